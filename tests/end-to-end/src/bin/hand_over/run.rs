// SPDX-License-Identifier: MPL-2.0

use std::fmt;
use std::fs;
use std::path::Path;
use std::thread;
use std::time::Duration;

use end_to_end::{Program, scene, scratch};
use handover::Map;
use virtual_camera::{Action, Auth, GroundTruth, Pose, RoomSettings, Settings, Video, VirtualCamera, World};

use crate::{Options, errors, film};

/// To the right of the other one, seven metres from it, and turned left towards the floor that people walk on.
const STAND: [f64; 3] = [6.2, 3.2, 0.4];
const LOOKS: Pose = Pose { pan_deg: -38.0, tilt_deg: -20.0, zoom_step: 1.0 };
const SIZE: (u32, u32) = (640, 480);
const RATE: f64 = 12.5;
/// Between two looks at what is true.
pub const LOOK: Duration = Duration::from_millis(40);
/// So long after somebody came in it is seen whom the camera follows.
const JUDGED_AFTER: Duration = Duration::from_secs(10);
/// Seconds for which the map is looked at.
const LEARNED: [u64; 5] = [10, 20, 30, 40, 60];
/// Number of who comes in second.
const SECOND: u32 = 2;

/// What became of one room.
pub struct Outcome {
    seed: u64,
    /// Degrees by which the map was off after so many seconds.
    errors: Vec<Option<f64>>,
    /// Seconds from when the second person was first seen by the fixed camera until they were in the middle half.
    seconds: Option<f64>,
    pub right: bool,
}

impl Outcome {
    pub const HEAD: &str =
        "seed,error after 10 s,20 s,30 s,40 s,60 s,seconds until in the middle half,right person";

    pub fn is_soon(&self) -> bool {
        self.seconds.is_some_and(|seconds| seconds <= 3.0)
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |number: Option<f64>| number.map_or(String::new(), |number| format!("{number:.2}"));
        let errors: Vec<String> = self.errors.iter().copied().map(number).collect();
        write!(f, "{},{},{},{}", self.seed, errors.join(","), number(self.seconds), self.right)
    }
}

/// The camera beside the other one, or that one.
pub fn camera(seed: u64, action: Action, others: usize, aside: bool) -> VirtualCamera {
    let stand = aside.then_some(STAND);
    let room = RoomSettings { seed, action, others, stand, ..RoomSettings::default() };
    let settings = Settings {
        user: scene::USER.into(),
        password: scene::PASSWORD.into(),
        auth: Auth::Digest { qop: true },
        home: stand.map(|_| LOOKS),
        world: World::Room(room),
        video: Video { size: Some(SIZE), frame_rate: Some(RATE), ..Video::default() },
        ..Settings::default()
    };
    VirtualCamera::start(settings).unwrap()
}

/// Plays one room; what the program says goes where the runs go.
pub fn run(seed: u64, Options { others, film, out, .. }: &Options) -> Outcome {
    let state = scratch(&format!("handover-{seed}"));
    fs::create_dir_all(&state).unwrap();
    let [yard, door] = [true, false].map(|aside| camera(seed, Action::Relay, *others, aside));
    let file = |folder: &Path| {
        let password = folder.join("password");
        let entry = |name: &str, camera: &VirtualCamera| {
            Program::entry(name, &camera.url(), &password).replace("320x240", "640x480")
        };
        let yard = entry("yard", &yard) + "kind = \"fixed\"\n";
        let door = entry("door", &door) + "[camera.door.vapixptzsink]\npan-min = -35.0\npan-max = 35.0\n";
        format!("{yard}{door}[handover.yard]\ncalls = [\"door\"]\n")
    };
    let environment = [("STATE_DIRECTORY", state.as_path())];
    let program = Program::start_in(&format!("handover-{seed}"), file, &[], &environment);
    let errors = LEARNED.map(|seconds| {
        wait_until(&door, Duration::from_secs(seconds + 2));
        let map = fs::read_to_string(state.join("map.yard.door.json")).ok();
        map.and_then(|map| errors::median_deg(&Map::from_json(&map).ok()?, STAND, &LOOKS))
    });
    let pictures = film.then(|| out.join(seed.to_string()));
    let (seconds, right) = film::shoot(&program, &door, pictures, || watch(&yard, &door));
    let (_, said) = program.end_somehow("TERM");
    fs::write(out.join(format!("{seed}.log")), said).unwrap();
    fs::remove_dir_all(&state).unwrap();
    Outcome { seed, errors: errors.to_vec(), seconds, right }
}

pub fn wait_until(camera: &VirtualCamera, time: Duration) {
    thread::sleep(time.saturating_sub(camera.now()));
}

/// How long it takes until the second person is in the middle half, and whether they are there in the end.
fn watch(yard: &VirtualCamera, door: &VirtualCamera) -> (Option<f64>, bool) {
    let began = loop {
        thread::sleep(LOOK);
        if second(yard).is_some_and(|person| person.in_view > 0.5) {
            break yard.now();
        }
    };
    let (mut seconds, mut middle) = (None, false);
    while yard.now() < began + JUDGED_AFTER {
        thread::sleep(LOOK);
        middle = second(door).is_some_and(|person| is_in_middle_half(&person));
        if middle {
            seconds.get_or_insert((yard.now() - began).as_secs_f64());
        }
    }
    (seconds, middle)
}

fn second(camera: &VirtualCamera) -> Option<GroundTruth> {
    people(camera).into_iter().find(|person| person.id == SECOND)
}

/// Everybody as the camera sees them now.
pub fn people(camera: &VirtualCamera) -> Vec<GroundTruth> {
    let pose = camera.status();
    let pose = Pose { pan_deg: pose.pan_deg, tilt_deg: pose.tilt_deg, zoom_step: pose.zoom_step };
    camera.ground_truth_from(&pose, camera.now(), SIZE)
}

pub fn is_in_middle_half(person: &GroundTruth) -> bool {
    let (x, y) = person.centroid;
    let middle = |place: f64, size: u32| (0.25..=0.75).contains(&(place / f64::from(size)));
    middle(x, SIZE.0) && middle(y, SIZE.1)
}
