// SPDX-License-Identifier: MPL-2.0

use std::fmt;

/// How something grew, by least squares. Neighbouring samples resemble each other, so what is fitted are the means of blocks of them.
#[derive(Debug, Clone, Copy)]
pub struct Trend {
    /// Of all.
    pub mean: f64,
    /// In a second.
    slope: f64,
    /// By how much more or less, with 95 % confidence.
    interval: f64,
    /// Seconds from the first to the last.
    lasts: f64,
}

const BLOCKS: usize = 12;
/// Student's t for 95 % on both sides and the degrees of freedom of a line through the blocks.
const STUDENT: f64 = 2.228;

impl Trend {
    /// Of times in seconds, in order, and what was then; `None` where there are fewer than blocks.
    pub fn of(points: &[(f64, f64)]) -> Option<Self> {
        let blocks: Vec<_> = (0..BLOCKS)
            .map(|block| &points[points.len() * block / BLOCKS..points.len() * (block + 1) / BLOCKS])
            .filter(|block| !block.is_empty())
            .map(mean)
            .collect();
        if blocks.len() < BLOCKS {
            return None;
        }
        let (time, value) = mean(&blocks);
        let spread: f64 = blocks.iter().map(|(t, _)| (t - time).powi(2)).sum();
        let slope = blocks.iter().map(|(t, v)| (t - time) * (v - value)).sum::<f64>() / spread;
        let rest: f64 = blocks.iter().map(|(t, v)| (v - value - slope * (t - time)).powi(2)).sum();
        let interval = STUDENT * (rest / (BLOCKS - 2) as f64 / spread).sqrt();
        Some(Self { mean: value, slope, interval, lasts: points.last()?.0 - points.first()?.0 })
    }

    /// As much as it grew at least in all that time, with 97.5 % confidence.
    pub fn least_growth(&self) -> f64 {
        (self.slope - self.interval) * self.lasts
    }
}

fn mean(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let sum = points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0, sum.1 + point.1));
    (sum.0 / count, sum.1 / count)
}

impl fmt::Display for Trend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hour = 3600.0;
        write!(f, "{:.2} | {:+.2} ± {:.2}", self.mean, self.slope * hour, self.interval * hour)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trend(value: fn(f64) -> f64) -> Trend {
        let points: Vec<_> = (0..240).map(|time| (f64::from(time), value(f64::from(time)))).collect();
        Trend::of(&points).unwrap()
    }

    #[test]
    fn what_grows_is_told_from_what_goes_up_and_down() {
        let leak = trend(|time| 50.0 + 0.1 * time + (time * 2.4).sin());
        assert!((leak.slope - 0.1).abs() < leak.interval && leak.interval < 0.01, "{leak:?}");
        assert!((22.0..24.0).contains(&leak.least_growth()), "{leak:?}");
        let flat = trend(|time| 50.0 + (time * 2.4).sin());
        assert!(flat.slope.abs() < flat.interval && flat.least_growth() < 0.0, "{flat:?}");
        // One step is no slope, however high.
        let step = trend(|time| if time < 230.0 { 50.0 } else { 60.0 });
        assert!(step.least_growth() < 2.0, "{step:?}");
    }

    #[test]
    fn too_few_samples_tell_nothing() {
        assert!(Trend::of(&[(0.0, 1.0); 5]).is_none());
    }
}
