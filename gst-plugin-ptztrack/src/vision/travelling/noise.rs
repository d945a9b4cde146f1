// SPDX-License-Identifier: MPL-2.0

//! How noisy the pictures are: of the sensor, and of coding.

/// Brightness is told apart in so many steps.
const BINS: usize = 8;
/// Deviations that are learned are at least those of rounding, grey levels.
const FLOOR: f32 = 0.6;
/// Chroma is coded in large blocks that come and go, grey levels.
const CHROMA_FLOOR: f32 = 2.0;
/// What is believed before anything was seen, grey levels.
const START: f32 = 2.5;
/// How much of it is believed of a brightness of which nothing was seen, beside one that was.
const START_WEIGHT: f32 = 0.01;
/// Weight of a picture in what is believed.
const RATE: f32 = 0.1;
/// Fewer samples of a picture than this say nothing.
const MIN_SAMPLES: f32 = 50.0;
/// Standard deviations of a normal distribution in its mean absolute deviation.
pub(super) const PER_MEAN_DEVIATION: f32 = 1.25;

/// Variance of the luma's noise as a straight line over brightness: shot noise grows with light, what gamma
/// and coding make of it may do the opposite.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    at_black: f32,
    slope: f32,
}

impl Line {
    /// At a brightness of 0 to 255, squared grey levels.
    #[inline(always)]
    pub fn variance(self, brightness: f32) -> f32 {
        (self.at_black + self.slope * brightness).max(FLOOR * FLOOR)
    }
}

/// Learns the noise from how pixels of the background differ from their mean.
#[derive(Debug)]
pub(super) struct Noise {
    luma: [f32; BINS],
    /// How well the luma's is known.
    weights: [f32; BINS],
    /// Standard deviation of the chroma.
    chroma: f32,
    sums: [(f32, f32); BINS],
    chroma_sum: (f32, f32),
}

impl Default for Noise {
    fn default() -> Self {
        let nothing = [(0.0, 0.0); BINS];
        let weights = [START_WEIGHT; BINS];
        Self { luma: [START; BINS], weights, chroma: START, sums: nothing, chroma_sum: (0.0, 0.0) }
    }
}

impl Noise {
    /// Takes note of a background pixel of that brightness whose luma is off by `luma`, whose chroma by
    /// `chroma` grey levels.
    pub fn note(&mut self, brightness: u8, luma: f32, chroma: f32) {
        let bin = &mut self.sums[usize::from(brightness) * BINS / 256];
        *bin = (bin.0 + luma, bin.1 + 1.0);
        self.chroma_sum = (self.chroma_sum.0 + chroma, self.chroma_sum.1 + 1.0);
    }

    /// Learns from what was noted of one picture.
    pub fn learn(&mut self) {
        let learned = |believed: &mut f32, (sum, count): (f32, f32)| {
            let is_seen = count >= MIN_SAMPLES;
            if is_seen {
                *believed += RATE * ((PER_MEAN_DEVIATION * sum / count).max(FLOOR) - *believed);
            }
            is_seen
        };
        for ((believed, weight), sums) in self.luma.iter_mut().zip(&mut self.weights).zip(self.sums) {
            if learned(believed, sums) {
                *weight += RATE * (1.0 - *weight);
            }
        }
        learned(&mut self.chroma, self.chroma_sum);
        self.sums = [(0.0, 0.0); BINS];
        self.chroma_sum = (0.0, 0.0);
    }

    /// Variance of the luma over brightness, by weighted least squares: in the dark only what is dark is known.
    pub fn luma(&self) -> Line {
        let middle = |bin: usize| (bin as f32 + 0.5) * 256.0 / BINS as f32;
        let known = self.luma.iter().zip(self.weights).enumerate();
        let known = known.map(|(bin, (deviation, weight))| (middle(bin), deviation * deviation, weight));
        let weights: f32 = self.weights.iter().sum();
        let average = |value: fn((f32, f32, f32)) -> f32| {
            known.clone().map(|bin| value(bin) * bin.2).sum::<f32>() / weights
        };
        let (centre, mean) = (average(|bin| bin.0), average(|bin| bin.1));
        let (mut product, mut square) = (0.0, 0.0);
        for (middle, variance, weight) in known {
            product += weight * (middle - centre) * (variance - mean);
            square += weight * (middle - centre).powi(2);
        }
        let slope = product / square;
        Line { at_black: mean - slope * centre, slope }
    }

    /// Variance of the chroma.
    pub fn chroma(&self) -> f32 {
        (self.chroma * self.chroma).max(CHROMA_FLOOR * CHROMA_FLOOR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a picture with these brightnesses, and the mean deviation of each.
    fn learned(bins: &[(u8, f32)]) -> Noise {
        let mut noise = Noise::default();
        for _ in 0..100 {
            for &(brightness, deviation) in bins {
                (0..60).for_each(|_| noise.note(brightness, deviation / PER_MEAN_DEVIATION, 0.0));
            }
            noise.learn();
        }
        noise
    }

    #[test]
    fn before_anything_was_seen_all_is_as_noisy() {
        let line = Noise::default().luma();
        for brightness in [0.0, 128.0, 255.0] {
            assert!((line.variance(brightness) - START * START).abs() < 1e-3, "{brightness} {line:?}");
        }
    }

    #[test]
    fn noise_that_grows_with_light_is_a_line() {
        let variance = |brightness: f32| 1.0 + 0.05 * brightness;
        let seen =
            [16_u8, 80, 144, 240].map(|brightness| (brightness, variance(f32::from(brightness)).sqrt()));
        let line = learned(&seen).luma();
        for brightness in [16.0, 112.0, 240.0] {
            assert!(
                (line.variance(brightness) / variance(brightness) - 1.0).abs() < 0.15,
                "{brightness} {line:?}"
            );
        }
    }

    #[test]
    fn what_is_not_known_of_bright_places_makes_dark_ones_no_noisier() {
        let line = learned(&[(10, 1.0), (40, 1.1)]).luma();
        for brightness in [5.0, 25.0, 50.0] {
            assert!((0.4..2.0).contains(&line.variance(brightness)), "{brightness} {line:?}");
        }
    }
}
