// SPDX-License-Identifier: MPL-2.0

//! What clients may ask of any picture.

use crate::{camera::Camera, encode::EncodeError, vapix::Args, world::FootageError};

/// Why a client gets no picture.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PictureError {
    #[error(transparent)]
    Footage(#[from] FootageError),
    #[error(transparent)]
    Encode(#[from] EncodeError),
    #[error("{name}: invalid value: {value}")]
    Argument { name: &'static str, value: String },
}

/// What a client asked a picture or a stream to be like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wish {
    pub size: (u32, u32),
    pub frame_rate: f64,
    pub compression: u32,
    pub h264_profile: &'static str,
}

impl Wish {
    /// The arguments `resolution`, `fps` (0 for as many as there are) and `compression`; the camera's own where absent.
    pub fn parse(args: &Args, camera: &Camera) -> Result<Self, PictureError> {
        let mut wish = Self {
            size: camera.world.view_size(),
            frame_rate: camera.frame_rate(),
            compression: camera.settings.video.compression,
            h264_profile: camera.settings.video.h264_profile,
        };
        if let Some(size) = argument(args, "resolution", parse_size)? {
            wish.size = size;
        }
        let frame_rate =
            argument(args, "fps", |text| text.parse().ok().filter(|fps| (0.0..=120.0).contains(fps)))?;
        if let Some(frame_rate) = frame_rate.filter(|&fps: &f64| fps > 0.0) {
            wish.frame_rate = frame_rate;
        }
        if let Some(compression) =
            argument(args, "compression", |text| text.parse().ok().filter(|&compression| compression <= 100))?
        {
            wish.compression = compression;
        }
        Ok(wish)
    }
}

/// The value of an argument; `None` where it is absent.
pub(crate) fn argument<T>(
    args: &Args,
    name: &'static str,
    parse: impl Fn(&str) -> Option<T>,
) -> Result<Option<T>, PictureError> {
    let Some((_, value)) = args.iter().find(|arg| arg.0 == name) else {
        return Ok(None);
    };
    parse(value).map(Some).ok_or_else(|| PictureError::Argument { name, value: value.clone() })
}

/// `640x480`, even and of a size that encoders take.
fn parse_size(text: &str) -> Option<(u32, u32)> {
    let (width, height) = text.split_once('x')?;
    let length =
        |text: &str| text.parse().ok().filter(|length| (32..=4096).contains(length) && length % 2 == 0);
    Some((length(width)?, length(height)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_even_and_bounded() {
        assert_eq!(parse_size("640x480"), Some((640, 480)));
        for nonsense in ["640", "640x", "x480", "641x480", "16x16", "8192x4096", "-640x480", "640x480x2"] {
            assert_eq!(parse_size(nonsense), None, "{nonsense}");
        }
    }
}
