// SPDX-License-Identifier: MPL-2.0

//! Where the person is when: the way across the room, its speed and its turn.

use std::f64::consts::PI;

use super::{
    super::{
        action::Action,
        settings::{Change, RoomSettings},
        view::{CAMERA, Vector},
    },
    cast, route,
};
use crate::{geometry::edge_of_view, kinematics::Pose, seeded::Seeded};

/// Ordinary walking, metres per second.
pub(crate) const SPEED: f64 = 1.4;
const FAST: f64 = 2.2;
const SLOW: f64 = 0.8;
/// Metres per second squared: of a change of pace, of setting off and of stopping to turn.
const GENTLE: f64 = 1.0;
const BRISK: f64 = 1.8;
/// How slow somebody gets who turns on their heel, and for how long they turn, in seconds.
const TURNING_SPEED: f64 = 0.4;
const TURNING_TIME: f64 = 1.1;
/// When the person sets off, in seconds; they come into view at 2 s.
const DEPARTURE: f64 = 0.8;
/// How far the way has gone when the person's middle passes the edge of the first view, in metres.
pub(super) const TO_THE_EDGE: f64 = 1.7;
/// Steps of the table a second.
pub(in crate::world) const RATE: f64 = 250.0;
/// Height of the middle of a person, in metres.
const MIDDLE: f64 = 0.87;
/// No test's way is nearer to the camera, in metres.
const NEAREST_WAY: f64 = 4.7;
/// Half of the widest view, in degrees.
const HALF_VIEW_DEG: f64 = 27.5;
/// How far above or below the middle of the first view somebody comes in, in degrees; all of them is in it still.
pub(super) const ENTRY_DEG: f64 = 9.0;
/// Stream of chance for that.
const ENTRY: u64 = 0xe27e;

/// The person on their way at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moment {
    /// On the floor, in metres.
    pub x: f64,
    /// On the floor, in metres.
    pub z: f64,
    /// The way they face, radians from z towards x.
    pub heading: f64,
    /// Metres per second along the heading.
    pub speed: f64,
    /// Radians per second.
    pub turning: f64,
    /// 0 upright, 1 seated.
    pub seated: f64,
    /// How far the arms are held ahead: 0 they hang, 1 they are level.
    pub reaching: f64,
}

/// The way of a test.
#[derive(Debug, Clone)]
pub(crate) struct Walk {
    moments: Vec<Moment>,
    duration: f64,
    /// 1 from left to right, -1 the other way.
    side: f64,
    at_the_edge: f64,
    /// How far above the middle of the first view they come in, in degrees.
    above_deg: f64,
}

impl Walk {
    /// The way of the person to be followed; `None` where there is nobody.
    pub fn new(settings: &RoomSettings) -> Option<Self> {
        match settings.action {
            Action::Test => Some(Self::of_test(settings)),
            _ => cast::cast(settings).first().map(|role| Self::along(&role.way)),
        }
    }

    /// A way by waypoints.
    pub(super) fn along(way: &route::Way) -> Self {
        let (moments, duration) = route::follow(way);
        let far = |moment: &Moment| (moment.x - way.start.0).hypot(moment.z - way.start.1) < TO_THE_EDGE;
        let at_the_edge = moments.partition_point(far) as f64 / RATE;
        Self { moments, duration, side: -way.start.0.signum(), at_the_edge, above_deg: way.above_deg }
    }

    /// A way by its moments, [`RATE`] of them a second; two at least.
    pub(super) fn by(moments: Vec<Moment>) -> Self {
        let duration = (moments.len() - 1) as f64 / RATE;
        Self { moments, duration, side: 1.0, at_the_edge: 0.0, above_deg: 0.0 }
    }

