// SPDX-License-Identifier: MPL-2.0

//! Light that changes or is thrown about: sun patches, cast shadows, a reflecting floor, lamps switched off.

use super::{
    event::{self, Event},
    light::Light,
    raster::cover,
    settings::RoomSettings,
    view::{self, Canvas, Vector, View},
    walker::Mover,
};
use crate::{picture::Plane, seeded::Seeded, world::sensor::soften};

/// Part of the light that is left in a shadow, and that a floor reflects.
const SHADED: f64 = 0.55;
const REFLECTED: f64 = 0.28;
/// By how much the sun brightens the floor.
const SUNNY: f64 = 0.75;
/// Slats of the blind that let stripes of sun through.
const STRIPES: u32 = 9;

/// What of all that a room has.
pub(super) struct Effects {
    seeded: Seeded,
    sun: bool,
    switch: bool,
    /// Where the light of a low sun falls that casts shadows.
    shadows: Option<Vector>,
    reflections: bool,
}

/// Stream of chance.
const EFFECTS: u64 = 0xeffe;

/// Along which the low sun of a seed shines: shadows fall to the side and towards the camera.
fn sunbeam(seed: u64) -> Vector {
    let mut chance = Seeded::new(seed).fork(EFFECTS).fork(1);
    let (around, down) = (chance.range(0.5, 1.0) * chance.pick(&[-1.0, 1.0]), chance.range(0.62, 0.85));
    [around, -down, -0.35]
}

/// The direction to that sun, of length 1.
pub(super) fn towards_sun(seed: u64) -> Vector {
    let beam = sunbeam(seed);
    view::scale(beam, -1.0 / view::dot(beam, beam).sqrt())
}

impl Effects {
    pub fn new(settings: &RoomSettings) -> Self {
        let seeded = Seeded::new(settings.seed).fork(EFFECTS);
        Self {
            sun: settings.events.contains(&Event::Sun),
            switch: settings.events.contains(&Event::Switch),
            shadows: settings.shadows.then(|| sunbeam(settings.seed)),
            reflections: settings.reflections,
            seeded,
        }
    }

    /// Draws what lies on the floor, before anything stands on it.
    pub fn on_floor(
        &self,
        movers: &[Box<dyn Mover>],
        time: f64,
        view: &View,
        light: &Light,
        canvas: &mut Canvas,
    ) {
        if self.sun {
            self.sun(time, view, canvas);
        }
        if self.reflections {
            reflect(movers, time, view, light, canvas);
        }
        if let Some(direction) = self.shadows {
            shade(movers, time, direction, view, canvas);
        }
    }

    /// Stripes that lie one behind the other, and move with the sun.
    fn sun(&self, time: f64, view: &View, canvas: &mut Canvas) {
        let strength = SUNNY * event::sun(&self.seeded, time);
        let mut chance = self.seeded.fork(2);
        let (left, width, slant) = (chance.range(-1.6, 0.4), chance.range(1.3, 2.0), chance.range(-0.5, 0.5));
        let near = chance.range(4.4, 5.0);
        let drift = 0.002 * time;
        for stripe in 0..STRIPES {
            let z = near + 0.21 * f64::from(stripe);
            let corner = |x: f64, z: f64| [x + drift + slant * (z - near), 0.0, z];
            let ring = [(left, z), (left + width, z), (left + width, z + 0.11), (left, z + 0.11)];
            let polygon: Option<Vec<_>> =
                ring.iter().map(|&(x, z)| view.pixel(corner(x, z)).map(|(pixel, _)| pixel)).collect();
            brighten(&polygon.unwrap_or_default(), strength, view, &mut canvas.planes[0]);
        }
    }

    /// Lets the lamps be off.
    pub fn switch(&self, time: f64, canvas: &mut Canvas) {
        let lamps = if self.switch { event::lamps(&self.seeded, time) } else { 1.0 };
        if lamps < 1.0 {
            let [luma, chroma @ ..] = &mut canvas.planes;
            scale(luma, 16.0, lamps);
            chroma.iter_mut().for_each(|plane| scale(plane, 128.0, lamps));
        }
    }
}

fn scale(plane: &mut Plane, zero: f64, factor: f64) {
    let (zero, factor) = (zero as i32, (256.0 * factor) as i32);
    for pixel in &mut plane.data {
        *pixel = (zero + (((i32::from(*pixel) - zero) * factor) >> 8)).clamp(0, 255) as u8;
    }
}

fn brighten(polygon: &[(f64, f64)], strength: f64, view: &View, luma: &mut Plane) {
    let lit = |pixel: &mut u8, part: f64| {
        let value = f64::from(*pixel) - 16.0;
        *pixel = (16.0 + value * (1.0 + strength * part)).min(238.0) as u8;
    };
    if polygon.is_empty() {
        return;
    }
    cover(polygon, view.size, |covered| {
        let line = &mut luma.data[covered.row * view.size.0..][..view.size.0];
        line[covered.whole.clone()].iter_mut().for_each(|pixel| lit(pixel, 1.0));
        for (column, part) in covered.edges() {
            lit(&mut line[column], f64::from(part) / 256.0);
        }
    });
}

fn shade(movers: &[Box<dyn Mover>], time: f64, direction: Vector, view: &View, canvas: &mut Canvas) {
    let mut mask = Plane::filled(view.size.0, view.size.1, 0);
    movers.iter().for_each(|mover| mover.cast_shadow(time, direction, view, &mut mask));
    (0..3).for_each(|_| soften(&mut mask));
    for (pixel, &shaded) in
        canvas.planes[0].data.iter_mut().zip(&mask.data).filter(|(_, shaded)| **shaded > 0)
    {
        let left = 1.0 - (1.0 - SHADED) * f64::from(shaded) / 255.0;
        *pixel = (16.0 + (f64::from(*pixel) - 16.0) * left) as u8;
    }
}

fn reflect(movers: &[Box<dyn Mover>], time: f64, view: &View, light: &Light, canvas: &mut Canvas) {
    let mut mirrored = canvas.clone();
    for layer in movers.iter().filter_map(|mover| mover.reflection(time, view, light)) {
        let (width, height) = layer.view(view).size;
        layer.over(&mut mirrored, Plane::filled(width, height, 255), (0.0, 0.0));
    }
    for (plane, mirrored) in canvas.planes.iter_mut().zip(&mirrored.planes) {
        for (pixel, &other) in
            plane.data.iter_mut().zip(&mirrored.data).filter(|(pixel, other)| pixel != other)
        {
            let mixed = f64::from(*pixel) + (f64::from(other) - f64::from(*pixel)) * REFLECTED;
            *pixel = mixed.round() as u8;
        }
    }
}
