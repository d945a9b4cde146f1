use std::fmt;

/// A move, as `ptz.cgi` takes it. `Display` is its part of the query string.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// `continuouspantiltmove`: move until told otherwise.
    Velocity {
        /// Speed step, -100 (left) to 100 (right).
        pan: i8,
        /// Speed step, -100 (down) to 100 (up).
        tilt: i8,
    },
    /// `pan`, `tilt`: move to a position.
    Absolute {
        /// Degrees, -180 to 180.
        pan_deg: f64,
        /// Degrees, -180 to 180.
        tilt_deg: f64,
        /// Speed step, 1 to 100.
        speed: u8,
    },
    /// `center`: bring a pixel of the picture to its middle.
    Centre {
        /// Pixels from the left.
        x: u32,
        /// Pixels from the top.
        y: u32,
        /// Width of the picture that the pixel is counted in.
        width: u32,
        /// Height of the picture that the pixel is counted in.
        height: u32,
    },
    /// `continuouspantiltmove=0,0`: end a continuous move.
    Halt,
    /// `move=stop`: end a move to a position.
    Stop,
}

impl Command {
    /// Whether the camera is at rest once it has accepted this.
    pub fn is_stop(&self) -> bool {
        matches!(self, Self::Halt | Self::Stop | Self::Velocity { pan: 0, tilt: 0 })
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Velocity { pan, tilt } => write!(f, "continuouspantiltmove={pan},{tilt}"),
            Self::Absolute { pan_deg, tilt_deg, speed } => {
                write!(f, "pan={pan_deg:.4}&tilt={tilt_deg:.4}&speed={speed}")
            }
            Self::Centre { x, y, width, height } => {
                write!(f, "center={x},{y}&imagewidth={width}&imageheight={height}")
            }
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
            (Command::Velocity { pan: -49, tilt: 7 }, "continuouspantiltmove=-49,7"),
            (
                Command::Absolute { pan_deg: -12.5, tilt_deg: 3.0, speed: 100 },
                "pan=-12.5000&tilt=3.0000&speed=100",
            ),
            (
                Command::Centre { x: 960, y: 270, width: 1280, height: 720 },
                "center=960,270&imagewidth=1280&imageheight=720",
            ),
            (Command::Halt, "continuouspantiltmove=0,0"),
            (Command::Stop, "move=stop"),
        ];
        for (command, query) in spelled {
            assert_eq!(command.to_string(), query);
        }
    }
}
