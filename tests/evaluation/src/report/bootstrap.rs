// SPDX-License-Identifier: MPL-2.0

//! How sure a mean is: 95 % intervals by the bootstrap (B. Efron, "Bootstrap methods: another look at the jackknife", 1979).
//!
//! Runs of the same seed and path are not independent: same room, same person, same way. So what is drawn, with
//! replacement, are such groups with all their runs.

use std::collections::BTreeMap;

/// How often it is drawn.
const DRAWS: usize = 2000;

/// What is not independent of each other: seed and path.
pub type Group<'a> = (u64, &'a str);

/// Between these lie 95 % of the means of what was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// 2.5 % are below.
    pub low: f64,
    /// 2.5 % are above.
    pub high: f64,
}

/// Of the mean over all `values`, each with its group. `None` of fewer than two groups, which tell nothing. The same values
/// give the same interval, in whichever order they come.
pub fn interval<'a>(values: impl IntoIterator<Item = (Group<'a>, f64)>) -> Option<Interval> {
    let mut groups = BTreeMap::<Group, Vec<f64>>::new();
    for (group, value) in values {
        groups.entry(group).or_default().push(value);
    }
    let groups: Vec<(f64, f64)> = groups
        .into_values()
        .map(|mut values| {
            values.sort_by(f64::total_cmp);
            (values.iter().sum(), values.len() as f64)
        })
        .collect();
    if groups.len() < 2 {
        return None;
    }
    let mut chance = Chance(0x9e37_79b9_7f4a_7c15);
    let mut draw = |_| {
        let drawn = (0..groups.len()).map(|_| groups[chance.below(groups.len())]);
        let (sum, count) = drawn.fold((0.0, 0.0), |(sum, count), (s, n)| (sum + s, count + n));
        sum / count
    };
    let mut means: Vec<f64> = (0..DRAWS).map(&mut draw).collect();
    means.sort_by(f64::total_cmp);
    Some(Interval { low: means[DRAWS / 40], high: means[DRAWS - 1 - DRAWS / 40] })
}

/// Xorshift64* (S. Vigna, 2016): always the same numbers.
struct Chance(u64);

impl Chance {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize) % end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_always_is_the_same_is_sure_and_one_group_tells_nothing() {
        let same = (0..10).map(|seed| ((seed, "1"), 0.5));
        assert_eq!(interval(same), Some(Interval { low: 0.5, high: 0.5 }));
        assert_eq!(interval((0..10).map(|n| ((1, "1"), f64::from(n)))), None);
        assert_eq!(interval([]), None);
    }

    #[test]
    fn groups_are_drawn_and_not_runs() {
        // Ten runs each of two groups are no surer than one run each.
        let many = (0..20).map(|n| ((u64::from(n % 2 == 0), "1"), f64::from(n % 2)));
        assert_eq!(interval(many), Some(Interval { low: 0.0, high: 1.0 }));
        // The standard error of a mean of 100 throws of a coin is 0.05.
        let coins = (0..100).map(|n| ((n, "1"), (n % 2) as f64));
        let Interval { low, high } = interval(coins.clone()).unwrap();
        assert!((low - 0.4).abs() < 0.02 && (high - 0.6).abs() < 0.02, "{low} {high}");
        assert_eq!(interval(coins.clone()), interval(coins.rev()));
    }
}
