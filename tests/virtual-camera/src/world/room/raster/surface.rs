// SPDX-License-Identifier: MPL-2.0

//! A flat piece of the room: where it is, what it is made of, how it is lit, and how it is drawn.

use std::sync::Arc;

use super::{brush::Brush, texture::Material};
use crate::world::room::view::{Canvas, Vector, View, add, cross, dot, scale};

/// Nothing nearer than this is drawn, in metres.
const NEAR: f64 = 0.05;
/// How far a piece reaches under a neighbour drawn later, in pixels, so that nothing shines through the joint.
const OVERLAP: f64 = 0.7;

/// Brightness over a surface: values at the crossings of a grid, even between them.
#[derive(Debug, Clone)]
pub(in super::super) struct LightMap {
    columns: usize,
    rows: usize,
    /// Meshes per metre.
    per_metre: (f64, f64),
    /// The brightness at the corners of every mesh: upper left and right, lower left and right.
    meshes: Vec<[f32; 4]>,
}

impl LightMap {
    /// Of a surface of `size` metres: `brightness` at places at most `step` metres apart.
    pub fn new(size: (f64, f64), step: f64, brightness: impl Fn(f64, f64) -> f64) -> Self {
        let count = |length: f64| ((length / step).ceil() as usize).max(1);
        let (columns, rows) = (count(size.0), count(size.1));
        let per_metre = (columns as f64 / size.0, rows as f64 / size.1);
        let crossing = |i: usize| {
            let (column, row) = (i % (columns + 1), i / (columns + 1));
            brightness(column as f64 / per_metre.0, row as f64 / per_metre.1) as f32
        };
        let crossings: Vec<f32> = (0..(columns + 1) * (rows + 1)).map(crossing).collect();
        let mesh = |i: usize| {
            let at = i / columns * (columns + 1) + i % columns;
            [at, at + 1, at + columns + 1, at + columns + 2].map(|at| crossings[at])
        };
        Self { columns, rows, per_metre, meshes: (0..columns * rows).map(mesh).collect() }
    }

    /// The same brightness all over.
    pub fn even(brightness: f64) -> Self {
        Self::new((1.0, 1.0), 1.0, |_, _| brightness)
    }

    /// At a place of the surface, in metres; beyond its edge as at the edge.
    pub fn at(&self, u: f64, v: f64) -> f32 {
        let split = |place: f64, count: usize| {
            let place = (place as f32).clamp(0.0, count as f32);
            let whole = (place as i32 as usize).min(count - 1);
            (whole, place - whole as f32)
        };
        let (column, right) = split(u * self.per_metre.0, self.columns);
        let (row, down) = split(v * self.per_metre.1, self.rows);
        let [a, b, c, d] = self.meshes[row * self.columns + column];
        let (above, below) = (a + (b - a) * right, c + (d - c) * right);
        above + (below - above) * down
    }
}

/// A convex flat piece. A place on it is (u, v), in metres from its origin along its two axes.
#[derive(Debug, Clone)]
pub(in super::super) struct Surface {
    /// Where (0, 0) lies.
    pub origin: Vector,
    /// Direction of u, of length 1.
    pub u: Vector,
    /// Direction of v, of length 1, square to u.
    pub v: Vector,
    /// Corners, in order.
    pub outline: Vec<(f64, f64)>,
    /// Which edges (from corner i to the next) another piece joins that is drawn later.
    pub joined: Vec<bool>,
    /// What it is made of.
    pub material: Arc<Material>,
    /// How it is lit.
    pub light: LightMap,
}

impl Surface {
    /// A rectangle, lit evenly and joined to nothing.
    pub fn rectangle(
        origin: Vector,
        u: Vector,
        v: Vector,
        size: (f64, f64),
        material: &Arc<Material>,
    ) -> Self {
        Self {
            origin,
            u,
            v,
            outline: vec![(0.0, 0.0), (size.0, 0.0), size, (0.0, size.1)],
            joined: vec![false; 4],
            material: material.clone(),
            light: LightMap::even(1.0),
        }
    }

    /// Where a place on it is in the room.
    pub fn point(&self, u: f64, v: f64) -> Vector {
        add(self.origin, add(scale(self.u, u), scale(self.v, v)))
    }

