// SPDX-License-Identifier: MPL-2.0

//! The command line: which experiments are run, how many at once, and where the report goes.

use std::{collections::BTreeSet, ops::RangeInclusive, path::PathBuf, str::FromStr, time::Duration};

use clap::Parser;

use crate::{
    experiment::{Experiment, Protocol, Scene},
    footage::{SceneError, Whom},
    record::{Codec, Delays, FirstBox, TestId, TrackerName},
    strata::options::StrataArgs,
    suite::photo::PhotosError,
    trackers::missing,
};

/// Follows people with a moving camera, in the thesis' tests or in recordings, and writes CSV, tables, plots and one page.
#[derive(Debug, Clone, Parser)]
#[command(name = "evaluate", version, after_help = EXAMPLES)]
pub struct Args {
    /// Tests by number, or ways through photographs, `7` or `1-6`; all unless given
    #[arg(long, value_name = "N[,N-M]", value_delimiter = ',')]
    pub test: Vec<Tests>,
    /// Trackers by name, or `all`
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "ptztrack")]
    pub tracker: Vec<Trackers>,
    /// By what the camera is moved, where it is
    #[arg(long, default_value = "vapix")]
    pub protocol: Protocol,
    /// What the pictures go through: mjpeg, mpeg4 or raw; a recording as it is only ever is raw
    #[arg(long, default_value = "mjpeg")]
    pub codec: Codec,
    /// Width and height of the pictures; a recording as it is has its own
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size, conflicts_with = "still_recording")]
    pub size: (u32, u32),
    /// Numbers of worlds, `1` or `1-3`; 1 is the reference
    #[arg(long, value_name = "N[,N-M]", value_delimiter = ',', default_value = "1")]
    pub seed: Vec<Seeds>,
    /// From light on the sensor to the picture at the tracker, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 100)]
    pub video_delay: u64,
    /// From a command's arrival to the first movement, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 60)]
    pub command_delay: u64,
    /// Who draws the first box: detected (by those that can) or given (the truth, to every tracker; ours is
    /// told its middle alone, as by a click). Detected in tests and given
    /// in recordings, unless said otherwise
    #[arg(long)]
    pub first_box: Option<FirstBox>,
    /// Run everything anew, whatever results are kept
    #[arg(long)]
    pub fresh: bool,
    /// Folder of the results that are kept
    #[arg(long, default_value = "target/evaluation/results")]
    pub results: PathBuf,
    /// Instead of running anything, say of each stratum whether the second of two reports is better, worse or not told apart from
    /// the first: two folders once given as --out with --open-loop or --closed-loop
    #[arg(long, num_args = 2, value_names = ["A", "B"], conflicts_with_all = ["test", "gallery", "footage", "still_recording"])]
    pub compare: Vec<PathBuf>,
    /// Instead of running anything, say how often a report of --replicates 2 or more is told apart from itself, its recordings dealt out
    /// at random
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["compare", "test", "gallery", "footage", "still_recording"])]
    pub calibrate: Option<PathBuf>,
    /// Write a video of each run into films/ as well, with everything drawn in: the truth in white
    #[arg(long)]
    pub record: bool,
    /// Instead of running tests, write pictures of the room or of the photographs, to look at: every
    /// subject, light and occlusion, from far and near
    #[arg(long, conflicts_with_all = ["test", "footage", "still_recording", "record"])]
    pub gallery: bool,
    /// Instead of the tests, follow one person in a still camera's recording, as seen by a camera that turns within it
    #[arg(long, value_name = "FILE", group = "recording", requires = "truth", conflicts_with_all = ["test"])]
    pub footage: Option<PathBuf>,
    /// Instead of the tests, follow one person in a recording as it is: no camera, no codec, no delays
    #[arg(long, value_name = "FILE", groups = ["recording", "shown"], requires = "truth", conflicts_with_all = ["test", "footage"])]
    pub still_recording: Option<PathBuf>,
    /// Who is where in the recording: MOTChallenge (frame,id,left,top,width,height,...); for --still-recording also one box
    /// a line, left,top,width,height or left,top,right,bottom
    #[arg(long, value_name = "FILE", requires = "recording")]
    pub truth: Option<PathBuf>,
    /// Number of the person to follow in the recording, auto: who is there longest, or all: everybody who is there for five
    /// seconds or more, one after the other
    #[arg(long, value_name = "ID|auto|all", default_value = "auto", requires = "recording")]
    pub person: Whom,
    /// Instead of the tests, twelve ways through each photograph of a folder: panoramas in panoramas/, in walker/ somebody cut out
    /// of film
    #[arg(long, value_name = "FOLDER", group = "photographs", conflicts_with_all = ["recording"])]
    pub photos: Option<PathBuf>,
    /// Instead of the tests, twelve ways through this equirectangular panorama
    #[arg(long, value_name = "FILE", group = "photographs", requires = "walker", conflicts_with_all = ["recording"])]
    pub photo: Option<PathBuf>,
    /// Folder of somebody cut out of film: walker.csv, and the pictures that it lists
    #[arg(long, value_name = "FOLDER", requires = "photo")]
    pub walker: Option<PathBuf>,
    /// Where one can walk in the panorama (JSON); the file beside it that has its name and ends with .json unless given
    #[arg(long, value_name = "FILE", requires = "photo")]
    pub photo_place: Option<PathBuf>,
    /// Scenes of the strata
    #[command(flatten)]
    pub strata: StrataArgs,
    /// Further properties of the servo, as for gst-launch-1.0: "learn=false prediction=average"
    #[arg(long, value_name = "PROPERTIES", default_value = "")]
    pub servo: String,
    /// How many runs go on at once
    #[arg(long, default_value_t = 2)]
    pub jobs: usize,
    /// Folder for everything that is written
    #[arg(long, default_value = "target/evaluation")]
    pub out: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  evaluate                                           all 72 tests in a simulated room
  evaluate --open-loop --seed 1-10                   scenes of all strata, from recordings, in open loop
  evaluate --test 1-6 --tracker ptztrack,oracle --record
  evaluate --footage walk.mp4 --truth walk.csv --tracker ptztrack,thesis,csrt
                                                     a camera that turns within a recording, in closed loop
  evaluate --still-recording walk.mp4 --truth walk.csv --tracker all
                                                     the recording as it is: success and precision of the box
  evaluate --photos photos --gallery                 pictures of somebody in photographs of rooms";

