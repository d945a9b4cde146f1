// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::ops::Range;
use std::time::Duration;

use opencv::core::{self, CV_8UC1, Mat, Point, Rect, Scalar, Vector};
use opencv::imgproc;
use opencv::prelude::*;

use super::Luma;

/// How far back lies the picture that is compared with: walkers are seen to move within this time, and
/// pictures that a slow camera's stream repeats lie closer together.
const REACH: Duration = Duration::from_millis(100);
/// Where less than this fraction of a region changed, it stands (or the picture is a repeated one).
const STANDS: f64 = 0.05;
/// Columns and rows of a region count from this fraction of changed pixels on: fewer are noise.
const NOISE: f64 = 0.1;

/// Tells where something is from where it was.
///
/// The running mean (thesis 3.1) keeps a trail: where somebody was, the picture differs from the mean as
/// much as where they are. But there it no longer changes from picture to picture.
#[derive(Debug, Default)]
pub struct Afterimage {
    /// The pictures of the last `REACH`, oldest first, each with the time since.
    past: VecDeque<(Duration, Mat)>,
}

impl Afterimage {
    /// Forgets the pictures before.
    pub fn restart(&mut self) {
        self.past.clear();
    }

    /// Cuts each region of the binary `mask` to the box around what in `luma`, `elapsed` after the picture
    /// before, has changed by `limit` grey levels or more. What stands remains as it is.
    pub fn shed(&mut self, luma: &Luma, elapsed: Duration, limit: f64, mask: &mut Mat) -> opencv::Result<()> {
        self.past.iter_mut().for_each(|(age, _)| *age = age.saturating_add(elapsed));
        let mut kept = Mat::default();
        while self.past.get(1).is_some_and(|(age, _)| *age >= REACH) {
            kept = self.past.pop_front().map(|(_, picture)| picture).unwrap_or_default();
        }
        luma.with_mat(|now| {
            if let Some((_, before)) = self.past.front()
                && !mask.empty()
                && core::count_non_zero(mask)? > 0
            {
                *mask = cut(mask, &changed(now, before, limit)?)?;
            }
            now.copy_to(&mut kept)
        })?;
        self.past.push_back((Duration::ZERO, kept));
        Ok(())
    }
}

/// 255 where the two differ by `limit` or more.
fn changed(now: &Mat, before: &Mat, limit: f64) -> opencv::Result<Mat> {
    let (mut difference, mut changed) = (Mat::default(), Mat::default());
    core::absdiff(now, before, &mut difference)?;
    // Whole grey levels: above the next lower one is the limit or more.
    imgproc::threshold(&difference, &mut changed, limit.ceil() - 1.0, 255.0, imgproc::THRESH_BINARY)?;
    Ok(changed)
}

/// What of each region of `mask`, its holes filled, lies within the box around its pixels in `changed`.
fn cut(mask: &Mat, changed: &Mat) -> opencv::Result<Mat> {
    let mut contours = Vector::<Vector<Point>>::new();
    imgproc::find_contours_def(mask, &mut contours, imgproc::RETR_EXTERNAL, imgproc::CHAIN_APPROX_SIMPLE)?;
    let black = Scalar::all(0.0);
    let mut rest = Mat::new_size_with_default(mask.size()?, CV_8UC1, black)?;
    for contour in &contours {
        let bounds = imgproc::bounding_rect(&contour)?;
        // The boxes of regions overlap: this is the region alone.
        let mut own = Mat::new_size_with_default(bounds.size(), CV_8UC1, black)?;
        imgproc::fill_poly(
            &mut own,
            &contour,
            Scalar::all(255.0),
            imgproc::LINE_8,
            0,
            Point::new(-bounds.x, -bounds.y),
        )?;
        let mut moved = Mat::default();
        core::bitwise_and_def(&own, &changed.roi(bounds)?, &mut moved)?;
        let part = extent(&moved, core::count_non_zero(&own)?)?
            .unwrap_or(Rect::from_point_size(Point::default(), bounds.size()));
        let part_own = own.roi(part)?;
        part_own.copy_to_masked(&mut rest.roi_mut(part + bounds.tl())?, &part_own)?;
    }
    Ok(rest)
}

/// The box around what moved in a region of `area` pixels; `None` where hardly anything did.
fn extent(moved: &Mat, area: i32) -> opencv::Result<Option<Rect>> {
    if f64::from(core::count_non_zero(moved)?) < STANDS * f64::from(area) {
        return Ok(None);
    }
    let (width, height) = (moved.cols() as usize, moved.rows() as usize);
    let pixels = moved.data_bytes()?;
    let mut columns = vec![0; width];
    for row in pixels.chunks_exact(width) {
        columns.iter_mut().zip(row).for_each(|(count, pixel)| *count += usize::from(*pixel != 0));
    }
    let Some(x) = span(&columns, height) else { return Ok(None) };
    let count = |row: &[u8]| row[x.clone()].iter().filter(|pixel| **pixel != 0).count();
    let rows: Vec<usize> = pixels.chunks_exact(width).map(count).collect();
    let box_of = |y: Range<usize>| Rect::new(x.start as i32, y.start as i32, x.len() as i32, y.len() as i32);
    Ok(span(&rows, x.len()).map(box_of))
}

