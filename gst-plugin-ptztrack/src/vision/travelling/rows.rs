// SPDX-License-Identifier: MPL-2.0

//! What is done to every pixel of the model in every picture, a row at a time, so that the compiler makes vector code of
//! it: with AVX2 where the processor has it, which gives the same numbers.

use multiversion::multiversion;

use super::model::{KNOWN, MAX_AGE, UNKNOWN, UNSEEN};
use super::noise::{Line, PER_MEAN_DEVIATION};

/// Squared deviations (of luma and chroma together) at which foreground is as likely as background. The noise of
/// three channels has a mean of 3, and anything else is spread over many more grey levels than noise is.
const EVEN: f32 = 16.0;
/// Light varies by this part of what it is: clouds, exposure, faint shadows (a part of the mean, as thesis 3.3).
const LIGHT: f32 = 0.04;
/// Pixels that are looked at together.
pub(super) const PART: usize = 64;

/// What is known of a row of the background.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub mean: &'a [u16],
    pub spread: &'a [u16],
    pub age: &'a [u8],
    /// The mean's range within one pixel.
    pub range: &'a [u8],
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
    let range = &known.range[..count];
    for index in 0..count {
        let (mean, age) = (f32::from(mean[index]) / 256.0, f32::from(age[index]));
        let spread = f32::from(spread[index]) * (PER_MEAN_DEVIATION / 256.0);
        let sensor = noise.variance(mean);
        // A spread of a few pictures says less than what is known of all pixels.
        let light = LIGHT * mean;
        let variance = ((age * spread * spread + 8.0 * sensor) / (age + 8.0)).max(sensor) + light * light;
        let off = ((f32::from(seen[index]) - mean).abs() - misplaced * f32::from(range[index])).max(0.0);
        let squares = off * off / variance + colour[index];
        let known = age.min(f32::from(KNOWN)) / f32::from(KNOWN);
        let level = 128.0 + known * (squares * (128.0 / EVEN) - 128.0);
        out[index] = whole_part(level.clamp(0.0, 255.0)) as u8;
    }
}

/// Makes foreground likelier by a fraction, but for what nothing is known of.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn expect(likelihoods: &mut [u8], (times, of): (u16, u16)) {
    for likelihood in likelihoods {
        let likelier = (u16::from(*likelihood) * times / of).min(255) as u8;
        *likelihood = if *likelihood == UNKNOWN { UNKNOWN } else { likelier };
    }
}

/// What is before the point of a number from 0 to 65535. A cast, which saturates, is not made into vector code.
#[inline(always)]
pub(super) fn whole_part(number: f32) -> u16 {
    // So large that a number with it added has no room for fractions, and the nearest whole one in its lowest bits.
    const LARGE: f32 = (1 << 23) as f32;
    let nearest = number + LARGE - LARGE;
    let below = if nearest > number { nearest - 1.0 } else { nearest };
    (below + LARGE).to_bits() as u16
}

/// Means in whole grey levels.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn whole(out: &mut [u8], mean: &[u16]) {
    for (out, mean) in out.iter_mut().zip(mean) {
        *out = (mean.saturating_add(128) >> 8) as u8;
    }
}

/// The range of grey levels within one pixel, of the row in the middle of three. `least` and `most` are memory.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn ranges(
    out: &mut [u8],
    [above, here, below]: [&[u8]; 3],
    least: &mut Vec<u8>,
    most: &mut Vec<u8>,
) {
    let width = out.len();
    // A pixel more on either side: beyond the border there is nothing, so it is repeated.
    for extreme in [&mut *least, &mut *most] {
        extreme.clear();
        extreme.resize(width + 2, 0);
    }
    let columns = above[..width].iter().zip(&here[..width]).zip(&below[..width]);
    for (((above, here), below), (least, most)) in
        columns.zip(least[1..=width].iter_mut().zip(&mut most[1..=width]))
    {
        *least = (*above).min(*here).min(*below);
        *most = (*above).max(*here).max(*below);
    }
    for extreme in [&mut *least, &mut *most] {
        (extreme[0], extreme[width + 1]) = (extreme[1], extreme[width]);
    }
    let least = least[..width].iter().zip(&least[1..=width]).zip(&least[2..]);
    let most = most[..width].iter().zip(&most[1..=width]).zip(&most[2..]);
    for (out, (((a, b), c), ((d, e), f))) in out.iter_mut().zip(least.zip(most)) {
        *out = (*d).max(*e).max(*f) - (*a).min(*b).min(*c);
    }
}

/// How many pixels of a row are known, and how many are foreground.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn count(likelihoods: &[u8]) -> (u32, u32) {
    let (mut known, mut foreground) = (0, 0);
    // In each chunk the numbers stay below 2^16.
    for chunk in likelihoods.chunks(1 << 15) {
        known += u32::from(chunk.iter().map(|value| u16::from(*value != UNKNOWN)).sum::<u16>());
        foreground += u32::from(chunk.iter().map(|value| u16::from(*value > UNKNOWN)).sum::<u16>());
    }
    (known, foreground)
}