    /// The way of a test of the thesis.
    pub(super) fn of_test(settings: &RoomSettings) -> Self {
        let mut chance = Seeded::new(settings.seed).fork(0x3a1c).fork(settings.way());
        let above_deg = chance.fork(ENTRY).range(-ENTRY_DEG, ENTRY_DEG);
        let side = chance.pick(&[-1.0, 1.0]);
        let (from_z, to_z) = (chance.range(5.1, 6.1), chance.range(5.1, 6.1));
        let from_x = -side * from_z * chance.range(50f64, 52.0).to_radians().tan();
        let to_x = side * to_z * chance.range(46f64, 48.0).to_radians().tan();
        let length = (to_x - from_x).hypot(to_z - from_z);
        let plan = Plan::new(settings, length, &mut chance);
        let heading = (to_x - from_x).atan2(to_z - from_z);
        let moments = plan.walked(from_x, from_z, heading, side);
        Self { moments, duration: plan.duration(), side, at_the_edge: plan.time_at(TO_THE_EDGE), above_deg }
    }

    /// The person at a time in seconds; before the first and after the last they stand still.
    pub fn at(&self, time: f64) -> Moment {
        let place = (time * RATE).clamp(0.0, (self.moments.len() - 1) as f64);
        let index = (place as usize).min(self.moments.len() - 2);
        let (before, after) = (self.moments[index], self.moments[index + 1]);
        let share = place - index as f64;
        let between = |a: f64, b: f64| a + (b - a) * share;
        Moment {
            x: between(before.x, after.x),
            z: between(before.z, after.z),
            heading: between(before.heading, after.heading),
            speed: between(before.speed, after.speed),
            turning: between(before.turning, after.turning),
            seated: between(before.seated, after.seated),
            reaching: between(before.reaching, after.reaching),
        }
    }

    /// Where it leads nearer to the camera than the tests' ways, a place every half second.
    pub fn off_the_way(&self) -> impl Iterator<Item = Vector> + '_ {
        let every = (RATE / 2.0) as usize;
        let near = self.moments.iter().step_by(every).filter(|moment| moment.z < NEAREST_WAY);
        near.map(|moment| [moment.x, 0.0, moment.z])
    }

    /// When it is over, in seconds.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// The table of moments and the seconds between two of them.
    pub fn table(&self) -> (&[Moment], f64) {
        (&self.moments, 1.0 / RATE)
    }

    /// When the person's middle passes the edge of the first view, in seconds.
    pub fn entry(&self) -> f64 {
        self.at_the_edge
    }

    /// The first view of a world that begins at a time in seconds: beside the person's start, their middle somewhat above or
    /// below the middle of the picture. Once they have come in, it is between the middle and the edge they came from.
    pub fn home(&self, begins: f64) -> Pose {
        let edge = self.at(self.at_the_edge.max(begins));
        let height = (MIDDLE - CAMERA[1]).atan2(edge.x.hypot(edge.z));
        let tilt = height - self.above_deg.to_radians();
        let half = if begins > self.at_the_edge { HALF_VIEW_DEG / 2.0 } else { HALF_VIEW_DEG };
        let beside = edge_of_view(half.to_radians(), tilt, height);
        let pan = edge.x.atan2(edge.z) + self.side * beside;
        Pose { pan_deg: pan.to_degrees(), tilt_deg: tilt.to_degrees(), ..Pose::default() }
    }
}

/// Speed over time, made of stretches of steady acceleration, and when the turn begins.
struct Plan {
    /// Seconds and metres per second.
    knots: Vec<(f64, f64)>,
    turn: Option<f64>,
}

impl Plan {
    fn new(settings: &RoomSettings, length: f64, chance: &mut Seeded) -> Self {
        let mut plan = Self { knots: vec![(0.0, 0.0), (DEPARTURE, 0.0)], turn: None };
        plan.change(SPEED, BRISK);
        let variable = settings.speed == Change::Variable;
        let paces = chance.pick(&[[FAST, SLOW], [SLOW, FAST]]);
        let first = chance.range(3.4, 3.9);
        let second = chance.range(0.7, 1.1);
        if variable {
            plan.keep_until(first);
            plan.pace(paces[0]);
        }
        if settings.direction == Change::Variable {
            plan.keep_until(length - chance.range(1.2, 1.6));
            plan.about_turn();
        }
        let turned = plan.distance();
        if variable {
            plan.keep_until(turned + second);
            plan.pace(paces[1]);
        }
        let back = if plan.turn.is_some() { turned + 7.5 } else { length };
        plan.keep_until(back);
        plan
    }

