// SPDX-License-Identifier: MPL-2.0

//! Reads what was written about scenes, and averages over recordings of the same one.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use crate::{metrics::mean, report::csv, strata::table::SCENES};

/// Why nothing can be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// There is no report, or none to read.
    #[error("cannot read {}: {source}; a report is a folder once given as --out to --open-loop or --closed-loop", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It is something else, or of an earlier version.
    #[error("{} has no column `{column}`: it is no report of this version", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// What is missing.
        column: &'static str,
    },
    /// Scenes that are drawn otherwise are other scenes.
    #[error(
        "the scenes were made by different generators (`{0}` and `{1}`): run both on the same recordings"
    )]
    Generator(String, String),
    /// There would be no telling which is compared with which.
    #[error("{} has {count} trackers: compare reports of one each", path.display())]
    Trackers {
        /// The file.
        path: PathBuf,
        /// How many.
        count: usize,
    },
    /// They have no scene in common.
    #[error("the reports have no scene in common")]
    Nothing,
    /// Nothing can be said about chance.
    #[error("{} has one recording of each scene: run it with --replicates 2 or more", path.display())]
    Replicates {
        /// The file.
        path: PathBuf,
    },
}

/// How many endpoints there are.
pub const ENDPOINTS: usize = 4;

/// One scene's endpoints, in the order of [`super::compare::ENDPOINT`]; and for counts of scenes whether it had a loss.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Figures {
    /// Held, distance, changes a minute, pursuits an hour.
    pub endpoints: [Option<f64>; ENDPOINTS],
    /// Share of the recordings with a loss.
    pub lost: f64,
}

/// Which scene: suite, stratum, seed, number.
pub type Key = (String, String, u64, u32);

/// What a report says.
#[derive(Debug, Clone)]
pub struct Report {
    /// What drew the scenes.
    pub generator: String,
    /// Of each scene, one for each recording of it.
    pub scenes: BTreeMap<Key, Vec<Figures>>,
}

impl Report {
    /// The scenes of the report in `folder` that came to their end.
    pub fn read(folder: &Path) -> Result<Self, CompareError> {
        let path = folder.join(SCENES);
        let text = fs::read_to_string(&path)
            .map_err(|source| CompareError::Unreadable { path: path.clone(), source })?;
        Self::parse(&text, &path)
    }

    pub(super) fn parse(text: &str, path: &Path) -> Result<Self, CompareError> {
        let mut lines = csv::parse(text).into_iter();
        let names = lines.next().unwrap_or_default();
        let place = |column: &'static str| {
            let found = names.iter().position(|name| name == column);
            found.ok_or_else(|| CompareError::Column { path: path.into(), column })
        };
        let [suite, tracker, stratum, seed, number] =
            [place("suite")?, place("tracker")?, place("stratum")?, place("seed")?, place("number")?];
        let [held, distance, changes, pursuits, losses, seconds] = [
            place("held")?,
            place("distance")?,
            place("changes")?,
            place("pursuits")?,
            place("losses")?,
            place("seconds")?,
        ];
        let (generator, error) = (place("generator")?, place("error")?);
        let rows: Vec<_> = lines.filter(|row| row.len() == names.len() && row[error].is_empty()).collect();
        let trackers: std::collections::BTreeSet<_> = rows.iter().map(|row| &row[tracker]).collect();
        if trackers.len() > 1 {
            return Err(CompareError::Trackers { path: path.into(), count: trackers.len() });
        }
        let mut scenes = BTreeMap::<Key, Vec<Figures>>::new();
        for row in &rows {
            let value = |column: usize| row[column].parse::<f64>().ok();
            let rate = |column: usize, unit_s: f64| Some(value(column)? / value(seconds)? * unit_s);
            let endpoints = [
                value(held).map(|held| 100.0 * held),
                value(distance),
                rate(changes, 60.0),
                rate(pursuits, 3600.0),
            ];
            let whole = |column: usize| row[column].parse::<u64>().unwrap_or(0);
            let key = (row[suite].clone(), row[stratum].clone(), whole(seed), whole(number) as u32);
            let lost = f64::from(u8::from(value(losses).is_some_and(|losses| losses > 0.0)));
            scenes.entry(key).or_default().push(Figures { endpoints, lost });
        }
        let generator = rows.first().map(|row| row[generator].clone()).unwrap_or_default();
        Ok(Self { generator, scenes })
    }

    /// Scene by scene, the mean over its recordings.
    pub fn averaged(&self) -> BTreeMap<Key, Figures> {
        self.scenes.iter().map(|(key, recordings)| (key.clone(), average(recordings))).collect()
    }
}

fn average(recordings: &[Figures]) -> Figures {
    let of = |value: &dyn Fn(&Figures) -> Option<f64>| {
        mean(&recordings.iter().filter_map(value).collect::<Vec<_>>())
    };
    Figures {
        endpoints: std::array::from_fn(|index| of(&|one| one.endpoints[index])),
        lost: of(&|one| Some(one.lost)).unwrap_or(0.0),
    }
}
