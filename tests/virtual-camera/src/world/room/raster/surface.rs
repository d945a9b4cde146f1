//! A flat piece of the room: where it is, what it is made of, how it is lit, and how it is drawn.

use std::{ops::Range, sync::Arc};

use super::{
    cover::cover,
    texture::{Level, Material, Texture},
};
use crate::{
    geometry::{Matrix, Pinhole},
    picture::Plane,
    world::room::view::{Canvas, Vector, View, add, cross, dot, scale},
};

/// Pixels between places computed exactly; straight lines in between.
const SPAN: usize = 16;
/// Nothing nearer than this is drawn, in metres.
const NEAR: f64 = 0.05;
/// Where a pixel covers so many pixels of the grain, nothing of it is left to see.
const COARSEST_GRAIN: f64 = 12.0;
/// How far a piece reaches under a neighbour drawn later, in pixels, so that nothing shines through the joint.
const OVERLAP: f64 = 0.7;

/// Brightness over a surface: values at the crossings of a grid, even between them.
#[derive(Debug, Clone)]
pub(in super::super) struct LightMap {
    columns: usize,
    rows: usize,
    /// Crossings per metre.
    per_metre: (f64, f64),
    values: Vec<f32>,
}

impl LightMap {
    /// Of a surface of `size` metres: `brightness` at places at most `step` metres apart.
    pub fn new(size: (f64, f64), step: f64, brightness: impl Fn(f64, f64) -> f64) -> Self {
        let cells = |length: f64| ((length / step).ceil() as usize).max(1);
        let (columns, rows) = (cells(size.0) + 1, cells(size.1) + 1);
        let per_metre = ((columns - 1) as f64 / size.0, (rows - 1) as f64 / size.1);
        let value = |i: usize| {
            brightness((i % columns) as f64 / per_metre.0, (i / columns) as f64 / per_metre.1) as f32
        };
        Self { columns, rows, per_metre, values: (0..columns * rows).map(value).collect() }
    }

    /// The same brightness all over.
    pub fn even(brightness: f64) -> Self {
        Self::new((1.0, 1.0), 1.0, |_, _| brightness)
    }

    /// At a place of the surface, in metres.
    pub fn at(&self, u: f64, v: f64) -> f32 {
        let split = |place: f64, count: usize| {
            let place = place.clamp(0.0, (count - 1) as f64);
            let whole = (place as usize).min(count - 2);
            (whole, place as f32 - whole as f32)
        };
        let (column, right) = split(u * self.per_metre.0, self.columns);
        let (row, down) = split(v * self.per_metre.1, self.rows);
        let at = row * self.columns + column;
        let line = |at: usize| self.values[at] * (1.0 - right) + self.values[at + 1] * right;
        line(at) * (1.0 - down) + line(at + self.columns) * down
    }
}

/// A convex flat piece. A place on it is (u, v), in metres from its origin along its two axes.
#[derive(Debug, Clone)]
pub(in super::super) struct Surface {
    /// Where (0, 0) lies.
    pub origin: Vector,
    /// Direction of u, of length 1.
    pub u: Vector,
    /// Direction of v, of length 1, square to u.
    pub v: Vector,
    /// Corners, in order.
    pub outline: Vec<(f64, f64)>,
    /// Which edges (from corner i to the next) another piece joins that is drawn later.
    pub joined: Vec<bool>,
    /// What it is made of.
    pub material: Arc<Material>,
    /// The place of the material's tile that lies at (0, 0), in metres.
    pub offset: (f64, f64),
    /// How it is lit.
    pub light: LightMap,
}

impl Surface {
    /// A rectangle, lit evenly and joined to nothing.
    pub fn rectangle(
        origin: Vector,
        u: Vector,
        v: Vector,
        size: (f64, f64),
        material: &Arc<Material>,
    ) -> Self {
        Self {
            origin,
            u,
            v,
            outline: vec![(0.0, 0.0), (size.0, 0.0), size, (0.0, size.1)],
            joined: vec![false; 4],
            material: material.clone(),
            offset: (0.0, 0.0),
            light: LightMap::even(1.0),
        }
    }

    /// Where a place on it is in the room.
    pub fn point(&self, u: f64, v: f64) -> Vector {
        add(self.origin, add(scale(self.u, u), scale(self.v, v)))
    }

