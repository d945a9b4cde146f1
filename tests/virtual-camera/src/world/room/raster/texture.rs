// SPDX-License-Identifier: MPL-2.0

//! What surfaces are made of: tiles of pixels at every resolution.

use std::sync::Arc;

/// Pixels sampled at once, at most.
pub(in super::super) const SPAN: usize = 64;

/// A square tile that repeats, at its own and all lower resolutions.
#[derive(Debug)]
pub(in super::super) struct Texture {
    /// Each resolution as it is and softened, for what lies between it and the next: a step of √2 is hardly seen.
    levels: Vec<Level>,
    side: f64,
}

/// Every pixel is stored with its right, lower and lower right neighbour: one load for what lies between four pixels.
#[derive(Debug)]
pub(in super::super) struct Level {
    shift: u32,
    cells: Vec<u32>,
}

/// A straight way over a tile, u and v: its first place, and how far it is from pixel to pixel.
///
/// Places count in 1/2^32 of the tile and so repeat by themselves.
pub(in super::super) struct Way {
    pub start: [u32; 2],
    pub step: [u32; 2],
}

/// Footprints at which the next step begins: 2^(1/4), 2^(3/4) and so on.
const STEPS: [f64; 12] = [1.189, 1.682, 2.378, 3.364, 4.757, 6.727, 9.514, 13.45, 19.03, 26.91, 38.05, 53.82];

impl Texture {
    /// A tile of 2^`shift` pixels a side, 1 at least.
    pub fn new(shift: u32, mut pixels: Vec<u8>) -> Self {
        let whole = f64::from(1u32 << shift);
        let mut levels = Vec::new();
        for shift in (1..=shift).rev() {
            let side = 1usize << shift;
            levels.push(Level::new(shift, &pixels));
            levels.push(Level::new(shift, &softened(side, &pixels)));
            let side = side / 2;
            let half = |x: usize, y: usize| {
                let at = 2 * y * 2 * side + 2 * x;
                let upper = u32::from(pixels[at]) + u32::from(pixels[at + 1]);
                let lower = u32::from(pixels[at + 2 * side]) + u32::from(pixels[at + 2 * side + 1]);
                ((upper + lower + 2) / 4) as u8
            };
            pixels = (0..side * side).map(|i| half(i % side, i / side)).collect();
        }
        Self { levels, side: whole }
    }

    /// Pixels a side.
    pub fn side(&self) -> f64 {
        self.side
    }

    /// The tile as sharp as fits pixels that cover `footprint` of its own.
    pub fn fitting(&self, footprint: f64) -> &Level {
        // Twice the logarithm, rounded.
        let steps = STEPS.iter().take_while(|&&limit| footprint > limit).count().min(self.levels.len() - 1);
        &self.levels[steps]
    }

    /// Its mean value, if no pixel is further than `tolerance` from it.
    pub fn plain(&self, tolerance: u8) -> Option<u8> {
        let mean = (self.levels.last()?.cells[0].to_le_bytes().map(u32::from).iter().sum::<u32>() / 4) as u8;
        self.levels[0].cells.iter().all(|&cell| (cell as u8).abs_diff(mean) <= tolerance).then_some(mean)
    }
}

/// The mean of every pixel with its neighbours, twice as heavy itself.
fn softened(side: usize, pixels: &[u8]) -> Vec<u8> {
    let mask = side - 1;
    let line = |x: usize, y: usize| {
        let pixel = |x: usize| u32::from(pixels[y * side + (x & mask)]);
        pixel(x + mask) + 2 * pixel(x) + pixel(x + 1)
    };
    let pixel = |i: usize| {
        let (x, y) = (i & mask, i / side);
        ((line(x, (y + mask) & mask) + 2 * line(x, y) + line(x, (y + 1) & mask) + 8) / 16) as u8
    };
    (0..side * side).map(pixel).collect()
}

impl Level {
    fn new(shift: u32, pixels: &[u8]) -> Self {
        let side = 1usize << shift;
        let cell = |i: usize| {
            let (x, y) = (i % side, i / side);
            let (right, below) = ((x + 1) % side, (y + 1) % side * side);
            let [a, b, c, d] =
                [y * side + x, y * side + right, below + x, below + right].map(|at| u32::from(pixels[at]));
            a | b << 8 | c << 16 | d << 24
        };
        Self { shift, cells: (0..side * side).map(cell).collect() }
    }

    /// Brightness along straight ways of `piece` pixels each: the mean of the four pixels around each place, in 1/128.
    ///
    /// Loading is pixel by pixel; all arithmetic is in loops that the compiler makes several pixels wide, each over
    /// numbers of one width as far as possible.
    pub fn sample(&self, ways: impl Iterator<Item = Way>, piece: usize, values: &mut [i16]) {
        let count = values.len().min(SPAN);
        let (mut cells, mut shares) = ([0u32; SPAN], [[0i16; SPAN]; 2]);
        let [right, down] = &mut shares;
        let places = cells[..count].chunks_mut(piece);
        let shares = right[..count].chunks_mut(piece).zip(down[..count].chunks_mut(piece));
        for ((way, cells), (right, down)) in ways.zip(places).zip(shares) {
            self.places(&way, cells, [right, down]);
        }
        let all = &self.cells[..1 << (2 * self.shift)];
        for cell in &mut cells[..count] {
            *cell = all[*cell as usize];
        }
        let mut corners = [[0i16; SPAN]; 4];
        unpack(&cells[..count], &mut corners);
        blend(&corners, [right, down], &mut values[..count]);
    }

