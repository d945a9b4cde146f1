// SPDX-License-Identifier: MPL-2.0

//! Pixels of a frame as a [`Surface`].

use gst_video::prelude::*;
use gst_video::{VideoColorRange, VideoFrameRef, VideoInfo};

use crate::vision::{ColourSpace, Component, Surface};

/// Where most decoders' colours come from, should the caps not say.
const BT601: (f64, f64) = (0.299, 0.114);

/// What a format's components say, where it can be drawn on as it is: eight bits a component, each byte at a place of its own.
pub(super) fn colour_space(info: &VideoInfo) -> Option<ColourSpace> {
    let format = info.format_info();
    let bytes =
        format.depth().iter().all(|depth| *depth == 8) && format.shift().iter().all(|shift| *shift == 0);
    let halvings = format.w_sub().iter().chain(format.h_sub()).all(|halvings| *halvings <= 2);
    let odd = format.is_complex() || format.is_tiled() || format.has_palette() || format.has_alpha();
    if !bytes || !halvings || odd || format.pixel_stride().iter().any(|stride| *stride <= 0) {
        return None;
    }
    if format.is_rgb() {
        return Some(ColourSpace::Rgb);
    }
    let colorimetry = info.colorimetry();
    let (kr, kb) = colorimetry.matrix().kr_kb().unwrap_or(BT601);
    Some(ColourSpace::Yuv { kr, kb, full_range: colorimetry.range() == VideoColorRange::Range0_255 })
}

/// Gives the pixels of `frame` to `draw`.
pub(super) fn with_surface<T>(
    frame: &mut VideoFrameRef<&mut gst::BufferRef>,
    colours: ColourSpace,
    draw: impl FnOnce(&mut Surface) -> T,
) -> T {
    let (format, mut components) = (frame.format_info(), [Component::default(); 4]);
    let count = format.n_components() as usize;
    for (index, component) in components.iter_mut().enumerate().take(count) {
        *component = Component {
            plane: format.plane()[index] as usize,
            offset: frame.comp_poffset(index as u32) as usize,
            step: frame.comp_pstride(index as u32).unsigned_abs() as usize,
            stride: frame.comp_stride(index as u32).unsigned_abs() as usize,
            halvings: (format.w_sub()[index], format.h_sub()[index]),
        };
    }
    let components = &components[..count.min(4)];
    draw(&mut Surface { planes: frame.planes_data_mut(), components, colours, origin: (0, 0) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gst_video::VideoFormat::{self, *};

    #[test]
    fn usual_formats_are_drawn_on_as_they_are() {
        gst::init().expect("GStreamer");
        let space =
            |format: VideoFormat| VideoInfo::builder(format, 64, 48).build().map(|info| colour_space(&info));
        for format in [I420, Yv12, Nv12, Nv21, Y42b, Y444, Gray8, Yuy2, Uyvy] {
            assert!(matches!(space(format), Ok(Some(ColourSpace::Yuv { .. }))), "{format:?}");
        }
        for format in [Rgb, Bgr, Rgbx, Bgrx, Xrgb, Gbr] {
            assert_eq!(space(format).ok().flatten(), Some(ColourSpace::Rgb), "{format:?}");
        }
        for format in [Ayuv, Bgra, I42010le, P01010le, Rgb16, Gray16Le, Nv1264z32, V210] {
            assert_eq!(space(format).ok().flatten(), None, "{format:?}");
        }
    }
}
