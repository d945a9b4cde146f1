// SPDX-License-Identifier: MPL-2.0

//! Where the person is when: along a lane of the floor, at what speed, facing where.
//!
//! Metres, x to the right, z ahead at pan 0, from below the lens.

use super::{
    place::{Lane, PhotoPlace},
    settings::PhotoSettings,
};
use crate::{
    geometry,
    kinematics::Pose,
    seeded::Seeded,
    world::{Change, room::walker as room},
};

/// How tall the person is, in metres.
pub(super) const HEIGHT: f64 = 1.75;
/// Half of the width that they take with swinging arms, in metres.
pub(super) const HALF_WIDTH: f64 = 0.42;
/// Metres per second: ordinary, and once each where the speed varies.
const SPEED: f64 = 1.1;
const FAST: f64 = 1.6;
const SLOW: f64 = 0.7;
/// Metres per second squared: of a change of pace, and of turning round.
const GENTLE: f64 = 1.5;
const BRISK: f64 = 2.2;
/// A lane goes on for so many metres beyond where somebody turns.
const LEFT: f64 = 0.45;
/// Where somebody who does not walk to the end of a lane turns, as a part of it: there, and on the way back.
const TURNS: [(f64, f64); 2] = [(0.65, 0.85), (0.15, 0.35)];
/// For how many seconds somebody walks to and fro: long enough to be lost and found again.
const WALK: f64 = 10.0;
/// A way takes one of so many of the longest lanes.
const LONGEST: usize = 3;
/// When the person sets off, in seconds.
const DEPARTURE: f64 = 1.6;
/// Metres walked on the way round when somebody turns on their heel, a second.
const TURNING: f64 = 0.5;
/// How far somebody may face away from the camera: nobody was filmed from behind.
const SIDEWAYS_DEG: f64 = 112.0;
/// Who may show their back looks so far ahead, in seconds, and turns by so many radians a second.
const AHEAD: f64 = 0.35;
const TURN: f64 = 4.5;
/// Steps of the tables: points a lane, and moments a second.
const POINTS: usize = 400;
const RATE: f64 = 100.0;

/// The person at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moment {
    pub x: f64,
    pub z: f64,
    /// Which way they face, seen from the camera, in degrees: 0 towards it, 90 to the right of the picture.
    pub heading_deg: f64,
    /// Metres that their feet have walked.
    pub walked: f64,
}

impl Moment {
    /// Degrees to the right of the picture's middle column.
    pub fn yaw_deg(&self) -> f64 {
        self.x.atan2(self.z).to_degrees()
    }

    /// How far away on the floor.
    pub fn away(&self) -> f64 {
        self.x.hypot(self.z)
    }
}

/// The way of a test.
#[derive(Debug, Clone)]
pub(super) struct Way {
    moments: Vec<Moment>,
    eye: f64,
    fov_deg: f64,
    above_deg: f64,
    repeats: bool,
}

impl Way {
    pub fn new(settings: &PhotoSettings) -> Self {
        let mut chance = Seeded::new(settings.seed).fork(0x9407).fork(u64::from(settings.way));
        let place = &settings.place;
        let track = Track::choose(place, &mut chance);
        let moments = track.walked(settings.speed, settings.direction, &mut chance);
        let above_deg = chance.range(-4.0, 4.0);
        Self { moments, eye: place.eye_m, fov_deg: place.fov_deg, above_deg, repeats: settings.repeats }
    }

    /// When it is over, in seconds.
    pub fn duration(&self) -> f64 {
        DEPARTURE + (self.moments.len() - 1) as f64 / RATE
    }

