// SPDX-License-Identifier: MPL-2.0

//! How large a picture a stream announces, read without decoding anything. What a decoder takes memory for counts, not what is
//! cropped from it.

use std::io::BufRead;
use std::num::NonZeroUsize;

use h264_reader::rbsp::{BitRead, BitReader, BitReaderError, ByteReader};

/// In pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    pub width: u32,
    pub height: u32,
}

impl Size {
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

/// It is cut off, or nonsense.
#[derive(Debug, PartialEq, Eq)]
pub struct Unreadable;

impl From<BitReaderError> for Unreadable {
    fn from(_: BitReaderError) -> Self {
        Self
    }
}

/// What pictures are encoded in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    Jpeg,
    Mpeg4,
    H264(Framing),
    H265(Framing),
}

/// How one unit of a stream is told from the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Framing {
    /// By start codes (ITU-T H.264, annex B).
    StartCodes,
    /// By lengths of four bytes, as the depayloaders of RTP have them (ISO/IEC 14496-15).
    Lengths,
}

/// The one of more pixels.
pub fn larger(one: Option<Size>, other: Option<Size>) -> Option<Size> {
    one.into_iter().chain(other).max_by_key(Size::pixels)
}

/// What caps say that a stream begins with.
pub fn codec_data(caps: &gst::CapsRef) -> Option<gst::Buffer> {
    caps.structure(0)?.get("codec_data").ok()
}

impl Codec {
    /// Every one.
    pub const ALL: [Self; 6] = [
        Self::Jpeg,
        Self::Mpeg4,
        Self::H264(Framing::StartCodes),
        Self::H264(Framing::Lengths),
        Self::H265(Framing::StartCodes),
        Self::H265(Framing::Lengths),
    ];

    /// `None`: no codec whose sizes are known.
    pub fn of(caps: &gst::CapsRef) -> Option<Self> {
        let structure = caps.structure(0)?;
        let framing = match structure.get("stream-format") {
            Ok("byte-stream") => Framing::StartCodes,
            _ => Framing::Lengths,
        };
        match structure.name().as_str() {
            "image/jpeg" => Some(Self::Jpeg),
            "video/mpeg" => Some(Self::Mpeg4),
            "video/x-h264" => Some(Self::H264(framing)),
            "video/x-h265" => Some(Self::H265(framing)),
            _ => None,
        }
    }

    /// The largest that is announced within, where one is.
    ///
    /// # Errors
    /// One is announced, but not readable.
    pub fn size_in(self, data: &[u8]) -> Result<Option<Size>, Unreadable> {
        match self {
            Self::Jpeg => jpeg(data).map(Some),
            Self::Mpeg4 => largest(after_start_codes(data), mpeg4),
            Self::H264(framing) => largest(framing.units(data), h264),
            Self::H265(framing) => largest(framing.units(data), h265),
        }
    }

    /// The same of what caps hold.
    ///
    /// # Errors
    /// Those of [`Self::size_in`].
    pub fn size_in_head(self, data: &[u8]) -> Result<Option<Size>, Unreadable> {
        match self {
            // Records of parameter sets, each with its length in two bytes before it. Whatever stands there is looked at as if it
            // were one: what is none announces no size, or makes no stream.
            Self::H264(Framing::Lengths) => largest(sets_of_record(data, 5, 6), h264),
            Self::H265(Framing::Lengths) => largest(sets_of_hevc_record(data), h265),
            Self::Jpeg => Ok(None),
            other => other.size_in(data),
        }
    }
}

impl Framing {
    fn units(self, data: &[u8]) -> Vec<&[u8]> {
        match self {
            Self::StartCodes => after_start_codes(data),
            Self::Lengths => {
                let (mut units, mut rest) = (Vec::new(), data);
                while let Some((length, after)) = rest.split_first_chunk() {
                    let length = usize::try_from(u32::from_be_bytes(*length)).unwrap_or(usize::MAX);
                    let (unit, next) = after.split_at(length.min(after.len()));
                    units.push(unit);
                    rest = next;
                }
                units
            }
        }
    }
}

fn largest(
    units: Vec<&[u8]>,
    size: fn(&[u8]) -> Result<Option<Size>, Unreadable>,
) -> Result<Option<Size>, Unreadable> {
    units.into_iter().try_fold(None, |so_far, unit| Ok(larger(so_far, size(unit)?)))
}

