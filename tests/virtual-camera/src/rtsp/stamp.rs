// SPDX-License-Identifier: MPL-2.0

//! Right times for MPEG-4 pictures, and each of them sent at once.
//!
//! `avenc_mpeg4` of GStreamer 1.22 stamps every picture with 2⁶³ ns, and `rtpmp4vpay` waits for the next picture, or for
//! several, before it sends one. Between the two, this gives every picture the time it went into the encoder with, and
//! lets a segment event follow it, which makes the payloader send what it has.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex},
};

use gst::prelude::*;

use crate::sync::lock;

type Times = Arc<Mutex<VecDeque<Option<gst::ClockTime>>>>;

/// Corrects what leaves `encoder`, which has no bidirectional pictures: one comes out for each that goes in, in order.
pub(super) fn correct(encoder: &gst::Element) {
    let times = Times::default();
    if let (Some(sink), Some(source)) = (encoder.static_pad("sink"), encoder.static_pad("src")) {
        let entering = times.clone();
        sink.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
            lock(&entering).extend(info.buffer().map(|buffer| buffer.pts()));
            gst::PadProbeReturn::Ok
        });
        source.add_probe(gst::PadProbeType::BUFFER, move |pad, info| send(pad, info, &times));
        source.add_probe(gst::PadProbeType::EVENT_DOWNSTREAM, |_, info| {
            if let Some(event) = info.event_mut().filter(|event| event.type_() == gst::EventType::Segment) {
                // The encoder's own begins a thousand hours later.
                *event = plain_segment();
            }
            gst::PadProbeReturn::Ok
        });
    }
}

fn plain_segment() -> gst::Event {
    gst::event::Segment::new(&gst::FormattedSegment::<gst::ClockTime>::new())
}

fn send(pad: &gst::Pad, info: &mut gst::PadProbeInfo, times: &Times) -> gst::PadProbeReturn {
    let time = lock(times).pop_front().flatten();
    let (Some(mut buffer), Some(peer)) = (info.take_buffer(), pad.peer()) else {
        return gst::PadProbeReturn::Ok;
    };
    let stamped = buffer.make_mut();
    stamped.set_pts(time);
    stamped.set_dts(time);
    let flow = peer.chain(buffer);
    if flow.is_ok() {
        peer.send_event(plain_segment());
    }
    info.flow_res = flow;
    gst::PadProbeReturn::Handled
}
