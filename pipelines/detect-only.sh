#!/bin/bash
# SPDX-License-Identifier: MPL-2.0
# Watches with any Axis camera, PTZ or not, and prints a message whenever motion starts and ends.
# Nothing is followed and the camera is not moved.
. "$(dirname "$0")/common.sh"

launch "${mjpeg[@]}" ! "${newest[@]}" ! bgavgdetect ! fakesink sync=false
