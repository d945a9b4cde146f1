#!/bin/bash
# SPDX-License-Identifier: MPL-2.0
# Follows with a PTZ camera of any make by ONVIF and H.264 over RTSP, and shows the picture.
#
#   STREAM           address of its stream, as its manual or its own pages have it, e.g.
#                    rtsp://192.168.0.90/Streaming/Channels/102  (default: that of an Axis camera)
. "$(dirname "$0")/common.sh"

rtsp h264
if [ -n "${STREAM:-}" ]; then stream[1]="location=$STREAM"; fi
steer[0]=onvifptzsink
launch "${stream[@]}" ! rtph264depay ! avdec_h264 ! "${follow[@]}" ! tee name=followed \
    followed. ! "${show[@]}" \
    followed. ! "${newest[@]}" ! "${steer[@]}"
