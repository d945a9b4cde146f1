// SPDX-License-Identifier: MPL-2.0

//! A clock and a logo, burned into the picture as cameras do.

use std::time::Duration;

use crate::picture::{Picture, Plane};

/// Rows of five pixels, the leftmost in bit 4; digits and the colon.
const GLYPHS: [[u8; 7]; 11] = [
    [0x0e, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0e],
    [0x04, 0x0c, 0x04, 0x04, 0x04, 0x04, 0x0e],
    [0x0e, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1f],
    [0x1f, 0x02, 0x04, 0x02, 0x01, 0x11, 0x0e],
    [0x02, 0x06, 0x0a, 0x12, 0x1f, 0x02, 0x02],
    [0x1f, 0x10, 0x1e, 0x01, 0x01, 0x11, 0x0e],
    [0x06, 0x08, 0x10, 0x1e, 0x11, 0x11, 0x0e],
    [0x1f, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08],
    [0x0e, 0x11, 0x11, 0x0e, 0x11, 0x11, 0x0e],
    [0x0e, 0x11, 0x11, 0x0f, 0x01, 0x02, 0x0c],
    [0x00, 0x04, 0x04, 0x00, 0x04, 0x04, 0x00],
];
const COLON: usize = 10;
/// Pixels from one glyph to the next.
const ADVANCE: usize = 6;
/// When the world's time begins: nine in the morning.
const START_S: u64 = 9 * 3600;

/// The time on a dark bar at the upper left; a ring with a bar in it at the lower right.
pub(super) fn burn_in(time: Duration, picture: &mut Picture) {
    // A pixel of the font on so many of the picture, as on a picture of 480 rows.
    let large = (picture.planes[0].height / 240).max(1);
    let text = clock(time);
    let bar = ((ADVANCE * text.len() + 3) * large, 11 * large);
    fill(picture, (4 * large, 4 * large), bar, |_, _| Some(24));
    for (index, glyph) in text.into_iter().enumerate() {
        let left = (6 + ADVANCE * index) * large;
        let lit = |x: usize, y: usize| GLYPHS[glyph][y / large] >> (4 - x / large) & 1 == 1;
        fill(picture, (left, 6 * large), (5 * large, 7 * large), |x, y| lit(x, y).then_some(230));
    }
    let (width, height) = (picture.planes[0].width, picture.planes[0].height);
    let side = 26 * large;
    let corner = (width.saturating_sub(side + 6 * large), height.saturating_sub(side + 6 * large));
    fill(picture, corner, (side, side), |x, y| {
        logo(x as f64 / side as f64 - 0.5, y as f64 / side as f64 - 0.5)
    });
}

/// Hours, minutes, seconds.
fn clock(time: Duration) -> [usize; 8] {
    let seconds = START_S + time.as_secs();
    let pair = |number: u64| [(number / 10) as usize, (number % 10) as usize];
    let ([a, b], [c, d], [e, f]) = (pair(seconds / 3600 % 24), pair(seconds / 60 % 60), pair(seconds % 60));
    [a, b, COLON, c, d, COLON, e, f]
}

fn logo(x: f64, y: f64) -> Option<u8> {
    let away = x.hypot(y);
    let bar = y.abs() < 0.08 && away < 0.4;
    ((0.38..0.5).contains(&away) || bar).then_some(225)
}

/// Sets pixels of a box where `value` says so; they are grey.
fn fill(
    picture: &mut Picture,
    (left, top): (usize, usize),
    (width, height): (usize, usize),
    value: impl Fn(usize, usize) -> Option<u8>,
) {
    let [luma, chroma @ ..] = &mut picture.planes;
    let mut set = |x: usize, y: usize, value: u8| {
        let put = |plane: &mut Plane, x: usize, y: usize, value: u8| {
            if x < plane.width && y < plane.height {
                plane.data[y * plane.width + x] = value;
            }
        };
        put(luma, x, y, value);
        chroma.iter_mut().for_each(|plane| put(plane, x / 2, y / 2, 128));
    };
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        if let Some(value) = value(x, y) {
            set(left + x, top + y, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_goes_and_little_else_is_covered() {
        let burned = |seconds| {
            let mut picture = Picture::grey(640, 480, 100);
            burn_in(Duration::from_secs(seconds), &mut picture);
            picture
        };
        assert_eq!(clock(Duration::from_secs(3661)), [1, 0, COLON, 0, 1, COLON, 0, 1]);
        let (one, next) = (burned(1), burned(2));
        assert_ne!(one, next);
        let changed = one.planes[0].data.iter().filter(|&&pixel| pixel != 100).count();
        assert!((2000..9000).contains(&changed), "{changed}");
        // Small pictures too.
        let mut small = Picture::grey(32, 32, 100);
        burn_in(Duration::ZERO, &mut small);
    }
}
