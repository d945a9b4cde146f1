//! The hall: its walls, and where what stands.

use std::sync::Arc;

use super::{
    Obstacle,
    furniture::Piece,
    paint::{Colour, hue, times},
    solid::{DOWN, Finish, Solid},
    stuff::{Painter, Wall},
};
use crate::{
    seeded::Seeded,
    world::room::{
        light::Light,
        raster::{Material, Surface},
        view::{Vector, add, scale},
    },
};

/// A hall of upright walls; the camera hangs in it at x = z = 0.
pub(super) struct Hall {
    left: f64,
    right: f64,
    front: f64,
    back: f64,
    height: f64,
    pub light: Light,
}

/// A wall to put things at: its left upper corner as seen from inside, its direction, length and the yaw of what leans on it.
struct Place {
    corner: Vector,
    along: Vector,
    length: f64,
    yaw_deg: f64,
}

impl Hall {
    pub fn new(seeded: &mut Seeded) -> Self {
        let (left, right) = (-seeded.range(8.9, 9.7), seeded.range(8.9, 9.7));
        let (front, back, height) = (-seeded.range(1.8, 2.6), seeded.range(8.5, 9.4), seeded.range(3.1, 3.4));
        let rows = [0.2, 0.7].map(|share| front + share * (back - front));
        let lamps = [0.14, 0.38, 0.62, 0.86]
            .iter()
            .flat_map(|share| rows.map(|z| [left + share * (right - left), height - 0.01, z]))
            .collect();
        Self { left, right, front, back, height, light: Light { lamps, windows: Vec::new() } }
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
    pub fn furnish(&mut self, painter: &Painter, seeded: &mut Seeded) -> (Vec<Surface>, Vec<Piece>) {
        let look = Look::new(painter, seeded);
        let mut row = Row { painter, look: &look, hung: Vec::new(), pieces: Vec::new(), windows: Vec::new() };
        for (index, place) in self.places().iter().enumerate() {
            row.skirt(place);
            row.fill(place, if index == 3 { &PICTURES } else { &KINDS }, seeded);
        }
        let (hung, mut pieces, windows) = (row.hung, row.pieces, row.windows);
        for x in [self.left + 0.55, self.right - 0.55] {
            let base = [x, 0.0, self.back - seeded.range(0.5, 0.9)];
            let at = Solid { base, size: [0.7, seeded.range(1.1, 1.7), 0.7], yaw_deg: 0.0 };
            pieces.extend(painter.plant(at, seeded));
        }
        let mut shell = self.shell(&look, painter);
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
            (Obstacle::Screen, 0) => painter.screen(at, seeded),
            (Obstacle::Screen, _) => painter.pillar(at, &painter.wall(Wall::Plaster, wall_colour(seeded))),
        }
    }
}

/// Finishes of one hall.
struct Look {
    floor: Arc<Material>,
    walls: [Arc<Material>; 4],
    skirting: Arc<Material>,
    doors: Colour,
}

impl Look {
    fn new(painter: &Painter, seeded: &mut Seeded) -> Self {
        let floor = match seeded.below(3) {
            0 => painter.tiles(stone_colour(seeded), seeded.range(0.4, 0.6)),
            1 => painter.boards(Painter::wood_colour(seeded)),
            _ => painter.carpet(hue(seeded.unit(), seeded.range(0.1, 0.4), seeded.range(0.35, 0.55))),
        };
        let plain = painter.plaster(wall_colour(seeded));
        let kinds = [Wall::Plaster, Wall::Brick, Wall::Panels, Wall::Stripes];
        let mut wall = |kinds: &[Wall]| match seeded.pick(kinds) {
            Wall::Plaster => plain.clone(),
            Wall::Panels => painter.wall(Wall::Panels, Painter::wood_colour(seeded)),
            kind => painter.wall(kind, wall_colour(seeded)),
        };
        let walls = [wall(&kinds[..2]), wall(&kinds), wall(&kinds), wall(&kinds[..1])];
        let doors = if seeded.unit() < 0.5 { [0.85, 0.84, 0.8] } else { Painter::wood_colour(seeded) };
        Self { floor, walls, skirting: painter.smooth(times(doors, 0.9)), doors }
    }
}

fn wall_colour(seeded: &mut Seeded) -> Colour {
    hue(seeded.unit(), seeded.range(0.02, 0.14), seeded.range(0.68, 0.9))
}

fn stone_colour(seeded: &mut Seeded) -> Colour {
    hue(seeded.range(0.02, 0.15), seeded.range(0.03, 0.25), seeded.range(0.45, 0.75))
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

/// Fills walls from one end to the other.
struct Row<'a> {
    painter: &'a Painter,
    look: &'a Look,
    hung: Vec<Surface>,
    pieces: Vec<Piece>,
    windows: Vec<Vector>,
}

impl Row<'_> {
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
                along += width + seeded.range(0.12, 0.5);
            }
            last = kind;
        }
    }

    fn put(&mut self, kind: Kind, place: &Place, along: f64, width: f64, seeded: &mut Seeded) {
        let painter = self.painter;
        let label = seeded.bits() % 1_000_000;
        match kind {
            Kind::Nothing => {}
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
        self.hang(place, along, 2.4, size, &self.painter.window(size, label));
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
