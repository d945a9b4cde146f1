use std::ops::Range;

use opencv::core::{self, CV_8UC1, DataType, Mat, Scalar, Size};
use opencv::imgproc;
use opencv::prelude::*;

use super::Luma;
use super::morphology::clean;

/// Likelihood, averaged over 3x3 pixels, from which a pixel may belong to a region: just above that of what is
/// unknown ...
const WEAK: f64 = 136.0;
/// ... and from which it makes one by itself.
const STRONG: f64 = 240.0;
/// Pixels that make a region, as a part of the picture: a few bright specks do not.
const MIN_STRONG: f64 = 1.0 / 8000.0;

/// The foreground as a mask of 255 and 0 from the likelihood of each pixel: what is likely, cleaned by opening and
/// closing (thesis 3.3.1), where part of it is sure (hysteresis, as Canny's edges have it).
pub fn segment(likelihood: &Luma, open_size: usize, close_size: (usize, usize)) -> opencv::Result<Mat> {
    let (mut smooth, mut mask, mut strong) = (Mat::default(), Mat::default(), Mat::default());
    likelihood.with_mat(|likelihood| imgproc::blur_def(likelihood, &mut smooth, Size::new(3, 3)))?;
    imgproc::threshold(&smooth, &mut mask, WEAK, 255.0, imgproc::THRESH_BINARY)?;
    imgproc::threshold(&smooth, &mut strong, STRONG, 255.0, imgproc::THRESH_BINARY)?;
    let needed = (MIN_STRONG * (likelihood.width() * likelihood.height()) as f64).ceil() as usize;
    if (core::count_non_zero(&strong)? as usize) < needed {
        return Mat::new_size_with_default(mask.size()?, CV_8UC1, Scalar::all(0.0));
    }
    clean(&mut mask, open_size, close_size)?;
    let (mut labels, mut boxes, mut centres) = (Mat::default(), Mat::default(), Mat::default());
    let count = imgproc::connected_components_with_stats_def(&mask, &mut labels, &mut boxes, &mut centres)?;
    for label in 1..count {
        let part = Part::of(&boxes, label)?;
        let is_sure = part.count(&labels, &strong)? >= needed;
        let kept = if is_sure { part.upright(&labels)? } else { 0..0 };
        part.keep(kept, &labels, &mut mask)?;
    }
    Ok(mask)
}

/// Columns of a region with less than this part of its tallest one may be a shadow on the floor beside somebody upright ...
const LOW: f32 = 0.3;
/// ... and are one where they go on for so many heights of it: farther than a foot or a hand reaches.
const LONG: f32 = 0.25;

/// A connected part of the mask: its number among the labels, and its box in pixels.
struct Part {
    label: i32,
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Part {
    fn of(boxes: &Mat, label: i32) -> opencv::Result<Self> {
        let side = |side: i32| boxes.at_2d::<i32>(label, side).map(|value| *value as usize);
        let (left, top) = (side(imgproc::CC_STAT_LEFT)?, side(imgproc::CC_STAT_TOP)?);
        let (width, height) = (side(imgproc::CC_STAT_WIDTH)?, side(imgproc::CC_STAT_HEIGHT)?);
        Ok(Self { label, columns: left..left + width, rows: top..top + height })
    }

    /// Its pixels that are set in another mask.
    fn count(&self, labels: &Mat, other: &Mat) -> opencv::Result<usize> {
        let mut count = 0;
        for row in self.rows.clone() {
            let set = self.line::<u8>(other, row)?.iter().zip(self.line::<i32>(labels, row)?);
            count += set.filter(|(pixel, label)| **pixel > 0 && **label == self.label).count();
        }
        Ok(count)
    }

    /// Its columns without a long low tail on either side: somebody stands upright, and their shadow lies (by the heights of
    /// columns, as Hsieh et al., "Shadow elimination for effective moving object detection", 2003).
    fn upright(&self, labels: &Mat) -> opencv::Result<Range<usize>> {
        let mut heights = vec![0_usize; self.columns.len()];
        for row in self.rows.clone() {
            let line = self.line::<i32>(labels, row)?;
            line.iter()
                .zip(&mut heights)
                .for_each(|(label, height)| *height += usize::from(*label == self.label));
        }
        let tallest = heights.iter().copied().max().unwrap_or(0) as f32;
        let low = |height: &&usize| (**height as f32) < LOW * tallest;
        let long = |tail: usize| if tail as f32 >= LONG * tallest { tail } else { 0 };
        let before = long(heights.iter().take_while(low).count());
        let after = long(heights.iter().rev().take_while(low).count());
        Ok(self.columns.start + before..self.columns.end - after)
    }

    /// Clears its pixels in the mask but for those in these columns.
    fn keep(&self, kept: Range<usize>, labels: &Mat, mask: &mut Mat) -> opencv::Result<()> {
        if kept == self.columns {
            return Ok(());
        }
        for row in self.rows.clone() {
            let line = self.line::<i32>(labels, row)?;
            let pixels = &mut mask.at_row_mut::<u8>(row as i32)?[self.columns.clone()];
            for ((column, pixel), label) in self.columns.clone().zip(pixels).zip(line) {
                if *label == self.label && !kept.contains(&column) {
                    *pixel = 0;
                }
            }
        }
        Ok(())
    }

    /// A row of a picture within its box.
    fn line<'a, T: DataType>(&self, picture: &'a Mat, row: usize) -> opencv::Result<&'a [T]> {
        Ok(&picture.at_row::<T>(row as i32)?[self.columns.clone()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (160, 100);

    /// Left, top, width, height in pixels.
    type Pixels = (usize, usize, usize, usize);

    /// Likelihoods of 20 with boxes of others; how many pixels are segmented.
    fn segmented(boxes: &[(Pixels, u8)]) -> i32 {
        let mut likelihood = vec![20; SIZE.0 * SIZE.1];
        for ((x, y, width, height), value) in boxes {
            for row in likelihood.chunks_exact_mut(SIZE.0).skip(*y).take(*height) {
                row[*x..x + width].fill(*value);
            }
        }
        let mask = segment(&Luma::packed(&likelihood, SIZE.0), 3, (3, 7)).unwrap();
        core::count_non_zero(&mask).unwrap()
    }

    #[test]
    fn what_is_likely_counts_beside_what_is_sure() {
        let (body, head) = ((50, 40, 12, 40), (53, 30, 6, 10));
        assert_eq!(segmented(&[(body, 180)]), 0, "likely only");
        let alone = segmented(&[(head, 255)]);
        let both = segmented(&[(body, 180), (head, 255)]);
        assert!(alone > 40 && both > 400, "{alone} {both}");
    }

    #[test]
    fn somebody_leaves_their_shadow_behind_and_keeps_their_feet() {
        let (body, shadow, foot) = ((50, 20, 14, 60), (10, 72, 40, 6), (64, 74, 6, 6));
        let alone = segmented(&[(body, 255)]);
        assert!((segmented(&[(body, 255), (shadow, 255)]) - alone).abs() < 30, "a shadow");
        assert!(segmented(&[(body, 255), (foot, 255)]) > alone + 15, "a foot");
        let beside = (80, 25, 14, 60);
        assert!(segmented(&[(body, 255), (shadow, 255), (beside, 255)]) > 2 * alone - 60, "somebody beside");
    }

    #[test]
    fn specks_and_the_unknown_are_no_regions() {
        assert_eq!(segmented(&[((20, 20, 1, 1), 255), ((90, 60, 2, 1), 255)]), 0);
        assert_eq!(segmented(&[((0, 0, 160, 100), 128)]), 0);
    }
}
