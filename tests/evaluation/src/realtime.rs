// SPDX-License-Identifier: MPL-2.0

//! One experiment in real time, as a user runs it: the camera streams over HTTP or RTSP, a leaky queue drops the pictures
//! that the tracker is too late for, and the servo looks at the clock.
//!
//! A stream does not tell when its pictures were taken. Each is held to be the newest that the camera had when it reached
//! the decoder; on a machine so slow that pictures are under way for longer than a frame period, that is one too
//! young. Two runs are never quite the same.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
    time::Duration,
};

use gst::prelude::*;
use ptztrack_contract::{BufferMeta, TargetMeta};
use virtual_camera::{Clock, Picture, Settings, VirtualCamera};

use crate::{
    album::Album,
    experiment::{self, Experiment},
    lockstep::{RunError, clock_time, count_commands, estimate},
    pipeline::{Elements, PipelineError, SINK, fault, lock},
    record::{Codec, FrameRecord, Run},
    trackers::{Cue, Phase, Tracker},
};

const DECODER: &str = "decoder";
const QUEUE: &str = "leaky";

/// Runs it as long as its world lasts.
pub(crate) fn drive(experiment: &Experiment, settings: &Settings, run: &mut Run) -> Result<(), RunError> {
    if experiment.codec == Codec::Raw {
        return Err(RunError::Raw);
    }
    // Found with time standing still: it takes a while.
    let first =
        experiment.first_counted(&experiment.camera(settings, Clock::Stepped)?).ok_or(RunError::Nobody)?;
    let camera = experiment.camera(settings, Clock::Real)?;
    run.frame_rate = 1.0 / camera.frame_period().as_secs_f64();
    let end = experiment.scene.duration + experiment.delays.video;
    let watch = Arc::new(Watch::new(experiment.clone(), camera, first));
    let stream = Stream::open(&watch)?;
    let watched = stream.watch_until(end);
    drop(stream);
    let journal = std::mem::take(&mut *lock(&watch.journal));
    (run.frames, run.dropped) = (journal.frames, Some(journal.arrived.saturating_sub(journal.tracked)));
    if let Some(info) = journal.info {
        run.snapshots = journal.album.develop(&info)?;
    }
    journal.fault.map_or(watched, Err)?;
    if run.frames.is_empty() { Err(RunError::Nobody) } else { Ok(()) }
}

/// What came of the pictures so far.
#[derive(Default)]
struct Journal {
    /// Numbers of the pictures that were decoded and did not reach the end yet, by their time in the stream.
    under_way: BTreeMap<Option<gst::ClockTime>, u32>,
    /// How many of those that count the network brought.
    arrived: u64,
    /// How many of them the tracker saw.
    tracked: u64,
    /// Whether a picture was that of the first box.
    begun: bool,
    /// Number of the last command that was counted.
    counted: u64,
    frames: Vec<FrameRecord>,
    album: Album,
    info: Option<gst_video::VideoInfo>,
    /// Why the tracker could not be told of a picture.
    fault: Option<PipelineError>,
}

/// Follows the pictures on their way.
struct Watch {
    experiment: Experiment,
    camera: VirtualCamera,
    tracker: Tracker,
    /// Number of the first picture that counts.
    first: u32,
    journal: Mutex<Journal>,
}

impl Watch {
    fn new(experiment: Experiment, camera: VirtualCamera, first: u32) -> Self {
        let tracker = Tracker::new(experiment.tracker, experiment.first_box, experiment.size);
        Self { experiment, camera, tracker, first, journal: Mutex::default() }
    }

    /// Number of the newest picture that the camera has by now.
    fn newest(&self) -> u32 {
        let late = self.experiment.delays.video + experiment::exposure(0, self.camera.frame_period());
        let since = self.camera.now().saturating_sub(late);
        (since.as_nanos() / self.camera.frame_period().as_nanos()) as u32
    }

