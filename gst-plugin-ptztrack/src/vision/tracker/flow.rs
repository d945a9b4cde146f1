// SPDX-License-Identifier: MPL-2.0

//! Sparse pyramidal Lucas-Kanade (thesis 3.5.2, equations 3.8 to 3.11) between two patches, with its tests.

use opencv::core::{Point2f, Size, TermCriteria, TermCriteria_COUNT, TermCriteria_EPS, Vector};
use opencv::video;

use super::geometry::length;
use super::patch::Patch;

/// Smaller eigenvalue of the gradient matrix, per pixel, below which equation 3.11 is not worth solving.
const MIN_EIGENVALUE: f64 = 1e-4;

/// When a search for a point ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Criteria {
    /// Levels of the pyramid above the full one that are gone through, at most.
    pub levels: i32,
    /// Iterations on each, at most, and the step, pixels of that level, after which there are no more.
    pub iterations: i32,
    pub precision: f64,
}

/// How points are followed and when they count as lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flow {
    /// Side of the window in patch pixels, odd.
    pub window: i32,
    /// Side of the larger window that lost points are tried with again.
    pub grown_window: i32,
    /// Mean absolute difference of the two windows, grey levels, above which a point is lost.
    pub max_residual: f32,
    pub criteria: Criteria,
    /// Patch pixels that a point may be off after being followed forth and back; `None`: not tested.
    pub max_return_error: Option<f32>,
}

/// Points that are followed into the next picture; kept as memory for the one after.
#[derive(Debug, Default)]
pub(super) struct Followed {
    /// Where they were, frame pixels, ...
    pub starts: Vec<Point2f>,
    /// ... where they may be, ...
    pub guesses: Vec<Point2f>,
    /// ... and where they are: `None` for one that is lost.
    pub found: Vec<Option<Point2f>>,
    ends: Vec<Option<End>>,
    returns: Vec<Point2f>,
}

impl Followed {
    /// Other points, none of which has been followed yet, each with where it may be.
    pub fn begin(&mut self, points: impl Iterator<Item = (Point2f, Point2f)>) {
        self.starts.clear();
        self.guesses.clear();
        for (start, guess) in points {
            self.starts.push(start);
            self.guesses.push(guess);
        }
    }
}

impl Flow {
    /// Follows `points` of `previous` into `next`. Both patches must be of one size.
    pub fn follow(&self, previous: &Patch, next: &Patch, points: &mut Followed) -> opencv::Result<()> {
        self.attempt(previous, next, points, self.window)?;
        let lost = points.found.iter().filter(|place| place.is_none()).count();
        // Thesis 3.5.2: "if the feature is not found in the small window, the algorithm increases the
        // window size". Worth it only where the motion was too large, and then most points are lost.
        if self.grown_window > self.window && 2 * lost > points.starts.len() {
            let mut again = Followed::default();
            let pairs = points.starts.iter().copied().zip(points.guesses.iter().copied());
            again.begin(pairs.zip(&points.found).filter(|(_, place)| place.is_none()).map(|(pair, _)| pair));
            self.attempt(previous, next, &mut again, self.grown_window)?;
            let lost = points.found.iter_mut().filter(|place| place.is_none());
            lost.zip(again.found).for_each(|(place, found)| *place = found);
        }
        Ok(())
    }

    fn attempt(
        &self,
        previous: &Patch,
        next: &Patch,
        points: &mut Followed,
        window: i32,
    ) -> opencv::Result<()> {
        let Followed { starts, guesses, found, ends, returns } = points;
        lucas_kanade((previous, next), (starts, guesses), window, self.criteria, ends)?;
        found.clear();
        found.extend(
            ends.iter().map(|end| {
                end.as_ref().filter(|end| end.residual <= self.max_residual).map(|end| end.position)
            }),
        );
        let Some(max_error) = self.max_return_error else { return Ok(()) };
        let limit = max_error * previous.step() as f32;
        // Whether it stays where it came from is asked of the finest level, which is what decides.
        returns.clear();
        returns.extend(found.iter().zip(&*guesses).map(|(end, guess)| end.unwrap_or(*guess)));
        let criteria = Criteria { levels: 0, ..self.criteria };
        lucas_kanade((next, previous), (returns, starts), window, criteria, ends)?;
        for ((place, returned), start) in found.iter_mut().zip(&*ends).zip(&*starts) {
            if returned.as_ref().is_none_or(|returned| length(returned.position - *start) > limit) {
                *place = None;
            }
        }
        Ok(())
    }
}

#[derive(Debug)]
struct End {
    position: Point2f,
    residual: f32,
}

