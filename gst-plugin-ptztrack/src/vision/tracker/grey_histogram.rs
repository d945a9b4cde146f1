// SPDX-License-Identifier: MPL-2.0

//! Centre of mass by mean-shift over the back-projected grey histogram (thesis 3.5.3, equations 3.12 to 3.15; Comaniciu).

use opencv::core::{Mat, Point2f, Rect, Rect2f};
use opencv::imgproc;

use super::geometry::centre;
use super::patch::Patch;

/// Bins of the grey histogram: few enough that light changing a little changes little.
const BINS: usize = 32;
const GREYS_A_BIN: usize = 256 / BINS;
/// "This process is repeated until the mean-shift vector converges to 0."
const ITERATIONS: usize = 15;
/// Half the side of the neighbourhood of a feature point that is counted as target, patch pixels.
const REACH: f32 = 2.0;

/// Share of each grey level on the target: the look-up table from pixel to probability.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GreyHistogram {
    shares: [f32; BINS],
}

impl GreyHistogram {
    /// Counts the surroundings of `points` in the patch; `None` where no point lies in it.
    pub fn new(patch: &Patch, points: &[Point2f]) -> Option<Self> {
        let mut target = [0.0; BINS];
        for point in points {
            count(patch, *point, &mut target);
        }
        let total: f32 = target.iter().sum();
        if total == 0.0 {
            return None;
        }
        target.iter_mut().for_each(|share| *share /= total);
        Some(Self { shares: target })
    }

    /// The probability picture: 255 for the grey that is most typical of the target.
    fn back_project(&self, patch: &Patch) -> opencv::Result<Mat> {
        let best = self.shares.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let table: Vec<u8> =
            (0..256).map(|grey| (255.0 * self.shares[grey / GREYS_A_BIN] / best).round() as u8).collect();
        let mut probability = Mat::default();
        let table = Mat::from_slice(&table)?;
        patch.grey().with_mat(|grey| opencv::core::lut(grey, &table, &mut probability))?;
        Ok(probability)
    }

    /// The centre of mass (3.13 to 3.15) of the probability in a window the size of `start`, moved until
    /// it stays, and then `None` where there is no mass at all.
    pub fn centre_of_mass(&self, patch: &Patch, start: Rect2f) -> opencv::Result<Option<Point2f>> {
        let Some(mut window) = pixels(patch, start) else { return Ok(None) };
        let probability = self.back_project(patch)?;
        let mut middle = mass_centre(&probability, window)?;
        for _ in 0..ITERATIONS {
            let Some(moved) = middle.map(|middle| shifted(window, middle, patch.size())) else { break };
            if std::mem::replace(&mut window, moved) == moved {
                break;
            }
            middle = mass_centre(&probability, window)?;
        }
        Ok(middle.map(|middle| patch.leave(middle)))
    }
}

/// A window moved by the mean-shift vector (3.12), so that the centre of its mass is its middle, as far as a picture of that size goes.
fn shifted(window: Rect, middle: Point2f, (columns, rows): (usize, usize)) -> Rect {
    let place = |middle: f32, length: i32, size: usize| {
        let start = (middle - 0.5 * length as f32).round() as i32;
        start.clamp(0, (size as i32 - length).max(0))
    };
    Rect { x: place(middle.x, window.width, columns), y: place(middle.y, window.height, rows), ..window }
}

/// Equations 3.13 to 3.15 inside a window, in pixels of the picture.
fn mass_centre(probability: &Mat, window: Rect) -> opencv::Result<Option<Point2f>> {
    let moments = imgproc::moments(&Mat::roi(probability, window)?, false)?;
    Ok((moments.m00 > 0.0).then(|| {
        let offset = Point2f::new((moments.m10 / moments.m00) as f32, (moments.m01 / moments.m00) as f32);
        offset + Point2f::new(window.x as f32, window.y as f32)
    }))
}

/// The box in whole pixels of the patch, cut to it; `None` where nothing of it lies inside.
fn pixels(patch: &Patch, bounds: Rect2f) -> Option<Rect> {
    let (first, last) = (patch.enter(bounds.tl()), patch.enter(bounds.br()));
    let (columns, rows) = patch.size();
    let x = (first.x.round() as i32).clamp(0, columns as i32);
    let y = (first.y.round() as i32).clamp(0, rows as i32);
    let width = (last.x.round() as i32).min(columns as i32) - x;
    let height = (last.y.round() as i32).min(rows as i32) - y;
    (width > 0 && height > 0).then(|| Rect::new(x, y, width, height))
}

