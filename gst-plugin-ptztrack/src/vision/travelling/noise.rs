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
    /// Standard deviation of the chroma.
    chroma: f32,
    sums: [(f32, f32); BINS],
    chroma_sum: (f32, f32),
}

impl Default for Noise {
    fn default() -> Self {
        let nothing = [(0.0, 0.0); BINS];
        Self { luma: [START; BINS], chroma: START, sums: nothing, chroma_sum: (0.0, 0.0) }
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
            if count >= MIN_SAMPLES {
                *believed += RATE * ((PER_MEAN_DEVIATION * sum / count).max(FLOOR) - *believed);
            }
        };
        self.luma.iter_mut().zip(self.sums).for_each(|(believed, sums)| learned(believed, sums));
        learned(&mut self.chroma, self.chroma_sum);
        self.sums = [(0.0, 0.0); BINS];
        self.chroma_sum = (0.0, 0.0);
    }

    /// Variance of the luma over brightness, by least squares.
    pub fn luma(&self) -> Line {
        let middle = |bin: usize| (bin as f32 + 0.5) * 256.0 / BINS as f32;
        let count = BINS as f32;
        let mean = self.luma.iter().map(|deviation| deviation * deviation).sum::<f32>() / count;
        let centre = 128.0;
        let (mut product, mut square) = (0.0, 0.0);
        for (bin, deviation) in self.luma.iter().enumerate() {
            product += (middle(bin) - centre) * (deviation * deviation - mean);
            square += (middle(bin) - centre).powi(2);
        }
        let slope = product / square;
        Line { at_black: mean - slope * centre, slope }
    }

    /// Variance of the chroma.
    pub fn chroma(&self) -> f32 {
        (self.chroma * self.chroma).max(CHROMA_FLOOR * CHROMA_FLOOR)
    }
}
