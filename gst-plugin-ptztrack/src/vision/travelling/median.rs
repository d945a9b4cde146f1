// SPDX-License-Identifier: MPL-2.0

/// Finds the middle one of some numbers, which are kept as whole numbers of the same order, as these are compared at once.
#[derive(Debug, Default)]
pub(super) struct Median {
    keys: Vec<i32>,
}

impl Median {
    /// Adds these numbers; NaN is none.
    pub fn extend(&mut self, numbers: impl Iterator<Item = f32>) {
        self.keys
            .extend(numbers.filter(|number| !number.is_nan()).map(|number| ordered(number.to_bits() as i32)));
    }

    /// The middle one of those that were added since it was taken last; `None` where there are none. Of an even number of them it is the
    /// larger one in the middle.
    pub fn take(&mut self) -> Option<f32> {
        let middle = self.keys.len() / 2;
        let key = (!self.keys.is_empty()).then(|| *self.keys.select_nth_unstable(middle).1);
        self.keys.clear();
        key.map(|key| f32::from_bits(ordered(key) as u32))
    }
}

/// The bits of a number in the order of numbers, and the other way round: below 0, those of the larger number are the smaller.
fn ordered(bits: i32) -> i32 {
    bits ^ ((bits >> 31) as u32 >> 1) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_middle_one_when_they_are_sorted(mut numbers in prop::collection::vec(-1e6..1e6_f32, 0..90)) {
            let mut median = Median::default();
            median.extend(numbers.iter().copied().chain([f32::NAN]));
            let found = median.take();
            numbers.sort_by(f32::total_cmp);
            prop_assert_eq!(found, numbers.get(numbers.len() / 2).copied());
            prop_assert_eq!(median.take(), None);
        }
    }
}
