// SPDX-License-Identifier: MPL-2.0

//! How much lighter or darker the pictures have become as a whole: lamps, clouds, and cameras that expose anew as they turn.

use super::median::Median;
use super::samples::{MIN_SAMPLES, Sample};

/// Grey levels within which a pixel shows the background.
const ALIKE: f32 = 6.0;

/// The factor by which the background's mean has to be multiplied to look like what is seen: the median ratio, where
/// that explains more than half of what differs; else 1. Somebody who comes before the background is no change of light,
/// however much of it they hide. `median` is memory.
pub(super) fn light_gain(samples: &[Sample], median: &mut Median) -> f32 {
    if samples.len() < MIN_SAMPLES {
        return 1.0;
    }
    median.extend(samples.iter().map(|sample| sample.seen / sample.mean));
    let Some(gain) = median.take() else { return 1.0 };
    let differ =
        |gain: f32| samples.iter().filter(|sample| (sample.seen - gain * sample.mean).abs() > ALIKE).count();
    if 2 * differ(gain) < differ(1.0) { gain } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::model::KNOWN;
    use super::super::samples;
    use super::*;
    use proptest::prelude::*;

    const SIZE: (usize, usize) = (100, 60);

    fn room() -> Vec<u8> {
        (0..SIZE.0 * SIZE.1).map(|at| 40 + (at * 37 % 97) as u8).collect()
    }

    fn gain(seen: &[u8], age: u8) -> f32 {
        let mean: Vec<u16> = room().iter().map(|&grey| u16::from(grey) << 8).collect();
        let mut samples = Vec::new();
        samples::take(seen, &mean, &vec![age; mean.len()], &vec![(0, SIZE.0); SIZE.1], &mut samples);
        light_gain(&samples, &mut Median::default())
    }

    #[test]
    fn nothing_changes_where_nothing_is_known() {
        let dark: Vec<u8> = room().iter().map(|grey| grey / 2).collect();
        assert_eq!(gain(&dark, 0), 1.0);
        assert_eq!(gain(&room(), KNOWN), 1.0);
    }

    #[test]
    fn somebody_before_most_of_it_is_no_change_of_light() {
        let mut seen = room();
        seen[..SIZE.0 * SIZE.1 * 7 / 10].fill(30);
        assert_eq!(gain(&seen, KNOWN), 1.0);
    }

    proptest! {
        #[test]
        fn all_of_it_lighter_or_darker_is(factor in 0.5_f32..1.6, hidden in 0usize..40) {
            let mut seen: Vec<u8> = room().iter().map(|&grey| (factor * f32::from(grey)).round() as u8).collect();
            seen[..SIZE.0 * SIZE.1 * hidden / 100].fill(200);
            let gain = gain(&seen, KNOWN);
            // A small change is learned like any other.
            prop_assert!((gain - factor).abs() < 0.06 || (gain == 1.0 && (factor - 1.0).abs() < 0.15), "{gain} {factor}");
        }
    }
}
