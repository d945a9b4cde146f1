// SPDX-License-Identifier: MPL-2.0

//! How the person walks: where the feet come down, and how the joints stand at every moment.
//!
//! The feet lead. Each comes down where the body will be over it in the middle of its stance and stays there, so no
//! foot slips; the pelvis rides over the supporting leg like an inverted pendulum; knees follow from hips and ankles.

use std::f64::consts::TAU;

use super::{
    super::view::{Vector, add, cross, dot, scale, subtract},
    figure::{Build, Frame},
    walk::{Moment, SPEED, Walk},
};

/// Metres per second between which walking becomes running.
const TO_RUNNING: (f64, f64) = (2.3, 3.2);
/// Part of a runner's cycle for which a foot is on the floor.
const RUNNING_STANCE: f64 = 0.36;
/// Height of a seat in metres, and how far behind the feet somebody sits.
const SEAT: f64 = 0.44;
const SITS_BACK: f64 = 0.4;
/// How far an arm is raised that is held ahead, in radians.
const LEVEL: f64 = 1.35;
/// Below this speed (m/s) and turning (rad/s) the feet come together.
const STANDING: (f64, f64) = (0.3, 0.6);

/// Part of the cycle for which a foot is on the floor.
const STANCE: f64 = 0.62;
/// Part of the cycle after touchdown at which the body is over the foot.
const OVER: f64 = 0.26;
/// Pitch of the foot over its cycle: degrees, toes up positive (after Perry & Burnfield, Gait Analysis, chapter 4).
const PITCH: [(f64, f64); 9] = [
    (0.0, 20.0),
    (0.1, 0.0),
    (0.3, 0.0),
    (0.48, -24.0),
    (STANCE, -58.0),
    (0.74, -42.0),
    (0.85, -2.0),
    (0.94, 16.0),
    (1.0, 20.0),
];

/// A leg from hip to foot.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leg {
    pub hip: Vector,
    pub knee: Vector,
    pub ankle: Vector,
    /// Of the foot: `up` and `ahead` pitched with it.
    pub foot: Frame,
}

/// An arm from shoulder to wrist.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arm {
    pub shoulder: Vector,
    pub elbow: Vector,
    pub wrist: Vector,
    pub frame: Frame,
}

/// All joints at a moment; left first.
#[derive(Debug, Clone)]
pub(crate) struct BodyPose {
    /// On the floor, below the body.
    pub place: Vector,
    /// Middle between the hips.
    pub pelvis: Vector,
    pub hips: Frame,
    pub chest: Frame,
    pub head: Frame,
    pub legs: [Leg; 2],
    pub arms: [Arm; 2],
}

/// Steps of a walk.
#[derive(Debug, Clone)]
pub(crate) struct Gait {
    walk: Walk,
    build: Build,
    /// Cycles (two steps) up to each moment of the walk's table.
    cycles: Vec<f64>,
}

impl Gait {
    /// The steps of `walk`, beginning somewhere in a cycle.
    pub fn new(walk: Walk, build: Build, phase: f64) -> Self {
        let (moments, interval) = walk.table();
        let mut cycle = phase;
        let cycles = moments
            .iter()
            .map(|moment| {
                cycle += build.cadence(moment.speed, moment.turning) * interval;
                cycle
            })
            .collect();
        Self { walk, build, cycles }
    }

    pub fn walk(&self) -> &Walk {
        &self.walk
    }

    fn cycle_at(&self, time: f64) -> f64 {
        let (_, interval) = self.walk.table();
        let place = (time / interval).clamp(0.0, (self.cycles.len() - 1) as f64);
        let index = (place as usize).min(self.cycles.len() - 2);
        let (before, after) = (self.cycles[index], self.cycles[index + 1]);
        before + (after - before) * (place - index as f64)
    }

    /// The body when the cycle has come so far.
    fn moment_at(&self, cycle: f64) -> Moment {
        let (_, interval) = self.walk.table();
        let next = self.cycles.partition_point(|&reached| reached < cycle);
        let Some(before) = next.checked_sub(1).filter(|_| next < self.cycles.len()) else {
            return self.walk.at(next as f64 * interval);
        };
        let share = (cycle - self.cycles[before]) / (self.cycles[next] - self.cycles[before]);
        self.walk.at((before as f64 + share) * interval)
    }

