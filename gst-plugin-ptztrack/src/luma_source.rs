// SPDX-License-Identifier: MPL-2.0

//! Reads the luma of any supported video frame.

use gst_video::VideoFormat;
use gst_video::prelude::*;
use opencv::core::{self, Mat};
use opencv::imgproc;
use opencv::prelude::*;

use crate::vision::{Chroma, Luma, LumaError, Picture, Samples};

/// Every format that [`LumaSource`] reads. Those that need no conversion stand first, as caps
/// negotiation prefers what stands first.
pub const FORMATS: &[VideoFormat] = &[
    VideoFormat::I420,
    VideoFormat::Nv12,
    VideoFormat::Gray8,
    VideoFormat::Yv12,
    VideoFormat::Nv21,
    VideoFormat::Y42b,
    VideoFormat::Y444,
    VideoFormat::Yuy2,
    VideoFormat::Uyvy,
    VideoFormat::Bgr,
    VideoFormat::Rgb,
    VideoFormat::Bgrx,
    VideoFormat::Rgbx,
    VideoFormat::Xbgr,
    VideoFormat::Xrgb,
    VideoFormat::Bgra,
    VideoFormat::Rgba,
    VideoFormat::Abgr,
    VideoFormat::Argb,
];

/// Raw video of every format in [`FORMATS`], of any size and frame rate (0/1, a variable one, too).
pub fn template_caps() -> gst::Caps {
    gst_video::VideoCapsBuilder::new().format_list(FORMATS.iter().copied()).build()
}

/// A frame whose luma cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LumaSourceError {
    /// Caps negotiation never lets one through.
    #[error("no luma in {0} frames")]
    Format(VideoFormat),
    /// The rows of the frame do not lie in ascending order.
    #[error("a stride of {0} bytes")]
    Stride(i32),
    /// The plane cannot be mapped.
    #[error(transparent)]
    Plane(#[from] glib::BoolError),
    /// The plane is smaller than its size says.
    #[error(transparent)]
    Luma(#[from] LumaError),
    /// The conversion failed.
    #[error(transparent)]
    Conversion(#[from] opencv::Error),
}

/// How the grey picture is obtained from plane 0.
#[derive(Debug, Clone, Copy)]
enum Access {
    /// It is the grey picture.
    InPlace,
    /// This channel of this many bytes a pixel.
    Channel { index: i32, bytes: usize },
    /// OpenCV's colour conversion of this many bytes a pixel.
    Colour { code: i32, bytes: usize },
    /// The weights of the four channels, for colours that OpenCV has no conversion for.
    Weighted([f32; 4]),
}

impl Access {
    /// Luma of RGB by ITU-R BT.601, full range, as OpenCV's own conversions have it.
    const RED: f32 = 0.299;
    const GREEN: f32 = 0.587;
    const BLUE: f32 = 0.114;

    fn of(format: VideoFormat) -> Option<Self> {
        use VideoFormat as F;
        Some(match format {
            F::Gray8 | F::I420 | F::Yv12 | F::Nv12 | F::Nv21 | F::Y42b | F::Y444 => Self::InPlace,
            F::Yuy2 => Self::Channel { index: 0, bytes: 2 },
            F::Uyvy => Self::Channel { index: 1, bytes: 2 },
            F::Rgb => Self::Colour { code: imgproc::COLOR_RGB2GRAY, bytes: 3 },
            F::Bgr => Self::Colour { code: imgproc::COLOR_BGR2GRAY, bytes: 3 },
            F::Rgbx | F::Rgba => Self::Colour { code: imgproc::COLOR_RGBA2GRAY, bytes: 4 },
            F::Bgrx | F::Bgra => Self::Colour { code: imgproc::COLOR_BGRA2GRAY, bytes: 4 },
            F::Xrgb | F::Argb => Self::Weighted([0.0, Self::RED, Self::GREEN, Self::BLUE]),
            F::Xbgr | F::Abgr => Self::Weighted([0.0, Self::BLUE, Self::GREEN, Self::RED]),
            _ => return None,
        })
    }

    fn bytes_per_pixel(self) -> usize {
        match self {
            Self::InPlace => 1,
            Self::Channel { bytes, .. } | Self::Colour { bytes, .. } => bytes,
            Self::Weighted(weights) => weights.len(),
        }
    }
}

/// Gives the luma of frames: planar and semi-planar formats as they lie in memory, others converted
/// once into memory that is kept for the next frame.
#[derive(Debug, Default)]
pub struct LumaSource {
    converted: Mat,
}

impl LumaSource {
    /// The luma of `frame`, which must be of one of [`FORMATS`]. RGB gives full-range BT.601 luma.
    pub fn luma<'a>(
        &'a mut self,
        frame: &'a gst_video::VideoFrameRef<&gst::BufferRef>,
    ) -> Result<Luma<'a>, LumaSourceError> {
        let access = Access::of(frame.format()).ok_or(LumaSourceError::Format(frame.format()))?;
        let stride = frame.plane_stride().first().copied().unwrap_or(0);
        let stride = usize::try_from(stride).map_err(|_| LumaSourceError::Stride(stride))?;
        let (width, height) = (frame.width() as usize, frame.height() as usize);
        let bytes = Luma::new(frame.plane_data(0)?, width * access.bytes_per_pixel(), height, stride)?;
        if matches!(access, Access::InPlace) {
            return Ok(bytes);
        }
        bytes.with_mat(|bytes| convert(bytes, access, &mut self.converted))?;
        Ok(Luma::new(self.converted.data_bytes()?, width, height, width)?)
    }
}

