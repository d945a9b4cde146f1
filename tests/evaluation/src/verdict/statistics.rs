// SPDX-License-Identifier: MPL-2.0

//! The statistics of a comparison, on plain numbers.

use statrs::distribution::{Beta, ContinuousCDF, Normal};
use virtual_camera::Seeded;

/// Of so many signs or fewer all are tried.
const ALL_SIGNS: usize = 14;
/// Of more, so many are drawn.
const DRAWS: u32 = 20_000;
/// What is as large but for rounding counts as large.
const ROUNDING: f64 = 1e-9;
/// How surely the smallest difference would have been seen.
const POWER: f64 = 0.8;

/// The test by sign flips (R. A. Fisher, "The Design of Experiments", 1935, section 21) of signed ranks (F. Wilcoxon, "Individual
/// comparisons by ranking methods", 1945): the probability that differences that go one way as far as these come about when nothing
/// but chance decides which of a pair is which. Ranks instead of the differences themselves, as a person who is lost in one scene
/// would else hide a small difference in all the others.
///
/// A row is a scene, a column an endpoint; `None` where a scene does not have it. All endpoints of a scene are flipped
/// together, and each is set against the largest of all (P. H. Westfall and S. S. Young, "Resampling-Based Multiple Testing",
/// 1993, section 2.3), so that the least of the probabilities given, one for each endpoint, needs no correction for their number. An
/// endpoint without any difference has 1.
pub fn sign_flip<const N: usize>(differences: &[[Option<f64>; N]]) -> [f64; N] {
    let columns: [Vec<f64>; N] = std::array::from_fn(|column| {
        signed_ranks(&differences.iter().map(|row| row[column].unwrap_or(0.0)).collect::<Vec<_>>())
    });
    let rows: Vec<[f64; N]> = (0..differences.len())
        .map(|row| std::array::from_fn(|column| columns[column][row]))
        .filter(|row: &[f64; N]| row.iter().any(|rank| *rank != 0.0))
        .collect();
    let squares: [f64; N] =
        std::array::from_fn(|column| rows.iter().map(|row| row[column] * row[column]).sum());
    // The sum of squares is the same whatever the signs are: it makes endpoints of any unit comparable.
    let statistic = |sums: [f64; N]| -> [f64; N] {
        std::array::from_fn(|column| {
            if squares[column] > 0.0 { sums[column].abs() / squares[column].sqrt() } else { 0.0 }
        })
    };
    let flipped = |signs: &dyn Fn(usize) -> bool| {
        let mut sums = [0.0; N];
        for (index, row) in rows.iter().enumerate() {
            for (sum, difference) in sums.iter_mut().zip(row) {
                *sum += if signs(index) { *difference } else { -*difference };
            }
        }
        statistic(sums)
    };
    let observed = flipped(&|_| true);
    let (mut as_large, mut tried) = ([0u32; N], 0);
    let mut count = |statistics: [f64; N]| {
        let largest = statistics.into_iter().fold(0.0, f64::max);
        tried += 1;
        for (count, observed) in as_large.iter_mut().zip(observed) {
            *count += u32::from(largest >= observed - ROUNDING);
        }
    };
    if rows.len() <= ALL_SIGNS {
        (0..1u32 << rows.len()).for_each(|signs| count(flipped(&|index| signs >> index & 1 == 0)));
    } else {
        let mut chance = Seeded::new(0x51f1);
        count(observed);
        for _ in 0..DRAWS {
            let signs: Vec<u64> = (0..rows.len().div_ceil(64)).map(|_| chance.bits()).collect();
            count(flipped(&|index| signs[index / 64] >> (index % 64) & 1 == 0));
        }
    }
    as_large.map(|as_large| f64::from(as_large) / f64::from(tried))
}

/// Of each difference its rank by size, from 1, with its sign; equal ones share theirs, and none has 0.
pub(super) fn signed_ranks(differences: &[f64]) -> Vec<f64> {
    let differs = |one: &f64| one.abs() > ROUNDING;
    let mut sizes: Vec<f64> = differences.iter().filter(|one| differs(one)).map(|one| one.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let rank = |size: f64| {
        let smaller = sizes.partition_point(|other| *other < size - ROUNDING);
        let up_to = sizes.partition_point(|other| *other <= size + ROUNDING);
        (smaller + up_to + 1) as f64 / 2.0
    };
    let signed = |one: &f64| if differs(one) { rank(one.abs()).copysign(*one) } else { 0.0 };
    differences.iter().map(signed).collect()
}

/// Probabilities, each with the weight of what it is a probability of, corrected for their number (S. Holm, "A simple sequentially
/// rejective multiple test procedure", 1979, section 3 for weights), in their order: all that are at most 0.05 then are wrong together
/// in 5 of 100 cases.
pub fn holm(probabilities: &[(f64, f64)]) -> Vec<f64> {
    let weighted = |index: usize| probabilities[index].0 / probabilities[index].1;
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|one, other| weighted(*one).total_cmp(&weighted(*other)));
    let mut left: f64 = probabilities.iter().map(|(_, weight)| weight).sum();
    let (mut corrected, mut largest) = (vec![1.0; probabilities.len()], 0.0f64);
    for index in order {
        largest = largest.max((left * weighted(index)).min(1.0));
        corrected[index] = largest;
        left -= probabilities[index].1;
    }
    corrected
}

/// What would have been seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Detectable {
    /// A mean difference of so much, in 80 of 100 cases, with the spread that these differences have.
    Difference(f64),
    /// They have no spread at all: only differences in so many scenes or more, all the same way.
    Scenes(usize),
}

/// The smallest mean difference that would have been seen at a level of `alpha`, two-sided: (z(1 − α/2) + z(0.8)) s / √n.
/// `None` of fewer than two.
pub fn detectable(differences: &[f64], alpha: f64) -> Option<Detectable> {
    let normal = Normal::standard();
    let n = differences.len() as f64;
    if differences.len() < 2 {
        return None;
    }
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if variance == 0.0 && mean == 0.0 {
        // Of k signs two in 2^k are as telling as all alike.
        return Some(Detectable::Scenes((2.0 / alpha).log2().ceil() as usize));
    }
    let quantiles = normal.inverse_cdf(1.0 - alpha / 2.0) + normal.inverse_cdf(POWER);
    Some(Detectable::Difference(quantiles * (variance / n).sqrt()))
}

/// Of a count, where the true share lies in at least 95 of 100 cases (C. J. Clopper and E. S. Pearson, "The use of confidence or
/// fiducial limits illustrated in the case of the binomial", Biometrika 26, 1934). All of it of nothing.
pub fn clopper_pearson(count: usize, of: usize) -> (f64, f64) {
    const TAIL: f64 = 0.025;
    let quantile = |a: usize, b: usize, share: f64| {
        Beta::new(a as f64, b as f64).map_or(f64::NAN, |beta| beta.inverse_cdf(share))
    };
    let low = if count == 0 { 0.0 } else { quantile(count, of - count + 1, TAIL) };
    let high = if count >= of { 1.0 } else { quantile(count + 1, of - count, 1.0 - TAIL) };
    (low, high)
}
