// SPDX-License-Identifier: MPL-2.0

use opencv::core::{Mat, Size};
use opencv::imgproc;
use opencv::prelude::*;

use super::{Luma, LumaError};

/// The smallest divisor of a picture's width that makes it at most `limit` pixels wide; 1 where there is
/// no limit (0).
pub fn divisor(width: usize, limit: usize) -> usize {
    if limit == 0 { 1 } else { width.div_ceil(limit).max(1) }
}

/// Runs `look` on `luma` reduced by `divisor` in both directions: each pixel is the average of a square
/// of that many a side, which also averages out noise. Columns and rows left over at the right and the
/// bottom (fewer than `divisor`) are not looked at; a picture smaller than one square is not reduced.
/// `kept` is memory for the next picture. Nothing is copied where `divisor` is 1.
pub fn with_reduced<T, E: From<opencv::Error> + From<LumaError>>(
    luma: &Luma,
    divisor: usize,
    kept: &mut Mat,
    look: impl FnOnce(&Luma) -> Result<T, E>,
) -> Result<T, E> {
    let (width, height) = (luma.width() / divisor, luma.height() / divisor);
    if divisor == 1 || width == 0 || height == 0 {
        return look(luma);
    }
    luma.crop(0, 0, width * divisor, height * divisor).with_mat(|whole| {
        let size = Size::new(width as i32, height as i32);
        imgproc::resize(whole, kept, size, 0.0, 0.0, imgproc::INTER_AREA)
    })?;
    look(&Luma::new(kept.data_bytes()?, width, height, width)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn reduced(luma: &Luma, divisor: usize) -> (usize, usize, Vec<u8>) {
        let mut kept = Mat::default();
        with_reduced(luma, divisor, &mut kept, |small| {
            let rows = (0..small.height()).flat_map(|y| small.row(y).to_vec()).collect();
            Ok::<_, super::super::DetectorError>((small.width(), small.height(), rows))
        })
        .unwrap()
    }

    #[test]
    fn divisor_is_the_smallest_that_fits() {
        assert_eq!([320, 640, 641, 1280, 1920, 4096].map(|width| divisor(width, 640)), [1, 1, 2, 2, 3, 7]);
        assert_eq!(divisor(4096, 0), 1);
        assert_eq!(divisor(0, 640), 1);
    }

    #[test]
    fn squares_are_averaged_and_left_overs_left_out() {
        let data = [10, 20, 100, 100, 9, 30, 40, 100, 104, 9, 7, 7, 7, 7, 7];
        let luma = Luma::new(&data, 5, 3, 5).unwrap();
        assert_eq!(reduced(&luma, 2), (2, 1, vec![25, 101]));
    }

    #[test]
    fn undivided_is_not_copied() {
        let data = [1; 12];
        let luma = Luma::new(&data, 3, 3, 4).unwrap();
        let look = |small: &Luma| Ok::<_, super::super::DetectorError>(small.row(0).as_ptr());
        assert_eq!(with_reduced(&luma, 1, &mut Mat::default(), look).unwrap(), data.as_ptr());
        assert_eq!(with_reduced(&luma, 4, &mut Mat::default(), look).unwrap(), data.as_ptr());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn averages_follow_their_definition(
            data in proptest::collection::vec(any::<u8>(), 30 * 20), divisor in 2usize..8, padding in 0usize..5,
        ) {
            let luma = Luma::new(&data, 30 - padding, 20, 30).unwrap();
            let (width, height, pixels) = reduced(&luma, divisor);
            prop_assert_eq!((width, height), ((30 - padding) / divisor, 20 / divisor));
            for (index, pixel) in pixels.into_iter().enumerate() {
                let (x, y) = (index % width * divisor, index / width * divisor);
                let sum: u32 = (y..y + divisor)
                    .map(|y| luma.row(y)[x..x + divisor].iter().map(|p| u32::from(*p)).sum::<u32>())
                    .sum();
                let average = f64::from(sum) / (divisor * divisor) as f64;
                prop_assert!((f64::from(pixel) - average).abs() <= 1.0);
            }
        }
    }
}
