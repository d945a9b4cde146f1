// SPDX-License-Identifier: MPL-2.0

//! What hangs on walls and the fronts of furniture: pictures of which there is one each.

use std::sync::Arc;

use super::{
    paint::{Colour, detail, hue, mix, paint, times},
    stuff::Painter,
};
use crate::{seeded::Seeded, world::room::raster::Material};

/// 0 outside, 1 inside, with an edge of `soft`.
fn inside(distance: f64, soft: f64) -> f64 {
    (0.5 - distance / soft).clamp(0.0, 1.0)
}

/// Distance from a rectangle by its middle and half sizes; below 0 within.
fn beyond(u: f64, v: f64, middle: (f64, f64), half: (f64, f64)) -> f64 {
    ((u - middle.0).abs() - half.0).max((v - middle.1).abs() - half.1)
}

/// A shape on a poster.
struct Shape {
    middle: (f64, f64),
    half: (f64, f64),
    round: bool,
    colour: Colour,
}

impl Painter {
    /// A framed poster of `size` metres: shapes on a ground, and lines like text.
    pub fn poster(&self, size: (f64, f64), label: u64) -> Arc<Material> {
        let mut seeded = self.seeded.fork(1000 + label);
        let (ground, below) = (Self::any_colour(&mut seeded), Self::any_colour(&mut seeded));
        let paper = if seeded.unit() < 0.4 { [0.9, 0.89, 0.84] } else { ground };
        let shapes: Vec<Shape> = (0..4 + seeded.below(8)).map(|_| shape(&mut seeded)).collect();
        let lines: Vec<(f64, f64)> =
            (0..9).map(|_| (seeded.range(0.12, 0.2), seeded.range(0.45, 0.88))).collect();
        let text_top = seeded.range(0.58, 0.8);
        let (words, ink) = (seeded.bits(), seeded.range(0.05, 0.25));
        let frame = mix([0.08, 0.08, 0.08], [0.6, 0.5, 0.35], seeded.unit());
        let grain = detail(&self.grains.plaster, 0.35, 0.06);
        Arc::new(paint(8, size, grain, |u, v| {
            let mut colour = mix(paper, below, 0.6 * v * (1.0 - v) + 0.1 * self.noise.sum(u, v, (4, 4), 4));
            for shape in &shapes {
                let far = if shape.round {
                    ((u - shape.middle.0) / shape.half.0).hypot((v - shape.middle.1) / shape.half.1) - 1.0
                } else {
                    beyond(u, v, shape.middle, shape.half) / shape.half.0
                };
                let part = if v < text_top { inside(far, 0.03) } else { 0.0 };
                colour =
                    mix(colour, times(shape.colour, 1.0 + 0.08 * self.noise.sum(u, v, (16, 16), 3)), part);
            }
            let line = (v - text_top - 0.02) * 40.0;
            if let Some(&(left, right)) = lines.get(line.max(0.0) as usize) {
                let letter = Seeded::new(words ^ (line as u64) << 32 ^ (u * 90.0) as u64).unit();
                let within = line > 0.0 && line.fract() < 0.55 && u > left && u < right && letter > 0.3;
                let ink = if Painter::dark(paper) { 1.0 - ink } else { ink };
                colour = mix(colour, [ink as f32; 3], if within { 0.85 } else { 0.0 });
            }
            mix(frame, colour, inside(beyond(u, v, (0.5, 0.5), (0.475, 0.48)), 0.004))
        }))
    }

    fn dark(colour: Colour) -> bool {
        colour.iter().sum::<f32>() < 1.4
    }

