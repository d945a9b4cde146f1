// SPDX-License-Identifier: MPL-2.0

//! Corners worth following (thesis 3.5.1, equations 3.6 and 3.7): Shi and Tomasi's smaller eigenvalue, ranked, outliers
//! rejected.

use opencv::core::{CV_8UC1, Mat, Point, Point2f, Rect2f, Scalar, Vector};
use opencv::imgproc;
use opencv::prelude::*;

use super::corner_strength::CornerStrength;
use super::geometry::mean;
use super::patch::Patch;

/// A corner must have this share of the best corner's eigenvalue.
const QUALITY: f32 = 0.03;
/// Pixels of a side of the least window that has a corner.
const LEAST: i32 = 3;

/// Corners of one patch in frame pixels, best first.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Corners {
    /// To be followed.
    pub kept: Vec<Point2f>,
    /// Too far out; shown to the user in red (thesis figure 3.7).
    pub rejected: Vec<Point2f>,
}

/// Where corners are wanted.
pub(super) struct Search<'a> {
    /// Polygon in frame pixels; fewer than three points stand for the whole patch.
    pub contour: &'a [Point2f],
    /// Places that have a point already.
    pub taken: &'a [Point2f],
    /// How many at most.
    pub count: usize,
    /// Frame pixels that corners keep from each other and from `taken`.
    pub distance: f32,
}

/// Finds corners; kept as memory for the next search.
#[derive(Debug, Default)]
pub(super) struct CornerFinder {
    strength: CornerStrength,
    /// Pixels of the window that may be corners, and how good they are.
    candidates: Vec<(usize, f32)>,
    /// Those that are taken.
    taken: Vec<(i32, i32)>,
}

impl CornerFinder {
    /// Leaves the best corners of `patch` inside the contour in `found`, as OpenCV's `goodFeaturesToTrack` does it.
    pub fn find(&mut self, patch: &Patch, search: &Search, found: &mut Vec<Point2f>) -> opencv::Result<()> {
        found.clear();
        // Only the part of the patch around the contour is looked at: corner search is the dearest step.
        let Some(window) = window_of(patch, search.contour).filter(|_| search.count > 0) else {
            return Ok(());
        };
        let mask = mask(patch, search, window)?;
        self.strength.fill(patch, window);
        self.rank(mask.data_bytes()?, window.width as usize);
        let distance = search.distance / patch.step() as f32;
        self.keep_apart(distance, search.count, window.width as usize);
        let corner = |&(x, y): &(i32, i32)| Point2f::new((window.x + x) as f32, (window.y + y) as f32);
        found.extend(self.taken.iter().map(|place| patch.leave(corner(place))));
        Ok(())
    }

    /// Leaves the pixels within the mask, but for the outermost, that are better than their neighbours, best first.
    fn rank(&mut self, mask: &[u8], width: usize) {
        let strength = self.strength.all();
        let best = strength.iter().zip(mask).filter(|(_, inside)| **inside > 0);
        let least = QUALITY * best.fold(0.0, |best: f32, (strength, _)| best.max(*strength));
        self.candidates.clear();
        for first in (width..strength.len().saturating_sub(width)).step_by(width) {
            for at in first + 1..first + width - 1 {
                let here = strength[at];
                let is_best = || {
                    let rows = [at - width, at, at + width].map(|middle| &strength[middle - 1..=middle + 1]);
                    rows.into_iter().flatten().all(|near| *near <= here)
                };
                if here > least && mask[at] > 0 && is_best() {
                    self.candidates.push((at, here));
                }
            }
        }
        self.candidates.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(b.0.cmp(&a.0)));
    }

    /// Takes the best, up to so many that keep that distance, pixels of the patch, from each other.
    fn keep_apart(&mut self, distance: f32, count: usize, width: usize) {
        self.taken.clear();
        for (at, _) in &self.candidates {
            let (x, y) = ((at % width) as i32, (at / width) as i32);
            let apart = |taken: &(i32, i32)| ((x - taken.0).pow(2) + (y - taken.1).pow(2)) as f32;
            if self.taken.iter().all(|taken| apart(taken) >= distance * distance) {
                self.taken.push((x, y));
            }
            if self.taken.len() >= count {
                break;
            }
        }
    }
}

