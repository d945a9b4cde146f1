# SPDX-License-Identifier: MPL-2.0
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
# Ctrl-C, SIGTERM and SIGHUP end the stream and stop the camera. Where the picture ends for any other reason, the pipeline is
# started anew until it is back: about twice a second, or where nothing is heard of the camera at all after 1 s (RTSP: 1.2 s) each.
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

# Anything else is no address, and no new start would make it one.
case ${CAMERA,,} in
http://?* | https://?*) ;;
*)
    echo "CAMERA needs http:// or https:// before the host, as http://192.168.0.90." >&2
    exit 2
    ;;
esac

CAMERA=${CAMERA%/}
host=${CAMERA#*://}
host=${host%%/*}
case $host in
*\]*) host=${host%]*}] ;; # IPv6: [::1]:80
*) host=${host%%:*} ;;
esac
RTSP=${RTSP:-rtsp://$host:554}
RTSP=${RTSP%/}
for address in "$RTSP" "${STREAM:-rtsp://}"; do
    case ${address,,} in
    rtsp://* | rtsps://*) ;;
    *)
        echo "$address is no address of RTSP: it begins with rtsp:// or rtsps://." >&2
        exit 2
        ;;
    esac
done
if [ -z "${VIDEO_SINK:-}" ]; then
    if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then VIDEO_SINK=autovideosink; else VIDEO_SINK=fakesink; fi
fi

# Between the camera and the elements that think: whatever they cannot keep up with is dropped here, oldest first.
newest=(queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0)

# Pictures by MJPEG over HTTP: least delay, most bandwidth.
mjpeg=(
    souphttpsrc is-live=true do-timestamp=true
    # A camera that reboots does not say goodbye; seconds.
    timeout=1 retries=0
    "location=$CAMERA/axis-cgi/mjpg/video.cgi?resolution=${SIZE:-640x480}&fps=${FPS:-15}&compression=30"
)
if [ -n "${CAMERA_USER:-}" ]; then mjpeg+=("user-id=$CAMERA_USER"); fi
mjpeg+=(! multipartdemux ! jpegdec)

# rtsp CODEC: pictures by RTSP in the codec (mpeg4 or h264), still encoded.
rtsp() {
    local location="$RTSP/axis-media/media.amp?videocodec=$1"
    location+="${SIZE:+&resolution=$SIZE}${FPS:+&fps=$FPS}"
    stream=(rtspsrc "location=$location" latency=0 protocols=tcp)
    if [ -n "${CAMERA_USER:-}" ]; then stream+=("user-id=$CAMERA_USER"); fi
    # Milliseconds until the first packet, and between two. In a branch of its own, as any event resets a watchdog, and those that
    # the servo sends upstream come without packets too.
    stream+=(! tee name=received received. ! watchdog timeout=1200 ! fakesink sync=false async=false received.)
}

# Finds, follows, and hands on what it saw.
follow=("${newest[@]}" ! bgavgdetect ! lkfeaturetrack)

# Moves the camera.
steer=(vapixptzsink "location=$CAMERA")
if [ -n "${CAMERA_USER:-}" ]; then steer+=("user=$CAMERA_USER"); fi

# Draws, and shows each picture as soon as it is there.
show=("${newest[@]}" ! ptzoverlay ! videoconvert ! "$VIDEO_SINK" sync=false)

# launch PIPELINE...: runs it, messages printed, until it is told to end. {run} in it is nothing the first time, then -2, -3 and so
# on. Elements with a user get CAMERA_PASSWORD from the environment: arguments can be read in the list of processes.
launch() {
    local launcher="$repository/target/release/ptztrack-launch"
    launcher=$(command -v ptztrack-launch || echo "$launcher")
    [ -x "$launcher" ] || { echo "$launcher is not built: run \`make build\` first." >&2; exit 2; }
    exec "$launcher" "$@"
}
