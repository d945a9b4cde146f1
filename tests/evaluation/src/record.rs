// SPDX-License-Identifier: MPL-2.0

//! What one run leaves: per picture what was true, what the tracker said and where the camera looked. Pure data.

use std::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

pub use crate::provenance::Provenance;
pub use ptztrack_contract::TargetState;
pub use virtual_camera::{Bounds, GroundTruth, Sighting, Silhouette};

/// Number of a test in the order of the thesis' table 5.2, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct TestId(pub u32);

impl TestId {
    /// How many there are.
    pub const COUNT: u32 = 72;

    /// Every one of them.
    pub fn all() -> impl Iterator<Item = Self> {
        (1..=Self::COUNT).map(Self)
    }
}

impl fmt::Display for TestId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// An enumeration whose values have a name each, on the command line and in tables.
macro_rules! named {
    ($(#[$meta:meta])* $type:ident, $what:literal { $($(#[$variant_meta:meta])* $variant:ident = $name:literal),+ $(,)? }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
        pub enum $type { $($(#[$variant_meta])* $variant),+ }

        impl $type {
            /// Every one, in the order of the tables.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// As on the command line and in the tables.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = String;

            fn from_str(name: &str) -> Result<Self, String> {
                let known = Self::ALL.iter().copied().find(|known| known.name() == name);
                known.ok_or_else(|| {
                    let names: Vec<_> = Self::ALL.iter().map(|known| known.name()).collect();
                    format!(concat!("no ", $what, " is named `{}`; there are {}"), name, names.join(", "))
                })
            }
        }
    };
}

pub(crate) use named;

named! {
    /// What follows the person.
    TrackerName, "tracker" {
        /// Ours with its defaults.
        Ptztrack = "ptztrack",
        /// The thesis to the letter: its detector, features, mean-shift and one-second average.
        Thesis = "thesis",
        /// GStreamer's `cvtracker algorithm=csrt`.
        Csrt = "csrt",
        /// GStreamer's `cvtracker algorithm=kcf`.
        Kcf = "kcf",
        /// GStreamer's `cvtracker algorithm=mosse`.
        Mosse = "mosse",
        /// GStreamer's `cvtracker algorithm=medianflow`.
        MedianFlow = "medianflow",
        /// Others' law: relative moves, each waited for, as Frigate's autotracker makes them; knows the truth of the delayed picture.
        RelativeMoves = "relative-moves",
        /// Others' law: proportional control of the box's place; knows the truth of the delayed picture.
        BoxPid = "box-pid",
        /// Others' law: absolute moves to a predicted place (Tang and Bilodeau 2017), with GStreamer's `cvtracker algorithm=kcf`.
        KcfPredicted = "kcf-predicted",
        /// Bound: knows the truth of the delayed picture. What is lost is lost by the servo.
        Oracle = "oracle",
        /// Bound: an oracle that also tells the servo how the background moves, as ours does.
        OracleEgo = "oracle-ego",
        /// Bound: the same, and sees through what hides the person.
        OracleXray = "oracle-xray",
        /// Bound: a camera that never moves.
        Still = "still",
    }
}

impl TrackerName {
    /// Whether it finds people itself, so that it needs no first box.
    pub fn detects(self) -> bool {
        matches!(self, Self::Ptztrack | Self::Thesis)
    }
}

named! {
    /// A set of tests that are judged together.
    Suite, "suite" {
        /// The thesis' 72 tests in a made-up room.
        Room = "room",
        /// People cut out of film, in photographs of rooms.
        Photo = "photo",
        /// Recordings of real people.
        Recording = "recording",
        /// Strata of scenes, recorded once and shown to detector and tracker alone.
        OpenLoop = "open-loop",
        /// The same scenes, with a camera that is steered.
        ClosedLoop = "closed-loop",
    }
}

named! {
    /// What the pictures go through before the tracker sees them.
    Codec, "codec" {
        /// Motion JPEG.
        Mjpeg = "mjpeg",
        /// MPEG-4 part 2.
        Mpeg4 = "mpeg4",
        /// Nothing: as the camera or the recording has them.
        Raw = "raw",
        /// MPEG-4 part 2 at a low bit rate.
        Mpeg4Low = "mpeg4-low",
        /// H.264 at a usual bit rate.
        H264 = "h264",
        /// H.264 at a low bit rate.
        H264Low = "h264-low",
    }
}

named! {
    /// Who draws the first box.
    FirstBox, "first box" {
        /// As users have it: trackers with a detector find the person themselves; the others are given the box.
        Detected = "detected",
        /// Every tracker is given the true box of the first counted picture.
        Given = "given",
    }
}

/// How old things are when they arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Delays {
    /// From light on the sensor to the picture at the tracker.
    pub video: Duration,
    /// From a command's arrival to the first movement.
    pub command: Duration,
}

impl Delays {
    /// Both together.
    pub fn total(&self) -> Duration {
        self.video + self.command
    }
}

impl Default for Delays {
    fn default() -> Self {
        Self { video: Duration::from_millis(100), command: Duration::from_millis(60) }
    }
}

/// What the tracker said of one picture. Pixels, edges of pixels at whole numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// What it was doing. In any state but tracking and occluded the geometry says nothing.
    #[serde(with = "state_name")]
    pub state: TargetState,
    /// Mean of its features (thesis 3.15), or the middle of its box where it has none.
    pub centroid: (f64, f64),
    /// Its box.
    pub bounds: Bounds,
    /// Number of its target.
    pub id: u64,
    /// How many feature points it kept.
    pub features: usize,
}

impl Estimate {
    /// Whether its geometry says anything.
    pub fn has_place(&self) -> bool {
        matches!(self.state, TargetState::Tracking | TargetState::Occluded)
    }
}

/// What an estimate holds of somebody.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Number of the person.
    pub id: u32,
    /// Whether the centroid lies inside of their whole silhouette, hidden parts included: a hit.
    pub hit: bool,
    /// Part of their whole silhouette, 0 to 1, that lies in the box.
    pub covered: f64,
}

impl Coverage {
    /// What `estimate` holds of a person; `None` where it is nothing.
    pub fn of(estimate: &Estimate, person: &Sighting) -> Option<Self> {
        let (hit, covered) =
            (person.silhouette.contains(estimate.centroid), person.silhouette.part_in(&estimate.bounds));
        (hit || covered > 0.0).then_some(Self { id: person.truth.id, hit, covered })
    }
}

/// One counted picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Its exposure, in seconds since that of the first counted picture.
    pub time_s: f64,
    /// The person in this very picture; `None` where there is nobody, not even outside of the view.
    pub truth: Option<GroundTruth>,
    /// Everybody else in it.
    pub others: Vec<GroundTruth>,
    /// What the tracker said; `None` where it said nothing.
    pub estimate: Option<Estimate>,
    /// What the estimate holds of anybody, judged by their silhouettes; nothing where it holds no place at all.
    pub coverage: Vec<Coverage>,
    /// How well the best region of the detector fits the person's box (intersection over union); `None` where nobody heard the
    /// detector, or there is no person.
    #[serde(default)]
    pub best_region: Option<f64>,
    /// Width and height of the picture in pixels.
    pub size: (u32, u32),
    /// Focal length of the view, in pixels.
    pub focal_px: f64,
    /// Where the camera looked during the exposure, degrees, positive to the right.
    pub pan_deg: f64,
    /// Degrees, positive up.
    pub tilt_deg: f64,
    /// VAPIX zoom step.
    pub zoom: f64,
    /// Commands that the camera received since the previous picture.
    pub commands: u32,
}

