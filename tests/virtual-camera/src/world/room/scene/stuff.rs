// SPDX-License-Identifier: MPL-2.0

//! What walls, floors and furniture are made of: tiles that repeat.

use std::sync::Arc;

use super::paint::{Colour, Grains, Noise, detail, hue, mix, paint, times};
use crate::{seeded::Seeded, world::room::raster::Material};

/// How a wall is finished.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wall {
    Plaster,
    Brick,
    BareBrick,
    Panels,
    Stripes,
}

/// Paints stuff of one room.
pub(super) struct Painter {
    pub seeded: Seeded,
    pub noise: Noise,
    pub grains: Grains,
    /// Furniture matches: there are few kinds of each.
    woods: Vec<(Colour, Arc<Material>)>,
    cloths: Vec<Arc<Material>>,
    paints: Vec<(Colour, Arc<Material>)>,
    greens: Vec<Arc<Material>>,
    /// What legs and frames are of.
    pub metal: Arc<Material>,
}

impl Painter {
    pub fn new(seeded: Seeded) -> Self {
        let (noise, grains) = (Noise::new(seeded.fork(1)), Grains::new(&seeded.fork(2)));
        let mut choice = seeded.fork(3);
        let metal = Self::smooth_with(&noise, &grains, [0.2, 0.19, 0.19]);
        let (woods, cloths, paints, greens) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut painter = Self { seeded, noise, grains, woods, cloths, paints, greens, metal };
        for _ in 0..3 {
            let wood = Self::wood_colour(&mut choice);
            painter.woods.push((wood, painter.wood(wood)));
            painter.cloths.push(painter.cloth(Self::any_colour(&mut choice)));
        }
        for _ in 0..6 {
            let paint = Self::any_colour(&mut choice);
            painter.paints.push((paint, painter.smooth(paint)));
        }
        for _ in 0..4 {
            let green = [choice.range(0.1, 0.3) as f32, choice.range(0.3, 0.5) as f32, 0.14];
            painter.greens.push(painter.smooth(green));
        }
        painter
    }

    /// Painted plaster: nearly plain.
    pub fn plaster(&self, colour: Colour) -> Arc<Material> {
        let grain = detail(&self.grains.plaster, 0.36, 0.1);
        Arc::new(paint(9, (2.9, 2.9), grain, |u, v| {
            times(colour, 1.0 + 0.018 * self.noise.sum(u, v, (4, 4), 6))
        }))
    }

    /// A wall of a colour.
    pub fn wall(&self, kind: Wall, colour: Colour) -> Arc<Material> {
        match kind {
            Wall::Plaster => self.plaster(colour),
            Wall::Brick => self.brick(colour, colour, 0.08),
            Wall::BareBrick => self.brick(colour, [0.66, 0.63, 0.58], 0.35),
            Wall::Panels => self.panels(colour),
            Wall::Stripes => self.stripes(colour),
        }
    }

    /// 8 by 24 bricks with `mortar` between them, under paint where it is of their colour; how much they differ in tone.
    fn brick(&self, colour: Colour, mortar: Colour, tones: f64) -> Arc<Material> {
        let grain = detail(&self.grains.plaster, 0.3, 0.22);
        Arc::new(paint(9, (2.0, 2.0), grain, |u, v| {
            let row = (v * 24.0).floor();
            let along = u * 8.0 + 0.5 * (row % 2.0);
            let (x, y) = (along.fract() * 250.0, (v * 24.0).fract() * 83.0);
            let edge = x.min(250.0 - x).min(y).min(83.0 - y);
            let tone = self.noise.at(along.floor() % 8.0 + 0.5, row + 0.5, (8, 32));
            let joint = 1.0 - ((edge - 4.0 - 2.0 * self.noise.sum(u, v, (64, 64), 2)) / 5.0).clamp(0.0, 1.0);
            let rough = self.noise.sum(u, v, (16, 16), 5);
            let brick = times(colour, 1.0 + tones * tone + 0.06 * rough);
            mix(brick, times(mortar, 0.78 + 0.06 * rough), joint)
        }))
    }

