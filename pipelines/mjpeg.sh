#!/bin/bash
# SPDX-License-Identifier: MPL-2.0
# Follows with an Axis PTZ camera by MJPEG over HTTP, and shows the picture.
. "$(dirname "$0")/common.sh"

launch "${mjpeg[@]}" ! "${follow[@]}" ! tee name=followed \
    followed. ! "${show[@]}" \
    followed. ! "${newest[@]}" ! "${steer[@]}"