/// What stands behind each start code, to the end.
fn after_start_codes(data: &[u8]) -> Vec<&[u8]> {
    memchr::memmem::find_iter(data, &[0, 0, 1]).map(|at| &data[at + 3..]).collect()
}

/// `avcC` (ISO/IEC 14496-15, 5.3.3.1): sequence parameter sets, counted in the lower bits of the byte at `count`.
fn sets_of_record(data: &[u8], count: usize, first: usize) -> Vec<&[u8]> {
    let sets = data.get(count).map_or(0, |count| count & 0x1f);
    let mut rest = data.get(first..).unwrap_or_default();
    (0..sets).map_while(|_| set(&mut rest)).collect()
}

/// `hvcC` (ISO/IEC 14496-15, 8.3.3.1): arrays of parameter sets, after 22 bytes and the number of arrays.
fn sets_of_hevc_record(data: &[u8]) -> Vec<&[u8]> {
    let mut rest = data.get(23..).unwrap_or_default();
    let mut sets = Vec::new();
    while let Some(([_, high, low], after)) = rest.split_first_chunk() {
        rest = after;
        sets.extend((0..u16::from_be_bytes([*high, *low])).map_while(|_| set(&mut rest)));
    }
    sets
}

fn set<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, after) = rest.split_first_chunk()?;
    let (unit, next) = after.split_at_checked(usize::from(u16::from_be_bytes(*length)))?;
    *rest = next;
    Some(unit)
}

/// The frame header of every picture within (ITU-T T.81, B.2.2).
fn jpeg(data: &[u8]) -> Result<Size, Unreadable> {
    let begins = memchr::memmem::find_iter(data, &[0xff, 0xd8, 0xff]);
    // A decoder that gets half a header waits for the other half, which nobody looks at as a whole then.
    begins.filter_map(|at| jpeg_frame(&data[at + 2..])).max_by_key(Size::pixels).ok_or(Unreadable)
}

fn jpeg_frame(mut segments: &[u8]) -> Option<Size> {
    loop {
        let (&[mark, kind], rest) = segments.split_first_chunk()?;
        if mark != 0xff {
            return None;
        }
        // A marker may be filled up.
        if kind == 0xff {
            segments = segments.get(1..)?;
            continue;
        }
        let length = usize::from(u16::from_be_bytes(*rest.first_chunk()?));
        if matches!(kind, 0xc0..=0xcf) && !matches!(kind, 0xc4 | 0xc8 | 0xcc) {
            let side = |at| Some(u16::from_be_bytes(*rest.get(at..)?.first_chunk()?).into());
            return Some(Size { height: side(3)?, width: side(5)? });
        }
        segments = rest.get(length..)?;
    }
}

/// A video object layer (ISO/IEC 14496-2, 6.2.3).
fn mpeg4(unit: &[u8]) -> Result<Option<Size>, Unreadable> {
    let Some((0x20..=0x2f, layer)) = unit.split_first() else { return Ok(None) };
    let mut bits = BitReader::new(layer);
    bits.skip(1 + 8, "")?;
    if bits.read_bool("is_object_layer_identifier")? {
        bits.skip(4 + 3, "")?;
    }
    if bits.read::<u8>(4, "aspect_ratio_info")? == 15 {
        bits.skip(8 + 8, "")?;
    }
    if bits.read_bool("vol_control_parameters")? {
        bits.skip(2 + 1, "")?;
        if bits.read_bool("vbv_parameters")? {
            bits.skip(79, "")?;
        }
    }
    bits.skip(2 + 1, "")?;
    let resolution = bits.read::<u32>(16, "vop_time_increment_resolution")?;
    bits.skip(1, "")?;
    if bits.read_bool("fixed_vop_rate")? {
        bits.skip((u32::BITS - resolution.saturating_sub(1).leading_zeros()).max(1), "")?;
    }
    bits.skip(1, "")?;
    let width = bits.read::<u32>(13, "video_object_layer_width")?;
    bits.skip(1, "")?;
    let height = bits.read::<u32>(13, "video_object_layer_height")?;
    Ok(Some(Size { width, height }))
}

/// Those whose sequence parameter sets tell of chroma (ITU-T H.264, 7.3.2.1.1).
const HIGH_PROFILES: [u8; 13] = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135];

