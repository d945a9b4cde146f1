// SPDX-License-Identifier: MPL-2.0

//! What a law of steering sees of a picture, and what it can have the camera do.

use std::time::Duration;

use virtual_camera::{Kinematics, SpeedMap};

/// How a follower turns what it sees into commands.
pub(super) trait Law: Send {
    /// What the camera is told after this picture; `None` for nothing.
    fn command(&mut self, observation: &Observation) -> Option<Command>;
}

/// A picture as a law sees it. Pan grows to the right, tilt upwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Observation {
    /// When the picture came, since the camera's start.
    pub time: Duration,
    /// Who is followed; `None` where they are not seen.
    pub target: Option<Seen>,
    /// Half of what the picture's width and height cover, degrees.
    pub half_view_deg: (f64, f64),
    /// Whether the camera says, as the picture comes, that it moves (`MoveStatus` of ONVIF).
    pub moving: bool,
}

/// Where somebody is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    /// Middle of the box from the middle of the picture, to the right and up: ±1 is the edge.
    pub offset: (f64, f64),
    /// Width and height of the box, parts of the picture's.
    pub size: (f64, f64),
    /// Pan and tilt that have the camera look at the middle of the box, degrees.
    pub bearing_deg: (f64, f64),
}

/// What the camera is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Command {
    /// Bring this place to the middle: from there to the right and up, ±1 is the edge.
    Centre(f64, f64),
    /// Look along this pan and tilt, degrees.
    GoTo(f64, f64),
    /// Turn at this speed of pan and tilt until told otherwise, degrees a second.
    Turn(f64, f64),
    /// Back to where it looked at first.
    Home,
}

impl Command {
    /// As `ptz.cgi` takes it. Pictures of `size` pixels.
    pub fn query(self, size: (u32, u32)) -> String {
        match self {
            Self::Centre(x, y) => {
                let (width, height) = (f64::from(size.0), f64::from(size.1));
                let (x, y) = ((1.0 + x) / 2.0 * width, (1.0 - y) / 2.0 * height);
                format!("center={x:.1},{y:.1}&imagewidth={width}&imageheight={height}")
            }
            Self::GoTo(pan, tilt) => format!("pan={pan:.3}&tilt={tilt:.3}"),
            Self::Turn(pan, tilt) => {
                let map = Kinematics::default().speed_map;
                let [pan, tilt] = [pan, tilt].map(|speed| speed_step(&map, speed));
                format!("continuouspantiltmove={pan:.1},{tilt:.1}")
            }
            Self::Home => "move=home".into(),
        }
    }
}

/// The speed step (-100 to 100) at which a camera turns by so many degrees a second, or nearest to it.
fn speed_step(map: &SpeedMap, deg_s: f64) -> f64 {
    if map.deg_s(1.0) > deg_s.abs() {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 100.0);
    for _ in 0..20 {
        let middle = (low + high) / 2.0;
        if map.deg_s(middle) < deg_s.abs() { low = middle } else { high = middle }
    }
    high.copysign(deg_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_said_as_the_camera_takes_them() {
        let said = |command: Command| command.query((640, 480));
        assert_eq!(said(Command::Centre(0.0, 0.0)), "center=320.0,240.0&imagewidth=640&imageheight=480");
        assert_eq!(said(Command::Centre(1.0, -0.5)), "center=640.0,360.0&imagewidth=640&imageheight=480");
        assert_eq!(said(Command::GoTo(-3.25, 1.0)), "pan=-3.250&tilt=1.000");
        assert_eq!(said(Command::Turn(0.0, 0.0)), "continuouspantiltmove=0.0,0.0");
        assert_eq!(said(Command::Home), "move=home");
    }

    #[test]
    fn speeds_become_the_steps_that_bring_them() {
        let map = SpeedMap::Linear { max_deg_s: 200.0 };
        for (speed, step) in [(100.0, 50.0), (-20.0, -10.0), (1e3, 100.0), (0.5, 0.0), (0.0, 0.0)] {
            assert!((speed_step(&map, speed) - step).abs() < 1e-3, "{speed}");
        }
        let cubic = Kinematics::default().speed_map;
        assert!((cubic.deg_s(speed_step(&cubic, 12.0)) - 12.0).abs() < 1e-2);
    }
}