/// Tests from one number to another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tests(RangeInclusive<u32>);

impl FromStr for Tests {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<u32>().ok();
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let range = number(first).zip(number(last)).map(|(first, last)| first..=last);
        let known = 1..=TestId::COUNT;
        range
            .filter(|range| known.contains(range.start()) && known.contains(range.end()) && !range.is_empty())
            .map(Self)
            .ok_or_else(|| {
                format!("tests are numbers from 1 to {} or ranges of them, not `{text}`", TestId::COUNT)
            })
    }
}

/// Worlds from one number to another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seeds(RangeInclusive<u64>);

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let range = first.trim().parse().ok().zip(last.trim().parse().ok()).map(|(first, last)| first..=last);
        range
            .filter(|range: &RangeInclusive<u64>| !range.is_empty())
            .map(Self)
            .ok_or_else(|| format!("seeds are whole numbers or ranges of them, not `{text}`"))
    }
}

/// One tracker, or all of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trackers(Vec<TrackerName>);

impl FromStr for Trackers {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "all" => Ok(Self(TrackerName::ALL.to_vec())),
            name => Ok(Self(vec![name.parse()?])),
        }
    }
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let sides =
        text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    sides
        .filter(|(width, height)| (16..=4096).contains(width) && (16..=4096).contains(height))
        .ok_or_else(|| format!("a size is WIDTHxHEIGHT, 16 to 4096 pixels each, not `{text}`"))
}

impl Args {
    /// The tests asked for, in order and each once.
    pub fn tests(&self) -> Vec<TestId> {
        TestId::all().filter(|test| self.asks_for(test.0)).collect()
    }

    fn asks_for(&self, number: u32) -> bool {
        self.test.is_empty() || self.test.iter().any(|Tests(range)| range.contains(&number))
    }

    /// The trackers asked for, in the order of the tables, and what is to be said of those that are left out.
    pub fn trackers(&self) -> (Vec<TrackerName>, Vec<String>) {
        let asked = |name: &TrackerName| self.tracker.iter().any(|Trackers(names)| names.contains(name));
        let (mut there, mut left_out) = (Vec::new(), Vec::new());
        for name in TrackerName::ALL.iter().copied().filter(asked) {
            match missing(name) {
                None => there.push(name),
                Some(reason) => left_out.push(reason),
            }
        }
        (there, left_out)
    }

