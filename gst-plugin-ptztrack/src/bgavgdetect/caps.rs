// SPDX-License-Identifier: MPL-2.0

use gst_video::VideoFormat;

use super::Output;
use crate::luma_source::FORMATS;

impl Output {
    /// The format that leaves; `None`: the one that came.
    pub(super) fn format(self) -> Option<VideoFormat> {
        match self {
            Self::Frame => None,
            Self::Mask => Some(VideoFormat::Gray8),
            Self::Foreground => Some(VideoFormat::Rgba),
        }
    }
}

/// What may stand at the other pad when `caps` stand at the pad of that direction.
pub(super) fn transformed(caps: &gst::Caps, direction: gst::PadDirection, output: Output) -> gst::Caps {
    let Some(format) = output.format() else { return caps.clone() };
    let formats = FORMATS.iter().map(|format| format.to_str());
    let mut caps = caps.clone();
    for structure in caps.make_mut().iter_mut() {
        if direction == gst::PadDirection::Sink {
            structure.set("format", format.to_str());
        } else {
            structure.set("format", gst::List::new(formats.clone()));
        }
        // These describe the colours of the format that is replaced.
        structure.remove_fields(["colorimetry", "chroma-site"]);
    }
    caps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn caps(text: &str) -> gst::Caps {
        gst::init().unwrap();
        text.parse().unwrap()
    }

    #[test]
    fn frames_keep_their_caps() {
        let came = caps("video/x-raw,format=NV12,width=3,height=5,colorimetry=bt709");
        assert_eq!(transformed(&came, gst::PadDirection::Sink, Output::Frame), came);
        assert_eq!(transformed(&came, gst::PadDirection::Src, Output::Frame), came);
    }

    #[test]
    fn mask_and_foreground_replace_the_format_only() {
        let came = caps("video/x-raw,format=NV12,width=3,height=5,framerate=7/1,colorimetry=bt709");
        let left = caps("video/x-raw,format=GRAY8,width=3,height=5,framerate=7/1");
        assert_eq!(transformed(&came, gst::PadDirection::Sink, Output::Mask), left);
        let back = transformed(&left, gst::PadDirection::Src, Output::Foreground);
        for format in FORMATS {
            let any = caps(&format!("video/x-raw,format={format},width=3,height=5,framerate=7/1"));
            assert!(any.is_subset(&back), "{format}");
        }
    }
}