/// Luma of `frame` (see [`LumaSource::luma`]) and its colours as they lie in memory.
impl LumaSource {
    /// The picture in `frame`, which must be of one of [`FORMATS`].
    pub fn picture<'a>(
        &'a mut self,
        frame: &'a gst_video::VideoFrameRef<&gst::BufferRef>,
    ) -> Result<Picture<'a>, LumaSourceError> {
        let chroma = chroma(frame)?;
        Ok(Picture { luma: self.luma(frame)?, chroma })
    }
}

fn chroma<'a>(
    frame: &'a gst_video::VideoFrameRef<&gst::BufferRef>,
) -> Result<Option<Chroma<'a>>, LumaSourceError> {
    let component = |index: u32| {
        let stride = frame.comp_stride(index);
        let stride = usize::try_from(stride).map_err(|_| LumaSourceError::Stride(stride))?;
        let size = (frame.comp_width(index) as usize, frame.comp_height(index) as usize);
        let (first, step) = (frame.comp_poffset(index) as usize, frame.comp_pstride(index) as usize);
        Ok::<_, LumaSourceError>(Samples::new(
            frame.plane_data(frame.comp_plane(index))?,
            size,
            stride,
            first,
            step,
        )?)
    };
    let format = frame.format_info();
    Ok(if format.is_rgb() {
        Some(Chroma::Rgb([component(0)?, component(1)?, component(2)?]))
    } else if format.is_yuv() {
        Some(Chroma::Yuv([component(1)?, component(2)?]))
    } else {
        None
    })
}

