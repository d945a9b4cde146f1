// SPDX-License-Identifier: MPL-2.0

//! How large a picture a stream announces, read without decoding anything. What a decoder takes memory for counts, not what is
//! cropped from it.

use h264_reader::rbsp::BitReaderError;

use super::{headers, jpeg};

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

/// It is cut off, or nonsense, or may be read in several ways.
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

/// Reads the size from a unit of a stream, where it tells one.
type Header = fn(&[u8]) -> Result<Option<Size>, Unreadable>;

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
            Self::Jpeg => jpeg::largest(data).map(Some),
            Self::Mpeg4 => after_start_codes(data, headers::mpeg4),
            // FFmpeg takes it for what belongs in caps, and its lengths for others from then on. No unit begins so.
            Self::H264(_) if matches!(data, [1, _, 0, _, 0xfc..=0xff, ..]) => Err(Unreadable),
            Self::H264(framing) => framing.largest(data, headers::h264),
            Self::H265(framing) => framing.largest(data, headers::h265),
        }
    }

    /// The same of what caps hold.
    ///
    /// # Errors
    /// Those of [`Self::size_in`].
    pub fn size_in_head(self, data: &[u8]) -> Result<Option<Size>, Unreadable> {
        match self {
            Self::Jpeg => Ok(None),
            Self::Mpeg4 => after_start_codes(data, headers::mpeg4),
            Self::H264(_) => in_head(data, sets_of_record, headers::h264),
            Self::H265(_) => in_head(data, sets_of_hevc_record, headers::h265),
        }
    }
}

impl Framing {
    fn largest(self, data: &[u8], header: Header) -> Result<Option<Size>, Unreadable> {
        if self == Self::StartCodes {
            return after_start_codes(data, header);
        }
        let (mut largest, mut rest) = (None, data);
        while let Some((length, after)) = rest.split_first_chunk() {
            let length = usize::try_from(u32::from_be_bytes(*length)).unwrap_or(usize::MAX);
            // FFmpeg may go by start codes after one that is too large.
            let (unit, next) = after.split_at_checked(length).ok_or(Unreadable)?;
            largest = larger(largest, in_unit(unit, header)?);
            rest = next;
        }
        Ok(largest)
    }
}

/// Of a unit with a length. There is no start code in one, but where there is, FFmpeg begins another.
fn in_unit(unit: &[u8], header: Header) -> Result<Option<Size>, Unreadable> {
    Ok(larger(header(unit)?, after_start_codes(unit, header)?))
}

/// Of every unit behind a start code. Nothing is collected: there may be millions.
fn after_start_codes(data: &[u8], header: Header) -> Result<Option<Size>, Unreadable> {
    let mut units = memchr::memmem::find_iter(data, &[0, 0, 1]).map(|at| &data[at + 3..]);
    units.try_fold(None, |so_far, unit| Ok(larger(so_far, header(unit)?)))
}

/// Caps hold a record of parameter sets or units with start codes, which FFmpeg tells by the first bytes, not by the caps.
fn in_head(data: &[u8], sets: fn(&[u8]) -> Vec<&[u8]>, header: Header) -> Result<Option<Size>, Unreadable> {
    let sets = if matches!(data, [0, 0, 0 | 1, ..]) { Vec::new() } else { sets(data) };
    let mut largest = after_start_codes(data, header)?;
    for set in sets {
        largest = larger(largest, in_unit(set, header)?);
    }
    Ok(largest)
}

/// `avcC` (ISO/IEC 14496-15, 5.3.3.1): sequence parameter sets, counted in the lower bits of a byte, then picture parameter sets, each
/// with its length in two bytes before it. FFmpeg takes either among both.
fn sets_of_record(data: &[u8]) -> Vec<&[u8]> {
    let mut rest = data.get(5..).unwrap_or_default();
    let mut sets = Vec::new();
    for bits in [0x1f_u8, 0xff] {
        let Some((&count, after)) = rest.split_first() else { break };
        rest = after;
        sets.extend((0..count & bits).map_while(|_| set(&mut rest)));
    }
    sets
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

#[cfg(test)]
mod tests {
    use gst::prelude::*;

    use super::super::headers::tests::sps;
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

    const LENGTHS: Codec = Codec::H264(Framing::Lengths);
    /// More than is decoded.
    const HUGE: Size = Size { width: 30_000, height: 30_000 };

    fn huge() -> Vec<u8> {
        sps(100, HUGE.width, HUGE.height)
    }

    #[test]
    fn a_start_code_in_a_unit_hides_no_picture() {
        let unit = [&[9_u8, 0x10, 0, 0, 1][..], &huge()].concat();
        let length = u32::try_from(unit.len()).unwrap().to_be_bytes();
        assert_eq!(LENGTHS.size_in(&[&length[..], &unit].concat()), Ok(Some(HUGE)));
        for start in [&[0_u8, 0, 1][..], &[0, 0, 0, 1]] {
            let data = [start, &sps(66, 320, 176), start, &huge(), start, &[0x68]].concat();
            assert_eq!(Codec::H264(Framing::StartCodes).size_in(&data), Ok(Some(HUGE)));
        }
    }

    #[test]
    fn units_are_told_apart_in_one_way_only() {
        let data = [&[0_u8, 0, 0, 1, 9, 0xff, 0xff, 0xff, 0xff, 0, 0, 1][..], &huge()].concat();
        assert_eq!(LENGTHS.size_in(&data), Err(Unreadable));
        // A unit of 16 MiB, which begins as what belongs in caps.
        let mut data = vec![1, 0, 0, 0, 0xff, 0xe1];
        data.resize(4 + (1 << 24), 0);
        assert_eq!(LENGTHS.size_in(&data), Err(Unreadable));
    }

    /// 32 sets are counted as none, and the first ones then as those of pictures.
    #[test]
    fn every_set_of_a_record_counts() {
        let record = |count: u8, sets: &[Vec<u8>], more: u8| {
            let mut record = vec![1, 100, 0, 40, 0xff, 0xe0 | count];
            for set in sets {
                record.extend(u16::try_from(set.len()).unwrap().to_be_bytes());
                record.extend(set);
            }
            record.push(more);
            record
        };
        let small = sps(100, 320, 176);
        let size = Size { width: 320, height: 176 };
        assert_eq!(LENGTHS.size_in_head(&record(1, std::slice::from_ref(&small), 0)), Ok(Some(size)));
        assert_eq!(LENGTHS.size_in_head(&record(2, &[small, huge()], 0)), Ok(Some(HUGE)));
        let mut record = record(0, &[], 1);
        record.extend(u16::try_from(huge().len()).unwrap().to_be_bytes());
        record.extend(huge());
        assert_eq!(LENGTHS.size_in_head(&record), Ok(Some(HUGE)));
        // Start codes are told by what stands there.
        let data = [&[0_u8, 0, 0, 1][..], &huge()].concat();
        assert_eq!(LENGTHS.size_in_head(&data), Ok(Some(HUGE)));
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
