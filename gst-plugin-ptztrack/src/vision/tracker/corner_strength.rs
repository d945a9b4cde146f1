// SPDX-License-Identifier: MPL-2.0

use multiversion::multiversion;
use opencv::core::Rect;

use super::patch::Patch;

/// How good a corner each pixel of a window is, row after row, and memory for the next one.
#[derive(Debug, Default)]
pub(super) struct CornerStrength {
    strength: Vec<f32>,
    /// Products of the gradients (3.6) in three rows, xx, xy and yy, of one pixel more on either side.
    products: [Products; 3],
    /// Their sums.
    sums: Products,
}

type Products = [Vec<f32>; 3];

impl CornerStrength {
    /// Works out the smaller eigenvalue (3.7; Shi and Tomasi) of the gradient matrix (3.6), summed over 3x3 pixels, at each pixel of a
    /// `window` of `patch`: as OpenCV's `cornerMinEigenVal` does it, but for a factor, and for the outermost pixels, which are no
    /// corners.
    pub fn fill(&mut self, patch: &Patch, window: Rect) {
        let (left, top) = (window.x as isize, window.y as isize);
        let (width, height) = (window.width as usize, window.height as usize);
        let Self { strength, products, sums } = self;
        strength.resize(width * height, 0.0);
        products.iter_mut().chain([&mut *sums]).flatten().for_each(|row| row.resize(width + 2, 0.0));
        for y in 0..height + 2 {
            let row = |off: isize| patch.around(left - 2, top + y as isize - 1 + off, width + 4);
            multiply([-1, 0, 1].map(row), &mut products[y % 3]);
            let Some(out) = y.checked_sub(2) else { continue };
            add(products, sums);
            smaller_eigenvalues(sums, &mut strength[out * width..][..width]);
        }
    }

    /// Of all pixels, row after row.
    pub fn all(&self) -> &[f32] {
        &self.strength
    }
}

/// Products of the gradients of the middle one of three rows by Sobel's kernel.
#[multiversion(targets("x86_64+avx2"))]
fn multiply(rows: [&[u8]; 3], [xx, xy, yy]: &mut Products) {
    let count = xx.len();
    let (xy, yy) = (&mut xy[..count], &mut yy[..count]);
    let [left, middle, right] = [0, 1, 2].map(|first| rows.map(|row| &row[first..][..count]));
    for x in 0..count {
        let at = |[above, here, below]: [&[u8]; 3]| [above[x], here[x], below[x]].map(i16::from);
        let (left, middle, right) = (at(left), at(middle), at(right));
        let across = (right[0] - left[0]) + 2 * (right[1] - left[1]) + (right[2] - left[2]);
        let down = (left[2] - left[0]) + 2 * (middle[2] - middle[0]) + (right[2] - right[0]);
        let (across, down) = (f32::from(across), f32::from(down));
        (xx[x], xy[x], yy[x]) = (across * across, across * down, down * down);
    }
}

/// Adds three rows.
#[multiversion(targets("x86_64+avx2"))]
fn add([a, b, c]: &[Products; 3], sums: &mut Products) {
    for (sums, ((a, b), c)) in sums.iter_mut().zip(a.iter().zip(b).zip(c)) {
        let count = sums.len();
        let (a, b, c) = (&a[..count], &b[..count], &c[..count]);
        for x in 0..count {
            sums[x] = a[x] + b[x] + c[x];
        }
    }
}

/// Of the sums of three of a row each.
#[multiversion(targets("x86_64+avx2"))]
fn smaller_eigenvalues([xx, xy, yy]: &Products, out: &mut [f32]) {
    let count = out.len();
    let [xx, xy, yy] = [xx, xy, yy].map(|row| [0, 1, 2].map(|first| &row[first..][..count]));
    for x in 0..count {
        let sum = |[a, b, c]: [&[f32]; 3]| a[x] + b[x] + c[x];
        let (xx, xy, yy) = (0.5 * sum(xx), sum(xy), 0.5 * sum(yy));
        out[x] = xx + yy - ((xx - yy) * (xx - yy) + xy * xy).sqrt();
    }
}
