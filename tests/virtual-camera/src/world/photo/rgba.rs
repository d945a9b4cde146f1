// SPDX-License-Identifier: MPL-2.0

//! A picture from a file.

use std::path::Path;

use gst::prelude::*;

use super::settings::PhotoError;
use crate::world::footage::{decoder, reason, starts, stop};

/// Pixels with their opacity, row by row.
pub(super) struct Rgba {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[u8; 4]>,
}

impl Rgba {
    /// Reads it, in whatever format GStreamer knows.
    pub fn read(path: &Path) -> Result<Self, PhotoError> {
        std::fs::File::open(path).map_err(|source| PhotoError::Unreadable { path: path.into(), source })?;
        let undecodable = |reason: String| PhotoError::Undecodable { path: path.into(), reason };
        let pipeline = decoder(path, "RGBA").map_err(|error| undecodable(error.to_string()))?;
        let sink = pipeline.by_name("sink").and_downcast::<gst_app::AppSink>().filter(|_| starts(&pipeline));
        let sample = sink.and_then(|sink| sink.pull_preroll().ok());
        let read = sample.as_ref().and_then(Self::of).ok_or_else(|| undecodable(reason(&pipeline)));
        stop(&pipeline);
        read
    }

    fn of(sample: &gst::Sample) -> Option<Self> {
        let info = gst_video::VideoInfo::from_caps(sample.caps()?).ok()?;
        let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(sample.buffer()?, &info).ok()?;
        let (width, height) = (info.width() as usize, info.height() as usize);
        let stride = usize::try_from(*info.stride().first()?).ok()?;
        let rows = frame.plane_data(0).ok()?.chunks(stride).take(height);
        let pixels: Vec<[u8; 4]> =
            rows.flat_map(|row| row.as_chunks().0.iter().copied().take(width)).collect();
        (pixels.len() == width * height).then_some(Self { width, height, pixels })
    }
}
