// SPDX-License-Identifier: MPL-2.0

//! Runs with their metrics, in an order that does not depend on which ended first.

use std::{collections::BTreeSet, fmt};

use super::{
    bootstrap::Group,
    thesis::{self, Row},
};
use crate::{
    metrics::{Loss, Metrics, losses},
    record::{Codec, Delays, FirstBox, Run, Suite, TestId, TrackerName},
};

/// What makes runs comparable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Setup {
    /// Which suite.
    pub suite: Suite,
    /// Who draws the first box.
    pub first_box: FirstBox,
    /// What the pictures go through.
    pub codec: Codec,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// How late things are.
    pub delays: Delays,
}

impl Setup {
    fn of(run: &Run) -> Self {
        let Run { suite, codec, size, first_box, delays, .. } = *run;
        Self { suite, first_box, codec, size, delays }
    }

    /// Name of a folder for runs of that seed.
    pub fn folder(&self, seed: u64) -> String {
        let Self { suite, codec, size: (width, height), first_box, delays, .. } = self;
        let (video, command) = (delays.video.as_millis(), delays.command.as_millis());
        format!("{suite}/seed{seed}-{codec}-{width}x{height}-{first_box}-video{video}ms-command{command}ms")
    }
}

impl fmt::Display for Setup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { suite, codec, size: (width, height), first_box, delays, .. } = self;
        let (video, command) = (delays.video.as_millis(), delays.command.as_millis());
        write!(
            f,
            "{suite}, first box {first_box}, {codec}, {width}x{height}, delays: video {video} ms, command {command} ms",
        )
    }
}

/// A run and what it is judged by.
pub struct Judged<'a> {
    /// What was run.
    pub run: &'a Run,
    /// With what it is comparable.
    pub setup: Setup,
    /// What came out.
    pub metrics: Metrics,
    /// When the person was lost, and why.
    pub losses: Vec<Loss>,
}

impl<'a> Judged<'a> {
    /// All of them, sorted.
    pub fn all(runs: &'a [Run]) -> Vec<Self> {
        let mut all: Vec<_> = runs
            .iter()
            .map(|run| Self {
                run,
                setup: Setup::of(run),
                metrics: Metrics::of(run),
                losses: losses(&run.frames),
            })
            .collect();
        all.sort_by_key(|one| (one.setup, one.run.test, &one.run.title, one.run.seed, one.run.tracker));
        all
    }

    /// With what it is not independent.
    pub fn group(&self) -> Group<'a> {
        (self.run.seed, &self.run.path)
    }

    /// What was shown: the same to every tracker.
    pub fn shown(&self) -> (&'a str, u64) {
        (&self.run.title, self.run.seed)
    }

    /// The thesis' row of the same test.
    pub fn printed(&self) -> Option<&'static Row> {
        thesis::row_of(self.run.test?)
    }
}

/// Name of a file of one run alone, without its ending: the setup is a folder.
pub fn place(run: &Run) -> String {
    format!("{}/{}-{}", Setup::of(run).folder(run.seed), slug(&run.title), run.tracker)
}

/// A title as part of a file name.
pub fn slug(title: &str) -> String {
    title.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

/// Comparable runs.
pub struct Section<'a> {
    /// What they have in common.
    pub setup: Setup,
    /// In order of test and tracker.
    pub runs: &'a [Judged<'a>],
}

impl<'a> Section<'a> {
    /// Sorted runs, cut where the setup changes.
    pub fn all(judged: &'a [Judged<'a>]) -> Vec<Self> {
        let same = |a: &Judged, b: &Judged| a.setup == b.setup;
        judged.chunk_by(same).map(|runs| Self { setup: runs[0].setup, runs }).collect()
    }

    /// Who was run, in the order of the tables.
    pub fn trackers(&self) -> impl Iterator<Item = TrackerName> {
        TrackerName::ALL.iter().copied().filter(|name| self.of(*name).next().is_some())
    }

    /// The runs of one tracker.
    pub fn of(&self, tracker: TrackerName) -> impl Iterator<Item = &'a Judged<'a>> + use<'a> {
        self.runs.iter().filter(move |judged| judged.run.tracker == tracker)
    }

    /// Those of them that came to their end: only they are comparable.
    pub fn whole(&self, tracker: TrackerName) -> impl Iterator<Item = &'a Judged<'a>> + use<'a> {
        self.of(tracker).filter(|one| one.run.error.is_none())
    }

    /// What was shown, each once.
    pub fn titles(&self) -> Vec<(Option<TestId>, &'a str)> {
        let mut titles: Vec<_> = self.runs.iter().map(|one| (one.run.test, one.run.title.as_str())).collect();
        titles.dedup();
        titles
    }

    /// What was shown to every tracker there is, to the end.
    pub fn shared(&self) -> BTreeSet<(&'a str, u64)> {
        let of = |name: TrackerName| self.whole(name).map(Judged::shown).collect::<BTreeSet<_>>();
        let all: Vec<_> = self.trackers().map(of).collect();
        let Some((first, others)) = all.split_first() else { return BTreeSet::new() };
        first.iter().filter(|shown| others.iter().all(|other| other.contains(*shown))).copied().collect()
    }

    /// The runs of what was shown, of the first seed.
    pub fn showing(&self, title: &str) -> impl Iterator<Item = &'a Judged<'a>> + use<'a, '_> {
        let title = title.to_owned();
        let first = self.runs.iter().filter(|one| one.run.title == title).map(|one| one.run.seed).min();
        self.runs.iter().filter(move |one| one.run.title == title && Some(one.run.seed) == first)
    }

    /// The thesis' rows of the tests that were run.
    pub fn printed(&self) -> Vec<&'static Row> {
        let was_run = |row: &&Row| self.runs.iter().any(|one| one.run.test == Some(row.test));
        thesis::rows().iter().filter(was_run).collect()
    }
}
