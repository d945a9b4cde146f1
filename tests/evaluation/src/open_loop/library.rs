// SPDX-License-Identifier: MPL-2.0

//! Recordings that are kept: one file a scene, which begins with the key of all that it was made of. Another key, and it is made
//! anew.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use virtual_camera::Settings;

use super::{recorded::RecordedScene, recorder};
use crate::{experiment::Experiment, lockstep::RunError, report::slug};

/// A hash of what draws, encodes and steers: results from recordings of two generators are not comparable.
pub fn generator() -> String {
    format!("{}, {}", env!("GENERATOR_SOURCES"), gst::version_string())
}

/// A file of it.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    key: String,
    scene: T,
}

/// The recording of a scene, kept in `folder`; made where it is not there.
pub(super) fn recording(
    experiment: &Experiment,
    settings: &Settings,
    folder: &Path,
) -> Result<RecordedScene, RunError> {
    let (file, key) = (file(experiment, folder), key(experiment));
    if let Some(scene) = read(&file, &key) {
        return Ok(scene);
    }
    let scene = recorder::record(experiment, settings)?;
    keep(&file, &Kept { key, scene: &scene }).map_err(|source| RunError::Keep { file, source })?;
    Ok(scene)
}

fn read(file: &Path, key: &str) -> Option<RecordedScene> {
    let kept: Kept<RecordedScene> = postcard::from_bytes(&fs::read(file).ok()?).ok()?;
    (kept.key == key).then_some(kept.scene)
}

fn keep(file: &Path, kept: &Kept<&RecordedScene>) -> std::io::Result<()> {
    let bytes = postcard::to_stdvec(kept).map_err(std::io::Error::other)?;
    fs::create_dir_all(file.parent().unwrap_or(file))?;
    // One that is broken off leaves no half of a file.
    let unfinished = file.with_extension(format!("{}.part", std::process::id()));
    fs::write(&unfinished, bytes)?;
    fs::rename(unfinished, file)
}

fn file(experiment: &Experiment, folder: &Path) -> PathBuf {
    folder.join(format!("{}-r{}.scene", slug(&experiment.scene.title), experiment.replicate))
}

/// All that a recording depends on, in words.
fn key(experiment: &Experiment) -> String {
    let Experiment { scene, codec, size, delays, seed, replicate, .. } = experiment;
    let scene = crate::experiment::Scene { suite: crate::record::Suite::OpenLoop, ..scene.clone() };
    format!("{}\n{scene:?} {codec} {size:?} {delays:?} {seed} {replicate}", generator())
}
