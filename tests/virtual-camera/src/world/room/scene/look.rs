// SPDX-License-Identifier: MPL-2.0

//! What the walls, the floor and the doors of one hall are finished with.

use std::sync::Arc;

use super::{
    paint::{Colour, hue, times},
    stuff::{Painter, Wall},
    style::{Style, wall_colour},
};
use crate::{seeded::Seeded, world::room::raster::Material};

/// Finishes of one hall.
pub(super) struct Look {
    pub style: Style,
    pub floor: Arc<Material>,
    /// Back, left, right and front.
    pub walls: [Arc<Material>; 4],
    pub skirting: Arc<Material>,
    pub doors: Colour,
}

impl Look {
    pub fn new(style: Style, painter: &Painter, seeded: &mut Seeded) -> Self {
        let plain = painter.plaster(style.wall);
        let mut wall = |kinds: &[Wall]| match seeded.pick(kinds) {
            Wall::Plaster => plain.clone(),
            Wall::Panels => painter.wall(Wall::Panels, Painter::wood_colour(seeded)),
            Wall::BareBrick => painter.wall(Wall::BareBrick, brick_colour(seeded)),
            kind => painter.wall(kind, wall_colour(seeded)),
        };
        let (back, sides): (&[Wall], &[Wall]) = if style.full {
            (&[Wall::Plaster, Wall::BareBrick], &[Wall::BareBrick, Wall::Brick, Wall::Panels, Wall::Stripes])
        } else {
            (&[Wall::Plaster, Wall::Brick], &[Wall::Plaster, Wall::Brick, Wall::Panels, Wall::Stripes])
        };
        let walls = [wall(back), wall(sides), wall(sides), wall(&[Wall::Plaster])];
        let floor = Self::floor(&style, painter, seeded);
        let doors = if seeded.unit() < 0.5 { [0.85, 0.84, 0.8] } else { Painter::wood_colour(seeded) };
        Self { style, floor, walls, skirting: painter.smooth(times(doors, 0.9)), doors }
    }

    fn floor(style: &Style, painter: &Painter, seeded: &mut Seeded) -> Arc<Material> {
        match seeded.below(if style.full { 4 } else { 3 }) {
            0 => painter.tiles(stone_colour(seeded), seeded.range(0.4, 0.6)),
            1 => painter.boards(Painter::wood_colour(seeded)),
            2 => painter.carpet(hue(seeded.unit(), seeded.range(0.1, 0.4), seeded.range(0.35, 0.55))),
            _ => {
                let dark = times(stone_colour(seeded), seeded.range(0.3, 0.6));
                painter.chequers([stone_colour(seeded), dark], seeded.range(0.3, 0.5))
            }
        }
    }
}

fn stone_colour(seeded: &mut Seeded) -> Colour {
    hue(seeded.range(0.02, 0.15), seeded.range(0.03, 0.25), seeded.range(0.45, 0.75))
}

fn brick_colour(seeded: &mut Seeded) -> Colour {
    hue(seeded.range(0.0, 0.07), seeded.range(0.25, 0.6), seeded.range(0.4, 0.65))
}
