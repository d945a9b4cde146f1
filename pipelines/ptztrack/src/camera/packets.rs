// SPDX-License-Identifier: MPL-2.0

//! A camera's stream as it comes, and what is seen in it, for who passes both on. Where nobody does, nothing is copied.

use std::sync::Arc;

use axum::body::Bytes;
use gst::prelude::*;
use ptztrack_contract::{BufferMeta, TrackState, TracksMeta};
use serde::{Deserialize, Serialize};
use tokio::sync::broadcast::{Receiver, Sender, error::RecvError};

use super::bounds;
use super::known::Known;
use super::sight::Person;

/// The decoder of a camera's pictures: what comes to it is passed on.
pub const DECODER: &str = "decoder";

/// So many wait for who takes them; of the oldest ones a slow taker misses some.
const MOST: usize = 64;

/// A picture as it is encoded, or who was seen in one.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Packet {
    /// When the picture came, in nanoseconds of the machine's monotonic clock, which its processes have in common.
    pub at: u64,
    pub content: Content,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Content {
    Picture {
        caps: String,
        /// It builds on those before.
        delta: bool,
        #[serde(with = "super::process::bytes")]
        data: Bytes,
    },
    People(Vec<Person>),
}

/// For the packets of one camera.
pub fn channel() -> Sender<Packet> {
    Sender::new(MOST)
}

/// The next one, however many were missed; `None` where the camera is no more.
pub async fn next(packets: &mut Receiver<Packet>) -> Option<Packet> {
    loop {
        match packets.recv().await {
            Ok(packet) => return Some(packet),
            Err(RecvError::Lagged(_)) => {}
            Err(RecvError::Closed) => return None,
        }
    }
}

/// Hands on what this pipeline gets and sees, to whoever takes it.
pub fn tap(pipeline: &gst::Pipeline, tracker: Option<&gst::Element>, known: &Arc<Known>) {
    // In the time of a clock that others have, too.
    pipeline.use_clock(Some(&gst::SystemClock::obtain()));
    if let Some(pad) = pipeline.by_name(DECODER).and_then(|decoder| decoder.static_pad("sink")) {
        watch(&pad, known, |pad, buffer| {
            let caps = caps(pad, buffer)?.to_string();
            let data = Bytes::copy_from_slice(&buffer.map_readable().ok()?);
            let delta = buffer.flags().contains(gst::BufferFlags::DELTA_UNIT);
            Some(Content::Picture { caps, delta, data })
        });
    }
    if let Some(pad) = tracker.and_then(|tracker| tracker.static_pad("src")) {
        watch(&pad, known, |_, buffer| {
            let meta = TracksMeta::of(buffer)?.ok()?;
            let seen = meta.tracks.iter().filter(|track| track.state != TrackState::Hidden);
            Some(Content::People(seen.map(Person::from).collect()))
        });
    }
}

fn watch(
    pad: &gst::Pad,
    known: &Arc<Known>,
    content: impl Fn(&gst::Pad, &gst::BufferRef) -> Option<Content> + Send + Sync + 'static,
) {
    let known = known.clone();
    pad.add_probe(gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST, move |pad, info| {
        let buffers: Vec<&gst::BufferRef> = match &info.data {
            _ if known.packets.receiver_count() == 0 => Vec::new(),
            Some(gst::PadProbeData::Buffer(buffer)) => vec![buffer],
            Some(gst::PadProbeData::BufferList(list)) => list.iter().collect(),
            _ => Vec::new(),
        };
        for buffer in buffers {
            if let Some((at, content)) = moment(pad, buffer).zip(content(pad, buffer)) {
                // Whoever took them may be gone by now.
                let _ = known.packets.send(Packet { at, content });
            }
        }
        gst::PadProbeReturn::Ok
    });
}

/// Whoever sends JPEG by RTP has to know its size, which a stream by HTTP does not tell.
fn caps(pad: &gst::Pad, buffer: &gst::BufferRef) -> Option<gst::Caps> {
    let mut caps = pad.current_caps()?;
    if caps.structure(0)?.name() == "image/jpeg" {
        let (width, height) = bounds::size_of(pad, buffer)?;
        let (width, height) = (i32::try_from(width).ok()?, i32::try_from(height).ok()?);
        caps.make_mut().set("width", width);
        caps.make_mut().set("height", height);
    }
    Some(caps)
}

/// When a picture came, by the pipeline's clock.
fn moment(pad: &gst::Pad, buffer: &gst::BufferRef) -> Option<u64> {
    let segment = pad.sticky_event::<gst::event::Segment>(0)?;
    let running = segment.segment().downcast_ref::<gst::ClockTime>()?.to_running_time(buffer.pts()?)?;
    Some((pad.parent_element()?.base_time()? + running).nseconds())
}
