// SPDX-License-Identifier: MPL-2.0

//! A picture in memory: planar YUV 4:2:0, as decoders give it and encoders take it.

/// One 8-bit plane without padding.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row after row.
    pub data: Vec<u8>,
}

impl Plane {
    /// A plane of one value.
    pub fn filled(width: usize, height: usize, value: u8) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }
}

/// An I420 picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Y, U, V; the latter two at half the resolution, rounded up.
    pub planes: [Plane; 3],
}

impl Picture {
    /// A grey picture of that size.
    pub fn grey(width: u32, height: u32, luma: u8) -> Self {
        let (width, height) = (width as usize, height as usize);
        let chroma = Plane::filled(width.div_ceil(2), height.div_ceil(2), 128);
        Self { planes: [Plane::filled(width, height, luma), chroma.clone(), chroma] }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.planes[0].width as u32, self.planes[0].height as u32)
    }

    /// Copies a decoded I420 buffer.
    pub fn from_buffer(buffer: &gst::BufferRef, info: &gst_video::VideoInfo) -> Option<Self> {
        let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(buffer, info).ok()?;
        let mut picture = Self::grey(info.width(), info.height(), 0);
        for (index, plane) in picture.planes.iter_mut().enumerate() {
            let stride = usize::try_from(*info.stride().get(index)?).ok()?;
            let source = frame.plane_data(index as u32).ok()?;
            for (row, line) in plane.data.chunks_exact_mut(plane.width).enumerate() {
                line.copy_from_slice(source.get(row * stride..row * stride + plane.width)?);
            }
        }
        Some(picture)
    }

    /// A buffer for a pipeline whose caps are `info`.
    pub fn to_buffer(&self, info: &gst_video::VideoInfo) -> Option<gst::Buffer> {
        let mut buffer = gst::Buffer::with_size(info.size()).ok()?;
        let mut frame = gst_video::VideoFrameRef::from_buffer_ref_writable(buffer.get_mut()?, info).ok()?;
        for (index, plane) in self.planes.iter().enumerate() {
            let stride = usize::try_from(*info.stride().get(index)?).ok()?;
            let target = frame.plane_data_mut(index as u32).ok()?;
            for (row, line) in plane.data.chunks_exact(plane.width).enumerate() {
                target.get_mut(row * stride..row * stride + plane.width)?.copy_from_slice(line);
            }
        }
        drop(frame);
        Some(buffer)
    }
}

/// The format in which pictures go through pipelines.
pub fn video_info(size: (u32, u32), frame_rate: f64) -> Result<gst_video::VideoInfo, glib::BoolError> {
    let rate = gst::Fraction::approximate_f64(frame_rate).unwrap_or(gst::Fraction::new(25, 1));
    gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, size.0, size.1)
        .fps(rate)
        .par(gst::Fraction::new(1, 1))
        .build()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goes_into_a_buffer_and_back_whatever_the_stride() {
        gst::init().unwrap();
        for size in [(64, 48), (33, 17)] {
            let info = video_info(size, 10.0).unwrap();
            let mut picture = Picture::grey(size.0, size.1, 0);
            for plane in &mut picture.planes {
                for (index, pixel) in plane.data.iter_mut().enumerate() {
                    *pixel = (index * 7) as u8;
                }
            }
            let buffer = picture.to_buffer(&info).unwrap();
            assert_eq!(Picture::from_buffer(&buffer, &info).unwrap(), picture);
        }
    }
}
