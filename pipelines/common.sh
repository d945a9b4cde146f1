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
# started anew until it is back: about twice a second, or where nothing is heard of the camera at all after 1 s (RTSP: 2 s) each.
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
host=${host%%/*}
case $host in
*\]*) host=${host%]*}] ;; # IPv6: [::1]:80
*) host=${host%%:*} ;;
esac
RTSP=${RTSP:-rtsp://$host:554}
RTSP=${RTSP%/}
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
    # Milliseconds between two packets.
    stream+=(! watchdog timeout=2000)
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

# end: ends the stream (-e), so that files are complete and the camera has stopped; without mercy where that takes too long.
end() {
    ending=1
    [ -n "${player:-}" ] || return 0
    kill -INT "$player" 2>/dev/null || return 0
    set -m
    { sleep 10 && kill -KILL "$player"; } >/dev/null 2>&1 &
    mercy=$!
    set +m
}

# hopeless FILE: whether what was said in it will be said again at each start; a password must not be tried for ever.
hopeless() {
    grep --quiet --extended-regexp 'erroneous pipeline|Unauthorized|no element' "$1"
}

# launch PIPELINE...: runs it, messages printed, again and again until it is told to end. {run} in it is nothing the first
# time, then -2, -3 and so on.
launch() {
    local errors status run= runs=1 begun pause=1 ending= player= mercy=
    errors=$(mktemp)
    trap end INT TERM HUP
    while :; do
        begun=$SECONDS
        # In a process group of its own (-m): a terminal's Ctrl-C is for this script only.
        set -m
        gst-launch-1.0 -e -m "${@//\{run\}/$run}" 2> >(tee "$errors" >&2) </dev/null &
        player=$!
        set +m
        # A signal ends the wait, not the pipeline.
        while :; do
            wait "$player" && status=0 || status=$?
            kill -0 "$player" 2>/dev/null || break
        done
        player=
        [ -z "$ending" ] || break
        if hopeless "$errors"; then
            echo "Not started anew: that would end in the same way." >&2
            break
        fi
        # Tenths of a second, doubled while it comes to nothing.
        [ $((SECONDS - begun)) -lt 5 ] || pause=1
        echo "The picture is gone; starting anew." >&2
        sleep "0.$pause" || true
        [ -z "$ending" ] || break
        pause=$((pause < 4 ? pause * 2 : 4)) runs=$((runs + 1))
        run=-$runs
    done
    [ -z "$mercy" ] || kill -- "-$mercy" 2>/dev/null || true
    rm -f "$errors"
    exit "$status"
}
