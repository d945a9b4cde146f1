#!/bin/bash
# SPDX-License-Identifier: MPL-2.0
# Follows with an Axis PTZ camera by MPEG-4 over RTSP, and shows the picture.
. "$(dirname "$0")/common.sh"

rtsp mpeg4
launch "${stream[@]}" ! rtpmp4vdepay ! avdec_mpeg4 ! "${follow[@]}" ! tee name=followed \
    followed. ! "${show[@]}" \
    followed. ! "${newest[@]}" ! "${steer[@]}"
