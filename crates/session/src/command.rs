// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use serde::{Deserialize, Serialize};
use servo::Actuation;

/// What a camera can be told, in the words of whichever protocol.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Command {
    /// Move until told otherwise.
    Velocity {
        /// Speed step, -100 (left) to 100 (right).
        pan: i8,
        /// Speed step, -100 (down) to 100 (up).
        tilt: i8,
        /// Speed step, -100 (out) to 100 (in); `None` leaves the zoom to others.
        zoom: Option<i8>,
        /// Free of the bound to the field of view, of a camera that has one and lets moves be free of it.
        free: bool,
    },
    /// Move to a position.
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
    /// Go to one of the camera's presets.
    Preset {
        /// Its number.
        number: u32,
    },
    /// End a continuous move of pan and tilt.
    Halt,
    /// End a move to a position.
    Stop,
}

impl Command {
    /// Ends a continuous move of all axes.
    pub const REST: Self = Self::Velocity { pan: 0, tilt: 0, zoom: Some(0), free: false };

    /// The command for a move; `free` where it is to be free of proportional speed. `None` where it is none.
    pub fn of(actuation: &Actuation, free: bool) -> Option<Self> {
        Some(match *actuation {
            Actuation::Rest | Actuation::Continue => return None,
            Actuation::Velocity { pan, tilt, zoom } => {
                Self::Velocity { pan, tilt, zoom, free: free && (pan, tilt) != (0, 0) }
            }
            Actuation::Absolute { pan_deg, tilt_deg, speed, zoom } => {
                Self::Absolute { pan_deg, tilt_deg, speed, zoom }
            }
            Actuation::Centre { x, y, width, height, zoom_percent } => {
                Self::Centre { x, y, width, height, zoom_percent }
            }
            Actuation::Preset { number } => Self::Preset { number },
        })
    }

    /// What it makes the camera do.
    pub fn actuation(&self) -> Actuation {
        match *self {
            Self::Velocity { pan, tilt, zoom, .. } => Actuation::Velocity { pan, tilt, zoom },
            Self::Absolute { pan_deg, tilt_deg, speed, zoom } => {
                Actuation::Absolute { pan_deg, tilt_deg, speed, zoom }
            }
            Self::Centre { x, y, width, height, zoom_percent } => {
                Actuation::Centre { x, y, width, height, zoom_percent }
            }
            Self::Preset { number } => Actuation::Preset { number },
            Self::Halt | Self::Stop => Actuation::Rest,
        }
    }

    /// Whether the camera is at rest once it has accepted this.
    pub fn is_stop(&self) -> bool {
        matches!(self, Self::Halt | Self::Stop | Self::Velocity { pan: 0, tilt: 0, zoom: None | Some(0), .. })
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Velocity { pan, tilt, zoom, .. } => {
                write!(f, "move at speed steps {pan},{tilt}")?;
                zoom.map_or(Ok(()), |zoom| write!(f, ", zoom at {zoom}"))
            }
            Self::Absolute { pan_deg, tilt_deg, .. } => write!(f, "move to {pan_deg:.1}°,{tilt_deg:.1}°"),
            Self::Centre { x, y, .. } => write!(f, "centre on pixel {x},{y}"),
            Self::Preset { number } => write!(f, "go to preset {number}"),
            Self::Halt => f.write_str("stop pan and tilt"),
            Self::Stop => f.write_str("stop"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zoom_is_no_rest() {
        let zooming = |zoom| Command::Velocity { pan: 0, tilt: 0, zoom, free: true };
        assert!(zooming(None).is_stop() && zooming(Some(0)).is_stop() && !zooming(Some(1)).is_stop());
    }
}
