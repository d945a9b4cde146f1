// SPDX-License-Identifier: MPL-2.0

//! Followers that others have described, with a law of steering of their own in the place of our servo: they command the camera by
//! `ptz.cgi` themselves. `docs/comparison.md` says what is theirs and what is not.

use std::{
    io::{self, Read, Write},
    net::TcpStream,
    time::Duration,
};

use ptztrack_contract::{TargetMeta, TargetState};
use virtual_camera::{VirtualCamera, aim};

use crate::record::TrackerName;

mod box_pid;
mod law;
mod predicted_place;
mod relative_moves;

use law::{Law, Observation, Seen};

/// No answer from a camera on this machine takes this long.
const PATIENCE: Duration = Duration::from_secs(10);

/// What commands the camera after each picture.
pub(super) struct Follower {
    law: Box<dyn Law>,
    size: (u32, u32),
}

impl Follower {
    /// Of pictures of `size` pixels; `None` for those that our servo moves the camera for, and for who moves nothing.
    pub fn of(name: TrackerName, size: (u32, u32)) -> Option<Self> {
        let law: Box<dyn Law> = match name {
            TrackerName::RelativeMoves => Box::<relative_moves::RelativeMoves>::default(),
            TrackerName::KcfPredicted => Box::<predicted_place::PredictedPlace>::default(),
            TrackerName::BoxPid => Box::<box_pid::BoxPid>::default(),
            _ => return None,
        };
        Some(Self { law, size })
    }

    /// Tells `camera` what is to be done about the picture of that `exposure`, which has just come.
    pub fn steer(
        &mut self,
        camera: &VirtualCamera,
        exposure: Duration,
        target: Option<&TargetMeta>,
    ) -> io::Result<()> {
        let observation = observe(camera, exposure, self.size, target);
        match self.law.command(&observation) {
            Some(command) => tell(camera, &command.query(self.size)),
            None => Ok(()),
        }
    }
}

fn observe(
    camera: &VirtualCamera,
    exposure: Duration,
    size: (u32, u32),
    target: Option<&TargetMeta>,
) -> Observation {
    let pose = camera.pose_at(exposure);
    let focal_px = camera.focal_px(&pose, size);
    // From the middle of the picture to its edge, in focal lengths.
    let (half_width, half_height) = (f64::from(size.0) / 2.0 / focal_px, f64::from(size.1) / 2.0 / focal_px);
    let seen = target.filter(|target| target.state == TargetState::Tracking).map(|target| {
        let middle = target.bounds.centre();
        let (right, up) = (2.0 * middle.x - 1.0, 1.0 - 2.0 * middle.y);
        Seen {
            offset: (right, up),
            size: (target.bounds.width, target.bounds.height),
            bearing_deg: aim(&pose, right * half_width, -up * half_height),
        }
    });
    Observation {
        time: camera.now(),
        target: seen,
        half_view_deg: (half_width.atan().to_degrees(), half_height.atan().to_degrees()),
        moving: camera.status().moving,
    }
}

/// A request to `ptz.cgi`, and its answer.
fn tell(camera: &VirtualCamera, query: &str) -> io::Result<()> {
    let mut stream = TcpStream::connect(camera.http_address())?;
    stream.set_read_timeout(Some(PATIENCE))?;
    write!(
        stream,
        "GET /axis-cgi/com/ptz.cgi?{query} HTTP/1.1\r\nHost: camera\r\nConnection: close\r\n\r\n"
    )?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    let accepted = answer.starts_with("HTTP/1.1 204") || answer.starts_with("HTTP/1.1 200");
    let first = answer.lines().next().unwrap_or_default();
    if accepted { Ok(()) } else { Err(io::Error::other(format!("`{query}` was answered `{first}`"))) }
}
