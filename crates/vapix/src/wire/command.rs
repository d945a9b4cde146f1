// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use serde::{Deserialize, Serialize};
use servo::Actuation;

/// A move, as `ptz.cgi` takes it. `Display` is its part of the query string.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Command {
    /// `continuouspantiltmove`: move until told otherwise.
    Velocity {
        /// Speed step, -100 (left) to 100 (right).
        pan: i8,
        /// Speed step, -100 (down) to 100 (up).
        tilt: i8,
        /// Speed step of `continuouszoommove`, -100 (out) to 100 (in); `None` leaves the zoom to others.
        zoom: Option<i8>,
        /// `proportionalspeed=disabled`: free of the bound to the field of view. Newer firmware only (API 1.1).
        free: bool,
    },
    /// `pan`, `tilt`: move to a position.
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
    /// `center`, or `areazoom`: bring a pixel of the picture to its middle.
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
    /// `gotoserverpresetno`: go to one of the camera's presets.
    Preset {
        /// Its number.
        number: u32,
    },
    /// `continuouspantiltmove=0,0`: end a continuous move.
    Halt,
    /// `move=stop`: end a move to a position.
    Stop,
}

impl Command {
    /// Ends a continuous move of all axes.
    pub const REST: Self = Self::Velocity { pan: 0, tilt: 0, zoom: Some(0), free: false };

    /// The words for a move; `free` where it is to be free of proportional speed. `None` where it is none.
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
            Self::Velocity { pan, tilt, zoom, free } => {
                write!(f, "continuouspantiltmove={pan},{tilt}")?;
                zoom.map_or(Ok(()), |zoom| write!(f, "&continuouszoommove={zoom}"))?;
                f.write_str(if *free { "&proportionalspeed=disabled" } else { "" })
            }
            Self::Absolute { pan_deg, tilt_deg, speed, zoom } => {
                write!(f, "pan={pan_deg:.4}&tilt={tilt_deg:.4}&speed={speed}")?;
                zoom.map_or(Ok(()), |zoom| write!(f, "&zoom={zoom}"))
            }
            Self::Centre { x, y, width, height, zoom_percent } => {
                match zoom_percent {
                    Some(percent) => write!(f, "areazoom={x},{y},{percent}")?,
                    None => write!(f, "center={x},{y}")?,
                }
                write!(f, "&imagewidth={width}&imageheight={height}")
            }
            Self::Preset { number } => write!(f, "gotoserverpresetno={number}"),
            Self::Halt => f.write_str("continuouspantiltmove=0,0"),
            Self::Stop => f.write_str("move=stop"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_spelled_as_documented() {
        let spelled = [
            (Command::Velocity { pan: -49, tilt: 7, zoom: None, free: false }, "continuouspantiltmove=-49,7"),
            (
                Command::Velocity { pan: -49, tilt: 7, zoom: Some(-3), free: false },
                "continuouspantiltmove=-49,7&continuouszoommove=-3",
            ),
            (
                Command::Velocity { pan: -49, tilt: 7, zoom: None, free: true },
                "continuouspantiltmove=-49,7&proportionalspeed=disabled",
            ),
            (
                Command::Absolute { pan_deg: -12.5, tilt_deg: 3.0, speed: 100, zoom: None },
                "pan=-12.5000&tilt=3.0000&speed=100",
            ),
            (
                Command::Absolute { pan_deg: -12.5, tilt_deg: 3.0, speed: 100, zoom: Some(3868) },
                "pan=-12.5000&tilt=3.0000&speed=100&zoom=3868",
            ),
            (
                Command::Centre { x: 960, y: 270, width: 1280, height: 720, zoom_percent: None },
                "center=960,270&imagewidth=1280&imageheight=720",
            ),
            (
                Command::Centre { x: 960, y: 270, width: 1280, height: 720, zoom_percent: Some(150) },
                "areazoom=960,270,150&imagewidth=1280&imageheight=720",
            ),
            (Command::Preset { number: 4 }, "gotoserverpresetno=4"),
            (Command::Halt, "continuouspantiltmove=0,0"),
            (Command::Stop, "move=stop"),
        ];
        for (command, query) in spelled {
            assert_eq!(command.to_string(), query);
        }
    }

    #[test]
    fn a_zoom_is_no_rest() {
        let zooming = |zoom| Command::Velocity { pan: 0, tilt: 0, zoom, free: true };
        assert!(zooming(None).is_stop() && zooming(Some(0)).is_stop() && !zooming(Some(1)).is_stop());
    }
}
