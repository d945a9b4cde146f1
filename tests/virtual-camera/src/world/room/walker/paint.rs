// SPDX-License-Identifier: MPL-2.0

//! Painting skins into a picture, nearest first.

use super::{
    super::{
        light::Light,
        view::{Canvas, Vector, View, dot, scale, subtract},
    },
    clothes::Cloth,
    fill::{CARRIED, Corner, triangle},
    mesh::{Detail, Ring, SkinPatch, Vertex, skin},
};
use crate::{
    picture::Plane,
    world::layer::{ASIDE, Layer, MOMENTS, Window},
};

/// The part of the picture that these skins lie in; none where one of them is behind the camera.
fn window(patches: &[SkinPatch], view: &View) -> Option<Window> {
    let vertices = patches.iter().flat_map(|patch| &patch.vertices);
    let pixels: Vec<_> = vertices.map(|vertex| Some(view.pixel(vertex.place)?.0)).collect::<Option<_>>()?;
    Window::around(pixels.into_iter(), view.size)
}

/// A corner in a window, for samples that lie `aside` of the middle of their pixel.
fn corner(window: &Window, (x, y): (f64, f64), aside: (f64, f64), carried: [f32; CARRIED]) -> Corner {
    let place = |pixel: f64, aside: f64, first: usize| (pixel - aside - first as f64) as f32;
    Corner { x: place(x, aside.0, window.left), y: place(y, aside.1, window.top), carried }
}

/// Every triangle of a patch that faces the camera.
fn facing(
    patch: &SkinPatch,
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
        dot(vertex.normal, subtract(view.lens(), vertex.place)) > 0.0
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

/// A body at one moment of an exposure, and how the camera sees it then.
pub(super) struct Moment {
    pub patches: Vec<SkinPatch>,
    pub view: View,
}

/// Paints the body alone, as the mean of some moments; `None` where nothing of it is in the picture.
pub(super) fn paint(moments: &[Moment; MOMENTS], cloths: &[Cloth], light: &Light) -> Option<Layer> {
    let windows = moments.iter().filter_map(|moment| window(&moment.patches, &moment.view));
    let corners = windows.flat_map(|Window { left, top, width, height }| {
        [(left, top), (left + width, top + height)].map(|(x, y)| (x as f64, y as f64))
    });
    let window = Window::around(corners, moments[0].view.size)?;
    let mut layer = Layer::new(window);
    let samples = window.width * window.height;
    // Nearness and colour of the nearest skin; 0 is none.
    let (mut nearness, mut colours) = (vec![0.0f32; samples], vec![[0u8; 4]; samples]);
    for (moment, aside) in moments.iter().zip(ASIDE) {
        nearness.fill(0.0);
        colours.fill([0; 4]);
        sample(moment, aside, cloths, light, &window, (&mut nearness, &mut colours));
        layer.add(&colours);
    }
    Some(layer)
}

/// Takes one sample a pixel of a window.
fn sample(
    Moment { patches, view }: &Moment,
    aside: (f64, f64),
    cloths: &[Cloth],
    light: &Light,
    window: &Window,
    (nearness, colours): (&mut [f32], &mut [[u8; 4]]),
) {
    // The nearest first: what is hidden need not be coloured.
    let depth = |patch: &SkinPatch| view.seen(patch.vertices[patch.vertices.len() / 2].place)[2];
    let mut order: Vec<(f64, &SkinPatch)> = patches.iter().map(|patch| (depth(patch), patch)).collect();
    order.sort_by(|one, other| one.0.total_cmp(&other.0));
    for (depth, patch) in order {
        // Moments together are twice as fine.
        let fine = view.pinhole.focal / depth * 2.0;
        let (texels, side, texels_per_metre) = cloths[patch.material].level(fine);
        let texture = Texture { texels, side, weave: (cloths[patch.material].weave * 256.0) as i32 };
        let corners = |vertex: &Vertex, pixel, depth: f64| {
            let [u, v] = vertex.cloth.map(|metres| (metres * texels_per_metre) as f32);
            corner(
                window,
                pixel,
                aside,
                [(1.0 / depth) as f32, u, v, shade(vertex, view.lens(), light) as f32],
            )
        };
        for corners in facing(patch, view, corners) {
            triangle(corners, window.size(), |start, end, carried, step| {
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

/// How bright a place on the skin is, seen from the lens.
fn shade(vertex: &Vertex, lens: Vector, light: &Light) -> f64 {
    let way = subtract(lens, vertex.place);
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

/// Left, top, right and bottom of skins in pixels of the view, inside of it or not, edges of pixels at whole numbers; `None` unless
/// all of them is ahead of the camera.
pub(in crate::world::room) fn bounds(patches: &[SkinPatch], view: &View) -> Option<[f64; 4]> {
    let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for vertex in patches.iter().flat_map(|patch| &patch.vertices) {
        let ((x, y), _) = view.pixel(vertex.place)?;
        let (x, y) = (x + 0.5, y + 0.5);
        bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
    }
    Some(bounds)
}

/// Marks the pixels whose centre the body covers.
pub(in crate::world::room) fn mark(patches: &[SkinPatch], view: &View, mask: &mut Plane) {
    let Some(window) = window(patches, view) else { return };
    for patch in patches {
        for corners in facing(patch, view, |_, pixel, _| corner(&window, pixel, (0.0, 0.0), [0.0; 4])) {
            triangle(corners, window.size(), |start, end, _, _| {
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
    let Some(window) = window(&patches, view) else { return };
    let corners =
        |vertex: &Vertex, pixel, _| corner(&window, pixel, (0.0, 0.0), [vertex.open as f32, 0.0, 0.0, 0.0]);
    let plane = &mut canvas.planes[0];
    for corners in facing(&patches[0], view, corners) {
        triangle(corners, window.size(), |start, end, mut carried, step| {
            let begin =
                (window.top + start / window.width) * plane.width + window.left + start % window.width;
            for pixel in &mut plane.data[begin..begin + end - start] {
                *pixel = (16.5 + (f32::from(*pixel) - 16.0) * (1.0 - carried[0])) as u8;
                carried[0] += step[0];
            }
        });
    }
}
