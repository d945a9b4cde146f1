// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use serde::{Deserialize, Serialize};
use servo::{Actuation, Motion};

/// What a camera can be told, in the words of whichever protocol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Move like this.
    Move {
        /// How.
        motion: Motion,
        /// At a speed free of the bound to the field of view, of a camera that has one and lets moves be free of it.
        free: bool,
    },
    /// Be at rest.
    Stop(Stop),
}

/// What ends a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// Of pan and tilt, at a speed.
    PanTilt,
    /// Of all axes, at a speed.
    AllAxes,
    /// To a position.
    Position,
}

impl Command {
    /// The command for a move; `free` where it is to be free of proportional speed.
    pub fn of(motion: Motion, free: bool) -> Self {
        let turns = matches!(motion, Motion::Velocity { pan, tilt, .. } if (pan, tilt) != (0.0, 0.0));
        Self::Move { motion, free: free && turns }
    }

    /// What it makes the camera do.
    pub fn actuation(&self) -> Actuation {
        match self {
            Self::Move { motion, .. } => Actuation::Move(*motion),
            Self::Stop(Stop::AllAxes) => Actuation::Move(Motion::STILL),
            Self::Stop(Stop::PanTilt | Stop::Position) => Actuation::Rest,
        }
    }

    /// Whether the camera is at rest once it has accepted this.
    pub fn is_stop(&self) -> bool {
        match self {
            Self::Move { motion, .. } => motion.is_still(),
            Self::Stop(_) => true,
        }
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Move { motion: Motion::Velocity { pan, tilt, zoom }, .. } => {
                let percent = |part: f64| (part * 100.0).round();
                write!(f, "move at {},{} % of full speed", percent(*pan), percent(*tilt))?;
                zoom.map_or(Ok(()), |zoom| write!(f, ", zoom at {} %", percent(zoom)))
            }
            Self::Move { motion: Motion::Absolute { pan_deg, tilt_deg, .. }, .. } => {
                write!(f, "move to {pan_deg:.1}°,{tilt_deg:.1}°")
            }
            Self::Move { motion: Motion::Centre { x, y, .. }, .. } => write!(f, "centre on pixel {x},{y}"),
            Self::Move { motion: Motion::Preset { number }, .. } => write!(f, "go to preset {number}"),
            Self::Stop(Stop::PanTilt) => f.write_str("stop pan and tilt"),
            Self::Stop(Stop::AllAxes | Stop::Position) => f.write_str("stop"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zoom_is_no_rest() {
        let zooming = |zoom| Command::of(Motion::Velocity { pan: 0.0, tilt: 0.0, zoom }, true);
        assert!(zooming(None).is_stop() && zooming(Some(0.0)).is_stop() && !zooming(Some(0.01)).is_stop());
    }
}
