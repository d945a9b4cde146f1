//! Painting skins into a picture, nearest first, several samples a pixel.

use std::ops::Range;

use super::{
    super::{
        light::Light,
        view::{CAMERA, Canvas, Vector, View, dot, scale, subtract},
    },
    clothes::Cloth,
    fill::{CARRIED, Corner, triangle},
    mesh::{Detail, Patch, Ring, Vertex, skin},
};
use crate::picture::Plane;

/// Samples that a picture's worth of body may take; closer up it is sampled less finely.
const BUDGET: f64 = 600_000.0;

/// A part of the picture, cut into samples.
pub(super) struct Window {
    /// First pixel; even, so that chroma pixels are whole.
    left: usize,
    top: usize,
    /// In pixels.
    width: usize,
    height: usize,
    /// Samples along a pixel's side.
    fineness: usize,
}

impl Window {
    /// The part of the view that these places lie in, if any.
    pub fn around(patches: &[Patch], view: &View, most: usize) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for vertex in patches.iter().flat_map(|patch| &patch.vertices) {
            let ((x, y), _) = view.pixel(vertex.place)?;
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        let limit = |place: f64, end: usize| place.clamp(0.0, end as f64) as usize;
        let (left, top) = (limit(low[0] - 1.0, view.size.0) & !1, limit(low[1] - 1.0, view.size.1) & !1);
        let width = limit(high[0] + 2.0, view.size.0).saturating_sub(left);
        let height = limit(high[1] + 2.0, view.size.1).saturating_sub(top);
        let pixels = (width * height) as f64;
        let fineness = if pixels * (most * most) as f64 > BUDGET { 1 } else { most };
        (width > 0 && height > 0).then_some(Self { left, top, width, height, fineness })
    }

    fn samples(&self) -> (usize, usize) {
        (self.width * self.fineness, self.height * self.fineness)
    }

    fn corner(&self, (x, y): (f64, f64), carried: [f32; CARRIED]) -> Corner {
        let fine = self.fineness as f64;
        let place = |pixel: f64, first: usize| ((pixel - first as f64 + 0.5) * fine - 0.5) as f32;
        Corner { x: place(x, self.left), y: place(y, self.top), carried }
    }
}

/// Every triangle of a patch that faces the camera.
fn facing(
    patch: &Patch,
    view: &View,
    corner: impl Fn(&Vertex, (f64, f64), f64) -> Corner,
) -> Vec<[Corner; 3]> {
    let seen: Vec<Option<Corner>> = patch
        .vertices
        .iter()
        .map(|vertex| {
            let (pixel, depth) = view.pixel(vertex.place)?;
            Some(corner(vertex, pixel, depth))
        })
        .collect();
    let towards = |index: usize| {
        let vertex = &patch.vertices[index];
        dot(vertex.normal, subtract(CAMERA, vertex.place)) > 0.0
    };
    let columns = patch.columns;
    let mut triangles = Vec::with_capacity(patch.vertices.len());
    for row in 0..patch.vertices.len() / columns - 1 {
        for column in 0..columns - 1 {
            let four = [0, 1, columns, columns + 1].map(|step| row * columns + column + step);
            if !four.iter().any(|&index| towards(index)) {
                continue;
            }
            if let [Some(a), Some(b), Some(c), Some(d)] = four.map(|index| seen[index]) {
                triangles.push([a, b, c]);
                triangles.push([b, d, c]);
            }
        }
    }
    triangles
}

/// Paints the body into the picture.
pub(super) fn paint(patches: &[Patch], cloths: &[Cloth], view: &View, light: &Light, canvas: &mut Canvas) {
    let Some(window) = Window::around(patches, view, 2) else { return };
    let samples = window.samples();
    // Nearness and colour of the nearest skin; 0 is none.
    let mut nearness = vec![0.0f32; samples.0 * samples.1];
    let mut colours = vec![[0u8; 4]; samples.0 * samples.1];
    // The nearest first: what is hidden need not be coloured.
    let depth = |patch: &Patch| view.seen(patch.vertices[patch.vertices.len() / 2].place)[2];
    let mut order: Vec<(f64, &Patch)> = patches.iter().map(|patch| (depth(patch), patch)).collect();
    order.sort_by(|one, other| one.0.total_cmp(&other.0));
    for (depth, patch) in order {
        let fine = view.pinhole.focal / depth * window.fineness as f64;
        let (texels, side, texels_per_metre) = cloths[patch.material].level(fine);
        let texture = Texture { texels, side, weave: (cloths[patch.material].weave * 256.0) as i32 };
        let corners = |vertex: &Vertex, pixel, depth: f64| {
            let [u, v] = vertex.cloth.map(|metres| (metres * texels_per_metre) as f32);
            window.corner(pixel, [(1.0 / depth) as f32, u, v, shade(vertex, light) as f32])
        };
        for corners in facing(patch, view, corners) {
            triangle(corners, samples, |start, end, carried, step| {
                let run = (&mut nearness[start..end], &mut colours[start..end]);
                // Close up texels are wider than samples: they melt into each other, and threads show.
                if fine > CLOSE {
                    fill(run, carried, step, |u, v, shade| texture.close(u, v, shade));
                } else {
                    fill(run, carried, step, |u, v, shade| texture.far(u, v, shade));
                }
            });
        }
    }
    blend(&window, &colours, canvas);
}

