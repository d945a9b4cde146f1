//! What surfaces are made of: tiles of pixels at every resolution.

use std::sync::Arc;

/// A square tile that repeats, at its own and all lower resolutions.
#[derive(Debug)]
pub(in super::super) struct Texture {
    /// Each resolution as it is and softened, for what lies between it and the next: a step of √2 is hardly seen.
    levels: Vec<Level>,
}

/// Every pixel is stored with its right, lower and lower right neighbour: one load for what lies between four pixels.
#[derive(Debug)]
pub(in super::super) struct Level {
    shift: u32,
    cells: Vec<u32>,
}

/// Footprints at which the next step begins: 2^(1/4), 2^(3/4) and so on.
const STEPS: [f64; 12] = [1.189, 1.682, 2.378, 3.364, 4.757, 6.727, 9.514, 13.45, 19.03, 26.91, 38.05, 53.82];

impl Texture {
    /// A tile of 2^`shift` pixels a side.
    pub fn new(shift: u32, mut pixels: Vec<u8>) -> Self {
        let mut levels = Vec::new();
        for shift in (0..=shift).rev() {
            let side = 1usize << shift;
            levels.push(Level::new(shift, &pixels));
            levels.push(Level::new(shift, &softened(side, &pixels)));
            if side == 1 {
                break;
            }
            let side = side / 2;
            let half = |x: usize, y: usize| {
                let at = 2 * y * 2 * side + 2 * x;
                let upper = u32::from(pixels[at]) + u32::from(pixels[at + 1]);
                let lower = u32::from(pixels[at + 2 * side]) + u32::from(pixels[at + 2 * side + 1]);
                ((upper + lower + 2) / 4) as u8
            };
            pixels = (0..side * side).map(|i| half(i % side, i / side)).collect();
        }
        Self { levels }
    }

    /// Pixels a side.
    pub fn side(&self) -> f64 {
        f64::from(1u32 << self.levels[0].shift)
    }

    /// The tile as sharp as fits pixels that cover `footprint` of its own, and how often its resolution is halved.
    pub fn fitting(&self, footprint: f64) -> (&Level, usize) {
        // Twice the logarithm, rounded.
        let steps = STEPS.iter().take_while(|&&limit| footprint > limit).count().min(self.levels.len() - 1);
        (&self.levels[steps], steps / 2)
    }

    /// Of one value all over?
    pub fn constant(&self) -> Option<u8> {
        let first = self.levels[0].cells[0];
        self.levels[0].cells.iter().all(|&cell| cell == first).then_some(first as u8)
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

    /// The mean of the four pixels around a place, in 1/256; the place counts in 1/65536 pixel and repeats.
    #[inline(always)]
    pub fn sample(&self, u: u32, v: u32) -> u32 {
        let mask = (1u32 << self.shift) - 1;
        let at = ((v >> 16) & mask) << self.shift | ((u >> 16) & mask);
        let cell = self.cells[at as usize];
        let (right, down) = (u >> 8 & 255, v >> 8 & 255);
        // Two pixels at once: the upper in the lower 16 bits, the lower in the upper.
        let both = (cell & 0x00ff_00ff) * (256 - right) + (cell >> 8 & 0x00ff_00ff) * right;
        ((both & 0xffff) * (256 - down) + (both >> 16) * down) >> 8
    }
}

/// Fine grain that only shows when looked at closely.
#[derive(Debug, Clone)]
pub(in super::super) struct Detail {
    /// Around 128.
    pub texture: Arc<Texture>,
    /// Pixels of the grain per metre.
    pub per_metre: f64,
    /// How strong, in 1/256.
    pub gain: i32,
}

/// What a surface is made of.
#[derive(Debug)]
pub(in super::super) struct Material {
    /// Luma.
    pub luma: Texture,
    /// U and V.
    pub chroma: [Texture; 2],
    /// U and V where they are the same all over.
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

    #[test]
    fn between_four_pixels_lies_their_mean() {
        let texture = Texture::new(1, vec![10, 20, 30, 60]);
        let level = &texture.levels[0];
        assert_eq!(level.sample(0, 0), 10 << 8);
        assert_eq!(level.sample(1 << 16, 0), 20 << 8);
        assert_eq!(level.sample(1 << 15, 0), 15 << 8);
        assert_eq!(level.sample(1 << 15, 1 << 15), 30 << 8);
        assert_eq!(level.sample(5 << 16, 2 << 16), 20 << 8, "it repeats");
    }

    #[test]
    fn the_larger_the_pixel_the_softer_the_tile() {
        let texture = Texture::new(1, vec![10, 20, 30, 60]);
        let seen = |footprint| {
            let (level, halved) = texture.fitting(footprint);
            (level.sample(0, 0) >> 8, halved)
        };
        assert_eq!(
            [seen(0.1), seen(1.0), seen(1.4), seen(2.0), seen(99.0)],
            [(10, 0), (10, 0), (20, 0), (30, 1), (30, 1)]
        );
    }

    #[test]
    fn knows_when_it_is_plain() {
        assert_eq!(Texture::new(2, vec![77; 16]).constant(), Some(77));
        assert_eq!(Texture::new(1, vec![77, 77, 77, 78]).constant(), None);
    }
}
