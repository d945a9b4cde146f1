// SPDX-License-Identifier: MPL-2.0

//! Maps frames of raw video. GStreamer takes a `GstVideoMeta` at its word; where a plane is not in memory as far as that says, what is
//! read or drawn there would be others' memory.

use gst_video::{VideoFormatInfo, VideoFrameRef, VideoInfo, VideoMeta};

/// A frame to be read; `None` where it is not what caps and meta say.
pub fn readable<'a>(
    buffer: &'a gst::BufferRef,
    info: &VideoInfo,
) -> Option<VideoFrameRef<&'a gst::BufferRef>> {
    is_whole(buffer, info).then(|| VideoFrameRef::from_buffer_ref_readable(buffer, info).ok()).flatten()
}

/// The same, to be drawn on.
pub fn writable<'a>(
    buffer: &'a mut gst::BufferRef,
    info: &VideoInfo,
) -> Option<VideoFrameRef<&'a mut gst::BufferRef>> {
    is_whole(buffer, info).then(|| VideoFrameRef::from_buffer_ref_writable(buffer, info).ok()).flatten()
}

/// Whether all planes are in memory as far as metas tell, their rows in ascending order. Without a meta GStreamer looks by itself.
fn is_whole(buffer: &gst::BufferRef, info: &VideoInfo) -> bool {
    let format = info.format_info();
    // Strides of tiles count these; nobody here looks at one.
    format.is_tiled()
        || buffer.iter_meta::<VideoMeta>().all(|meta| {
            let planes = meta.offset().iter().zip(meta.stride()).zip(0..);
            let mut planes = planes.filter(|(_, plane)| !(format.has_palette() && *plane == 1));
            planes.all(|((offset, stride), plane)| {
                let needed = bytes_needed(&format, info, plane, *stride);
                needed.is_some_and(|bytes| bytes <= bytes_there(buffer, *offset))
            })
        })
}

/// From the first byte of a plane to the last of its last row; `None` where its rows do not ascend.
fn bytes_needed(format: &VideoFormatInfo, info: &VideoInfo, plane: u32, stride: i32) -> Option<usize> {
    let stride = usize::try_from(stride).ok().filter(|stride| *stride > 0)?;
    let components = (0..info.n_components()).filter(|index| format.plane()[*index as usize] == plane);
    let end = |index: u32| {
        let index = index as u8;
        let step = usize::try_from(info.comp_pstride(index)).unwrap_or(0);
        let before = |length: u32| (length as usize).saturating_sub(1);
        let rows = before(info.comp_height(index)) * stride;
        rows + info.comp_poffset(index) as usize + before(info.comp_width(index)) * step + 1
    };
    components.map(end).max()
}

/// From this byte of a buffer to the end of the piece of memory that it lies in: no more is mapped for a plane.
fn bytes_there(buffer: &gst::BufferRef, offset: usize) -> usize {
    let mut end = 0;
    for memory in buffer.iter_memories() {
        end += memory.size();
        if offset < end {
            return end - offset;
        }
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;
    use gst_video::{VideoFormat, VideoFrameFlags};

    const SIZE: (u32, u32) = (64, 48);

    fn buffer(bytes: usize, format: VideoFormat, planes: Option<(&[usize], &[i32])>) -> gst::Buffer {
        let mut buffer = gst::Buffer::with_size(bytes).unwrap();
        if let Some((offsets, strides)) = planes {
            let buffer = buffer.get_mut().unwrap();
            VideoMeta::add_full(buffer, VideoFrameFlags::empty(), format, SIZE.0, SIZE.1, offsets, strides)
                .unwrap();
        }
        buffer
    }

    #[track_caller]
    fn assert_maps(maps: bool, format: VideoFormat, bytes: usize, planes: Option<(&[usize], &[i32])>) {
        gst::init().unwrap();
        let info = VideoInfo::builder(format, SIZE.0, SIZE.1).build().unwrap();
        let mut buffer = buffer(bytes, format, planes);
        assert_eq!(readable(&buffer, &info).is_some(), maps, "{format:?}, {bytes} bytes, {planes:?}");
        assert_eq!(writable(buffer.get_mut().unwrap(), &info).is_some(), maps);
    }

    #[test]
    fn frames_are_mapped_however_their_planes_lie() {
        assert_maps(true, VideoFormat::Gray8, 64 * 48, None);
        // The last row need not be as long as its stride.
        assert_maps(true, VideoFormat::Gray8, 47 * 80 + 64, Some((&[0], &[80])));
        let (luma, chroma) = (64 * 48, 32 * 24);
        let i420 = luma + 2 * chroma;
        assert_maps(true, VideoFormat::I420, i420, None);
        assert_maps(
            true,
            VideoFormat::I420,
            i420 + 16,
            Some((&[16, luma + 16, luma + chroma + 16], &[64, 32, 32])),
        );
        assert_maps(true, VideoFormat::Bgrx, 4 * 64 * 48, Some((&[0], &[256])));
    }

    #[test]
    fn one_whose_meta_tells_of_more_than_there_is_is_refused() {
        assert_maps(false, VideoFormat::Gray8, 4096, Some((&[0], &[640])));
        assert_maps(false, VideoFormat::Gray8, 64 * 48 - 1, Some((&[0], &[64])));
        let (luma, chroma) = (64 * 48, 32 * 24);
        let i420 = luma + 2 * chroma;
        assert_maps(false, VideoFormat::I420, i420 - 1, Some((&[0, luma, luma + chroma], &[64, 32, 32])));
        assert_maps(false, VideoFormat::Bgrx, 4 * 64 * 48 - 4, Some((&[0], &[256])));
    }

    /// GStreamer maps the piece that a plane begins in, and no other.
    #[test]
    fn a_plane_that_goes_on_in_another_piece_of_memory_is_refused() {
        gst::init().unwrap();
        let info = VideoInfo::builder(VideoFormat::Gray8, SIZE.0, SIZE.1).build().unwrap();
        for (first, maps) in [(64 * 40, false), (64 * 48, true)] {
            let mut buffer = buffer(first, VideoFormat::Gray8, None);
            buffer.get_mut().unwrap().append_memory(gst::Memory::with_size(64 * 48));
            let content = buffer.get_mut().unwrap();
            let (format, flags) = (VideoFormat::Gray8, VideoFrameFlags::empty());
            VideoMeta::add_full(content, flags, format, SIZE.0, SIZE.1, &[0], &[64]).unwrap();
            assert_eq!(readable(&buffer, &info).is_some(), maps, "{first}");
        }
    }

    #[test]
    fn one_whose_rows_lie_upside_down_is_refused() {
        assert_maps(false, VideoFormat::Gray8, 64 * 48, Some((&[47 * 64], &[-64])));
    }
}
