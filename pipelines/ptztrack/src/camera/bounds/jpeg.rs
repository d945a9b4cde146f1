// SPDX-License-Identifier: MPL-2.0

//! How large the pictures of a buffer are that claims to be JPEG (ITU-T T.81).
//!
//! Two read it after us: libjpeg, and, of a stream in bytes, before it `jpegdec`, to find where each picture begins. Both go on
//! behind what does not belong there, but not at the same place, so that one finds a picture in what the other skips. Only
//! what both read alike has a size.

use super::sizes::{Size, Unreadable, larger};

/// What a picture begins with.
const START: [u8; 2] = [0xff, 0xd8];

/// Kinds of markers (T.81, table B.1).
const SOI: u8 = 0xd8;
const EOI: u8 = 0xd9;
const SOS: u8 = 0xda;

/// That of the largest picture within.
///
/// # Errors
/// There is none, or it is not known what a decoder would make of it.
pub fn largest(data: &[u8]) -> Result<Size, Unreadable> {
    // Some servers put an empty line before a picture.
    let mut rest = data.trim_ascii_start();
    if !rest.starts_with(&START) {
        return Err(Unreadable);
    }
    let mut largest = None;
    while let Some(start) = memchr::memmem::find(rest, &START) {
        let (size, after) = picture(&rest[start + START.len()..])?;
        largest = larger(largest, Some(size));
        rest = after;
    }
    largest.ok_or(Unreadable)
}

/// The size of a picture that has begun, and what follows it.
fn picture(mut rest: &[u8]) -> Result<(Size, &[u8]), Unreadable> {
    let (mut size, mut scanned, mut filled) = (None, false, false);
    loop {
        // Some cameras leave out its end. Where a marker was filled up, `jpegdec` then goes on at the wrong place.
        if rest.is_empty() && scanned && !filled {
            break;
        }
        filled |= rest.starts_with(&[0xff, 0xff]);
        let (kind, after) = marker(rest)?;
        if matches!(kind, SOI | EOI) {
            rest = if kind == EOI { after } else { rest };
            break;
        }
        let (content, after) = if is_restart(kind) { after.split_at(0) } else { segment(after)? };
        // The second field of a picture is looked for wherever the first one ended.
        if scanned && memchr::memmem::find(content, &START).is_some() {
            return Err(Unreadable);
        }
        if is_frame(kind) {
            size = larger(size, Some(frame(content)?));
        }
        scanned |= kind == SOS;
        rest = if kind == SOS || is_restart(kind) { after_entropy_coded(after)? } else { after };
    }
    size.filter(|_| scanned).map(|size| (size, rest)).ok_or(Unreadable)
}

/// Nothing but data follows it.
fn is_restart(kind: u8) -> bool {
    matches!(kind, 0xd0..=0xd7)
}

fn is_frame(kind: u8) -> bool {
    matches!(kind, 0xc0..=0xcf) && !matches!(kind, 0xc4 | 0xc8 | 0xcc)
}

/// The kind of the marker that has to stand here, and what follows it.
fn marker(data: &[u8]) -> Result<(u8, &[u8]), Unreadable> {
    let Some((0xff, filled)) = data.split_first() else { return Err(Unreadable) };
    // A marker may be filled up.
    let fill = filled.iter().take_while(|byte| **byte == 0xff).count();
    match filled[fill..].split_first() {
        // Others are none, or reserved, or have no length, which `jpegdec` does not know.
        Some((&kind, after)) if kind >= 0xc0 => Ok((kind, after)),
        _ => Err(Unreadable),
    }
}

/// What a segment holds, and what follows it. Its length counts itself.
fn segment(data: &[u8]) -> Result<(&[u8], &[u8]), Unreadable> {
    let (length, after) = data.split_first_chunk().ok_or(Unreadable)?;
    let length = usize::from(u16::from_be_bytes(*length)).checked_sub(2).ok_or(Unreadable)?;
    // One that goes on beyond the buffer is not skipped by libjpeg, and `jpegdec` waits for what is missing.
    after.split_at_checked(length).ok_or(Unreadable)
}

