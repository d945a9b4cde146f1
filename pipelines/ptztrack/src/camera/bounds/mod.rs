// SPDX-License-Identifier: MPL-2.0

//! What whoever answers in a camera's place can make us hold in memory. A decoder believes the size that a stream announces, and
//! takes the memory for it before there is a picture; an element that waits for the end of a picture keeps what comes until
//! then. So both are looked at on their way.

mod headers;
mod jpeg;
mod sizes;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use gst::prelude::*;
use sizes::{Codec, Size};

/// The most pixels that are decoded: those of 8K, as cinemas have it.
const MOST_PIXELS: u64 = 8192 * 4320;

/// The most bytes of one encoded picture, with what its buffers take besides: one that large of poorly compressed JPEG.
const MOST_BYTES: usize = 64 * 1024 * 1024;

/// What a buffer takes beside the bytes in it: its own structure, that of its memory, and its place where it waits. Together they are
/// half of that to all of it, so a stream of tiny buffers takes far more than it sends.
pub const BUFFER: usize = 1024;

/// Pictures in a row that cannot be read, of which the network may have broken some: a second or two.
const MOST_UNREADABLE: usize = 50;

/// Ends the pipeline with an error before one of its decoders gets a picture that is too large, or what `source` brings grows
/// without end before there is one.
pub fn keep(pipeline: &gst::Pipeline, source: Option<&gst::Element>) {
    let waiting = Arc::new(AtomicUsize::new(0));
    for decoder in pipeline.iterate_recurse().into_iter().flatten() {
        let decodes = |factory: gst::ElementFactory| factory.has_type(gst::ElementFactoryType::DECODER);
        if decoder.factory().is_some_and(decodes)
            && let Some(pad) = decoder.static_pad("sink")
        {
            look_at_sizes(&pad, waiting.clone());
        }
    }
    // What goes in, where anything does: a depayloader keeps packets until they are a picture, and nothing comes out until then.
    if let Some(pad) =
        source.and_then(|source| source.static_pad("sink").or_else(|| source.static_pad("src")))
    {
        count(&pad, waiting);
    }
}

/// Width and height that a stream announces, of the codec with this number.
pub fn picture_size(codec: u8, stream: &[u8]) -> Option<(u32, u32)> {
    let codec = Codec::ALL[usize::from(codec) % Codec::ALL.len()];
    // It is as sure of what stands before the stream.
    let head = codec.size_in_head(stream).ok().flatten();
    let size = sizes::larger(head, codec.size_in(stream).ok().flatten())?;
    Some((size.width, size.height))
}

/// The size that a picture announces, which comes to this pad.
pub fn size_of(pad: &gst::Pad, picture: &gst::BufferRef) -> Option<(u32, u32)> {
    let size = of_buffers(pad, [picture]).ok().flatten()?;
    Some((size.width, size.height))
}

/// The bytes that a buffer takes of our memory.
pub fn cost(buffer: &gst::BufferRef) -> usize {
    buffer.size().saturating_add(BUFFER)
}

/// What comes is counted until a decoder gets a picture.
fn count(pad: &gst::Pad, waiting: Arc<AtomicUsize>) {
    pad.add_probe(gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST, move |pad, info| {
        let bytes = match &info.data {
            Some(gst::PadProbeData::Buffer(buffer)) => cost(buffer),
            Some(gst::PadProbeData::BufferList(list)) => list.iter().map(cost).sum(),
            _ => 0,
        };
        if waiting.fetch_add(bytes, Ordering::Relaxed) + bytes > MOST_BYTES {
            return refuse(pad, &format!("{MOST_BYTES} bytes of memory are taken without a picture"));
        }
        gst::PadProbeReturn::Ok
    });
}

