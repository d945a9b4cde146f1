// SPDX-License-Identifier: MPL-2.0

//! How far a map is off.

use handover::{Direction, Map, Place};
use virtual_camera::Pose;

/// Where the camera that turns hangs, in metres: right, up, ahead.
const PTZ: [f64; 3] = [0.0, 2.5, 0.0];
/// Half the widest view of either camera, and its height by its width.
const HALF_VIEW_DEG: f64 = 27.5;
const SHAPE: f64 = 0.75;

/// The median of the degrees by which the map is off on the floor that people walk on.
pub fn median_deg(map: &Map, stand: [f64; 3], pose: &Pose) -> Option<f64> {
    let floor = (0..200).map(|n| [f64::from(n % 20) * 0.42 - 4.0, f64::from(n / 20) * 0.22 + 4.8]);
    let mut errors: Vec<f64> = floor
        .filter_map(|[x, z]| {
            let aim = map.aim(place([x, 0.0, z], stand, pose)?)?;
            Some(aim.feet.angle_to_deg(direction([x, 0.0, z])))
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors.get(errors.len() / 2).copied()
}

fn direction(point: [f64; 3]) -> Direction {
    let [x, y, z] = [0, 1, 2].map(|axis| point[axis] - PTZ[axis]);
    Direction { pan_deg: x.atan2(z).to_degrees(), tilt_deg: y.atan2(x.hypot(z)).to_degrees() }
}

/// Where the camera that does not turn sees a place.
fn place(point: [f64; 3], stand: [f64; 3], pose: &Pose) -> Option<Place> {
    let [x, y, z] = [0, 1, 2].map(|axis| point[axis] - stand[axis]);
    let (sin, cos) = pose.pan_deg.to_radians().sin_cos();
    let (right, level) = (x * cos - z * sin, x * sin + z * cos);
    let (sin, cos) = pose.tilt_deg.to_radians().sin_cos();
    let (up, ahead) = (y * cos - level * sin, level * cos + y * sin);
    let half = HALF_VIEW_DEG.to_radians().tan();
    let (x, y) = (0.5 + right / ahead / half / 2.0, 0.5 - up / ahead / half / SHAPE / 2.0);
    (ahead > 0.0 && (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y)).then(|| Place::in_picture(x, y))
}
