// SPDX-License-Identifier: MPL-2.0

//! Pixels all over the picture beside what is known of them: enough to tell what is true of the whole.

use super::model::KNOWN;

/// Pixels of each row, and rows, that are looked at: one in so many.
const SAMPLING: usize = 5;
/// Grey levels between which a pixel tells of light: below is noise, above the sensor is full.
const TELLS: std::ops::Range<f32> = 16.0..240.0;
/// Fewer pixels than this tell nothing.
pub(super) const MIN_SAMPLES: usize = 64;

/// A pixel of the background, and what is seen of it now.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub mean: f32,
    pub seen: f32,
}

/// Takes them from left to right, row by row, where the background's mean `mean` (8.8 fixed point) is known.
pub(super) fn take(
    seen: &[u8],
    mean: &[u16],
    age: &[u8],
    spans: &[(usize, usize)],
    samples: &mut Vec<Sample>,
) {
    let width = mean.len() / spans.len().max(1);
    samples.clear();
    for (y, &(start, end)) in spans.iter().enumerate().step_by(SAMPLING) {
        let row = y * width + start..y * width + end.max(start);
        let (seen, mean, age) = (&seen[row.clone()], &mean[row.clone()], &age[row.clone()]);
        for x in (0..row.len()).step_by(SAMPLING) {
            let sample = Sample { mean: f32::from(mean[x]) / 256.0, seen: f32::from(seen[x]) };
            if age[x] >= KNOWN && TELLS.contains(&sample.mean) && TELLS.contains(&sample.seen) {
                samples.push(sample);
            }
        }
    }
}