    /// The person at a time in seconds; before the first and after the last moment they stand still.
    pub fn at(&self, time: f64) -> Moment {
        let time = if self.repeats { time.rem_euclid(self.duration()) } else { time };
        let place = ((time - DEPARTURE) * RATE).clamp(0.0, (self.moments.len() - 1) as f64);
        let index = (place as usize).min(self.moments.len().saturating_sub(2));
        let (from, to) = (self.moments[index], self.moments[(index + 1).min(self.moments.len() - 1)]);
        let between = |from: f64, to: f64| from + (to - from) * (place - index as f64);
        Moment {
            x: between(from.x, to.x),
            z: between(from.z, to.z),
            heading_deg: between(from.heading_deg, to.heading_deg),
            walked: between(from.walked, to.walked),
        }
    }

    /// The same for somebody who may show their back: they face where they go, and turn round as people do.
    pub fn on_foot(&self) -> Vec<room::Moment> {
        let count = (self.duration() * room::RATE) as usize + 1;
        let place = |time: f64| {
            let now = self.at(time.clamp(0.0, self.duration() - 1e-6));
            (now.x, now.z)
        };
        let mut heading = None;
        let moment = |index: usize| {
            let time = index as f64 / room::RATE;
            let ((x, z), (before, after)) = (place(time), (place(time - AHEAD / 4.0), place(time + AHEAD)));
            let (right, ahead) = (after.0 - before.0, after.1 - before.1);
            let wanted = right.atan2(ahead);
            let (next, last) = (place(time + 0.02), place(time - 0.02));
            let speed = (next.0 - last.0).hypot(next.1 - last.1) / 0.04;
            let was = *heading.get_or_insert(wanted);
            let missing = turned(was.to_degrees(), wanted.to_degrees()).to_radians();
            let moving = right.hypot(ahead) > 0.02;
            let step = if moving { missing.clamp(-TURN / room::RATE, TURN / room::RATE) } else { 0.0 };
            heading = Some(was + step);
            room::Moment {
                x,
                z,
                heading: was + step,
                speed,
                turning: step * room::RATE,
                seated: 0.0,
                reaching: 0.0,
            }
        };
        (0..count.max(2)).map(moment).collect()
    }

    /// The time at which a part of all moments has gone, 0 to 1.
    pub fn time_of(&self, part: f64) -> f64 {
        DEPARTURE + part * (self.duration() - DEPARTURE)
    }

    /// When they have first come so far from where they start, as a part of the farthest they ever come.
    pub fn time_at(&self, part: f64) -> f64 {
        let start = self.moments[0];
        let gone = |moment: &Moment| (moment.x - start.x).hypot(moment.z - start.z);
        let farthest = self.moments.iter().map(gone).fold(0.0, f64::max);
        let index = self.moments.iter().position(|moment| gone(moment) >= part * farthest);
        DEPARTURE + index.unwrap_or(0) as f64 / RATE
    }

    /// The first view: beside the person, who stands just outside of it.
    pub fn home(&self) -> Pose {
        let start = self.moments[0];
        let away = start.away();
        let middle = (HEIGHT / 2.0 - self.eye).atan2(away);
        let tilt = middle - self.above_deg.to_radians();
        let beside = geometry::edge_of_view((self.fov_deg / 2.0).to_radians(), tilt, middle);
        let outside = 1.1 * (HALF_WIDTH / away).atan();
        let next = self.at(DEPARTURE + 0.5).yaw_deg();
        let side = if turned(start.yaw_deg(), next) > 0.0 { 1.0 } else { -1.0 };
        let pan_deg = start.yaw_deg() + side * (beside + outside).to_degrees();
        Pose { pan_deg: turned(0.0, pan_deg), tilt_deg: tilt.to_degrees(), ..Pose::default() }
    }
}

/// From one direction to another, from -180 to 180.
pub(super) fn turned(from_deg: f64, to_deg: f64) -> f64 {
    (to_deg - from_deg + 180.0).rem_euclid(360.0) - 180.0
}

/// A lane as a line on the floor.
struct Track {
    /// x, z and metres from the start.
    points: Vec<[f64; 3]>,
}

