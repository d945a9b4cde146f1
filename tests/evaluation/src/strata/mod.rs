// SPDX-License-Identifier: MPL-2.0

//! Scenes by stratum, seed and number: each a world of its own, drawn by chance from what the stratum is about. Ten seconds
//! each, so that a comparison has many of them. How a scene comes about is told in `docs/scenes.md`.

mod builders;
mod draft;
mod endpoints;
mod faults;
pub mod options;
pub mod stages;
pub mod table;

use std::fmt;

use virtual_camera::Seeded;

use self::draft::Draft;
pub use self::{endpoints::Endpoints, table::SceneRun};
use crate::{
    experiment::Experiment,
    record::{Suite, TrackerName, named},
};

/// How many scenes each stratum has of a seed.
pub const NUMBERS: u32 = 3;

named! {
    /// What a scene is about.
    Stratum, "stratum" {
        /// One person whom nothing hides.
        Alone = "alone",
        /// One person who is hidden for a while, in part or wholly.
        Hidden = "hidden",
        /// Two who pass each other, or one who overtakes another.
        Crossing = "crossing",
        /// Two in different clothes who walk side by side and part.
        Parting = "parting",
        /// Three to eight who walk together, or one among others who wander about.
        Groups = "groups",
        /// Little light, or clothes like the wall.
        Dark = "dark",
        /// Nobody: whatever is followed is wrong.
        Nobody = "nobody",
        /// One person far away in a yard, 20 to 40 pixels high.
        Far = "far",
        /// One person who comes so near that they fill the picture.
        Near = "near",
        /// One person in a yard: wind, clouds' shadows, rain, headlights, street lamps, infrared light.
        Outdoors = "outdoors",
        /// A car to be followed, or one person while cars drive by.
        Vehicles = "vehicles",
        /// One person who is in view from the start, before a camera that turns from the start.
        Turning = "turning",
        /// One person who is hardly to be told from the wall (3 to 5 grey levels), in the noise of little light.
        Faint = "faint",
        /// One person who holds their hands into the view for a while before they walk in, where other things move too.
        Reaching = "reaching",
        /// One person before a camera with a fault, or one that is late, slow or not as told.
        Faults = "faults",
        /// One person who is little lighter or darker than the wall (6 to 12 grey levels), in the noise of little light.
        Pale = "pale",
        /// One person among six who wander about, in other clothes.
        Crowd = "crowd",
        /// The same, all in the same clothes.
        CrowdAlike = "crowd-alike",
        /// Two in the same clothes who walk side by side and part.
        PartingAlike = "parting-alike",
        /// One person on a floor that reflects them.
        Reflecting = "reflecting",
    }
}

impl Stratum {
    fn builder(self) -> fn(&mut Draft, &mut Seeded) {
        match self {
            Self::Alone => builders::alone,
            Self::Hidden => builders::hidden,
            Self::Crossing => builders::crossing,
            Self::Parting => builders::parting,
            Self::Groups => builders::groups,
            Self::Dark => builders::dark,
            Self::Nobody => builders::nobody,
            Self::Far => builders::far,
            Self::Near => builders::near,
            Self::Outdoors => builders::outdoors,
            Self::Vehicles => builders::vehicles,
            Self::Turning => builders::turning,
            Self::Faint => builders::faint,
            Self::Reaching => builders::reaching,
            Self::Faults => faults::faults,
            Self::Pale => builders::pale,
            Self::Crowd => builders::crowd,
            Self::CrowdAlike => builders::crowd_alike,
            Self::PartingAlike => builders::parting_alike,
            Self::Reflecting => builders::reflecting,
        }
    }
}

/// Which scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SceneId {
    /// What it is about.
    pub stratum: Stratum,
    /// 1 to 10 may be tuned on, 11 to 20 are held out: run once at the end, and never looked into.
    pub seed: u64,
    /// From 1.
    pub number: u32,
}

impl fmt::Display for SceneId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}-{}", self.stratum, self.seed, self.number)
    }
}

impl SceneId {
    /// The scene, with `tracker` in it.
    pub fn experiment(self, suite: Suite, tracker: TrackerName) -> Experiment {
        let mut chance = Seeded::new(self.seed).fork(u64::from(self.number)).fork(self.stratum as u64);
        let mut draft = Draft::new(&mut chance);
        self.stratum.builder()(&mut draft, &mut chance);
        draft.experiment(self, suite, tracker)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use virtual_camera::{Clock, Pose};

    use super::*;
    use crate::experiment::{Place, Target, exposure};

    fn setups(seed: u64) -> Vec<String> {
        let scenes = Stratum::ALL
            .iter()
            .flat_map(|&stratum| (1..=NUMBERS).map(move |number| SceneId { stratum, seed, number }));
        let experiments = scenes.map(|id| id.experiment(Suite::OpenLoop, TrackerName::Ptztrack));
        experiments.map(|one| format!("{:?} {:?}", one.scene.place, one.codec)).collect()
    }

    #[test]
    fn every_scene_is_a_world_of_its_own_and_always_the_same() {
        let (first, second) = (setups(1), setups(2));
        assert_eq!(first, setups(1));
        let worlds: BTreeSet<_> = first.iter().chain(&second).collect();
        assert_eq!(worlds.len(), 2 * Stratum::ALL.len() * NUMBERS as usize);
    }

    #[test]
    fn all_last_ten_seconds_and_somebody_is_to_be_followed_in_all_but_one() {
        for &stratum in Stratum::ALL {
            let one =
                SceneId { stratum, seed: 3, number: 2 }.experiment(Suite::OpenLoop, TrackerName::Ptztrack);
            assert_eq!((one.scene.duration - one.scene.begin).as_secs(), 10, "{stratum}");
            assert_eq!(one.scene.target == Target::Nobody, stratum == Stratum::Nobody);
        }
    }

    #[test]
    fn who_is_near_is_higher_than_the_picture_for_a_good_part_of_the_time() {
        for (seed, number) in [(1, 1), (2, 3), (5, 2)] {
            let id = SceneId { stratum: Stratum::Near, seed, number };
            let one = id.experiment(Suite::OpenLoop, TrackerName::Ptztrack);
            let Place::Camera(settings) = &one.scene.place else { panic!("no camera in {id}") };
            let camera = one.camera(settings, Clock::Stepped).unwrap();
            let (period, home) = (camera.frame_period(), camera.home());
            let fills = |number: &u32| {
                let from = |pose: &Pose| {
                    camera.ground_truth_from(pose, exposure(*number, period), one.size).remove(0)
                };
                let (pan_deg, tilt_deg) = from(&home).direction_deg.unwrap();
                from(&Pose { pan_deg, tilt_deg, ..home }).bounds.height >= f64::from(one.size.1)
            };
            let numbers: Vec<u32> = one.pictures(period).collect();
            let share = numbers.iter().filter(|one| fills(one)).count() as f64 / numbers.len() as f64;
            assert!(share > 0.25, "{id}: {share}");
        }
    }
}
