// SPDX-License-Identifier: MPL-2.0

//! The part of the command line that asks for scenes of the strata.

use std::{ops::RangeInclusive, path::PathBuf};

use clap::Args;

use super::{NUMBERS, SceneId, Stratum, stages};
use crate::{
    experiment::Experiment,
    open_loop::Stage,
    record::{Suite, TrackerName},
};

/// These may be looked into and tuned on.
pub const TUNING: RangeInclusive<u64> = 1..=10;
/// These are run once, at the end of a piece of work, and never looked into.
pub const HELD_OUT: RangeInclusive<u64> = 11..=20;

/// Scenes of the strata.
#[derive(Debug, Clone, Args)]
pub struct StrataArgs {
    /// Show scenes of the strata to detector and tracker alone, from recordings that are made once: seeds 1 to 10 are for tuning,
    /// 11 to 20 are held out: run them once, at the end, and never look into them
    #[arg(long, group = "shown", conflicts_with_all = ["test", "gallery", "recording", "photographs"])]
    pub open_loop: bool,
    /// The same scenes with a camera that is steered by what the tracker says
    #[arg(long, conflicts_with_all = ["open_loop", "test", "gallery", "recording", "photographs"])]
    pub closed_loop: bool,
    /// Only these strata
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub stratum: Vec<Stratum>,
    /// How many scenes of each stratum and seed, from the first
    #[arg(long, value_name = "N", default_value_t = NUMBERS)]
    pub scenes: u32,
    /// How many recordings of each scene, each by a camera that is steered otherwise
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub replicates: u32,
    /// Elements instead of the tracker's usual ones, as for gst-launch-1.0; one is named tracker:
    /// "bgavgdetect ! lkfeaturetrack name=tracker coast-time=1000000000"
    #[arg(long, value_name = "ELEMENTS")]
    pub elements: Option<String>,
    /// Folder of the recordings
    #[arg(long, value_name = "FOLDER", default_value = "target/evaluation/recordings")]
    pub recordings: PathBuf,
    // What conflicts with a required option lifts the requirement, in clap: so each that needs `open_loop` says what it does not go with.
    /// Replace what these stages say by the truth: motion, regions, owner, hidden, speed, size, lag, bias, jitter
    #[arg(
        long,
        value_name = "STAGE",
        value_delimiter = ',',
        requires = "open_loop",
        conflicts_with = "closed_loop"
    )]
    pub replace: Vec<Stage>,
    /// Show each scene with no stage, each alone, all but each and all replaced, and write a table of what that changes
    #[arg(long, requires = "open_loop", conflicts_with_all = ["closed_loop", "replace"])]
    pub by_stage: bool,
    /// Write truth, regions and tracks of everybody into this folder, as MOTChallenge text: in open loop beside what else is
    /// written, of --still-recording instead of it
    #[arg(long, value_name = "FOLDER", requires = "shown", conflicts_with = "closed_loop")]
    pub motchallenge: Option<PathBuf>,
}

impl StrataArgs {
    /// Which suite is asked for, if one of these is.
    pub fn suite(&self) -> Option<Suite> {
        match (self.open_loop, self.closed_loop) {
            (true, _) => Some(Suite::OpenLoop),
            (false, true) => Some(Suite::ClosedLoop),
            (false, false) => None,
        }
    }

    /// Every scene asked for of these seeds with these trackers, and which it is.
    pub fn experiments(
        &self,
        suite: Suite,
        seeds: &[u64],
        trackers: &[TrackerName],
    ) -> Vec<(SceneId, Experiment)> {
        let mut all = Vec::new();
        let strata = Stratum::ALL.iter().filter(|one| self.stratum.is_empty() || self.stratum.contains(one));
        for &stratum in strata {
            for (&tracker, &seed) in trackers.iter().flat_map(|one| seeds.iter().map(move |seed| (one, seed)))
            {
                let numbers =
                    (1..=self.scenes).flat_map(|number| (1..=self.replicates).map(move |one| (number, one)));
                for (number, replicate) in numbers {
                    let id = SceneId { stratum, seed, number };
                    let one = self.experiment(id, replicate, suite, tracker);
                    let replaced = self.replaced().into_iter();
                    all.extend(replaced.map(|replaced| (id, Experiment { replaced, ..one.clone() })));
                }
            }
        }
        all
    }

    fn experiment(&self, id: SceneId, replicate: u32, suite: Suite, tracker: TrackerName) -> Experiment {
        let recordings = (suite == Suite::OpenLoop).then(|| self.recordings.clone());
        let (motchallenge, elements) = (self.motchallenge.clone(), self.elements.clone());
        Experiment { elements, replicate, recordings, motchallenge, ..id.experiment(suite, tracker) }
    }

    /// What is replaced by the truth, one after the other.
    fn replaced(&self) -> Vec<Vec<Stage>> {
        if self.by_stage { stages::sets() } else { vec![self.replace.clone()] }
    }
}

/// What is to be said of these seeds before they are run; `looked_into` is an error for those that are held out.
///
/// # Errors
/// In words, where scenes that are held out would be shown.
pub fn notice(seeds: &[u64], looked_into: bool) -> Result<Option<&'static str>, &'static str> {
    match seeds.iter().any(|seed| HELD_OUT.contains(seed)) {
        true if looked_into => Err("seeds 11 to 20 are held out: no films, no texts of them"),
        true => Ok(Some(
            "seeds 11 to 20 are held out: run them once, at the end, and do not tune on what comes out",
        )),
        false => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_out_is_said_to_be_and_is_not_shown() {
        assert_eq!(notice(&[1, 10], true), Ok(None));
        assert!(notice(&[10, 11], false).is_ok_and(|said| said.is_some()));
        assert!(notice(&[20], true).is_err());
        assert!(TUNING.end() + 1 == *HELD_OUT.start());
    }
}
