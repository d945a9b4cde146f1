// SPDX-License-Identifier: MPL-2.0

//! A world on paper whose every motion is known: smooth noise, sampled anywhere between the pixels.

use ptztrack_contract::{Homography, Point};

/// A grey picture in memory.
#[derive(Clone)]
pub(super) struct Canvas {
    pub pixels: Vec<u8>,
    pub width: usize,
}

impl Canvas {
    /// The world `paint` (of places in pixels) seen by a camera that has moved by `motion`: from the world's
    /// pixels to the picture's.
    pub fn seen(
        (width, height): (usize, usize),
        motion: &Homography,
        paint: impl Fn(f64, f64) -> f64,
    ) -> Self {
        let back = motion.inverse().expect("a camera");
        let pixel = |index: usize| {
            let at = back.apply(Point { x: (index % width) as f64, y: (index / width) as f64 });
            paint(at.x, at.y).clamp(0.0, 255.0).round() as u8
        };
        Self { pixels: (0..width * height).map(pixel).collect(), width }
    }

    pub fn luma(&self) -> super::Luma<'_> {
        super::Luma::packed(&self.pixels, self.width)
    }

    /// Fills a box (left, top, width, height; cut to the picture) with what `paint` says of places in it.
    pub fn paint(&mut self, (x, y, width, height): (f64, f64, f64, f64), paint: impl Fn(f64, f64) -> f64) {
        for index in 0..self.pixels.len() {
            let (u, v) = ((index % self.width) as f64 - x, (index / self.width) as f64 - y);
            if (0.0..width).contains(&u) && (0.0..height).contains(&v) {
                self.pixels[index] = paint(u, v).clamp(0.0, 255.0).round() as u8;
            }
        }
    }

    /// Adds sensor noise of that standard deviation; another `seed`, other noise.
    pub fn noisy(mut self, deviation: f64, seed: u32) -> Self {
        for (index, pixel) in self.pixels.iter_mut().enumerate() {
            // Twelve uniform numbers add up to a nearly normal one of deviation 1.
            let sum: f64 =
                (0..12).map(|k| hash(seed.wrapping_mul(12).wrapping_add(k), index as i32, 7)).sum();
            *pixel = (f64::from(*pixel) + deviation * (sum - 6.0)).clamp(0.0, 255.0).round() as u8;
        }
        self
    }

    /// Smears `length` pixels along each row, as a panning camera does.
    pub fn blurred(mut self, length: usize) -> Self {
        for row in self.pixels.chunks_exact_mut(self.width) {
            let sharp = row.to_vec();
            for (x, pixel) in row.iter_mut().enumerate() {
                let first = x.saturating_sub(length / 2);
                let window = &sharp[first..(first + length.max(1)).min(sharp.len())];
                *pixel = (window.iter().map(|&p| u32::from(p)).sum::<u32>() / window.len() as u32) as u8;
            }
        }
        self
    }
}

/// Grey level of texture `seed` at a place: two octaves of value noise.
pub(super) fn texture(seed: u32, x: f64, y: f64) -> f64 {
    128.0
        + 160.0 * (noise(seed, x / 9.0, y / 9.0) - 0.5)
        + 90.0 * (noise(seed ^ 0x5bd1, x / 4.0, y / 4.0) - 0.5)
}

fn noise(seed: u32, x: f64, y: f64) -> f64 {
    let (left, top) = (x.floor(), y.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (ease(x - left), ease(y - top));
    let at = |dx: i32, dy: i32| hash(seed, left as i32 + dx, top as i32 + dy);
    let upper = at(0, 0) * (1.0 - u) + at(1, 0) * u;
    let lower = at(0, 1) * (1.0 - u) + at(1, 1) * u;
    upper * (1.0 - v) + lower * v
}

/// 0 to 1, the same for the same place.
pub(super) fn hash(seed: u32, x: i32, y: i32) -> f64 {
    let mut hash = seed
        .wrapping_mul(0x9e37_79b1)
        .wrapping_add((x as u32).wrapping_mul(0x85eb_ca6b))
        .wrapping_add((y as u32).wrapping_mul(0xc2b2_ae35));
    for (shift, factor) in [(15, 0x2c1b_3c6d), (12, 0x297a_2d39)] {
        hash = (hash ^ hash >> shift).wrapping_mul(factor);
    }
    f64::from(hash ^ hash >> 15) / f64::from(u32::MAX)
}