/// Splits ranked corners into those near their common middle and outliers.
///
/// The thesis "selects pixels based on a standard deviation of the points. If points fall out of a
/// 20% range from the standard deviation, points are rejected". It is read here as: along each axis, a
/// point may lie `range` standard deviations from the mean of all points, 1.2 in the thesis.
pub(super) fn reject_outliers(corners: Vec<Point2f>, range: f32) -> Corners {
    let Some(middle) = mean(corners.iter().copied()) else { return Corners::default() };
    let squares = corners.iter().map(|corner| *corner - middle).map(|d| Point2f::new(d.x * d.x, d.y * d.y));
    let variance = mean(squares).unwrap_or_default();
    // Half a pixel of grace: corners on one line have no deviation across it.
    let limit = Point2f::new(range * variance.x.sqrt() + 0.5, range * variance.y.sqrt() + 0.5);
    let is_near = |corner: &Point2f| {
        let offset = *corner - middle;
        offset.x.abs() <= limit.x && offset.y.abs() <= limit.y
    };
    if !corners.iter().any(is_near) {
        // A few points spread evenly are no outliers of each other.
        return Corners { kept: corners, rejected: Vec::new() };
    }
    let (kept, rejected) = corners.into_iter().partition(is_near);
    Corners { kept, rejected }
}

/// The pixels of the patch around the contour; `None` where there are none.
fn window_of(patch: &Patch, contour: &[Point2f]) -> Option<opencv::core::Rect> {
    let area = patch.area();
    let (mut left, mut top, mut right, mut bottom) = (area.x, area.y, area.br().x, area.br().y);
    if contour.len() >= 3 {
        let bound = |pick: fn(&Point2f) -> f32, best: fn(f32, f32) -> f32| {
            contour.iter().map(pick).reduce(best).unwrap_or_default()
        };
        left = left.max(bound(|p| p.x, f32::min));
        top = top.max(bound(|p| p.y, f32::min));
        right = right.min(bound(|p| p.x, f32::max) + 1.0);
        bottom = bottom.min(bound(|p| p.y, f32::max) + 1.0);
    }
    let (first, last) = (patch.enter(Point2f::new(left, top)), patch.enter(Point2f::new(right, bottom)));
    let (x, y) = (first.x.floor().max(0.0) as i32, first.y.floor().max(0.0) as i32);
    let (columns, rows) = patch.size();
    let width = (last.x.ceil() as i32).min(columns as i32) - x;
    let height = (last.y.ceil() as i32).min(rows as i32) - y;
    (width >= LEAST && height >= LEAST).then(|| opencv::core::Rect::new(x, y, width, height))
}

fn mask(patch: &Patch, search: &Search, window: opencv::core::Rect) -> opencv::Result<Mat> {
    let pixel = |point: &Point2f| {
        let inside = patch.enter(*point);
        Point::new(inside.x.round() as i32 - window.x, inside.y.round() as i32 - window.y)
    };
    let all = search.contour.len() < 3;
    let ground = Scalar::all(if all { 255.0 } else { 0.0 });
    let mut mask = Mat::new_rows_cols_with_default(window.height, window.width, CV_8UC1, ground)?;
    if !all {
        let polygon: Vector<Point> = search.contour.iter().map(pixel).collect();
        imgproc::fill_poly_def(&mut mask, &polygon, Scalar::all(255.0))?;
    }
    let radius = (search.distance / patch.step() as f32).round().max(1.0) as i32;
    for point in search.taken {
        imgproc::circle(
            &mut mask,
            pixel(point),
            radius,
            Scalar::all(0.0),
            imgproc::FILLED,
            imgproc::LINE_8,
            0,
        )?;
    }
    Ok(mask)
}

/// The ellipse inscribed in a box, as a polygon: where a body is, when no contour tells.
pub(super) fn ellipse(bounds: Rect2f) -> [Point2f; 24] {
    let middle = super::geometry::centre(bounds);
    std::array::from_fn(|corner| {
        let (sin, cos) = (corner as f32 / 24.0 * std::f32::consts::TAU).sin_cos();
        middle + Point2f::new(cos * bounds.width / 2.0, sin * bounds.height / 2.0)
    })
}

#[cfg(test)]
mod tests {
    use super::super::geometry::{in_ellipse, length};
    use super::super::patch::Cut;
    use super::super::synthetic::Scene;
    use super::*;
    use crate::vision::Luma;
    use proptest::prelude::*;

    fn found(patch: &Patch, search: &Search) -> Vec<Point2f> {
        let mut found = Vec::new();
        CornerFinder::default().find(patch, search, &mut found).expect("corners");
        found
    }

    fn textured() -> Patch {
        let scene = Scene::new(160, 120);
        let picture = scene.background((0.0, 0.0));
        let cut = Cut::new(&picture.luma(), Rect2f::new(20.0, 10.0, 100.0, 90.0), 1);
        Patch::cut(&picture.luma(), cut, 0)
    }

