// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

/// How the camera is moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Mode {
    /// Continuously, by speed.
    #[default]
    Velocity,
    /// From position to position: look, move, wait until at rest, look again.
    Absolute,
    /// Like `Absolute`, but the camera itself works out the angles.
    Centre,
}

impl Mode {
    /// As the property has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Absolute => "absolute",
            Self::Centre => "centre",
        }
    }
}

/// What the camera is to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Actuation {
    /// Nothing: to be at rest.
    Rest,
    /// Whatever it does: a move to a position is under way.
    Continue,
    /// This.
    Move(Motion),
}

/// How the camera is to move. Speeds are parts of the camera's fastest, as no camera is believed how many degrees a second that
/// is: how many each part is, is the model's to know ([`SpeedMap`](crate::SpeedMap)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Turn at these speeds until told otherwise.
    Velocity {
        /// Part of the fastest, -1 (left) to 1 (right).
        pan: f64,
        /// Part of the fastest, -1 (down) to 1 (up).
        tilt: f64,
        /// Part of the zoom's fastest, -1 (out) to 1 (in); `None` leaves the zoom to others.
        zoom: Option<f64>,
    },
    /// Look there.
    Absolute {
        /// Degrees, -180 to 180.
        pan_deg: f64,
        /// Degrees, -180 to 180.
        tilt_deg: f64,
        /// Part of the fastest, beyond 0 to 1.
        speed: f64,
        /// Part of the optical zoom's travel, 0 (out) to 1 (in); `None` leaves it as it is.
        zoom: Option<f64>,
    },
    /// Bring a pixel of the picture to its middle.
    Centre {
        /// Pixels from the left.
        x: u32,
        /// Pixels from the top.
        y: u32,
        /// Width of the picture that the pixel is counted in.
        width: u32,
        /// Height of the picture that the pixel is counted in.
        height: u32,
        /// Magnify what is seen by this factor; `None` leaves the zoom as it is.
        magnify: Option<f64>,
    },
    /// Go to a position that is stored in the camera.
    Preset {
        /// Its number.
        number: u32,
    },
}

impl Motion {
    /// Speed of moves to a position, of a camera that does not tell its own.
    pub const FULL_SPEED: f64 = 1.0;

    /// All axes at rest, where they move at a speed.
    pub const STILL: Self = Self::Velocity { pan: 0.0, tilt: 0.0, zoom: Some(0.0) };

    /// Whether this moves nothing.
    pub fn is_still(&self) -> bool {
        matches!(self, Self::Velocity { pan: 0.0, tilt: 0.0, zoom: None | Some(0.0) })
    }

    /// Whether this is a move from rest to rest.
    pub fn is_point_to_point(&self) -> bool {
        !matches!(self, Self::Velocity { .. })
    }
}

impl Actuation {
    /// Whether the camera rests once it has done this.
    pub fn is_rest(&self) -> bool {
        match self {
            Self::Rest => true,
            Self::Continue => false,
            Self::Move(motion) => motion.is_still(),
        }
    }
}

/// Whether the camera is ours to move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// It is.
    Ours,
    /// That is being found out.
    Undecided,
    /// Somebody else moves it.
    Others,
}

/// What the camera's session knows of it, for the servo to decide by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActuatorStatus {
    /// Whether it is ours to move.
    pub access: Access,
    /// How it is moved.
    pub mode: Mode,
    /// It may be moving on our behalf.
    pub may_move: bool,
    /// A move went unanswered, and may yet act.
    pub in_doubt: bool,
    /// From one command to the next.
    pub interval: Duration,
}