/// Writes the grey picture of `bytes` (interleaved pixels, one matrix column a byte) to `grey`.
fn convert(bytes: &Mat, access: Access, grey: &mut Mat) -> opencv::Result<()> {
    let pixels = bytes.reshape(access.bytes_per_pixel() as i32, 0)?;
    match access {
        Access::InPlace => pixels.copy_to(grey),
        Access::Channel { index, .. } => core::extract_channel(&pixels, grey, index),
        Access::Colour { code, .. } => imgproc::cvt_color_def(&pixels, grey, code),
        Access::Weighted(weights) => core::transform(&pixels, grey, &Mat::from_slice(&weights)?),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A frame whose rows are `padding` bytes further apart than GStreamer would have them.
    fn padded_frame(
        format: VideoFormat,
        width: u32,
        height: u32,
        padding: i32,
    ) -> gst_video::VideoFrame<gst_video::video_frame::Writable> {
        gst::init().unwrap();
        let plain = gst_video::VideoInfo::builder(format, width, height).build().unwrap();
        let strides: Vec<i32> = plain.stride().iter().map(|stride| stride + padding).collect();
        let mut offsets = Vec::new();
        let mut size = 0;
        for stride in &strides {
            offsets.push(size);
            // One row more than any plane of these formats has.
            size += *stride as usize * (height as usize + 1);
        }
        let mut buffer = gst::Buffer::with_size(size).unwrap();
        gst_video::VideoMeta::add_full(
            buffer.get_mut().unwrap(),
            gst_video::VideoFrameFlags::empty(),
            format,
            width,
            height,
            &offsets,
            &strides,
        )
        .unwrap();
        gst_video::VideoFrame::from_buffer_writable(buffer, &plain).unwrap()
    }

    /// Sets component `component` of every pixel to what `value` says; the rest of the memory is noise.
    fn paint(
        frame: &mut gst_video::VideoFrame<gst_video::video_frame::Writable>,
        component: u32,
        value: impl Fn(usize, usize) -> u8,
    ) {
        let (width, height) = (frame.comp_width(component) as usize, frame.comp_height(component) as usize);
        let stride = frame.comp_stride(component) as usize;
        let (first, step) = (frame.comp_poffset(component) as usize, frame.comp_pstride(component) as usize);
        let plane = frame.comp_plane(component);
        let data = frame.plane_data_mut(plane).unwrap();
        for y in 0..height {
            for x in 0..width {
                data[y * stride + first + x * step] = value(x, y);
            }
        }
    }

    fn rows(
        source: &mut LumaSource,
        frame: &gst_video::VideoFrame<gst_video::video_frame::Writable>,
    ) -> Vec<Vec<u8>> {
        let buffer = frame.buffer().copy();
        let info =
            gst_video::VideoInfo::builder(frame.format(), frame.width(), frame.height()).build().unwrap();
        let readable = gst_video::VideoFrameRef::from_buffer_ref_readable(&buffer, &info).unwrap();
        let luma = source.luma(&readable).unwrap();
        (0..luma.height()).map(|y| luma.row(y).to_vec()).collect()
    }

    fn is_rgb(format: VideoFormat) -> bool {
        gst::init().unwrap();
        gst_video::VideoFormatInfo::from_format(format).is_rgb()
    }

    fn pattern(x: usize, y: usize) -> u8 {
        (x * 7 + y * 31) as u8
    }

    #[test]
    fn luma_of_every_format_size_and_stride() {
        let mut source = LumaSource::default();
        for &format in FORMATS {
            for (width, height) in [(1, 1), (16, 16), (17, 9), (64, 33)] {
                for padding in [0, 1, 16] {
                    let mut frame = padded_frame(format, width, height, padding);
                    frame.plane_data_mut(0).unwrap().fill(0xa5);
                    let components = if is_rgb(format) { 3 } else { 1 };
                    for component in 0..components {
                        paint(&mut frame, component, pattern);
                    }
                    for (y, row) in rows(&mut source, &frame).into_iter().enumerate() {
                        assert_eq!(row.len(), width as usize, "{format} {width}x{height}+{padding}");
                        for (x, luma) in row.into_iter().enumerate() {
                            let off = i16::from(luma) - i16::from(pattern(x, y));
                            assert!(off.abs() <= 1, "{format} {width}x{height}+{padding} at {x},{y}: {luma}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn colours_weigh_as_bt601_says() {
        let mut source = LumaSource::default();
        // 0.299 * 200 + 0.587 * 100 + 0.114 * 30 = 121.92
        for &format in FORMATS.iter().filter(|format| is_rgb(**format)) {
            let mut frame = padded_frame(format, 5, 3, 3);
            for (component, value) in [200, 100, 30].into_iter().enumerate() {
                paint(&mut frame, component as u32, |_, _| value);
            }
            for luma in rows(&mut source, &frame).concat() {
                assert!((121..=123).contains(&luma), "{format}: {luma}");
            }
        }
    }

    #[test]
    fn planar_luma_is_not_copied() {
        let frame = padded_frame(VideoFormat::Nv12, 17, 9, 5);
        let buffer = frame.into_buffer();
        let info = gst_video::VideoInfo::builder(VideoFormat::Nv12, 17, 9).build().unwrap();
        let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(&buffer, &info).unwrap();
        let mut source = LumaSource::default();
        assert_eq!(source.luma(&frame).unwrap().row(0).as_ptr(), frame.plane_data(0).unwrap().as_ptr());
    }

    #[test]
    fn other_formats_are_refused() {
        let frame = padded_frame(VideoFormat::I42010le, 16, 16, 0);
        let buffer = frame.into_buffer();
        let info = gst_video::VideoInfo::builder(VideoFormat::I42010le, 16, 16).build().unwrap();
        let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(&buffer, &info).unwrap();
        let error = LumaSource::default().luma(&frame).unwrap_err();
        assert!(matches!(error, LumaSourceError::Format(VideoFormat::I42010le)), "{error}");
    }

    #[test]
    fn caps_take_any_size_and_a_variable_frame_rate() {
        gst::init().unwrap();
        let caps = gst::Caps::builder("video/x-raw")
            .field("format", "YUY2")
            .field("width", 4096)
            .field("height", 1)
            .field("framerate", gst::Fraction::new(0, 1))
            .build();
        assert!(caps.is_subset(&template_caps()));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn opencv_and_definition_agree(
            index in 0..FORMATS.len(), width in 1u32..40, height in 1u32..20, padding in 0i32..9,
            red in any::<u8>(), green in any::<u8>(), blue in any::<u8>(),
        ) {
            let format = FORMATS[index];
            prop_assume!(is_rgb(format));
            let mut frame = padded_frame(format, width, height, padding);
            for (component, value) in [red, green, blue].into_iter().enumerate() {
                paint(&mut frame, component as u32, |_, _| value);
            }
            let expected = 0.299 * f64::from(red) + 0.587 * f64::from(green) + 0.114 * f64::from(blue);
            for luma in rows(&mut LumaSource::default(), &frame).concat() {
                prop_assert!((f64::from(luma) - expected).abs() <= 1.0, "{} {} {}", format, luma, expected);
            }
        }
    }
}