    /// A picture came from the network.
    fn arrives(&self, time: Option<gst::ClockTime>) {
        let number = self.newest();
        let mut journal = lock(&self.journal);
        journal.arrived += u64::from(number >= self.first);
        journal.under_way.insert(time, number);
    }

    /// It is the tracker's turn.
    fn goes_to_tracker(
        &self,
        pipeline: &gst::Pipeline,
        time: Option<gst::ClockTime>,
    ) -> Result<(), PipelineError> {
        let (size, mut journal) = (self.experiment.size, lock(&self.journal));
        // Those before it were dropped.
        journal.under_way.retain(|other, _| *other >= time);
        let Some(&number) = journal.under_way.get(&time) else { return Ok(()) };
        // The very picture of the first box may have been dropped: then it is the next one.
        let counted = number >= self.first;
        let phase = Phase::of(counted, std::mem::replace(&mut journal.begun, counted));
        journal.tracked += u64::from(counted);
        if phase == Phase::FirstBox {
            // What the camera was told before belongs to no picture that counts.
            count_commands(&self.camera, &mut journal.counted);
        }
        drop(journal);
        let exposure = experiment::exposure(number, self.camera.frame_period());
        let (truth, _) = self.experiment.scene.split(self.camera.ground_truth(exposure, size));
        self.tracker.next(pipeline, Cue { phase, truth, motion: None, size })
    }

    /// Everybody has done with it.
    fn ends(&self, buffer: &gst::BufferRef, info: Option<gst_video::VideoInfo>) {
        let mut journal = lock(&self.journal);
        let Some(number) = journal.under_way.remove(&buffer.pts()).filter(|number| *number >= self.first)
        else {
            return;
        };
        let target = TargetMeta::of(buffer).and_then(Result::ok);
        let size = self.experiment.size;
        let (witnessed, people) = self.experiment.witness(&self.camera, number, self.first);
        let exposure = experiment::exposure(number, self.camera.frame_period());
        if let Err(error) = self.tracker.steer(&self.camera, exposure, target.as_ref()) {
            journal.fault.get_or_insert(error);
        }
        let commands = count_commands(&self.camera, &mut journal.counted);
        let said = target.map(|target| estimate(&target, size));
        let record = FrameRecord { commands, ..witnessed }.judged(said, &people);
        if let Some((picture, info)) =
            info.and_then(|info| Some((Picture::from_buffer(buffer, &info)?, info)))
        {
            let frame = journal.frames.len();
            journal.album.look(frame, &record, picture);
            journal.info = Some(info);
        }
        journal.frames.push(record);
    }
}

/// The pipeline of a user.
struct Stream {
    pipeline: gst::Pipeline,
    watch: Arc<Watch>,
}

impl Stream {
    fn open(watch: &Arc<Watch>) -> Result<Self, PipelineError> {
        let pipeline = gst::parse::launch(&description(watch))?
            .downcast::<gst::Pipeline>()
            .map_err(|_| PipelineError::NoElement(DECODER))?;
        let stream = Self { pipeline, watch: watch.clone() };
        watch.tracker.attach(&stream.pipeline)?;
        stream.attach()?;
        let started = stream.pipeline.set_state(gst::State::Playing);
        started.map_err(|error| PipelineError::Start(error.to_string()))?;
        Ok(stream)
    }

    fn attach(&self) -> Result<(), PipelineError> {
        let watch = self.watch.clone();
        on_buffer(&self.pipeline.pad(DECODER, "sink")?, move |_, buffer| watch.arrives(buffer.pts()));
        let (watch, pipeline) = (self.watch.clone(), self.pipeline.downgrade());
        on_buffer(&self.pipeline.pad(QUEUE, "src")?, move |_, buffer| {
            let Some(pipeline) = pipeline.upgrade() else { return };
            if let Err(error) = watch.goes_to_tracker(&pipeline, buffer.pts()) {
                lock(&watch.journal).fault.get_or_insert(error);
                // Nothing that comes now is worth waiting for. A stopped pipeline needs no waking.
                let _ = pipeline.post_message(gst::message::Eos::new());
            }
        });
        let watch = self.watch.clone();
        on_buffer(&self.pipeline.pad(SINK, "sink")?, move |pad, buffer| {
            let caps = pad.current_caps();
            watch.ends(buffer, caps.and_then(|caps| gst_video::VideoInfo::from_caps(&caps).ok()));
        });
        Ok(())
    }