    /// A door in its frame, with panels, a handle and a plate.
    pub fn door(&self, colour: Colour, size: (f64, f64), label: u64) -> Arc<Material> {
        let mut seeded = self.seeded.fork(2000 + label);
        let glazed = seeded.unit() < 0.35;
        let handle = if seeded.unit() < 0.5 { 0.16 } else { 0.84 };
        let grain = detail(&self.grains.wood, 0.4, 0.1);
        Arc::new(paint(8, size, grain, |u, v| {
            let fibre = self.noise.sum(v, u, (2, 64), 3);
            let leaf = times(colour, 1.0 + 0.06 * fibre);
            let frame = times(colour, 0.82 + 0.05 * fibre);
            let mut shown = mix(frame, leaf, inside(beyond(u, v, (0.5, 0.52), (0.42, 0.49)), 0.006));
            let gap = beyond(u, v, (0.5, 0.52), (0.42, 0.49)).abs();
            shown = times(shown, 1.0 - 0.6 * inside(gap - 0.002, 0.006));
            for (top, height) in [(0.3, 0.19), (0.75, 0.17)] {
                let far = beyond(u, v, (0.5, top), (0.3, height));
                let pane = glazed && top < 0.5;
                let fill =
                    if pane { times([0.55, 0.62, 0.66], 1.0 + 0.2 * (u - v)) } else { times(leaf, 1.03) };
                shown = mix(shown, fill, inside(far, 0.004));
                let bevel = inside(far.abs() - 0.006, 0.008);
                shown = times(shown, 1.0 + bevel * if v < top { -0.25 } else { 0.15 });
            }
            shown = mix(shown, [0.75, 0.74, 0.7], inside(beyond(u, v, (handle, 0.53), (0.015, 0.03)), 0.006));
            let lever = beyond(u, v, (handle + 0.05 * (0.5 - handle).signum(), 0.52), (0.06, 0.006));
            shown = mix(shown, [0.82, 0.81, 0.78], inside(lever, 0.004));
            mix(shown, [0.85, 0.85, 0.8], inside(beyond(u, v, (0.5, 0.085), (0.12, 0.02)), 0.004))
        }))
    }

    /// A window on a bright day: frame, bars, sky, something green; by night next to nothing behind it.
    pub fn window(&self, size: (f64, f64), label: u64, night: bool) -> Arc<Material> {
        let mut seeded = self.seeded.fork(3000 + label);
        let (columns, skyline) = (2.0 + seeded.below(2) as f64, seeded.range(0.5, 0.75));
        let shift = seeded.unit();
        let mut material = paint(8, size, None, |u, v| {
            let hills = skyline + 0.1 * self.noise.sum(u + shift, 0.5, (4, 4), 4);
            let sky =
                mix([0.72, 0.84, 0.98], [0.98, 0.99, 1.0], v * 1.6 + 0.3 * self.noise.sum(u, v, (2, 4), 4));
            let green = times([0.5, 0.6, 0.4], 1.0 + 0.25 * self.noise.sum(u, v, (16, 16), 4));
            let outside = mix(sky, green, inside(hills - v, 0.03));
            let pane = ((u * columns).fract() - 0.5).abs() - 0.5 + 0.035 * columns / 2.0;
            let bars = inside(pane.max((v - 0.5).abs() - 0.46), 0.01)
                * (1.0 - inside((v - 0.3).abs() - 0.012, 0.006));
            let outside = if night { times(outside, 0.09) } else { outside };
            mix([0.78, 0.77, 0.74], outside, bars)
        });
        material.glows = !night;
        Arc::new(material)
    }

    /// A lamp in the ceiling.
    pub fn lamp(&self) -> Arc<Material> {
        let mut material = paint(6, (1.2, 0.3), None, |u, v| {
            let tube = inside(beyond(u, v, (0.5, 0.5), (0.47, 0.4)), 0.05);
            mix([0.7, 0.7, 0.7], times([1.0, 1.0, 0.97], 0.93 + 0.07 * (v * 12.0).sin()), tube)
        });
        material.glows = true;
        Arc::new(material)
    }

    /// The shade of a standing lamp that is on: brightest in the middle.
    pub fn lampshade(&self, size: (f64, f64)) -> Arc<Material> {
        let mut material = paint(5, size, None, |u, v| {
            let glow = 1.0 - 1.2 * (u - 0.5).powi(2) - 0.9 * (v - 0.6).powi(2);
            times([1.0, 0.93, 0.78], glow)
        });
        material.glows = true;
        Arc::new(material)
    }

    /// Shelves full of books.
    pub fn books(&self, wood: Colour, size: (f64, f64), label: u64) -> Arc<Material> {
        let seeded = self.seeded.fork(4000 + label);
        let shelves = (size.1 / 0.36).round().max(1.0);
        let slots = (size.0 / 0.045).round();
        let grain = detail(&self.grains.plaster, 0.3, 0.12);
        Arc::new(paint(8, size, grain, |u, v| {
            let (shelf, y) = ((v * shelves).floor(), (v * shelves).fract());
            let slot = (u * slots).floor();
            let x = (u * slots).fract();
            let mut book = seeded.fork((shelf * 1000.0 + slot) as u64);
            let (top, gone, colour) =
                (book.range(0.14, 0.45), book.unit() < 0.08, Self::any_colour(&mut book));
            let label_at = book.range(0.5, 0.75);
            let edge = (y - 0.04).min(0.96 - y).min((u).min(1.0 - u) * 20.0 - 0.3);
            if edge < 0.0 {
                return times(wood, 1.0 + 0.1 * self.noise.sum(u, v, (2, 64), 2));
            }
            if y < top || gone {
                return times(wood, 0.3);
            }
            let round = 1.0 - 1.6 * (x - 0.5) * (x - 0.5);
            let title = (y - label_at).abs() < 0.1 && (0.25..0.75).contains(&x);
            times(if title { mix(colour, [0.9, 0.88, 0.8], 0.7) } else { colour }, round)
        }))
    }

