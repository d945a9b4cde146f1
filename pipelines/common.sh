# What the pipelines share; each sources it. Settings come from environment variables:
#
#   CAMERA           address of the camera, e.g. http://192.168.0.90 (required; https:// works too)
#   CAMERA_USER      account with operator rights                    (default: none)
#   CAMERA_PASSWORD  its password                                    (default: none)
#   RTSP             address of the camera's RTSP server             (default: rtsp://<host of CAMERA>:554)
#   SIZE             size of the picture                             (default: 640x480; RTSP: the camera's own)
#   FPS              frames per second                               (default: 15; RTSP: the camera's own)
#   VIDEO_SINK       element that shows the picture                  (default: autovideosink, fakesink without display)
#
# gst-launch-1.0 takes passwords as arguments, which other users of the same machine can read in the
# list of processes. Where that matters, build the pipeline in a program (see embed/), or use an account that
# may do nothing but watch and steer this camera.
set -eu

repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Installed plugins are found by GStreamer itself, those just built are not.
if [ -z "${GST_PLUGIN_PATH:-}" ] && [ -e "$repository/target/release/libgstptztrack.so" ]; then
    export GST_PLUGIN_PATH="$repository/target/release"
fi

if [ -z "${CAMERA:-}" ]; then
    # The comment at the top of the pipeline's file, and the one above.
    for file in "$0" "${BASH_SOURCE[0]}"; do
        sed -n '/^#!/d; /^#/!q; s/^# \{0,1\}//p' "$file" >&2
        echo >&2
    done
    echo "CAMERA is not set." >&2
    exit 2
fi

CAMERA=${CAMERA%/}
host=${CAMERA#*://}
RTSP=${RTSP:-rtsp://${host%%:*}:554}
RTSP=${RTSP%/}
if [ -z "${VIDEO_SINK:-}" ]; then
    if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then VIDEO_SINK=autovideosink; else VIDEO_SINK=fakesink; fi
fi

# Between the camera and the elements that think: whatever they cannot keep up with is dropped here, oldest first.
newest=(queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0)

# Pictures by MJPEG over HTTP: least delay, most bandwidth.
mjpeg=(
    souphttpsrc is-live=true do-timestamp=true
    "location=$CAMERA/axis-cgi/mjpg/video.cgi?resolution=${SIZE:-640x480}&fps=${FPS:-15}&compression=30"
)
if [ -n "${CAMERA_USER:-}" ]; then
    mjpeg+=("user-id=$CAMERA_USER" "user-pw=${CAMERA_PASSWORD:-}")
fi
mjpeg+=(! multipartdemux ! jpegdec)

# rtsp CODEC: pictures by RTSP in the codec (mpeg4 or h264), still encoded.
rtsp() {
    local location="$RTSP/axis-media/media.amp?videocodec=$1"
    location+="${SIZE:+&resolution=$SIZE}${FPS:+&fps=$FPS}"
    stream=(rtspsrc "location=$location" latency=0 protocols=tcp)
    if [ -n "${CAMERA_USER:-}" ]; then
        stream+=("user-id=$CAMERA_USER" "user-pw=${CAMERA_PASSWORD:-}")
    fi
}

# Finds, follows, and hands on what it saw.
follow=("${newest[@]}" ! bgavgdetect ! lkfeaturetrack)

# Moves the camera.
steer=(vapixptzsink "location=$CAMERA")
if [ -n "${CAMERA_USER:-}" ]; then
    steer+=("user=$CAMERA_USER" "password=${CAMERA_PASSWORD:-}")
fi

# Draws, and shows each picture as soon as it is there.
show=("${newest[@]}" ! ptzoverlay ! videoconvert ! "$VIDEO_SINK" sync=false)

# launch PIPELINE...: runs it, messages printed, until Ctrl-C, which ends the stream (-e), so that files are
# complete and the camera has stopped.
launch() {
    exec gst-launch-1.0 -e -m "$@"
}
