// SPDX-License-Identifier: MPL-2.0

//! Means of squares of pixels around each one, to the last digit those of OpenCV's `blur`: rows come one at a time, so that nothing
//! larger than a row is kept.

use multiversion::multiversion;

use super::Luma;

/// Pixels on either side of the middle one, ...
const REACH: usize = 4;
/// ... and of the square's side.
pub(super) const SIDE: usize = 2 * REACH + 1;

/// Blurs one plane; kept as memory for the next one.
#[derive(Debug, Default)]
pub(super) struct Blur {
    /// Sums of the columns of pixels around the last row, with those of the mirrored border.
    columns: Vec<u16>,
    /// Which of them is which one's mirror.
    mirrors: [(usize, usize); 2 * REACH],
    row: Vec<u8>,
}

impl Blur {
    /// The means around row `y` of a plane whose rows are asked for in turn.
    pub fn row(&mut self, plane: &Luma, y: usize) -> &[u8] {
        let (width, height) = (plane.width(), plane.height());
        let row = |y: isize| plane.row(mirrored(y, height));
        let (first, last) = (y as isize - REACH as isize, y as isize + REACH as isize);
        self.row.resize(width, 0);
        self.columns.resize(width + 2 * REACH, 0);
        if y == 0 {
            self.mirrors = std::array::from_fn(|border| {
                let mirror = if border < REACH { border } else { width + border };
                (mirror, REACH + mirrored(mirror as isize - REACH as isize, width))
            });
            self.columns.fill(0);
            (first..last).for_each(|y| add(&mut self.columns[REACH..], row(y)));
        } else {
            subtract(&mut self.columns[REACH..], row(first - 1));
        }
        add(&mut self.columns[REACH..], row(last));
        for (mirror, inside) in self.mirrors {
            self.columns[mirror] = self.columns[inside];
        }
        means(&self.columns, &mut self.row);
        &self.row
    }
}

/// The place inside that a place beyond the border shows, of which the border itself is the mirror.
pub(super) fn mirrored(place: isize, size: usize) -> usize {
    let last = size.saturating_sub(1);
    let place = place.unsigned_abs() % (2 * last).max(1);
    place.min(2 * last - place)
}

#[multiversion(targets("x86_64+avx2"))]
fn add(columns: &mut [u16], row: &[u8]) {
    columns.iter_mut().zip(row).for_each(|(sum, &pixel)| *sum += u16::from(pixel));
}

#[multiversion(targets("x86_64+avx2"))]
fn subtract(columns: &mut [u16], row: &[u8]) {
    columns.iter_mut().zip(row).for_each(|(sum, &pixel)| *sum -= u16::from(pixel));
}

/// Rounded means, from the sums of the columns.
#[multiversion(targets("x86_64+avx2"))]
fn means(columns: &[u16], row: &mut [u8]) {
    const COUNT: u16 = (SIDE * SIDE) as u16;
    let width = row.len();
    let columns: [&[u16]; SIDE] = std::array::from_fn(|off| &columns[off..off + width]);
    for (x, mean) in row.iter_mut().enumerate() {
        let mut sum = COUNT / 2;
        for columns in columns {
            sum += columns[x];
        }
        *mean = (sum / COUNT) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::{Mat, Size};
    use opencv::imgproc;
    use opencv::prelude::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_that_of_opencv(width in 1usize..40, pixels in prop::collection::vec(any::<u8>(), 400)) {
            let plane = Luma::packed(&pixels[..400 / width * width], width);
            let mut expected = Mat::default();
            let side = Size::new(SIDE as i32, SIDE as i32);
            plane.with_mat(|plane| imgproc::blur_def(plane, &mut expected, side)).unwrap();
            let mut blur = Blur::default();
            for y in 0..plane.height() {
                prop_assert_eq!(blur.row(&plane, y), expected.at_row::<u8>(y as i32).unwrap());
            }
        }
    }
}
