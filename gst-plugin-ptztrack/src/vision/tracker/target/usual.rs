// SPDX-License-Identifier: MPL-2.0

//! What is usually seen of a target: only beside that does what is seen now say whether it is there.

use crate::vision::tracker::figure::{Halves, Level};

/// Weight of the filter beside the fit of the silhouette, which counts the more the more it usually says.
const FILTER_WEIGHT: f32 = 0.25;
/// What the filter answers to anything, as a share of its answer to the target.
const FILTER_NOISE: f32 = 0.35;
/// What is taken for usual of the filter before it was asked, and of the silhouette at least.
const FIRST_RESPONSE: Halves = Halves { upper: 0.25, lower: 0.25 };
const LEAST_FIT: f32 = 0.02;
const LEAST_RESPONSE: f32 = 0.05;
const LEAST_LEVEL: f32 = 0.05;
/// Share of what usually moves against the background from which nobody misses the rest: a dark coat before a dark wall does not
/// stand out for a while.
const ENOUGH: f32 = 0.5;
/// How much slower than it is learned it is forgotten that the target stood out: a box that grows into the wall, or slides onto
/// it, shows less and less of it.
const FORGETTING: f32 = 0.1;
/// What the better half of the body is worth without the other.
const HALF: f32 = 0.9;

/// What is usually seen of the target while it is there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Usual {
    fit: Halves,
    level: Level,
    response: Halves,
}

impl Usual {
    /// Before anything was learned, of a target seen like this. Who was already there when the picture was first seen does
    /// not stand out from the background.
    pub fn at_first(fit: Halves, level: Level) -> Self {
        let at_least = |halves: Halves, least: f32| halves.with(halves, |seen, _| seen.max(least));
        let level = Level { figure: at_least(level.figure, LEAST_LEVEL), ..level };
        Self { fit: at_least(fit, LEAST_FIT), level, response: FIRST_RESPONSE }
    }

    /// How much of the silhouette usually stands out.
    pub fn level(self) -> Level {
        self.level
    }

    /// What the filter usually answers.
    pub fn response(self) -> f32 {
        self.response.sum()
    }

    /// Share of the usual silhouette that is seen of either half, from 0 to about 1.
    pub fn silhouette(self, fit: Halves) -> Halves {
        fit.with(self.fit, |seen, usual| (seen / usual).clamp(0.0, 1.2))
    }

    /// Who stood out from the background stands out still, or is not there: whatever the looks say, known wall is wall. While the
    /// target is followed nothing at its place becomes background, so that this holds for somebody who stands, too. The less
    /// likely the target is `alone`, 0 to 1, the more its colours count: others move as well.
    pub fn stands_out(self, level: Level, alone: f32) -> Halves {
        let figure = level.figure.with(self.level.figure, |seen, usual| (seen / usual).clamp(0.0, 1.0));
        let moving = level.moving.with(self.level.moving, |seen, usual| {
            ((seen + LEAST_LEVEL) / (ENOUGH * usual + LEAST_LEVEL)).min(1.0)
        });
        figure.with(moving, |figure, moving| figure + (moving - figure) * alone)
    }

    /// Share of all that is usually seen of either half.
    pub fn shares(self, fit: Halves, level: Level, response: Halves, alone: f32) -> Halves {
        let looks = response.with(self.response, |seen, usual| {
            ((seen / usual - FILTER_NOISE) / (1.0 - FILTER_NOISE)).clamp(0.02, 1.2)
        });
        // Both must speak for it: somebody else moves as well, and the wall may look like anybody.
        let usual = self.fit.mean().max(0.0);
        let weight = usual / (usual + FILTER_WEIGHT);
        let both = self.silhouette(fit).with(looks, |fit, looks| fit.powf(weight) * looks.powf(1.0 - weight));
        both.with(self.stands_out(level, alone), |both, stands_out| both * stands_out)
    }

    /// Takes over what is seen now, at this rate from 0 to 1.
    pub fn learn(&mut self, fit: Halves, level: Level, response: Halves, rate: f32) {
        let mix = |least: f32| move |old: f32, new: f32| (old + (new - old) * rate).max(least);
        self.fit = self.fit.with(fit, mix(LEAST_FIT));
        self.level.figure = self.level.figure.with(level.figure, mix(LEAST_LEVEL));
        self.level.moving = self.level.moving.with(level.moving, |old, new| {
            let rate = if new > old { rate } else { FORGETTING * rate };
            old + (new - old) * rate
        });
        self.response = self.response.with(response, mix(LEAST_RESPONSE));
    }
}

/// Of a whole body: one half is enough, as a table may hide the other, but then it must be seen well.
pub(super) fn of_whole(shares: Halves) -> f32 {
    let better = shares.upper.max(shares.lower);
    (HALF * better * better).max(shares.mean())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(share: f32) -> Halves {
        Halves { upper: share, lower: share }
    }

    fn level(figure: f32, moving: f32) -> Level {
        Level { figure: both(figure), moving: both(moving) }
    }

    fn share(seen: Level, alone: f32) -> f32 {
        let usual = Usual::at_first(both(0.6), level(0.8, 0.6));
        of_whole(usual.shares(both(0.6), seen, FIRST_RESPONSE, alone))
    }

    #[test]
    fn known_wall_is_wall_in_whatever_colours() {
        assert!(share(level(0.8, 0.6), 1.0) > 0.95);
        assert!(share(level(0.7, 0.01), 1.0) < 0.2, "{}", share(level(0.7, 0.01), 1.0));
    }

    #[test]
    fn a_box_that_slides_onto_the_wall_is_noticed() {
        let mut usual = Usual::at_first(both(0.6), level(0.8, 0.6));
        for n in 0..50 {
            usual.learn(both(0.6), level(0.8, 0.6 * (1.0 - n as f32 / 50.0)), FIRST_RESPONSE, 0.03);
        }
        let share = of_whole(usual.shares(both(0.6), level(0.8, 0.0), FIRST_RESPONSE, 1.0));
        assert!(share < 0.3, "{share}");
    }

    #[test]
    fn who_passes_something_in_their_colours_is_still_there() {
        assert!(share(level(0.4, 0.35), 1.0) > 0.95);
    }

    #[test]
    fn beside_others_colours_count() {
        assert!(share(level(0.2, 0.6), 0.0) < 0.3);
        assert!(share(level(0.2, 0.6), 1.0) > 0.95);
    }

    #[test]
    fn who_never_stood_out_is_followed_by_looks() {
        let usual = Usual::at_first(both(0.05), level(0.3, 0.0));
        let share = of_whole(usual.shares(both(0.05), level(0.3, 0.0), FIRST_RESPONSE, 1.0));
        assert!(share > 0.95, "{share}");
    }

    #[test]
    fn one_half_is_enough_where_it_is_seen_well() {
        let hidden = Halves { upper: 1.0, lower: 0.0 };
        assert!((of_whole(hidden) - HALF).abs() < 1e-6);
        assert!(of_whole(Halves { upper: 0.6, lower: 0.0 }) < 0.45);
    }
}
