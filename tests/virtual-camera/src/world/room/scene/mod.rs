//! The room itself: a hall with what stands and hangs in it, lit once and for all.

mod furniture;
mod hall;
mod lighting;
mod paint;
mod solid;
mod stuff;
mod things;

use furniture::Piece;
use hall::Hall;
pub(super) use solid::Solid;
use stuff::Painter;

use super::{
    light::Light,
    raster::{Surface, cover},
    view::{Canvas, Vector, View},
};
use crate::{picture::Plane, seeded::Seeded};

/// What is put into the person's way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Obstacle {
    /// A piece of furniture that hides the lower body.
    Furniture,
    /// Something as high as a person, or the room.
    Screen,
}

/// All that does not move.
pub(super) struct Scene {
    /// Walls and what hangs on them, in the order of drawing.
    shell: Vec<Surface>,
    /// What stands in the room, in the order of drawing.
    pieces: Vec<Piece>,
    /// The light it stands in.
    pub light: Light,
}

/// Which part of the room, as seen from the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Behind,
    Before,
}

impl Scene {
    /// The room of a seed. `obstacles` stand on the floor where their boxes are; what they are is up to the seed.
    pub fn new(seeded: &Seeded, obstacles: &[(Obstacle, Solid)]) -> Self {
        let painter = Painter::new(seeded.fork(1));
        let mut hall = Hall::new(&mut seeded.fork(2));
        let (mut shell, mut pieces) = hall.furnish(&painter, &mut seeded.fork(3));
        let mut choice = seeded.fork(4);
        for &(kind, solid) in obstacles {
            pieces.extend(hall.obstacle(kind, solid, &painter, &mut choice));
        }
        let mut pieces = in_order(pieces);
        lighting::light(&hall, &mut shell, &mut pieces);
        Self { shell, pieces, light: hall.light }
    }

    /// Draws all that stands behind a person with these feet, walls included; or before them.
    pub fn draw(&self, side: Side, feet: Vector, view: &View, canvas: &mut Canvas) {
        if side == Side::Behind {
            self.shell.iter().for_each(|surface| surface.draw(view, canvas));
        }
        for piece in self.pieces.iter().filter(|piece| side_of(&piece.solid, feet) == side) {
            piece.surfaces.iter().for_each(|surface| surface.draw(view, canvas));
        }
    }

    /// Takes out of `mask` (of the size of the view) what is hidden by what stands before a person with these feet.
    pub fn hide(&self, feet: Vector, view: &View, mask: &mut Plane) {
        for piece in self.pieces.iter().filter(|piece| side_of(&piece.solid, feet) == Side::Before) {
            for surface in &piece.surfaces {
                cover(&surface.polygon(view), view.size, |covered| {
                    let line = &mut mask.data[covered.row * view.size.0..][..view.size.0];
                    line[covered.whole.clone()].fill(0);
                    for (column, part) in covered.edges() {
                        line[column] = ((u32::from(line[column]) * (256 - u32::from(part))) >> 8) as u8;
                    }
                });
            }
        }
    }
}

/// Where something stands for a person with these feet, seen from the camera.
fn side_of(solid: &Solid, feet: Vector) -> Side {
    let head = [feet[0], feet[1] + 1.0, feet[2]];
    if solid.hides(&[feet, head]) { Side::Before } else { Side::Behind }
}

/// Sorted so that what may hide others comes after them.
fn in_order(mut pieces: Vec<Piece>) -> Vec<Piece> {
    let mut sorted = Vec::with_capacity(pieces.len());
    while !pieces.is_empty() {
        let free = |&i: &usize| {
            let piece = &pieces[i].solid;
            pieces.iter().all(|other| std::ptr::eq(&other.solid, piece) || !other.solid.precedes(piece))
        };
        let next = (0..pieces.len()).find(free).unwrap_or(0);
        sorted.push(pieces.remove(next));
    }
    sorted
}

#[cfg(test)]
mod tests;
