#!/bin/bash
# Follows with an Axis PTZ camera and records the picture with what was seen drawn in.
#
#   OUT              the recording, Matroska with H.264              (default: followed.mkv)
. "$(dirname "$0")/common.sh"

launch "${mjpeg[@]}" ! "${follow[@]}" ! tee name=followed \
    followed. ! queue ! ptzoverlay ! videoconvert ! x264enc tune=zerolatency speed-preset=superfast \
        ! h264parse ! matroskamux ! filesink "location=${OUT:-followed.mkv}" \
    followed. ! "${newest[@]}" ! "${steer[@]}"
