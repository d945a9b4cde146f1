// SPDX-License-Identifier: MPL-2.0

//! Estimates that a minority of wrong pairs does not move.

/// Feet are found no better than to this, in radians: a degree, as gait and shadows have it.
pub const FEET: f64 = 0.0175;

/// A normal distribution's standard deviation, of the median of the absolute values.
const OF_MEDIAN: f64 = 1.4826;

/// Beyond so many standard deviations Tukey's biweight takes no notice: 95 % efficient where nothing is wrong (Holland and
/// Welsch, Robust regression using iteratively reweighted least-squares, 1977).
const BIWEIGHT: f64 = 4.685;

/// The median; 0 of nothing.
pub fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// The standard deviation of residuals in two dimensions that are given by their length, per axis.
pub fn scale(lengths: impl Iterator<Item = f64>) -> f64 {
    // The median of a length in the plane is sqrt(2 ln 2) standard deviations.
    let of_length = 1.0 / (2.0 * std::f64::consts::LN_2).sqrt();
    (of_length * median(&mut lengths.collect::<Vec<_>>())).max(FEET / OF_MEDIAN)
}

/// Tukey's biweight of a residual.
pub fn weight(residual: f64, scale: f64) -> f64 {
    let part = residual / (BIWEIGHT * scale);
    if part < 1.0 { (1.0 - part * part).powi(2) } else { 0.0 }
}

/// What a residual costs, in squared radians: no more where it is larger than any of a right pair.
pub fn cost(residual: f64) -> f64 {
    residual.min(BIWEIGHT * FEET).powi(2)
}
