// SPDX-License-Identifier: MPL-2.0

//! One experiment in virtual time: camera and pipeline take turns, and nobody looks at a clock.
//!
//! Picture n is exposed n and a half frame periods after the camera's start and reaches the pipeline when it is as old
//! as the video delay (jitter and stalls of the camera's network included); the camera's time is that of its arrival. The pipeline finishes it, with every command that it
//! leads to sent over HTTP and answered, before the camera's time goes on.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use ptztrack_contract::{TargetMeta, TargetState};
use virtual_camera::{Clock, Picture, Pose, Settings, VirtualCamera};

use crate::{
    album::Album,
    experiment::{self, Experiment, Place},
    film, open_loop,
    pipeline::{Pipeline, PipelineError, SOURCE},
    record::{Bounds, Estimate, FrameRecord, Run},
    still,
    trackers::{Cue, Phase, Tracker},
};

/// Why an experiment came to no end.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RunError {
    #[error("virtual camera: {0}")]
    Camera(#[from] virtual_camera::Error),
    #[error("virtual camera: {0}")]
    Picture(#[from] virtual_camera::FootageError),
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    #[error("pictures of {0}x{1} cannot be made")]
    Size(u32, u32),
    #[error("the camera does not take `{0}`")]
    Aim(String),
    #[error("cannot film into {}: {source}", file.display())]
    Film { file: PathBuf, source: std::io::Error },
    #[error("cannot write {}: {source}", file.display())]
    Keep { file: PathBuf, source: std::io::Error },
    #[error("the person is never wholly in the first view")]
    Nobody,
}

/// Runs one experiment from the start of its world to its end. A fault ends it early and is told in the run.
pub fn run(experiment: &Experiment) -> Run {
    let mut run = experiment.blank();
    let driven = match (&experiment.scene.place, &experiment.recordings) {
        (Place::Camera(camera), Some(folder)) => open_loop::drive(experiment, camera, folder, &mut run),
        (Place::Camera(camera), None) => drive(experiment, camera, &mut run),
        (Place::Recording(recording), _) => still::drive(experiment, recording, &mut run),
    };
    if let Err(error) = driven {
        run.error = Some(error.to_string());
    }
    run
}

fn drive(experiment: &Experiment, camera: &Settings, run: &mut Run) -> Result<(), RunError> {
    let film = experiment.films.as_ref().map(|films| film::file(films, run)).transpose()?;
    let mut stage = Stage::set(experiment, camera, film.as_deref())?;
    let first = experiment.first_counted(&stage.camera).ok_or(RunError::Nobody)?;
    open_loop::lead(experiment, camera, &stage.camera)?;
    let period = stage.camera.frame_period();
    run.frame_rate = 1.0 / period.as_secs_f64();
    let mut album = Album::default();
    for number in experiment.pictures(period) {
        let (record, picture) = stage.picture(number, first)?;
        if number >= first {
            album.look(run.frames.len(), &record, picture);
            run.frames.push(record);
        }
    }
    if film.is_some() {
        stage.pipeline.end()?;
    }
    run.snapshots = album.develop(&stage.info)?;
    Ok(())
}

/// Camera, pipeline and tracker of one run.
struct Stage<'a> {
    experiment: &'a Experiment,
    /// Goes before the camera, which it stops at its end.
    pipeline: Pipeline,
    camera: VirtualCamera,
    tracker: Tracker,
    info: gst_video::VideoInfo,
    /// Number of the last command that was counted.
    counted: u64,
    /// Where the camera looked in the picture before.
    looked: Option<Pose>,
    /// When the picture before came.
    arrived: Duration,
}

