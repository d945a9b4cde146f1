// SPDX-License-Identifier: MPL-2.0

//! A camera `yard` that does not turn and others that do, for tests: all look out of the same place.

use std::sync::Arc;
use std::time::{Duration, Instant};

use handover::{Direction, Map, Pair, Place};
use ptztrack_contract::Point;
use ptztrack_contract::lock::lock;

use super::link::Link;
use super::view::{View, direction};
use crate::camera::{Known, Person, Pose, Sight};
use crate::config::HandOver;

/// Where somebody walks, and how fast, to the right.
pub const FEET: [f64; 2] = [0.4, 0.7];
pub const RATE: f64 = 0.2;

fn pose() -> Pose {
    let age = Duration::ZERO;
    Pose { age, pan_deg: 0.0, tilt_deg: -10.0, horizontal_fov_deg: 60.0, vertical_fov_deg: 46.0 }
}

/// Both look out of the same place, the one that turns to where the other one looks.
pub fn link() -> Link {
    let view = pose().view().unwrap();
    let mut map = Map::default();
    for n in 0..100 {
        let (x, y) = (f64::from(n % 10) / 10.0, 0.5 + f64::from(n / 10) / 20.0);
        let direction = direction(&view, Point { x, y });
        map.learn(Pair { place: Place::in_picture(x, y), direction, height_deg: Some(15.0), person: 1 });
    }
    Link::new(map)
}

/// Of two that turn, while somebody has come only a few steps.
pub fn new_turning_link() -> Link {
    let mut map = Map::default();
    for n in 0..10 {
        let direction = Direction { pan_deg: f64::from(n) * 0.5 - 2.5, tilt_deg: -20.0 };
        map.learn(Pair { place: Place::towards(direction), direction, height_deg: Some(9.0), person: 1 });
    }
    Link::new(map)
}

/// Of two that turn.
pub fn turning_link() -> Link {
    let mut map = Map::default();
    for n in 0..150 {
        let (pan_deg, tilt_deg) = (f64::from(n % 15) * 4.0 - 28.0, f64::from(n / 15) * 2.4 - 26.0);
        let direction = Direction { pan_deg, tilt_deg };
        map.learn(Pair { place: Place::towards(direction), direction, height_deg: Some(9.0), person: 1 });
    }
    Link::new(map)
}

pub fn person(id: u64, [x, y]: [f64; 2], rate: f64) -> Person {
    let bounds = [x - 0.04, y - 0.3, 0.08, 0.3];
    Person { id, bounds, velocity: [rate, 0.0], seen: true, confidence: 1.0, is_target: false }
}

pub fn view(name: &str, turns: bool, came: Instant, people: Vec<Person>) -> View {
    let poses = if turns { vec![pose()] } else { Vec::new() };
    let known = Arc::new(Known::new(name));
    lock(&known.state).picture = true;
    View {
        is_here: true,
        can_be_called: true,
        errand: None,
        known,
        seen: Arc::new((came, Sight { people, poses, ..Sight::default() })),
        turns,
        video: Duration::ZERO,
        widest_fov_deg: Some(60.0),
        target_height: None,
    }
}

pub fn target(person: Person) -> Person {
    Person { is_target: true, ..person }
}

/// `yard` calls these.
pub fn wish(calls: &[&str]) -> HandOver {
    HandOver {
        from: "yard".to_owned(),
        calls: calls.iter().map(|&name| name.to_owned()).collect(),
        zones: Vec::new(),
        precedence: 0,
        together: false,
    }
}
