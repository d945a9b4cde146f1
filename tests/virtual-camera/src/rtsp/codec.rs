// SPDX-License-Identifier: MPL-2.0

//! What travels over RTP.

use crate::wish::Wish;

/// `videocodec=`
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Codec {
    H264,
    H265,
    Mpeg4,
    Jpeg,
}

/// Sequence numbers and timestamps of RTP begin anywhere (RFC 3550, 5.1), and begin anew once in hours: here after some dozen
/// packets and a second, so that everybody who watches sees it.
const WRAPS_SOON: &str = "seqnum-offset=65500 timestamp-offset=4294877296";

impl Codec {
    pub fn parse(name: &str) -> Option<Self> {
        match name {
            "h264" => Some(Self::H264),
            "h265" => Some(Self::H265),
            "mpeg4" => Some(Self::Mpeg4),
            "jpeg" => Some(Self::Jpeg),
            _ => None,
        }
    }

    /// A bin that takes pictures in at `video` and gives RTP.
    pub fn launch(self, wish: &Wish) -> String {
        let encoder = match self {
            Self::H264 => format!(
                "x264enc tune=zerolatency sliced-threads=false threads=1 speed-preset=ultrafast key-int-max={} bitrate={} \
                 ! video/x-h264,profile={} ! rtph264pay config-interval=-1 pt=96",
                Self::key_interval(wish),
                Self::bits_per_second(wish) / 1000,
                wish.h264_profile
            ),
            Self::H265 => format!(
                "x265enc tune=zerolatency speed-preset=ultrafast key-int-max={} bitrate={} option-string=pools=1:frame-threads=1:log-level=error \
                 ! video/x-h265,profile=main ! rtph265pay config-interval=-1 pt=96",
                Self::key_interval(wish),
                Self::bits_per_second(wish) / 1000
            ),
            Self::Mpeg4 => format!(
                "avenc_mpeg4 name=encoder gop-size={} pass=quant quantizer={} ! rtpmp4vpay config-interval=1 pt=96",
                Self::key_interval(wish),
                quantizer(wish.compression)
            ),
            Self::Jpeg => format!("jpegenc quality={} ! rtpjpegpay pt=26", 100 - wish.compression.min(99)),
        };
        format!(
            "( appsrc name=video is-live=true format=time max-buffers=4 max-bytes=0 leaky-type=downstream \
             ! {encoder} name=pay0 {WRAPS_SOON} )"
        )
    }

    /// A key frame a second: who joins or loses a packet soon sees again.
    fn key_interval(wish: &Wish) -> u32 {
        wish.frame_rate.round().max(1.0) as u32
    }

    /// A fifth of a bit for a pixel at compression 0, a tenth at 50.
    fn bits_per_second(wish: &Wish) -> u64 {
        let pixels = f64::from(wish.size.0) * f64::from(wish.size.1) * wish.frame_rate;
        let share = (100.0 - f64::from(wish.compression.min(95))) / 100.0;
        (pixels * 0.2 * share).max(64_000.0) as u64
    }
}

/// MPEG-4's quantizer at a VAPIX compression: 2 (best) to 31.
fn quantizer(compression: u32) -> u32 {
    (2 + compression / 10 + compression.saturating_sub(50) / 3).min(31)
}
