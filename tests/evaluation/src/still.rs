// SPDX-License-Identifier: MPL-2.0

//! A recording as it is, without any camera: only the tracked box is judged.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use gst::prelude::*;
use virtual_camera::{GroundTruth, People, Person, Picture, Sighting};

use crate::{
    album::Album,
    experiment::Experiment,
    film,
    lockstep::{RunError, estimate},
    pipeline::{Elements, Pipeline, PipelineError, SINK, SOURCE},
    record::{Codec, Delays, FrameRecord, Run},
    trackers::{Cue, Phase, Tracker},
};

/// No decoder takes this long for a picture.
const PATIENCE: gst::ClockTime = gst::ClockTime::from_seconds(30);

/// Pictures a second where the file does not tell.
pub(crate) const UNKNOWN_RATE: f64 = 25.0;
/// Their distance.
pub(crate) const USUAL_PERIOD: Duration = Duration::from_millis(40);

/// A video and who is where in it.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Any video file that GStreamer decodes.
    pub file: PathBuf,
    /// By the number of the picture, from 0.
    pub people: Arc<People>,
    /// Number of the last picture that counts.
    pub last: u64,
}

/// Shows it to the tracker of `experiment`.
pub(crate) fn drive(experiment: &Experiment, recording: &Recording, run: &mut Run) -> Result<(), RunError> {
    (run.codec, run.delays) = (Codec::Raw, Delays { video: Duration::ZERO, command: Duration::ZERO });
    let projector = Projector::open(&recording.file)?;
    let mut samples = projector.samples();
    let first = samples.next().unwrap_or_else(|| Err(projector.fault()))?;
    let info = info(&first).ok_or_else(|| projector.fault())?;
    run.size = (info.width(), info.height());
    let film = experiment.films.as_ref().map(|films| film::file(films, run)).transpose()?;
    let mut screening = Screening::begin(experiment, info, film.as_deref())?;
    run.frame_rate = screening.frame_rate;
    let mut album = Album::default();
    for (number, sample) in (0..=recording.last).zip(std::iter::once(Ok(first)).chain(samples)) {
        let people = recording.people.get(&number).map_or(&[][..], Vec::as_slice);
        let (record, picture) = screening.picture(number, &sample?, people)?;
        if screening.first.is_some() {
            album.look(run.frames.len(), &record, picture);
            run.frames.push(record);
        }
    }
    if film.is_some() {
        screening.pipeline.end()?;
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
    first: Option<u64>,
}

impl<'a> Screening<'a> {
    fn begin(
        experiment: &'a Experiment,
        info: gst_video::VideoInfo,
        film: Option<&Path>,
    ) -> Result<Self, RunError> {
        let rate = f64::from(info.fps().numer()) / f64::from(info.fps().denom().max(1));
        let tracker = Tracker::new(experiment.tracker, experiment.first_box, (info.width(), info.height()));
        let sink = film::beside(&format!("fakesink name={SINK} sync=false async=false"), film);
        let description = format!("appsrc name={SOURCE} ! {} ! {sink}", tracker.description());
        let pipeline = Pipeline::new(&description, &info)?;
        tracker.attach(pipeline.bin())?;
        if film.is_some() {
            film::attach(pipeline.bin(), tracker.cue(), &info)?;
        }
        pipeline.start()?;
        let frame_rate = if rate > 0.0 { rate } else { UNKNOWN_RATE };
        Ok(Self { experiment, tracker, pipeline, info, frame_rate, first: None })
    }

    fn size(&self) -> (u32, u32) {
        (self.info.width(), self.info.height())
    }

    fn picture(
        &mut self,
        number: u64,
        sample: &gst::Sample,
        people: &[Person],
    ) -> Result<(FrameRecord, Picture), RunError> {
        let size = self.size();
        let people: Vec<_> = people.iter().map(|person| sighting(person, size)).collect();
        let (truth, others) =
            self.experiment.scene.split(people.iter().map(|one| one.truth.clone()).collect());
        let begun = self.first.is_some();
        let phase = Phase::of(begun || truth.is_some(), begun);
        if phase == Phase::FirstBox {
            self.first = Some(number);
        }
        self.tracker.next(self.pipeline.bin(), Cue { phase, truth: truth.clone(), ..Cue::new(size) })?;
        let buffer = stamped(sample, number as f64 / self.frame_rate)?;
        let picture = Picture::from_buffer(&buffer, &self.info).ok_or(RunError::Size(size.0, size.1))?;
        let target = self.pipeline.finish(buffer)?;
        let record = FrameRecord {
            time_s: (number - self.first.unwrap_or(number)) as f64 / self.frame_rate,
            truth,
            others,
            estimate: None,
            coverage: Vec::new(),
            best_region: None,
            size,
            focal_px: f64::from(size.0),
            pan_deg: 0.0,
            tilt_deg: 0.0,
            zoom: 1.0,
            commands: 0,
        };
        let record = record.judged(target.map(|target| estimate(&target, size)), &people);
        Ok((record, picture))
    }
}

/// A person of a recording, seen from where it was made.
pub(crate) fn sighting(person: &Person, size: (u32, u32)) -> Sighting {
    let in_view = person.bounds.part_inside(size);
    let truth = GroundTruth {
        id: person.id,
        bounds: person.bounds,
        centroid: person.bounds.centre(),
        visible: in_view * person.unhidden,
        unhidden: person.unhidden,
        in_view,
        position_m: None,
        direction_deg: None,
    };
    Sighting::of_box(truth, size)
}

pub(crate) fn info(sample: &gst::Sample) -> Option<gst_video::VideoInfo> {
    gst_video::VideoInfo::from_caps(sample.caps()?).ok()
}

/// The picture with a time that only depends on its number.
pub(crate) fn stamped(sample: &gst::Sample, time_s: f64) -> Result<gst::Buffer, RunError> {
    let mut buffer = sample.buffer_owned().ok_or(PipelineError::Stalled)?;
    let stamped = buffer.make_mut();
    stamped.set_pts(gst::ClockTime::from_nseconds((time_s * 1e9).round() as u64));
    stamped.set_dts(gst::ClockTime::NONE);
    stamped.unset_flags(gst::BufferFlags::DISCONT);
    Ok(buffer)
}

/// A video file, picture by picture.
pub(crate) struct Projector {
    pipeline: gst::Pipeline,
    sink: gst_app::AppSink,
}

impl Projector {
    pub fn open(file: &Path) -> Result<Self, PipelineError> {
        let pipeline = gst::parse::launch(
            "filesrc name=file ! decodebin ! videoconvert ! video/x-raw,format=I420 \
             ! appsink name=pictures sync=false max-buffers=2",
        )?
        .downcast::<gst::Pipeline>()
        .map_err(|_| PipelineError::NoElement("pictures"))?;
        let sink = pipeline.by_name("pictures").and_downcast::<gst_app::AppSink>();
        let sink = sink.ok_or(PipelineError::NoElement("pictures"))?;
        pipeline.element("file")?.set_property("location", file.display().to_string());
        let projector = Self { pipeline, sink };
        // A file that cannot be decoded is told of before the first picture.
        projector.go_to(gst::State::Paused)?;
        projector.go_to(gst::State::Playing)?;
        Ok(projector)
    }

    fn go_to(&self, state: gst::State) -> Result<(), PipelineError> {
        let changed = self.pipeline.set_state(state).and_then(|_| self.pipeline.state(PATIENCE).0);
        changed.map(|_| ()).map_err(|_| self.fault())
    }

    /// All pictures of the file, and at last why there are no more if that is not its end.
    pub fn samples(&self) -> impl Iterator<Item = Result<gst::Sample, PipelineError>> + '_ {
        std::iter::from_fn(|| match self.sink.try_pull_sample(PATIENCE) {
            Some(sample) => Some(Ok(sample)),
            None => self.posted().or_else(|| (!self.sink.is_eos()).then(|| self.fault())).map(Err),
        })
    }

    /// Why it gives no picture.
    pub fn fault(&self) -> PipelineError {
        let nothing = || PipelineError::Posted("the recording gives no picture".into());
        self.posted().unwrap_or_else(nothing)
    }

    /// The next fault that the bus tells of.
    fn posted(&self) -> Option<PipelineError> {
        let error = self.pipeline.bus()?.pop_filtered(&[gst::MessageType::Error])?;
        crate::pipeline::fault(&error).map(PipelineError::Posted)
    }
}

impl Drop for Projector {
    fn drop(&mut self) {
        // Nothing more can be done about a pipeline that will not stop.
        let _ = self.pipeline.set_state(gst::State::Null);
    }
}
