// SPDX-License-Identifier: MPL-2.0

//! Things in the room that move by themselves.

mod door;
mod film;
pub(super) mod plant;

use super::{furniture::Piece, solid::Solid, stuff::Painter};
use crate::{
    seeded::Seeded,
    world::room::{event::Event, raster::Surface},
};

/// How a thing looks at a time.
pub(super) enum Moving {
    Door(Box<door::Door>),
    Film(film::Film),
    Plant(plant::Plant),
}

impl Moving {
    /// The sides of the thing at a time in seconds; `resting` are those of the piece it is.
    pub fn surfaces(&self, resting: &[Surface], time: f64) -> Vec<Surface> {
        match self {
            Self::Door(door) => door.surfaces(resting, time),
            Self::Film(film) => film.surfaces(resting, time),
            Self::Plant(plant) => plant.surfaces(resting, time),
        }
    }
}

/// The things of an event: those that only stand there, and those that move.
pub(super) fn things(event: Event, painter: &Painter, seeded: &Seeded) -> Vec<(Piece, Option<Moving>)> {
    let seeded = seeded.fork(event as u64);
    match event {
        Event::Door => door::things(painter, &seeded),
        Event::Film => film::things(painter, &seeded),
        Event::Draught => plant::things(painter, &seeded),
        Event::Sun | Event::Switch | Event::Clouds | Event::Headlights | Event::Rain => Vec::new(),
    }
}

/// A box on the floor in a direction from the camera, facing it.
fn facing(azimuth_deg: f64, away: f64, size: [f64; 3]) -> Solid {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    Solid { base: [away * sin, 0.0, away * cos], size, yaw_deg: -azimuth_deg }
}