    /// Out of the surface, towards those who see u to the right and v down.
    pub fn normal(&self) -> Vector {
        cross(self.u, self.v)
    }

    /// Does a viewer see its front?
    pub fn faces(&self, viewer: Vector) -> bool {
        let way = [0, 1, 2].map(|axis| viewer[axis] - self.origin[axis]);
        dot(self.normal(), way) > 0.0
    }

    /// Its corners in a view, cut where they are behind the camera; nothing if it is out of sight.
    pub fn polygon(&self, view: &View) -> Vec<(f64, f64)> {
        polygon_in_view(&self.corners(view), view)
    }

    /// Corners in the room, a little further out where others join.
    fn corners(&self, view: &View) -> Vec<Vector> {
        let count = self.outline.len();
        let outward = |edge: usize| {
            let (a, b) = (self.outline[edge], self.outline[(edge + 1) % count]);
            let length = (b.0 - a.0).hypot(b.1 - a.1);
            ((b.1 - a.1) / length, (a.0 - b.0) / length)
        };
        let corner = |i: usize| {
            let (u, v) = self.outline[i];
            let depth = view.seen(self.point(u, v))[2].max(NEAR);
            let overlap = OVERLAP * depth / view.pinhole.focal;
            let meeting = [(i + count - 1) % count, i];
            let moves = meeting.into_iter().filter(|&edge| self.joined[edge]).map(outward);
            let (u, v) = moves.fold((u, v), |(u, v), way| (u + way.0 * overlap, v + way.1 * overlap));
            self.point(u, v)
        };
        (0..count).map(corner).collect()
    }

    /// Draws it over what is there.
    pub fn draw(&self, view: &View, canvas: &mut Canvas) {
        let polygon = self.polygon(view);
        if polygon.is_empty() {
            return;
        }
        let halved: Vec<_> = polygon.iter().map(|(x, y)| ((x - 0.5) / 2.0, (y - 0.5) / 2.0)).collect();
        let half = view.halved();
        let [luma, u, v] = &mut canvas.planes;
        let material = &*self.material;
        let brush = Brush::new(self, view, &material.luma, None);
        brush.fill(&polygon, view.size, luma);
        for (index, plane) in [u, v].into_iter().enumerate() {
            let brush = Brush::new(self, &half, &material.chroma[index], material.plain[index]);
            brush.fill_chroma(&halved, half.size, plane);
        }
    }
}

/// Corners in the room as a polygon of a view, cut where they are behind the camera; nothing if it is out of sight.
fn polygon_in_view(corners: &[Vector], view: &View) -> Vec<(f64, f64)> {
    let seen: Vec<Vector> = corners.iter().map(|&corner| view.seen(corner)).collect();
    let mut polygon = Vec::with_capacity(seen.len() + 1);
    for (i, &a) in seen.iter().enumerate() {
        let b = seen[(i + 1) % seen.len()];
        if a[2] >= NEAR {
            polygon.push(view.project(a));
        }
        if (a[2] >= NEAR) != (b[2] >= NEAR) {
            let share = (NEAR - a[2]) / (b[2] - a[2]);
            let mut cut = [0, 1, 2].map(|axis| a[axis] + (b[axis] - a[axis]) * share);
            cut[2] = NEAR;
            polygon.push(view.project(cut));
        }
    }
    let (width, height) = (view.size.0 as f64, view.size.1 as f64);
    let beyond = |outside: fn(f64, f64) -> bool, x: f64, pick: fn(&(f64, f64)) -> f64| {
        polygon.iter().all(|corner| outside(pick(corner), x))
    };
    let out = beyond(|a, b| a < b, -1.0, |c| c.0)
        || beyond(|a, b| a > b, width, |c| c.0)
        || beyond(|a, b| a < b, -1.0, |c| c.1)
        || beyond(|a, b| a > b, height, |c| c.1);
    if out { Vec::new() } else { polygon }
}

/// All that is needed to fill pixels of one plane.
struct Brush<'a> {
    surface: &'a Surface,
    texture: &'a Texture,
    plain: Option<u8>,
    /// From pixel to place: (u w, v w, w), with w the depth's inverse.
    place: Matrix,
    /// Texture pixels per metre.
    per_metre: (f64, f64),
}