/// By how many of 65536 parts each pixel is learned: the younger, the more, and none less than `min_weight`; nothing of what is
/// foreground.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn alphas(out: &mut [u16], likelihood: &[u8], age: &[u8], min_weight: f32) {
    for (out, (&likely, &age)) in out.iter_mut().zip(likelihood.iter().zip(age)) {
        let weight = (1.0 / (f32::from(age) + 1.0)).max(min_weight);
        let alpha = whole_part((65536.0 * weight).min(65535.0));
        // What is unknown is learned, too: it is 128 and no more.
        *out = if likely <= UNKNOWN { alpha } else { 0 };
    }
}

/// Nothing of what was never seen is learned.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn leave_unseen(alphas: &mut [u16], age: &[u8]) {
    for (alpha, &age) in alphas.iter_mut().zip(age) {
        *alpha = if age == UNSEEN { 0 } else { *alpha };
    }
}

/// Pixels that are learned from grow older, and nothing waits to take their place.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn grow_older(age: &mut [u8], waited: &mut [u8], alphas: &[u16]) {
    for ((age, waited), &alpha) in age.iter_mut().zip(waited).zip(alphas) {
        *age = age.saturating_add(u8::from(alpha > 0)).min(MAX_AGE);
        *waited = if alpha > 0 { 0 } else { *waited };
    }
}

/// Whether any of a few pixels is foreground, from which nothing is learned.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn any_foreground(alphas: &[u16]) -> bool {
    alphas.iter().fold(false, |any, &alpha| any | (alpha == 0))
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

/// (3.1) in 8.8 fixed point: `alpha` of 65536 parts of the way, but for its lowest bit, in numbers of 16 bits, of which the most fit
/// into a register.
#[inline(always)]
fn towards(from: u16, to: u16, alpha: u16) -> u16 {
    let (up, down) = (to.saturating_sub(from), from.saturating_sub(to));
    let (way, alpha) = (up | down, alpha & !1);
    let (high, low) = (((u32::from(way) * u32::from(alpha)) >> 16) as u16, way.wrapping_mul(alpha));
    // Rounded, so that a small alpha pulls to neither side; halves go up.
    let step = high + (low.saturating_sub(u16::from(down > 0)) >> 15);
    if down > 0 { from - step } else { from + step }
}

/// What candidates make of a part of a row of the picture: `seen`, `ticks` after the picture before. Only those of foreground, whose
/// `alphas` are nought, change. Whether any of these has been the same for so many ticks as its [`patience`], `most` of them at most.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn wait(
    candidates: [&mut [u8]; 3],
    waited: &mut [u8],
    seen: [&[u8]; 3],
    alphas: &[u16],
    age: &[u8],
    (ticks, most): (u8, u8),
) -> bool {
    // 255 for those that are as they were: few planes at a time, as the compiler has to know that none lies on another.
    let mut alike = [u8::MAX; PART];
    for (candidate, seen) in candidates.iter().zip(seen) {
        for (alike, (&candidate, &seen)) in alike.iter_mut().zip(candidate.iter().zip(seen)) {
            *alike &= if seen.abs_diff(candidate) <= CANDIDATE_TOLERANCE { u8::MAX } else { 0 };
        }
    }
    for (candidate, seen) in candidates.into_iter().zip(seen) {
        let pixels = candidate.iter_mut().zip(seen).zip(alike.iter().zip(alphas));
        for ((candidate, &seen), (&alike, &alpha)) in pixels {
            let changed = if alike > 0 { near(*candidate, seen) } else { seen };
            *candidate = if alpha == 0 { changed } else { *candidate };
        }
    }
    let mut is_any_due = false;
    let pixels = waited.iter_mut().zip(age).zip(alike.iter().zip(alphas));
    for ((waited, &age), (&alike, &alpha)) in pixels {
        let longer = waited.saturating_add(ticks) & alike;
        *waited = if alpha == 0 { longer } else { *waited };
        is_any_due |= (alpha == 0) & (longer >= patience(age, (ticks, most)));
    }
    is_any_due
}

/// Ticks that every candidate waits: somebody walking past looks alike from picture to picture.
pub(super) const MIN_PATIENCE: u8 = 12;

/// For how many ticks, `most` of them at most, a candidate has to stay the same to take the place of what is `age` pictures old, which
/// come `ticks` after each other. What was hardly seen before has no more right to be there (Yi et al.: the older one is apparent).
#[inline(always)]
pub(super) fn patience(age: u8, (ticks, most): (u8, u8)) -> u8 {
    // In more bits, as a product that saturates is not made into vector code.
    let seen_for = (u16::from(age) * u16::from(ticks)).min(u16::from(u8::MAX)) as u8;
    most.min(seen_for.max(MIN_PATIENCE))
}

/// Grey levels within which a candidate is still the same.
const CANDIDATE_TOLERANCE: u8 = 12;

/// A quarter of the way.
#[inline(always)]
fn near(from: u8, to: u8) -> u8 {
    ((u16::from(from) * 3 + u16::from(to) + 2) / 4) as u8
}