fn count(patch: &Patch, point: Point2f, counts: &mut [f32; BINS]) {
    let middle = patch.enter(point);
    let side = 2.0 * REACH + 1.0;
    let window = Rect2f::new(middle.x - REACH, middle.y - REACH, side, side);
    let (columns, rows) = patch.size();
    let span = |start: f32, length: f32, size: usize| {
        let first = (start.round().max(0.0) as usize).min(size);
        first..((start + length).round().max(0.0) as usize).clamp(first, size)
    };
    for y in span(window.y, window.height, rows) {
        for grey in &patch.grey().row(y)[span(window.x, window.width, columns)] {
            counts[usize::from(*grey) / GREYS_A_BIN] += 1.0;
        }
    }
}

/// Where mass was found, kept near the middle of the box: limbs and shadows pull, a camera should not swing.
pub(super) fn near_the_middle(mass: Point2f, bounds: Rect2f, share: f32) -> Point2f {
    let middle = centre(bounds);
    let (x, y) = (share * bounds.width, share * bounds.height);
    let offset = mass - middle;
    middle + Point2f::new(offset.x.clamp(-x, x), offset.y.clamp(-y, y))
}

#[cfg(test)]
mod tests {
    use super::super::patch::Cut;
    use super::super::synthetic::Scene;
    use super::*;

    #[test]
    fn centre_of_mass_by_hand() {
        // Two pixels of weight 10 at (2, 1) and one of 20 at (4, 3): M00 = 30, M10 = 100, M01 = 70.
        let mut pixels = [0_u8; 48];
        (pixels[8 + 2], pixels[3 * 8 + 4]) = (10, 20);
        let probability = Mat::from_slice_2d(&pixels.chunks(8).collect::<Vec<_>>()).expect("plane");
        let middle = mass_centre(&probability, Rect::new(0, 0, 8, 6)).expect("moments").expect("mass");
        assert!((middle.x - 100.0 / 30.0).abs() < 1e-4 && (middle.y - 70.0 / 30.0).abs() < 1e-4);
        let beside = mass_centre(&probability, Rect::new(1, 1, 2, 2)).expect("moments").expect("mass");
        assert!((beside.x - 2.0).abs() < 1e-4 && (beside.y - 1.0).abs() < 1e-4);
        assert_eq!(mass_centre(&probability, Rect::new(5, 4, 3, 2)).expect("moments"), None);
    }

    /// A bright square of 20 pixels at (40, 30) on a dark wall.
    fn square() -> Patch {
        let mut pixels = vec![30_u8; 120 * 90];
        for y in 30..50 {
            pixels[y * 120 + 40..y * 120 + 60].fill(200);
        }
        let mut picture = Scene::new(120, 90).flat(0);
        picture.replace(pixels);
        let area = Rect2f::new(0.0, 0.0, 120.0, 90.0);
        Patch::cut(&picture.luma(), Cut::new(&picture.luma(), area, 1), 0)
    }

    #[test]
    fn the_window_climbs_onto_the_target() {
        let patch = square();
        let on_square = [Point2f::new(48.0, 38.0), Point2f::new(52.0, 44.0)];
        let model = GreyHistogram::new(&patch, &on_square).expect("points inside");
        let start = Rect2f::new(28.0, 22.0, 24.0, 24.0);
        let mass = model.centre_of_mass(&patch, start).expect("shift").expect("mass");
        assert!((mass.x - 49.5).abs() < 1.0 && (mass.y - 39.5).abs() < 1.0, "{mass:?}");
    }

    #[test]
    fn no_points_and_no_window_are_no_model_and_no_mass() {
        let patch = square();
        let outside = [Point2f::new(-60.0, 900.0)];
        assert_eq!(GreyHistogram::new(&patch, &outside), None);
        let model = GreyHistogram::new(&patch, &[Point2f::new(48.0, 38.0)]).expect("inside");
        let away = Rect2f::new(500.0, 22.0, 24.0, 24.0);
        assert_eq!(model.centre_of_mass(&patch, away).expect("shift"), None);
    }

    #[test]
    fn mass_is_kept_near_the_middle() {
        let bounds = Rect2f::new(100.0, 100.0, 40.0, 80.0);
        assert_eq!(near_the_middle(Point2f::new(900.0, 141.0), bounds, 0.1), Point2f::new(124.0, 141.0));
    }
}
