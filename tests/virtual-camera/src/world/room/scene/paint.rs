// SPDX-License-Identifier: MPL-2.0

//! Tools to paint tiles with: colours, noise, shapes.

use std::sync::Arc;

use crate::{
    seeded::Seeded,
    world::room::raster::{Detail, Material, Texture},
};

/// Red, green, blue, 0 to 1.
pub(super) type Colour = [f32; 3];

/// A colour by hue (0 to 1), saturation and brightness.
pub(super) fn hue(hue: f64, saturation: f64, value: f64) -> Colour {
    [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|shift| {
        let wave = ((hue + shift).fract() * 6.0 - 3.0).abs() - 1.0;
        (value * (1.0 - saturation * (1.0 - wave.clamp(0.0, 1.0)))) as f32
    })
}

/// A colour made so much brighter.
pub(super) fn times(colour: Colour, factor: f64) -> Colour {
    colour.map(|channel| channel * factor as f32)
}

/// Between two colours.
pub(super) fn mix(a: Colour, b: Colour, share: f64) -> Colour {
    let share = share.clamp(0.0, 1.0) as f32;
    [0, 1, 2].map(|channel| a[channel] + (b[channel] - a[channel]) * share)
}

/// Smooth chance over a plane that repeats.
#[derive(Debug, Clone)]
pub(super) struct Noise(Vec<f32>);

const LATTICE: usize = 256;

impl Noise {
    pub fn new(mut seeded: Seeded) -> Self {
        Self((0..LATTICE * LATTICE).map(|_| seeded.range(-1.0, 1.0) as f32).collect())
    }

    /// -1 to 1, with bumps of size 1; repeats every `period` (a power of two up to 256) each way.
    pub fn at(&self, x: f64, y: f64, period: (usize, usize)) -> f64 {
        let split = |place: f64, period: usize| {
            // No call to floor: it is most of the work where the processor's own is not used.
            let floor = place as i32 - i32::from(place < 0.0);
            let share = place - f64::from(floor);
            let whole = floor as usize & (period - 1);
            (whole, (whole + 1) & (period - 1), (share * share * (3.0 - 2.0 * share)) as f32)
        };
        let (left, right, across) = split(x, period.0);
        let (above, below, down) = split(y, period.1);
        let line = |row: usize| {
            let (a, b) = (self.0[row * LATTICE + left], self.0[row * LATTICE + right]);
            a + (b - a) * across
        };
        let (a, b) = (line(above), line(below));
        f64::from(a + (b - a) * down)
    }

    /// Sum of `octaves` over the unit square, the coarsest with `periods` bumps; about -1 to 1.
    pub fn sum(&self, u: f64, v: f64, periods: (usize, usize), octaves: usize) -> f64 {
        let mut sum = 0.0;
        for octave in 0..octaves {
            let (x, y) = (periods.0 << octave, periods.1 << octave);
            let period = (x.min(LATTICE), y.min(LATTICE));
            sum +=
                self.at(u * x as f64 + 17.0 * octave as f64, v * y as f64, period) / f64::from(1 << octave);
        }
        sum / 1.6
    }
}

/// Colours that differ by no more than this are as good as one: brightness alone tells them apart.
const PLAIN: u8 = 9;