impl Track {
    /// A lane of the place, from one of its ends, such that nobody shows their back going and coming.
    fn choose(place: &PhotoPlace, chance: &mut Seeded) -> Self {
        let lanes = place.lanes.iter().flat_map(|Lane(points)| {
            let mut reversed = points.clone();
            reversed.reverse();
            [Self::new(place.eye_m, points), Self::new(place.eye_m, &reversed)]
        });
        let mut tracks: Vec<(Self, f64)> = lanes
            .map(|track| {
                let away = track.most_away_deg(1.0).max(track.most_away_deg(-1.0));
                (track, away)
            })
            .collect();
        tracks.sort_by(|one, other| one.1.total_cmp(&other.1));
        tracks.truncate(tracks.iter().filter(|(_, away)| *away <= SIDEWAYS_DEG).count().max(1));
        tracks.sort_by(|one, other| other.0.length().total_cmp(&one.0.length()));
        tracks.swap_remove(chance.below(tracks.len().min(LONGEST))).0
    }

    fn new(eye: f64, corners: &[[f64; 2]]) -> Self {
        let mut points: Vec<[f64; 3]> = Vec::with_capacity(POINTS + 1);
        for step in 0..=POINTS {
            let place = step as f64 / POINTS as f64 * (corners.len() - 1) as f64;
            let index = (place as usize).min(corners.len() - 2);
            let share = place - index as f64;
            let [yaw, below] = [0, 1]
                .map(|axis| corners[index][axis] + (corners[index + 1][axis] - corners[index][axis]) * share);
            let away = eye / below.to_radians().tan();
            let (sin, cos) = yaw.to_radians().sin_cos();
            let (x, z) = (away * sin, away * cos);
            let come = points.last().map_or(0.0, |last| last[2] + (x - last[0]).hypot(z - last[1]));
            points.push([x, z, come]);
        }
        Self { points }
    }

    fn length(&self) -> f64 {
        self.points.last().map_or(0.0, |last| last[2])
    }

    /// Where it is so many metres from its start, and its heading there in degrees; along it (1) or back (-1).
    fn at(&self, come: f64, direction: f64) -> (f64, f64, f64) {
        let after = self.points.partition_point(|point| point[2] <= come).clamp(1, self.points.len() - 1);
        let (from, to) = (self.points[after - 1], self.points[after]);
        let share = ((come - from[2]) / (to[2] - from[2]).max(1e-9)).clamp(0.0, 1.0);
        let (x, z) = (from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share);
        let (right, ahead) = (direction * (to[0] - from[0]), direction * (to[1] - from[1]));
        let away = x.hypot(z).max(1e-9);
        // To the right of the picture, and towards the camera.
        let (sideways, near) = ((right * z - ahead * x) / away, -(right * x + ahead * z) / away);
        (x, z, sideways.atan2(near).to_degrees())
    }

    fn most_away_deg(&self, direction: f64) -> f64 {
        let headings =
            (0..=20).map(|part| self.at(self.length() * f64::from(part) / 20.0, direction).2.abs());
        headings.fold(0.0, f64::max)
    }

