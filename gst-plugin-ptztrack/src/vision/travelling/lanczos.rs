// SPDX-License-Identifier: MPL-2.0

//! Planes sampled through a projective map by Lanczos' kernel: what is sampled bilinearly again and again is blurred each time, and differs
//! from the picture at every edge.

use opencv::core::{self, Mat, Point, Scalar, Size};
use opencv::imgproc;
use opencv::prelude::*;

use super::warp::Warp;
use crate::vision::Luma;

/// Pixels that the kernel reaches to each side.
const REACH: i32 = 4;

/// Samples a plane where it is known; keeps memory.
#[derive(Debug, Default)]
pub(super) struct Lanczos {
    element: Mat,
    least_age: Mat,
    known: Vec<u8>,
    sampled: Vec<u16>,
}

impl Lanczos {
    /// Samples a plane of `size` through `warp` into `out`, which holds what was sampled otherwise, wherever all is known that the kernel
    /// reaches: where the plane's `age` is more than 0.
    pub fn sharpen(
        &mut self,
        out: &mut [u16],
        warp: &Warp,
        (plane, age): (&[u16], &[u8]),
        (width, height): (usize, usize),
    ) -> opencv::Result<()> {
        let (columns, rows) = (width as i32, height as i32);
        self.note_known(warp, Luma::packed(age, width))?;
        let to_source = Mat::from_slice_2d(&warp.to_source().0)?;
        self.sampled.resize(plane.len(), 0);
        imgproc::warp_perspective(
            &Mat::new_rows_cols_with_data(rows, columns, plane)?,
            &mut Mat::new_rows_cols_with_data_mut(rows, columns, &mut self.sampled)?,
            &to_source,
            Size::new(columns, rows),
            imgproc::INTER_LANCZOS4 | imgproc::WARP_INVERSE_MAP,
            core::BORDER_REPLICATE,
            Scalar::default(),
        )?;
        let sampled = out.iter_mut().zip(&self.sampled).zip(&self.known);
        sampled.filter(|(_, known)| **known > 0).for_each(|((out, sampled), _)| *out = *sampled);
        Ok(())
    }

    /// Leaves in `known` what is more than 0 where all is known around.
    fn note_known(&mut self, warp: &Warp, age: Luma) -> opencv::Result<()> {
        if self.element.empty() {
            let size = Size::new(2 * REACH + 1, 2 * REACH + 1);
            self.element = imgproc::get_structuring_element_def(imgproc::MORPH_RECT, size)?;
        }
        let (middle, border) = (Point::new(-1, -1), imgproc::morphology_default_border_value()?);
        let (least, element) = (&mut self.least_age, &self.element);
        age.with_mat(|age| imgproc::erode(age, least, element, middle, 1, core::BORDER_CONSTANT, border))?;
        warp.sample_nearest(self.least_age.data_bytes()?, 0, &mut self.known);
        Ok(())
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
                lanczos.sharpen(&mut out, &warp, (&plane, age), SIZE).expect("OpenCV");
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