/// Nothing reaches a decoder that announces more than is to be decoded.
fn look_at_sizes(pad: &gst::Pad, waiting: Arc<AtomicUsize>) {
    let kinds =
        gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST | gst::PadProbeType::EVENT_DOWNSTREAM;
    let unreadable = AtomicUsize::new(0);
    pad.add_probe(kinds, move |pad, info| {
        let largest = match &info.data {
            Some(gst::PadProbeData::Event(event)) => of_event(event),
            Some(gst::PadProbeData::Buffer(buffer)) => of_buffers(pad, [&**buffer]),
            Some(gst::PadProbeData::BufferList(list)) => of_buffers(pad, list.iter()),
            _ => Ok(None),
        };
        if info.event().is_none() {
            waiting.store(0, Ordering::Relaxed);
        }
        match largest {
            Ok(Some(size)) if size.pixels() > MOST_PIXELS => {
                let Size { width, height } = size;
                refuse(pad, &format!("a picture of {width}x{height} is announced, which is not decoded"))
            }
            Ok(_) => {
                if info.event().is_none() {
                    unreadable.store(0, Ordering::Relaxed);
                }
                gst::PadProbeReturn::Ok
            }
            Err(sizes::Unreadable) if unreadable.fetch_add(1, Ordering::Relaxed) + 1 >= MOST_UNREADABLE => {
                refuse(
                    pad,
                    &format!("{MOST_UNREADABLE} pictures came one after the other whose size cannot be read"),
                )
            }
            // No decoder is to guess it. Not `Drop`: on a sink pad GStreamer 1.22 then lets go of data that the bindings have taken.
            Err(sizes::Unreadable) => gst::PadProbeReturn::Handled,
        }
    });
}

/// Caps hold what a stream begins with.
fn of_event(event: &gst::Event) -> Result<Option<Size>, sizes::Unreadable> {
    let gst::EventView::Caps(caps) = event.view() else { return Ok(None) };
    let Some((codec, data)) = Codec::of(caps.caps()).zip(sizes::codec_data(caps.caps())) else {
        return Ok(None);
    };
    let Ok(data) = data.map_readable() else { return Ok(None) };
    codec.size_in_head(&data)
}

fn of_buffers<'a>(
    pad: &gst::Pad,
    buffers: impl IntoIterator<Item = &'a gst::BufferRef>,
) -> Result<Option<Size>, sizes::Unreadable> {
    let caps = pad.current_caps();
    let Some(codec) = caps.as_deref().and_then(Codec::of) else { return Ok(None) };
    let mut largest = None;
    for buffer in buffers {
        if let Ok(data) = buffer.map_readable() {
            largest = sizes::larger(largest, codec.size_in(&data)?);
        }
    }
    Ok(largest)
}

