// SPDX-License-Identifier: MPL-2.0

//! Sparse pyramidal Lucas-Kanade (thesis 3.5.2, equations 3.8 to 3.11) between two whole reduced pictures.

use opencv::core::{self, Mat, Point2f, Size, TermCriteria, TermCriteria_COUNT, TermCriteria_EPS, Vector};
use opencv::video;

/// Side of the window of a point.
const WINDOW: i32 = 13;
/// Halvings of the picture: the coarsest level sees motions of half its window, 8 times as large here.
const LEVELS: i32 = 3;
const ITERATIONS: i32 = 15;
const PRECISION: f64 = 0.02;
/// Smaller eigenvalue of the gradient matrix, per pixel, below which (3.11) is not worth solving.
const MIN_EIGENVALUE: f64 = 1e-4;
/// Mean absolute difference of the two windows, grey levels, above which a point is lost. Generous: what does
/// not fit the others is sorted out by the fit, and blur changes looks.
const MAX_RESIDUAL: f32 = 24.0;

/// A picture and its halvings.
#[derive(Debug)]
pub(super) struct Pyramid {
    levels: Vector<Mat>,
    highest: i32,
}

impl Pyramid {
    pub fn of(picture: &Mat) -> opencv::Result<Self> {
        let mut levels = Vector::new();
        let highest = video::build_optical_flow_pyramid(
            picture,
            &mut levels,
            Size::new(WINDOW, WINDOW),
            LEVELS,
            false,
            core::BORDER_REFLECT_101,
            core::BORDER_CONSTANT,
            false,
        )?;
        Ok(Self { levels, highest })
    }

    pub fn picture(&self) -> opencv::Result<Mat> {
        self.levels.get(0)
    }
}

/// Follows `points` of `from` into `to`, where each is expected at its `guess`; `None` in `out` for one that is lost.
pub(super) fn follow(
    from: &Pyramid,
    to: &Pyramid,
    points: impl Iterator<Item = Point2f>,
    guesses: impl Iterator<Item = Point2f>,
    out: &mut Vec<Option<Point2f>>,
) -> opencv::Result<()> {
    out.clear();
    let starts: Vector<Point2f> = points.collect();
    let mut ends: Vector<Point2f> = guesses.collect();
    if starts.is_empty() {
        return Ok(());
    }
    let (mut status, mut residuals) = (Vector::<u8>::new(), Vector::<f32>::new());
    video::calc_optical_flow_pyr_lk(
        &from.levels,
        &to.levels,
        &starts,
        &mut ends,
        &mut status,
        &mut residuals,
        Size::new(WINDOW, WINDOW),
        from.highest.min(to.highest),
        TermCriteria {
            typ: TermCriteria_COUNT | TermCriteria_EPS,
            max_count: ITERATIONS,
            epsilon: PRECISION,
        },
        video::OPTFLOW_USE_INITIAL_FLOW,
        MIN_EIGENVALUE,
    )?;
    let found = ends.iter().zip(status.iter().zip(residuals.iter()));
    out.extend(found.map(|(end, (found, residual))| (found != 0 && residual <= MAX_RESIDUAL).then_some(end)));
    Ok(())
}
