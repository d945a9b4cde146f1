// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::time::Duration;

use crate::Time;
use crate::model::PanTilt;

/// Mean of a rate over a window of time (thesis 3.16: one second), whatever the frame rate.
///
/// A Kalman filter of the rate and its change was measured in its place: as near to the target in the room (0.054 for the
/// oracle), but a filter quick enough for somebody who turns back follows the gait's sway too, half as far again, and with
/// noisy velocities it is twice as far off. It takes no less code.
#[derive(Debug)]
pub struct RateAverage {
    window: Duration,
    samples: VecDeque<(Time, PanTilt)>,
    /// How the rate was changing at each sample of the last moments.
    trends: VecDeque<(Time, PanTilt)>,
}

impl RateAverage {
    /// The gait's sway turns to the other side within this time: half a wave of 1 Hz, the slowest, and a little.
    const SWAY: Duration = Duration::from_millis(600);

    /// An empty average.
    pub fn new(window: Duration) -> Self {
        Self { window, samples: VecDeque::new(), trends: VecDeque::new() }
    }

    /// Takes the rate at a time; times that go back begin anew.
    pub fn push(&mut self, at: Time, rate: PanTilt) {
        if self.samples.back().is_some_and(|(last, _)| *last > at) {
            self.clear();
        }
        self.samples.push_back((at, rate));
        while self.samples.front().is_some_and(|(first, _)| at - *first > self.window) {
            self.samples.pop_front();
        }
        let trend = self.axes(|axis| axis.slope());
        self.trends.push_back((at, trend));
        while self.trends.front().is_some_and(|(first, _)| at - *first > Self::SWAY) {
            self.trends.pop_front();
        }
    }

    /// Takes a rate at which it is only thought to go on, and whose changes so far are no sign of more.
    pub fn coast(&mut self, at: Time, rate: PanTilt) {
        // Of whom it is not known when they were where, the rate is as it was before.
        let newest = self.samples.back().map_or(at, |(newest, _)| *newest);
        self.push(at.max(newest), rate);
        self.trends.clear();
    }

    /// The mean; zero where nothing is known.
    pub fn mean(&self) -> PanTilt {
        let sum = self.samples.iter().fold(PanTilt::default(), |sum, (_, rate)| sum + *rate);
        sum / self.samples.len().max(1) as f64
    }

    /// The rate to expect so long after the newest sample, by the straight line through the samples as far as
    /// it stands out of the noise and of the gait's sway. Never much beyond what was seen: nobody turns for ever.
    pub fn ahead(&self, lead: Duration) -> PanTilt {
        let (lead_s, trend) = (lead.as_secs_f64(), self.trend());
        PanTilt::new(
            self.axis(|rate| rate.pan).map_or(0.0, |pan| pan.ahead(trend.pan, lead_s)),
            self.axis(|rate| rate.tilt).map_or(0.0, |tilt| tilt.ahead(trend.tilt, lead_s)),
        )
    }

    /// The mean as far as the motion as a whole stands out of the noise of both axes.
    pub fn certain_mean(&self) -> PanTilt {
        let (mean, variance) = (self.mean(), self.axes(|axis| axis.variance_of_mean()));
        mean * certain_part(mean.dot(mean), variance.pan + variance.tilt)
    }

    /// How the rate changes, per second: what of that goes beyond the changes to the other side just before. Who
    /// starts or turns keeps on; what sways comes back.
    fn trend(&self) -> PanTilt {
        let lasting = |part: fn(&PanTilt) -> f64| {
            let trends = || self.trends.iter().map(|(_, trend)| part(trend));
            let newest = trends().next_back().unwrap_or_default();
            let back = trends().fold(0.0, |back: f64, trend| back.max(-trend * newest.signum()));
            (newest.abs() - back).max(0.0).copysign(newest)
        };
        PanTilt::new(lasting(|trend| trend.pan), lasting(|trend| trend.tilt))
    }

    fn axes(&self, value: impl Fn(&Samples) -> f64) -> PanTilt {
        let value = |axis: Option<Samples>| axis.map_or(0.0, |axis| value(&axis));
        PanTilt::new(value(self.axis(|rate| rate.pan)), value(self.axis(|rate| rate.tilt)))
    }

    /// The samples of one axis; `None` without any.
    fn axis(&self, part: fn(&PanTilt) -> f64) -> Option<Samples> {
        let (newest, _) = self.samples.back()?;
        let at = |time: &Time| -(*newest - *time).as_secs_f64();
        Some(Samples::new(self.samples.iter().map(|(time, rate)| (at(time), part(rate)))))
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.samples.clear();
        self.trends.clear();
    }
}

/// Values over time, in order; times in seconds, 0 is the newest.
pub struct Samples(Vec<(f64, f64)>);

impl Samples {
    /// Standard errors by which a value must stand out.
    const CONFIDENCE: f64 = 2.0;

    /// How far beyond the rates seen a rate may be expected, as a part of their range: with more, the sway of a
    /// walk is exaggerated; with less, who starts or turns is followed late.
    const STRETCH: f64 = 0.3;

    /// Samples further apart than this differ by more than their noise.
    const PAUSE_S: f64 = 0.25;

    /// At least one.
    pub fn new(samples: impl Iterator<Item = (f64, f64)>) -> Self {
        Self(samples.collect())
    }

    /// Mean of the values.
    pub fn mean(&self) -> f64 {
        self.mean_of(|(_, value)| *value)
    }

    fn mean_of(&self, value: impl Fn(&(f64, f64)) -> f64) -> f64 {
        self.0.iter().map(value).sum::<f64>() / self.0.len() as f64
    }