/// A sequence parameter set (ITU-T H.264, 7.3.2.1.1).
fn h264(unit: &[u8]) -> Result<Option<Size>, Unreadable> {
    if unit.first().is_none_or(|head| head & 0x1f != 7) {
        return Ok(None);
    }
    let mut bits = rbsp(unit, NonZeroUsize::MIN);
    let profile = bits.read::<u8>(8, "profile_idc")?;
    bits.skip(8 + 8, "")?;
    bits.read_ue("seq_parameter_set_id")?;
    if HIGH_PROFILES.contains(&profile) {
        let chroma = bits.read_ue("chroma_format_idc")?;
        bits.skip(u32::from(chroma == 3), "")?;
        bits.read_ue("bit_depth_luma_minus8")?;
        bits.read_ue("bit_depth_chroma_minus8")?;
        bits.skip(1, "")?;
        if bits.read_bool("seq_scaling_matrix_present_flag")? {
            for list in 0..if chroma == 3 { 12 } else { 8 } {
                skip_scaling_list(&mut bits, if list < 6 { 16 } else { 64 })?;
            }
        }
    }
    bits.read_ue("log2_max_frame_num_minus4")?;
    match bits.read_ue("pic_order_cnt_type")? {
        0 => drop(bits.read_ue("log2_max_pic_order_cnt_lsb_minus4")?),
        1 => {
            bits.skip(1, "")?;
            bits.read_se("offset_for_non_ref_pic")?;
            bits.read_se("offset_for_top_to_bottom_field")?;
            let cycle = bits.read_ue("num_ref_frames_in_pic_order_cnt_cycle")?;
            // More there are not.
            for _ in 0..u8::try_from(cycle).map_err(|_| Unreadable)? {
                bits.read_se("offset_for_ref_frame")?;
            }
        }
        _ => {}
    }
    bits.read_ue("max_num_ref_frames")?;
    bits.skip(1, "")?;
    let width = bits.read_ue("pic_width_in_mbs_minus1")?.saturating_add(1).saturating_mul(16);
    let height = bits.read_ue("pic_height_in_map_units_minus1")?.saturating_add(1).saturating_mul(16);
    let fields = if bits.read_bool("frame_mbs_only_flag")? { 1 } else { 2 };
    Ok(Some(Size { width, height: height.saturating_mul(fields) }))
}

fn skip_scaling_list(bits: &mut impl BitRead, entries: u32) -> Result<(), Unreadable> {
    if !bits.read_bool("seq_scaling_list_present_flag")? {
        return Ok(());
    }
    let (mut last, mut next) = (8, 8);
    for _ in 0..entries {
        if next != 0 {
            next = (last + i64::from(bits.read_se("delta_scale")?) + 256).rem_euclid(256);
        }
        last = if next == 0 { last } else { next };
    }
    Ok(())
}

/// A sequence parameter set (ITU-T H.265, 7.3.2.2.1).
fn h265(unit: &[u8]) -> Result<Option<Size>, Unreadable> {
    if unit.first().is_none_or(|head| (head >> 1) & 0x3f != 33) {
        return Ok(None);
    }
    let mut bits = rbsp(unit, NonZeroUsize::MIN.saturating_add(1));
    bits.skip(4, "")?;
    let sub_layers = bits.read::<u32>(3, "sps_max_sub_layers_minus1")?;
    bits.skip(1 + PROFILE_BITS + LEVEL_BITS, "")?;
    let mut present = Vec::new();
    for _ in 0..sub_layers {
        present.push((
            bits.read_bool("sub_layer_profile_present_flag")?,
            bits.read_bool("sub_layer_level_present_flag")?,
        ));
    }
    if sub_layers > 0 {
        bits.skip(2 * (8 - sub_layers), "")?;
    }
    for (profile, level) in present {
        bits.skip(u32::from(profile) * PROFILE_BITS + u32::from(level) * LEVEL_BITS, "")?;
    }
    bits.read_ue("sps_seq_parameter_set_id")?;
    if bits.read_ue("chroma_format_idc")? == 3 {
        bits.skip(1, "")?;
    }
    let width = bits.read_ue("pic_width_in_luma_samples")?;
    let height = bits.read_ue("pic_height_in_luma_samples")?;
    Ok(Some(Size { width, height }))
}

/// Of `profile_tier_level` (ITU-T H.265, 7.3.3).
const PROFILE_BITS: u32 = 88;
const LEVEL_BITS: u32 = 8;

