// SPDX-License-Identifier: MPL-2.0

//! What stands free on the floor, behind the person's way and before it.

use super::{furniture::Piece, solid::Solid, stuff::Painter};
use crate::{
    seeded::Seeded,
    world::room::view::{CAMERA, Vector},
};

/// The nearest and the farthest that somebody walks, ahead of the camera, with some room to both sides, in metres.
const WAY: (f64, f64) = (4.7, 7.4);
/// Nothing stands nearer than this ahead of the camera, in metres.
const NEAREST: f64 = 1.5;
/// From side to side, in metres.
const WIDTH: (f64, f64) = (-7.6, 7.6);
/// How far people keep from things, in metres.
const BERTH: f64 = 0.45;
/// Places that are tried, before the way and behind it.
const TRIES: (usize, usize) = (9, 22);

/// How far ahead of the camera something so high may reach so that it hides nobody on the way: the line of sight over its
/// top meets the floor before them.
fn farthest_before(height: f64) -> f64 {
    WAY.0 * (CAMERA[1] - height) / CAMERA[1]
}

/// Fills the floor of a hall that is so deep with tables, chairs and plants, wherever there is room and nobody treads.
pub(super) fn fill(
    back: f64,
    trodden: &[Vector],
    painter: &Painter,
    seeded: &mut Seeded,
    pieces: &mut Vec<Piece>,
) {
    for number in 0..TRIES.0 + TRIES.1 {
        let before = number < TRIES.0;
        // Plants are high: none of them before the way.
        let kind = seeded.below(if before { 2 } else { 3 });
        let yaw_deg = seeded.range(-180.0, 180.0);
        let size = match kind {
            0 => [seeded.range(0.9, 1.5), 0.74, seeded.range(0.6, 0.8)],
            1 => [0.44, seeded.range(0.8, 0.92), 0.44],
            _ => [seeded.range(0.6, 0.9), seeded.range(1.0, 1.8), 0.7],
        };
        let round = size[0].hypot(size[2]) / 2.0;
        let (near, far) = if before { (NEAREST, farthest_before(size[1])) } else { (WAY.1, back - 0.3) };
        if far - near < 2.0 * round {
            continue;
        }
        let z = seeded.range(near + round, far - round);
        let x = seeded.range(WIDTH.0, WIDTH.1);
        let at = Solid { base: [x, 0.0, z], size, yaw_deg };
        let is_trodden = trodden.iter().any(|feet| at.distance(*feet) < BERTH);
        if is_trodden || pieces.iter().any(|piece| piece.solid.distance(at.base) < round + 0.05) {
            continue;
        }
        pieces.extend(match kind {
            0 => painter.table(at, seeded),
            1 => painter.chair(at, seeded),
            _ => painter.plant(at, seeded),
        });
    }
}

/// Puts up standing lamps along the back of a hall, and says where their light comes from.
pub(super) fn lamps(
    back: f64,
    painter: &Painter,
    seeded: &mut Seeded,
    pieces: &mut Vec<Piece>,
) -> Vec<Vector> {
    let mut lights = Vec::new();
    for place in 0..4 {
        let x = -6.0 + 4.0 * f64::from(place) + seeded.range(-1.2, 1.2);
        let size = [0.4, seeded.range(1.45, 1.75), 0.4];
        // Out of the way of what leans on the wall.
        let z = back - 1.1;
        let at = Solid { base: [x, 0.0, z], size, yaw_deg: seeded.range(0.0, 90.0) };
        pieces.extend(painter.standing_lamp(at));
        lights.push([x, size[1] - 0.15, z]);
    }
    lights
}