    /// What there are to be pictures of; nothing unless asked for.
    ///
    /// # Errors
    /// Where photographs cannot be used.
    pub fn gallery(&self) -> Result<Vec<Experiment>, SceneError> {
        let Some(&seed) = self.seeds().first().filter(|_| self.gallery) else { return Ok(Vec::new()) };
        // The first quarter of the tests has all lights, occlusions and subjects.
        let rooms = || (1..=18).filter_map(|test| Scene::room(TestId(test), seed)).collect();
        let scenes: Vec<Scene> = self.photographs(seed).transpose()?.unwrap_or_else(rooms);
        let still = |scene| self.experiment(scene, TrackerName::Still, seed);
        Ok(scenes.into_iter().map(still).collect())
    }

    /// The worlds asked for, in order and each once.
    pub fn seeds(&self) -> Vec<u64> {
        let asked: BTreeSet<_> = self.seed.iter().flat_map(|Seeds(range)| range.clone()).collect();
        asked.into_iter().collect()
    }

    fn is_recording(&self) -> bool {
        self.footage.is_some() || self.still_recording.is_some()
    }

    fn experiment(&self, scene: Scene, tracker: TrackerName, seed: u64) -> Experiment {
        let usual = if self.is_recording() { FirstBox::Given } else { FirstBox::Detected };
        let delays = Delays {
            video: Duration::from_millis(self.video_delay),
            command: Duration::from_millis(self.command_delay),
        };
        Experiment {
            protocol: self.protocol,
            codec: self.codec,
            size: self.size,
            delays,
            first_box: self.first_box.unwrap_or(usual),
            servo: self.servo.clone(),
            films: self.record.then(|| self.out.join("films")),
            elements: self.strata.elements.clone(),
            ..Experiment::new(scene, tracker, seed)
        }
    }

    /// Ways through photographs; `None` where none are asked for.
    fn photographs(&self, seed: u64) -> Option<Result<Vec<Scene>, PhotosError>> {
        let mut scenes = match (&self.photos, &self.photo, &self.walker) {
            (Some(folder), ..) => Scene::photos(folder, seed),
            (None, Some(file), Some(walker)) => Scene::photo(file, walker, self.photo_place.as_deref(), seed),
            _ => return None,
        };
        if let Ok(scenes) = &mut scenes {
            scenes.retain(|scene| scene.way().is_none_or(|way| self.asks_for(way)));
        }
        Some(scenes)
    }

    /// What is to be followed, and the number of its world.
    fn scenes(&self) -> Result<Vec<(Scene, u64)>, SceneError> {
        let mut photographs = Vec::new();
        for seed in self.seeds() {
            let scenes = self.photographs(seed).transpose()?.unwrap_or_default();
            photographs.extend(scenes.into_iter().map(|scene| (scene, seed)));
        }
        if !photographs.is_empty() {
            return Ok(photographs);
        }
        let recordings = match (&self.footage, &self.still_recording, &self.truth) {
            (Some(file), _, Some(truth)) => Scene::footage(file, truth, self.person, self.size)?,
            (None, Some(file), Some(truth)) => Scene::recordings(file, truth, self.person)?,
            _ => return Ok(self.seeds().into_iter().flat_map(|seed| self.rooms(seed)).collect()),
        };
        // A recording is what it is: there is no other world of it.
        Ok(recordings.into_iter().map(|scene| (scene, 1)).collect())
    }

    fn rooms(&self, seed: u64) -> Vec<(Scene, u64)> {
        let rooms = self.tests().into_iter().filter_map(|test| Scene::room(test, seed));
        rooms.map(|scene| (scene, seed)).collect()
    }

