// SPDX-License-Identifier: MPL-2.0

//! A door in a partition, that opens and falls shut.

use super::{
    super::{furniture::Piece, solid::Finish, stuff::Painter},
    Moving, facing,
};
use crate::{
    seeded::Seeded,
    world::room::{
        event::Now,
        raster::Surface,
        view::{add, scale},
    },
};

/// Width and height of the leaf, in metres; how far it opens, in degrees.
const LEAF: (f64, f64) = (0.92, 2.05);
const OPEN_DEG: f64 = 82.0;
/// Above the floor, and in front of the partition, in metres.
const GAP: f64 = 0.01;

pub(in super::super) struct Door {
    /// Behind the leaf.
    opening: Surface,
    /// Shut.
    leaf: Surface,
    open: Now,
}

pub(super) fn things(painter: &Painter, seeded: &Seeded) -> Vec<(Piece, Option<Moving>)> {
    let mut chance = seeded.fork(1);
    let solid = facing(chance.range(-20.0, -14.0), chance.range(7.1, 7.5), [1.7, 2.5, 0.12]);
    let (along, out) = solid.axes();
    let finish = Finish::all(&painter.smooth([0.72, 0.7, 0.66]));
    let corner = solid.place(0.0, 0.0, 1.0);
    let corner = add(corner, add(scale(along, -LEAF.0 / 2.0), scale(out, GAP)));
    let upper = [corner[0], LEAF.1 + GAP, corner[2]];
    let down = [0.0, -1.0, 0.0];
    let leaf = painter.door([0.55, 0.33, 0.2], LEAF, chance.bits() % 1_000_000);
    let dark = painter.smooth([0.16, 0.15, 0.15]);
    let door = Door {
        opening: Surface::rectangle(upper, along, down, LEAF, &dark),
        leaf: Surface::rectangle(add(upper, scale(out, GAP)), along, down, LEAF, &leaf),
        open: Now::new(seeded.fork(2), 45.0, (1.5, 6.0), 1.3),
    };
    vec![(Piece { solid, surfaces: solid.surfaces(&finish) }, Some(Moving::Door(Box::new(door))))]
}

impl Door {
    pub fn surfaces(&self, resting: &[Surface], time: f64) -> Vec<Surface> {
        let (sin, cos) = (OPEN_DEG * self.open.at(time)).to_radians().sin_cos();
        // Turns about its left edge, towards the camera.
        let normal = self.leaf.normal();
        let u = add(scale(self.leaf.u, cos), scale(normal, sin));
        let leaf = Surface { u, ..self.leaf.clone() };
        resting.iter().cloned().chain([self.opening.clone(), leaf]).collect()
    }
}
