// SPDX-License-Identifier: MPL-2.0

//! `--suite hard`: what makes following hard in reality, one thing a test. Every test is settings of camera and room that
//! `virtual-camera` takes on its command line too.

use std::time::Duration;

use virtual_camera::{Action, Event, RoomSettings, Settings, SpeedMap, Stall, World};

use crate::{
    experiment::{Experiment, Place, Scene, Target},
    record::{Codec, Delays, Suite, TrackerName},
};

/// Where nobody comes for ten minutes, pictures are fewer (a second) and smaller than usual: all would take half an hour.
const EMPTY_RATE: f64 = 10.0;
const EMPTY_SIZE: (u32, u32) = (320, 240);
/// Pictures a second of three minutes' wandering.
const WANDER_RATE: f64 = 12.5;
/// The field of view of a camera that is zoomed in, in degrees.
const NARROW_DEG: f64 = 12.0;
/// The room's widest field of view in degrees, and its magnification at zoom step 9999.
const WIDE_DEG: f64 = 55.0;
const MAGNIFICATION: f64 = 19.885;

/// How a test is made of one in which a person walks across the room and back.
type Change = fn(&mut Trial);

/// A test before it is run.
struct Trial {
    room: RoomSettings,
    camera: Settings,
    codec: Codec,
    size: (u32, u32),
    delays: Delays,
    servo: &'static str,
}

/// Every test by its title, which names the thing that is hard.
const TESTS: [(&str, Change); 38] = [
    ("two cross, other clothes", |trial| trial.room.action = Action::Cross),
    ("two cross, same clothes", |trial| trial.room.action = Action::CrossAlike),
    ("two side by side part", |trial| trial.room.action = Action::Part),
    ("one overtakes", |trial| trial.room.action = Action::Overtake),
    ("nobody: door, draught", |trial| trial.empty(&[Event::Door, Event::Draught])),
    ("nobody: film, sun", |trial| trial.empty(&[Event::Film, Event::Sun])),
    ("nobody: all of it, light switched", |trial| trial.empty(&Event::ALL.map(|(event, _)| event))),
    ("stop and go", |trial| trial.room.action = Action::StopAndGo),
    ("sit down and rise", |trial| trial.room.action = Action::Sit),
    ("towards the camera and away", |trial| trial.room.action = Action::Approach),
    ("run at 4 m/s", |trial| trial.room.action = Action::Run),
    ("wander for 3 min", |trial| {
        trial.room.action = Action::Wander;
        trial.camera.video.frame_rate = Some(WANDER_RATE);
    }),
    ("zoomed in to 12 degrees", |trial| {
        let mut home = trial.room.home();
        let tangent = |degrees: f64| (degrees / 2.0).to_radians().tan();
        let share = (tangent(WIDE_DEG) / tangent(NARROW_DEG) - 1.0) / (MAGNIFICATION - 1.0);
        home.zoom_step = 1.0 + share * 9998.0;
        trial.camera.home = Some(home);
    }),
    ("auto-zoom", |trial| trial.servo = "auto-zoom=true"),
    ("video 350 ms late", |trial| trial.delays.video = Duration::from_millis(350)),
    ("video 100 to 350 ms late", |trial| trial.camera.video.jitter = Duration::from_millis(250)),
    ("video stalls for 600 ms", |trial| {
        let stall = Stall { every: Duration::from_secs(5), lasts: Duration::from_millis(600) };
        trial.camera.video.stall = Some(stall);
    }),
    ("commands 5 to 250 ms late", |trial| {
        trial.delays.command = Duration::from_millis(5);
        trial.camera.kinematics.command_jitter = Duration::from_millis(245);
    }),
    ("speeds 20 % lower", |trial| trial.speed(0.8)),
    ("speeds 20 % higher", |trial| trial.speed(1.2)),
    ("acceleration 100 deg/s2", |trial| trial.camera.kinematics.acceleration_deg_s2 = 100.0),
    ("acceleration 800 deg/s2", |trial| trial.camera.kinematics.acceleration_deg_s2 = 800.0),
    ("backlash 0.3 degrees", |trial| trial.camera.kinematics.backlash_deg = 0.3),
    ("exposure, balance, focus hunt", |trial| trial.camera.imaging.hunting = 1.0),
    ("day to night every 4 s", |trial| trial.camera.imaging.night = Some(Duration::from_secs(4))),
    ("clock and logo burned in", |trial| trial.camera.imaging.overlay = true),
    ("H.264 at 250 kbit/s", |trial| trial.codec = Codec::H264Low),
    ("MPEG-4 at 250 kbit/s", |trial| trial.codec = Codec::Mpeg4Low),
    ("10 pictures a second", |trial| trial.camera.video.frame_rate = Some(10.0)),
    ("15 pictures a second", |trial| trial.camera.video.frame_rate = Some(15.0)),
    ("mast sways by 0.15 degrees", |trial| trial.camera.imaging.vibration_deg = 0.15),
    ("cast shadows", |trial| trial.room.shadows = true),
    ("reflecting floor", |trial| trial.room.reflections = true),
    ("noise filter smears", |trial| trial.camera.imaging.noise_filter = 0.8),
    ("door and draught besides", |trial| trial.room.events = vec![Event::Door, Event::Draught]),
    ("film and sun besides", |trial| trial.room.events = vec![Event::Film, Event::Sun]),
    ("10 pictures a second, late by 350 ms", |trial| {
        trial.camera.video.frame_rate = Some(10.0);
        trial.delays.video = Duration::from_millis(350);
    }),
    ("nothing hard", |_| {}),
];