/// A place of a surface with its brightness, exact.
#[derive(Clone, Copy)]
struct Spot {
    u: f64,
    v: f64,
    light: f32,
}

impl<'a> Brush<'a> {
    fn new(surface: &'a Surface, view: &View, texture: &'a Texture, plain: Option<u8>) -> Self {
        let tile = surface.material.tile;
        let per_metre = (texture.side() / tile.0, texture.side() / tile.1);
        let axes = [view.turned(surface.u), view.turned(surface.v), view.seen(surface.origin)];
        Self { surface, texture, plain, place: place_of_pixel(&axes, &view.pinhole), per_metre }
    }

    fn fill(&self, polygon: &[(f64, f64)], size: (usize, usize), plane: &mut Plane) {
        self.paint(polygon, size, plane, |brush, row, columns, line| brush.shade(row, columns, line));
    }

    fn fill_chroma(&self, polygon: &[(f64, f64)], size: (usize, usize), plane: &mut Plane) {
        self.paint(polygon, size, plane, |brush, row, columns, line| brush.shade_chroma(row, columns, line));
    }

    fn paint(
        &self,
        polygon: &[(f64, f64)],
        size: (usize, usize),
        plane: &mut Plane,
        shade: impl Fn(&Self, usize, Range<usize>, &mut [u8]),
    ) {
        let mut before = Vec::new();
        cover(polygon, size, |covered| {
            let line = &mut plane.data[covered.row * size.0..][..size.0];
            before.clear();
            before.extend(covered.edges().map(|(column, _)| line[column]));
            shade(self, covered.row, covered.columns.clone(), &mut line[covered.columns.clone()]);
            for ((column, part), &old) in covered.edges().zip(&before) {
                let (part, old, new) = (i32::from(part), i32::from(old), i32::from(line[column]));
                line[column] = (old + (((new - old) * part + 128) >> 8)) as u8;
            }
        });
    }

    fn spot(&self, x: f64, y: f64) -> Spot {
        let [u, v, w] = [0, 1, 2].map(|row| {
            let line = &self.place[row];
            line[0] * x + line[1] * y + line[2]
        });
        let depth = 1.0 / w.max(1e-6);
        let (u, v) = (u * depth, v * depth);
        let light = if self.surface.material.glows { 1.0 } else { self.surface.light.at(u, v) };
        Spot { u, v, light }
    }

    /// Width of a pixel's footprint around a place, in metres: between its longest and its shortest way.
    fn footprint(&self, x: f64, y: f64, spot: &Spot) -> f64 {
        let [along_u, along_v, along_w] = &self.place;
        let depth = 1.0 / (along_w[0] * x + along_w[1] * y + along_w[2]).max(1e-6);
        let way = |axis: usize| {
            let u = (along_u[axis] - spot.u * along_w[axis]) * depth;
            let v = (along_v[axis] - spot.v * along_w[axis]) * depth;
            (u * u + v * v).sqrt()
        };
        let (across, down) = (way(0), way(1));
        0.6 * across.max(down) + 0.4 * across.min(down)
    }

    /// Calls `each` with pieces of the row short enough to be straight.
    fn spans(
        &self,
        row: usize,
        columns: Range<usize>,
        line: &mut [u8],
        mut each: impl FnMut(Span, &mut [u8]),
    ) {
        let y = row as f64;
        let mut x = columns.start as f64;
        let mut from = self.spot(x, y);
        for pixels in line.chunks_mut(SPAN) {
            let middle = x;
            x += pixels.len() as f64;
            let to = self.spot(x, y);
            let span = Span { from, to, length: pixels.len() as f64, x: middle, y };
            each(span, pixels);
            from = to;
        }
    }

    fn shade(&self, row: usize, columns: Range<usize>, line: &mut [u8]) {
        let scale = (self.per_metre.0 * self.per_metre.1).sqrt();
        self.spans(row, columns, line, |span, pixels| {
            let footprint = self.footprint(span.x, span.y, &span.from);
            let (level, halved) = self.texture.fitting(footprint * scale);
            let (walk, light) = (self.walk(&span, halved, self.per_metre), span.light());
            let detail = self.surface.material.detail.as_ref();
            let Some(detail) = detail.filter(|detail| footprint * detail.per_metre < COARSEST_GRAIN) else {
                fill(pixels, light, level, walk);
                return;
            };
            let (grain, halved) = detail.texture.fitting(footprint * detail.per_metre);
            let fine = self.walk(&span, halved, (detail.per_metre, detail.per_metre));
            fill_with_grain(pixels, light, (level, walk), (grain, fine), detail.gain);
        });
    }