    /// Variance of a sample, from the differences of neighbours (von Neumann), which a change of the rate itself
    /// hardly swells unless there is a pause in between. Of two or fewer nothing can be said.
    fn variance(&self) -> f64 {
        let neighbours = self.0.windows(2).filter(|pair| pair[1].0 - pair[0].0 <= Self::PAUSE_S);
        let squares: Vec<f64> = neighbours.map(|pair| (pair[1].1 - pair[0].1).powi(2)).collect();
        if squares.len() < 2 {
            return f64::INFINITY;
        }
        squares.iter().sum::<f64>() / (2.0 * squares.len() as f64)
    }

    /// The mean as far as it stands out of the noise: nearly all of a rate well above it, nothing of one below.
    ///
    /// Somebody who stands before a tracker that trembles would else be led to and fro for ever.
    fn certain_mean(&self) -> f64 {
        certain(self.mean(), self.variance_of_mean())
    }

    fn variance_of_mean(&self) -> f64 {
        self.variance() / self.0.len() as f64
    }

    /// The rate to expect `lead_s` after the newest, if it changes by `slope` per second.
    fn ahead(&self, slope: f64, lead_s: f64) -> f64 {
        if slope == 0.0 {
            return self.certain_mean();
        }
        let rates = || self.0.iter().map(|(_, rate)| *rate);
        let (low, high) = (rates().fold(f64::INFINITY, f64::min), rates().fold(f64::NEG_INFINITY, f64::max));
        let beyond = Self::STRETCH * (high - low);
        self.line(slope, lead_s).clamp(low - beyond, high + beyond)
    }

    /// Slope per second of the straight line through them, as far as it stands out of the noise.
    pub fn slope(&self) -> f64 {
        let (middle, mean) = (self.mean_of(|(time, _)| *time), self.mean());
        let spread: f64 = self.0.iter().map(|(time, _)| (time - middle).powi(2)).sum();
        let together: f64 = self.0.iter().map(|(time, rate)| (time - middle) * (rate - mean)).sum();
        certain(together / spread, self.variance() / spread)
    }

    /// A line of that slope through their middle, `lead_s` after the newest.
    pub fn line(&self, slope: f64, lead_s: f64) -> f64 {
        self.mean() + slope * (lead_s - self.mean_of(|(time, _)| *time))
    }
}

/// What of a value stands out of noise of this variance.
fn certain(value: f64, variance: f64) -> f64 {
    let part = certain_part(value * value, variance);
    // A value that is no number gives 0.
    if part > 0.0 { value * part } else { 0.0 }
}

/// The fraction, 0 to 1, of a value of this square that stands out of the noise; 0 if that is undefined.
fn certain_part(square: f64, variance: f64) -> f64 {
    let noise = Samples::CONFIDENCE.powi(2) * variance / square;
    if noise < 1.0 { 1.0 - noise } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    fn average(rates: impl IntoIterator<Item = f64>) -> RateAverage {
        let mut average = RateAverage::new(ms(300));
        for (at, rate) in (0..).step_by(40).zip(rates) {
            average.push(ms(at), PanTilt::new(rate, 0.0));
        }
        average
    }

    /// Of pan.
    fn certain_mean(average: &RateAverage) -> f64 {
        average.axes(|axis| axis.certain_mean()).pan
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
        assert_eq!(certain_mean(&average([5.0; 10])), 5.0);
        assert_eq!(certain_mean(&average([3.0, -4.0, 5.0, -3.0, 4.0, -3.0, 4.0])), 0.0);
        assert_eq!(certain_mean(&average([5.0, 5.0])), 0.0);
        // A rate that has just changed is no tremble.
        let changed = average([0.0, 0.0, 0.0, 0.0, 12.0, 12.0, 12.0, 12.0]);
        assert!(certain_mean(&changed) > 0.75 * changed.mean().pan, "{}", certain_mean(&changed));
    }

    #[test]
    fn a_rate_that_grows_is_followed_ahead_but_not_far_beyond_what_was_seen() {
        let growing = average((0..8).map(|sample| f64::from(sample) * 0.4));
        assert!((growing.ahead(ms(0)).pan - 2.8).abs() < 0.2, "{:?}", growing.ahead(ms(0)));
        assert!((growing.ahead(ms(200)).pan - 3.64).abs() < 0.01, "{:?}", growing.ahead(ms(200)));
        assert!((growing.ahead(ms(9000)).pan - 3.64).abs() < 1e-9);
        assert_eq!(average([5.0; 8]).ahead(ms(300)).pan, 5.0);
        assert_eq!(average([3.0, -4.0, 5.0, -3.0, 4.0, -3.0, 4.0]).ahead(ms(300)).pan, 0.0);
    }

    #[test]
    fn what_sways_has_no_trend() {
        for steps_hz in [1.0, 1.5, 2.0] {
            let mut average = RateAverage::new(ms(400));
            for frame in 0..75 {
                let sway = (f64::from(frame) / 25.0 * std::f64::consts::TAU * steps_hz).sin();
                average.push(ms(40 * u64::from(frame as u32)), PanTilt::new(12.0 + 2.0 * sway, 0.0));
                let ahead = average.ahead(ms(300)).pan;
                assert!(frame < 50 || (ahead - 12.0).abs() < 2.0, "{steps_hz} Hz: {ahead}");
            }
        }
    }

    proptest! {
        #[test]
        fn what_is_certain_is_part_of_the_mean(rates in prop::collection::vec(-50.0..50.0f64, 0..12)) {
            let average = average(rates);
            let (mean, certain) = (average.mean().pan, certain_mean(&average));
            prop_assert!(certain * mean >= 0.0 && certain.abs() <= mean.abs(), "{certain} of {mean}");
        }
    }
}