/// Samples a metre from which on texels are smoothed.
const CLOSE: f64 = 1500.0;

/// Colours those samples of a row whose skin is nearer than what is there.
///
/// Places in the cloth and shades run in 65536ths: whole numbers are fast.
fn fill(
    (nearness, colours): (&mut [f32], &mut [[u8; 4]]),
    carried: [f32; CARRIED],
    step: &[f32; CARRIED],
    colour: impl Fn(i32, i32, i32) -> [u8; 4],
) {
    let fixed = |value: f32| (value * 65536.0) as i32;
    let mut near = carried[0];
    let [mut u, mut v, mut shade] = [1, 2, 3].map(|index| fixed(carried[index]));
    let [right_u, right_v, right_shade] = [1, 2, 3].map(|index| fixed(step[index]));
    for (nearest, target) in nearness.iter_mut().zip(colours) {
        if near > *nearest {
            *nearest = near;
            *target = colour(u, v, shade >> 8);
        }
        near += step[0];
        u = u.wrapping_add(right_u);
        v = v.wrapping_add(right_v);
        shade = shade.wrapping_add(right_shade);
    }
}

/// How bright a place on the skin is.
fn shade(vertex: &Vertex, light: &Light) -> f64 {
    let way = subtract(CAMERA, vertex.place);
    let facing = dot(vertex.normal, scale(way, 1.0 / dot(way, way).sqrt()));
    if facing < -0.5 {
        return 0.0; // Seen by nobody.
    }
    light.at(vertex.place, vertex.normal) * vertex.open * (0.70 + 0.30 * facing.max(0.0).sqrt())
}

/// A level of a cloth.
struct Texture<'a> {
    texels: &'a [[u8; 4]],
    side: usize,
    /// In 256ths.
    weave: i32,
}

impl Texture<'_> {
    /// A row's texels.
    fn row(&self, row: i32) -> &[[u8; 4]] {
        &self.texels[(row as usize & (self.side - 1)) * self.side..][..self.side]
    }

    /// The nearest texel; places in 65536ths of texels, shade in 256ths.
    fn far(&self, u: i32, v: i32, shade: i32) -> [u8; 4] {
        let [y, u, v, _] = self.row(v >> 16)[(u >> 16) as usize & (self.side - 1)].map(i32::from);
        lit([y, u, v], shade)
    }

    /// Between texels, with threads that go over and under each other.
    fn close(&self, u: i32, v: i32, shade: i32) -> [u8; 4] {
        let (column, row) = (u >> 16, v >> 16);
        let (across, down) = (u >> 8 & 255, v >> 8 & 255);
        let columns = [column, column + 1].map(|column| column as usize & (self.side - 1));
        let [above, below] = [row, row + 1].map(|row| columns.map(|column| self.row(row)[column]));
        let four = [above[0], above[1], below[0], below[1]];
        let mixed = [0, 1, 2].map(|part| {
            let [a, b, c, d] = four.map(|texel| i32::from(texel[part]));
            let (above, below) = (a * 256 + (b - a) * across, c * 256 + (d - c) * across);
            (above * 256 + (below - above) * down + 32768) >> 16
        });
        let over = (across - 128).abs() + (down - 128).abs() - 128;
        let thread = if (column ^ row) & 1 == 0 { over } else { -over };
        lit(mixed, (shade * (65536 + self.weave * thread)) >> 16)
    }
}

/// Y, U, V and 1 for "covered". Black stays black, grey stays grey.
fn lit([y, u, v]: [i32; 3], shade: i32) -> [u8; 4] {
    let scaled = |value: i32, zero: i32| (zero + (((value - zero) * shade + 128) >> 8)).clamp(0, 255) as u8;
    [scaled(y, 16), scaled(u, 128), scaled(v, 128), 1]
}

/// Averages the samples of every pixel over what the picture shows behind them.
fn blend(window: &Window, colours: &[[u8; 4]], canvas: &mut Canvas) {
    match window.fineness {
        1 => blend_fine::<1>(window, colours, canvas),
        _ => blend_fine::<2>(window, colours, canvas),
    }
}

