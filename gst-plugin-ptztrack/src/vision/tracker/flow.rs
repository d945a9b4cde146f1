// SPDX-License-Identifier: MPL-2.0

//! Points of a target followed from one patch to the next (thesis 3.5.2), and which of them count as lost.

use opencv::core::Point2f;

use super::geometry::length;
use super::patch::{GROWN_WINDOW, Patch};
use crate::vision::lucas_kanade::{Precision, Template};

/// How points are followed and when they count as lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flow {
    /// Side of the window in patch pixels, odd.
    pub window: usize,
    /// Halvings of the patches that are looked at first.
    pub halvings: usize,
    /// Mean absolute difference of the two windows, grey levels, above which a point is lost.
    pub max_residual: f32,
    pub precision: Precision,
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
    template: Template,
}

impl Followed {
    /// Other points, none of which has been followed yet, each with where it may be.
    pub fn begin(&mut self, points: impl Iterator<Item = (Point2f, Point2f)>) {
        self.starts.clear();
        self.guesses.clear();
        self.found.clear();
        for (start, guess) in points {
            self.starts.push(start);
            self.guesses.push(guess);
            self.found.push(None);
        }
    }
}

impl Flow {
    /// Follows `points` of `previous` into `next`. Where these are not of one size, all are lost.
    pub fn follow(&self, previous: &Patch, next: &Patch, points: &mut Followed) {
        if !previous.fits(next) {
            return;
        }
        self.attempt(previous, next, points, self.window);
        let lost = points.found.iter().filter(|place| place.is_none()).count();
        // Thesis 3.5.2: "if the feature is not found in the small window, the algorithm increases the
        // window size". Worth it only where the motion was too large, and then most points are lost.
        if self.window < GROWN_WINDOW && 2 * lost > points.starts.len() {
            self.attempt(previous, next, points, GROWN_WINDOW);
        }
    }

    /// Looks for those that have not been found.
    fn attempt(&self, previous: &Patch, next: &Patch, points: &mut Followed, window: usize) {
        let Followed { starts, guesses, found, template } = points;
        let pairs = starts.iter().zip(guesses);
        for (place, (start, guess)) in found.iter_mut().zip(pairs).filter(|(place, _)| place.is_none()) {
            let begin = previous.enter(*start);
            template.take(previous.pyramid(), begin, window, self.halvings);
            let end = template.follow(next.pyramid(), next.enter(*guess), self.precision);
            let end = end.filter(|end| end.residual <= self.max_residual).map(|end| end.place);
            let is_back = |end: &Point2f| match self.max_return_error {
                Some(most) => self.error(previous, next, (begin, *end), window, template) <= most,
                None => true,
            };
            *place = end.filter(is_back).map(|end| next.leave(end));
        }
    }

    /// How far from where it began a point gets that is followed back, by the finest level, which is what decides; infinitely far where it
    /// is lost.
    fn error(
        &self,
        previous: &Patch,
        next: &Patch,
        (begin, end): (Point2f, Point2f),
        window: usize,
        template: &mut Template,
    ) -> f32 {
        template.take(next.pyramid(), end, window, 0);
        let back = template.follow(previous.pyramid(), begin, self.precision);
        back.map_or(f32::INFINITY, |back| length(back.place - begin))
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::Scene;
    use super::*;
    use crate::vision::tracker::patch::Cut;
    use opencv::core::Rect2f;
    use proptest::prelude::*;

    const HALVINGS: usize = 2;
    const FLOW: Flow = Flow {
        window: 15,
        halvings: HALVINGS,
        precision: Precision { steps: 10, step: 0.1 },
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
        let previous = Patch::cut(&still.luma(), Cut::new(&still.luma(), area, 1), HALVINGS);
        let cut = previous.as_cut().moved(&moved.luma(), guess);
        follow(previous, Patch::cut(&moved.luma(), cut, HALVINGS), guess)
    }

    /// Where the lattice is found, expected so far from where it was.
    fn follow(previous: Patch, next: Patch, guess: Point2f) -> Vec<Option<Point2f>> {
        let mut points = Followed::default();
        points.begin(lattice().into_iter().map(|point| (point, point + guess)));
        FLOW.follow(&previous, &next, &mut points);
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
        let previous = Patch::cut(&there.luma(), cut, HALVINGS);
        let next = Patch::cut(&gone.luma(), cut, HALVINGS);
        let found = follow(previous, next, Point2f::default());
        assert!(found.iter().all(Option::is_none));
    }
}