    /// Somebody's moments along it, from setting off: to and fro.
    fn walked(&self, speed: Change, direction: Change, chance: &mut Seeded) -> Vec<Moment> {
        let length = self.length();
        let paces = chance.pick(&[[FAST, SLOW], [SLOW, FAST]]);
        let wanted = |come: f64| match (speed, come / length) {
            (Change::Variable, part) if (0.25..0.45).contains(&part) => paces[0],
            (Change::Variable, part) if (0.62..0.82).contains(&part) => paces[1],
            _ => SPEED,
        };
        let mut turn = |forth: bool| {
            let (low, high) = TURNS[usize::from(!forth)];
            let early = chance.range(low, high) * length;
            let late = if forth { length - LEFT } else { LEFT };
            if direction == Change::Variable { early } else { late }
        };
        let (mut come, mut walked, mut forth) = (0.0f64, 0.0f64, true);
        let (mut velocity, mut heading) = (0.0f64, self.at(0.0, 1.0).2);
        let mut next = turn(forth);
        let mut moments = Vec::new();
        while (moments.len() as f64) < WALK * RATE {
            if (come >= next) == forth {
                forth = !forth;
                next = turn(forth);
            }
            let ahead = if forth { 1.0 } else { -1.0 };
            let change = if velocity * ahead < 0.0 { BRISK } else { GENTLE } / RATE;
            // Who turns slows down, and goes on the other way.
            velocity += (ahead * wanted(come) - velocity).clamp(-change, change);
            let (x, z, along) = self.at(come, ahead);
            // Turns towards the camera, as nobody was filmed from behind.
            let step = 180.0 / RATE / 1.2;
            heading += (along - heading).clamp(-step, step);
            moments.push(Moment { x, z, heading_deg: heading, walked });
            let moved = velocity / RATE;
            let turning = (along - heading).abs() > 30.0;
            walked += moved.abs().max(if turning { TURNING / RATE } else { 0.0 });
            // Who comes fast to the end of the lane turns on the spot.
            come = (come + moved).clamp(0.0, length);
        }
        moments
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::Occlusion;
    use std::path::PathBuf;

    fn ways() -> Vec<PhotoSettings> {
        let names =
            ["chester_v112351", "chester_v112355", "leaving-room", "puydesancy", "lake", "abandoned-room"];
        let numbers = 1..=PhotoSettings::WAYS;
        let way = |name: &str, number| {
            let panorama = PathBuf::from(format!("{name}.jpg"));
            let place = PhotoPlace::of(&panorama, None).unwrap();
            PhotoSettings::way(panorama, "walker".into(), place, number, 1).unwrap()
        };
        names.iter().flat_map(|name| numbers.clone().map(move |number| way(name, number))).collect()
    }

    #[test]
    fn nobody_shows_their_back_or_jumps() {
        for settings in ways() {
            let way = Way::new(&settings);
            assert!((3.4..20.0).contains(&way.duration()), "{} {settings:?}", way.duration());
            let mut before = way.at(0.0);
            for step in 0..(way.duration() / 0.04) as u32 {
                let now = way.at(f64::from(step) * 0.04);
                assert!(now.heading_deg.abs() < 120.0, "{settings:?} {now:?}");
                assert!((now.x - before.x).hypot(now.z - before.z) < 0.07, "{settings:?} {now:?}");
                assert!(now.walked >= before.walked);
                before = now;
            }
        }
    }

    #[test]
    fn everybody_turns_and_varied_speed_varies() {
        for settings in ways() {
            let way = Way::new(&settings);
            let moments: Vec<Moment> =
                (0..=100).map(|part| way.at(way.time_of(f64::from(part) / 100.0))).collect();
            let step = |pair: &[Moment]| (pair[1].x - pair[0].x, pair[1].z - pair[0].z);
            let steps: Vec<(f64, f64)> = moments.windows(2).map(step).collect();
            let turns =
                steps.windows(2).filter(|two| two[0].0 * two[1].0 + two[0].1 * two[1].1 < 0.0).count();
            assert!(turns >= 1, "{settings:?}");
            let fastest =
                moments.windows(2).map(|pair| pair[1].walked - pair[0].walked).fold(0.0, f64::max) * 10.0;
            assert_eq!(fastest > 1.15, settings.speed == Change::Variable, "{settings:?} {fastest}");
        }
    }

    #[test]
    fn a_third_of_the_ways_each_has_nothing_something_low_and_something_high_before_it() {
        let count = |kind: Occlusion| ways().iter().filter(|settings| settings.occlusion == kind).count();
        assert_eq!([Occlusion::None, Occlusion::Partial, Occlusion::Full].map(count), [24; 3]);
    }
}