    fn shade_chroma(&self, row: usize, columns: Range<usize>, line: &mut [u8]) {
        self.spans(row, columns, line, |span, pixels| {
            let (mut light, light_step) = span.light();
            let mut lit = |value: i32| {
                let colour = 128 + (((value - (128 << 8)) * light + (1 << 19)) >> 20);
                light += light_step;
                colour.clamp(0, 255) as u8
            };
            if let Some(value) = self.plain {
                pixels.iter_mut().for_each(|pixel| *pixel = lit(i32::from(value) << 8));
                return;
            }
            let footprint = self.footprint(span.x, span.y, &span.from);
            let (texture, halved) =
                self.texture.fitting(footprint * (self.per_metre.0 * self.per_metre.1).sqrt());
            let mut walk = self.walk(&span, halved, self.per_metre);
            for pixel in pixels {
                *pixel = lit(texture.sample(walk.u, walk.v) as i32);
                walk.next();
            }
        });
    }

    /// Places of a span's pixels in a texture of `per_metre` pixels per metre at 1/2^`level` of its resolution.
    fn walk(&self, span: &Span, level: usize, per_metre: (f64, f64)) -> Walk {
        let shrink = 65536.0 / (1u64 << level.min(30)) as f64;
        let place = |u: f64, per_metre: f64, offset: f64| ((u + offset) * per_metre * shrink) as i64 - 32768;
        let (offset_u, offset_v) = self.surface.offset;
        let step =
            |from: f64, to: f64, per_metre: f64| ((to - from) / span.length * per_metre * shrink) as i64;
        Walk {
            u: place(span.from.u, per_metre.0, offset_u) as u32,
            v: place(span.from.v, per_metre.1, offset_v) as u32,
            step_u: step(span.from.u, span.to.u, per_metre.0) as u32,
            step_v: step(span.from.v, span.to.v, per_metre.1) as u32,
        }
    }
}

/// A piece of a row, with what lies at both of its ends.
struct Span {
    from: Spot,
    to: Spot,
    length: f64,
    x: f64,
    y: f64,
}

impl Span {
    /// Brightness at the start and its growth by pixel, in 1/4096.
    fn light(&self) -> (i32, i32) {
        let step = f64::from(self.to.light - self.from.light) / self.length;
        ((self.from.light * 4096.0) as i32, (step * 4096.0) as i32)
    }
}

/// A straight way through a texture, in 1/65536 pixel; wraps around.
#[derive(Clone, Copy)]
struct Walk {
    u: u32,
    v: u32,
    step_u: u32,
    step_v: u32,
}

impl Walk {
    #[inline(always)]
    fn next(&mut self) {
        self.u = self.u.wrapping_add(self.step_u);
        self.v = self.v.wrapping_add(self.step_v);
    }
}

/// Pixels of a tile under a light that changes evenly.
fn fill(pixels: &mut [u8], (mut light, step): (i32, i32), level: &Level, mut walk: Walk) {
    for pixel in pixels {
        let value = level.sample(walk.u, walk.v) as i32;
        *pixel = ((value * light) >> 20).min(255) as u8;
        walk.next();
        light += step;
    }
}

/// The same with grain on top, `gain` in 1/256.
fn fill_with_grain(
    pixels: &mut [u8],
    (mut light, step): (i32, i32),
    (level, mut walk): (&Level, Walk),
    (grain, mut fine): (&Level, Walk),
    gain: i32,
) {
    for pixel in pixels {
        let rough = grain.sample(fine.u, fine.v) as i32 - (128 << 8);
        let value = level.sample(walk.u, walk.v) as i32 + ((rough * gain) >> 8);
        *pixel = ((value.max(0) * light) >> 20).min(255) as u8;
        walk.next();
        fine.next();
        light += step;
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