impl Trial {
    /// A person of a kind that depends on the seed walks across the room and back.
    fn new(seed: u64) -> Self {
        let number = 37 + (seed % 3) as u32;
        let room = RoomSettings::test(number, seed).unwrap_or_default();
        Self {
            room,
            camera: Settings::default(),
            codec: Codec::Mjpeg,
            size: (640, 480),
            delays: Delays::default(),
            servo: "",
        }
    }

    fn empty(&mut self, events: &[Event]) {
        (self.room.action, self.room.events) = (Action::Nobody, events.to_vec());
        (self.size, self.camera.video.frame_rate) = (EMPTY_SIZE, Some(EMPTY_RATE));
    }

    /// Lets the camera turn by so much of the speed that the servo expects.
    fn speed(&mut self, factor: f64) {
        let map = SpeedMap::Cubic { max_deg_s: 450.0 * factor, floor_deg_s: 0.05 * factor };
        self.camera.kinematics.speed_map = map;
    }

    fn experiment(self, title: &str, tracker: TrackerName, seed: u64) -> Experiment {
        let target = match self.room.action {
            Action::Nobody => Target::Nobody,
            _ => Target::Person(1),
        };
        let scene = Scene {
            suite: Suite::Hard,
            test: None,
            title: title.into(),
            path: title.into(),
            duration: self.room.duration(),
            begin: Duration::ZERO,
            lead: Duration::ZERO,
            place: Place::Camera(Box::new(Settings {
                world: World::Room(self.room.clone()),
                ..self.camera.clone()
            })),
            target,
        };
        let (codec, size, delays, servo) = (self.codec, self.size, self.delays, self.servo);
        Experiment { codec, size, delays, servo: servo.into(), ..Experiment::new(scene, tracker, seed) }
    }
}

/// All tests in the rooms of a seed, in the order of their numbers from 1; `like` says what else is as asked for.
pub fn experiments(tracker: TrackerName, seed: u64, like: &Experiment) -> Vec<Experiment> {
    let test = |(title, change): (&str, Change)| {
        let mut trial = Trial::new(seed);
        change(&mut trial);
        let experiment = trial.experiment(title, tracker, seed);
        Experiment { first_box: like.first_box, films: like.films.clone(), ..experiment }
    };
    TESTS.into_iter().map(test).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_test_is_another_and_always_the_same() {
        let like = Trial::new(1).experiment("", TrackerName::Still, 1);
        let all = experiments(TrackerName::Ptztrack, 2, &like);
        let titles: BTreeSet<_> = all.iter().map(|one| one.scene.title.clone()).collect();
        assert_eq!(titles.len(), TESTS.len());
        let setup = |one: &Experiment| {
            let Place::Camera(camera) = &one.scene.place else { panic!("no camera") };
            let settings = format!("{camera:?} {:?} {:?}", camera.home, camera.imaging);
            format!("{settings} {:?} {:?} {}", one.codec, one.delays, one.servo)
        };
        assert_eq!(all.iter().map(setup).collect::<BTreeSet<_>>().len(), TESTS.len());
        let again = experiments(TrackerName::Ptztrack, 2, &like);
        assert!(all.iter().zip(&again).all(|(one, other)| setup(one) == setup(other)));
        let empty = all.iter().filter(|one| one.scene.target == Target::Nobody);
        assert_eq!(empty.map(|one| one.scene.duration.as_secs()).sum::<u64>(), 1800);
    }
}
