// SPDX-License-Identifier: MPL-2.0

//! Both cameras turn: one person walks about for a minute, then there are two.

use std::path::Path;
use std::time::Duration;
use std::{fmt, fs, thread};

use end_to_end::{Program, scratch};
use virtual_camera::{Action, VirtualCamera};

use crate::run::{LOOK, camera, is_in_middle_half, people, wait_until};
use crate::{Options, film};

/// While there is one person, who is followed is looked at for so long, from then on: what was learned by then counts.
const ALONE: (Duration, Duration) = (Duration::from_secs(45), Duration::from_secs(60));
/// While there are two: the second one has been in for some seconds.
const TWO: (Duration, Duration) = (Duration::from_secs(78), Duration::from_secs(118));

/// What became of one room.
pub struct Outcome {
    seed: u64,
    /// Part of the time in which both cameras followed somebody, while there was one person.
    pub both: f64,
    /// Part of the time in which one camera had the one and the other one the other person in the middle half, while there were two.
    pub each: f64,
}

impl Outcome {
    pub const HEAD: &str = "seed,both follow one person,each follows one of two";
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{:.3},{:.3}", self.seed, self.both, self.each)
    }
}

/// Plays one room; what the program says goes where the runs go.
pub fn run(seed: u64, options: &Options) -> Outcome {
    let state = scratch(&format!("handover-{seed}"));
    fs::create_dir_all(&state).unwrap();
    let [yard, door] = [true, false].map(|aside| camera(seed, Action::Join, options.others, aside));
    let file = |folder: &Path| {
        let password = folder.join("password");
        let entry = |name: &str, camera: &VirtualCamera| {
            Program::entry(name, &camera.url(), &password).replace("320x240", "640x480")
        };
        let calls = |from: &str, to: &str| {
            format!("[handover.{from}]\ncalls = [\"{to}\"]\ntogether = {}\n", options.together)
        };
        entry("yard", &yard) + &entry("door", &door) + &calls("yard", "door") + &calls("door", "yard")
    };
    let environment = [("STATE_DIRECTORY", state.as_path())];
    let program = Program::start_in(&format!("handover-{seed}"), file, &[], &environment);
    let pictures = options.film.then(|| options.out.join(seed.to_string()));
    let (both, each) = film::shoot(&program, &door, pictures, || {
        wait_until(&door, ALONE.0);
        let both = share_until(&door, ALONE.1, || both_follow(&program));
        wait_until(&door, TWO.0);
        (both, share_until(&door, TWO.1, || each_has_one(&yard, &door)))
    });
    let (_, said) = program.end_somehow("TERM");
    fs::write(options.out.join(format!("{seed}.log")), said).unwrap();
    fs::remove_dir_all(&state).unwrap();
    Outcome { seed, both, each }
}

/// In which part of the looks until then this is so.
fn share_until(clock: &VirtualCamera, time: Duration, mut is_so: impl FnMut() -> bool) -> f64 {
    let (mut looks, mut so) = (0u32, 0u32);
    while clock.now() < time {
        (looks, so) = (looks + 1, so + u32::from(is_so()));
        thread::sleep(LOOK);
    }
    f64::from(so) / f64::from(looks.max(1))
}

/// Both say that they follow somebody.
fn both_follow(program: &Program) -> bool {
    let (_, cameras) = program.ask("GET", "/cameras");
    !cameras.contains("\"target\":null")
}

fn each_has_one(yard: &VirtualCamera, door: &VirtualCamera) -> bool {
    let has = |camera: &VirtualCamera, id: u32| {
        people(camera).iter().any(|person| person.id == id && is_in_middle_half(person))
    };
    has(yard, 1) && has(door, 2) || has(yard, 2) && has(door, 1)
}