/// The same for so many samples along a pixel's side, known beforehand: sums need no loops.
fn blend_fine<const FINE: usize>(window: &Window, colours: &[[u8; 4]], canvas: &mut Canvas) {
    let stride = window.samples().0;
    let [luma, chroma @ ..] = &mut canvas.planes;
    for (index, rows) in colours.chunks(2 * FINE * stride).enumerate() {
        let (y, covered) = (2 * index, covered(rows, stride));
        for x in (((covered.start / FINE) & !1)..covered.end.div_ceil(FINE)).step_by(2) {
            let mut block = Sum::default();
            for (x, down) in [(x, 0), (x + 1, 0), (x, 1), (x + 1, 1)] {
                if x < window.width && y + down < window.height {
                    let sum = Sum::of::<FINE>(rows, down * FINE * stride + x * FINE, stride);
                    sum.over(&mut luma.data[(window.top + y + down) * luma.width + window.left + x], 0);
                    block.add(sum);
                }
            }
            for (index, plane) in chroma.iter_mut().enumerate() {
                let place = (window.top + y) / 2 * plane.width + (window.left + x) / 2;
                block.over(&mut plane.data[place], index + 1);
            }
        }
    }
}

/// From the first to the last column of some rows in which there is any skin.
fn covered(rows: &[[u8; 4]], stride: usize) -> Range<usize> {
    let none = |colour: &&[u8; 4]| colour[3] == 0;
    let (mut start, mut end) = (stride, 0);
    for row in rows.chunks_exact(stride) {
        start = start.min(row.iter().take_while(none).count());
        end = end.max(stride - row.iter().rev().take_while(none).count());
    }
    start..end
}

/// Y, U, V and coverage of some samples together; what is not covered is black.
#[derive(Default, Clone, Copy)]
struct Sum {
    parts: [u32; 4],
    samples: u32,
}

impl Sum {
    /// A square of samples, a power of two along its side.
    fn of<const SIDE: usize>(colours: &[[u8; 4]], first: usize, stride: usize) -> Self {
        // Two parts at a time, each with 16 bits to grow.
        let (mut even, mut odd) = (0u32, 0u32);
        for row in 0..SIDE {
            for &colour in &colours[first + row * stride..][..SIDE] {
                let parts = u32::from_le_bytes(colour);
                even += parts & 0x00ff_00ff;
                odd += parts >> 8 & 0x00ff_00ff;
            }
        }
        let parts = [even & 0xffff, odd & 0xffff, even >> 16, odd >> 16];
        Self { parts, samples: (SIDE * SIDE) as u32 }
    }

    fn add(&mut self, other: Self) {
        self.parts.iter_mut().zip(other.parts).for_each(|(part, more)| *part += more);
        self.samples += other.samples;
    }

    /// One of its parts over a pixel of the picture.
    fn over(&self, pixel: &mut u8, part: usize) {
        let covered = self.parts[3];
        if covered > 0 {
            let behind = u32::from(*pixel) * (self.samples - covered);
            // Samples are as many as a power of two: of one, two or four pixels.
            let half = self.samples / 2;
            *pixel = ((self.parts[part] + behind + half) >> self.samples.trailing_zeros()) as u8;
        }
    }
}

/// Marks the pixels whose centre the body covers.
pub(super) fn mark(patches: &[Patch], view: &View, mask: &mut Plane) {
    let Some(window) = Window::around(patches, view, 1) else { return };
    for patch in patches {
        for corners in facing(patch, view, |_, pixel, _| window.corner(pixel, [0.0; 4])) {
            triangle(corners, window.samples(), |start, end, _, _| {
                let (row, first) = (start / window.width, start % window.width);
                let begin = (window.top + row) * mask.width + window.left + first;
                mask.data[begin..begin + end - start].fill(255);
            });
        }
    }
}

/// A soft round patch of darkness on the floor: `dark` in the middle, nothing at `radius` metres.
pub(super) fn shadow(middle: Vector, radius: f64, dark: f64, view: &View, canvas: &mut Canvas) {
    let rings: Vec<Ring> = (0..=8)
        .map(|step| {
            let share = f64::from(step) / 8.0;
            Ring {
                centre: middle,
                right: [radius * share, 0.0, 0.0],
                ahead: [0.0, 0.0, radius * share],
                open: dark * (1.0 - share * share).powi(2),
            }
        })
        .collect();
    let mut disc = skin(&rings, 0, [0.0; 2], Detail { corners: 20, steps: 1 });
    disc.vertices.iter_mut().for_each(|vertex| vertex.normal = [0.0, 1.0, 0.0]);
    let patches = [disc];
    let Some(window) = Window::around(&patches, view, 1) else { return };
    let corners = |vertex: &Vertex, pixel, _| window.corner(pixel, [vertex.open as f32, 0.0, 0.0, 0.0]);
    let plane = &mut canvas.planes[0];
    for corners in facing(&patches[0], view, corners) {
        triangle(corners, window.samples(), |start, end, mut carried, step| {
            let begin =
                (window.top + start / window.width) * plane.width + window.left + start % window.width;
            for pixel in &mut plane.data[begin..begin + end - start] {
                *pixel = (16.5 + (f32::from(*pixel) - 16.0) * (1.0 - carried[0])) as u8;
                carried[0] += step[0];
            }
        });
    }
}