    /// Out of the surface, towards those who see u to the right and v down.
    pub fn normal(&self) -> Vector {
        cross(self.u, self.v)
    }

    /// Does a viewer see its front?
    pub fn faces(&self, viewer: Vector) -> bool {
        let way = [0, 1, 2].map(|axis| viewer[axis] - self.origin[axis]);
        dot(self.normal(), way) > 0.0
    }

    /// Its corners in a view, cut where they are behind the camera; nothing if it is out of sight.
    pub fn polygon(&self, view: &View) -> Vec<(f64, f64)> {
        polygon_in_view(&self.corners(view), view)
    }

    /// Corners in the room, a little further out where others join.
    fn corners(&self, view: &View) -> Vec<Vector> {
        let count = self.outline.len();
        let outward = |edge: usize| {
            let (a, b) = (self.outline[edge], self.outline[(edge + 1) % count]);
            let length = (b.0 - a.0).hypot(b.1 - a.1);
            ((b.1 - a.1) / length, (a.0 - b.0) / length)
        };
        let corner = |i: usize| {
            let (u, v) = self.outline[i];
            let depth = view.seen(self.point(u, v))[2].max(NEAR);
            let overlap = OVERLAP * depth / view.pinhole.focal;
            let meeting = [(i + count - 1) % count, i];
            let moves = meeting.into_iter().filter(|&edge| self.joined[edge]).map(outward);
            let (u, v) = moves.fold((u, v), |(u, v), way| (u + way.0 * overlap, v + way.1 * overlap));
            self.point(u, v)
        };
        (0..count).map(corner).collect()
    }

    /// Draws it over what is there.
    pub fn draw(&self, view: &View, canvas: &mut Canvas) {
        let polygon = self.polygon(view);
        if polygon.is_empty() {
            return;
        }
        let halved: Vec<_> = polygon.iter().map(|(x, y)| ((x - 0.5) / 2.0, (y - 0.5) / 2.0)).collect();
        let half = view.halved();
        let [luma, u, v] = &mut canvas.planes;
        Brush::new(self, view).luma(&polygon, view.size, luma);
        Brush::new(self, &half).chroma(&halved, half.size, [u, v]);
    }
}

/// Corners in the room as a polygon of a view, cut where they are behind the camera; nothing if it is out of sight.
fn polygon_in_view(corners: &[Vector], view: &View) -> Vec<(f64, f64)> {
    let seen: Vec<Vector> = corners.iter().map(|&corner| view.seen(corner)).collect();
    let mut polygon = Vec::with_capacity(seen.len() + 1);
    for (i, &a) in seen.iter().enumerate() {
        let b = seen[(i + 1) % seen.len()];
        if a[2] >= NEAR {
            polygon.push(view.project(a));
        }
        if (a[2] >= NEAR) != (b[2] >= NEAR) {
            let share = (NEAR - a[2]) / (b[2] - a[2]);
            let mut cut = [0, 1, 2].map(|axis| a[axis] + (b[axis] - a[axis]) * share);
            cut[2] = NEAR;
            polygon.push(view.project(cut));
        }
    }
    let (width, height) = (view.size.0 as f64, view.size.1 as f64);
    let beyond = |outside: fn(f64, f64) -> bool, x: f64, pick: fn(&(f64, f64)) -> f64| {
        polygon.iter().all(|corner| outside(pick(corner), x))
    };
    let out = beyond(|a, b| a < b, -1.0, |c| c.0)
        || beyond(|a, b| a > b, width, |c| c.0)
        || beyond(|a, b| a < b, -1.0, |c| c.1)
        || beyond(|a, b| a > b, height, |c| c.1);
    if out { Vec::new() } else { polygon }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_even_between_the_crossings() {
        let light = LightMap::new((4.0, 2.0), 0.5, |u, v| 0.1 * u + 0.2 * v);
        for (u, v, expected) in [(0.0, 0.0, 0.0), (1.3, 0.7, 0.27), (4.0, 2.0, 0.8), (9.0, -3.0, 0.4)] {
            assert!((light.at(u, v) - expected).abs() < 1e-5, "{}", light.at(u, v));
        }
    }
}