    /// How everything stands at a time in seconds.
    pub fn pose(&self, time: f64) -> BodyPose {
        let now = self.walk.at(time);
        let cycle = self.cycle_at(time);
        // Who turns on the spot lifts their feet too.
        let effort = (now.speed.max(0.4 * now.turning.abs().min(1.0)) / SPEED).clamp(0.0, 1.5).sqrt();
        let (run, seated) = (running(now.speed), now.seated);
        let swing = TAU * cycle;
        let build = &self.build;
        let place = [now.x, 0.0, now.z];
        let feet = [0, 1].map(|side| self.gathered(side, cycle, &now, self.foot(side, cycle, effort)));
        let level = Frame::heading(now.heading);
        // Weight goes over the supporting foot: the left one's stance is the first half of the cycle.
        let sway = -0.016 * build.height * (swing - 0.2).sin() * effort;
        let middle = add(place, scale(level.right, sway));
        let hips =
            Frame::heading(now.heading + 0.09 * effort * swing.cos()).rolled(0.05 * effort * swing.sin());
        let walking = self.pelvis_height(middle, &hips, &feet);
        // A runner is highest between two steps.
        let bounce = 0.96 * (build.thigh + build.shank) + build.ankle_height - 0.025 * (2.0 * swing).cos();
        let upright = walking + (bounce - walking) * run;
        let back = scale(level.ahead, -SITS_BACK * seated);
        let pelvis = add([middle[0], upright + (SEAT + 0.09 - upright) * seated, middle[2]], back);
        // Who sits down or rises leans forward meanwhile.
        let lean = build.lean + 0.02 * effort + 0.13 * run + 2.4 * seated * (1.0 - seated);
        let chest = Frame::heading(now.heading - build.twist * effort * swing.cos())
            .rolled(-0.02 * effort * swing.sin())
            .pitched(-lean);
        let glance = self.walk.at(time + 0.25).heading - now.heading;
        let head = Frame::heading(now.heading + 0.8 * glance)
            .pitched(-build.nod - 0.015 * (2.0 * swing).cos() * effort);
        let legs = [0, 1].map(|side| self.leg(side, pelvis, &hips, feet[side], run));
        let arms = [0, 1].map(|side| self.arm(side, pelvis, &chest, swing, &now));
        BodyPose { place, pelvis, hips, chest, head, legs, arms }
    }

    /// Ankle and frame of a foot.
    fn foot(&self, side: usize, cycle: f64, effort: f64) -> (Vector, Frame) {
        let own = cycle - 0.5 * side as f64;
        let (count, part) = (own.floor(), own - own.floor());
        let touchdown = count + 0.5 * side as f64;
        let run = running(self.moment_at(touchdown).speed);
        let stance = STANCE + (RUNNING_STANCE - STANCE) * run;
        // The same roll in less of the cycle.
        let rolled = if part < stance {
            part / stance * STANCE
        } else {
            1.0 - (1.0 - part) / (1.0 - stance) * (1.0 - STANCE)
        };
        let pitch = pitch_deg(rolled).to_radians() * effort.min(1.15);
        let stands = self.stands(side, touchdown);
        if part < stance {
            return self.rolled_foot(stands, pitch);
        }
        let comes = self.stands(side, touchdown + 1.0);
        let share = (part - stance) / (1.0 - stance);
        let (from, _) = self.rolled_foot(stands, pitch_deg(STANCE).to_radians() * effort.min(1.15));
        let (to, _) = self.rolled_foot(comes, pitch_deg(1.0).to_radians() * effort.min(1.15));
        let eased = share * share * (3.0 - 2.0 * share);
        let height = (0.035 + 0.14 * run) * self.build.height;
        let lift = height * effort * (share * std::f64::consts::PI).sin().powi(2);
        let ankle = add(add(from, scale(subtract(to, from), eased)), [0.0, lift, 0.0]);
        let heading = stands.1 + (comes.1 - stands.1) * eased;
        (ankle, Frame::heading(heading).pitched(pitch))
    }

    /// Who comes to a stand draws the farther foot up beside the one they stand on.
    fn gathered(&self, side: usize, cycle: f64, now: &Moment, foot: (Vector, Frame)) -> (Vector, Frame) {
        let share = ((now.speed / STANDING.0).max(now.turning.abs() / STANDING.1)).min(1.0);
        // How far a foot's cycle is from the middle of its stance.
        let off = |side: f64| ((cycle - 0.5 * side - STANCE / 2.0 + 0.5).rem_euclid(1.0) - 0.5).abs();
        if share >= 1.0 || off(side as f64) <= off(1.0 - side as f64) {
            return foot;
        }
        let apart = share * share * (3.0 - 2.0 * share);
        let (level, outwards) = (Frame::heading(now.heading), [-1.0, 1.0][side]);
        let place = add([now.x, 0.0, now.z], scale(level.right, outwards * 1.3 * self.build.track));
        let (ankle, flat) = self.rolled_foot((place, now.heading + outwards * self.build.toe_out), 0.0);
        // It is lifted on the way.
        let lift = [0.0, 0.1 * self.build.height * apart * (1.0 - apart), 0.0];
        (add(add(ankle, scale(subtract(foot.0, ankle), apart)), lift), flat.towards(&foot.1, apart))
    }

    /// Where a foot that touched down at `cycle` stands flat, and its heading.
    fn stands(&self, side: usize, cycle: f64) -> (Vector, f64) {
        let run = running(self.moment_at(cycle).speed);
        let over = self.moment_at(cycle + OVER + (RUNNING_STANCE / 2.0 - OVER) * run);
        let outwards = [-1.0, 1.0][side];
        let right = Frame::heading(over.heading).right;
        let place = add([over.x, 0.0, over.z], scale(right, outwards * self.build.track));
        (place, over.heading + outwards * self.build.toe_out)
    }

