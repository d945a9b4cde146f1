// SPDX-License-Identifier: MPL-2.0

//! What a yard is made of: lawn, asphalt, house fronts, sky, trees.

use std::sync::Arc;

use super::{
    furniture::{Piece, leaf},
    paint::{detail, mix, paint, times},
    solid::{Finish, Solid},
    stuff::Painter,
};
use crate::{
    seeded::Seeded,
    world::room::{
        raster::{Material, Surface},
        view::{CAMERA, Vector, add, dot, subtract},
    },
};

/// Leaves of a tree.
const LEAVES: usize = 110;

impl Painter {
    /// Grass with bare and dry patches.
    pub fn lawn(&self) -> Arc<Material> {
        let grain = detail(&self.grains.cloth, 0.5, 0.5);
        Arc::new(paint(9, (7.0, 7.0), grain, |u, v| {
            let patch = 0.5 + 0.5 * self.noise.sum(u, v, (4, 4), 5);
            let grass = mix([0.20, 0.30, 0.12], [0.42, 0.42, 0.22], patch);
            times(grass, 1.0 + 0.25 * self.noise.sum(u, v, (64, 64), 3))
        }))
    }

    /// Asphalt, worn and patched.
    pub fn asphalt(&self) -> Arc<Material> {
        let grain = detail(&self.grains.plaster, 0.4, 0.3);
        Arc::new(paint(9, (6.0, 6.0), grain, |u, v| {
            let worn = self.noise.sum(u, v, (2, 8), 5);
            times([0.33, 0.33, 0.34], 1.0 + 0.16 * worn + 0.1 * self.noise.sum(u, v, (128, 128), 2))
        }))
    }

    /// The front of a house: three windows a storey on each tile.
    pub fn house_front(&self, wall: [f32; 3], night: bool, seeded: &mut Seeded) -> Arc<Material> {
        let lit = seeded.clone();
        let tall = seeded.range(0.26, 0.34);
        let grain = detail(&self.grains.plaster, 0.5, 0.16);
        Arc::new(paint(9, (9.0, 9.0), grain, |u, v| {
            let (column, row) = ((u * 3.0).floor(), (v * 3.0).floor());
            let (x, y) = ((u * 3.0).fract() - 0.5, (v * 3.0).fract() - 0.5);
            let plaster = times(wall, 1.0 + 0.05 * self.noise.sum(u, v, (4, 4), 6));
            let frame = (x.abs() - 0.19).max(y.abs() - tall);
            if frame > 0.0 {
                let sill = x.abs() < 0.23 && (0.0..0.03).contains(&(y - tall));
                return if sill { [0.7, 0.69, 0.66] } else { plaster };
            }
            if frame > -0.02 || x.abs() < 0.012 {
                return [0.82, 0.81, 0.78];
            }
            let mut window = lit.fork((row * 3.0 + column) as u64);
            let curtain = window.range(0.0, 0.6);
            let glass =
                mix([0.13, 0.16, 0.2], [0.5, 0.56, 0.62], f64::from(u8::from(y < curtain - 0.3)) * 0.8);
            if night && window.unit() < 0.25 { [0.95, 0.8, 0.5] } else { glass }
        }))
    }

    /// The sky all around, brightest at the horizon; `bright` is 1 by day.
    pub fn sky(&self, size: (f64, f64), bright: f64) -> Arc<Material> {
        let mut material = paint(9, size, None, |u, v| {
            let cloud = (1.6 * self.noise.sum(u, v, (8, 4), 6) + 0.3).clamp(0.0, 1.0);
            let blue = mix([0.36, 0.55, 0.85], [0.78, 0.86, 0.95], v);
            times(mix(blue, [0.94, 0.94, 0.95], cloud), bright)
        });
        material.glows = true;
        Arc::new(material)
    }

    /// Clipped evergreen.
    pub fn hedge(&self) -> Arc<Material> {
        let grain = detail(&self.grains.cloth, 0.6, 0.6);
        Arc::new(paint(9, (2.2, 2.2), grain, |u, v| {
            let leaves = self.noise.sum(u, v, (32, 32), 4);
            times([0.16, 0.26, 0.13], 1.0 + 0.6 * leaves)
        }))
    }

    /// A tree: its trunk, and its crown, whose leaves may move.
    pub fn tree(&self, at: Solid, seeded: &mut Seeded) -> [Piece; 2] {
        let [width, height, _] = at.size;
        let bark = Finish::all(&self.smooth([0.26, 0.2, 0.15]));
        let stem = 0.42 * height;
        let trunk = Solid { size: [0.07 * width + 0.08, stem, 0.07 * width + 0.08], ..at };
        let crown =
            Solid { base: add(at.base, [0.0, 0.3 * height, 0.0]), size: [width, 0.7 * height, width], ..at };
        let mut leaves: Vec<Surface> = (0..LEAVES)
            .map(|_| {
                let green = self.some_green(seeded);
                leaf(crown.base, (width, 0.7 * height), green, seeded)
            })
            .collect();
        leaves.sort_by(|one, other| far(other).total_cmp(&far(one)));
        [Piece { solid: trunk, surfaces: trunk.surfaces(&bark) }, Piece { solid: crown, surfaces: leaves }]
    }
}

/// The square of its distance from the camera.
fn far(surface: &Surface) -> f64 {
    let way: Vector = subtract(surface.origin, CAMERA);
    dot(way, way)
}
