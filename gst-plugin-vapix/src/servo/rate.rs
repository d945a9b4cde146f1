use std::collections::VecDeque;
use std::time::Duration;

use super::PanTilt;

/// Mean of a rate over a window of time (thesis 3.16: one second), whatever the frame rate.
#[derive(Debug)]
pub struct RateAverage {
    window: Duration,
    samples: VecDeque<(Duration, PanTilt)>,
}

impl RateAverage {
    /// Standard errors of the mean by which a rate must stand out.
    const CONFIDENCE: f64 = 2.0;

    /// An empty average.
    pub fn new(window: Duration) -> Self {
        Self { window, samples: VecDeque::new() }
    }

    /// Takes the rate at a time; times that go back begin anew.
    pub fn push(&mut self, at: Duration, rate: PanTilt) {
        if self.samples.back().is_some_and(|(last, _)| *last > at) {
            self.samples.clear();
        }
        self.samples.push_back((at, rate));
        while self.samples.front().is_some_and(|(first, _)| at - *first > self.window) {
            self.samples.pop_front();
        }
    }

    /// The mean; zero where nothing is known.
    pub fn mean(&self) -> PanTilt {
        let sum = self.samples.iter().fold(PanTilt::default(), |sum, (_, rate)| sum + *rate);
        sum / self.samples.len().max(1) as f64
    }

    /// The part of the mean that stands out of the noise: nearly all of a rate well above it, nothing of one below.
    ///
    /// Somebody who stands before a tracker that trembles would else be led to and fro for ever.
    pub fn certain_mean(&self) -> PanTilt {
        let (mean, variance) = (self.mean(), self.variance_of_mean());
        let part = |mean: f64, variance: f64| {
            let noise = Self::CONFIDENCE.powi(2) * variance / (mean * mean);
            // What is no number, as at 0 of 0, stays out.
            if noise < 1.0 { mean * (1.0 - noise) } else { 0.0 }
        };
        PanTilt::new(part(mean.pan, variance.pan), part(mean.tilt, variance.tilt))
    }

    /// Estimated from the differences of neighbours (von Neumann), which a change of the rate itself hardly swells.
    fn variance_of_mean(&self) -> PanTilt {
        let count = self.samples.len() as f64;
        let mut squares = PanTilt::default();
        for (before, after) in self.samples.iter().zip(self.samples.iter().skip(1)) {
            let step = after.1 - before.1;
            squares = squares + PanTilt::new(step.pan * step.pan, step.tilt * step.tilt);
        }
        // Of two or fewer samples nothing can be said.
        if count < 3.0 {
            PanTilt::new(f64::INFINITY, f64::INFINITY)
        } else {
            squares / (2.0 * (count - 1.0) * count)
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.samples.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn average(rates: impl IntoIterator<Item = f64>) -> RateAverage {
        let mut average = RateAverage::new(ms(300));
        for (at, rate) in (0..).step_by(40).zip(rates) {
            average.push(ms(at), PanTilt::new(rate, 0.0));
        }
        average
    }

    #[test]
    fn the_average_covers_its_window_only() {
        let mut average = RateAverage::new(ms(1000));
        assert_eq!(average.mean(), PanTilt::default());
        for i in 0..=60 {
            let rate = if i < 30 { 100.0 } else { f64::from(i % 2) * 2.0 };
            average.push(ms(1000 * u64::from(i as u32) / 30), PanTilt::new(rate, -1.0));
        }
        assert!((average.mean().pan - 1.0).abs() < 0.05, "{:?}", average.mean());
        assert!((average.mean().tilt + 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_clock_that_goes_back_begins_anew() {
        let mut average = RateAverage::new(ms(1000));
        average.push(ms(5000), PanTilt::new(10.0, 0.0));
        average.push(ms(10), PanTilt::new(2.0, 0.0));
        assert_eq!(average.mean().pan, 2.0);
    }

    #[test]
    fn a_steady_rate_is_certain_and_a_tremble_is_not() {
        assert_eq!(average([5.0; 10]).certain_mean().pan, 5.0);
        assert_eq!(average([3.0, -4.0, 5.0, -3.0, 4.0, -3.0, 4.0]).certain_mean().pan, 0.0);
        assert_eq!(average([5.0, 5.0]).certain_mean().pan, 0.0);
        // A rate that has just changed is no tremble.
        let changed = average([0.0, 0.0, 0.0, 0.0, 12.0, 12.0, 12.0, 12.0]);
        assert!(changed.certain_mean().pan > 0.75 * changed.mean().pan, "{:?}", changed.certain_mean());
    }

    proptest! {
        #[test]
        fn what_is_certain_is_part_of_the_mean(rates in prop::collection::vec(-50.0..50.0f64, 0..12)) {
            let average = average(rates);
            let (mean, certain) = (average.mean().pan, average.certain_mean().pan);
            prop_assert!(certain * mean >= 0.0 && certain.abs() <= mean.abs(), "{certain} of {mean}");
        }
    }
}