    #[test]
    fn corners_lie_inside_the_contour_and_apart() {
        let contour = ellipse(Rect2f::new(40.0, 30.0, 40.0, 60.0));
        let search = Search { contour: &contour, taken: &[], count: 20, distance: 5.0 };
        let corners = found(&textured(), &search);
        assert!(corners.len() >= 8, "{}", corners.len());
        for (index, corner) in corners.iter().enumerate() {
            assert!(in_ellipse(Rect2f::new(38.0, 28.0, 44.0, 64.0), *corner));
            assert!(corners[..index].iter().all(|other| length(*corner - *other) >= 4.9));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_best_are_those_of_opencv(
            data in prop::collection::vec(any::<u8>(), 60 * 50), count in 1_usize..12, distance in 1_u8..8,
        ) {
            let luma = Luma::new(&data, 60, 50, 60).expect("fits");
            let patch = Patch::cut(&luma, Cut::new(&luma, Rect2f::new(3.0, 2.0, 50.0, 40.0), 1), 0);
            let distance = f32::from(distance);
            // At the edge of a picture OpenCV sums other gradients.
            let contour = [(8.0, 7.0), (47.0, 7.0), (47.0, 36.0), (8.0, 36.0)].map(|(x, y)| Point2f::new(x, y));
            let search = Search { contour: &contour, taken: &[], count, distance };
            let mut mask = Mat::new_rows_cols_with_default(40, 50, CV_8UC1, Scalar::all(0.0)).expect("a mask");
            let inside = opencv::core::Rect::new(6, 6, 38, 28);
            imgproc::rectangle(&mut mask, inside, Scalar::all(255.0), imgproc::FILLED, imgproc::LINE_8, 0).expect("drawn");
            let mut theirs = Vector::<Point2f>::new();
            let quality = f64::from(QUALITY);
            let search_by_opencv = |grey: &Mat| imgproc::good_features_to_track(
                grey, &mut theirs, count as i32, quality, distance.into(), &mask, 3, false, 0.04,
            );
            patch.grey().with_mat(search_by_opencv).expect("OpenCV");
            let ours: Vec<Point2f> = found(&patch, &search).iter().map(|corner| patch.enter(*corner)).collect();
            prop_assert_eq!(ours, theirs.to_vec());
        }
    }

    #[test]
    fn taken_places_are_left_alone() {
        let all = Search { contour: &[], taken: &[], count: 10, distance: 6.0 };
        let first = found(&textured(), &all);
        let rest = Search { taken: &first, ..all };
        for corner in found(&textured(), &rest) {
            assert!(first.iter().all(|taken| length(corner - *taken) >= 5.0));
        }
    }

    #[test]
    fn a_corner_of_a_square_is_found_first() {
        let mut picture = Scene::new(64, 64).flat(20);
        let mut pixels = vec![20; 64 * 64];
        for y in 20..64 {
            pixels[y * 64 + 30..(y + 1) * 64].fill(200);
        }
        picture.replace(pixels);
        let cut = Cut::new(&picture.luma(), Rect2f::new(0.0, 0.0, 60.0, 60.0), 1);
        let patch = Patch::cut(&picture.luma(), cut, 0);
        let search = Search { contour: &[], taken: &[], count: 1, distance: 5.0 };
        let corner = found(&patch, &search)[0];
        assert!(length(corner - Point2f::new(30.0, 20.0)) < 2.0, "{corner:?}");
    }

    #[test]
    fn flat_and_tiny_windows_have_none() {
        let picture = Scene::new(64, 64).flat(90);
        let cut = Cut::new(&picture.luma(), Rect2f::new(0.0, 0.0, 40.0, 40.0), 1);
        let patch = Patch::cut(&picture.luma(), cut, 0);
        let point = [Point2f::new(5.0, 5.0); 3];
        for contour in [&[][..], &point[..]] {
            let search = Search { contour, taken: &[], count: 9, distance: 3.0 };
            assert!(found(&patch, &search).is_empty());
        }
    }

    #[test]
    fn points_beyond_the_deviation_are_rejected() {
        let mut corners: Vec<Point2f> = (0..10).map(|n| Point2f::new(n as f32, 5.0)).collect();
        corners.push(Point2f::new(60.0, 5.0));
        let split = reject_outliers(corners, 1.2);
        assert_eq!(split.rejected, [Point2f::new(60.0, 5.0)]);
        assert_eq!(split.kept.len(), 10);
        assert_eq!(reject_outliers(Vec::new(), 1.2), Corners::default());
    }

    proptest! {
        #[test]
        fn no_corner_is_forgotten(xy in prop::collection::vec((0.0_f32..640.0, 0.0_f32..480.0), 0..40)) {
            let corners: Vec<Point2f> = xy.iter().map(|&(x, y)| Point2f::new(x, y)).collect();
            let split = reject_outliers(corners.clone(), 1.2);
            prop_assert_eq!(split.kept.len() + split.rejected.len(), corners.len());
            prop_assert!(corners.is_empty() || !split.kept.is_empty());
        }
    }
}