/// A frame header (T.81, B.2.2).
fn frame(content: &[u8]) -> Result<Size, Unreadable> {
    let &[_, y1, y0, x1, x0] = content.first_chunk::<5>().ok_or(Unreadable)?;
    let (width, height) = (u16::from_be_bytes([x1, x0]), u16::from_be_bytes([y1, y0]));
    // A height may come after the picture: too late.
    if width == 0 || height == 0 {
        return Err(Unreadable);
    }
    Ok(Size { width: width.into(), height: height.into() })
}

/// From the next marker on.
fn after_entropy_coded(data: &[u8]) -> Result<&[u8], Unreadable> {
    for at in memchr::memchr_iter(0xff, data) {
        match data.get(at + 1) {
            Some(0) => {}
            Some(_) => return Ok(&data[at..]),
            // The next buffer would make a marker of it.
            None => return Err(Unreadable),
        }
    }
    Ok(&[])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One scan, with a byte that looks like a marker and a restart.
    const SCAN: [u8; 20] =
        [0xff, SOS, 0, 12, 3, 1, 0, 2, 0, 3, 0, 0, 0x3f, 0, 0x12, 0xff, 0, 0xff, 0xd3, 0x34];
    const END: [u8; 2] = [0xff, EOI];
    const COM: u8 = 0xfe;
    const HUGE: u16 = 30_000;

    fn segment_of(kind: u8, content: &[u8]) -> Vec<u8> {
        let length = u16::try_from(content.len() + 2).unwrap().to_be_bytes();
        [&[0xff, kind][..], &length, content].concat()
    }

    fn frame_of(kind: u8, width: u16, height: u16) -> Vec<u8> {
        let sides = [height, width].map(u16::to_be_bytes).concat();
        segment_of(kind, &[&[8_u8][..], &sides, &[3, 1, 0x22, 0, 2, 0x11, 0, 3, 0x11, 0]].concat())
    }

    /// A frame with whatever stands before and behind it.
    fn picture_of(before: &[u8], frame: &[u8], behind: &[u8]) -> Vec<u8> {
        [&START[..], before, frame, behind].concat()
    }

    fn whole(width: u16, height: u16) -> Vec<u8> {
        picture_of(&[], &frame_of(0xc0, width, height), &[SCAN.as_slice(), &END].concat())
    }

    fn huge() -> Vec<u8> {
        frame_of(0xc2, HUGE, HUGE)
    }

    #[track_caller]
    fn assert_size(data: &[u8], width: u16, height: u16) {
        assert_eq!(largest(data), Ok(Size { width: width.into(), height: height.into() }));
    }

    #[track_caller]
    fn assert_unreadable(data: &[u8]) {
        assert_eq!(largest(data), Err(Unreadable));
    }

    #[test]
    fn ordinary_pictures_have_their_size() {
        let head = [segment_of(0xe0, b"JFIF\0"), segment_of(COM, b"of a camera"), segment_of(0xdb, &[0; 65])];
        let head = head.concat();
        let table = segment_of(0xc4, &[0; 17]);
        let scans = [table.as_slice(), &SCAN, &table, &SCAN, &END].concat();
        for kind in [0xc0, 0xc1, 0xc2] {
            let frame = frame_of(kind, 1920, 1080);
            assert_size(&picture_of(&head, &frame, &scans), 1920, 1080);
            // With an empty line before it, something after it, and without its end.
            let picture = picture_of(&head, &frame, &scans);
            assert_size(&[&b"\r\n"[..], &picture, b"\r\n\0\xff"].concat(), 1920, 1080);
            assert_size(&picture_of(&head, &frame, &SCAN), 1920, 1080);
        }
    }

    #[test]
    fn the_largest_of_several_counts() {
        let two = [whole(16, 16), whole(999, 16)];
        assert_size(&two.concat(), 999, 16);
        let frames = [frame_of(0xc0, 16, 16), huge(), frame_of(0xc0, 16, 16)].concat();
        assert_size(&picture_of(&[], &frames, &SCAN), HUGE, HUGE);
        // Without its end, the next one ends it.
        let open = picture_of(&[], &frame_of(0xc0, 16, 16), &SCAN);
        assert_size(&[open, whole(999, 16)].concat(), 999, 16);
    }

    #[test]
    fn half_a_picture_is_none() {
        let whole = whole(16, 16);
        let scan = whole.len() - SCAN.len() - END.len();
        for end in 0..scan + 14 {
            assert_unreadable(&whole[..end]);
        }
        assert_unreadable(b"no picture");
        assert_unreadable(&[START, END].concat());
        assert_unreadable(&[&whole[..], &START].concat());
        // The next buffer would make a marker of its last byte.
        assert_unreadable(&whole[..whole.len() - 1]);
    }

    /// Whoever takes what follows such a marker for a length lands at a small picture.
    #[test]
    fn markers_without_a_length_hide_no_picture() {
        for (kind, is_read) in [(0xd0, true), (0xd7, true), (0x01, false)] {
            let mut data = picture_of(&[0xff, kind], &huge(), &SCAN);
            data.resize(4 + 0xffc2, 0);
            data.extend(frame_of(0xc0, 16, 16));
            if is_read {
                assert_size(&data, HUGE, HUGE);
            } else {
                assert_unreadable(&data);
            }
        }
    }

    #[test]
    fn nothing_stands_between_segments() {
        for junk in [&[0_u8][..], &[0xff, 0], &[0x12, 0x34], &[0xff, 0xff, 0]] {
            let data = picture_of(junk, &huge(), &[SCAN.as_slice(), &END].concat());
            assert_unreadable(&[data, whole(16, 16)].concat());
        }
    }

    #[test]
    fn a_picture_in_a_comment_does_not_count() {
        let comment = segment_of(COM, &whole(16, 16));
        assert_size(&picture_of(&comment, &huge(), &SCAN), HUGE, HUGE);
        assert_unreadable(&picture_of(&[&*comment, &[0]].concat(), &huge(), &SCAN));
        // One that goes on beyond the buffer, or counts less than itself.
        for length in [0xffff_u16, 1, 0] {
            let comment = [&[0xff, COM][..], &length.to_be_bytes()].concat();
            assert_unreadable(&picture_of(&comment, &huge(), &whole(16, 16)));
        }
    }

    #[test]
    fn a_thumbnail_does_not_count() {
        for (width, height) in [(160, 120), (HUGE, HUGE)] {
            let exif = segment_of(0xe1, &[&b"Exif\0\0"[..], &whole(width, height)].concat());
            let frame = frame_of(0xc0, 1920, 1080);
            assert_size(&picture_of(&exif, &frame, &[SCAN.as_slice(), &END].concat()), 1920, 1080);
        }
    }

    #[test]
    fn markers_may_be_filled_up() {
        let end = [SCAN.as_slice(), &[0xff, 0xff], &END].concat();
        assert_size(&picture_of(&[0xff, 0xff], &frame_of(0xc0, 640, 480), &end), 640, 480);
        assert_size(&picture_of(&[0xff, 0xff], &huge(), &end), HUGE, HUGE);
        assert_unreadable(&picture_of(&[0xff], &frame_of(0xc0, 640, 480), &SCAN));
    }

    #[test]
    fn a_height_that_comes_later_is_not_known() {
        let later = [&SCAN[..], &segment_of(0xdc, &HUGE.to_be_bytes()), &END].concat();
        assert_unreadable(&picture_of(&[], &frame_of(0xc0, 16, 0), &later));
    }

    /// What comes in the next buffer would belong to it, or be taken for a second field.
    #[test]
    fn nothing_is_hidden_behind_a_scan() {
        let frame = frame_of(0xc0, 16, 16);
        for hidden in [&[0xff, COM, 0xff, 0xff, 0][..], &segment_of(COM, &START), &[0xff, COM]] {
            assert_unreadable(&picture_of(&[], &frame, &[&SCAN[..], hidden].concat()));
        }
    }
}