/// Paints a tile of 2^`shift` pixels a side that is `tile` metres wide and high; `colour` takes 0 to 1 both ways.
pub(super) fn paint(
    shift: u32,
    tile: (f64, f64),
    detail: Option<Detail>,
    colour: impl Fn(f64, f64) -> Colour,
) -> Material {
    let side = 1usize << shift;
    let place = |i: usize| (i as f64 + 0.5) / side as f64;
    let pixels: Vec<Colour> = (0..side * side).map(|i| colour(place(i % side), place(i / side))).collect();
    let luma = pixels.iter().map(|&[r, g, b]| (16.5 + 219.0 * luma(r, g, b)).clamp(16.0, 235.0) as u8);
    let half = side / 2;
    let chroma = |weights: Colour| {
        let value = |i: usize| {
            let at = 2 * (i / half) * side + 2 * (i % half);
            let sum: f32 = [at, at + 1, at + side, at + side + 1]
                .iter()
                .map(|&at| (0..3).map(|channel| pixels[at][channel] * weights[channel]).sum::<f32>())
                .sum();
            (128.5 + 56.0 * sum).clamp(16.0, 240.0) as u8
        };
        Texture::new(shift - 1, (0..half * half).map(value).collect())
    };
    let luma = Texture::new(shift, luma.collect());
    // BT.601.
    let chroma = [chroma([-0.169, -0.331, 0.5]), chroma([0.5, -0.419, -0.081])];
    let plain = chroma.each_ref().map(|chroma| chroma.plain(PLAIN));
    Material { luma, chroma, plain, tile, detail, glows: false }
}

fn luma(r: f32, g: f32, b: f32) -> f32 {
    0.299 * r + 0.587 * g + 0.114 * b
}

/// The grains there are.
#[derive(Debug, Clone)]
pub(super) struct Grains {
    /// Irregular bumps and specks: plaster, stone, paper, paint.
    pub plaster: Arc<Texture>,
    /// Long fibres along u: wood.
    pub wood: Arc<Texture>,
    /// Threads over and under: cloth, carpet.
    pub cloth: Arc<Texture>,
}

impl Grains {
    pub fn new(seeded: &Seeded) -> Self {
        let grain = |label: u64, value: fn(&Noise, f64, f64) -> f64| {
            let noise = Noise::new(seeded.fork(label));
            let pixel = |i: usize| {
                let (u, v) = ((i % 512) as f64 / 512.0, (i / 512) as f64 / 512.0);
                (128.0 + 110.0 * value(&noise, u, v)).clamp(0.0, 255.0) as u8
            };
            Arc::new(Texture::new(9, (0..512 * 512).map(pixel).collect()))
        };
        Self {
            plaster: grain(1, |noise, u, v| {
                let bumps = noise.sum(u, v, (32, 32), 4);
                let specks = noise.at(u * 64.0, v * 64.0 + 9.0, (64, 64));
                0.7 * bumps - 0.9 * (specks - 0.62).max(0.0) / 0.38
            }),
            wood: grain(2, |noise, u, v| {
                let fibres = noise.sum(u, v, (4, 64), 3);
                let pores = noise.at(u * 16.0, v * 256.0, (16, 256));
                0.8 * fibres - 0.8 * (pores - 0.5).max(0.0)
            }),
            cloth: grain(3, |noise, u, v| {
                let threads = |t: f64| (t * 64.0 * std::f64::consts::TAU).sin();
                0.3 * threads(u) * threads(v) + 0.8 * noise.sum(u, v, (64, 64), 3)
            }),
        }
    }
}

/// A grain of 512 pixels on `metres`, as strong as `gain` of 1.
pub(super) fn detail(texture: &Arc<Texture>, metres: f64, gain: f64) -> Option<Detail> {
    Some(Detail { texture: texture.clone(), per_metre: 512.0 / metres, gain: (gain * 256.0) as i16 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_without_a_seam() {
        let noise = Noise::new(Seeded::new(4));
        for v in [0.1, 0.37, 0.9] {
            let (start, end) = (noise.sum(0.0, v, (8, 8), 4), noise.sum(1.0, v, (8, 8), 4));
            assert!((start - end).abs() < 1e-6, "{start} {end}");
        }
        assert!(noise.sum(0.2, 0.3, (8, 8), 4) != noise.sum(0.7, 0.3, (8, 8), 4));
    }

    #[test]
    fn colours_become_yuv() {
        let red = paint(2, (1.0, 1.0), None, |_, _| hue(0.0, 1.0, 1.0));
        assert_eq!((red.luma.plain(0), red.plain), (Some(81), [Some(90), Some(240)]));
    }
}