impl<'a> Stage<'a> {
    fn set(experiment: &'a Experiment, settings: &Settings, film: Option<&Path>) -> Result<Self, RunError> {
        let camera = experiment.camera(settings, Clock::Stepped)?;
        let tracker = Tracker::new(experiment.tracker, experiment.first_box, experiment.size);
        let info = info(experiment.size, camera.frame_period())?;
        let servo = format!("lockstep=true timeout=60000000000 {}", experiment.servo);
        let sink = film::beside(&tracker.sink(experiment.protocol, &camera.url(), &servo), film);
        let (codec, elements) = (experiment.codec.description(), experiment.elements(&tracker));
        let description = format!("appsrc name={SOURCE} ! {codec} ! {elements} ! {sink}");
        let pipeline = Pipeline::new(&description, &info)?;
        experiment.codec.attach(pipeline.bin())?;
        tracker.attach(pipeline.bin())?;
        if film.is_some() {
            film::attach(pipeline.bin(), tracker.cue(), &info)?;
        }
        pipeline.start()?;
        let (looked, arrived) = (None, Duration::ZERO);
        Ok(Self { experiment, pipeline, camera, tracker, info, counted: 0, looked, arrived })
    }

    /// Takes picture `number` and sends it through.
    fn picture(&mut self, number: u32, first: u32) -> Result<(FrameRecord, Picture), RunError> {
        let (period, size) = (self.camera.frame_period(), self.experiment.size);
        let exposure = experiment::exposure(number, period);
        // Those that were held back come at once, but one after the other.
        let arrival = self.camera.arrival(exposure).max(self.arrived + Duration::from_millis(1));
        self.arrived = arrival;
        self.camera.advance_to(arrival);
        let (witnessed, people) = self.experiment.witness(&self.camera, number, first);
        let phase = Phase::of(number >= first, number > first);
        let pose = self.camera.pose_at(exposure);
        let motion =
            self.looked.replace(pose).map(|before| self.camera.background_motion(&before, &pose, size));
        let cue = Cue { phase, truth: witnessed.truth.clone(), motion, ..Cue::new(size) };
        self.tracker.next(self.pipeline.bin(), cue.with_a_click_among(&people))?;
        let picture = self.camera.picture(exposure, size)?;
        let target = self.pipeline.finish(self.buffer(&picture, arrival)?)?;
        self.tracker.steer(&self.camera, exposure, target.as_ref())?;
        let record = FrameRecord { commands: count_commands(&self.camera, &mut self.counted), ..witnessed };
        let record = record.judged(target.map(|target| estimate(&target, size)), &people);
        Ok((record, picture))
    }

    fn buffer(&self, picture: &Picture, arrival: Duration) -> Result<gst::Buffer, RunError> {
        let (width, height) = self.experiment.size;
        let mut buffer = picture.to_buffer(&self.info).ok_or(RunError::Size(width, height))?;
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(clock_time(arrival));
            buffer.set_duration(clock_time(self.camera.frame_period()));
        }
        Ok(buffer)
    }
}

/// Commands that came after number `counted`, which becomes the last one; questions do not count.
pub(crate) fn count_commands(camera: &VirtualCamera, counted: &mut u64) -> u32 {
    let commands = camera.commands_after(*counted);
    *counted = commands.last().map_or(*counted, |command| command.number);
    commands.iter().filter(|command| !command.query.contains("query=")).count() as u32
}

/// What pictures are before they are encoded.
pub(crate) fn info((width, height): (u32, u32), period: Duration) -> Result<gst_video::VideoInfo, RunError> {
    let rate = gst::Fraction::approximate_f64(1.0 / period.as_secs_f64());
    gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, width, height)
        .fps(rate.unwrap_or(gst::Fraction::new(25, 1)))
        .par(gst::Fraction::new(1, 1))
        .build()
        .map_err(|_| RunError::Size(width, height))
}

pub(crate) fn clock_time(time: Duration) -> gst::ClockTime {
    gst::ClockTime::from_nseconds(time.as_nanos() as u64)
}

/// What a tracker said, in pixels.
pub(crate) fn estimate(target: &TargetMeta, size: (u32, u32)) -> Estimate {
    let (width, height) = (f64::from(size.0), f64::from(size.1));
    let followed = matches!(target.state, TargetState::Tracking | TargetState::Occluded);
    Estimate {
        state: target.state,
        centroid: (target.centroid.x * width, target.centroid.y * height),
        bounds: Bounds {
            left: target.bounds.x * width,
            top: target.bounds.y * height,
            width: target.bounds.width * width,
            height: target.bounds.height * height,
        },
        id: if followed { target.id } else { 0 },
        features: target.features.iter().filter(|feature| feature.kept).count(),
    }
}
