//! Painting skins into a picture, nearest first, several samples a pixel.

use super::{
    super::{
        light::Light,
        view::{CAMERA, Canvas, Vector, View, dot, scale, subtract},
    },
    clothes::Cloth,
    fill::{Corner, triangle},
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

    fn corner(&self, (x, y): (f64, f64), carried: [f32; 4]) -> Corner {
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
    for patch in patches {
        let depth = view.pixel(patch.vertices[0].place).map_or(1.0, |(_, depth)| depth);
        let fine = view.pinhole.focal / depth * window.fineness as f64;
        let (texels, side, texels_per_metre) = cloths[patch.material].level(fine);
        let texture = Texture { texels, side, weave: cloths[patch.material].weave, close: fine > 1500.0 };
        let corners = |vertex: &Vertex, pixel, depth: f64| {
            let [u, v] = vertex.cloth.map(|metres| (metres * texels_per_metre) as f32);
            window.corner(pixel, [(1.0 / depth) as f32, u, v, shade(vertex, light) as f32])
        };
        for corners in facing(patch, view, corners) {
            triangle(corners, samples, |start, end, mut carried, step| {
                let (near, colours) = (&mut nearness[start..end], &mut colours[start..end]);
                for (near, colour) in near.iter_mut().zip(colours) {
                    if carried[0] > *near {
                        *near = carried[0];
                        *colour = texture.colour(carried[1], carried[2], carried[3]);
                    }
                    for (value, step) in carried.iter_mut().zip(step) {
                        *value += step;
                    }
                }
            });
        }
    }
    blend(&window, &colours, canvas);
}

/// How bright a place on the skin is.
fn shade(vertex: &Vertex, light: &Light) -> f64 {
    let way = subtract(CAMERA, vertex.place);
    let facing = dot(vertex.normal, scale(way, 1.0 / dot(way, way).sqrt())).max(0.0);
    light.at(vertex.place, vertex.normal) * vertex.open * (0.70 + 0.30 * facing.sqrt())
}

struct Texture<'a> {
    texels: &'a [[u8; 4]],
    side: usize,
    weave: f32,
    /// Whether texels are wider than samples, so that threads show.
    close: bool,
}

impl Texture<'_> {
    /// Y, U, V and 255 for "covered".
    fn colour(&self, u: f32, v: f32, shade: f32) -> [u8; 4] {
        let mask = self.side - 1;
        let (column, row) = (u.floor() as i32, v.floor() as i32);
        let texel =
            |column: i32, row: i32| self.texels[(row as usize & mask) * self.side + (column as usize & mask)];
        if !self.close {
            let [y, u, v, _] = texel(column, row);
            return lit(f32::from(y), f32::from(u), f32::from(v), shade);
        }
        let (across, down) = (u - column as f32, v - row as f32);
        let four =
            [texel(column, row), texel(column + 1, row), texel(column, row + 1), texel(column + 1, row + 1)];
        let mixed = |part: usize| {
            let of = |index: usize| f32::from(four[index][part]);
            let above = of(0) + (of(1) - of(0)) * across;
            let below = of(2) + (of(3) - of(2)) * across;
            above + (below - above) * down
        };
        // Threads over and under each other.
        let over = (across - 0.5).abs() + (down - 0.5).abs();
        let thread = if (column ^ row) & 1 == 0 { over } else { 1.0 - over };
        lit(mixed(0), mixed(1), mixed(2), shade * (1.0 + self.weave * (thread - 0.5)))
    }
}

/// Black stays black, grey stays grey.
fn lit(y: f32, u: f32, v: f32, shade: f32) -> [u8; 4] {
    let tint = |value: f32| (128.5 + (value - 128.0) * shade) as u8;
    [(16.5 + (y - 16.0) * shade) as u8, tint(u), tint(v), 255]
}

/// Averages the samples of every pixel over what the picture shows behind them.
fn blend(window: &Window, colours: &[[u8; 4]], canvas: &mut Canvas) {
    for (index, plane) in canvas.planes.iter_mut().enumerate() {
        let shrink = if index == 0 { 1 } else { 2 };
        let side = window.fineness * shrink;
        let stride = window.samples().0;
        let (left, top) = (window.left / shrink, window.top / shrink);
        for row in 0..window.height.div_ceil(shrink) {
            let Some(line) = plane.data.get_mut((top + row) * plane.width..(top + row + 1) * plane.width)
            else {
                break;
            };
            let rows = row * side..((row + 1) * side).min(window.samples().1);
            for (column, pixel) in line[left..].iter_mut().take(window.width.div_ceil(shrink)).enumerate() {
                let columns = column * side..((column + 1) * side).min(stride);
                let (mut sum, mut covered, mut all) = (0u32, 0u32, 0u32);
                for row in rows.clone() {
                    for colour in &colours[row * stride + columns.start..row * stride + columns.end] {
                        let hit = u32::from(colour[3] & 1);
                        sum += u32::from(colour[index]) * hit;
                        covered += hit;
                        all += 1;
                    }
                }
                if covered > 0 {
                    *pixel = ((sum + u32::from(*pixel) * (all - covered) + all / 2) / all) as u8;
                }
            }
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
