// SPDX-License-Identifier: MPL-2.0

//! What stands in the room, made of boxes and leaves.

use std::sync::Arc;

use super::{
    solid::{DOWN, Finish, Solid},
    stuff::Painter,
};
use crate::{
    seeded::Seeded,
    world::room::{
        raster::{Material, Surface},
        view::{CAMERA, Vector, add, cross, dot, scale, subtract},
    },
};

/// Something that is drawn as a whole: its room, and what of it can be seen.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub solid: Solid,
    pub surfaces: Vec<Surface>,
}

impl Piece {
    fn new(solid: Solid, finish: &Finish) -> Self {
        Self { solid, surfaces: solid.surfaces(finish) }
    }
}

/// Puts boxes together, in measures of one piece of furniture that stands at `at`.
struct Joiner {
    at: Solid,
    pieces: Vec<Piece>,
}

impl Joiner {
    fn new(at: Solid) -> Self {
        Self { at, pieces: Vec::new() }
    }

    /// A box: middle of its bottom from the left front lower corner's middle (right, up, back), and its size.
    fn add(&mut self, right: f64, up: f64, back: f64, size: Vector, finish: &Finish) -> Solid {
        let (width, ahead) = self.at.axes();
        let front = self.at.size[2] / 2.0 - back;
        let flat = add(scale(width, right), scale(ahead, front));
        let solid =
            Solid { base: add(self.at.base, add(flat, [0.0, up, 0.0])), size, yaw_deg: self.at.yaw_deg };
        self.pieces.push(Piece::new(solid, finish));
        solid
    }
}

impl Painter {
    /// A cupboard with doors or drawers, and things on it.
    pub fn sideboard(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let [w, h, d] = at.size;
        let (colour, wood) = self.some_wood(seeded);
        let cells = ((w / 0.5).round().max(1.0) as usize, 1 + seeded.below(3));
        let front = self.front(colour, (w, h - 0.1), cells, false);
        let body = Finish { sides: wood.clone(), top: wood.clone(), front };
        let mut joiner = Joiner::new(at);
        let dark = self.smooth([0.12, 0.11, 0.1]);
        joiner.add(0.0, 0.0, d / 2.0 + 0.02, [w - 0.06, 0.06, d - 0.06], &Finish::all(&dark));
        joiner.add(0.0, 0.06, d / 2.0, [w, h - 0.09, d], &body);
        joiner.add(0.0, h - 0.03, d / 2.0, [w + 0.04, 0.03, d + 0.02], &Finish::all(&wood));
        for share in [-0.33, 0.0, 0.33] {
            if seeded.unit() < 0.6 && d < 0.7 {
                let (_, stuff) = self.some_paint(seeded);
                let size = [seeded.range(0.1, 0.35), seeded.range(0.08, 0.35), seeded.range(0.1, 0.25)];
                joiner.add(share * w, h, d / 2.0, size, &Finish::all(&stuff));
            }
        }
        joiner.pieces
    }

    /// A sofa with cushions.
    pub fn sofa(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let [w, h, d] = at.size;
        let cloth = Finish::all(&self.some_cloth(seeded));
        let mut joiner = Joiner::new(at);
        let seat = 0.42 * h / 0.8;
        joiner.add(0.0, 0.06, d / 2.0, [w - 0.36, seat - 0.18, d], &cloth);
        let seats = (w / 0.8).round().max(1.0);
        let each = (w - 0.4) / seats;
        for i in 0..seats as usize {
            let right = (i as f64 + 0.5) * each - (w - 0.4) / 2.0;
            joiner.add(right, seat - 0.12, (d - 0.2) / 2.0, [each - 0.015, 0.13, d - 0.2], &cloth);
            joiner.add(right, seat, d - 0.26, [each - 0.03, 0.8 * (h - seat), 0.14], &cloth);
        }
        joiner.add(0.0, 0.06, d - 0.1, [w - 0.36, h - 0.06, 0.2], &cloth);
        for side in [-1.0, 1.0] {
            joiner.add(side * (w / 2.0 - 0.09), 0.0, d / 2.0, [0.18, 0.75 * h, d], &cloth);
        }
        if seeded.unit() < 0.8 {
            let cushion = Finish::all(&self.some_cloth(seeded));
            joiner.add(seeded.range(-0.3, 0.3) * w, seat + 0.02, d - 0.42, [0.42, 0.36, 0.12], &cushion);
        }
        joiner.pieces
    }

