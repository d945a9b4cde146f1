// SPDX-License-Identifier: MPL-2.0

//! Pictures whose every motion is known: smooth noise, sampled anywhere between the pixels.

use opencv::core::Rect2f;

use crate::vision::Luma;

/// A grey picture in memory.
pub(super) struct Picture {
    data: Vec<u8>,
    width: usize,
    height: usize,
}

impl Picture {
    pub fn luma(&self) -> Luma<'_> {
        Luma::new(&self.data, self.width, self.height, self.width).expect("whole picture")
    }

    /// Puts other pixels, as many, in place of its own.
    pub fn replace(&mut self, pixels: Vec<u8>) {
        assert_eq!(pixels.len(), self.data.len());
        self.data = pixels;
    }

    /// Makes what is in a rectangle a third as light.
    pub fn darken(&mut self, bounds: Rect2f) {
        for (index, pixel) in self.data.iter_mut().enumerate() {
            let (x, y) = ((index % self.width) as f32, (index / self.width) as f32);
            if bounds.contains(opencv::core::Point2f::new(x, y)) {
                *pixel /= 3;
            }
        }
    }

    /// Paints a rectangle with a texture of its own, which moves with it.
    pub fn paint(&mut self, bounds: Rect2f, seed: u32) {
        for y in 0..self.height {
            for x in 0..self.width {
                let (u, v) = (x as f32 - bounds.x, y as f32 - bounds.y);
                if (0.0..bounds.width).contains(&u) && (0.0..bounds.height).contains(&v) {
                    self.data[y * self.width + x] = texture(seed, u, v);
                }
            }
        }
    }
}

/// A textured background of one size.
pub(super) struct Scene {
    width: usize,
    height: usize,
}

impl Scene {
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height }
    }

    /// The background with its content moved by `shift` pixels.
    pub fn background(&self, shift: (f32, f32)) -> Picture {
        self.warped(|x, y| (x - shift.0, y - shift.1))
    }

    /// The background as `source` says: from a pixel to where its content comes from.
    pub fn warped(&self, source: impl Fn(f32, f32) -> (f32, f32)) -> Picture {
        let data = (0..self.height * self.width)
            .map(|index| {
                let (x, y) = source((index % self.width) as f32, (index / self.width) as f32);
                texture(1, x, y)
            })
            .collect();
        Picture { data, width: self.width, height: self.height }
    }

    /// One grey level.
    pub fn flat(&self, level: u8) -> Picture {
        Picture { data: vec![level; self.width * self.height], width: self.width, height: self.height }
    }
}

/// Grey level of texture `seed` at (`x`, `y`): two octaves of value noise.
fn texture(seed: u32, x: f32, y: f32) -> u8 {
    let level = 128.0
        + 80.0 * (noise(seed, x / 9.0, y / 9.0) - 0.5) * 2.0
        + 45.0 * (noise(seed ^ 0x5bd1, x / 4.0, y / 4.0) - 0.5) * 2.0;
    level.clamp(0.0, 255.0).round() as u8
}

fn noise(seed: u32, x: f32, y: f32) -> f32 {
    let (left, top) = (x.floor(), y.floor());
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    let (u, v) = (ease(x - left), ease(y - top));
    let at = |dx: i32, dy: i32| lattice(seed, left as i32 + dx, top as i32 + dy);
    let upper = at(0, 0) * (1.0 - u) + at(1, 0) * u;
    let lower = at(0, 1) * (1.0 - u) + at(1, 1) * u;
    upper * (1.0 - v) + lower * v
}

/// 0 to 1, the same for the same place.
fn lattice(seed: u32, x: i32, y: i32) -> f32 {
    let mut hash = seed
        .wrapping_mul(0x9e37_79b1)
        .wrapping_add((x as u32).wrapping_mul(0x85eb_ca6b))
        .wrapping_add((y as u32).wrapping_mul(0xc2b2_ae35));
    hash ^= hash >> 15;
    hash = hash.wrapping_mul(0x2c1b_3c6d);
    hash ^= hash >> 12;
    hash = hash.wrapping_mul(0x297a_2d39);
    hash ^= hash >> 15;
    hash as f32 / u32::MAX as f32
}
