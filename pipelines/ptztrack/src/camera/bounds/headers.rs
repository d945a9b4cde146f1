// SPDX-License-Identifier: MPL-2.0

//! Headers of streams that are written bit by bit. Where FFmpeg reads one otherwise than the standard says, it is not readable.

use std::io::BufRead;
use std::num::NonZeroUsize;

use h264_reader::rbsp::{BitRead, BitReader, ByteReader};

use super::sizes::{Size, Unreadable};

/// A video object layer (ISO/IEC 14496-2, 6.2.3).
///
/// # Errors
/// Those of [`h264`].
pub fn mpeg4(unit: &[u8]) -> Result<Option<Size>, Unreadable> {
    let Some((0x20..=0x2f, layer)) = unit.split_first() else { return Ok(None) };
    let mut bits = BitReader::new(layer);
    bits.skip(1, "")?;
    if STUDIO_OBJECTS.contains(&bits.read::<u8>(8, "video_object_type_indication")?) {
        return Err(Unreadable);
    }
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

/// Simple and core studio: their layers are laid out otherwise. No camera has them.
const STUDIO_OBJECTS: [u8; 2] = [14, 15];

/// Those whose sequence parameter sets tell of chroma (ITU-T H.264, 7.3.2.1.1).
const HIGH_PROFILES: [u8; 9] = [100, 110, 122, 244, 44, 83, 86, 118, 128];

/// Those of which not all say so: of several views with depth, and one that was withdrawn. No camera has them.
const DISPUTED_PROFILES: [u8; 5] = [134, 135, 138, 139, 144];

/// A sequence parameter set (ITU-T H.264, 7.3.2.1.1).
///
/// # Errors
/// It cannot be read, or not in one way only.
pub fn h264(unit: &[u8]) -> Result<Option<Size>, Unreadable> {
    let Some((head, set)) = unit.split_first() else { return Ok(None) };
    if head & 0x1f != 7 {
        return Ok(None);
    }
    let mut bits = BitReader::new(before_escapes(set));
    let profile = bits.read::<u8>(8, "profile_idc")?;
    if DISPUTED_PROFILES.contains(&profile) {
        return Err(Unreadable);
    }
    bits.skip(8 + 8, "")?;
    bits.read_ue("seq_parameter_set_id")?;
    if HIGH_PROFILES.contains(&profile) {
        skip_chroma(&mut bits)?;
    }
    bits.read_ue("log2_max_frame_num_minus4")?;
    skip_order(&mut bits)?;
    bits.read_ue("max_num_ref_frames")?;
    bits.skip(1, "")?;
    let width = bits.read_ue("pic_width_in_mbs_minus1")?.saturating_add(1).saturating_mul(16);
    let height = bits.read_ue("pic_height_in_map_units_minus1")?.saturating_add(1).saturating_mul(16);
    let fields = if bits.read_bool("frame_mbs_only_flag")? { 1 } else { 2 };
    Ok(Some(Size { width, height: height.saturating_mul(fields) }))
}

/// Bytes that keep start codes out of a set are removed by FFmpeg, but not when it tries a set again that it could not read. They
/// stand behind the size: so many zeros are not needed before it.
fn before_escapes(set: &[u8]) -> &[u8] {
    let escape = set.windows(3).position(|bytes| matches!(bytes, [0, 0, 0..=3]));
    &set[..escape.unwrap_or(set.len())]
}

fn skip_chroma(bits: &mut impl BitRead) -> Result<(), Unreadable> {
    let chroma = bits.read_ue("chroma_format_idc")?;
    bits.skip(u32::from(chroma == 3), "")?;
    bits.read_ue("bit_depth_luma_minus8")?;
    bits.read_ue("bit_depth_chroma_minus8")?;
    bits.skip(1, "")?;
    if bits.read_bool("seq_scaling_matrix_present_flag")? {
        for list in 0..if chroma == 3 { 12 } else { 8 } {
            skip_scaling_list(bits, if list < 6 { 16 } else { 64 })?;
        }
    }
    Ok(())
}

fn skip_scaling_list(bits: &mut impl BitRead, entries: u32) -> Result<(), Unreadable> {
    if !bits.read_bool("seq_scaling_list_present_flag")? {
        return Ok(());
    }
    let (mut last, mut next) = (8, 8);
    for _ in 0..entries {
        if next != 0 {
            next = (last + i32::from(short(bits, "delta_scale")?)).rem_euclid(256);
        }
        last = if next == 0 { last } else { next };
    }
    Ok(())
}

/// The order in which pictures are shown.
fn skip_order(bits: &mut impl BitRead) -> Result<(), Unreadable> {
    match bits.read_ue("pic_order_cnt_type")? {
        0 => {
            bits.read_ue("log2_max_pic_order_cnt_lsb_minus4")?;
        }
        1 => {
            bits.skip(1, "")?;
            short(bits, "offset_for_non_ref_pic")?;
            short(bits, "offset_for_top_to_bottom_field")?;
            let cycle = bits.read_ue("num_ref_frames_in_pic_order_cnt_cycle")?;
            // More there are not.
            for _ in 0..u8::try_from(cycle).map_err(|_| Unreadable)? {
                short(bits, "offset_for_ref_frame")?;
            }
        }
        _ => {}
    }
    Ok(())
}

/// A signed number. FFmpeg reads the longest codes, which nobody needs, only in part.
fn short(bits: &mut impl BitRead, name: &'static str) -> Result<i16, Unreadable> {
    i16::try_from(bits.read_se(name)?).map_err(|_| Unreadable)
}

/// A sequence parameter set (ITU-T H.265, 7.3.2.2.1).
///
/// # Errors
/// Those of [`h264`].
pub fn h265(unit: &[u8]) -> Result<Option<Size>, Unreadable> {
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
pub mod tests {
    use super::*;

    #[derive(Default)]
    struct Bits(Vec<bool>);

    impl Bits {
        /// A number in so many bits.
        fn fixed(mut self, count: u32, value: u32) -> Self {
            self.0.extend((0..count).rev().map(|bit| (value >> bit) & 1 == 1));
            self
        }

        /// In a code of Golomb's.
        fn ue(self, value: u32) -> Self {
            let length = u32::BITS - (value + 1).leading_zeros();
            self.fixed(length - 1, 0).fixed(length, value + 1)
        }

        /// What ends a sequence parameter set, from the numbers of frames on.
        fn sides(self, width: u32, height: u32) -> Vec<u8> {
            let frames = self.ue(0).ue(0).ue(0).ue(1).fixed(1, 0);
            frames.ue(width / 16 - 1).ue(height / 16 - 1).fixed(4, 0b1100).bytes()
        }

        fn bytes(self) -> Vec<u8> {
            let bits = self.fixed(1, 1).0;
            let byte = |bits: &[bool]| {
                bits.iter().enumerate().fold(0_u8, |byte, (at, bit)| byte | (u8::from(*bit) << (7 - at)))
            };
            bits.chunks(8).map(byte).collect()
        }
    }

    fn head(profile: u32) -> Bits {
        Bits::default().fixed(8, 0x67).fixed(8, profile).fixed(8, 0).fixed(8, 40).ue(0)
    }

    /// A sequence parameter set of H.264, which tells of chroma unless it is of the baseline profile.
    pub fn sps(profile: u32, width: u32, height: u32) -> Vec<u8> {
        let head = head(profile);
        let head = if profile == 66 { head } else { head.ue(1).ue(0).ue(0).fixed(2, 0) };
        head.sides(width, height)
    }

    fn layer(object: u32, width: u32, height: u32) -> Vec<u8> {
        let head = Bits::default().fixed(8, 0x20).fixed(1, 0).fixed(8, object).fixed(1, 0).fixed(4, 1);
        let time = head.fixed(1, 0).fixed(2, 0).fixed(1, 1).fixed(16, 25).fixed(1, 1).fixed(1, 0);
        time.fixed(1, 1).fixed(13, width).fixed(1, 1).fixed(13, height).fixed(1, 1).bytes()
    }

    const SMALL: Size = Size { width: 320, height: 176 };

    #[test]
    fn profiles_that_are_read_in_two_ways_are_not_read() {
        for profile in [66, 100, 110, 122, 244, 44] {
            assert_eq!(h264(&sps(profile, 320, 176)), Ok(Some(SMALL)), "{profile}");
            let size = Size { width: 30_000, height: 30_000 };
            assert_eq!(h264(&sps(profile, 30_000, 30_000)), Ok(Some(size)), "{profile}");
        }
        for profile in [134, 135, 138, 139, 144] {
            for side in [320, 30_000] {
                assert_eq!(h264(&sps(profile, side, side)), Err(Unreadable), "{profile}");
            }
        }
    }

    #[test]
    fn objects_of_studios_are_not_read() {
        for object in [1, 17] {
            assert_eq!(mpeg4(&layer(object, 320, 176)), Ok(Some(SMALL)), "{object}");
        }
        for object in [14, 15] {
            assert_eq!(mpeg4(&layer(object, 320, 176)), Err(Unreadable), "{object}");
        }
    }

    /// FFmpeg refuses such a number of the set, and tries again without removing anything.
    #[test]
    fn bytes_that_may_be_removed_do_not_stand_before_the_size() {
        let head = Bits::default().fixed(8, 0x67).fixed(8, 66).fixed(16, 0).ue(63);
        let mut set = head.sides(320, 176);
        set.insert(4, 3);
        assert_eq!(h264(&set), Err(Unreadable));

        let mut set = sps(66, 320, 176);
        set.extend([0, 0, 3, 0, 1]);
        assert_eq!(h264(&set), Ok(Some(SMALL)));
    }

    #[test]
    fn codes_that_are_too_long_are_not_read() {
        // The first list alone is there, and -8 is all that it says; or -8 - 65536, which is the same in a byte.
        for (delta, expected) in [(16, Ok(Some(SMALL))), (16 + 131_072, Err(Unreadable))] {
            let lists = head(100).ue(1).ue(0).ue(0).fixed(1, 0).fixed(2, 0b11).ue(delta).fixed(7, 0);
            assert_eq!(h264(&lists.sides(320, 176)), expected, "{delta}");
        }
    }
}
