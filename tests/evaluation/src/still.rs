//! A recording as it is, without any camera: only the tracked box is judged.

use std::{path::PathBuf, sync::Arc};

use gst::prelude::*;
use virtual_camera::{GroundTruth, People, Person, Picture};

use crate::{
    album::Album,
    experiment::Experiment,
    lockstep::{RunError, estimate},
    pipeline::{Pipeline, PipelineError, SINK, SOURCE},
    record::{FrameRecord, Run},
    trackers::{Cue, Phase, Tracker},
};

/// No decoder takes this long for a picture.
const PATIENCE: gst::ClockTime = gst::ClockTime::from_seconds(30);

/// Pictures a second where the file does not tell.
const UNKNOWN_RATE: f64 = 25.0;

/// A video and who is where in it.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Any video file that GStreamer decodes.
    pub file: PathBuf,
    /// By the number of the picture, from 0.
    pub people: Arc<People>,
}

/// Shows it to the tracker of `experiment`.
pub(crate) fn drive(experiment: &Experiment, recording: &Recording, run: &mut Run) -> Result<(), RunError> {
    let film = Film::open(recording)?;
    let mut samples = film.samples().peekable();
    let info = samples.peek().and_then(info).ok_or_else(|| PipelineError::Posted(film.fault()))?;
    let mut screening = Screening::begin(experiment, info)?;
    (run.size, run.frame_rate) = (screening.size(), screening.frame_rate);
    let mut album = Album::default();
    for (number, sample) in samples.enumerate() {
        let people = recording.people.get(&(number as u64)).map_or(&[][..], Vec::as_slice);
        let (record, picture) = screening.picture(number, &sample, people)?;
        if screening.first.is_some() {
            album.look(run.frames.len(), &record, picture);
            run.frames.push(record);
        }
    }
    run.snapshots = album.develop(&screening.info)?;
    if run.frames.is_empty() { Err(RunError::Nobody) } else { Ok(()) }
}

/// A tracker in front of a recording.
struct Screening<'a> {
    experiment: &'a Experiment,
    tracker: Tracker,
    pipeline: Pipeline,
    info: gst_video::VideoInfo,
    frame_rate: f64,
    /// Number of the first picture that counts, once it has come: the first with the person in it.
    first: Option<usize>,
}

impl<'a> Screening<'a> {
    fn begin(experiment: &'a Experiment, info: gst_video::VideoInfo) -> Result<Self, RunError> {
        let rate = f64::from(info.fps().numer()) / f64::from(info.fps().denom().max(1));
        let tracker = Tracker::new(experiment.tracker, experiment.first_box, (info.width(), info.height()));
        let description = format!(
            "appsrc name={SOURCE} ! {} ! fakesink name={SINK} sync=false async=false",
            tracker.description()
        );
        let pipeline = Pipeline::new(&description, &info)?;
        tracker.attach(pipeline.bin())?;
        pipeline.start()?;
        let frame_rate = if rate > 0.0 { rate } else { UNKNOWN_RATE };
        Ok(Self { experiment, tracker, pipeline, info, frame_rate, first: None })
    }

    fn size(&self) -> (u32, u32) {
        (self.info.width(), self.info.height())
    }

    fn picture(
        &mut self,
        number: usize,
        sample: &gst::Sample,
        people: &[Person],
    ) -> Result<(FrameRecord, Picture), RunError> {
        let size = self.size();
        let people = people.iter().map(|person| truth(person, size)).collect();
        let (truth, others) = self.experiment.scene.split(people);
        let phase = match (self.first, &truth) {
            (None, None) => Phase::Before,
            (None, Some(_)) => Phase::FirstBox,
            (Some(_), _) => Phase::After,
        };
        if phase == Phase::FirstBox {
            self.first = Some(number);
        }
        self.tracker.next(self.pipeline.bin(), Cue { phase, truth: truth.clone(), size })?;
        let buffer = stamped(sample, number as f64 / self.frame_rate)?;
        let picture = Picture::from_buffer(&buffer, &self.info).ok_or(RunError::Size(size.0, size.1))?;
        let target = self.pipeline.finish(buffer)?;
        let record = FrameRecord {
            time_s: (number - self.first.unwrap_or(number)) as f64 / self.frame_rate,
            truth,
            others,
            estimate: target.map(|target| estimate(&target, size)),
            size,
            pan_deg: 0.0,
            tilt_deg: 0.0,
            zoom: 1.0,
            commands: 0,
        };
        Ok((record, picture))
    }
}

/// A person of a recording, seen from where it was made.
fn truth(person: &Person, size: (u32, u32)) -> GroundTruth {
    let in_view = person.bounds.part_inside(size);
    GroundTruth {
        id: person.id,
        bounds: person.bounds,
        centroid: person.bounds.centre(),
        visible: in_view * person.unhidden,
        unhidden: person.unhidden,
        in_view,
        position_m: None,
        direction_deg: None,
    }
}

fn info(sample: &gst::Sample) -> Option<gst_video::VideoInfo> {
    gst_video::VideoInfo::from_caps(sample.caps()?).ok()
}

/// The picture with a time that only depends on its number.
fn stamped(sample: &gst::Sample, time_s: f64) -> Result<gst::Buffer, RunError> {
    let mut buffer = sample.buffer_owned().ok_or(PipelineError::Stalled)?;
    let stamped = buffer.make_mut();
    stamped.set_pts(gst::ClockTime::from_nseconds((time_s * 1e9).round() as u64));
    stamped.set_dts(gst::ClockTime::NONE);
    stamped.unset_flags(gst::BufferFlags::DISCONT);
    Ok(buffer)
}

/// A video file, picture by picture.
struct Film {
    pipeline: gst::Pipeline,
    sink: gst_app::AppSink,
}

impl Film {
    fn open(recording: &Recording) -> Result<Self, PipelineError> {
        let pipeline = gst::parse::launch(
            "filesrc name=file ! decodebin ! videoconvert ! video/x-raw,format=I420 \
             ! appsink name=pictures sync=false max-buffers=2",
        )?
        .downcast::<gst::Pipeline>()
        .map_err(|_| PipelineError::NoElement(SOURCE))?;
        let sink = pipeline.by_name("pictures").and_downcast::<gst_app::AppSink>();
        let sink = sink.ok_or(PipelineError::NoElement("pictures"))?;
        let file = pipeline.by_name("file").ok_or(PipelineError::NoElement("file"))?;
        file.set_property("location", recording.file.display().to_string());
        let film = Self { pipeline, sink };
        let started = film.pipeline.set_state(gst::State::Playing);
        started.map_err(|_| PipelineError::Start(film.fault()))?;
        Ok(film)
    }

    fn samples(&self) -> impl Iterator<Item = gst::Sample> + '_ {
        std::iter::from_fn(|| self.sink.try_pull_sample(PATIENCE))
    }

    /// Why there is no picture.
    fn fault(&self) -> String {
        let bus = self.pipeline.bus();
        let message = bus.and_then(|bus| bus.pop_filtered(&[gst::MessageType::Error]));
        message
            .and_then(|message| crate::pipeline::fault(&message))
            .unwrap_or_else(|| "no picture in it".into())
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        // Nothing more can be done about a pipeline that will not stop.
        let _ = self.pipeline.set_state(gst::State::Null);
    }
}