    /// Upright wooden panels.
    fn panels(&self, colour: Colour) -> Arc<Material> {
        let grain = detail(&self.grains.wood, 0.4, 0.14);
        Arc::new(paint(9, (2.4, 2.4), grain, |u, v| {
            let panel = (u * 4.0).floor();
            let x = (u * 4.0).fract() * 600.0;
            let groove = 1.0 - (x.min(600.0 - x) / 6.0 - 0.6).clamp(0.0, 1.0);
            let fibre = self.noise.sum(u + panel * 0.37, v, (32, 2), 4);
            let tone = self.noise.at(panel + 0.5, 3.5, (4, 8));
            times(colour, (1.0 + 0.05 * tone + 0.09 * fibre) * (1.0 - 0.5 * groove))
        }))
    }

    /// Wallpaper.
    fn stripes(&self, colour: Colour) -> Arc<Material> {
        let grain = detail(&self.grains.plaster, 0.25, 0.1);
        Arc::new(paint(9, (1.8, 1.8), grain, |u, v| {
            let stripe = ((u * 15.0).fract() - 0.5).abs() * 2.0;
            let band = ((stripe - 0.45) * 12.0).clamp(0.0, 1.0);
            times(colour, 1.0 - 0.07 * band + 0.012 * self.noise.sum(u, v, (8, 8), 5))
        }))
    }

    /// Stone tiles: 4 by 4 with joints.
    pub fn tiles(&self, colour: Colour, side: f64) -> Arc<Material> {
        let grain = detail(&self.grains.plaster, 0.4, 0.16);
        Arc::new(paint(9, (side * 4.0, side * 4.0), grain, |u, v| {
            let (x, y) = ((u * 4.0).fract(), (v * 4.0).fract());
            let edge = x.min(1.0 - x).min(y).min(1.0 - y) * side * 1000.0;
            let joint = 1.0 - ((edge - 2.0) / 3.0).clamp(0.0, 1.0);
            let tone = self.noise.at((u * 4.0).floor() + 0.5, (v * 4.0).floor() + 0.5, (4, 4));
            let veins = 1.0 - self.noise.sum(u, v, (8, 8), 4).abs() * 8.0;
            let cloud = self.noise.sum(u + 0.5 * tone, v, (8, 8), 6);
            times(colour, (1.0 + 0.05 * tone + 0.07 * cloud + 0.05 * veins.max(0.0)) * (1.0 - 0.35 * joint))
        }))
    }

    /// Square tiles of two colours by turns, `side` metres each: 4 by 4 of them.
    pub fn chequers(&self, colours: [Colour; 2], side: f64) -> Arc<Material> {
        let grain = detail(&self.grains.plaster, 0.4, 0.14);
        Arc::new(paint(9, (side * 4.0, side * 4.0), grain, |u, v| {
            let (column, row) = ((u * 4.0) as usize, (v * 4.0) as usize);
            let cloud = self.noise.sum(u + 0.3 * column as f64, v, (8, 8), 5);
            times(colours[(column + row) % 2], 1.0 + 0.06 * cloud)
        }))
    }

    /// Floor boards along u: 8 rows.
    pub fn boards(&self, colour: Colour) -> Arc<Material> {
        let grain = detail(&self.grains.wood, 0.35, 0.18);
        Arc::new(paint(9, (2.8, 1.1), grain, |u, v| {
            let row = (v * 8.0).floor();
            let along = u * 2.0 + 0.5 + 0.5 * self.noise.at(0.5, row + 0.5, (4, 8));
            let board = along.rem_euclid(2.0).floor();
            let (x, y) = (along.rem_euclid(1.0) * 1400.0, (v * 8.0).fract() * 137.0);
            let gap = 1.0 - (x.min(1400.0 - x).min(y).min(137.0 - y) / 3.5).clamp(0.0, 1.0);
            let tone = self.noise.at(board + 9.5, row + 0.5, (256, 8));
            let fibre = self.noise.sum(u + 0.31 * row, v, (4, 64), 2);
            let rings = (12.0 * self.noise.sum(u + 0.17 * row + 0.5 * board, v, (2, 8), 2)).sin();
            times(colour, (1.0 + 0.14 * tone + 0.08 * fibre + 0.05 * rings) * (1.0 - 0.5 * gap))
        }))
    }