    fn last(&self) -> (f64, f64) {
        self.knots.last().copied().unwrap_or_default()
    }

    fn duration(&self) -> f64 {
        self.last().0
    }

    fn change(&mut self, speed: f64, acceleration: f64) {
        let (time, before) = self.last();
        self.knots.push((time + (speed - before).abs() / acceleration, speed));
    }

    /// Goes on at the same speed up to a distance from the start.
    fn keep_until(&mut self, distance: f64) {
        let (time, speed) = self.last();
        self.knots.push((time + ((distance - self.distance()) / speed).max(0.0), speed));
    }

    /// Walks at another pace for some steps.
    fn pace(&mut self, speed: f64) {
        self.change(speed, GENTLE);
        self.keep_until(self.distance() + 1.2 * speed);
        self.change(SPEED, GENTLE);
    }

    fn about_turn(&mut self) {
        let time = self.duration();
        let slowing = (SPEED - TURNING_SPEED) / BRISK;
        self.knots.push((time + slowing, TURNING_SPEED));
        self.knots.push((time + slowing + TURNING_TIME / 2.0, TURNING_SPEED));
        self.change(SPEED, BRISK);
        self.turn = Some(time + slowing - TURNING_TIME / 4.0);
    }

    fn distance(&self) -> f64 {
        self.knots.windows(2).map(|pair| (pair[1].0 - pair[0].0) * (pair[0].1 + pair[1].1) / 2.0).sum()
    }

    fn speed(&self, time: f64) -> f64 {
        let next = self.knots.partition_point(|knot| knot.0 <= time);
        match (next.checked_sub(1).map(|before| self.knots[before]), self.knots.get(next)) {
            (Some(before), Some(after)) => {
                before.1 + (after.1 - before.1) * (time - before.0) / (after.0 - before.0)
            }
            // Who has arrived comes to a stand.
            _ => (self.last().1 - BRISK * (time - self.duration())).max(0.0),
        }
    }

    /// Radians per second, without the sign.
    fn turning(&self, time: f64) -> f64 {
        let share = self.turn.map_or(-1.0, |start| (time - start) / TURNING_TIME);
        if (0.0..=1.0).contains(&share) { PI / TURNING_TIME * (1.0 - (2.0 * PI * share).cos()) } else { 0.0 }
    }

    /// When the person has come so far, in seconds.
    fn time_at(&self, distance: f64) -> f64 {
        let mut come = 0.0;
        let mut step = 0;
        while come < distance && f64::from(step) < self.duration() * RATE {
            come += self.speed((f64::from(step) + 0.5) / RATE) / RATE;
            step += 1;
        }
        f64::from(step) / RATE
    }

    /// The way itself, up to the person's standing still.
    fn walked(&self, x: f64, z: f64, heading: f64, side: f64) -> Vec<Moment> {
        let steps = ((self.duration() + SPEED / BRISK) * RATE).ceil() as usize + 1;
        let mut now =
            Moment { x, z, heading, speed: self.speed(0.0), turning: 0.0, seated: 0.0, reaching: 0.0 };
        let mut moments = vec![now];
        for step in 0..steps {
            let (middle, end) = ((step as f64 + 0.5) / RATE, (step as f64 + 1.0) / RATE);
            // Turns away from the camera: the way back is the farther one.
            let turned = -side * self.turning(middle) / RATE;
            let (sin, cos) = (now.heading + turned / 2.0).sin_cos();
            let way = self.speed(middle) / RATE;
            now = Moment {
                x: now.x + way * sin,
                z: now.z + way * cos,
                heading: now.heading + turned,
                speed: self.speed(end),
                turning: -side * self.turning(end),
                ..now
            };
            moments.push(now);
        }
        moments
    }
}
