#!/bin/bash
# SPDX-License-Identifier: MPL-2.0
# Follows with an Axis PTZ camera and records the picture with what was seen drawn in.
#
#   OUT              the recording, Matroska with H.264              (default: followed.mkv)
#
# When the picture was gone and is back, the recording goes on in followed-2.mkv, followed-3.mkv and so on.
. "$(dirname "$0")/common.sh"

out=${OUT:-followed.mkv}

launch "${mjpeg[@]}" ! "${follow[@]}" ! tee name=followed \
    followed. ! queue ! ptzoverlay ! videoconvert ! x264enc tune=zerolatency speed-preset=superfast \
        ! h264parse ! matroskamux ! filesink "location=${out%.*}{run}.${out##*.}" \
    followed. ! "${newest[@]}" ! "${steer[@]}"
