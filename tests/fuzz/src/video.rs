// SPDX-License-Identifier: MPL-2.0

//! What a camera, or whoever answers in its place, sends as video.

use futures_util::FutureExt;
use pipeline_supervisor::video::media::Media;
use pipeline_supervisor::video::multipart::Multipart;
use pipeline_supervisor::video::rtsp_message::Item;

/// Bytes of a description that is added to a report.
const DESCRIPTION: usize = 20;

/// What is left of a packet is one, hardly longer than that, and the same once it is passed on again.
pub fn media(bytes: &[u8]) -> bool {
    let (mut wire, mut media, mut understood) = (bytes, Media::default(), false);
    // Bytes in memory are there at once.
    while let Some(Ok(Some(item))) = Item::read(&mut wire).now_or_never() {
        let Item::Packet(packet) = item else { continue };
        let Ok(passed) = media.pass(&packet) else { break };
        let Some(passed) = passed else { continue };
        assert!(passed.len() <= packet.len() + DESCRIPTION && is_packet(&passed));
        assert_eq!(media.pass(&passed).expect("few sources").as_deref(), Some(&*passed));
        understood = true;
    }
    understood
}

fn is_packet(bytes: &[u8]) -> bool {
    let again = Item::read(&mut &bytes[..]).now_or_never();
    matches!(again, Some(Ok(Some(Item::Packet(packet)))) if packet == bytes)
}

/// Pictures are the same once they were passed on, and in whatever pieces they came.
pub fn multipart(bytes: &[u8]) -> bool {
    let whole = pictures(bytes, bytes.len());
    // One of them for each input: there are millions, and a byte at a time takes longest.
    let sizes = [1, 2, 3, 7, bytes.len() / 2];
    let size = sizes[bytes.len() % sizes.len()];
    assert_eq!(pictures(bytes, size), whole, "in pieces of {size}");
    let Some(passed) = whole else { return false };
    assert_eq!(pictures(&passed, passed.len()).as_ref(), Some(&passed));
    !passed.is_empty()
}

/// What is passed on of bytes that come in pieces of this size, unless they are refused.
fn pictures(bytes: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut parts = Multipart::default();
    let passed: Result<Vec<_>, _> = bytes.chunks(size.max(1)).map(|piece| parts.pass(piece)).collect();
    Some(passed.ok()?.concat())
}
