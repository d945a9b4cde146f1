// SPDX-License-Identifier: MPL-2.0

//! Whether who is followed is in the camera's view.

use std::thread;
use std::time::Duration;

use virtual_camera::{GroundTruth, VirtualCamera};

/// Between two looks.
const LOOK: Duration = Duration::from_millis(40);

/// What was seen of somebody for a while.
#[derive(Debug, Clone, Copy, Default)]
pub struct InView {
    /// Part of the time that they were in view.
    pub share: f64,
    /// The longest time that they were not.
    pub longest_out: Duration,
    /// The longest time that the camera stood still although they were not in the middle half of the picture: nobody steered it.
    pub longest_unsteered: Duration,
    /// How fast the camera turned at most meanwhile, °/s.
    pub fastest_deg_s: f64,
}

impl InView {
    /// Looks at the only person before a camera for so long.
    pub fn watch(camera: &VirtualCamera, time: Duration) -> Self {
        let (begin, size) = (camera.now(), camera.view_size());
        let (mut seen, mut looks, mut found) = (0u32, 0u32, Self::default());
        let (mut last_seen, mut last_steered) = (begin, begin);
        while camera.now() < begin + time {
            // The newest picture of which everything is known.
            let now = camera.now();
            let people = camera.ground_truth(now.saturating_sub(camera.video_delay()), size);
            if people.first().is_some_and(|person| person.in_view > 0.5) {
                (seen, last_seen) = (seen + 1, now);
            }
            looks += 1;
            found.longest_out = found.longest_out.max(now - last_seen);
            let status = camera.status();
            if status.moving || people.first().is_some_and(|person| is_in_middle(person, size)) {
                last_steered = now;
            }
            found.longest_unsteered = found.longest_unsteered.max(now - last_steered);
            let rate = status.pan_rate_deg_s.hypot(status.tilt_rate_deg_s);
            found.fastest_deg_s = found.fastest_deg_s.max(rate);
            thread::sleep(LOOK);
        }
        found.share = f64::from(seen) / f64::from(looks.max(1));
        found
    }
}

/// Where a camera may stand still: there is no reason to steer it.
fn is_in_middle(person: &GroundTruth, (width, _): (u32, u32)) -> bool {
    (person.centroid.0 / f64::from(width) - 0.5).abs() < 0.25
}
