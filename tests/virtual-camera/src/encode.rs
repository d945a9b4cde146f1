// SPDX-License-Identifier: MPL-2.0

//! JPEG, through GStreamer.

use gst::prelude::*;

use crate::picture::{Picture, video_info};

const PATIENCE: gst::ClockTime = gst::ClockTime::from_seconds(5);

/// Why a picture became no JPEG.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// GStreamer refuses.
    #[error("cannot encode: {0}")]
    Pipeline(#[from] glib::Error),
    /// Something of it is missing.
    #[error("cannot encode: {0}")]
    Missing(#[from] glib::BoolError),
    /// Nothing came out.
    #[error("the JPEG encoder gives nothing")]
    Nothing,
}

/// Makes JPEGs of pictures of one size.
pub(crate) struct JpegEncoder {
    pipeline: gst::Pipeline,
    source: gst_app::AppSrc,
    sink: gst_app::AppSink,
    info: gst_video::VideoInfo,
}

impl JpegEncoder {
    /// For pictures of `size`; `compression` is VAPIX', 0 (best) to 100.
    pub fn new(size: (u32, u32), compression: u32) -> Result<Self, EncodeError> {
        let info = video_info(size, 25.0)?;
        let quality = 100 - compression.min(99) as i32;
        let source = gst_app::AppSrc::builder().caps(&info.to_caps()?).format(gst::Format::Time).build();
        let encoder = gst::ElementFactory::make("jpegenc").property("quality", quality).build()?;
        let sink = gst_app::AppSink::builder().sync(false).build();
        let pipeline = gst::Pipeline::new();
        pipeline.add_many([source.upcast_ref(), &encoder, sink.upcast_ref()])?;
        gst::Element::link_many([source.upcast_ref(), &encoder, sink.upcast_ref()])?;
        let jpeg = Self { pipeline, source, sink, info };
        jpeg.pipeline.set_state(gst::State::Playing).map_err(|_| EncodeError::Nothing)?;
        Ok(jpeg)
    }

    pub fn encode(&self, picture: &Picture) -> Result<Vec<u8>, EncodeError> {
        let mut buffer = picture.to_buffer(&self.info).ok_or(EncodeError::Nothing)?;
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(gst::ClockTime::ZERO);
        }
        self.source.push_buffer(buffer).map_err(|_| EncodeError::Nothing)?;
        let sample = self.sink.try_pull_sample(PATIENCE).ok_or(EncodeError::Nothing)?;
        let map =
            sample.buffer().and_then(|buffer| buffer.map_readable().ok()).ok_or(EncodeError::Nothing)?;
        Ok(map.to_vec())
    }
}

impl Drop for JpegEncoder {
    fn drop(&mut self) {
        // Going to NULL cannot fail in a way that leaves anything to do.
        let _ = self.pipeline.set_state(gst::State::Null);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn makes_jpegs_and_smaller_ones_under_compression() {
        gst::init().unwrap();
        let mut picture = Picture::grey(64, 48, 0);
        for (index, pixel) in picture.planes[0].data.iter_mut().enumerate() {
            *pixel = (index * index % 251) as u8;
        }
        let fine = JpegEncoder::new((64, 48), 0).unwrap();
        let coarse = JpegEncoder::new((64, 48), 90).unwrap();
        for _ in 0..3 {
            let (fine, coarse) = (fine.encode(&picture).unwrap(), coarse.encode(&picture).unwrap());
            assert_eq!((&fine[..2], &coarse[..2]), (&[0xff, 0xd8][..], &[0xff, 0xd8][..]));
            assert!(coarse.len() * 2 < fine.len());
        }
    }
}
