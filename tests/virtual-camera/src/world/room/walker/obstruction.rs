// SPDX-License-Identifier: MPL-2.0

//! Where something must stand to hide the person, or the lower half of them, for as long as wanted.

use super::{
    super::{
        action::Action,
        scene::{Obstacle, Solid},
        settings::{Occlusion, RoomSettings},
        view::CAMERA,
    },
    Walker, body, cast,
    mesh::Detail,
    mover::Mover,
};
use crate::seeded::Seeded;

/// Seconds from when the person's middle passes the edge of the first view to when the hiding begins.
const AFTER_ENTRY: (f64, f64) = (3.1, 3.7);
/// Seconds for which all of the person is hidden, or their legs.
const HIDDEN: f64 = 1.0;
const LEGS_HIDDEN: f64 = 2.6;
/// Between two looks at the body, in seconds.
const STEP: f64 = 0.02;
/// How far from the camera it stands, as a part of the person's distance.
const NEARNESS: f64 = 0.76;

/// What must stand in the room for what people do in it.
pub(in super::super) fn obstacles(settings: &RoomSettings) -> Vec<(Obstacle, Solid)> {
    match settings.action {
        Action::Test => obstacle(&Walker::of_test(settings), settings).into_iter().collect(),
        _ => cast::seat(settings).map(sofa).into_iter().collect(),
    }
}

/// A sofa behind whoever sits down with their feet at a place of the floor, facing the camera.
fn sofa((x, z): (f64, f64)) -> (Obstacle, Solid) {
    let (azimuth, size) = (x.atan2(z), [1.7, 0.8, 0.85]);
    let away = x.hypot(z) + 0.12 + size[2] / 2.0;
    let base = [away * azimuth.sin(), 0.0, away * azimuth.cos()];
    (Obstacle::Sofa, Solid { base, size, yaw_deg: -azimuth.to_degrees() })
}

/// What must stand in the way of `walker`, if anything.
pub(super) fn obstacle(walker: &Walker, settings: &RoomSettings) -> Option<(Obstacle, Solid)> {
    let mut chance = Seeded::new(settings.seed).fork(0x0b57).fork(settings.way());
    let begins = walker.walk().entry() + chance.range(AFTER_ENTRY.0, AFTER_ENTRY.1);
    match settings.occlusion {
        Occlusion::None => None,
        Occlusion::Partial => Some((Obstacle::Furniture, lower(walker, begins))),
        Occlusion::Full => Some((Obstacle::Screen, whole(walker, begins))),
    }
}

/// The body's last part goes out of sight when it begins; as wide as it takes to hide all of it for so long.
fn whole(walker: &Walker, begins: f64) -> Solid {
    let seen: Vec<(f64, f64)> = (0..(3.0 * HIDDEN / STEP) as u32)
        .map(|step| azimuths(walker, begins - HIDDEN + f64::from(step) * STEP))
        .collect();
    let first = azimuths(walker, begins);
    let rightwards = azimuths(walker, begins + HIDDEN).0 > first.0;
    // Limbs swing, so that a wall's width does not tell for how long it hides: look for it.
    let span = |width: f64| if rightwards { (first.0, first.0 + width) } else { (first.1 - width, first.1) };
    let hides = |width: f64| {
        let (left, right) = span(width);
        seen.iter().filter(|body| body.0 >= left && body.1 <= right).count() as f64 * STEP
    };
    let (mut narrow, mut wide) = (0.0, 1.0);
    for _ in 0..16 {
        let middle = (narrow + wide) / 2.0;
        if hides(middle) < HIDDEN { narrow = middle } else { wide = middle }
    }
    spanning(span(wide), distance(walker, begins + HIDDEN / 2.0), [2.3, 0.3])
}

/// From one middle of the body to the other; the line of sight over its back edge meets the person below the hip.
fn lower(walker: &Walker, begins: f64) -> Solid {
    let middle = |time: f64| {
        let now = walker.walk().at(time);
        now.x.atan2(now.z)
    };
    let ends = [middle(begins), middle(begins + LEGS_HIDDEN)];
    let away = distance(walker, begins + LEGS_HIDDEN / 2.0);
    let (thickness, hidden) = (0.5, 0.47 * walker.build.height);
    let height = CAMERA[1] - (CAMERA[1] - hidden) * (NEARNESS + thickness / away);
    spanning((ends[0].min(ends[1]), ends[0].max(ends[1])), away, [height, thickness])
}

/// How far the person is from below the camera, in metres.
fn distance(walker: &Walker, time: f64) -> f64 {
    let now = walker.walk().at(time);
    now.x.hypot(now.z)
}

/// A box whose front covers the directions from `left` to `right`, before a person so far away.
fn spanning((left, right): (f64, f64), away: f64, [height, thickness]: [f64; 2]) -> Solid {
    let (middle, front) = ((left + right) / 2.0, NEARNESS * away);
    let centre = front + thickness / 2.0;
    Solid {
        base: [centre * middle.sin(), 0.0, centre * middle.cos()],
        size: [2.0 * front * ((right - left) / 2.0).tan(), height, thickness],
        yaw_deg: -middle.to_degrees(),
    }
}

/// Leftmost and rightmost direction in which the camera sees the body at a time.
pub(super) fn azimuths(walker: &Walker, time: f64) -> (f64, f64) {
    let detail = Detail { corners: 12, steps: 1 };
    let pose = walker.gait.pose(time);
    let patches = body::patches(&pose, &walker.build, &walker.outfit, detail);
    let directions =
        patches.iter().flat_map(|patch| &patch.vertices).map(|vertex| vertex.place[0].atan2(vertex.place[2]));
    directions.fold((f64::INFINITY, f64::NEG_INFINITY), |(left, right), direction| {
        (left.min(direction), right.max(direction))
    })
}
