// SPDX-License-Identifier: MPL-2.0

//! The room itself: a hall with what stands and hangs in it, lit once and for all.

mod furniture;
mod hall;
mod lighting;
mod look;
mod moving;
mod open_air;
mod paint;
mod solid;
mod standing;
mod stuff;
mod style;
mod things;
mod walls;
mod yard;

use std::{
    borrow::Cow,
    collections::BTreeMap,
    sync::{Arc, Mutex, Weak},
};

use furniture::Piece;
use hall::Hall;
use moving::Moving;
pub(super) use solid::Solid;
use stuff::Painter;
pub(super) use style::Style;
use yard::Yard;

use super::{
    event::Event,
    light::Light,
    raster::{Surface, cover},
    settings::Place,
    view::{Canvas, Vector, View},
};
use crate::{picture::Plane, seeded::Seeded, sync::lock};

/// What is put into the person's way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Obstacle {
    /// A piece of furniture that hides the lower body.
    Furniture,
    /// Something as high as a person, or the room.
    Screen,
    /// To sit down on.
    Sofa,
}

/// Nobody reaches higher, in metres.
const TALLEST: f64 = 2.0;

/// All that does not move.
pub(super) struct Scene {
    /// Walls and what hangs on them, in the order of drawing.
    shell: Vec<Surface>,
    /// What stands in the room, in the order of drawing.
    pieces: Vec<Piece>,
    /// Those of them that move, by their place in that order.
    moving: BTreeMap<usize, Moving>,
    /// The light it stands in.
    pub light: Light,
}

/// What decides what a scene looks like.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    pub seed: u64,
    /// What kind of place it is.
    pub place: Place,
    /// Where the sun is, if it is a place that it shines on: a direction of length 1.
    pub sun: Vector,
    /// Stand on the floor where their boxes are; what they are is up to the seed.
    pub obstacles: Vec<(Obstacle, Solid)>,
    /// What the scene must have for them is there.
    pub events: Vec<Event>,
    /// Where people tread: nothing else stands there.
    pub trodden: Vec<Vector>,
}

impl Scene {
    /// The scene of a plan, shared by all rooms of that plan that there are: painting it takes longer than many a picture.
    pub fn of(plan: Plan) -> Arc<Self> {
        static SCENES: Mutex<Vec<(Plan, Weak<Scene>)>> = Mutex::new(Vec::new());
        // Locked while one is painted, so that nobody paints the same one beside it.
        let mut scenes = lock(&SCENES);
        scenes.retain(|(_, scene)| scene.strong_count() > 0);
        if let Some(scene) =
            scenes.iter().find(|(other, _)| *other == plan).and_then(|(_, scene)| scene.upgrade())
        {
            return scene;
        }
        let scene = Arc::new(Self::new(&plan));
        scenes.push((plan, Arc::downgrade(&scene)));
        scene
    }

    fn new(plan: &Plan) -> Self {
        match plan.place {
            Place::Hall => Self::in_hall(plan),
            Place::Yard | Place::NightYard | Place::InfraredYard => Self::in_yard(plan),
        }
    }

    fn in_hall(Plan { seed, obstacles, events, trodden, .. }: &Plan) -> Self {
        let (seeded, style) = (Seeded::new(*seed), Style::of(*seed));
        let painter = Painter::new(seeded.fork(1));
        let mut hall = Hall::new(style, &mut seeded.fork(2));
        let (shell, mut pieces) = hall.furnish(trodden, &painter, &mut seeded.fork(3));
        let mut choice = seeded.fork(4);
        for &(kind, solid) in obstacles {
            pieces.extend(hall.obstacle(kind, solid, &painter, &mut choice));
        }
        let mut things: Vec<_> = pieces.into_iter().map(|piece| (piece, None)).collect();
        things.extend(events.iter().flat_map(|event| moving::things(*event, &painter, &seeded.fork(5))));
        let planes = hall.planes();
        Self::lit(hall.light, &planes, shell, things)
    }

