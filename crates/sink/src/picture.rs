// SPDX-License-Identifier: MPL-2.0

//! What the caps say of the picture.

use ptztrack_contract::{TargetMeta, aspect};

/// Size and shape of the picture, whatever memory it lies in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Width by height as displayed.
    pub aspect: f64,
}

impl Picture {
    /// Reads caps; `None` where they tell no size.
    pub fn of(caps: &gst::Caps) -> Option<Self> {
        let structure = caps.structure(0)?;
        let pixels = |field| structure.get::<i32>(field).ok().and_then(|size| u32::try_from(size).ok());
        let size = (pixels("width")?, pixels("height")?);
        let pixel = structure.get::<gst::Fraction>("pixel-aspect-ratio").unwrap_or(gst::Fraction::new(1, 1));
        Some(Self { size, aspect: aspect(size, pixel.into())? })
    }

    /// Whether this may be the picture in which a target was found: of the same shape, as scaling leaves it.
    pub fn shows(&self, target: &TargetMeta) -> bool {
        // As much as rounding to whole, even pixels does to a small picture.
        const TOLERANCE: f64 = 0.03;
        target.aspect.is_none_or(|aspect| (self.aspect / aspect).ln().abs() < TOLERANCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(caps: gst::caps::Builder<gst::caps::NoFeature>) -> Option<Picture> {
        Picture::of(&caps.build())
    }

    #[test]
    fn pixels_need_not_be_square() {
        gst::init().unwrap();
        let caps = || gst::Caps::builder("video/x-raw").field("width", 720).field("height", 576);
        assert_eq!(picture(caps()), Some(Picture { size: (720, 576), aspect: 1.25 }));
        let wide = caps().field("pixel-aspect-ratio", gst::Fraction::new(64, 45));
        assert!((picture(wide).unwrap().aspect - 16.0 / 9.0).abs() < 1e-9);
    }

    #[test]
    fn a_scaled_picture_shows_the_target_and_a_cropped_one_does_not() {
        gst::init().unwrap();
        let found_in = |aspect| TargetMeta { aspect, ..TargetMeta::default() };
        let caps =
            |width, height| gst::Caps::builder("video/x-raw").field("width", width).field("height", height);
        for (width, height, shows) in
            [(1280, 720, true), (400, 226, true), (960, 720, false), (1280, 960, false)]
        {
            let picture = picture(caps(width, height)).unwrap();
            assert_eq!(picture.shows(&found_in(Some(16.0 / 9.0))), shows, "{width}x{height}");
            assert!(picture.shows(&found_in(None)), "of a tracker that does not tell");
        }
    }

    #[test]
    fn caps_without_a_size_are_refused() {
        gst::init().unwrap();
        let caps = || gst::Caps::builder("video/x-raw");
        assert_eq!(picture(caps()), None);
        assert_eq!(picture(caps().field("width", 320).field("height", 0)), None);
        assert_eq!(picture(caps().field("width", -320).field("height", 240)), None);
    }
}
