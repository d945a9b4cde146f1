// SPDX-License-Identifier: MPL-2.0

//! The hall: how large it is, its walls, floor and ceiling, and its light.

use super::{
    Obstacle,
    furniture::Piece,
    look::Look,
    solid::{DOWN, Solid},
    standing,
    stuff::{Painter, Wall},
    style::Style,
    walls::{Place, Walls},
};
use crate::{
    seeded::Seeded,
    world::room::{
        light::{Light, Strength},
        raster::Surface,
        view::Vector,
    },
};

/// A hall of upright walls; the camera hangs in it at x = z = 0.
pub(super) struct Hall {
    left: f64,
    right: f64,
    front: f64,
    back: f64,
    height: f64,
    style: Style,
    pub light: Light,
}

impl Hall {
    pub fn new(style: Style, seeded: &mut Seeded) -> Self {
        let (left, right) = (-seeded.range(8.9, 9.7), seeded.range(8.9, 9.7));
        let (front, back, height) = (-seeded.range(1.8, 2.6), seeded.range(8.5, 9.4), seeded.range(3.1, 3.4));
        let rows = [0.2, 0.7].map(|share| front + share * (back - front));
        let strength = if style.night { Strength::NIGHT } else { Strength::DAY };
        let lamps = if style.night { Vec::new() } else { [0.14, 0.38, 0.62, 0.86].to_vec() };
        let lamps =
            lamps.iter().flat_map(|share| rows.map(|z| [left + share * (right - left), height - 0.01, z]));
        let light = Light { lamps: lamps.collect(), ..Light::even(strength) };
        Self { left, right, front, back, height, style, light }
    }

    /// Floor, ceiling and walls: the direction into the room, and where along it they are.
    pub fn planes(&self) -> [(Vector, f64); 6] {
        [
            ([0.0, 1.0, 0.0], 0.0),
            ([0.0, -1.0, 0.0], -self.height),
            ([1.0, 0.0, 0.0], self.left),
            ([-1.0, 0.0, 0.0], -self.right),
            ([0.0, 0.0, 1.0], self.front),
            ([0.0, 0.0, -1.0], -self.back),
        ]
    }

    /// Back, left, right and front wall.
    fn places(&self) -> [Place; 4] {
        let (width, depth) = (self.right - self.left, self.back - self.front);
        let place =
            |x, z, along, length, yaw_deg| Place { corner: [x, self.height, z], along, length, yaw_deg };
        [
            place(self.left, self.back, [1.0, 0.0, 0.0], width, 0.0),
            place(self.left, self.front, [0.0, 0.0, 1.0], depth, 90.0),
            place(self.right, self.back, [0.0, 0.0, -1.0], depth, -90.0),
            place(self.right, self.front, [-1.0, 0.0, 0.0], width, 180.0),
        ]
    }

    /// Everything in the hall: walls and what hangs on them in the order of drawing, and what stands there.
    /// People tread on the floor at `trodden`.
    pub fn furnish(
        &mut self,
        trodden: &[Vector],
        painter: &Painter,
        seeded: &mut Seeded,
    ) -> (Vec<Surface>, Vec<Piece>) {
        let look = Look::new(self.style, painter, seeded);
        let Walls { hung, mut pieces, windows, .. } =
            Walls::furnished(&self.places(), &look, painter, seeded);
        for x in [self.left + 0.55, self.right - 0.55] {
            let base = [x, 0.0, self.back - seeded.range(0.5, 0.9)];
            let at = Solid { base, size: [0.7, seeded.range(1.1, 1.7), 0.7], yaw_deg: 0.0 };
            pieces.extend(painter.plant(at, seeded));
        }
        let mut shell = self.shell(&look, painter);
        if self.style.night {
            self.light.lamps = standing::lamps(self.back, painter, seeded, &mut pieces);
        }
        if self.style.full {
            standing::fill(self.back, trodden, painter, seeded, &mut pieces);
        }
        shell.extend(hung);
        self.light.windows = windows;
        (shell, pieces)
    }

    /// Floor, ceiling with its lamps, and walls; each joined to what is drawn later.
    fn shell(&self, look: &Look, painter: &Painter) -> Vec<Surface> {
        let (width, depth) = (self.right - self.left, self.back - self.front);
        let (right, ahead, back) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
        let flat = |y, z, v, material| {
            let mut surface = Surface::rectangle([self.left, y, z], right, v, (width, depth), material);
            surface.joined = vec![true; 4];
            surface
        };
        let mut shell = vec![
            flat(0.0, self.back, back, &look.floor),
            flat(self.height, self.front, ahead, &painter.ceiling()),
        ];
        let lamp = painter.lamp();
        for &[x, y, z] in &self.light.lamps {
            shell.push(Surface::rectangle([x - 0.6, y, z - 0.15], right, ahead, (1.2, 0.3), &lamp));
        }
        // The two between the others first: their ends go on beneath those.
        for index in [0, 3, 1, 2] {
            let place = &self.places()[index];
            let size = (place.length, self.height);
            let mut wall = Surface::rectangle(place.corner, place.along, DOWN, size, &look.walls[index]);
            let below = index == 0 || index == 3;
            wall.joined = vec![false, below, false, below];
            shell.push(wall);
        }
        shell
    }

    /// What a box in the way is made of.
    pub fn obstacle(&self, kind: Obstacle, at: Solid, painter: &Painter, seeded: &mut Seeded) -> Vec<Piece> {
        match (kind, seeded.below(3)) {
            (Obstacle::Furniture, 0) => painter.sideboard(at, seeded),
            (Obstacle::Furniture, 1) => painter.sofa(at, seeded),
            (Obstacle::Furniture, _) => painter.counter(at, seeded),
            (Obstacle::Sofa, _) => painter.sofa(at, seeded),
            (Obstacle::Screen, 0) => painter.screen(at, seeded),
            (Obstacle::Screen, _) => painter.pillar(at, &painter.wall(Wall::Plaster, self.style.wall)),
        }
    }
}
