// SPDX-License-Identifier: MPL-2.0

//! Whether a picture shows another part of the world than the one that is known, where nobody can tell how the camera moved.

use super::noise::Noise;
use super::samples::{MIN_SAMPLES, Sample};

/// Whether what is seen is as unlike the background behind it as the background of another place would be. Where the background is
/// too plain for that to stand out from noise, nobody knows. Takes the samples as they lie in the picture.
pub(super) fn is_another_view(samples: &[Sample], noise: &Noise) -> bool {
    if samples.len() < MIN_SAMPLES {
        return false;
    }
    let elsewhere = samples.iter().cycle().skip(samples.len() / 2);
    // Medians: somebody before less than half of the background does not count.
    let unlike = median(samples.iter().map(|sample| (sample.seen - sample.mean).abs()));
    let strangers =
        median(samples.iter().zip(elsewhere).map(|(sample, other)| (sample.seen - other.mean).abs()));
    let mean = samples.iter().map(|sample| sample.mean).sum::<f32>() / samples.len() as f32;
    // A different view is nearer to `strangers`, the same one to its noise.
    unlike > (strangers / 2.0).max(noise.luma().variance(mean).sqrt())
}

fn median(differences: impl Iterator<Item = f32>) -> f32 {
    let mut differences: Vec<f32> = differences.collect();
    let middle = differences.len() / 2;
    *differences.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::synthetic::texture;

    const SIZE: (usize, usize) = (60, 40);

    /// A background of so much contrast, and the part of the world `texture_seen` before it with noise; somebody hides a share of it.
    fn samples(contrast: f64, texture_seen: u32, hidden: f32) -> Vec<Sample> {
        let place = |at: usize| (3.0 * (at % SIZE.0) as f64, 3.0 * (at / SIZE.0) as f64);
        let light = |seed: u32, (x, y)| (100.0 + contrast * (texture(seed, x, y) - 128.0) / 128.0) as f32;
        let noise = |at: usize| ((at * 7919) % 9) as f32 - 4.0;
        let seen = |at: usize| {
            if (at as f32) < hidden * 2400.0 { 20.0 } else { light(texture_seen, place(at)) + noise(at) }
        };
        (0..SIZE.0 * SIZE.1).map(|at| Sample { mean: light(1, place(at)), seen: seen(at) }).collect()
    }

    fn another(contrast: f64, texture_seen: u32, hidden: f32) -> bool {
        is_another_view(&samples(contrast, texture_seen, hidden), &Noise::default())
    }

    #[test]
    fn another_part_of_the_world_is_told_by_little_contrast() {
        assert!(another(60.0, 2, 0.0));
        assert!(another(20.0, 2, 0.0));
        assert!(!another(60.0, 1, 0.0));
        assert!(!another(20.0, 1, 0.0));
    }

    #[test]
    fn somebody_who_is_near_is_no_other_view() {
        assert!(!another(60.0, 1, 0.4));
        assert!(another(60.0, 2, 0.4));
    }

    #[test]
    fn before_a_plain_wall_nobody_knows() {
        assert!(!another(2.0, 2, 0.0));
        assert!(!is_another_view(&samples(60.0, 2, 0.0)[..MIN_SAMPLES - 1], &Noise::default()), "too few");
    }
}
