// SPDX-License-Identifier: MPL-2.0

//! Photographs of rooms with somebody walking in them: twelve ways through each.

use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fmt::Write,
    path::{Path, PathBuf},
    time::Duration,
};

use virtual_camera::{PhotoError, PhotoPlace, PhotoSettings, World};

use crate::{
    experiment::{Place, Scene, Target},
    metrics::{Cause, Metrics, losses, mean},
    record::{Run, Suite, TrackerName},
};

/// In a folder of photographs, where the panoramas are and where the person is.
const PANORAMAS: &str = "panoramas";
const WALKER: &str = "walker";
/// What files of panoramas end with.
const ENDINGS: [&str; 3] = ["jpg", "jpeg", "webp"];

/// Why there are no photographs.
#[derive(Debug, thiserror::Error)]
pub enum PhotosError {
    /// The folder cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// There is none in it.
    #[error("no panorama in {}: .jpg, .jpeg or .webp", .0.display())]
    Empty(PathBuf),
    /// One of them is no world.
    #[error(transparent)]
    Photo(#[from] PhotoError),
}

impl Scene {
    /// All ways through one panorama; `description` says where one can walk, unless a file beside it does or its name is known.
    ///
    /// # Errors
    /// Where nothing says where one can walk.
    pub fn photo(
        panorama: &Path,
        walker: &Path,
        description: Option<&Path>,
        seed: u64,
    ) -> Result<Vec<Self>, PhotosError> {
        let place = PhotoPlace::of(panorama, description)?;
        let name = panorama.file_stem().map(OsStr::to_string_lossy).unwrap_or_default();
        let settings =
            |number| PhotoSettings::way(panorama.into(), walker.into(), place.clone(), number, seed);
        let scene = |photo: PhotoSettings| Self {
            suite: Suite::Photo,
            test: None,
            path: name.clone().into_owned(),
            title: format!("{name} way {}", photo.way),
            duration: photo.duration(),
            place: Place::world(World::Photo(Box::new(photo))),
            begin: Duration::ZERO,
            lead: Duration::ZERO,
            target: Target::Only,
        };
        Ok((1..=PhotoSettings::WAYS).filter_map(settings).map(scene).collect())
    }

    /// Number of the way through a photograph, from 1; `None` in any other scene.
    pub fn way(&self) -> Option<u32> {
        match &self.place {
            Place::Camera(camera) => match &camera.world {
                World::Photo(photo) => Some(photo.way),
                _ => None,
            },
            Place::Recording(_) => None,
        }
    }

    /// All ways through all panoramas of a folder.
    ///
    /// # Errors
    /// Where there is none, or nothing says where one can walk in one of them.
    pub fn photos(folder: &Path, seed: u64) -> Result<Vec<Self>, PhotosError> {
        let panoramas = folder.join(PANORAMAS);
        let unreadable = |source| PhotosError::Unreadable { path: panoramas.clone(), source };
        let entries = std::fs::read_dir(&panoramas).map_err(unreadable)?;
        let files: Result<Vec<PathBuf>, _> = entries.map(|entry| Ok(entry?.path())).collect();
        let is_picture = |file: &PathBuf| {
            file.extension()
                .is_some_and(|ending| ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)))
        };
        let mut files: Vec<_> = files.map_err(unreadable)?.into_iter().filter(is_picture).collect();
        files.sort();
        if files.is_empty() {
            return Err(PhotosError::Empty(panoramas));
        }
        let scenes = files.iter().map(|file| Self::photo(file, &folder.join(WALKER), None, seed));
        Ok(scenes.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
    }
}

/// A table of each tracker's figures by panorama; nothing where there are no photographs among `runs`.
pub fn summary(runs: &[Run]) -> String {
    let mut text = String::new();
    let photos = || runs.iter().filter(|run| run.suite == Suite::Photo && run.error.is_none());
    for tracker in TrackerName::ALL {
        let mut panoramas: BTreeMap<&str, Vec<&Run>> = BTreeMap::new();
        for run in photos().filter(|run| run.tracker == *tracker) {
            panoramas.entry(&run.path).or_default().push(run);
            panoramas.entry("~").or_default().push(run);
        }
        if panoramas.is_empty() {
            continue;
        }
        let heading = format!(
            "\n| {tracker}: photograph | ways | with a loss | stuck on the background | P % | DP % | TF % | d_gc |\n"
        );
        text += &heading;
        text += "|---|---:|---:|---:|---:|---:|---:|---:|\n";
        for (name, runs) in &panoramas {
            let name = if *name == "~" { "*all*" } else { name };
            // Writing to a string cannot fail.
            let _ = writeln!(text, "| {name} | {} |", row(runs).join(" | "));
        }
    }
    text
}

fn row(runs: &[&Run]) -> Vec<String> {
    let metrics: Vec<Metrics> = runs.iter().map(|run| Metrics::of(run)).collect();
    let of = |value: fn(&Metrics) -> Option<f64>| mean(&metrics.iter().filter_map(value).collect::<Vec<_>>());
    let percent = |value: Option<f64>| value.map_or("—".into(), |value| format!("{:.1}", 100.0 * value));
    let with = |holds: &dyn Fn(&Cause) -> bool| {
        let lost = |run: &&&Run| losses(&run.frames).iter().any(|loss| holds(&loss.cause));
        runs.iter().filter(lost).count().to_string()
    };
    vec![
        runs.len().to_string(),
        with(&|_| true),
        with(&|cause| *cause == Cause::Background),
        percent(of(|one| one.precision)),
        percent(of(|one| one.detection_precision)),
        percent(of(|one| one.track_fragmentation)),
        of(|one| one.mean_dgc).map_or("—".into(), |value| format!("{value:.3}")),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::made_up;

    #[test]
    fn every_panorama_has_its_ways() {
        let folder = std::env::temp_dir().join(format!("evaluation-photos-{}", std::process::id()));
        let panoramas = folder.join(PANORAMAS);
        std::fs::create_dir_all(&panoramas).unwrap();
        assert!(matches!(Scene::photos(&folder, 1), Err(PhotosError::Empty(_))));
        std::fs::write(panoramas.join("lake.jpg"), "").unwrap();
        let scenes = Scene::photos(&folder, 1).unwrap();
        assert_eq!(scenes.len(), PhotoSettings::WAYS as usize);
        assert!(scenes.iter().all(|scene| scene.suite == Suite::Photo && scene.path == "lake"));
        assert!(scenes.iter().map(Scene::way).eq((1..=PhotoSettings::WAYS).map(Some)));
        std::fs::write(panoramas.join("unknown.jpg"), "").unwrap();
        let told = Scene::photos(&folder, 1).unwrap_err().to_string();
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(told.contains("unknown.jpg") && told.contains("description"), "{told}");
        assert!(matches!(Scene::photos(&folder, 1), Err(PhotosError::Unreadable { .. })));
    }

    #[test]
    fn the_summary_has_a_line_for_each_panorama_and_one_for_all() {
        let run = |path: &str| Run { suite: Suite::Photo, path: path.into(), ..made_up::run(Vec::new()) };
        let text = summary(&[run("lake"), run("lake"), run("court")]);
        let ways = |name: &str| text.lines().find(|line| line.starts_with(&format!("| {name} | "))).unwrap();
        assert!(ways("lake").contains("| lake | 2 |") && ways("*all*").contains("| 3 |"), "{text}");
        assert_eq!(summary(&[made_up::run(Vec::new())]), "");
    }
}
