// SPDX-License-Identifier: MPL-2.0

//! A recording as it is, all of it and everybody in it.

use std::{
    io,
    path::{Path, PathBuf},
};

use virtual_camera::People;

use super::{Listener, Sequence};
use crate::{
    lockstep::RunError,
    people::{self, TruthError},
    pipeline::{Pipeline, SINK, SOURCE},
    record::{FirstBox, TrackerName},
    still::{Projector, UNKNOWN_RATE, info, sighting, stamped},
    trackers::Tracker,
};

/// Why a recording cannot be written down.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The ground truth cannot be used.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// The recording cannot be shown to the elements.
    #[error("{}: {reason}", file.display())]
    Recording {
        /// As given.
        file: PathBuf,
        /// What an element says.
        reason: String,
    },
    /// The folder cannot be written to.
    #[error("cannot write into {}: {source}", folder.display())]
    Folder {
        /// As given.
        folder: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// Shows `recording` to detector and tracker, or to these `elements`, and writes what they say into `folder`, beside the `truth`.
///
/// # Errors
/// Where recording or truth cannot be used, or nothing can be written.
pub fn write_recording(
    recording: &Path,
    truth: &Path,
    elements: Option<&str>,
    folder: &Path,
) -> Result<(), RecordingError> {
    let truth = people::read(truth)?;
    let (sequence, frame_rate) = show(recording, &truth, elements)
        .map_err(|error| RecordingError::Recording { file: recording.into(), reason: error.to_string() })?;
    let name = recording.file_stem().unwrap_or_default().to_string_lossy();
    let written = sequence.write(folder, &name, TrackerName::Ptztrack.name(), frame_rate);
    written.map_err(|source| RecordingError::Folder { folder: folder.into(), source })
}

/// What was said of it, and how many pictures a second it has.
fn show(recording: &Path, truth: &People, elements: Option<&str>) -> Result<(Sequence, f64), RunError> {
    let projector = Projector::open(recording)?;
    let mut samples = projector.samples();
    let first = samples.next().unwrap_or_else(|| Err(projector.fault()))?;
    let info = info(&first).ok_or_else(|| projector.fault())?;
    let size = (info.width(), info.height());
    let rate = f64::from(info.fps().numer()) / f64::from(info.fps().denom().max(1));
    let frame_rate = if rate > 0.0 { rate } else { UNKNOWN_RATE };
    let ours = || Tracker::new(TrackerName::Ptztrack, FirstBox::Detected, size).description();
    let elements = elements.map_or_else(ours, str::to_owned);
    let description =
        format!("appsrc name={SOURCE} ! {elements} ! fakesink name={SINK} sync=false async=false");
    let pipeline = Pipeline::new(&description, &info)?;
    let listener = Listener::attach(&pipeline)?;
    pipeline.start()?;
    let mut sequence = Sequence::new(size);
    for (number, sample) in (0..).zip(std::iter::once(Ok(first)).chain(samples)) {
        pipeline.finish(stamped(&sample?, number as f64 / frame_rate)?)?;
        let people = truth.get(&number).map_or(&[][..], Vec::as_slice);
        let people: Vec<_> = people.iter().map(|person| sighting(person, size).truth).collect();
        sequence.add(&people, &listener.take(), None);
    }
    Ok((sequence, frame_rate))
}