/// What a unit holds, behind so many bytes of head, without the bytes that keep start codes out of it.
fn rbsp(unit: &[u8], head: NonZeroUsize) -> BitReader<impl BufRead + Clone> {
    BitReader::new(ByteReader::skipping_bytes(unit, head))
}

#[cfg(test)]
mod tests {
    use gst::prelude::*;

    use super::*;

    /// Caps, codec data and first buffer of a stream that an encoder of GStreamer makes; `None` without that encoder.
    fn encoded(encoder: &str, caps: &str) -> Option<(gst::Caps, gst::Buffer)> {
        gst::init().unwrap();
        // An encoder may wait for what comes next.
        let text = format!(
            "videotestsrc num-buffers=9 ! video/x-raw,format=I420,width=320,height=176 ! {encoder} ! {caps} \
             ! appsink name=sink sync=false"
        );
        let pipeline = gst::parse::launch(&text).ok()?.downcast::<gst::Pipeline>().unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let sink = pipeline.by_name("sink").unwrap().downcast::<gst_app::AppSink>().unwrap();
        let sample =
            sink.try_pull_sample(gst::ClockTime::from_seconds(20)).unwrap_or_else(|| panic!("{text}"));
        pipeline.set_state(gst::State::Null).unwrap();
        Some((sample.caps_owned().unwrap(), sample.buffer_owned().unwrap()))
    }

    #[test]
    fn sizes_are_those_that_encoders_wrote() {
        let size = Some(Size { width: 320, height: 176 });
        for (encoder, caps, in_head) in [
            ("jpegenc", "image/jpeg", false),
            ("avenc_mpeg4", "video/mpeg", true),
            ("x264enc", "video/x-h264,stream-format=byte-stream,profile=high", false),
            ("x264enc", "video/x-h264,stream-format=avc,profile=main", true),
            ("x265enc", "video/x-h265,stream-format=byte-stream", false),
        ] {
            let Some((caps, buffer)) = encoded(encoder, caps) else {
                assert_eq!(encoder, "x265enc", "a plugin is missing");
                continue;
            };
            let codec = Codec::of(&caps).unwrap();
            let data = buffer.map_readable().unwrap();
            let head = codec_data(&caps).filter(|_| in_head);
            let found = match &head {
                Some(head) => codec.size_in_head(&head.map_readable().unwrap()),
                None => codec.size_in(&data),
            };
            assert_eq!(found, Ok(size), "{caps}");
            // Half of what announces it is no announcement.
            let cut = &data[..12.min(data.len())];
            assert_ne!(codec.size_in(cut), Ok(size), "{caps}");
        }
    }

    #[test]
    fn the_largest_of_several_counts_and_half_a_picture_is_none() {
        let picture = |width: u16| {
            let mut jpeg = vec![0xff, 0xd8, 0xff, 0xe0, 0, 4, 0, 0, 0xff, 0xff, 0xc0, 0, 17, 8];
            jpeg.extend([16, width].map(u16::to_be_bytes).concat());
            jpeg
        };
        let two = [picture(16), picture(999)].concat();
        assert_eq!(Codec::Jpeg.size_in(&two), Ok(Some(Size { width: 999, height: 16 })));
        assert_eq!(Codec::Jpeg.size_in(&picture(16)[..14]), Err(Unreadable));
        assert_eq!(Codec::Jpeg.size_in(b"no picture"), Err(Unreadable));
    }

    #[test]
    fn nothing_that_comes_is_a_panic() {
        let mut bytes = vec![0; 4096];
        let mut state = 1_u32;
        for byte in &mut bytes {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *byte = (state >> 24) as u8;
        }
        for start in 0..1000 {
            let mut data = bytes[start..start + 64].to_vec();
            for head in [[0, 0, 1, 0x67], [0, 0, 1, 0x42], [0, 0, 1, 0x20], [0xff, 0xd8, 0xff, 0xc0]] {
                data[..4].copy_from_slice(&head);
                for framing in [Framing::StartCodes, Framing::Lengths] {
                    for codec in [Codec::Jpeg, Codec::Mpeg4, Codec::H264(framing), Codec::H265(framing)] {
                        let _ = (codec.size_in(&data), codec.size_in_head(&data));
                    }
                }
            }
        }
    }
}
