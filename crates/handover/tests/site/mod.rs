// SPDX-License-Identifier: MPL-2.0

//! Two cameras above made-up ground, and who walks on it.
#![allow(dead_code, clippy::unwrap_used)]

use fastrand::Rng;
use handover::{Direction, Learned, Map, Pair, Place};
use nalgebra::{Rotation3, Vector3};

pub type Vector = Vector3<f64>;

/// Metres: right, down, forward.
pub fn at(x: f64, height: f64, z: f64) -> Vector {
    Vector::new(x, -height, z)
}

/// A camera that does not turn, and one that does.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    pub fixed: Vector,
    /// To where the fixed one is turned: degrees right and down.
    pub turned: (f64, f64),
    pub ptz: Vector,
    /// How high the ground is.
    pub ground: fn(f64, f64) -> f64,
}

pub const PLANE: fn(f64, f64) -> f64 = |_, _| 0.0;
/// A step of one metre.
pub const STEP: fn(f64, f64) -> f64 = |x, _| if x > 0.0 { 1.0 } else { 0.0 };

/// At right angles, some ten metres from each other: nothing is in the same place for both.
pub fn site(ground: fn(f64, f64) -> f64) -> Site {
    Site { fixed: at(-8.0, 3.5, 8.0), turned: (90.0, 20.0), ptz: at(0.0, 2.5, 0.0), ground }
}

impl Site {
    /// Where the fixed camera sees a point; `None` outside of its picture, 70° wide.
    pub fn place(&self, point: Vector) -> Option<(f64, f64)> {
        let (right, down) = self.turned;
        let turn = Rotation3::from_euler_angles(-down.to_radians(), right.to_radians(), 0.0);
        let seen = turn.inverse() * (point - self.fixed);
        let half = 35f64.to_radians().tan();
        let (x, y) = (seen.x / seen.z / half, seen.y / seen.z / half / 0.75);
        (seen.z > 0.5 && x.abs() < 1.0 && y.abs() < 1.0).then_some((0.5 + x / 2.0, 0.5 + y / 2.0))
    }

    pub fn direction(&self, point: Vector) -> Direction {
        let seen = point - self.ptz;
        let tilt = (-seen.y).atan2(seen.x.hypot(seen.z));
        Direction { pan_deg: seen.x.atan2(seen.z).to_degrees(), tilt_deg: tilt.to_degrees() }
    }

    /// Feet and head of somebody.
    pub fn person(&self, (x, z): (f64, f64), height: f64) -> (Vector, Vector) {
        let ground = (self.ground)(x, z);
        (at(x, ground, z), at(x, ground + height, z))
    }

    pub fn pair(&self, place: (f64, f64), person: u64, rng: &mut Rng) -> Option<Pair> {
        let (feet, head) = self.person(place, 1.6 + 0.3 * (person as f64 * 0.618).fract());
        let (x, y) = self.place(feet)?;
        let (below, above) = (self.direction(feet), self.direction(head));
        let mut noise = |size: f64| size * ((0..12).map(|_| rng.f64()).sum::<f64>() - 6.0);
        Some(Pair {
            place: Place::in_picture(x + noise(0.006), y + noise(0.012)),
            direction: Direction {
                pan_deg: below.pan_deg + noise(0.7),
                tilt_deg: below.tilt_deg + noise(0.5),
            },
            height_deg: Some((above.tilt_deg - below.tilt_deg) * (1.0 + noise(0.05))),
            person,
        })
    }
}

/// Somebody who walks about before both cameras, from one place to another at 1.3 m/s; five pairs a second.
pub struct Walk {
    rng: Rng,
    pub place: (f64, f64),
    goal: (f64, f64),
}

impl Walk {
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng::with_seed(seed);
        let (place, goal) = (somewhere(&mut rng), somewhere(&mut rng));
        Self { rng, place, goal }
    }

    pub fn step(&mut self) -> (f64, f64) {
        let (x, z) = (self.goal.0 - self.place.0, self.goal.1 - self.place.1);
        let (left, step) = (x.hypot(z), 0.26);
        if left < step {
            self.goal = somewhere(&mut self.rng);
        } else {
            self.place = (self.place.0 + x / left * step, self.place.1 + z / left * step);
        }
        self.place
    }
}

pub fn somewhere(rng: &mut Rng) -> (f64, f64) {
    (rng.f64() * 9.0 - 4.0, 4.0 + rng.f64() * 8.0)
}

/// Has a map learn for so many seconds, one person after the other for 20 s each; the pairs of so many in a hundred are of somebody
/// else's feet.
pub fn learn(map: &mut Map, site: &Site, seconds: u32, wrong: f64, seed: u64) -> Vec<Learned> {
    let mut rng = Rng::with_seed(seed + 1000);
    let (mut walk, mut other) = (Walk::new(seed), Walk::new(seed + 500));
    let mut confused = false;
    let steps = (0..seconds * 5).filter_map(|n| {
        if n % 5 == 0 {
            confused = rng.f64() < wrong;
        }
        let person = 1 + u64::from(n / 100) + 1000 * seed;
        let pair = site.pair(walk.step(), person, &mut rng);
        let stranger = site.pair(other.step(), person, &mut rng);
        Some(if confused { Pair { place: stranger?.place, ..pair? } } else { pair? })
    });
    steps.map(|pair| map.learn(pair)).collect()
}

/// Degrees by which the map is off on the ground that both see: median, and the worst of 20.
pub fn errors(map: &Map, site: &Site) -> (f64, f64) {
    let mut errors = Vec::new();
    for place in (0..400).map(|n| (f64::from(n % 20) * 0.45 - 4.0, 4.0 + f64::from(n / 20) * 0.4)) {
        let (feet, _) = site.person(place, 1.75);
        if let Some((x, y)) = site.place(feet) {
            let aim = map.aim(Place::in_picture(x, y)).unwrap();
            errors.push(aim.feet.angle_to_deg(site.direction(feet)));
        }
    }
    errors.sort_by(f64::total_cmp);
    assert!(errors.len() > 100, "the fixed camera sees too little");
    (errors[errors.len() / 2], errors[errors.len() * 19 / 20])
}

pub fn error_of(site: &Site, seconds: u32, wrong: f64, seed: u64) -> (f64, f64) {
    let mut map = Map::default();
    learn(&mut map, site, seconds, wrong, seed);
    errors(&map, site)
}
