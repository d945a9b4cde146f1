#!/usr/bin/env python3
"""ptztrack inside a Python program: prints what happens to the target until Ctrl-C.

    GST_PLUGIN_PATH=target/release pipelines/embed/follow.py http://192.168.0.90 [USER]

The password comes from the environment variable CAMERA_PASSWORD, so that no list of processes shows it.
"""

import os
import signal
import sys

import gi

gi.require_version("Gst", "1.0")
from gi.repository import GLib, Gst  # noqa: E402

PIPELINE = """
    souphttpsrc name=source is-live=true do-timestamp=true ! multipartdemux ! jpegdec
    ! queue leaky=downstream max-size-buffers=1 ! bgavgdetect ! lkfeaturetrack name=tracker ! vapixptzsink name=servo
"""


def on_message(_bus, message, loop):
    if message.type == Gst.MessageType.ERROR:
        error, _ = message.parse_error()
        print(f"{message.src.get_name()}: {error.message}", file=sys.stderr)
        loop.quit()
    elif message.type == Gst.MessageType.EOS:
        loop.quit()
    elif message.has_name("ptztrack-target"):
        target = message.get_structure()
        print(f"target {target.get_value('id')} {target.get_string('change')}", flush=True)


def main(camera, user=""):
    Gst.init(None)
    password = os.environ.get("CAMERA_PASSWORD", "")
    pipeline = Gst.parse_launch(PIPELINE)
    source, servo = pipeline.get_by_name("source"), pipeline.get_by_name("servo")
    source.set_property("location", f"{camera}/axis-cgi/mjpg/video.cgi")
    servo.set_property("location", camera)
    if user:
        source.set_property("user-id", user)
        source.set_property("user-pw", password)
        servo.set_property("user", user)
        servo.set_property("password", password)

    loop = GLib.MainLoop()
    bus = pipeline.get_bus()
    bus.add_signal_watch()
    bus.connect("message", on_message, loop)
    # Ctrl-C ends the stream; the sink has stopped the camera when the end arrives.
    GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, signal.SIGINT, pipeline.send_event, Gst.Event.new_eos())
    pipeline.set_state(Gst.State.PLAYING)
    try:
        loop.run()
    finally:
        pipeline.set_state(Gst.State.NULL)


if __name__ == "__main__":
    main(*sys.argv[1:])
