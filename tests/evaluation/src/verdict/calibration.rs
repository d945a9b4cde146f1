// SPDX-License-Identifier: MPL-2.0

//! How often a build is told from itself: recordings of the same scenes, dealt out at random to two that are the same.

use std::{collections::BTreeMap, path::Path};

use virtual_camera::Seeded;

use super::{
    compare::Comparison,
    read::{CompareError, Figures, Key, Report},
};

/// Of so many comparisons of the report in `folder` with itself, how many tell something apart.
///
/// # Errors
/// Where it cannot be read, or has only one recording of a scene.
pub fn calibrate(folder: &Path, comparisons: usize) -> Result<usize, CompareError> {
    let report = Report::read(folder)?;
    if report.scenes.values().any(|recordings| recordings.len() < 2) {
        return Err(CompareError::Replicates { path: folder.into() });
    }
    Ok(told(&report, comparisons))
}

pub(super) fn told(report: &Report, comparisons: usize) -> usize {
    let mut chance = Seeded::new(0xca11);
    let comparison = |_: &usize| {
        let (mut one, mut other) = (BTreeMap::<Key, Figures>::new(), BTreeMap::new());
        for (key, recordings) in &report.scenes {
            let first = chance.below(recordings.len());
            let second = (first + 1 + chance.below(recordings.len() - 1)) % recordings.len();
            one.insert(key.clone(), recordings[first]);
            other.insert(key.clone(), recordings[second]);
        }
        Comparison::of(&one, &other).tells()
    };
    (0..comparisons).filter(comparison).count()
}
