// SPDX-License-Identifier: MPL-2.0

//! Results that are kept, so that only what is missing is run: one file for each tracker, test, seed and setup. It begins
//! with the key of all that the result depends on; another key, and it is not taken.

use std::{fs, io, path::PathBuf, time::UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::{
    experiment::{Experiment, Place},
    provenance::Provenance,
    record::Run,
    report::place,
};

/// A folder of results.
#[derive(Debug, Clone)]
pub struct Store {
    folder: PathBuf,
    /// Whether nothing that is there is taken.
    fresh: bool,
}

/// A file of it.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    key: String,
    run: T,
}

impl Store {
    /// Results in `folder`; with `fresh` all are made anew, and kept.
    pub fn new(folder: impl Into<PathBuf>, fresh: bool) -> Self {
        Self { folder: folder.into(), fresh }
    }

    /// The kept result, if there is one that was made with what there is now. What cannot be read is not there.
    pub fn get(&self, experiment: &Experiment) -> Option<Run> {
        // A film is only made by running it.
        let kept = !self.fresh && experiment.films.is_none() && experiment.motchallenge.is_none();
        let bytes = fs::read(self.file(experiment)).ok().filter(|_| kept)?;
        let kept: Kept<Run> = postcard::from_bytes(&bytes).ok()?;
        (kept.key == key(experiment)).then_some(kept.run)
    }

    /// Keeps a result that came to its end, in the place of any older one.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn put(&self, experiment: &Experiment, run: &Run) -> io::Result<()> {
        if run.error.is_some() {
            return Ok(());
        }
        let bytes = postcard::to_stdvec(&Kept { key: key(experiment), run }).map_err(io::Error::other)?;
        let file = self.file(experiment);
        fs::create_dir_all(file.parent().unwrap_or(&self.folder))?;
        // A run that is broken off leaves no half of a file.
        let unfinished = file.with_extension(format!("{}.part", std::process::id()));
        fs::write(&unfinished, bytes)?;
        fs::rename(unfinished, file)
    }

    fn file(&self, experiment: &Experiment) -> PathBuf {
        self.folder.join(place(&experiment.blank()) + ".run")
    }
}

/// All that a result depends on, in words.
fn key(experiment: &Experiment) -> String {
    let files = match &experiment.scene.place {
        Place::Recording(recording) => vec![recording.file.clone()],
        Place::Camera(settings) => match &settings.world {
            virtual_camera::World::Footage(footage) => {
                [Some(footage.file.clone()), footage.ground_truth.clone()].into_iter().flatten().collect()
            }
            _ => Vec::new(),
        },
    };
    let stamps: Vec<_> = files.iter().map(stamp).collect();
    let experiment = Experiment { films: None, recordings: None, motchallenge: None, ..experiment.clone() };
    format!("{:?}\n{experiment:?}\n{stamps:?}", Provenance::of(experiment.tracker))
}

/// Length and time of the last change of a file.
fn stamp(file: &PathBuf) -> Option<(u64, u128)> {
    let metadata = fs::metadata(file).ok()?;
    let changed = metadata.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some((metadata.len(), changed.as_nanos()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        experiment::Scene,
        record::{FirstBox, TestId, TrackerName},
        report::made_up,
    };

    #[test]
    fn a_result_is_taken_again_only_for_the_very_same_experiment() {
        crate::init().unwrap();
        let folder = std::env::temp_dir().join(format!("ptztrack-store-{}", std::process::id()));
        let store = Store::new(&folder, false);
        let experiment =
            |seed| Experiment::new(Scene::room(TestId(7), seed).unwrap(), TrackerName::Ptztrack, seed);
        assert_eq!(store.get(&experiment(1)), None);
        let run = made_up::run(vec![made_up::judged_by_boxes(made_up::frame((80, 60)))]);
        store.put(&experiment(1), &run).unwrap();
        assert_eq!(store.get(&experiment(1)), Some(run.clone()));
        assert_eq!(store.get(&experiment(2)), None);
        for other in [
            Experiment { tracker: TrackerName::Thesis, ..experiment(1) },
            Experiment { first_box: FirstBox::Given, ..experiment(1) },
            Experiment { size: (320, 240), ..experiment(1) },
            Experiment { films: Some("films".into()), ..experiment(1) },
        ] {
            assert_eq!(store.get(&other), None, "{other:?}");
        }
        assert_eq!(Store::new(&folder, true).get(&experiment(1)), None);
        let broken = Run { error: Some("broke off".into()), ..run.clone() };
        store.put(&experiment(2), &broken).unwrap();
        assert_eq!(store.get(&experiment(2)), None, "what failed is run again");
        // Made with something else, or half written: as if it were not there.
        let file = store.file(&experiment(1));
        let other = Kept { key: "an older laboratory".to_owned(), run: &run };
        fs::write(&file, postcard::to_stdvec(&other).unwrap()).unwrap();
        assert_eq!(store.get(&experiment(1)), None);
        fs::write(&file, b"half").unwrap();
        assert_eq!(store.get(&experiment(1)), None);
        fs::remove_dir_all(&folder).unwrap();
    }
}
