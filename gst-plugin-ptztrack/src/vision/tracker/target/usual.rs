// SPDX-License-Identifier: MPL-2.0

//! What is usually seen of a target: only beside that does what is seen now say whether it is there.

use crate::vision::tracker::figure::Halves;

/// Weight of the filter beside the fit of the silhouette, which counts the more the more it usually says.
const FILTER_WEIGHT: f32 = 0.25;
/// What the filter answers to anything, as a share of its answer to the target.
const FILTER_NOISE: f32 = 0.35;
/// What is taken for usual of the filter before it was asked, and of the silhouette at least.
const FIRST_RESPONSE: Halves = Halves { upper: 0.25, lower: 0.25 };
const LEAST_FIT: f32 = 0.02;
const LEAST_RESPONSE: f32 = 0.05;
const LEAST_LEVEL: f32 = 0.05;
/// What the better half of the body is worth without the other.
const HALF: f32 = 0.9;

/// What is usually seen of the target while it is there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Usual {
    fit: Halves,
    /// How much of the silhouette is figure, by motion and colour alone.
    level: Halves,
    response: Halves,
}

impl Usual {
    /// Before anything was learned, of a target seen like this. Who was already there when the picture was first seen does
    /// not stand out from the background.
    pub fn at_first(fit: Halves, level: Halves) -> Self {
        Self { fit: fit.with(fit, |fit, _| fit.max(LEAST_FIT)), level, response: FIRST_RESPONSE }
    }

    /// How much of the silhouette is usually figure, by motion and colour alone.
    pub fn level(self) -> Halves {
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

    /// Who stood out from the background stands out still, or is not there: whatever the looks say, known wall is wall.
    pub fn stands_out(self, level: Halves) -> Halves {
        level.with(self.level, |seen, usual| (seen / usual).clamp(0.0, 1.0))
    }

    /// Share of all that is usually seen of either half.
    pub fn shares(self, fit: Halves, level: Halves, response: Halves) -> Halves {
        let looks = response.with(self.response, |seen, usual| {
            ((seen / usual - FILTER_NOISE) / (1.0 - FILTER_NOISE)).clamp(0.02, 1.2)
        });
        // Both must speak for it: somebody else moves as well, and the wall may look like anybody.
        let usual = self.fit.mean().max(0.0);
        let weight = usual / (usual + FILTER_WEIGHT);
        let both = self.silhouette(fit).with(looks, |fit, looks| fit.powf(weight) * looks.powf(1.0 - weight));
        both.with(self.stands_out(level), |both, stands_out| both * stands_out)
    }

    /// Takes over what is seen now, at this rate from 0 to 1.
    pub fn learn(&mut self, fit: Halves, level: Halves, response: Halves, rate: f32) {
        let mix = |least: f32| move |old: f32, new: f32| (old + (new - old) * rate).max(least);
        self.fit = self.fit.with(fit, mix(LEAST_FIT));
        self.level = self.level.with(level, mix(LEAST_LEVEL));
        self.response = self.response.with(response, mix(LEAST_RESPONSE));
    }
}

/// Of a whole body: one half is enough, as a table may hide the other, but then it must be seen well.
pub(super) fn of_whole(shares: Halves) -> f32 {
    let better = shares.upper.max(shares.lower);
    (HALF * better * better).max(shares.mean())
}
