// SPDX-License-Identifier: MPL-2.0

//! A recording from a file, decoded as it is looked at.

use std::{
    collections::{BTreeMap, VecDeque},
    path::PathBuf,
    sync::Arc,
};

use gst::prelude::*;

use super::{
    mot::{self, MotError},
    panorama::{Person, Recording},
    timeline::Timeline,
};
use crate::{picture::Picture, settings::FootageSettings};

/// Pictures kept, for clients that look at slightly different times.
const KEPT: usize = 8;
/// A longer way ahead is sought, a shorter one decoded.
const SEEK_BEYOND: u64 = 100;
/// For decoders that come from a cold disk, on a busy machine.
const PATIENCE: gst::ClockTime = gst::ClockTime::from_seconds(60);

/// Why there is nothing to see.
#[derive(Debug, thiserror::Error)]
pub enum FootageError {
    /// A photograph cannot be walked in.
    #[error(transparent)]
    Photo(#[from] super::photo::PhotoError),
    /// No such file, or not one to read.
    #[error("cannot read the footage {path}: {source}")]
    Unreadable {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// GStreamer cannot decode it.
    #[error("cannot decode the footage {path}: {reason}")]
    Undecodable {
        /// As given.
        path: PathBuf,
        /// What GStreamer says.
        reason: String,
    },
    /// The settings leave no picture of it.
    #[error("the footage {path} has {frames} pictures; it cannot start at picture {start}")]
    Empty {
        /// As given.
        path: PathBuf,
        /// How many there are.
        frames: u64,
        /// Where to start.
        start: u64,
    },
    /// Its ground truth cannot be used.
    #[error(transparent)]
    GroundTruth(#[from] MotError),
}

/// A looped recording.
pub(super) struct Footage {
    path: PathBuf,
    pipeline: gst::Pipeline,
    sink: gst_app::AppSink,
    info: gst_video::VideoInfo,
    timeline: Arc<Timeline>,
    /// Number of the picture that the decoder gives next.
    next: u64,
    recent: VecDeque<(u64, Arc<Picture>)>,
    people: BTreeMap<u64, Vec<Person>>,
}

impl Footage {
    pub fn open(settings: &FootageSettings) -> Result<Self, FootageError> {
        let people = settings.ground_truth.as_deref().map(mot::read).transpose()?.unwrap_or_default();
        let path = settings.file.clone();
        std::fs::File::open(&path)
            .map_err(|source| FootageError::Unreadable { path: path.clone(), source })?;
        let undecodable = |reason: String| FootageError::Undecodable { path: path.clone(), reason };
        let pipeline = decoder(&path, "I420").map_err(|error| undecodable(error.to_string()))?;
        let sink = pipeline.by_name("sink").and_downcast::<gst_app::AppSink>();
        let sink = sink.ok_or_else(|| undecodable("the decoder has no sink".into()))?;
        let started = starts(&pipeline);
        let info = sink
            .sink_pads()
            .first()
            .filter(|_| started)
            .and_then(|pad| pad.current_caps())
            .and_then(|caps| gst_video::VideoInfo::from_caps(&caps).ok());
        let Some(info) = info else {
            let reason = undecodable(reason(&pipeline));
            stop(&pipeline);
            return Err(reason);
        };
        let frame_rate = match info.fps() {
            fps if fps.numer() > 0 => f64::from(fps.numer()) / f64::from(fps.denom()),
            _ => 25.0,
        };
        let length = pipeline.query_duration::<gst::ClockTime>().unwrap_or(gst::ClockTime::MAX);
        let frames = (length.nseconds() as f64 / 1e9 * frame_rate).round() as u64;
        let start = (settings.start.as_secs_f64() * frame_rate) as u64;
        let timeline = Arc::new(Timeline::new(frame_rate, start, frames, settings.looped));
        let recent = VecDeque::new();
        let footage = Self { path: path.clone(), pipeline, sink, info, timeline, next: 0, recent, people };
        if start >= frames {
            return Err(FootageError::Empty { path, frames, start });
        }
        footage
            .pipeline
            .set_state(gst::State::Playing)
            .map_err(|error| FootageError::Undecodable { path, reason: error.to_string() })?;
        Ok(footage)
    }

    fn pull(&mut self) -> Result<Option<Arc<Picture>>, FootageError> {
        let Some(sample) = self.sink.try_pull_sample(PATIENCE) else {
            if self.sink.is_eos() {
                return Ok(None);
            }
            return Err(FootageError::Undecodable {
                path: self.path.clone(),
                reason: reason(&self.pipeline),
            });
        };
        let buffer = sample.buffer();
        // Only a jump makes the count doubtful; the time stamp then says where it ended.
        if self.next == u64::MAX {
            let time = buffer.and_then(|buffer| buffer.pts()).unwrap_or(gst::ClockTime::ZERO);
            self.next = (time.nseconds() as f64 / 1e9 * self.timeline.frame_rate()).round() as u64;
        }
        let picture = buffer.and_then(|buffer| Picture::from_buffer(buffer, &self.info));
        let picture = Arc::new(picture.unwrap_or_else(|| {
            let (width, height) = self.size();
            Picture::grey(width, height, 0)
        }));
        self.recent.push_back((self.next, picture.clone()));
        if self.recent.len() > KEPT {
            self.recent.pop_front();
        }
        self.next += 1;
        Ok(Some(picture))
    }

    fn seek(&mut self, frame: u64) -> Result<(), FootageError> {
        let time =
            gst::ClockTime::from_nseconds((frame as f64 / self.timeline.frame_rate() * 1e9).round() as u64);
        self.pipeline.seek_simple(gst::SeekFlags::FLUSH | gst::SeekFlags::ACCURATE, time).map_err(
            |error| FootageError::Undecodable { path: self.path.clone(), reason: error.to_string() },
        )?;
        self.next = if frame == 0 { 0 } else { u64::MAX };
        self.recent.clear();
        Ok(())
    }
}

impl Recording for Footage {
    fn size(&self) -> (u32, u32) {
        (self.info.width(), self.info.height())
    }

    fn timeline(&self) -> Arc<Timeline> {
        self.timeline.clone()
    }

    fn picture(&mut self, frame: u64) -> Result<Arc<Picture>, FootageError> {
        if let Some((_, picture)) = self.recent.iter().find(|(number, _)| *number == frame) {
            return Ok(picture.clone());
        }
        if frame < self.next || frame > self.next + SEEK_BEYOND {
            self.seek(frame)?;
        }
        loop {
            match self.pull()? {
                Some(picture) if self.next > frame => return Ok(picture),
                Some(_) => {}
                None => break,
            }
        }
        // Shorter than its header says: from now on it ends here.
        let last = self.recent.back().cloned();
        let start = self.timeline.start();
        let Some((number, picture)) = last.filter(|(number, _)| *number >= start) else {
            return Err(FootageError::Empty { path: self.path.clone(), frames: 0, start });
        };
        self.timeline.end_at(number + 1);
        self.next = u64::MAX;
        Ok(picture)
    }

    fn people(&self, frame: u64) -> Vec<Person> {
        self.people.get(&frame).cloned().unwrap_or_default()
    }
}

impl Drop for Footage {
    fn drop(&mut self) {
        stop(&self.pipeline);
    }
}

/// Reads a file into an `appsink` that is called `sink`, in a format of raw video.
pub(super) fn decoder(path: &std::path::Path, format: &str) -> Result<gst::Pipeline, glib::Error> {
    let launch = format!(
        "filesrc name=source ! decodebin ! videoconvert ! videoscale \
         ! video/x-raw,format={format},pixel-aspect-ratio=1/1 ! appsink name=sink sync=false max-buffers=4"
    );
    let pipeline = gst::parse::launch(&launch)?;
    let pipeline = pipeline
        .downcast::<gst::Pipeline>()
        .map_err(|_| glib::Error::new(gst::ParseError::Syntax, "the decoder is no pipeline"))?;
    if let Some(source) = pipeline.by_name("source") {
        source.set_property("location", path);
    }
    Ok(pipeline)
}

/// Whether it comes to its first picture.
pub(super) fn starts(pipeline: &gst::Pipeline) -> bool {
    pipeline.set_state(gst::State::Paused).is_ok() && pipeline.state(PATIENCE).0.is_ok()
}

/// Why it gives no picture.
pub(super) fn reason(pipeline: &gst::Pipeline) -> String {
    let error = pipeline.bus().and_then(|bus| bus.pop_filtered(&[gst::MessageType::Error]));
    match error.as_ref().map(|message| message.view()) {
        Some(gst::MessageView::Error(error)) => error.error().to_string(),
        _ => "the decoder gives no picture".into(),
    }
}

pub(super) fn stop(pipeline: &gst::Pipeline) {
    // Going to NULL cannot fail in a way that leaves anything to do.
    let _ = pipeline.set_state(gst::State::Null);
}
