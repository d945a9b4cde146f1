// SPDX-License-Identifier: MPL-2.0

//! How well a target usually fits what is known of its looks: only beside that does how it fits now say whether it is there.

use crate::vision::tracker::figure::Halves;

/// Weight of the filter beside the fit of the silhouette, which counts the more the more it usually says.
const FILTER_WEIGHT: f32 = 0.25;
/// What the filter answers to anything, as a share of its answer to the target.
const FILTER_NOISE: f32 = 0.35;
/// What is taken for usual of the filter before it was asked, and of both at least.
const FIRST_RESPONSE: Halves = Halves { upper: 0.25, lower: 0.25 };
const LEAST_FIT: f32 = 0.02;
const LEAST_RESPONSE: f32 = 0.05;
/// What the better half of the body is worth without the other.
const HALF: f32 = 0.9;

/// What silhouette and filter usually answer to the target, for either half of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Usual {
    fit: Halves,
    response: Halves,
}

impl Usual {
    /// Before anything was learned, of a target that fits like this.
    pub fn at_first(fit: Halves) -> Self {
        Self { fit: fit.with(fit, |seen, _| seen.max(LEAST_FIT)), response: FIRST_RESPONSE }
    }

    /// What the filter usually answers.
    pub fn response(self) -> f32 {
        self.response.sum()
    }

    /// Share of what is usual, from 0 to about 1. One half of the body is enough, as a table may hide the other, but then it must be
    /// seen well.
    pub fn share(self, fit: Halves, response: Halves) -> f32 {
        let looks = response.with(self.response, |seen, usual| {
            ((seen / usual - FILTER_NOISE) / (1.0 - FILTER_NOISE)).clamp(0.02, 1.2)
        });
        let silhouette = fit.with(self.fit, |seen, usual| (seen / usual).clamp(0.0, 1.2));
        // Both must speak for it: somebody else stands out as well, and the wall may look like anybody.
        let usual = self.fit.mean().max(0.0);
        let weight = usual / (usual + FILTER_WEIGHT);
        let shares = silhouette.with(looks, |fit, looks| fit.powf(weight) * looks.powf(1.0 - weight));
        let better = shares.upper.max(shares.lower);
        (HALF * better * better).max(shares.mean())
    }

    /// Takes over what is seen now, at this rate from 0 to 1.
    pub fn learn(&mut self, fit: Halves, response: Halves, rate: f32) {
        let mix = |least: f32| move |old: f32, new: f32| (old + (new - old) * rate).max(least);
        self.fit = self.fit.with(fit, mix(LEAST_FIT));
        self.response = self.response.with(response, mix(LEAST_RESPONSE));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(share: f32) -> Halves {
        Halves { upper: share, lower: share }
    }

    #[test]
    fn silhouette_and_filter_must_both_speak_for_it() {
        let mut usual = Usual::at_first(both(0.4));
        (0..50).for_each(|_| usual.learn(both(0.4), both(0.3), 0.1));
        assert!((usual.share(both(0.4), both(0.3)) - 1.0).abs() < 0.05);
        assert!(usual.share(both(0.4), both(0.1)) < 0.45, "somebody else");
        assert!(usual.share(both(0.0), both(0.3)) < 0.1, "the wall looks like them");
    }

    #[test]
    fn one_half_is_enough_where_it_is_seen_well() {
        let usual = Usual::at_first(both(0.4));
        let half = |share: f32| Halves { upper: share, lower: 0.0 };
        assert!(usual.share(half(0.4), half(0.25)) > 0.7);
        assert!(usual.share(half(0.2), half(0.15)) < 0.45);
    }
}
