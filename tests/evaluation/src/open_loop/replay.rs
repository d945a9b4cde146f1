// SPDX-License-Identifier: MPL-2.0

//! Shows a recording to decoder, detector and tracker.

use std::{path::Path, str::FromStr};

use virtual_camera::Settings;

use super::{
    library,
    placement::Placement,
    recorded::{RecordedPicture, RecordedScene},
    truth::Replacement,
};
use crate::{
    experiment::Experiment,
    film,
    lockstep::{RunError, clock_time, estimate, info},
    motchallenge::{Listener, Said, Sequence},
    pipeline::{Pipeline, PipelineError, SINK, SOURCE},
    record::{FrameRecord, Run},
    report::slug,
    trackers::{Cue, Phase, Tracker},
};

/// Shows the scene of `experiment` to its tracker, from the recording kept in `folder`.
pub(crate) fn drive(
    experiment: &Experiment,
    settings: &Settings,
    folder: &Path,
    run: &mut Run,
) -> Result<(), RunError> {
    let scene = library::recording(experiment, settings, folder)?;
    run.frame_rate = 1.0 / scene.period.as_secs_f64();
    let film = experiment.films.as_ref().map(|films| film::file(films, run)).transpose()?;
    let mut screening = Screening::begin(experiment, &scene, film.as_deref())?;
    let mut sequence = Sequence::new(experiment.size);
    for (index, picture) in scene.pictures.iter().enumerate() {
        let (record, said) = screening.picture(index, picture)?;
        sequence.add(record.truth.iter().chain(&record.others), &said, picture.motion.as_ref());
        if index >= scene.first {
            run.frames.push(record);
        }
    }
    if film.is_some() {
        screening.pipeline.end()?;
    }
    match &experiment.motchallenge {
        Some(folder) => sequence
            .write(folder, &slug(&run.title), run.tracker.name(), run.frame_rate)
            .map_err(|source| RunError::Keep { file: folder.clone(), source }),
        None => Ok(()),
    }
}

/// A tracker in front of a recording.
struct Screening<'a> {
    experiment: &'a Experiment,
    scene: &'a RecordedScene,
    pipeline: Pipeline,
    tracker: Tracker,
    replacement: Replacement,
    placement: Placement,
    listener: Listener,
}

impl<'a> Screening<'a> {
    fn begin(
        experiment: &'a Experiment,
        scene: &'a RecordedScene,
        film: Option<&Path>,
    ) -> Result<Self, RunError> {
        let tracker = Tracker::new(experiment.tracker, experiment.first_box, experiment.size);
        let sink = film::beside(&format!("fakesink name={SINK} sync=false async=false"), film);
        let (decoder, elements) = (experiment.codec.decoder(), experiment.elements(&tracker));
        let description = format!("appsrc name={SOURCE} ! {decoder} ! {elements} ! {sink}");
        let caps = gst::Caps::from_str(&scene.caps).map_err(PipelineError::Link)?;
        let pipeline = Pipeline::of_caps(&description, &caps)?;
        tracker.attach(pipeline.bin())?;
        let replacement = Replacement::attach(pipeline.bin(), &experiment.replaced)?;
        if film.is_some() {
            film::attach(pipeline.bin(), tracker.cue(), &info(experiment.size, scene.period)?)?;
        }
        let listener = Listener::attach(&pipeline)?;
        pipeline.start()?;
        let placement = Placement::new(&experiment.replaced);
        Ok(Self { experiment, scene, pipeline, tracker, replacement, placement, listener })
    }

    fn picture(&mut self, index: usize, picture: &RecordedPicture) -> Result<(FrameRecord, Said), RunError> {
        let (first, size) = (self.scene.first, self.experiment.size);
        let phase = Phase::of(index >= first, index > first);
        let truth = picture.truth.truth.clone();
        let cue = Cue { phase, truth, motion: picture.motion, ..Cue::new(size) };
        self.tracker.next(self.pipeline.bin(), cue.with_a_click_among(&picture.people))?;
        self.replacement.next(picture);
        let mut buffer = gst::Buffer::from_slice(picture.encoded.clone());
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(clock_time(picture.arrival));
            buffer.set_dts(clock_time(picture.arrival));
            buffer.set_duration(clock_time(self.scene.period));
        }
        let target = self.pipeline.finish(buffer)?;
        if let Some(state) = &picture.told {
            self.pipeline.send_upstream(state.event())?;
        }
        let said = target.map(|target| self.placement.replaced(estimate(&target, size), &picture.truth));
        let mut record = picture.truth.clone().judged(said, &picture.people);
        let heard = self.listener.take();
        record.best_region = record.truth.as_ref().and_then(|person| heard.best_region(&person.bounds, size));
        Ok((record, heard))
    }
}