    /// Shelves with books.
    pub fn bookcase(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let (colour, wood) = self.some_wood(seeded);
        let front = self.books(colour, (at.size[0], at.size[1]), seeded.bits() % 1000);
        vec![Piece::new(at, &Finish { sides: wood.clone(), top: wood, front })]
    }

    /// A row of lockers.
    pub fn lockers(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let (colour, metal) = self.some_paint(seeded);
        let columns = (at.size[0] / 0.4).round().max(1.0) as usize;
        let front = self.front(colour, (at.size[0], at.size[1]), (columns, 1 + seeded.below(2)), true);
        vec![Piece::new(at, &Finish { sides: metal.clone(), top: metal, front })]
    }

    /// A table or bench: a board on legs.
    pub fn table(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let [w, h, d] = at.size;
        let top = Finish::all(&self.some_wood(seeded).1);
        let leg = Finish::all(&self.metal);
        let mut joiner = Joiner::new(at);
        joiner.add(0.0, h - 0.04, d / 2.0, [w, 0.04, d], &top);
        for (right, back) in [(-1.0, 0.05), (1.0, 0.05), (-1.0, d - 0.05), (1.0, d - 0.05)] {
            joiner.add(right * (w / 2.0 - 0.06), 0.0, back, [0.05, h - 0.04, 0.05], &leg);
        }
        joiner.pieces
    }

    /// A chair: legs, seat and back; it faces where its front does.
    pub fn chair(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let [w, h, d] = at.size;
        let frame = Finish::all(&self.metal);
        let (_, wood) = self.some_wood(seeded);
        let seat = Finish::all(&if seeded.unit() < 0.5 { self.some_cloth(seeded) } else { wood });
        let mut joiner = Joiner::new(at);
        for (right, back) in [(-1.0, 0.03), (1.0, 0.03), (-1.0, d - 0.03), (1.0, d - 0.03)] {
            joiner.add(right * (w / 2.0 - 0.03), 0.0, back, [0.035, 0.47 * h, 0.035], &frame);
        }
        joiner.add(0.0, 0.47 * h, d / 2.0, [w, 0.05, d], &seat);
        joiner.add(0.0, 0.6 * h, d - 0.03, [w, 0.4 * h, 0.04], &seat);
        joiner.pieces
    }

    /// A standing lamp that is on: its pole, and its shade on top.
    pub fn standing_lamp(&self, at: Solid) -> Vec<Piece> {
        let [w, h, d] = at.size;
        let pole = Finish::all(&self.metal);
        let shade = Finish::all(&self.lampshade((w, 0.3)));
        let mut joiner = Joiner::new(at);
        joiner.add(0.0, 0.0, d / 2.0, [0.04, h - 0.3, 0.04], &pole);
        joiner.add(0.0, h - 0.3, d / 2.0, [w, 0.3, d], &shade);
        joiner.pieces
    }

    /// A counter as in a reception.
    pub fn counter(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let [w, h, d] = at.size;
        let (colour, wood) = self.some_wood(seeded);
        let front = self.front(colour, (w, h), ((w / 0.6).round().max(1.0) as usize, 1), false);
        let body = Finish { sides: wood.clone(), top: wood, front };
        let mut joiner = Joiner::new(at);
        joiner.add(0.0, 0.0, d / 2.0, [w - 0.08, h - 0.05, d - 0.06], &body);
        joiner.add(0.0, h - 0.05, d / 2.0, [w, 0.05, d], &Finish::all(&self.smooth([0.8, 0.79, 0.77])));
        joiner.add(-0.2 * w, h, d / 2.0, [0.3, 0.02, 0.22], &Finish::all(&self.smooth([0.92, 0.92, 0.9])));
        joiner.pieces
    }