    /// A standing foot rolls over its heel, then over its ball.
    fn rolled_foot(&self, (place, heading): (Vector, f64), pitch: f64) -> (Vector, Frame) {
        let flat = Frame::heading(heading);
        let pivot = if pitch > 0.0 { self.build.heel } else { self.build.ball };
        let foot = flat.pitched(pitch);
        let up = add(scale(foot.up, self.build.ankle_height), scale(foot.ahead, -pivot));
        (add(add(place, scale(flat.ahead, pivot)), up), foot)
    }

    /// As high as both legs reach, the one that reaches less deciding.
    fn pelvis_height(&self, middle: Vector, hips: &Frame, feet: &[(Vector, Frame); 2]) -> f64 {
        let softness = 0.012;
        let reach = 0.993 * (self.build.thigh + self.build.shank);
        let shares = [0, 1].map(|side: usize| {
            let (ankle, _) = feet[side];
            let hip = add(middle, scale(hips.right, [-1.0, 1.0][side] * self.build.hip));
            let apart = (hip[0] - ankle[0]).hypot(hip[2] - ankle[2]);
            let height = ankle[1] + (reach * reach - apart * apart).max(0.0).sqrt();
            (-height / softness).exp()
        });
        -softness * (shares[0] + shares[1]).ln()
    }

    fn leg(
        &self,
        side: usize,
        pelvis: Vector,
        hips: &Frame,
        (ankle, foot): (Vector, Frame),
        run: f64,
    ) -> Leg {
        let hip = add(pelvis, scale(hips.right, [-1.0, 1.0][side] * self.build.hip));
        let ahead = add(scale(hips.ahead, 0.5), scale(cross(foot.right, [0.0, 1.0, 0.0]), 0.5));
        // A runner's foot may be left behind, one that is walked on is not.
        let reach = if run > 0.0 { 0.999 * (self.build.thigh + self.build.shank) } else { f64::INFINITY };
        let ankle = within(hip, ankle, reach);
        let knee = joint(hip, ankle, self.build.thigh, self.build.shank, ahead);
        Leg { hip, knee, ankle, foot }
    }

    fn arm(&self, side: usize, pelvis: Vector, chest: &Frame, swing: f64, now: &Moment) -> Arm {
        let build = &self.build;
        let effort = (now.speed / SPEED).clamp(0.0, 1.5).sqrt();
        let run = running(now.speed);
        let outwards = [-1.0, 1.0][side];
        let shoulder = add(
            add(pelvis, scale(chest.up, build.shoulder_height)),
            scale(chest.right, outwards * build.shoulder),
        );
        // The arm swings with the other side's leg, a little behind it.
        let forwards = outwards * (swing - 0.25).cos();
        let raised = build.arm_swing * effort * forwards * (1.0 + 0.5 * run) + 0.06 + 0.45 * now.seated;
        let raised = raised + (LEVEL - raised) * now.reaching;
        let bent =
            build.elbow + 0.4 * build.arm_swing * effort * (1.0 + forwards) + 1.1 * run + 0.75 * now.seated;
        let upper = chest.pitched(raised).rolled(-outwards * build.arm_out);
        let fore = upper.pitched(bent).rolled(outwards * 0.12);
        let elbow = add(shoulder, scale(upper.up, -build.upper_arm));
        let wrist = add(elbow, scale(fore.up, -build.forearm));
        Arm { shoulder, elbow, wrist, frame: fore }
    }
}

/// How far somebody of a speed runs: 0 walks, 1 runs.
fn running(speed: f64) -> f64 {
    let share = ((speed - TO_RUNNING.0) / (TO_RUNNING.1 - TO_RUNNING.0)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// The same place, or one on the way to it no farther than `reach`: a runner's foot that is off the floor.
fn within(from: Vector, to: Vector, reach: f64) -> Vector {
    let way = subtract(to, from);
    let length = dot(way, way).sqrt();
    if length <= reach { to } else { add(from, scale(way, reach / length)) }
}

/// The foot's pitch at a part of its cycle.
fn pitch_deg(part: f64) -> f64 {
    let next = PITCH.partition_point(|knot| knot.0 <= part).clamp(1, PITCH.len() - 1);
    let (before, after) = (PITCH[next - 1], PITCH[next]);
    let share = (part - before.0) / (after.0 - before.0);
    before.1 + (after.1 - before.1) * share * share * (3.0 - 2.0 * share)
}

/// The joint between two bones of given lengths, bent towards `ahead`.
fn joint(from: Vector, to: Vector, first: f64, second: f64, ahead: Vector) -> Vector {
    let way = subtract(to, from);
    let length = dot(way, way).sqrt().clamp(1e-6, first + second);
    let along = scale(way, 1.0 / length);
    let share = (first * first - second * second + length * length) / (2.0 * length);
    let out = (first * first - share * share).max(0.0).sqrt();
    let side = subtract(ahead, scale(along, dot(ahead, along)));
    let side = scale(side, 1.0 / dot(side, side).sqrt().max(1e-9));
    add(add(from, scale(along, share)), scale(side, out))
}