/// Leaves in `out` where points of one patch are in another, looked for from a guess of each with windows of that side; `None` for one that
/// is not there.
fn lucas_kanade(
    (from, to): (&Patch, &Patch),
    (points, guesses): (&[Point2f], &[Point2f]),
    window: i32,
    criteria: Criteria,
    out: &mut Vec<Option<End>>,
) -> opencv::Result<()> {
    out.clear();
    if points.is_empty() || from.is_empty() || !from.fits(to) {
        out.extend(points.iter().map(|_| None));
        return Ok(());
    }
    let starts: Vector<Point2f> = points.iter().map(|point| from.enter(*point)).collect();
    let mut ends: Vector<Point2f> = guesses.iter().map(|guess| to.enter(*guess)).collect();
    let (mut status, mut residuals) = (Vector::<u8>::new(), Vector::<f32>::new());
    video::calc_optical_flow_pyr_lk(
        from.pyramid(),
        to.pyramid(),
        &starts,
        &mut ends,
        &mut status,
        &mut residuals,
        Size::new(window, window),
        criteria.levels.min(from.levels()).min(to.levels()),
        TermCriteria {
            typ: TermCriteria_COUNT | TermCriteria_EPS,
            max_count: criteria.iterations,
            epsilon: criteria.precision,
        },
        video::OPTFLOW_USE_INITIAL_FLOW,
        MIN_EIGENVALUE,
    )?;
    let found = ends.iter().zip(status.iter().zip(residuals.iter()));
    out.extend(found.map(|(end, (status, residual))| {
        let position = to.leave(end);
        (status != 0 && position.x.is_finite() && position.y.is_finite())
            .then_some(End { position, residual })
    }));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::Scene;
    use super::*;
    use crate::vision::tracker::patch::Cut;
    use opencv::core::Rect2f;
    use proptest::prelude::*;

    const CRITERIA: Criteria = Criteria { levels: 2, iterations: 10, precision: 0.1 };
    const FLOW: Flow = Flow {
        window: 15,
        grown_window: 31,
        criteria: CRITERIA,
        max_residual: 20.0,
        max_return_error: Some(0.5),
    };

    fn lattice() -> Vec<Point2f> {
        (0..16).map(|n| Point2f::new(100.0 + 12.0 * (n % 4) as f32, 90.0 + 12.0 * (n / 4) as f32)).collect()
    }

    fn flow_of(shift: (f32, f32), guess: Point2f) -> Vec<Option<Point2f>> {
        let scene = Scene::new(320, 240);
        let still = scene.background((0.0, 0.0));
        let moved = scene.background(shift);
        let area = Rect2f::new(40.0, 40.0, 180.0, 160.0);
        let previous = Patch::cut(&still.luma(), Cut::new(&still.luma(), area, 1), 31).expect("cut");
        let cut = previous.as_cut().moved(&moved.luma(), guess);
        let next = Patch::cut(&moved.luma(), cut, 31).expect("cut");
        follow(&previous, &next, guess)
    }

    /// Where the lattice is found, expected so far from where it was.
    fn follow(previous: &Patch, next: &Patch, guess: Point2f) -> Vec<Option<Point2f>> {
        let mut points = Followed::default();
        points.begin(lattice().into_iter().map(|point| (point, point + guess)));
        FLOW.follow(previous, next, &mut points).expect("flow");
        points.found
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn sub_pixel_motion_is_measured(dx in -9.0_f32..9.0, dy in -9.0_f32..9.0) {
            let found = flow_of((dx, dy), Point2f::default());
            let errors: Vec<f32> = found.iter().zip(lattice()).filter_map(|(end, start)| {
                end.map(|end| length(end - start - Point2f::new(dx, dy)))
            }).collect();
            prop_assert!(errors.len() >= 12, "{} of 16 points", errors.len());
            for error in errors {
                prop_assert!(error < 0.2, "{error} pixels off");
            }
        }
    }

    #[test]
    fn a_guess_carries_over_a_large_motion() {
        let shift = Point2f::new(63.3, -20.6);
        let found = flow_of((shift.x, shift.y), Point2f::new(60.0, -18.0));
        let good = found
            .iter()
            .zip(lattice())
            .filter(|(end, start)| end.is_some_and(|end| length(end - *start - shift) < 0.2));
        assert!(good.count() >= 12);
    }

    #[test]
    fn points_that_vanish_are_lost() {
        let scene = Scene::new(320, 240);
        let (there, gone) = (scene.background((0.0, 0.0)), scene.flat(90));
        let cut = Cut::new(&there.luma(), Rect2f::new(40.0, 40.0, 180.0, 160.0), 1);
        let previous = Patch::cut(&there.luma(), cut, 31).expect("cut");
        let next = Patch::cut(&gone.luma(), cut, 31).expect("cut");
        let found = follow(&previous, &next, Point2f::default());
        assert!(found.iter().all(Option::is_none));
    }
}
