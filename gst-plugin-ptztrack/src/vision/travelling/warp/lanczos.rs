// SPDX-License-Identifier: MPL-2.0

//! Planes sampled through a projective map by Lanczos' kernel: what is sampled bilinearly again and again is blurred each time, and differs
//! from the picture at every edge.

use std::f32::consts::PI;
use std::sync::LazyLock;

use multiversion::multiversion;
use opencv::core::{BORDER_CONSTANT, Mat, Point, Size};
use opencv::imgproc;
use opencv::prelude::*;

use super::{BLOCK, PARTS, Run, Warp};
use crate::vision::Luma;
use crate::vision::travelling::rows::whole_part;

/// Pixels that the kernel reaches to each side, and all of those that it mixes.
const REACH: usize = 4;
const TAPS: usize = 2 * REACH;
/// Columns that are looked at together.
const COLUMNS: usize = 2 * BLOCK;

/// The kernel's weights for each sixteenth of a pixel, from the third pixel to the left on.
static WEIGHTS: LazyLock<Vec<[f32; TAPS]>> = LazyLock::new(|| {
    let sinc = |x: f32| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
    let kernel = |part: i32| -> [f32; TAPS] {
        let off = |tap: usize| part as f32 / PARTS as f32 + (REACH - 1) as f32 - tap as f32;
        let weights: [f32; TAPS] = std::array::from_fn(|tap| sinc(off(tap)) * sinc(off(tap) / REACH as f32));
        let sum: f32 = weights.iter().sum();
        weights.map(|weight| weight / sum)
    };
    (0..PARTS).map(kernel).collect()
});

/// Samples a plane where it is known; keeps memory.
#[derive(Debug, Default)]
pub(in super::super) struct Lanczos {
    element: Mat,
    least_age: Mat,
    known: Vec<u8>,
}

impl Lanczos {
    /// Samples a plane through `warp` into `out`, which holds what was sampled bilinearly, in whole blocks of `warp`, wherever all
    /// is known that the kernel reaches: where the plane's `age` is more than 0.
    pub fn sharpen(&mut self, out: &mut [u16], warp: &Warp, plane: &[u16], age: &[u8]) -> opencv::Result<()> {
        self.note_known(warp, Luma::packed(age, warp.source.0))?;
        sharpen_runs(warp, plane, &self.known, out);
        Ok(())
    }