    /// Carpet.
    pub fn carpet(&self, colour: Colour) -> Arc<Material> {
        let grain = detail(&self.grains.cloth, 0.22, 0.4);
        Arc::new(paint(9, (1.6, 1.6), grain, |u, v| {
            times(
                colour,
                1.0 + 0.06 * self.noise.sum(u, v, (4, 4), 3) + 0.16 * self.noise.sum(u, v, (128, 128), 2),
            )
        }))
    }

    /// Ceiling: 4 by 4 boards with holes.
    pub fn ceiling(&self) -> Arc<Material> {
        let grain = detail(&self.grains.plaster, 0.3, 0.12);
        Arc::new(paint(9, (2.4, 2.4), grain, |u, v| {
            let (x, y) = ((u * 4.0).fract() * 600.0, (v * 4.0).fract() * 600.0);
            let joint = 1.0 - ((x.min(600.0 - x).min(y).min(600.0 - y) - 4.0) / 6.0).clamp(0.0, 1.0);
            let hole = (self.noise.sum(u, v, (128, 128), 1) - 0.35).max(0.0);
            times([0.93, 0.93, 0.91], 1.0 - 0.22 * joint - 0.3 * hole)
        }))
    }

    /// One of the room's kinds of wood: its colour, and the wood itself.
    pub fn some_wood(&self, seeded: &mut Seeded) -> (Colour, Arc<Material>) {
        self.woods[seeded.below(self.woods.len())].clone()
    }

    /// One of the room's kinds of cloth.
    pub fn some_cloth(&self, seeded: &mut Seeded) -> Arc<Material> {
        self.cloths[seeded.below(self.cloths.len())].clone()
    }

    /// One of the room's paints: its colour, and something painted.
    pub fn some_paint(&self, seeded: &mut Seeded) -> (Colour, Arc<Material>) {
        self.paints[seeded.below(self.paints.len())].clone()
    }

    /// One of the room's leaves.
    pub fn some_green(&self, seeded: &mut Seeded) -> &Arc<Material> {
        &self.greens[seeded.below(self.greens.len())]
    }

    /// Wood for furniture, fibres along u.
    fn wood(&self, colour: Colour) -> Arc<Material> {
        let grain = detail(&self.grains.wood, 0.35, 0.2);
        Arc::new(paint(8, (1.3, 0.7), grain, |u, v| {
            let fibre = self.noise.sum(u, v, (2, 64), 3);
            let rings = (10.0 * self.noise.sum(u, v, (1, 8), 3)).sin();
            times(colour, 1.0 + 0.12 * fibre + 0.07 * rings)
        }))
    }

    /// Varnish, plastic, painted metal.
    pub fn smooth(&self, colour: Colour) -> Arc<Material> {
        Self::smooth_with(&self.noise, &self.grains, colour)
    }

    fn smooth_with(noise: &Noise, grains: &Grains, colour: Colour) -> Arc<Material> {
        let grain = detail(&grains.plaster, 0.3, 0.09);
        Arc::new(paint(7, (1.1, 1.1), grain, |u, v| times(colour, 1.0 + 0.03 * noise.sum(u, v, (2, 2), 6))))
    }

    /// Cloth with seams every 0.6 m.
    fn cloth(&self, colour: Colour) -> Arc<Material> {
        let grain = detail(&self.grains.cloth, 0.2, 0.32);
        Arc::new(paint(8, (1.2, 1.2), grain, |u, v| {
            let seam = ((u * 2.0).fract() - 0.5).abs() * 600.0;
            let crease = self.noise.sum(u, v, (4, 4), 5);
            times(colour, 1.0 + 0.1 * crease - 0.3 * (1.0 - seam / 5.0).max(0.0))
        }))
    }

    /// A colour for furniture or doors of wood.
    pub fn wood_colour(seeded: &mut Seeded) -> Colour {
        let dark = [0.28, 0.18, 0.12];
        let light = [0.72, 0.56, 0.38];
        mix(dark, light, seeded.unit())
    }

    /// A colour that may be strong.
    pub fn any_colour(seeded: &mut Seeded) -> Colour {
        hue(seeded.unit(), seeded.range(0.1, 0.62), seeded.range(0.25, 0.85))
    }
}