    /// A board with notes pinned to it.
    pub fn notice_board(&self, size: (f64, f64), label: u64) -> Arc<Material> {
        let mut seeded = self.seeded.fork(5000 + label);
        let notes: Vec<Shape> = (0..14).map(|_| note(&mut seeded)).collect();
        let cork = if seeded.unit() < 0.5 { [0.66, 0.5, 0.33] } else { [0.3, 0.42, 0.36] };
        let grain = detail(&self.grains.plaster, 0.3, 0.2);
        Arc::new(paint(8, size, grain, |u, v| {
            let mut shown = times(cork, 1.0 + 0.12 * self.noise.sum(u, v, (64, 32), 3));
            for note in &notes {
                let far = beyond(u, v, note.middle, note.half);
                shown = times(
                    shown,
                    1.0 - 0.3 * inside(beyond(u - 0.006, v - 0.01, note.middle, note.half), 0.01),
                );
                let y = (v - note.middle.1 + note.half.1) / note.half.1 * 5.0;
                let x = (u - note.middle.0) / note.half.0;
                let written =
                    y > 1.0 && y.fract() < 0.4 && x.abs() < 0.8 && (x * 9.0 + y.floor() * 1.7).sin() > -0.6;
                let paper = if written { times(note.colour, 0.45) } else { note.colour };
                shown = mix(shown, paper, inside(far, 0.004));
            }
            mix([0.55, 0.54, 0.52], shown, inside(beyond(u, v, (0.5, 0.5), (0.48, 0.46)), 0.006))
        }))
    }

    /// Doors or drawers of a cupboard: `columns` by `rows`, with handles.
    pub fn front(
        &self,
        colour: Colour,
        size: (f64, f64),
        cells: (usize, usize),
        slots: bool,
    ) -> Arc<Material> {
        let grain = detail(&self.grains.wood, 0.4, 0.12);
        let cells = (cells.0 as f64, cells.1 as f64);
        Arc::new(paint(8, size, grain, |u, v| {
            let (x, y) = ((u * cells.0).fract(), (v * cells.1).fract());
            let metres = (size.0 / cells.0, size.1 / cells.1);
            let edge = (x.min(1.0 - x) * metres.0).min(y.min(1.0 - y) * metres.1);
            let gap = inside(edge - 0.004, 0.004);
            let tone = self.noise.at((u * cells.0).floor() + 0.5, (v * cells.1).floor() + 0.5, (16, 16));
            let shown = times(
                colour,
                (1.0 + 0.04 * tone + 0.05 * self.noise.sum(u, v, (2, 32), 4)) * (1.0 - 0.6 * gap),
            );
            let handle = beyond(x * metres.0, y * metres.1, (0.84 * metres.0, metres.1 / 2.0), (0.012, 0.06));
            let shown = mix(shown, [0.8, 0.79, 0.76], inside(handle, 0.006));
            let slit =
                slots && (0.1..0.2).contains(&y) && (y * 50.0).fract() < 0.4 && (0.3..0.7).contains(&x);
            times(shown, if slit { 0.45 } else { 1.0 })
        }))
    }
}

fn shape(seeded: &mut Seeded) -> Shape {
    Shape {
        middle: (seeded.range(0.15, 0.85), seeded.range(0.1, 0.65)),
        half: (seeded.range(0.05, 0.25), seeded.range(0.03, 0.2)),
        round: seeded.unit() < 0.55,
        colour: hue(seeded.unit(), seeded.range(0.1, 0.8), seeded.range(0.2, 0.95)),
    }
}

fn note(seeded: &mut Seeded) -> Shape {
    Shape {
        middle: (seeded.range(0.1, 0.9), seeded.range(0.18, 0.8)),
        half: (seeded.range(0.04, 0.07), seeded.range(0.06, 0.13)),
        round: false,
        colour: hue(seeded.unit(), seeded.range(0.0, 0.35), seeded.range(0.75, 0.97)),
    }
}