    /// Everything asked for, tracker after tracker.
    ///
    /// # Errors
    /// Where a recording or its ground truth cannot be used.
    pub fn experiments(&self, trackers: &[TrackerName]) -> Result<Vec<Experiment>, SceneError> {
        let scenes = self.scenes()?;
        let mut experiments = Vec::new();
        for tracker in trackers {
            let of = |(scene, seed): &(Scene, u64)| self.experiment(scene.clone(), *tracker, *seed);
            experiments.extend(scenes.iter().map(of));
        }
        Ok(experiments)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Args, clap::Error> {
        Args::try_parse_from(["evaluate"].into_iter().chain(line.split_whitespace()))
    }

    #[test]
    fn all_tests_of_ours_unless_asked_for_others() {
        let args = parse("").unwrap();
        assert_eq!(args.tests().len(), 72);
        assert_eq!(args.trackers().0, [TrackerName::Ptztrack]);
        let args = parse("--test 7,1-3,2 --tracker oracle,thesis").unwrap();
        assert_eq!(args.tests(), [1, 2, 3, 7].map(TestId));
        assert_eq!(args.trackers().0, [TrackerName::Thesis, TrackerName::Oracle]);
        assert_eq!(args.experiments(&args.trackers().0).unwrap().len(), 8);
    }

    #[test]
    fn elements_are_those_of_every_run() {
        for line in ["--test 1 --elements identity", "--closed-loop --stratum alone --elements identity"] {
            let args = parse(line).unwrap();
            let all = match args.strata.suite() {
                Some(suite) => args.strata.experiments(suite, &[1], &[TrackerName::Ptztrack]),
                None => Vec::new(),
            };
            let scenes = all.into_iter().map(|(_, scene)| scene);
            let tests = args.experiments(&[TrackerName::Ptztrack]).unwrap();
            assert!(scenes.chain(tests).all(|one| one.elements.as_deref() == Some("identity")), "{line}");
        }
    }

    #[test]
    fn several_worlds_are_run_one_after_the_other() {
        let args = parse("--test 1,5 --seed 1-3,7,2").unwrap();
        assert_eq!(args.seeds(), [1, 2, 3, 7]);
        let experiments = args.experiments(&[TrackerName::Ptztrack]).unwrap();
        let seeds: Vec<_> = experiments.iter().map(|one| one.seed).collect();
        assert_eq!(seeds, [1, 1, 2, 2, 3, 3, 7, 7]);
        assert!(experiments.iter().all(|one| one.first_box == FirstBox::Detected));
    }

    #[test]
    fn all_means_all_that_are_there() {
        crate::init().unwrap();
        let (there, left_out) = parse("--tracker all").unwrap().trackers();
        assert_eq!(there.len() + left_out.len(), TrackerName::ALL.len());
    }

    #[test]
    fn what_is_only_there_by_default_conflicts_with_nothing() {
        for line in [
            "--still-recording x.avi --truth x.csv",
            "--still-recording x.avi --truth x.csv --person 3",
            "--footage x.avi --truth x.csv --size 320x240 --person auto",
        ] {
            assert!(parse(line).is_ok(), "{line}");
        }
    }

    #[test]
    fn nonsense_is_refused_with_what_would_be_right() {
        for (line, hint) in [
            ("--test 73", "1 to 72"),
            ("--test 5-3", "1 to 72"),
            ("--size 640", "WIDTHxHEIGHT"),
            ("--tracker best", "ptztrack, thesis"),
            ("--codec h265", "mjpeg, mpeg4, raw"),
            ("--first-box drawn", "detected, given"),
            ("--seed 3-1", "whole numbers"),
            ("--compare a", "2 values"),
            ("--footage x.avi", "--truth"),
            ("--truth x.csv", "--footage"),
            ("--person 3", "--still-recording"),
            ("--footage x.avi --still-recording x.avi --truth x.csv", "cannot be used with"),
            ("--still-recording x.avi --truth x.csv --size 320x240", "cannot be used with"),
            ("--person somebody", "auto"),
            ("--replace motion", "--open-loop"),
            ("--closed-loop --replace motion", "cannot be used with"),
            ("--closed-loop --by-stage", "cannot be used with"),
            ("--closed-loop --motchallenge x", "cannot be used with"),
            ("--photo x.jpg", "--walker"),
            ("--photos x --footage y.avi --truth z.csv", "cannot be used with"),
            ("--photos x --photo y.jpg --walker z", "cannot be used with"),
        ] {
            let error = parse(line).unwrap_err().to_string();
            assert!(error.contains(hint), "{line}: {error}");
        }
    }
}
