// SPDX-License-Identifier: MPL-2.0

//! Somebody without what is behind them: the mean of some moments of an exposure, laid over a picture.

use super::{
    blur::blur_plane,
    room::view::{Canvas, View},
};
use crate::{geometry::Pinhole, picture::Plane, truth::Bounds};

/// Moments of an exposure that are looked at: what moves is blurred by as many steps. A power of two.
pub(super) const MOMENTS: usize = 4;

/// Where in a pixel each moment of an exposure has its sample: together they smooth the edges.
pub(super) const ASIDE: [(f64, f64); MOMENTS] =
    [(-0.375, -0.125), (0.125, -0.375), (0.375, 0.125), (-0.125, 0.375)];

/// A part of the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    /// First pixel; even, so that chroma pixels are whole.
    pub left: usize,
    pub top: usize,
    /// In pixels.
    pub width: usize,
    pub height: usize,
}

impl Window {
    /// The part of a picture of `size` that these pixels lie in, if any.
    pub fn around(pixels: impl Iterator<Item = (f64, f64)>, size: (usize, usize)) -> Option<Self> {
        let bounds = Bounds::around(pixels)?;
        let limit = |place: f64, end: usize| place.clamp(0.0, end as f64) as usize;
        let (left, top) = (limit(bounds.left - 1.0, size.0) & !1, limit(bounds.top - 1.0, size.1) & !1);
        let width = limit(bounds.left + bounds.width + 2.0, size.0).saturating_sub(left);
        let height = limit(bounds.top + bounds.height + 2.0, size.1).saturating_sub(top);
        (width > 0 && height > 0).then_some(Self { left, top, width, height })
    }

    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }
}

/// Sums over the samples of all moments; what is not covered is black.
pub(super) struct Layer {
    window: Window,
    /// Of each pixel: brightness, and how many samples are covered.
    luma: Vec<[u16; 2]>,
    /// Of each square of four pixels: both tints, and how many samples are covered.
    chroma: Vec<[u16; 3]>,
}

impl Layer {
    pub fn new(window: Window) -> Self {
        let Window { width, height, .. } = window;
        let squares = width.div_ceil(2) * height.div_ceil(2);
        Self { window, luma: vec![[0; 2]; width * height], chroma: vec![[0; 3]; squares] }
    }

    /// Adds a moment: Y, U, V and 1 for each pixel that is covered, else zeros.
    pub fn add(&mut self, colours: &[[u8; 4]]) {
        let width = self.window.width;
        let half = width.div_ceil(2);
        let rows = colours.chunks_exact(width).zip(self.luma.chunks_exact_mut(width));
        for (row, (colours, luma)) in rows.enumerate() {
            let squares = &mut self.chroma[row / 2 * half..][..half];
            // Most of a row is nobody.
            let covered = |colour: &[u8; 4]| colour[3] != 0;
            let Some(first) = colours.iter().position(covered) else { continue };
            let end = colours.iter().rposition(covered).map_or(first, |last| last + 1);
            for column in first..end {
                let [y, u, v, there] = colours[column].map(u16::from);
                luma[column][0] += y;
                luma[column][1] += there;
                let square = &mut squares[column / 2];
                square[0] += u;
                square[1] += v;
                square[2] += there;
            }
        }
    }

    /// The part of a view that it lies in.
    pub fn view(&self, view: &View) -> View {
        let Window { left, top, width, height } = self.window;
        let Pinhole { focal, centre_x, centre_y } = view.pinhole;
        let pinhole = Pinhole { focal, centre_x: centre_x - left as f64, centre_y: centre_y - top as f64 };
        view.through(pinhole, (width, height))
    }

    /// Lays it over a picture, as far as nothing hides it: `unhidden`, of the size of [`Self::view`], is 255 where nothing
    /// does as the shutter opens, and what hides it moves by `sweep` pixels.
    pub fn over(&self, canvas: &mut Canvas, mut unhidden: Plane, sweep: (f64, f64)) {
        blur_plane(&mut unhidden, sweep.0, sweep.1);
        let Window { left, top, width, height } = self.window;
        let [luma, chroma @ ..] = &mut canvas.planes;
        for row in 0..height {
            let line = &mut luma.data[(top + row) * luma.width + left..][..width];
            let seen = &unhidden.data[row * width..][..width];
            for ((pixel, &[sum, covered]), &seen) in line.iter_mut().zip(&self.luma[row * width..]).zip(seen)
            {
                blend(pixel, sum, covered, MOMENTS, seen);
            }
        }
        let (half, rows) = (width.div_ceil(2), height.div_ceil(2));
        for (index, plane) in chroma.iter_mut().enumerate() {
            for row in 0..rows {
                let begin = (top / 2 + row) * plane.width + left / 2;
                let line = &mut plane.data[begin..][..half];
                let seen = &unhidden.data[2 * row * width..][..width];
                let squares = &self.chroma[row * half..][..half];
                for (column, (pixel, square)) in line.iter_mut().zip(squares).enumerate() {
                    blend(pixel, square[index], square[2], 4 * MOMENTS, seen[2 * column]);
                }
            }
        }
    }
}

/// The mean of so many samples, of which `covered` add up to `sum` and the others show the pixel as it is; `seen` of 255.
fn blend(pixel: &mut u8, sum: u16, covered: u16, samples: usize, seen: u8) {
    if covered == 0 {
        return;
    }
    let (behind, samples) = (u32::from(*pixel), samples as u32);
    let mixed = u32::from(sum) + behind * (samples - u32::from(covered));
    let seen = u32::from(seen) + u32::from(seen >> 7);
    let whole = mixed * seen + behind * samples * (256 - seen);
    *pixel = ((whole + 128 * samples) / (256 * samples)) as u8;
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Window = Window { left: 2, top: 2, width: 4, height: 3 };
    const NOBODY: [u8; 4] = [0; 4];

    /// Somebody of brightness 200 in the middle two columns, in so many of the moments.
    fn layer(moments: usize) -> Layer {
        let somebody = [200, 90, 170, 1];
        let mut layer = Layer::new(WINDOW);
        for moment in 0..MOMENTS {
            let row = if moment < moments { [NOBODY, somebody, somebody, NOBODY] } else { [NOBODY; 4] };
            layer.add(&row.repeat(3));
        }
        layer
    }

    fn over(moments: usize, unhidden: u8) -> [u8; 3] {
        let mut canvas = Canvas::grey(8, 8, 40);
        layer(moments).over(&mut canvas, Plane::filled(4, 3, unhidden), (0.0, 0.0));
        assert_eq!(canvas.planes[0].data[3 * 8 + 2], 40, "beside them nothing changes");
        [canvas.planes[0].data[3 * 8 + 3], canvas.planes[1].data[4 + 1], canvas.planes[2].data[4 + 1]]
    }

    #[test]
    fn who_is_there_all_the_time_covers_what_is_behind() {
        // Tints of a square that is half covered lie between theirs and grey.
        assert_eq!(over(MOMENTS, 255), [200, 109, 149]);
    }

    #[test]
    fn who_passes_is_seen_through() {
        assert_eq!(over(MOMENTS / 2, 255)[0], 120);
        assert_eq!(over(0, 255), [40, 128, 128]);
    }

    #[test]
    fn what_is_hidden_is_not_seen() {
        assert_eq!(over(MOMENTS, 0), [40, 128, 128]);
        assert!((118..=122).contains(&over(MOMENTS, 128)[0]));
    }
}