    /// Waits until it is `end` for the camera; a fault ends it before.
    fn watch_until(&self, end: Duration) -> Result<(), PipelineError> {
        let left = end.saturating_sub(self.watch.camera.now());
        let bus = self.pipeline.bus().ok_or(PipelineError::NoElement("bus"))?;
        unbroken(&bus, clock_time(left))
    }
}

/// Waits for `left`; an error, a warning or the end of the stream ends it before. Being late (QoS) is none of them.
fn unbroken(bus: &gst::Bus, left: gst::ClockTime) -> Result<(), PipelineError> {
    use gst::MessageType::{Eos, Error, Warning};
    match bus.timed_pop_filtered(left, &[Error, Warning, Eos]) {
        None => Ok(()),
        Some(message) => Err(PipelineError::Posted(fault(&message).unwrap_or("the stream ended".into()))),
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // Nothing more can be done about a pipeline that will not stop.
        let _ = self.pipeline.set_state(gst::State::Null);
    }
}

/// As in `pipelines/`, where each of the lines is explained.
fn description(watch: &Watch) -> String {
    let (camera, (width, height)) = (&watch.camera, watch.experiment.size);
    let stream = match watch.experiment.codec {
        Codec::Mpeg4 | Codec::Mpeg4Low | Codec::H264 | Codec::H264Low => format!(
            "rtspsrc location=\"{}/axis-media/media.amp?videocodec=mpeg4&resolution={width}x{height}\" latency=0 protocols=tcp ! rtpmp4vdepay \
             ! avdec_mpeg4 name={DECODER} max-threads=1",
            camera.rtsp_url()
        ),
        Codec::Mjpeg | Codec::Raw => format!(
            "souphttpsrc location=\"{}/axis-cgi/mjpg/video.cgi?resolution={width}x{height}\" is-live=true \
             do-timestamp=true ! multipartdemux single-stream=true ! jpegdec name={DECODER}",
            camera.url()
        ),
    };
    let (tracker, sink) =
        (watch.tracker.description(), watch.tracker.sink(watch.experiment.protocol, &camera.url(), ""));
    format!(
        "{stream} ! queue name={QUEUE} leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0 ! {tracker} ! {sink}"
    )
}

fn on_buffer(pad: &gst::Pad, look: impl Fn(&gst::Pad, &gst::BufferRef) + Send + Sync + 'static) {
    pad.add_probe(gst::PadProbeType::BUFFER, move |pad, info| {
        if let Some(buffer) = info.buffer() {
            look(pad, buffer);
        }
        gst::PadProbeReturn::Ok
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_breaks_the_run_and_being_late_does_not() {
        gst::init().unwrap();
        let bus = gst::Bus::new();
        let late = || bus.post(gst::message::Qos::builder(true).build()).unwrap();
        late();
        assert!(unbroken(&bus, gst::ClockTime::from_mseconds(1)).is_ok());
        let broken = || unbroken(&bus, gst::ClockTime::from_seconds(10)).unwrap_err().to_string();
        late();
        let warning = gst::message::Warning::builder(gst::StreamError::Decode, "half a picture").build();
        bus.post(warning).unwrap();
        let told = broken();
        assert!(told.ends_with(": half a picture"), "{told}");
        bus.post(gst::message::Eos::new()).unwrap();
        assert_eq!(broken(), "the stream ended");
    }
}
