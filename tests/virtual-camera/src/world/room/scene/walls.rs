// SPDX-License-Identifier: MPL-2.0

//! What stands along the walls and hangs on them.

use std::sync::Arc;

use super::{
    furniture::Piece,
    look::Look,
    solid::{DOWN, Finish, Solid},
    stuff::Painter,
};
use crate::{
    seeded::Seeded,
    world::room::{
        raster::{Material, Surface},
        view::{Vector, add, scale},
    },
};

/// A wall to put things at: its left upper corner as seen from inside, its direction, length and the yaw of what leans on it.
pub(super) struct Place {
    pub corner: Vector,
    pub along: Vector,
    pub length: f64,
    pub yaw_deg: f64,
}

/// What a stretch of a wall is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Poster,
    Nothing,
    Door,
    Window,
    Notices,
    Books,
    Sideboard,
    Sofa,
    Lockers,
    Table,
}

const PICTURES: [Kind; 3] = [Kind::Poster, Kind::Nothing, Kind::Door];
const KINDS: [Kind; 12] = [
    Kind::Poster,
    Kind::Poster,
    Kind::Nothing,
    Kind::Door,
    Kind::Window,
    Kind::Window,
    Kind::Notices,
    Kind::Books,
    Kind::Sideboard,
    Kind::Sofa,
    Kind::Lockers,
    Kind::Table,
];

/// What stands along and hangs on the walls of a full room.
const FULL: [Kind; 12] = [
    Kind::Poster,
    Kind::Poster,
    Kind::Poster,
    Kind::Door,
    Kind::Window,
    Kind::Notices,
    Kind::Books,
    Kind::Books,
    Kind::Books,
    Kind::Sideboard,
    Kind::Lockers,
    Kind::Table,
];

/// Walls, filled from one end to the other.
pub(super) struct Walls<'a> {
    painter: &'a Painter,
    look: &'a Look,
    pub hung: Vec<Surface>,
    pub pieces: Vec<Piece>,
    /// Middles of the windows.
    pub windows: Vec<Vector>,
}

impl<'a> Walls<'a> {
    /// What stands along and hangs on the back, left, right and front wall.
    pub fn furnished(places: &[Place; 4], look: &'a Look, painter: &'a Painter, seeded: &mut Seeded) -> Self {
        let mut walls = Self { painter, look, hung: Vec::new(), pieces: Vec::new(), windows: Vec::new() };
        let kinds: &[Kind] = if look.style.full { &FULL } else { &KINDS };
        for (index, place) in places.iter().enumerate() {
            walls.skirt(place);
            walls.fill(place, if index == 3 { &PICTURES } else { kinds }, seeded);
        }
        walls
    }

    fn fill(&mut self, place: &Place, kinds: &[Kind], seeded: &mut Seeded) {
        let mut along = seeded.range(0.5, 1.2);
        let mut last = Kind::Nothing;
        loop {
            let kind = seeded.pick(kinds);
            let width = match kind {
                Kind::Poster => seeded.range(0.5, 1.0),
                Kind::Nothing => seeded.range(0.4, 1.1),
                Kind::Door => 1.0,
                Kind::Window => seeded.range(1.3, 2.2),
                Kind::Notices => seeded.range(1.2, 1.9),
                Kind::Books | Kind::Lockers => 0.4 * (3 + seeded.below(3)) as f64,
                Kind::Sideboard | Kind::Table => seeded.range(1.2, 1.8),
                Kind::Sofa => seeded.range(1.6, 2.2),
            };
            if along + width > place.length - 0.4 {
                return;
            }
            if kind != last {
                self.put(kind, place, along, width, seeded);
                along += width
                    + if self.look.style.full { seeded.range(0.03, 0.2) } else { seeded.range(0.12, 0.5) };
            }
            last = kind;
        }
    }

