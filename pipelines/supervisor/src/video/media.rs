// SPDX-License-Identifier: MPL-2.0

//! The packets of a camera's streams in an RTSP connection (RTP and RTCP, RFC 3550). `rtspsrc` keeps something of everybody who is
//! named in them until the pipeline ends, and a thread besides for everybody who sends. So only a few are named to it.

use std::borrow::Cow;
use std::collections::HashSet;
use std::ops::RangeInclusive;

use super::Failure;

/// A stream has one source, and one that is mixed names those that it is mixed of.
const MOST_SOURCES: usize = 64;

/// Bytes before a packet: `$`, the channel, and the length (RFC 2326, section 10.12).
const FRAME: usize = 4;

const VERSION: u8 = 2;

/// By its second byte a packet is RTCP, or else RTP (RFC 5761, section 4).
const RTCP: RangeInclusive<u8> = 200..=207;
const SENDER_REPORT: u8 = 200;

/// Bytes of a sender report without report blocks, and of one of these (section 6.4.1).
const REPORT: usize = 28;
const BLOCK: usize = 24;

/// A description of one source in five words (section 6.5), and the one name of all streams of a camera, by which they belong together.
const DESCRIPTION_HEAD: [u8; 4] = [0x81, 202, 0, 4];
const NAME: &[u8; 12] = b"\x01\x06camera\0\0\0\0";

/// Who sends, and what of it is passed on.
#[derive(Debug, Default)]
pub struct Media {
    sources: HashSet<u32>,
}

impl Media {
    /// What is passed on of a packet, with the four bytes before it; nothing of some.
    ///
    /// # Errors
    /// There are more sources than a camera has.
    pub fn pass<'a>(&mut self, packet: &'a [u8]) -> Result<Option<Cow<'a, [u8]>>, Failure> {
        let payload = packet.get(FRAME..).unwrap_or_default();
        if payload.first().is_none_or(|first| first >> 6 != VERSION) {
            return Ok(None);
        }
        if payload.get(1).is_some_and(|kind| RTCP.contains(kind)) {
            return Ok(self.report(packet).map(Cow::Owned));
        }
        let Some(sources) = sources_of(payload) else { return Ok(None) };
        self.sources.extend(sources);
        if self.sources.len() > MOST_SOURCES {
            return Err(Failure::new(format!("the camera sends as more than {MOST_SOURCES} sources")));
        }
        Ok(Some(Cow::Borrowed(packet)))
    }

    /// The report of a sender that is known, and a description of ours in place of what follows it. `rtspsrc` needs no more to know when a
    /// picture was taken and which streams belong together, and makes a source of whoever is named in other packets: descriptions,
    /// goodbyes, feedback. It reads a report without a look at its length, so one that is cut short is none.
    fn report(&self, packet: &[u8]) -> Option<Vec<u8>> {
        let (frame, payload) = packet.split_at_checked(FRAME)?;
        let [first, SENDER_REPORT, high, low, a, b, c, d, ..] = *payload else { return None };
        let length = 4 * (usize::from(u16::from_be_bytes([high, low])) + 1);
        let blocks = usize::from(first & 0x1f);
        let is_whole = length >= REPORT + blocks * BLOCK;
        let is_padded = first & 0x20 != 0;
        if !is_whole || is_padded || !self.sources.contains(&u32::from_be_bytes([a, b, c, d])) {
            return None;
        }
        let report = payload.get(..length)?;
        let mut passed = [frame, report, &DESCRIPTION_HEAD, &[a, b, c, d], NAME].concat();
        let length = u16::try_from(passed.len() - FRAME).ok()?;
        passed.get_mut(2..FRAME)?.copy_from_slice(&length.to_be_bytes());
        Some(passed)
    }
}

