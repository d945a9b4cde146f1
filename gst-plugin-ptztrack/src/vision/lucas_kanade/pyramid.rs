// SPDX-License-Identifier: MPL-2.0

use multiversion::multiversion;

use super::{LANES, MAX_ROW};
use crate::vision::Luma;

/// A picture and its halvings, each with its border mirrored around it, so that windows may reach beyond. Kept as memory for another
/// picture.
#[derive(Debug, Default)]
pub struct Pyramid {
    levels: Vec<Level>,
    /// How many of `levels` are of this picture.
    count: usize,
    /// Memory: a row of sums.
    sums: Vec<u16>,
}

/// One level.
#[derive(Debug, Default)]
pub(super) struct Level {
    pixels: Vec<u8>,
    pub width: usize,
    pub height: usize,
    border: usize,
}

impl Pyramid {
    /// Of a picture of that `size` (width and height), of which `copy` writes each row, for windows of `side` pixels; with so many
    /// halvings at most, fewer where the picture is small.
    pub fn fill(
        &mut self,
        size: (usize, usize),
        side: usize,
        halvings: usize,
        mut copy: impl FnMut(usize, &mut [u8]),
    ) {
        let border = (side + 2).next_multiple_of(LANES);
        self.count = 0;
        let (mut width, mut height) = size;
        while width > 0 && height > 0 && self.count <= halvings {
            if self.count == self.levels.len() {
                self.levels.push(Level::default());
            }
            let (finer, coarser) = self.levels.split_at_mut(self.count);
            let Some(level) = coarser.first_mut() else { break };
            level.fit(width, height, border);
            match finer.last() {
                Some(finer) => level.halve(finer, &mut self.sums),
                None => (0..height).for_each(|y| copy(y, level.row_mut(y))),
            }
            level.mirror();
            self.count += 1;
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            if width <= side || height <= side {
                break;
            }
        }
    }

    /// The picture itself.
    pub fn luma(&self) -> Luma<'_> {
        self.levels().first().map_or(Luma::packed(&[], 0), Level::luma)
    }

    /// So many pixels of a row of the picture; they may lie in the border, which is as wide as a window.
    pub fn around(&self, x: isize, y: isize, count: usize) -> &[u8] {
        self.levels().first().map_or(&[], |level| &level.from(x, y)[..count])
    }

    /// The picture first.
    pub(super) fn levels(&self) -> &[Level] {
        &self.levels[..self.count]
    }
}

impl Level {
    fn fit(&mut self, width: usize, height: usize, border: usize) {
        (self.width, self.height, self.border) = (width, height, border);
        self.pixels.resize((height + 2 * border) * self.stride(), 0);
    }

    /// Pixels from one row to the next.
    pub fn stride(&self) -> usize {
        self.width + 2 * self.border
    }

    /// The pixels from that place on, row after row; it may lie in the border.
    pub fn from(&self, x: isize, y: isize) -> &[u8] {
        let border = self.border as isize;
        &self.pixels[((y + border) * self.stride() as isize + x + border) as usize..]
    }

    fn luma(&self) -> Luma<'_> {
        let padded = Luma::packed(&self.pixels, self.stride());
        padded.crop(self.border, self.border, self.width, self.height)
    }

    fn row_mut(&mut self, y: usize) -> &mut [u8] {
        let start = (y + self.border) * self.stride() + self.border;
        &mut self.pixels[start..][..self.width]
    }

    /// Becomes half of `finer`, smoothed by (1 4 6 4 1) / 16 either way, as OpenCV's `pyrDown`.
    fn halve(&mut self, finer: &Self, sums: &mut Vec<u16>) {
        let columns = 2 * self.width + 4;
        sums.resize(columns, 0);
        for y in 0..self.height {
            let middle = 2 * y as isize;
            let rows = [-2, -1, 0, 1, 2].map(|off| &finer.from(-2, middle + off)[..columns]);
            smooth_down(rows, sums);
            smooth_across(sums, self.row_mut(y));
        }
    }

    /// Fills the border: what is beyond it is as what is before it.
    fn mirror(&mut self) {
        let (border, width, stride) = (self.border, self.width, self.stride());
        let last = border + width - 1;
        let columns: [usize; MAX_ROW] = std::array::from_fn(|off| mirrored(off + 1, width));
        for row in self.pixels.chunks_exact_mut(stride).skip(border).take(self.height) {
            if width > border {
                mirror_row(row, border);
                continue;
            }
            for (off, column) in (1..=border).zip(columns) {
                row[border - off] = row[border + column];
                row[last + off] = row[last - column];
            }
        }
        let last = border + self.height - 1;
        for off in 1..=border {
            let inside = mirrored(off, self.height);
            for (from, to) in [(border + inside, border - off), (last - inside, last + off)] {
                self.pixels.copy_within(from * stride..(from + 1) * stride, to * stride);
            }
        }
    }
}

/// Fills both borders, whole lanes, of a row that is longer than one of them.
fn mirror_row(row: &mut [u8], border: usize) {
    let (left, inside) = row.split_at_mut(border);
    let (inside, right) = inside.split_at_mut(inside.len() - border);
    let reversed = |mut lanes: [u8; LANES]| {
        lanes.reverse();
        lanes
    };
    let first = inside[1..].as_chunks().0.iter();
    left.as_chunks_mut().0.iter_mut().rev().zip(first).for_each(|(to, from)| *to = reversed(*from));
    let last = inside[..inside.len() - 1].as_rchunks().1.iter().rev();
    right.as_chunks_mut().0.iter_mut().zip(last).for_each(|(to, from)| *to = reversed(*from));
}

/// How far inside lies what shows so far outside of a picture of `size` pixels that is mirrored at its last one.
fn mirrored(off: usize, size: usize) -> usize {
    let period = (2 * (size - 1)).max(1);
    let off = off % period;
    off.min(period - off).min(size - 1)
}

#[multiversion(targets("x86_64+avx2"))]
fn smooth_down([a, b, c, d, e]: [&[u8]; 5], sums: &mut [u16]) {
    let count = sums.len();
    let (a, b, c, d, e) = (&a[..count], &b[..count], &c[..count], &d[..count], &e[..count]);
    for x in 0..count {
        let [a, b, c, d, e] = [a[x], b[x], c[x], d[x], e[x]].map(u16::from);
        sums[x] = a + e + 4 * (b + d) + 6 * c;
    }
}

/// `sums` begin two columns before the first.
#[multiversion(targets("x86_64+avx2"))]
fn smooth_across(sums: &[u16], out: &mut [u8]) {
    let [here, after, later] =
        [0, 2, 4].map(|first| sums.get(first..).unwrap_or_default().as_chunks::<2>().0);
    for (((pixel, [a, b]), [c, d]), [e, _]) in out.iter_mut().zip(here).zip(after).zip(later) {
        // At most 255 * 256, and half of 256.
        *pixel = ((a + e + 4 * (b + d) + 6 * c + 128) >> 8) as u8;
    }
}
