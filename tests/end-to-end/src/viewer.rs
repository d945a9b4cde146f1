// SPDX-License-Identifier: MPL-2.0

//! Whoever watches a camera that `ptztrack` passes on by RTSP, with what is seen in it.

use std::time::Duration;

use gst::prelude::*;

use crate::{PATIENCE, Running};

/// Watches pictures and documents.
pub struct Viewer {
    running: Running,
}

/// The times of a picture, or of a document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// When it was taken, since 1970, where the sender's reports have told that yet.
    pub taken: Option<Duration>,
    /// The same by RTP: 90,000 a second, from anywhere on.
    pub rtp: u32,
}

/// Between the beginnings of NTP's calendar and of Unix' (RFC 5905).
const NTP_TO_UNIX: Duration = Duration::from_secs(2_208_988_800);

impl Viewer {
    /// Begins to watch, with an `rtspsrc` that is set up by `set_up`.
    ///
    /// Its pads are linked here: where two come at once, from two threads, what GStreamer makes of two links in a description ends twice.
    #[track_caller]
    pub fn start(url: &str, set_up: impl FnOnce(&gst::Element)) -> Self {
        let running = Running::parse(&format!(
            "rtspsrc name=source location={url} protocols=tcp latency=0 add-reference-timestamp-meta=true \
             appsink name=video sync=false appsink name=metadata sync=false"
        ));
        let source = running.element("source");
        let sinks = [("video", "video"), ("application", "metadata")].map(|(media, sink)| {
            (media, running.element(sink).static_pad("sink").expect("every sink has one"))
        });
        source.connect_pad_added(move |_, pad| {
            let caps = pad.current_caps().unwrap_or_else(|| pad.query_caps(None));
            let media = caps.structure(0).and_then(|caps| caps.get::<&str>("media").ok());
            if let Some((_, sink)) = sinks.iter().find(|(carried, _)| media == Some(*carried)) {
                pad.link(sink).expect("an `appsink` takes anything");
            }
        });
        set_up(&source);
        running.pipeline().set_state(gst::State::Playing).unwrap();
        Self { running }
    }

    /// What ends it.
    #[track_caller]
    pub fn error(&self) -> String {
        let bus = self.running.pipeline().bus().unwrap();
        let patience = gst::ClockTime::try_from(PATIENCE).unwrap();
        let message = bus.timed_pop_filtered(patience, &[gst::MessageType::Error]);
        message.expect("nothing ended it").structure().unwrap().to_string()
    }

    /// The next picture.
    #[track_caller]
    pub fn picture(&self) -> Times {
        self.packets("video").1
    }

    /// The next document, and its times.
    #[track_caller]
    pub fn document(&self) -> (String, Times) {
        let (text, times) = self.packets("metadata");
        (String::from_utf8(text).unwrap(), times)
    }

    /// What the packets carry up to the next one that is marked as the last.
    #[track_caller]
    fn packets(&self, sink: &str) -> (Vec<u8>, Times) {
        let sink = self.running.element(sink).downcast::<gst_app::AppSink>().unwrap();
        let patience = gst::ClockTime::try_from(PATIENCE).unwrap();
        let mut carried = Vec::new();
        loop {
            let sample = sink.try_pull_sample(patience).expect("nothing came");
            let buffer = sample.buffer().unwrap();
            let rtp = gst_rtp::RTPBuffer::from_buffer_readable(buffer).unwrap();
            carried.extend_from_slice(rtp.payload().unwrap());
            if rtp.is_marker() {
                let reference = buffer.iter_meta::<gst::ReferenceTimestampMeta>().next();
                let taken = reference.map(|meta| Duration::from(meta.timestamp()) - NTP_TO_UNIX);
                return (carried, Times { taken, rtp: rtp.timestamp() });
            }
        }
    }
}
