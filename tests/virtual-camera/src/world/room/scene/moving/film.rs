// SPDX-License-Identifier: MPL-2.0

//! A screen on a stand that shows films: shots with something moving in each, and cuts between them.

use std::sync::Arc;

use super::{
    super::{
        furniture::Piece,
        paint::{Colour, hue, mix, paint},
        solid::{Finish, Solid},
        stuff::Painter,
    },
    Moving, facing,
};
use crate::{
    seeded::Seeded,
    world::room::{
        raster::{Material, Surface},
        view::add,
    },
};

/// Pictures of the film a second.
const RATE: f64 = 25.0;
/// Seconds that a shot lasts, at least and at most on average.
const SHOT: f64 = 3.5;
/// Width and height in metres; the picture is as wide as it is high in its own pixels, 2^`SHIFT`.
const SCREEN: (f64, f64) = (1.3, 0.75);
const SHIFT: u32 = 6;

pub(in super::super) struct Film {
    seeded: Seeded,
}

pub(super) fn things(painter: &Painter, seeded: &Seeded) -> Vec<(Piece, Option<Moving>)> {
    let mut chance = seeded.fork(1);
    let stand = facing(chance.range(-3.0, 4.0), chance.range(6.4, 7.2), [0.5, 0.95, 0.4]);
    let black = Finish::all(&painter.smooth([0.08, 0.08, 0.09]));
    let screen =
        Solid { base: add(stand.base, [0.0, stand.size[1], 0.0]), size: [SCREEN.0, SCREEN.1, 0.06], ..stand };
    let piece = |solid: Solid| Piece { solid, surfaces: solid.surfaces(&black) };
    let film = Moving::Film(Film { seeded: seeded.fork(2) });
    vec![(piece(stand), None), (piece(screen), Some(film))]
}

impl Film {
    /// The front, which is as large as the screen, shows the film.
    pub fn surfaces(&self, resting: &[Surface], time: f64) -> Vec<Surface> {
        let picture = Arc::new(self.picture((time * RATE).floor() / RATE));
        let is_front = |surface: &Surface| {
            let (width, height) = surface.outline.get(2).copied().unwrap_or_default();
            (width - SCREEN.0).abs() < 1e-6 && (height - SCREEN.1).abs() < 1e-6
        };
        let show = |surface: &Surface| match is_front(surface) {
            true => Surface { material: picture.clone(), ..surface.clone() },
            false => surface.clone(),
        };
        resting.iter().map(show).collect()
    }

    fn picture(&self, time: f64) -> Material {
        let shot = (time / SHOT).floor();
        let mut chance = self.seeded.fork(shot as u64);
        let since = time - shot * SHOT;
        let sky = hue(chance.unit(), chance.range(0.1, 0.6), chance.range(0.3, 1.0));
        let ground = hue(chance.unit(), chance.range(0.2, 0.7), chance.range(0.1, 0.7));
        let figure = hue(chance.unit(), 0.7, chance.range(0.2, 0.95));
        let horizon = chance.range(0.3, 0.75);
        let (x, speed) = (chance.range(0.1, 0.9), chance.range(-0.35, 0.35));
        let (size, pan) = (chance.range(0.1, 0.3), chance.range(-0.15, 0.15));
        let at = x + speed * since;
        let colour = move |u: f64, v: f64| -> Colour {
            let wave = 0.05 * ((u + pan * since) * 19.0).sin();
            let back = if v < horizon + wave { mix(sky, ground, v / horizon * 0.5) } else { ground };
            let (across, up) = ((u - at) / size, (v - horizon) / (1.6 * size));
            if across * across + up * up < 1.0 { figure } else { back }
        };
        Material { glows: true, ..paint(SHIFT, SCREEN, None, colour) }
    }
}