/// From the first to the last of the lines of `length` pixels of which more changed than noise does.
fn span(changed: &[usize], length: usize) -> Option<Range<usize>> {
    let moves = |count: &usize| *count as f64 > NOISE * length as f64;
    Some(changed.iter().position(moves)?..changed.iter().rposition(moves)? + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (100, 60);
    const STEP: Duration = Duration::from_millis(100);
    /// Left, top, width, height.
    type Box = (usize, usize, usize, usize);

    fn picture(boxes: &[Box], ground: u8, ink: u8) -> Vec<u8> {
        let mut picture = vec![ground; SIZE.0 * SIZE.1];
        for (x, y, width, height) in boxes {
            for row in picture.chunks_exact_mut(SIZE.0).skip(*y).take(*height) {
                row[*x..x + width].fill(ink);
            }
        }
        picture
    }

    /// The boxes of what `foreground` is cut to in a picture that shows `boxes`.
    fn shed(afterimage: &mut Afterimage, boxes: &[Box], foreground: &[Box], elapsed: Duration) -> Vec<Box> {
        let picture_now = picture(boxes, 80, 200);
        let luma = Luma::new(&picture_now, SIZE.0, SIZE.1, SIZE.0).unwrap();
        let bytes = picture(foreground, 0, 255);
        let mat = Mat::from_slice(&bytes).unwrap();
        let mut mask = mat.reshape(1, SIZE.1 as i32).unwrap().try_clone().unwrap();
        afterimage.shed(&luma, elapsed, 12.0, &mut mask).unwrap();
        let mut contours = Vector::<Vector<Point>>::new();
        imgproc::find_contours_def(&mask, &mut contours, imgproc::RETR_EXTERNAL, imgproc::CHAIN_APPROX_NONE)
            .unwrap();
        let bounds = contours.iter().map(|contour| imgproc::bounding_rect(&contour).unwrap());
        let mut found: Vec<_> =
            bounds.map(|b| (b.x as usize, b.y as usize, b.width as usize, b.height as usize)).collect();
        found.sort();
        found
    }

    #[test]
    fn the_trail_of_a_walker_is_shed() {
        let mut afterimage = Afterimage::default();
        shed(&mut afterimage, &[(50, 10, 10, 40)], &[], STEP);
        // Foreground since column 20; only the last step's columns still change.
        let found = shed(&mut afterimage, &[(55, 10, 10, 40)], &[(20, 10, 45, 40)], STEP);
        assert_eq!(found, [(50, 10, 15, 40)]);
    }

    #[test]
    fn a_first_picture_and_what_stands_remain_as_they_are() {
        let mut afterimage = Afterimage::default();
        let (person, region) = ((50, 10, 10, 40), (45, 10, 20, 40));
        for _ in 0..5 {
            assert_eq!(shed(&mut afterimage, &[person], &[region], STEP), [region]);
        }
        // A few pixels that flicker make no movement.
        assert_eq!(shed(&mut afterimage, &[person, (46, 20, 2, 2)], &[region], STEP), [region]);
    }

    #[test]
    fn repeated_pictures_show_the_same() {
        let mut afterimage = Afterimage::default();
        for step in 0..6 {
            let x = 40 + step * 5;
            for repeated in 0..3 {
                let boxes = [(x, 10, 10, 40)];
                let found = shed(&mut afterimage, &boxes, &[(20, 10, x - 10, 40)], Duration::from_millis(40));
                if step > 0 {
                    assert_eq!(found, [(x - 5, 10, 15, 40)], "{step} {repeated}");
                }
            }
        }
    }

    #[test]
    fn a_change_outside_the_region_does_not_widen_it() {
        let mut afterimage = Afterimage::default();
        shed(&mut afterimage, &[(50, 10, 10, 40)], &[], STEP);
        let now = [(53, 10, 10, 40), (0, 0, 15, 60)];
        assert_eq!(shed(&mut afterimage, &now, &[(20, 10, 43, 40)], STEP), [(50, 10, 13, 40)]);
    }

    #[test]
    fn after_a_restart_there_is_nothing_to_compare_with() {
        let mut afterimage = Afterimage::default();
        shed(&mut afterimage, &[(50, 10, 10, 40)], &[], STEP);
        afterimage.restart();
        let region = (20, 10, 45, 40);
        assert_eq!(shed(&mut afterimage, &[(55, 10, 10, 40)], &[region], STEP), [region]);
    }
}
