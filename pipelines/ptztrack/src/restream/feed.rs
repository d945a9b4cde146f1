// SPDX-License-Identifier: MPL-2.0

//! Carries packets of a camera to the pipeline of those who watch it, while that is there.

use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use gst::prelude::*;
use gst_app::AppSrc;
use onvif::metadata::{Object, document};

use crate::camera::{Content, Packet, Person, next_packet};
use crate::config::Codec;
use crate::fleet::Fleet;

/// Where packets come from, and where they go.
pub struct Feed {
    pub fleet: Arc<Fleet>,
    pub camera: String,
    pub codec: Codec,
    pub video: glib::WeakRef<AppSrc>,
    pub metadata: glib::WeakRef<AppSrc>,
}

impl Feed {
    /// Until nobody watches any more, or the camera is no more.
    pub async fn run(self) {
        // One that was begun anew is the same.
        while let Some(camera) = self.fleet.of_codec(&self.camera, self.codec) {
            let mut packets = camera.packets.subscribe();
            drop(camera);
            while let Some(packet) = next_packet(&mut packets).await {
                if self.pass_on(packet).is_none() {
                    return;
                }
            }
        }
        for source in [&self.video, &self.metadata].into_iter().filter_map(glib::WeakRef::upgrade) {
            let _ = source.end_of_stream();
        }
    }

    /// `None`: nobody watches any more.
    fn pass_on(&self, packet: Packet) -> Option<()> {
        let (video, metadata) = (self.video.upgrade()?, self.metadata.upgrade()?);
        match packet.content {
            Content::Picture { caps, delta, data } => {
                let caps = gst::Caps::from_str(&caps).ok();
                let mut buffer = gst::Buffer::from_slice(data);
                if let Some(buffer) = buffer.get_mut().filter(|_| delta) {
                    buffer.set_flags(gst::BufferFlags::DELTA_UNIT);
                }
                push(&video, packet.at, buffer, caps.as_ref());
            }
            Content::People(people) => {
                let objects: Vec<Object> = people.iter().map(object).collect();
                if let Ok(document) = document(taken(packet.at), &objects) {
                    push(&metadata, packet.at, gst::Buffer::from_slice(document), None);
                }
            }
        }
        Some(())
    }
}

fn object(person: &Person) -> Object {
    Object { id: person.id, bounds: person.bounds, likelihood: person.confidence }
}

/// Waits for nothing: what is not sent in time is dropped there.
fn push(source: &AppSrc, at: u64, mut buffer: gst::Buffer, caps: Option<&gst::Caps>) {
    // Before it runs, it has no time yet, and takes nothing.
    let began = source.base_time().filter(|_| source.current_state() == gst::State::Playing);
    let time = began.and_then(|began| gst::ClockTime::from_nseconds(at).checked_sub(began));
    let (Some(time), Some(writable)) = (time, buffer.get_mut()) else { return };
    writable.set_pts(time);
    if caps.is_some() && source.caps().as_ref() != caps {
        source.set_caps(caps);
    }
    // Where it has ended meanwhile, nobody watches.
    let _ = source.push_buffer(buffer);
}

/// By the calendar.
fn taken(at: u64) -> SystemTime {
    let now = gst::SystemClock::obtain().time().nseconds();
    SystemTime::now() - Duration::from_nanos(now.saturating_sub(at))
}
