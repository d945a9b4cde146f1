// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use session::Command;

/// A command as `ptz.cgi` takes it: its part of the query string.
#[derive(Debug, Clone, Copy)]
pub struct Words<'a>(pub &'a Command);

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Command::Velocity { pan, tilt, zoom, free } => {
                write!(f, "continuouspantiltmove={pan},{tilt}")?;
                zoom.map_or(Ok(()), |zoom| write!(f, "&continuouszoommove={zoom}"))?;
                f.write_str(if *free { "&proportionalspeed=disabled" } else { "" })
            }
            Command::Absolute { pan_deg, tilt_deg, speed, zoom } => {
                write!(f, "pan={pan_deg:.4}&tilt={tilt_deg:.4}&speed={speed}")?;
                zoom.map_or(Ok(()), |zoom| write!(f, "&zoom={zoom}"))
            }
            Command::Centre { x, y, width, height, zoom_percent } => {
                match zoom_percent {
                    Some(percent) => write!(f, "areazoom={x},{y},{percent}")?,
                    None => write!(f, "center={x},{y}")?,
                }
                write!(f, "&imagewidth={width}&imageheight={height}")
            }
            Command::Preset { number } => write!(f, "gotoserverpresetno={number}"),
            Command::Halt => f.write_str("continuouspantiltmove=0,0"),
            Command::Stop => f.write_str("move=stop"),
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
            assert_eq!(Words(&command).to_string(), query);
        }
    }
}
