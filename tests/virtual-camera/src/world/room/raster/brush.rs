// SPDX-License-Identifier: MPL-2.0

//! Fills the pixels that a surface covers.

use std::ops::Range;

use super::{
    cover::cover,
    surface::Surface,
    texture::{SPAN, Texture, Way},
};
use crate::{
    geometry::{Matrix, Pinhole},
    picture::Plane,
    world::room::view::{Vector, View, cross, dot, scale},
};

/// Exact places in a span of pixels, at most; straight lines in between.
const PIECES: usize = 4;
/// How far straight lines may lead astray, in pixels.
const ASTRAY: f64 = 0.1;
/// Light is computed at least so often, in metres.
const LIGHT_STEP: f64 = 0.5;
/// Where a pixel covers so many pixels of the grain, nothing of it is left to see.
const COARSEST_GRAIN: f64 = 7.0;

/// What is needed to fill pixels of planes of one size.
pub(super) struct Brush<'a> {
    surface: &'a Surface,
    /// From pixel to place: (u w, v w, w), with w the depth's inverse.
    place: Matrix,
}

/// A place of a surface with its brightness, exact.
#[derive(Clone, Copy)]
struct Spot {
    u: f64,
    v: f64,
    depth: f64,
    light: f32,
}

/// A piece of a row, with what lies at both ends of equally long straight pieces of it.
struct Span {
    spots: [Spot; PIECES + 1],
    /// Pixels of a straight piece.
    piece: usize,
    /// Width of a pixel's footprint in metres.
    footprint: f64,
}

impl<'a> Brush<'a> {
    /// For planes of the size of the view.
    pub fn new(surface: &'a Surface, view: &View) -> Self {
        let axes = [view.turned(surface.u), view.turned(surface.v), view.seen(surface.origin)];
        Self { surface, place: place_of_pixel(&axes, &view.pinhole) }
    }

    /// Fills a polygon of the luma plane.
    pub fn luma(&self, polygon: &[(f64, f64)], size: (usize, usize), plane: &mut Plane) {
        let material = &*self.surface.material;
        let (mut values, mut rough, mut light) = ([0; SPAN], [0; SPAN], [0; SPAN]);
        self.paint(polygon, size, [plane], |span, [line]| {
            let count = padded(line.len());
            sample(&material.luma, material.tile, span, &mut values[..count]);
            let grain = material.detail.as_ref();
            if let Some(grain) = grain.filter(|grain| span.footprint * grain.per_metre < COARSEST_GRAIN) {
                let tile = grain.texture.side() / grain.per_metre;
                sample(&grain.texture, (tile, tile), span, &mut rough[..count]);
                add_grain(&mut values[..count], &rough[..count], grain.gain);
            }
            span.light(&mut light[..count]);
            fill(line, &light, &values);
        });
    }

    /// Fills a polygon of the chroma planes.
    pub fn chroma(&self, polygon: &[(f64, f64)], size: (usize, usize), planes: [&mut Plane; 2]) {
        let material = &*self.surface.material;
        let (mut values, mut light) = ([0; SPAN], [0; SPAN]);
        self.paint(polygon, size, planes, |span, lines| {
            let count = padded(lines[0].len());
            span.light(&mut light[..count]);
            for (index, line) in lines.into_iter().enumerate() {
                let values = &mut values[..count];
                match material.plain[index] {
                    Some(value) => values.fill(i16::from(value) << 7),
                    None => sample(&material.chroma[index], material.tile, span, values),
                }
                fill_chroma(line, &light, values);
            }
        });
    }

    /// Calls `shade` with all straight pieces of a polygon, and mixes at its edges with what was there.
    fn paint<const PLANES: usize>(
        &self,
        polygon: &[(f64, f64)],
        size: (usize, usize),
        mut planes: [&mut Plane; PLANES],
        mut shade: impl FnMut(&Span, [&mut [u8]; PLANES]),
    ) {
        let mut before = Vec::new();
        cover(polygon, size, |covered| {
            let row = covered.row * size.0..(covered.row + 1) * size.0;
            let mut lines = planes.each_mut().map(|plane| &mut plane.data[row.clone()]);
            before.clear();
            before.extend(covered.edges().map(|(column, _)| lines.each_ref().map(|line| line[column])));
            self.row(covered.row, covered.columns.clone(), &mut lines, &mut shade);
            for ((column, part), old) in covered.edges().zip(&before) {
                for (line, &old) in lines.iter_mut().zip(old) {
                    let (part, old, new) = (i32::from(part), i32::from(old), i32::from(line[column]));
                    line[column] = (old + (((new - old) * part + 128) >> 8)) as u8;
                }
            }
        });
    }

    /// Divides columns of a row into spans.
    fn row<const PLANES: usize>(
        &self,
        row: usize,
        columns: Range<usize>,
        lines: &mut [&mut [u8]; PLANES],
        mut shade: impl FnMut(&Span, [&mut [u8]; PLANES]),
    ) {
        let y = row as f64;
        let mut from = self.spot(columns.start as f64, y);
        for start in columns.clone().step_by(SPAN) {
            let end = (start + SPAN).min(columns.end);
            let footprint = self.footprint(&from);
            let mut span =
                Span { spots: [from; PIECES + 1], piece: self.straight(&from, footprint), footprint };
            let pieces = (end - start).div_ceil(span.piece);
            for (index, spot) in span.spots[1..=pieces].iter_mut().enumerate() {
                *spot = self.spot((start + (index + 1) * span.piece) as f64, y);
            }
            from = span.spots[pieces];
            shade(&span, lines.each_mut().map(|line| &mut line[start..end]));
        }
    }

