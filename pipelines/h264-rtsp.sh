#!/bin/bash
# SPDX-License-Identifier: MPL-2.0
# Follows with an Axis PTZ camera by H.264 over RTSP, and shows the picture.
. "$(dirname "$0")/common.sh"

rtsp h264
launch "${stream[@]}" ! rtph264depay ! avdec_h264 ! "${follow[@]}" ! tee name=followed \
    followed. ! "${show[@]}" \
    followed. ! "${newest[@]}" ! "${steer[@]}"
