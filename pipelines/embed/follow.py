#!/usr/bin/env python3
# SPDX-License-Identifier: MPL-2.0
"""ptztrack inside a Python program: prints what happens to the target until Ctrl-C, SIGTERM or SIGHUP.

Where the picture is gone, as when the camera reboots, it starts anew until it is back.

    GST_PLUGIN_PATH=target/release pipelines/embed/follow.py http://192.168.0.90 [USER]

The password comes from the environment variable CAMERA_PASSWORD, so that no list of processes shows it.
"""

import os
import signal
import socket
import sys
import time
from urllib.parse import urlsplit

import gi

gi.require_version("Gst", "1.0")
from gi.repository import GLib, Gst  # noqa: E402

PIPELINE = """
    souphttpsrc name=source is-live=true do-timestamp=true timeout=1 retries=0 ! multipartdemux ! jpegdec
    ! queue leaky=downstream max-size-buffers=1 ! bgavgdetect ! lkfeaturetrack name=tracker ! vapixptzsink name=servo
"""


# Seconds between two starts, doubled while they come to nothing.
PAUSES = (0.1, 0.4)
# A pipeline that ran for so many seconds had a picture.
WELL = 5


class Follower:
    """Plays one pipeline after the other until it is told to end."""

    def __init__(self, camera, user):
        self.camera, self.user = camera, user
        self.loop = GLib.MainLoop()
        self.pipeline = None
        self.ending = False
        self.hopeless = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, number, self.end)

    def build(self):
        pipeline = Gst.parse_launch(PIPELINE)
        source, servo = pipeline.get_by_name("source"), pipeline.get_by_name("servo")
        source.set_property("location", f"{self.camera}/axis-cgi/mjpg/video.cgi")
        servo.set_property("location", self.camera)
        if self.user:
            password = os.environ.get("CAMERA_PASSWORD", "")
            source.set_property("user-id", self.user)
            source.set_property("user-pw", password)
            servo.set_property("user", self.user)
            servo.set_property("password", password)
        return pipeline

    def run(self):
        pause = PAUSES[0]
        while not self.ending and not self.hopeless:
            begin = time.monotonic()
            if self.answers():
                self.play()
            if time.monotonic() - begin > WELL:
                pause = PAUSES[0]
            if not self.ending and not self.hopeless:
                GLib.timeout_add(int(pause * 1000), self.loop.quit)
                self.loop.run()
            pause = min(2 * pause, PAUSES[1])
        return 1 if self.hopeless else 0

    def answers(self):
        """Whether the camera, or its proxy, accepts a connection: where not, each try of souphttpsrc would cost a descriptor."""
        address = os.environ.get("http_proxy") or self.camera
        url = urlsplit(address if "://" in address else f"http://{address}")
        try:
            socket.create_connection((url.hostname, url.port or {"https": 443}.get(url.scheme, 80)), timeout=1).close()
        except OSError as error:
            print(f"{url.hostname}: {error}", file=sys.stderr)
            return False
        return True

    def play(self):
        """Plays a pipeline to its end, whatever that is; the camera has stopped then."""
        self.pipeline = self.build()
        bus = self.pipeline.get_bus()
        bus.add_signal_watch()
        bus.connect("message", self.on_message)
        self.pipeline.set_state(Gst.State.PLAYING)
        try:
            self.loop.run()
        finally:
            bus.remove_signal_watch()
            self.pipeline.set_state(Gst.State.NULL)
            self.pipeline = None

    def end(self):
        """Ends the stream: the sink has stopped the camera when the end arrives."""
        self.ending = True
        if self.pipeline:
            self.pipeline.send_event(Gst.Event.new_eos())
            # Not for ever, where there is nothing to end.
            GLib.timeout_add_seconds(10, self.loop.quit)
        else:
            self.loop.quit()
        return GLib.SOURCE_CONTINUE

    def on_message(self, _bus, message):
        if message.type == Gst.MessageType.ERROR:
            error, _ = message.parse_error()
            print(f"{message.src.get_name()}: {error.message}", file=sys.stderr)
            # To try a wrong password again and again could lock the account.
            self.hopeless = error.matches(Gst.ResourceError.quark(), Gst.ResourceError.NOT_AUTHORIZED)
            self.loop.quit()
        elif message.type == Gst.MessageType.EOS:
            self.loop.quit()
        elif message.has_name("ptztrack-target"):
            target = message.get_structure()
            print(f"target {target.get_value('id')} {target.get_string('change')}", flush=True)


def main(camera, user=""):
    Gst.init(None)
    return Follower(camera, user).run()


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