impl FrameRecord {
    /// What the estimate holds of the person to be followed.
    pub fn on_target(&self) -> Option<&Coverage> {
        let id = self.truth.as_ref()?.id;
        self.coverage.iter().find(|coverage| coverage.id == id)
    }

    /// Takes what the tracker said of this picture, with `people` in it.
    pub(crate) fn judged(self, estimate: Option<Estimate>, people: &[Sighting]) -> Self {
        let placed = estimate.as_ref().filter(|estimate| estimate.has_place());
        let coverage =
            placed.map(|estimate| people.iter().filter_map(|one| Coverage::of(estimate, one)).collect());
        Self { coverage: coverage.unwrap_or_default(), estimate, ..self }
    }
}

named! {
    /// A telling moment of a run.
    Moment, "moment" {
        /// The tracker tracks something for the first time.
        Acquired = "acquired",
        /// It says for the first time that the target is hidden.
        Occluded = "occluded",
        /// A loss begins: see [`crate::metrics::Loss`].
        Lost = "lost",
        /// The target was never farther from the middle while its own middle was in the picture.
        Worst = "worst",
    }
}

/// A picture to look at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Why it is kept.
    pub moment: Moment,
    /// Index of its record in [`Run::frames`].
    pub frame: usize,
    /// Encoded anew as a JPEG, nothing drawn in: in virtual time from the picture before it went through the codec, else from
    /// the decoded one. So it is not what the tracker saw to the last bit.
    pub jpeg: Vec<u8>,
}

/// One test with one tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Which suite it is from.
    pub suite: Suite,
    /// Which of the 72 tests; `None` in any other suite.
    pub test: Option<TestId>,
    /// What was shown, in words for tables: `test 7`, or the recording's file name and person. Another in every test of a suite.
    pub title: String,
    /// Tests of the same path and seed are not independent of each other.
    pub path: String,
    /// What followed.
    pub tracker: TrackerName,
    /// What it was made with.
    pub provenance: Provenance,
    /// What the pictures went through.
    pub codec: Codec,
    /// Width and height of the pictures.
    pub size: (u32, u32),
    /// Number of the world.
    pub seed: u64,
    /// How late everything was.
    pub delays: Delays,
    /// Who drew the first box.
    pub first_box: FirstBox,
    /// Pictures a second.
    pub frame_rate: f64,
    /// The counted pictures.
    pub frames: Vec<FrameRecord>,
    /// Some of them to look at.
    pub snapshots: Vec<Snapshot>,
    /// When it failed, why; the pictures up to there are kept.
    pub error: Option<String>,
}

/// A state is kept by its name.
mod state_name {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use super::TargetState;

    const ALL: [TargetState; 4] =
        [TargetState::Searching, TargetState::Tracking, TargetState::Occluded, TargetState::Lost];

    pub fn serialize<S: Serializer>(state: &TargetState, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(state.name())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<TargetState, D::Error> {
        let name = String::deserialize(deserializer)?;
        let known = ALL.into_iter().find(|state| state.name() == name);
        known.ok_or_else(|| D::Error::custom(format!("there is no state `{name}`")))
    }
}