    /// Leaves in `known` what is more than 0 where all is known around.
    fn note_known(&mut self, warp: &Warp, age: Luma) -> opencv::Result<()> {
        if self.element.empty() {
            let side = (TAPS + 1) as i32;
            self.element = imgproc::get_structuring_element_def(imgproc::MORPH_RECT, Size::new(side, side))?;
        }
        let (middle, border) = (Point::new(-1, -1), imgproc::morphology_default_border_value()?);
        let (least, element) = (&mut self.least_age, &self.element);
        age.with_mat(|age| imgproc::erode(age, least, element, middle, 1, BORDER_CONSTANT, border))?;
        warp.sample_nearest(self.least_age.data_bytes()?, 0, &mut self.known);
        Ok(())
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn sharpen_runs(warp: &Warp, plane: &[u16], known: &[u8], out: &mut [u16]) {
    for run in warp.runs.iter().filter(|run| !run.shift.is_whole()) {
        let mut x = run.columns.start;
        while x + COLUMNS <= run.columns.end {
            sharpen_columns::<COLUMNS>(warp, run, x, plane, known, out);
            x += COLUMNS;
        }
        while x + BLOCK <= run.columns.end {
            sharpen_columns::<BLOCK>(warp, run, x, plane, known, out);
            x += BLOCK;
        }
    }
}

/// `N` columns of a run, from column `x` on, if the plane reaches as far around them as the kernel.
#[inline(always)]
fn sharpen_columns<const N: usize>(
    warp: &Warp,
    run: &Run,
    x: usize,
    plane: &[u16],
    known: &[u8],
    out: &mut [u16],
) {
    let (width, height) = warp.source;
    let (left, top) = (x as i32 + run.shift.x, run.rows.start as i32 + run.shift.y);
    let before = REACH as i32 - 1;
    if left < before || top < before {
        return;
    }
    let (left, top) = ((left - before) as usize, (top - before) as usize);
    let count = run.rows.len() + TAPS - 1;
    if left + N + TAPS - 1 > width || top + count > height {
        return;
    }
    let [across, down] = [run.shift.part_x, run.shift.part_y].map(|part| WEIGHTS[usize::from(part)]);
    let mut mixed = [[0.0; N]; BLOCK + TAPS - 1];
    for (row, mixed) in mixed[..count].iter_mut().enumerate() {
        let pixels = &plane[(top + row) * width + left..][..N + TAPS - 1];
        for (tap, weight) in across.iter().enumerate() {
            for (mixed, pixel) in mixed.iter_mut().zip(&pixels[tap..tap + N]) {
                *mixed += weight * f32::from(*pixel);
            }
        }
    }
    for (row, y) in run.rows.clone().enumerate() {
        let mut sharp = [0.5; N];
        for (weight, mixed) in down.iter().zip(&mixed[row..row + TAPS]) {
            for (sharp, mixed) in sharp.iter_mut().zip(mixed) {
                *sharp += weight * mixed;
            }
        }
        let at = y * warp.size.0 + x;
        for ((out, known), sharp) in out[at..at + N].iter_mut().zip(&known[at..at + N]).zip(sharp) {
            *out = if *known > 0 { whole_part(sharp.clamp(0.0, f32::from(u16::MAX))) } else { *out };
        }
    }
}

#[cfg(test)]
mod tests {
    use ptztrack_contract::Homography;

    use super::*;

    const SIZE: (usize, usize) = (96, 64);

    /// Checks of 5 pixels with soft edges, from 60 to 140.
    fn checks() -> Vec<u16> {
        let wave = |at: usize| (at as f64 * std::f64::consts::PI / 5.0).sin();
        let light = |at: usize| 100.0 + 40.0 * wave(at % SIZE.0) * wave(at / SIZE.0);
        (0..SIZE.0 * SIZE.1).map(|at| (256.0 * light(at)) as u16).collect()
    }

    /// The same after it was laid half a pixel to and fro so many times, where `age` says what is known; by Lanczos' kernel or bilinearly.
    fn laid(times: usize, age: &[u8], sharp: bool) -> Vec<u16> {
        let (mut plane, mut out) = (checks(), Vec::new());
        let (mut lanczos, mut warp) = (Lanczos::default(), Warp::default());
        for time in 0..times {
            let half = if time.is_multiple_of(2) { 0.5 } else { -0.5 };
            warp.prepare(SIZE, SIZE, &Homography::translation(half, half));
            warp.sample_wide(&plane, 0, &mut out);
            if sharp {
                lanczos.sharpen(&mut out, &warp, &plane, age).expect("OpenCV");
            }
            std::mem::swap(&mut plane, &mut out);
        }
        plane
    }

    /// Mean difference from what it was in the middle, grey levels.
    fn change(plane: &[u16]) -> f64 {
        let first = checks();
        let middle = (16..48).flat_map(|y| (16..80).map(move |x| y * SIZE.0 + x));
        let offs = middle.map(|at| f64::from(plane[at].abs_diff(first[at])) / 256.0);
        offs.sum::<f64>() / (32.0 * 64.0)
    }

    #[test]
    fn what_is_laid_anew_again_and_again_stays_sharp() {
        let known = vec![9; SIZE.0 * SIZE.1];
        let (bilinear, lanczos) = (change(&laid(16, &known, false)), change(&laid(16, &known, true)));
        assert!(bilinear > 12.0 && lanczos < 2.0, "{bilinear} {lanczos}");
    }

    #[test]
    fn what_is_not_known_tells_nothing_of_what_is() {
        let mut age = vec![9; SIZE.0 * SIZE.1];
        age.chunks_exact_mut(SIZE.0).for_each(|row| row[..40].fill(0));
        let (mixed, bilinear) = (laid(1, &age, true), laid(1, &age, false));
        let columns = |plane: &[u16], columns: std::ops::Range<usize>| plane[20 * SIZE.0..][columns].to_vec();
        assert_eq!(columns(&mixed, 0..43), columns(&bilinear, 0..43));
        assert_ne!(columns(&mixed, 48..60), columns(&bilinear, 48..60));
    }
}
