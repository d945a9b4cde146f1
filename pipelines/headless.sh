#!/bin/bash
# SPDX-License-Identifier: MPL-2.0
# Follows with an Axis PTZ camera and shows nothing: for a machine without display. Messages say what happens.
. "$(dirname "$0")/common.sh"

launch "${mjpeg[@]}" ! "${follow[@]}" ! "${steer[@]}"
