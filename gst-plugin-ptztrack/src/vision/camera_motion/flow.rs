// SPDX-License-Identifier: MPL-2.0

//! Points of a whole reduced picture, followed from the key picture on.

use opencv::core::Point2f;

use crate::vision::Luma;
use crate::vision::lucas_kanade::{Precision, Pyramid, Template};

/// Side of the window of a point.
const WINDOW: usize = 13;
/// Halvings of the picture: the coarsest level sees motions of half its window, 8 times as large here.
const HALVINGS: usize = 3;
const PRECISION: Precision = Precision { steps: 15, step: 0.02 };
/// Mean absolute difference of the two windows, grey levels, above which a point is lost. Generous: what does
/// not fit the others is sorted out by the fit, and blur changes looks.
const MAX_RESIDUAL: f32 = 24.0;

/// Makes `pyramid` that of a picture.
pub(super) fn fill(pyramid: &mut Pyramid, luma: &Luma) {
    let size = (luma.width(), luma.height());
    pyramid.fill(size, WINDOW, HALVINGS, |y, row| row.copy_from_slice(luma.row(y)));
}

/// Makes `template` that of a point.
pub(super) fn take(template: &mut Template, from: &Pyramid, point: Point2f) {
    template.take(from, point, WINDOW, HALVINGS);
}

/// Where a point is that is expected at its `guess`; `None` where it is lost.
pub(super) fn follow(template: &Template, to: &Pyramid, guess: Point2f) -> Option<Point2f> {
    let found = template.follow(to, guess, PRECISION)?;
    (found.residual <= MAX_RESIDUAL).then_some(found.place)
}