    fn in_yard(Plan { seed, place, sun, obstacles, events, .. }: &Plan) -> Self {
        let seeded = Seeded::new(*seed).fork(0x7a2d);
        let painter = Painter::new(seeded.fork(1));
        let yard = Yard::new(*place, *sun, &mut seeded.fork(2));
        let windy = events.contains(&Event::Draught);
        let (shell, mut things) = yard.furnish(windy, &painter, &mut seeded.fork(3));
        let mut choice = seeded.fork(4);
        for &(kind, solid) in obstacles {
            let pieces = yard.obstacle(kind, solid, &painter, &mut choice);
            things.extend(pieces.into_iter().map(|piece| (piece, None)));
        }
        let planes = yard.planes();
        Self::lit(yard.light, &planes, shell, things)
    }

    /// All of it in the order of drawing, and in this light.
    fn lit(
        light: Light,
        planes: &[lighting::Plane],
        mut shell: Vec<Surface>,
        things: Vec<(Piece, Option<Moving>)>,
    ) -> Self {
        let (pieces, movings): (Vec<_>, Vec<_>) = things.into_iter().unzip();
        let solids: Vec<Solid> = pieces.iter().map(|piece| piece.solid).collect();
        let mut pieces = in_order(pieces);
        lighting::light(&light, planes, &mut shell, &mut pieces);
        let place = |solid: &Solid| pieces.iter().position(|piece| piece.solid == *solid);
        let moving = solids.iter().zip(movings).filter_map(|(solid, moving)| Some((place(solid)?, moving?)));
        Self { moving: moving.collect(), shell, pieces, light }
    }

    /// Draws walls, floor and ceiling, and what hangs there.
    pub fn draw_shell(&self, view: &View, canvas: &mut Canvas) {
        self.shell.iter().for_each(|surface| surface.draw(view, canvas));
    }

    /// The surfaces of one of its pieces as they are at a time in seconds.
    fn surfaces(&self, index: usize, time: f64) -> Cow<'_, [Surface]> {
        let surfaces = self.pieces[index].surfaces.as_slice();
        match self.moving.get(&index) {
            Some(moving) => Cow::Owned(moving.surfaces(surfaces, time)),
            None => Cow::Borrowed(surfaces),
        }
    }

    /// Draws all that stands in the room, as it is at a time in seconds.
    pub fn draw_pieces(&self, time: f64, view: &View, canvas: &mut Canvas) {
        for index in 0..self.pieces.len() {
            self.surfaces(index, time).iter().for_each(|surface| surface.draw(view, canvas));
        }
    }

    /// Takes out of `mask` (of the size of the view) what is hidden by what stands before a person with these feet,
    /// at a time in seconds.
    pub fn hide(&self, feet: Vector, time: f64, view: &View, mask: &mut Plane) {
        let head = [feet[0], feet[1] + TALLEST, feet[2]];
        let before = |index: &usize| self.pieces[*index].solid.hides(&[feet, head]);
        for index in (0..self.pieces.len()).filter(before) {
            for surface in self.surfaces(index, time).iter() {
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

/// Sorted so that what may hide others comes after them.
fn in_order(pieces: Vec<Piece>) -> Vec<Piece> {
    let solids: Vec<Solid> = pieces.iter().map(|piece| piece.solid).collect();
    // For each piece, how many must be drawn before it, and which ones after it.
    let mut before = vec![0usize; solids.len()];
    let mut after = vec![Vec::new(); solids.len()];
    for (first, one) in solids.iter().enumerate() {
        for (second, other) in solids.iter().enumerate() {
            if first != second && one.precedes(other) {
                before[second] += 1;
                after[first].push(second);
            }
        }
    }
    let mut left: Vec<Option<Piece>> = pieces.into_iter().map(Some).collect();
    let mut sorted = Vec::with_capacity(left.len());
    // Where things hide each other in a circle, the one that hides fewest of the others goes first.
    let next = |left: &[Option<Piece>], before: &[usize]| {
        (0..left.len()).filter(|&i| left[i].is_some()).min_by_key(|&i| before[i])
    };
    while let Some(index) = next(&left, &before) {
        sorted.extend(left[index].take());
        for &later in &after[index] {
            before[later] = before[later].saturating_sub(1);
        }
    }
    sorted
}

#[cfg(test)]
mod tests;
