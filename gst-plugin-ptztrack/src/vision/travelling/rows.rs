//! What is done to every pixel of the model in every picture, a row at a time, so that the compiler makes vector code of
//! it: with AVX2 where the processor has it, which gives the same numbers.

use multiversion::multiversion;

use super::model::KNOWN;
use super::noise::{Line, PER_MEAN_DEVIATION};

/// Squared deviations (of luma and chroma together) at which foreground is as likely as background. The noise of
/// three channels has a mean of 3, and anything else is spread over many more grey levels than noise is.
const EVEN: f32 = 16.0;
/// Light varies by this part of what it is: clouds, exposure, faint shadows (a part of the mean, as thesis 3.3).
const LIGHT: f32 = 0.04;
/// What is known of a row of the background.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub mean: &'a [u16],
    pub spread: &'a [u16],
    pub age: &'a [u8],
    /// The mean's range within one pixel.
    pub low: &'a [u8],
    pub high: &'a [u8],
}

/// Adds the squared deviations from the mean, in units of the noise's variance.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn add_deviations(sums: &mut [f32], seen: &[u8], mean: &[u16], variance: f32) {
    let scale = 1.0 / variance;
    for (sum, (&seen, &mean)) in sums.iter_mut().zip(seen.iter().zip(mean)) {
        let off = f32::from(seen) - f32::from(mean) / 256.0;
        *sum += off * off * scale;
    }
}

/// How likely each pixel is foreground, with the deviation of its colour already known.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn likelihoods(
    out: &mut [u8],
    seen: &[u8],
    colour: &[f32],
    known: Known,
    misplaced: f32,
    noise: Line,
) {
    let count = out.len();
    let (seen, colour) = (&seen[..count], &colour[..count]);
    let (mean, spread, age) = (&known.mean[..count], &known.spread[..count], &known.age[..count]);
    let (low, high) = (&known.low[..count], &known.high[..count]);
    for index in 0..count {
        let (mean, age) = (f32::from(mean[index]) / 256.0, f32::from(age[index]));
        let spread = f32::from(spread[index]) * (PER_MEAN_DEVIATION / 256.0);
        let sensor = noise.variance(mean);
        // A spread of a few pictures says less than what is known of all pixels.
        let light = LIGHT * mean;
        let variance = ((age * spread * spread + 8.0 * sensor) / (age + 8.0)).max(sensor) + light * light;
        let range = f32::from(high[index].saturating_sub(low[index]));
        let off = ((f32::from(seen[index]) - mean).abs() - misplaced * range).max(0.0);
        let squares = off * off / variance + colour[index];
        let known = age.min(f32::from(KNOWN)) / f32::from(KNOWN);
        let level = 128.0 + known * (squares * (128.0 / EVEN) - 128.0);
        out[index] = level.clamp(0.0, 255.0) as u8;
    }
}

/// Takes the deviations from the mean into the spread (3.2), each by `alpha` of 65536 parts of the way.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn learn_spread(spread: &mut [u16], mean: &[u16], seen: &[u8], alphas: &[u16]) {
    for ((spread, &mean), (&seen, &alpha)) in spread.iter_mut().zip(mean).zip(seen.iter().zip(alphas)) {
        *spread = towards(*spread, (u16::from(seen) << 8).abs_diff(mean), alpha);
    }
}

/// Takes a row of the picture into the mean (3.1).
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn learn_mean(mean: &mut [u16], seen: &[u8], alphas: &[u16]) {
    for (mean, (&seen, &alpha)) in mean.iter_mut().zip(seen.iter().zip(alphas)) {
        *mean = towards(*mean, u16::from(seen) << 8, alpha);
    }
}

/// (3.1) in 8.8 fixed point: `alpha` of 65536 parts of the way.
#[inline(always)]
fn towards(from: u16, to: u16, alpha: u16) -> u16 {
    let way = i32::from(to) - i32::from(from);
    // Rounded, so that a small alpha pulls to neither side.
    (i32::from(from) + ((way * i32::from(alpha >> 1) + (1 << 14)) >> 15)) as u16
}