/// Who sends a packet of RTP, and those of whose it is mixed (section 5.1).
fn sources_of(payload: &[u8]) -> Option<impl Iterator<Item = u32>> {
    let mixed = usize::from(payload.first()? & 0xf);
    let (words, _) = payload.get(8..12 + 4 * mixed)?.as_chunks::<4>();
    Some(words.iter().map(|word| u32::from_be_bytes(*word)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One description of a source, whose number is 9.
    const DESCRIPTION: [u8; 12] = [0x81, 202, 0, 2, 0, 0, 0, 9, 1, 0, 0, 0];
    const GOODBYE: [u8; 8] = [0x81, 203, 0, 1, 0, 0, 0, 9];

    fn packet(channel: u8, payload: &[u8]) -> Vec<u8> {
        let [high, low] = u16::try_from(payload.len()).unwrap().to_be_bytes();
        [[b'$', channel, high, low].as_slice(), payload].concat()
    }

    fn rtp(source: u32, mixed: &[u32]) -> Vec<u8> {
        let first = 0x80 | u8::try_from(mixed.len()).unwrap();
        let mut payload = vec![first, 96, 0, 1, 0, 0, 0, 0];
        payload.extend([source].iter().chain(mixed).flat_map(|source| source.to_be_bytes()));
        payload.extend(b"picture");
        packet(0, &payload)
    }

    /// The same as it is passed on.
    fn passed_report(source: u32, blocks: &[u8]) -> Vec<u8> {
        report(source, &[blocks, &DESCRIPTION_HEAD, &source.to_be_bytes(), NAME].concat())
    }

    /// A sender's report, and what follows it in the same packet.
    fn report(source: u32, rest: &[u8]) -> Vec<u8> {
        let [a, b, c, d] = source.to_be_bytes();
        let mut payload = vec![0x80, SENDER_REPORT, 0, 6, a, b, c, d];
        payload.extend([7u8; 20]);
        payload.extend(rest);
        packet(1, &payload)
    }

    #[track_caller]
    fn passed(media: &mut Media, packet: &[u8]) -> Option<Vec<u8>> {
        media.pass(packet).unwrap().map(Cow::into_owned)
    }

    #[test]
    fn pictures_of_a_camera_pass_as_they_are() {
        let mut media = Media::default();
        for source in 0..MOST_SOURCES as u32 {
            let sent = rtp(source, &[]);
            assert_eq!(passed(&mut media, &sent), Some(sent.clone()));
            assert_eq!(passed(&mut media, &sent), Some(sent));
        }
    }

    #[test]
    fn who_sends_as_ever_other_sources_is_given_up() {
        let mut media = Media::default();
        for source in 0..MOST_SOURCES as u32 {
            media.pass(&rtp(source, &[])).unwrap();
        }
        let failure = media.pass(&rtp(MOST_SOURCES as u32, &[])).unwrap_err();
        assert_eq!(failure.reason, "the camera sends as more than 64 sources");
    }

    #[test]
    fn those_of_whom_it_is_mixed_count_too() {
        let mut media = Media::default();
        let mixed: Vec<u32> = (100..115).collect();
        let sent = rtp(1, &mixed);
        assert_eq!(passed(&mut media, &sent), Some(sent));
        let more = (2..10).find(|round| {
            let mixed: Vec<u32> = (0..15).map(|one| round * 100 + one).collect();
            media.pass(&rtp(1, &mixed)).is_err()
        });
        // 1 + 15 of before, and 15 more each time.
        assert_eq!(more, Some(5));
    }

    #[test]
    fn of_reports_only_that_of_a_known_sender_passes_and_alone() {
        let mut media = Media::default();
        assert_eq!(passed(&mut media, &report(7, &[])), None, "nobody is known yet");
        media.pass(&rtp(7, &[])).unwrap();
        assert_eq!(passed(&mut media, &report(7, &[])), Some(passed_report(7, &[])));
        assert_eq!(passed(&mut media, &report(7, &DESCRIPTION)), Some(passed_report(7, &[])));
        assert_eq!(passed(&mut media, &passed_report(7, &[])), Some(passed_report(7, &[])));
        assert_eq!(passed(&mut media, &report(7, &[0xff])), Some(passed_report(7, &[])));
        assert_eq!(passed(&mut media, &report(8, &DESCRIPTION)), None);
        for other in [&DESCRIPTION[..], &GOODBYE] {
            assert_eq!(passed(&mut media, &packet(1, other)), None, "{other:?}");
        }
    }

    /// `rtspsrc` would read on behind their end.
    #[test]
    fn reports_that_are_shorter_than_they_say_are_none() {
        let mut media = Media::default();
        media.pass(&rtp(7, &[])).unwrap();
        let whole = report(7, &[]);
        for (at, byte, what) in [
            (4, 0xa0, "padding"),
            (4, 0x81, "a block that is not there"),
            (4, 0x40, "another version"),
            (7, 5, "too short for what it says"),
            (7, 7, "longer than the packet"),
        ] {
            let mut sent = whole.clone();
            sent[at] = byte;
            assert_eq!(passed(&mut media, &sent), None, "{what}");
        }
        let [mut with_block, mut expected] = [report(7, &[3; BLOCK]), passed_report(7, &[3; BLOCK])];
        for sent in [&mut with_block, &mut expected] {
            (sent[4], sent[7]) = (0x81, 12);
        }
        assert_eq!(passed(&mut media, &with_block), Some(expected));
    }

    #[test]
    fn what_is_cut_short_is_nothing() {
        let mut media = Media::default();
        let whole = rtp(7, &[8, 9]);
        // Four bytes of frame, twelve of head, and two sources.
        for length in 0..24 {
            assert_eq!(passed(&mut media, &whole[..length]), None, "{length}");
        }
        assert_eq!(passed(&mut media, &report(7, &[])), None, "somebody is known by that");
        assert_eq!(passed(&mut media, &whole[..24]).unwrap(), whole[..24]);
    }

    #[test]
    fn nothing_that_comes_breaks_it() {
        let (mut media, mut state) = (Media::default(), 1u64);
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state.to_be_bytes()[0]
        };
        for round in 0..100_000 {
            let mut sent: Vec<u8> = (0..draw() % 48).map(|_| draw()).collect();
            if round % 2 == 0 && sent.len() > 5 {
                // Else hardly any is of this version, or a report.
                (sent[4], sent[5]) = (0x80 | (sent[4] & 0x3f), SENDER_REPORT);
            }
            if let Ok(Some(passed)) = media.pass(&sent) {
                assert!(passed.len() <= sent.len() + 20, "{sent:?}");
            }
        }
    }
}