    /// How many pixels from there on are straight enough: n of them are off by n²/4 of their change in depth.
    fn straight(&self, from: &Spot, footprint: f64) -> usize {
        let deepening = self.place[2][0].abs() * from.depth;
        let fits =
            |pixels: f64| pixels * pixels / 4.0 * deepening < ASTRAY && pixels * footprint < LIGHT_STEP;
        let lengths = [SPAN, SPAN / 2].into_iter().find(|&pixels| fits(pixels as f64));
        lengths.unwrap_or(SPAN / PIECES)
    }

    fn spot(&self, x: f64, y: f64) -> Spot {
        let [u, v, w] = &self.place;
        let depth = 1.0 / (w[0] * x + w[1] * y + w[2]).max(1e-6);
        let (u, v) = ((u[0] * x + u[1] * y + u[2]) * depth, (v[0] * x + v[1] * y + v[2]) * depth);
        let light = if self.surface.material.glows { 1.0 } else { self.surface.light.at(u, v) };
        Spot { u, v, depth, light }
    }

    /// Width of a pixel's footprint around a place, in metres: between its longest and its shortest way.
    fn footprint(&self, spot: &Spot) -> f64 {
        let [along_u, along_v, along_w] = &self.place;
        let way = |axis: usize| {
            let u = along_u[axis] - spot.u * along_w[axis];
            let v = along_v[axis] - spot.v * along_w[axis];
            u * u + v * v
        };
        let (across, down) = (way(0), way(1));
        (0.6 * across.max(down) + 0.4 * across.min(down)).sqrt() * spot.depth
    }
}

impl Span {
    /// Brightness of its pixels, in 1/16384.
    fn light(&self, light: &mut [i16]) {
        let share = self.share();
        for (light, ends) in light.chunks_mut(self.piece).zip(self.spots.windows(2)) {
            let (from, to) = (f64::from(ends[0].light) * 16384.0, f64::from(ends[1].light) * 16384.0);
            let (mut value, step) = (from as i16, ((to - from) * share) as i16);
            for light in light {
                *light = value;
                value = value.wrapping_add(step);
            }
        }
    }

    /// What part of a straight piece a pixel is: exact, as pieces are powers of two.
    fn share(&self) -> f64 {
        1.0 / self.piece as f64
    }

    /// Its straight pieces on a tile so many metres wide and high.
    fn ways(&self, tile: (f64, f64)) -> impl Iterator<Item = Way> {
        const WHOLE: f64 = 4_294_967_296.0;
        let (scale, share) = ((WHOLE / tile.0, WHOLE / tile.1), self.share());
        self.spots.windows(2).map(move |ends| {
            let [from, to] = [&ends[0], &ends[1]].map(|spot| [spot.u * scale.0, spot.v * scale.1]);
            let step = [0, 1].map(|axis| (to[axis] - from[axis]) * share);
            // Whole tiles are left out.
            let part = |value: f64| value as i64 as u32;
            Way { start: from.map(part), step: step.map(part) }
        })
    }
}

/// As many pixels as straight pieces are multiples of: what is reckoned in loops of that length needs no remainder.
fn padded(count: usize) -> usize {
    count.next_multiple_of(SPAN / PIECES)
}

/// What pixels of a span show of a texture whose tile is `tile` metres wide and high, in 1/128.
fn sample(texture: &Texture, tile: (f64, f64), span: &Span, values: &mut [i16]) {
    let per_metre = texture.side() / (tile.0 * tile.1).sqrt();
    texture.fitting(span.footprint * per_metre).sample(span.ways(tile), span.piece, values);
}

/// Pixels of so much brightness in 1/128 under a light in 1/16384.
fn fill(pixels: &mut [u8], light: &[i16], values: &[i16]) {
    for ((pixel, &value), &light) in pixels.iter_mut().zip(values).zip(light) {
        let value = ((i32::from(value) * i32::from(light)) >> 16) as i16;
        *pixel = ((value + 16) >> 5).clamp(0, 255) as u8;
    }
}

/// The same for colours: the brighter the light, the further from grey.
fn fill_chroma(pixels: &mut [u8], light: &[i16], values: &[i16]) {
    for ((pixel, &value), &light) in pixels.iter_mut().zip(values).zip(light) {
        let colour = ((i32::from(value - (128 << 7)) * i32::from(light)) >> 16) as i16;
        *pixel = (((colour + 16) >> 5) + 128).clamp(0, 255) as u8;
    }
}

/// Adds grain, as strong as `gain` of 256.
fn add_grain(values: &mut [i16], grain: &[i16], gain: i16) {
    for (value, &grain) in values.iter_mut().zip(grain) {
        let rough = ((i32::from(grain - (128 << 7)) * i32::from(gain << 7)) >> 16) as i16;
        *value = value.saturating_add(rough << 1).max(0);
    }
}

/// From pixels to places (u w, v w, w) of the plane with these axes and origin (u, v, origin) in the camera's axes.
fn place_of_pixel(axes: &[Vector; 3], pinhole: &Pinhole) -> Matrix {
    let [u, v, origin] = *axes;
    // Rows of the inverse of the matrix with columns u, v, origin.
    let volume = dot(u, cross(v, origin));
    let rows = [cross(v, origin), cross(origin, u), cross(u, v)].map(|row| scale(row, 1.0 / volume));
    let (focal, x, y) = (pinhole.focal, pinhole.centre_x, pinhole.centre_y);
    rows.map(|[a, b, c]| [a / focal, b / focal, c - (a * x + b * y) / focal])
}
