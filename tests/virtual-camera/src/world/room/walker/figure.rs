// SPDX-License-Identifier: MPL-2.0

//! The build of a person: lengths of bones, thickness of limbs, habits of walking.

use super::super::{
    settings::Subject,
    view::{Vector, add, scale},
};
use crate::seeded::Seeded;

/// Three axes at right angles, moving with a part of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    pub right: Vector,
    pub up: Vector,
    pub ahead: Vector,
}

impl Frame {
    /// Upright, facing along `heading`: radians from z towards x.
    pub fn heading(heading: f64) -> Self {
        let (sin, cos) = heading.sin_cos();
        Self { right: [cos, 0.0, -sin], up: [0.0, 1.0, 0.0], ahead: [sin, 0.0, cos] }
    }

    /// Turned about its right: what is ahead goes up.
    pub fn pitched(self, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self {
            ahead: add(scale(self.ahead, cos), scale(self.up, sin)),
            up: add(scale(self.up, cos), scale(self.ahead, -sin)),
            ..self
        }
    }

    /// Turned about what is ahead: what is up goes right.
    pub fn rolled(self, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self {
            right: add(scale(self.right, cos), scale(self.up, -sin)),
            up: add(scale(self.up, cos), scale(self.right, sin)),
            ..self
        }
    }

    /// A place given in these axes: right, up, ahead.
    pub fn place(&self, origin: Vector, [right, up, ahead]: Vector) -> Vector {
        let sum = add(scale(self.right, right), scale(self.up, up));
        add(origin, add(sum, scale(self.ahead, ahead)))
    }

    /// Partly this, partly that: as a spine twists.
    pub fn towards(&self, other: &Self, share: f64) -> Self {
        let mix = |a, b| add(scale(a, 1.0 - share), scale(b, share));
        Self {
            right: mix(self.right, other.right),
            up: mix(self.up, other.up),
            ahead: mix(self.ahead, other.ahead),
        }
    }
}

/// How a body is made. Lengths in metres, angles in radians; proportions after Winter, Biomechanics, figure 4.1.
#[derive(Debug, Clone)]
pub(crate) struct Build {
    /// Standing upright, shoes included.
    pub height: f64,
    /// Thickness of everything, 1 is slim.
    pub girth: f64,
    /// Width of the shoulders over the usual.
    pub breadth: f64,
    pub thigh: f64,
    pub shank: f64,
    pub ankle_height: f64,
    /// From the ankle back and ahead to where the foot rolls over.
    pub heel: f64,
    pub ball: f64,
    /// Half of the distances between hips, shoulders, feet.
    pub hip: f64,
    pub shoulder: f64,
    pub track: f64,
    /// From the pelvis up to the shoulders.
    pub shoulder_height: f64,
    pub upper_arm: f64,
    pub forearm: f64,
    pub toe_out: f64,
    pub arm_swing: f64,
    pub arm_out: f64,
    pub elbow: f64,
    pub lean: f64,
    pub nod: f64,
    pub twist: f64,
    /// Metres of a cycle of two steps at 1.4 m/s.
    pub stride: f64,
}

impl Build {
    /// Somebody of the subject's kind.
    pub fn of(subject: Subject, chance: &mut Seeded) -> Self {
        let (height, girth, breadth, pace) = match subject {
            Subject::A => (1.85, 1.0, 1.06, 1.02),
            Subject::B => (1.65, 0.94, 0.93, 0.94),
            Subject::C => (1.75, 1.14, 1.03, 0.98),
        };
        let height: f64 = height + chance.range(-0.025, 0.025);
        let girth: f64 = girth + chance.range(-0.03, 0.03);
        let breadth = breadth + chance.range(-0.02, 0.02);
        Self {
            height,
            girth,
            breadth,
            thigh: 0.243 * height,
            shank: 0.243 * height,
            ankle_height: 0.047 * height,
            heel: -0.03 * height,
            ball: 0.075 * height,
            hip: 0.052 * height,
            shoulder: 0.107 * height * breadth,
            track: 0.038 * height * girth,
            shoulder_height: 0.268 * height,
            upper_arm: 0.175 * height,
            forearm: 0.150 * height,
            toe_out: chance.range(0.06, 0.16),
            arm_swing: chance.range(0.27, 0.40),
            arm_out: 0.10 + 0.12 * (girth - 0.9),
            elbow: chance.range(0.16, 0.28),
            lean: chance.range(0.0, 0.035),
            nod: chance.range(0.0, 0.12),
            twist: chance.range(0.09, 0.14),
            stride: 0.83 * height * (pace + chance.range(-0.02, 0.02)),
        }
    }

    /// Cycles a second of who walks so fast (metres per second) and turns so fast (radians per second).
    ///
    /// Who walks faster takes longer steps and takes them quicker, about equally; a turn takes a step every 60 degrees.
    pub fn cadence(&self, speed: f64, turning: f64) -> f64 {
        let usual = super::walk::SPEED;
        let walking = usual / self.stride * (speed.max(0.0) / usual).sqrt();
        let most = if speed > 2.5 { 1.45 } else { 1.3 };
        walking.hypot(turning / 2.1).min(most)
    }
}
