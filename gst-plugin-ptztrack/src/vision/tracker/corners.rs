// SPDX-License-Identifier: MPL-2.0

//! Corners worth following (thesis 3.5.1, equations 3.6 and 3.7): Shi and Tomasi's smaller eigenvalue, ranked, outliers
//! rejected.

use opencv::core::{CV_8UC1, Mat, Point, Point2f, Rect2f, Scalar, Vector};
use opencv::imgproc;
use opencv::prelude::*;

use super::geometry::mean;
use super::patch::Patch;

/// A corner must have this share of the best corner's eigenvalue.
const QUALITY: f64 = 0.03;
/// Side in pixels of the neighbourhood that the gradient matrix (3.6) sums over.
const BLOCK: i32 = 3;

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

/// Leaves the best corners of `patch` inside the contour in `found`.
pub(super) fn find(patch: &Patch, search: &Search, found: &mut Vec<Point2f>) -> opencv::Result<()> {
    found.clear();
    // Only the part of the patch around the contour is looked at: corner search is the dearest step.
    let Some(window) = window_of(patch, search.contour).filter(|_| search.count > 0) else {
        return Ok(());
    };
    let mask = mask(patch, search, window)?;
    let grey = Mat::roi(patch.grey(), window)?;
    let mut corners = Vector::<Point2f>::new();
    imgproc::good_features_to_track(
        &grey,
        &mut corners,
        i32::try_from(search.count).unwrap_or(i32::MAX),
        QUALITY,
        f64::from(search.distance) / patch.step() as f64,
        &mask,
        BLOCK,
        false,
        0.04,
    )?;
    let offset = Point2f::new(window.x as f32, window.y as f32);
    found.extend(corners.iter().map(|corner| patch.leave(corner + offset)));
    Ok(())
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
    let width = (last.x.ceil() as i32).min(patch.grey().cols()) - x;
    let height = (last.y.ceil() as i32).min(patch.grey().rows()) - y;
    (width >= BLOCK && height >= BLOCK).then(|| opencv::core::Rect::new(x, y, width, height))
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
    use proptest::prelude::*;

    fn found(patch: &Patch, search: &Search) -> Vec<Point2f> {
        let mut found = Vec::new();
        find(patch, search, &mut found).expect("corners");
        found
    }

    fn textured() -> Patch {
        let scene = Scene::new(160, 120);
        let picture = scene.background((0.0, 0.0));
        let cut = Cut::new(&picture.luma(), Rect2f::new(20.0, 10.0, 100.0, 90.0), 1);
        Patch::cut(&picture.luma(), cut, 15).expect("cut")
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
        let patch = Patch::cut(&picture.luma(), cut, 15).expect("cut");
        let search = Search { contour: &[], taken: &[], count: 1, distance: 5.0 };
        let corner = found(&patch, &search)[0];
        assert!(length(corner - Point2f::new(30.0, 20.0)) < 2.0, "{corner:?}");
    }

    #[test]
    fn flat_and_tiny_windows_have_none() {
        let picture = Scene::new(64, 64).flat(90);
        let cut = Cut::new(&picture.luma(), Rect2f::new(0.0, 0.0, 40.0, 40.0), 1);
        let patch = Patch::cut(&picture.luma(), cut, 15).expect("cut");
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
