// SPDX-License-Identifier: MPL-2.0

//! Light baked into the room: lamps and windows, and the darkness of corners and beneath things.

use super::{furniture::Piece, solid::Solid};
use crate::world::room::{
    light::Light,
    raster::{LightMap, Surface},
    view::{Vector, dot},
};

/// Metres between places at which the light is computed; a large surface has no more than so many along it.
const STEP: f64 = 0.15;
const STEPS: f64 = 240.0;

/// What bounds a place: the direction into it, and where along that it is.
pub(super) type Plane = (Vector, f64);

/// Lights all surfaces.
pub(super) fn light(light: &Light, planes: &[Plane], shell: &mut [Surface], pieces: &mut [Piece]) {
    let solids: Vec<Solid> = pieces.iter().map(|piece| piece.solid).collect();
    for surface in shell {
        surface.light = bake((light, planes), surface, &solids, None);
    }
    for (index, piece) in pieces.iter_mut().enumerate() {
        for surface in &mut piece.surfaces {
            surface.light = bake((light, planes), surface, &solids, Some(index));
        }
    }
}

fn bake(
    (light, planes): (&Light, &[Plane]),
    surface: &Surface,
    solids: &[Solid],
    own: Option<usize>,
) -> LightMap {
    let size = surface.outline.iter().fold((0.05f64, 0.05f64), |(w, h), &(u, v)| (w.max(u), h.max(v)));
    let normal = surface.normal();
    let (middle, radius) = (surface.point(size.0 / 2.0, size.1 / 2.0), size.0.hypot(size.1) / 2.0);
    let near: Vec<&Solid> = (0..solids.len())
        .filter(|&i| Some(i) != own && solids[i].distance(middle) < radius + 1.0)
        .map(|i| &solids[i])
        .collect();
    let step = STEP.max(size.0.max(size.1) / STEPS);
    LightMap::new(size, step, |u, v| {
        let point = surface.point(u, v);
        light.at(point, normal) * corners(planes, point, normal) * beneath(&near, point)
    })
}

/// Walls, floor and ceiling take light from each other where they meet.
fn corners(planes: &[Plane], point: Vector, normal: Vector) -> f64 {
    planes
        .iter()
        .filter(|(out, _)| dot(*out, normal) < 0.9)
        .map(|&(out, distance)| 1.0 - 0.25 * (-(dot(out, point) - distance).max(0.0) / 0.28).exp())
        .product()
}

/// Things darken what they stand on and lean against.
fn beneath(solids: &[&Solid], point: Vector) -> f64 {
    let shade = |solid: &&Solid| {
        // Light comes from above: little is lost over a thing, most at its foot.
        let above = (point[1] - solid.base[1] - solid.size[1]).max(0.0);
        1.0 - 0.4 * (-(solid.distance(point) + 3.0 * above) / 0.15).exp()
    };
    solids.iter().map(shade).product::<f64>().max(0.4)
}
