#!/usr/bin/env python3
# SPDX-License-Identifier: MPL-2.0
"""The demonstration: a virtual camera in front of real footage or in a room, its person followed by plain gst-launch-1.0.

Leaves in --out: followed.mkv (what the camera saw, with what was seen drawn in), plot.png (offset, pan and
tilt over time), samples.csv (what the plot shows) and summary.json. Ends with 0 only where somebody was
followed and the camera stands still afterwards.
"""

import argparse
import os
import pathlib
import shlex
import signal
import subprocess
import sys
import threading
import time

import report
from camera import VirtualCamera
from messages import Progress, parse

CODECS = {
    "mjpeg": "souphttpsrc name=source is-live=true do-timestamp=true location={http}/axis-cgi/mjpg/video.cgi "
    "user-id={user} user-pw={password} ! multipartdemux ! jpegdec",
    "mpeg4": "rtspsrc name=source latency=0 protocols=tcp location={rtsp}/axis-media/media.amp?videocodec=mpeg4 "
    "user-id={user} user-pw={password} ! rtpmp4vdepay ! avdec_mpeg4",
    "h264": "rtspsrc name=source latency=0 protocols=tcp location={rtsp}/axis-media/media.amp?videocodec=h264 "
    "user-id={user} user-pw={password} ! rtph264depay ! avdec_h264",
}
NEWEST = "queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0"
# Every fifth of a second a message says where the target is, every second one how many frames passed.
FOLLOW = (
    f"{NEWEST} ! bgavgdetect ! lkfeaturetrack message-interval=200000000 "
    "! progressreport name=frames format=buffers do-query=false silent=true update-freq=1 ! tee name=followed"
)
STEER = f"followed. ! {NEWEST} ! vapixptzsink location={{http}} user={{user}} password={{password}}"
DRAW = "followed. ! queue leaky=downstream ! ptzoverlay ! videoconvert ! tee name=drawn"
RECORD = (
    "drawn. ! queue ! x264enc tune=zerolatency speed-preset=superfast key-int-max=50 ! h264parse "
    "! matroskamux ! filesink location={out}/followed.mkv"
)
# How many seconds the first picture may take: where GStreamer was never run before, it looks through its plugins first.
PATIENCE = 60.0
SHOW = "drawn. ! queue leaky=downstream ! videoconvert ! autovideosink sync=false"


def world_options(arguments):
    """What the camera looks at, as options of its program."""
    if arguments.footage:
        return ["--footage", arguments.footage]
    return ["--world", "room", "--room-test", arguments.room_test, "--seed", arguments.seed]


def pipeline(camera, codec, out):
    """The arguments of gst-launch-1.0."""
    parts = [CODECS[codec] + " ! " + FOLLOW, STEER, DRAW, RECORD]
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        parts.append(SHOW)
    text = " ".join(parts).format(
        http=camera.http, rtsp=camera.rtsp, user=camera.user, password=camera.password, out=out
    )
    return ["gst-launch-1.0", "-e", "-m", *shlex.split(text)]


def follow(camera, command, duration):
    """Runs the pipeline, for `duration` seconds from its first pictures on, and returns what happened."""
    progress = Progress()
    give_up = time.monotonic() + PATIENCE
    launch = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    )
    try:
        reader = threading.Thread(target=read_messages, args=(launch.stdout, progress), daemon=True)
        reader.start()
        while launch.poll() is None and progress.seconds() < duration:
            if progress.started is None and time.monotonic() > give_up:
                print(f"no picture came within {PATIENCE:.0f} s", file=sys.stderr)
                break
            progress.sample(*camera.report())
            time.sleep(0.1)
        # Ctrl-C ends the stream (-e): the recording is completed and the camera told to stop.
        if launch.poll() is None:
            launch.send_signal(signal.SIGINT)
        launch.wait(timeout=30)
        reader.join(timeout=5)
    finally:
        if launch.poll() is None:
            launch.kill()
            launch.wait()
    progress.exit_code = launch.returncode
    return progress


def read_messages(lines, progress):
    for line in lines:
        message = parse(line)
        if message is None:
            if "ERROR" in line or "WARNING" in line:
                print(line.rstrip(), file=sys.stderr)
            continue
        text = progress.take(message)
        if text:
            print(text, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--camera", required=True, help="the program virtual-camera")
    world = parser.add_mutually_exclusive_group(required=True)
    world.add_argument("--footage", help="a recording by a camera that stood still")
    world.add_argument("--room-test", metavar="NUMBER", help="a made-up room, as in this of the thesis' tests (1 to 72)")
    parser.add_argument("--seed", default="1", help="of the room; 1 is the reference world")
    parser.add_argument("--codec", choices=CODECS, default="mjpeg")
    parser.add_argument("--duration", type=float, default=60.0, help="seconds")
    parser.add_argument("--out", default="target/demo", type=pathlib.Path)
    arguments = parser.parse_args()
    arguments.world = world_options(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    # A terminated demonstration cleans up like an interrupted one.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))

    with VirtualCamera(arguments.camera, arguments.world, arguments.out / "camera.log") as camera:
        print(f"The camera: {camera.http}/ (open it to look and steer by hand), {camera.rtsp}")
        command = pipeline(camera, arguments.codec, arguments.out)
        print(shlex.join(command), "\n", flush=True)
        progress = follow(camera, command, arguments.duration)
        at_rest = camera.comes_to_rest()
        status, _ = camera.report()

    summary = report.summarise(progress, status, at_rest, arguments)
    report.write(progress, summary, arguments.out)
    print(report.in_words(summary), f"\nEverything is in {arguments.out}/", sep="")
    return 0 if summary["passed"] else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
