// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use servo::Motion;
use session::{Command, Stop, ZoomStep};

use crate::steps::speed_step;

/// A command as `ptz.cgi` takes it: its part of the query string.
#[derive(Debug, Clone, Copy)]
pub struct Words<'a>(pub &'a Command);

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Command::Move { motion, free } => {
                moving(f, motion)?;
                f.write_str(if *free { "&proportionalspeed=disabled" } else { "" })
            }
            Command::Stop(Stop::PanTilt) => f.write_str("continuouspantiltmove=0,0"),
            Command::Stop(Stop::AllAxes) => moving(f, &Motion::STILL),
            Command::Stop(Stop::Position) => f.write_str("move=stop"),
        }
    }
}

fn moving(f: &mut fmt::Formatter<'_>, motion: &Motion) -> fmt::Result {
    match *motion {
        Motion::Velocity { pan, tilt, zoom } => {
            write!(f, "continuouspantiltmove={},{}", speed_step(pan), speed_step(tilt))?;
            zoom.map_or(Ok(()), |zoom| write!(f, "&continuouszoommove={}", speed_step(zoom)))
        }
        Motion::Absolute { pan_deg, tilt_deg, speed, zoom } => {
            write!(f, "pan={pan_deg:.4}&tilt={tilt_deg:.4}&speed={}", speed_step(speed).max(1))?;
            zoom.map_or(Ok(()), |zoom| write!(f, "&zoom={}", ZoomStep::at(zoom).whole()))
        }
        Motion::Centre { x, y, width, height, magnify } => {
            match magnify {
                Some(factor) => write!(f, "areazoom={x},{y},{}", (factor * 100.0).round())?,
                None => write!(f, "center={x},{y}")?,
            }
            write!(f, "&imagewidth={width}&imageheight={height}")
        }
        Motion::Preset { number } => write!(f, "gotoserverpresetno={number}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn move_at(pan: f64, tilt: f64, zoom: Option<f64>, free: bool) -> Command {
        Command::Move { motion: Motion::Velocity { pan, tilt, zoom }, free }
    }

    fn move_to(motion: Motion) -> Command {
        Command::Move { motion, free: false }
    }

    #[test]
    fn commands_are_spelled_as_documented() {
        let direction = |zoom| Motion::Absolute { pan_deg: -12.5, tilt_deg: 3.0, speed: 1.0, zoom };
        let pixel = |magnify| Motion::Centre { x: 960, y: 270, width: 1280, height: 720, magnify };
        let third = Some(3867.0 / 9998.0);
        let spelled = [
            (move_at(-0.49, 0.07, None, false), "continuouspantiltmove=-49,7"),
            (move_at(-0.49, 0.07, Some(-0.03), false), "continuouspantiltmove=-49,7&continuouszoommove=-3"),
            (move_at(-0.49, 0.07, None, true), "continuouspantiltmove=-49,7&proportionalspeed=disabled"),
            (move_to(direction(None)), "pan=-12.5000&tilt=3.0000&speed=100"),
            (move_to(direction(third)), "pan=-12.5000&tilt=3.0000&speed=100&zoom=3868"),
            (move_to(pixel(None)), "center=960,270&imagewidth=1280&imageheight=720"),
            (move_to(pixel(Some(1.5))), "areazoom=960,270,150&imagewidth=1280&imageheight=720"),
            (move_to(Motion::Preset { number: 4 }), "gotoserverpresetno=4"),
            (Command::Stop(Stop::PanTilt), "continuouspantiltmove=0,0"),
            (Command::Stop(Stop::AllAxes), "continuouspantiltmove=0,0&continuouszoommove=0"),
            (Command::Stop(Stop::Position), "move=stop"),
        ];
        for (command, query) in spelled {
            assert_eq!(Words(&command).to_string(), query);
        }
    }
}
