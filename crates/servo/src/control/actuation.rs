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
    /// Turn at these speeds until told otherwise.
    Velocity {
        /// Speed step, -100 (left) to 100 (right): percent of full speed.
        pan: i8,
        /// Speed step, -100 (down) to 100 (up).
        tilt: i8,
        /// Speed step of the zoom, -100 (out) to 100 (in); `None` leaves the zoom to others.
        zoom: Option<i8>,
    },
    /// Look there.
    Absolute {
        /// Degrees, -180 to 180.
        pan_deg: f64,
        /// Degrees, -180 to 180.
        tilt_deg: f64,
        /// Speed step, 1 to 100.
        speed: u8,
        /// Zoom step, 1 to 9999; `None` leaves it as it is.
        zoom: Option<u16>,
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
        /// Magnify what is seen by so many per cent; `None` leaves the zoom as it is.
        zoom_percent: Option<u32>,
    },
    /// Go to a position that is stored in the camera.
    Preset {
        /// Its number.
        number: u32,
    },
}

impl Actuation {
    /// Speed step of moves to a position, of a camera that does not tell its own.
    pub const FULL_SPEED: u8 = 100;

    /// Whether the camera rests once it has done this.
    pub fn is_rest(&self) -> bool {
        matches!(self, Self::Rest | Self::Velocity { pan: 0, tilt: 0, zoom: None | Some(0) })
    }

    /// Whether this is a move from rest to rest.
    pub fn is_point_to_point(&self) -> bool {
        matches!(self, Self::Absolute { .. } | Self::Centre { .. } | Self::Preset { .. })
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
