// SPDX-License-Identifier: MPL-2.0

//! A plant whose leaves move in the draught.

use super::{
    super::{furniture::Piece, stuff::Painter},
    Moving, facing,
};
use crate::{
    seeded::Seeded,
    world::room::{
        raster::Surface,
        view::{add, cross, dot, scale},
    },
};

/// How far leaves swing, in radians.
const SWING: f64 = 0.28;

pub(in super::super) struct Plant {
    /// Of the leaves' swinging.
    phase: f64,
}

pub(super) fn things(painter: &Painter, seeded: &Seeded) -> Vec<(Piece, Option<Moving>)> {
    let mut chance = seeded.fork(1);
    let at = facing(chance.range(13.0, 19.0), chance.range(6.2, 7.2), [0.95, chance.range(1.4, 1.8), 0.95]);
    let pieces = painter.plant(at, &mut chance);
    let phase = chance.range(0.0, 6.0);
    pieces.into_iter().map(|piece| (piece, Some(Moving::Plant(Plant::new(phase))))).collect()
}

impl Plant {
    pub fn new(phase: f64) -> Self {
        Self { phase }
    }

    pub fn surfaces(&self, resting: &[Surface], time: f64) -> Vec<Surface> {
        // The draught comes and goes.
        let gust = 0.35 + 0.65 * (0.5 + 0.5 * (0.23 * time + self.phase).sin()).powi(2);
        resting.iter().enumerate().map(|(index, leaf)| self.swung(leaf, index, gust, time)).collect()
    }

    fn swung(&self, leaf: &Surface, index: usize, gust: f64, time: f64) -> Surface {
        // Pots are boxes; leaves are pointed.
        if leaf.joined.iter().any(|joined| *joined)
            || leaf.outline.get(1).is_some_and(|corner| corner.1 == 0.0)
        {
            return leaf.clone();
        }
        let own = self.phase + 1.7 * index as f64;
        let angle = SWING * gust * ((5.2 + 0.13 * index as f64) * time + own).sin();
        let (sin, cos) = angle.sin_cos();
        let normal = leaf.normal();
        let u = add(scale(leaf.u, cos), scale(normal, sin));
        let v = cross(normal, leaf.u);
        // Whichever way round the leaf is laid.
        let v = if dot(v, leaf.v) < 0.0 { scale(v, -1.0) } else { v };
        Surface { u, v, ..leaf.clone() }
    }
}