    /// A folding screen: leaves at angles to each other.
    pub fn screen(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let [w, h, d] = at.size;
        let leaves = (w / 0.55).round().max(2.0);
        let each = w / leaves;
        let tilt_deg = (d / each).min(0.5).atan().to_degrees();
        let cloth = self.some_cloth(seeded);
        let (_, frame) = self.some_wood(seeded);
        let finish = Finish { sides: frame.clone(), top: frame, front: cloth };
        let (width, _) = at.axes();
        let leaf = |i: usize| {
            let right = (i as f64 + 0.5) * each - w / 2.0;
            let turn = if i.is_multiple_of(2) { tilt_deg } else { -tilt_deg };
            let size = [each / tilt_deg.to_radians().cos() + 0.02, h, 0.03];
            Solid { base: add(at.base, scale(width, right)), size, yaw_deg: at.yaw_deg + turn }
        };
        (0..leaves as usize).map(|i| Piece::new(leaf(i), &finish)).collect()
    }

    /// A pillar as thick as the box it is given.
    pub fn pillar(&self, at: Solid, stone: &Arc<Material>) -> Vec<Piece> {
        let mut joiner = Joiner::new(at);
        let [w, h, d] = at.size;
        let foot = self.smooth([0.35, 0.34, 0.33]);
        joiner.add(0.0, 0.0, d / 2.0, [w + 0.02, 0.12, d + 0.02], &Finish::all(&foot));
        joiner.add(0.0, 0.12, d / 2.0, [w, h - 0.12, d], &Finish::all(stone));
        joiner.pieces
    }

    /// A plant in a pot.
    pub fn plant(&self, at: Solid, seeded: &mut Seeded) -> Vec<Piece> {
        let [w, h, _] = at.size;
        let pot = Finish::all(&self.some_paint(seeded).1);
        let mut joiner = Joiner::new(at);
        joiner.add(0.0, 0.0, w / 2.0, [0.62 * w, 0.3, 0.62 * w], &pot);
        let middle = at.place(0.0, 0.0, 0.0);
        let mut leaves: Vec<Surface> = (0..34)
            .map(|_| {
                let green = self.some_green(seeded);
                leaf(add(middle, [0.0, 0.3, 0.0]), (w, h - 0.3), green, seeded)
            })
            .collect();
        let far = |surface: &Surface| {
            let way = subtract(surface.origin, CAMERA);
            -dot(way, way)
        };
        leaves.sort_by(|a, b| far(a).total_cmp(&far(b)));
        let crown = Solid { base: add(middle, [0.0, 0.3, 0.0]), size: [w, h - 0.3, w], yaw_deg: at.yaw_deg };
        joiner.pieces.push(Piece { solid: crown, surfaces: leaves });
        joiner.pieces
    }
}

/// A leaf somewhere in the crown of a plant: a pointed piece that droops outwards.
pub(super) fn leaf(
    foot: Vector,
    (width, height): (f64, f64),
    green: &Arc<Material>,
    seeded: &mut Seeded,
) -> Surface {
    let (around, rise) = (seeded.range(0.0, std::f64::consts::TAU), seeded.range(-0.2, 1.2));
    let out = [around.cos() * rise.cos(), rise.sin(), around.sin() * rise.cos()];
    let reach = seeded.range(0.05, 0.3) * width;
    let up = seeded.range(0.05, 0.8) * height;
    let origin = add(foot, [around.cos() * reach, up, around.sin() * reach]);
    let side = cross(out, DOWN);
    let side = scale(side, 1.0 / dot(side, side).sqrt().max(1e-6));
    let length = seeded.range(0.5, 0.8) * width * 0.6;
    let outline =
        vec![(0.0, 0.0), (0.4 * length, -0.16 * length), (length, 0.0), (0.4 * length, 0.16 * length)];
    let mut leaf = Surface::rectangle(origin, out, side, (1.0, 1.0), green);
    leaf.outline = outline;
    if !leaf.faces(CAMERA) {
        leaf.v = scale(leaf.v, -1.0);
    }
    leaf
}