    fn put(&mut self, kind: Kind, place: &Place, along: f64, width: f64, seeded: &mut Seeded) {
        let painter = self.painter;
        let label = seeded.bits() % 1_000_000;
        match kind {
            Kind::Nothing => {}
            Kind::Poster if self.look.style.full => {
                // As high as a body's middle, and one above.
                self.poster(place, along, width, seeded.range(0.85, 1.2), label);
                self.poster(place, along, 0.8 * width, seeded.range(2.1, 2.3), label / 2);
            }
            Kind::Poster => self.poster(place, along, width, seeded.range(1.5, 1.75), label),
            Kind::Door => {
                let size = (width, 2.12);
                self.hang(place, along, 2.12, size, &painter.door(self.look.doors, size, label));
            }
            Kind::Window => self.window(place, along, width, label),
            Kind::Notices => {
                let size = (width, 1.1);
                self.hang(place, along, 2.1, size, &painter.notice_board(size, label));
            }
            Kind::Books => {
                self.pieces.extend(painter.bookcase(stand(place, along, [width, 1.95, 0.35]), seeded))
            }
            Kind::Lockers => {
                self.pieces.extend(painter.lockers(stand(place, along, [width, 1.9, 0.5]), seeded))
            }
            Kind::Table => {
                self.pieces.extend(painter.table(stand(place, along, [width, 0.74, 0.65]), seeded))
            }
            Kind::Sofa => self.pieces.extend(painter.sofa(stand(place, along, [width, 0.8, 0.85]), seeded)),
            Kind::Sideboard => {
                let height = seeded.range(0.75, 0.95);
                self.pieces.extend(painter.sideboard(stand(place, along, [width, height, 0.45]), seeded));
            }
        }
        if matches!(kind, Kind::Table | Kind::Sofa | Kind::Sideboard) && seeded.unit() < 0.75 {
            let narrow = width * seeded.range(0.4, 0.6);
            self.poster(place, along + (width - narrow) / 2.0, narrow, seeded.range(1.7, 1.9), label);
        }
    }

    fn poster(&mut self, place: &Place, along: f64, width: f64, middle: f64, label: u64) {
        let size = (width, width * (0.7 + 0.7 * ((label % 100) as f64 / 100.0)));
        let poster = self.painter.poster(size, label);
        self.hang(place, along, middle + size.1 / 2.0, size, &poster);
    }

    fn window(&mut self, place: &Place, along: f64, width: f64, label: u64) {
        let size = (width, 1.45);
        let pane = self.painter.window(size, label, self.look.style.night);
        self.hang(place, along, 2.4, size, &pane);
        let low = stand(place, along - 0.05, [width + 0.1, 0.04, 0.18]);
        let raised = Solid { base: add(low.base, [0.0, 0.9, 0.0]), ..low };
        let white = Finish::all(&self.look.skirting);
        self.pieces.push(Piece { solid: raised, surfaces: raised.surfaces(&white) });
        self.windows.push(add(
            add(place.corner, scale(place.along, along + width / 2.0)),
            scale(DOWN, place.corner[1] - 1.7),
        ));
    }

    /// A flat thing on a wall, its upper edge at a height.
    fn hang(&mut self, place: &Place, along: f64, top: f64, size: (f64, f64), material: &Arc<Material>) {
        let corner = add(place.corner, scale(place.along, along));
        let origin = [corner[0], top, corner[2]];
        self.hung.push(Surface::rectangle(origin, place.along, DOWN, size, material));
    }

    fn skirt(&mut self, place: &Place) {
        let skirting = self.look.skirting.clone();
        self.hang(place, 0.0, 0.1, (place.length, 0.1), &skirting);
    }
}

/// A box of `size` on the floor with its back to a wall.
fn stand(place: &Place, along: f64, size: Vector) -> Solid {
    let (sin, cos) = place.yaw_deg.to_radians().sin_cos();
    let middle = add(place.corner, scale(place.along, along + size[0] / 2.0));
    let out = size[2] / 2.0 + 0.02;
    Solid { base: [middle[0] + sin * out, 0.0, middle[2] - cos * out], size, yaw_deg: place.yaw_deg }
}
