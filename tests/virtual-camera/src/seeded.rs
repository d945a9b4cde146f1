// SPDX-License-Identifier: MPL-2.0

//! Chance that always falls the same way: everything made up comes from a seed.

/// A stream of numbers (splitmix64, Steele et al. 2014), the same on every machine.
#[derive(Debug, Clone)]
pub struct Seeded(u64);

impl Seeded {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(mix(seed ^ 0x5bd1_e995_9d1b_54a5))
    }

    /// A stream for one purpose: does not depend on how much was drawn from this one by others later on.
    pub fn fork(&self, label: u64) -> Self {
        Self(mix(self.0 ^ mix(label.wrapping_add(0x9e37_79b9_7f4a_7c15))))
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// From 0 to 1, 1 not included.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Nearly normal with mean 0 and standard deviation 1: twelve draws, which add up to the same on every machine.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    /// From `low` to `high`.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A whole number below `n`, which is not 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// One of several, of which there is at least one.
    pub fn pick<T: Copy>(&mut self, choice: &[T]) -> T {
        choice[self.below(choice.len())]
    }
}

fn mix(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_a_stream() {
        let stream = |seed| {
            let mut seeded = Seeded::new(seed);
            [seeded.bits(), seeded.bits(), seeded.bits()]
        };
        assert_eq!(stream(7), stream(7));
        assert_ne!(stream(7), stream(8));
        let root = Seeded::new(7);
        assert_ne!(root.fork(1).bits(), root.fork(2).bits());
        assert_eq!(root.fork(1).bits(), root.fork(1).bits());
    }

    #[test]
    fn normal_numbers_have_mean_0_and_deviation_1() {
        let mut seeded = Seeded::new(1);
        let drawn: Vec<f64> = (0..10_000).map(|_| seeded.normal()).collect();
        let mean = drawn.iter().sum::<f64>() / 1e4;
        let square = drawn.iter().map(|value| value * value).sum::<f64>() / 1e4;
        assert!(mean.abs() < 0.03 && (square - 1.0).abs() < 0.04, "{mean} {square}");
    }

    #[test]
    fn numbers_are_spread_evenly_over_their_range() {
        let mut seeded = Seeded::new(1);
        let mean = (0..10_000).map(|_| seeded.range(2.0, 4.0)).sum::<f64>() / 10_000.0;
        assert!((mean - 3.0).abs() < 0.02, "{mean}");
        let mut counts = [0; 5];
        (0..10_000).for_each(|_| counts[seeded.below(5)] += 1);
        assert!(counts.iter().all(|&count| (1800..2200).contains(&count)), "{counts:?}");
    }
}