fn refuse(pad: &gst::Pad, why: &str) -> gst::PadProbeReturn {
    if let Some(element) = pad.parent_element() {
        gst::element_error!(element, gst::StreamError::Decode, ("{why}"));
    }
    gst::PadProbeReturn::Handled
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a pipeline with this decoder says of these bytes.
    fn error_of(decoder: &str, caps: &str, bytes: &[&[u8]]) -> Option<String> {
        gst::init().unwrap();
        let buffers = bytes.iter().map(|bytes| gst::Buffer::from_slice(bytes.to_vec()));
        error_of_buffers(decoder, caps, buffers)
    }

    /// The same of buffers. Counted is as in a pipeline of ours: at what is called `received`, or else at the source.
    fn error_of_buffers(
        decoder: &str,
        caps: &str,
        buffers: impl Iterator<Item = gst::Buffer>,
    ) -> Option<String> {
        gst::init().unwrap();
        let caps: gst::Caps = caps.parse().unwrap();
        let pipeline =
            gst::parse::launch(&format!("appsrc name=source format=time ! {decoder} ! fakesink")).unwrap();
        let pipeline = pipeline.downcast::<gst::Pipeline>().unwrap();
        let source = pipeline.by_name("source").unwrap();
        keep(&pipeline, Some(&pipeline.by_name("received").unwrap_or_else(|| source.clone())));
        let source = source.downcast::<gst_app::AppSrc>().unwrap();
        source.set_caps(Some(&caps));
        for buffer in buffers {
            source.push_buffer(buffer).unwrap();
        }
        source.end_of_stream().unwrap();
        let _ = pipeline.set_state(gst::State::Playing);
        let kinds = [gst::MessageType::Eos, gst::MessageType::Error];
        let message =
            pipeline.bus().unwrap().timed_pop_filtered(gst::ClockTime::from_seconds(60), &kinds).unwrap();
        pipeline.set_state(gst::State::Null).unwrap();
        match message.view() {
            gst::MessageView::Error(error) => Some(error.error().message().to_owned()),
            _ => None,
        }
    }

    /// Peak of the memory of this process, in kilobytes.
    fn peak() -> u64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
        line.trim_end_matches("kB").trim().parse().unwrap()
    }

    /// Progressive: of these, libjpeg takes the memory before it hands anything out.
    #[test]
    fn a_picture_that_claims_to_be_huge_takes_no_memory() {
        // Also after a marker that has no length.
        for start in [&[0xff_u8, 0xd8][..], &[0xff, 0xd8, 0xff, 0xd0]] {
            let mut jpeg = [start, &[0xff, 0xc2, 0, 17, 8]].concat();
            jpeg.extend([30000_u16, 30000].map(u16::to_be_bytes).concat());
            jpeg.extend([3, 1, 0x22, 0, 2, 0x11, 0, 3, 0x11, 0]);
            jpeg.extend([0xff, 0xda, 0, 12, 3, 1, 0, 2, 0, 3, 0, 0, 0, 0]);
            jpeg.resize(4096, 0);
            let before = peak();
            let error = error_of("jpegdec", "image/jpeg", &[&jpeg]);
            assert!(error.as_ref().is_some_and(|error| error.contains("30000x30000")), "{error:?}");
            assert!(peak() < before + 200_000, "{before}, then {}", peak());
        }
    }

    #[test]
    fn what_never_becomes_a_picture_is_not_kept() {
        let endless = vec![b'x'; MOST_BYTES + 1];
        let error = error_of("multipartdemux ! jpegdec", "multipart/x-mixed-replace", &[&endless]);
        assert!(error.as_ref().is_some_and(|error| error.contains("without a picture")), "{error:?}");
    }

    /// What is said of so many packets of RTP (RFC 3550), none of which has the marker that ends a picture.
    fn error_of_packets(number: usize, carried: impl Fn() -> gst::Memory) -> Option<String> {
        let packets = (0..number).map(|number| {
            let [.., high, low] = number.to_be_bytes();
            let mut packet = gst::Buffer::from_slice([0x80, 96, high, low, 0, 0, 0, 0, 0, 0, 0, 1]);
            packet.get_mut().unwrap().append_memory(carried());
            packet
        });
        let caps = "application/x-rtp,media=video,clock-rate=90000,encoding-name=MP4V-ES";
        error_of_buffers("rtpmp4vdepay name=received", caps, packets)
    }

    /// They carry the same memory: another test looks at how much this process takes.
    #[test]
    fn packets_that_never_become_a_picture_are_not_kept() {
        gst::init().unwrap();
        let carried = gst::Memory::from_slice(vec![b'x'; 1 << 20]);
        let error = error_of_packets((MOST_BYTES >> 20) + 1, || carried.clone());
        assert!(error.as_ref().is_some_and(|error| error.contains("without a picture")), "{error:?}");
    }

    /// A byte each: what they carry would be millions of them below the bound.
    #[test]
    fn packets_with_hardly_anything_in_them_are_not_kept_either() {
        gst::init().unwrap();
        let error = error_of_packets(MOST_BYTES / BUFFER, || gst::Memory::from_slice([b'x']));
        assert!(error.as_ref().is_some_and(|error| error.contains("without a picture")), "{error:?}");
    }

    #[test]
    fn a_list_of_buffers_costs_what_each_of_them_does() {
        gst::init().unwrap();
        let pad = gst::Pad::new(gst::PadDirection::Src);
        let waiting = Arc::new(AtomicUsize::new(0));
        count(&pad, waiting.clone());
        pad.set_active(true).unwrap();
        pad.push_event(gst::event::StreamStart::new("packets"));
        pad.push_event(gst::event::Segment::new(&gst::FormattedSegment::<gst::ClockTime>::new()));
        let list: gst::BufferList = (0..3).map(|_| gst::Buffer::from_slice([b'x'])).collect();
        // Nothing is linked that would take them.
        let _ = pad.push_list(list);
        assert_eq!(waiting.load(Ordering::Relaxed), 3 * (BUFFER + 1));
    }

    #[test]
    fn pictures_that_cannot_be_read_are_said() {
        let none: &[u8] = b"no picture";
        let error = error_of("jpegdec", "image/jpeg", &[none; MOST_UNREADABLE]);
        assert!(error.as_ref().is_some_and(|error| error.contains("cannot be read")), "{error:?}");
    }
}