    /// The cell of each place on a way, and how far right and down it lies in there: in 1/128 and in 1/32768.
    fn places(&self, way: &Way, cells: &mut [u32], [right, down]: [&mut [i16]; 2]) {
        let shift = self.shift;
        // Values stand for the middles of pixels.
        let middle = (1u32 << 31) >> shift;
        let (mut u, mut v) = (way.start[0].wrapping_sub(middle), way.start[1].wrapping_sub(middle));
        for ((cell, right), down) in cells.iter_mut().zip(right).zip(down) {
            *cell = (v >> (32 - shift)) << shift | u >> (32 - shift);
            *right = (u << shift >> 25) as i16;
            *down = (v << shift >> 17) as i16;
            (u, v) = (u.wrapping_add(way.step[0]), v.wrapping_add(way.step[1]));
        }
    }
}

/// Cells' four pixels: itself, right, below, below right.
fn unpack(cells: &[u32], [a, b, c, d]: &mut [[i16; SPAN]; 4]) {
    for ((((&cell, a), b), c), d) in cells.iter().zip(a).zip(b).zip(c).zip(d) {
        *a = (cell & 255) as i16;
        *b = (cell >> 8 & 255) as i16;
        *c = (cell >> 16 & 255) as i16;
        *d = (cell >> 24) as i16;
    }
}

/// What lies between four pixels, in 1/128.
fn blend([a, b, c, d]: &[[i16; SPAN]; 4], [right, down]: [&[i16; SPAN]; 2], values: &mut [i16]) {
    let pixels = a.iter().zip(b).zip(c.iter().zip(d));
    let shares = right.iter().zip(down);
    for ((value, ((&a, &b), (&c, &d))), (&right, &down)) in values.iter_mut().zip(pixels).zip(shares) {
        let above = (a << 7).wrapping_add((b - a).wrapping_mul(right));
        let below = (c << 7).wrapping_add((d - c).wrapping_mul(right));
        let between = ((i32::from(below.wrapping_sub(above)) * i32::from(down)) >> 16) as i16;
        *value = above.wrapping_add(between << 1);
    }
}

/// Fine grain that only shows when looked at closely.
#[derive(Debug, Clone)]
pub(in super::super) struct Detail {
    /// Around 128.
    pub texture: Arc<Texture>,
    /// Pixels of the grain per metre.
    pub per_metre: f64,
    /// How strong, in 1/256, up to 255.
    pub gain: i16,
}

/// What a surface is made of.
#[derive(Debug)]
pub(in super::super) struct Material {
    /// Luma.
    pub luma: Texture,
    /// U and V.
    pub chroma: [Texture; 2],
    /// U and V where they hardly differ.
    pub plain: [Option<u8>; 2],
    /// Metres that the tile is wide and high.
    pub tile: (f64, f64),
    /// Grain on top.
    pub detail: Option<Detail>,
    /// Shines by itself: no light falls on it.
    pub glows: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The brightness at a place, in pixels from the corner of a tile of two pixels a side.
    fn at(level: &Level, u: f64, v: f64) -> i16 {
        let place = |pixels: f64| (pixels * f64::from(1u32 << 31)) as u64 as u32;
        let mut values = [0; 3];
        let way = Way { start: [place(u), place(v)], step: [0; 2] };
        level.sample(std::iter::once(way), 3, &mut values);
        values[1]
    }

    #[test]
    fn between_four_pixels_lies_their_mean() {
        let texture = Texture::new(1, vec![10, 20, 30, 60]);
        let level = &texture.levels[0];
        assert_eq!(at(level, 0.5, 0.5), 10 << 7);
        assert_eq!(at(level, 1.5, 0.5), 20 << 7);
        assert_eq!(at(level, 1.0, 0.5), 15 << 7);
        assert!((at(level, 1.0, 1.0) - (30 << 7)).abs() <= 2);
        assert_eq!(at(level, 5.5, 2.5), 20 << 7, "it repeats");
    }

    #[test]
    fn the_larger_the_pixel_the_softer_the_tile() {
        let texture = Texture::new(2, [10, 90].repeat(8));
        let contrast = |footprint| {
            let level = texture.fitting(footprint);
            let mut values = [0; 2];
            let way = Way { start: [1 << 29; 2], step: [2 << 29, 0] };
            level.sample(std::iter::once(way), 2, &mut values);
            (values[1] - values[0]) >> 7
        };
        assert_eq!([0.1, 1.0, 1.4, 2.0, 99.0].map(contrast), [80, 80, 0, 0, 0]);
    }

    #[test]
    fn knows_when_it_is_plain() {
        assert_eq!(Texture::new(2, vec![77; 16]).plain(0), Some(77));
        assert_eq!(Texture::new(1, vec![77, 77, 77, 81]).plain(3), Some(78));
        assert_eq!(Texture::new(1, vec![77, 77, 77, 81]).plain(2), None);
    }
}
