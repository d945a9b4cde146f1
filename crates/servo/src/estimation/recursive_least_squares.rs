// SPDX-License-Identifier: MPL-2.0

/// Recursive least squares with forgetting (Åström and Wittenmark, *Adaptive Control*, 2nd ed., section 2.2): the weights
/// of `N` regressors with their covariance, which is that of the prior at first. Forgetting adds a part of the prior's
/// variance to the diagonal, up to the prior's itself (Kulhavý's stabilised forgetting): a regressor that is not excited
/// becomes as uncertain as it was, and no more. A measurement beyond three standard deviations counts as one
/// of three (Huber).
#[derive(Debug, Clone)]
pub(super) struct RecursiveLeastSquares<const N: usize> {
    weights: [f64; N],
    covariance: [[f64; N]; N],
    prior: [f64; N],
}

impl<const N: usize> RecursiveLeastSquares<N> {
    /// A measurement further off than this many standard deviations counts as one that far off.
    const OUTLIER: f64 = 3.0;

    /// All weights zero, give or take `deviations`.
    pub fn new(deviations: [f64; N]) -> Self {
        let prior = deviations.map(|deviation| deviation * deviation);
        let mut covariance = [[0.0; N]; N];
        for (i, row) in covariance.iter_mut().enumerate() {
            row[i] = prior[i];
        }
        Self { weights: [0.0; N], covariance, prior }
    }

    /// What the weights make of these features.
    pub fn predict(&self, features: &[f64; N]) -> f64 {
        dot(&self.weights, features)
    }

    /// How far that may be off: its standard deviation.
    pub fn deviation(&self, features: &[f64; N]) -> f64 {
        dot(&self.covariance.map(|row| dot(&row, features)), features).max(0.0).sqrt()
    }

    /// Takes a measurement with a variance.
    pub fn update(&mut self, features: &[f64; N], measured: f64, variance: f64) {
        let spread = self.covariance.map(|row| dot(&row, features));
        let total = dot(&spread, features) + variance;
        let limit = Self::OUTLIER * total.sqrt();
        let surprise = (measured - self.predict(features)).clamp(-limit, limit);
        for i in 0..N {
            self.weights[i] += spread[i] / total * surprise;
            for j in 0..N {
                self.covariance[i][j] -= spread[i] * spread[j] / total;
            }
        }
    }

    /// Grows a little less sure, by this part of the prior's variance, and never less sure than that was.
    pub fn forget(&mut self, part: f64) {
        for i in 0..N {
            self.covariance[i][i] = (self.covariance[i][i] + part * self.prior[i]).min(self.prior[i]);
        }
    }

    /// Shifts one weight, as what it is measured in has changed: by as much of `change` as was learned of it.
    pub fn shift(&mut self, index: usize, change: f64) {
        let unlearned = self.covariance[index][index] / self.prior[index];
        self.weights[index] += change * (1.0 - unlearned);
    }
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_line_is_found_and_an_outlier_hardly_moves_it() {
        let mut line = RecursiveLeastSquares::new([10.0, 10.0]);
        for i in 0..50 {
            let x = f64::from(i % 10);
            line.update(&[1.0, x], 3.0 - 0.5 * x, 0.01);
        }
        let before = line.predict(&[1.0, 4.0]);
        assert!((before - 1.0).abs() < 0.01, "{before}");
        line.update(&[1.0, 4.0], 1e6, 0.01);
        assert!((line.predict(&[1.0, 4.0]) - before).abs() < 0.02);
    }

    #[test]
    fn what_was_forgotten_is_learned_anew() {
        let mut level = RecursiveLeastSquares::new([1.0]);
        for value in [0.5, -0.5] {
            for _ in 0..200 {
                level.forget(1e-3);
                level.update(&[1.0], value, 0.01);
            }
            assert!((level.predict(&[1.0]) - value).abs() < 0.02);
        }
    }

    #[test]
    fn only_what_was_learned_is_shifted() {
        let mut level = RecursiveLeastSquares::new([1.0]);
        level.shift(0, 0.4);
        assert_eq!(level.predict(&[1.0]), 0.0);
        for _ in 0..100 {
            level.update(&[1.0], 0.2, 0.01);
        }
        level.shift(0, 0.4);
        assert!((level.predict(&[1.0]) - 0.6).abs() < 0.01);
    }

    proptest! {
        #[test]
        fn weights_stay_finite(
            rows in prop::collection::vec((prop::array::uniform3(-5.0..5.0f64), -100.0..100.0f64, 1e-3..10.0f64), 0..200),
        ) {
            let mut regression = RecursiveLeastSquares::new([1.0, 2.0, 0.1]);
            for (features, measured, variance) in rows {
                regression.forget(1e-4);
                regression.update(&features, measured, variance);
                prop_assert!(regression.predict(&features).is_finite());
                prop_assert!((0..3).all(|i| regression.covariance[i][i] >= -1e-6));
            }
        }
    }
}
