// SPDX-License-Identifier: MPL-2.0

//! The noise filter over time: what changes little is taken for noise, so that what moves leaves a smear.

use std::time::Duration;

use crate::picture::Picture;

/// The picture before is that of the same stream if it is no older than this.
const SAME_STREAM: Duration = Duration::from_millis(500);
/// A change of so many steps is no noise any more.
const CHANGE: i32 = 40;

/// What the filter remembers.
#[derive(Debug, Default)]
pub(crate) struct NoiseFilter {
    before: Option<(Duration, Picture)>,
}

impl NoiseFilter {
    /// Mixes the picture of `time` with the one before; `strength` is the part of it that stays where nothing changes.
    pub fn apply(&mut self, strength: f64, time: Duration, picture: &mut Picture) {
        let follows = |then: &Duration, past: &Picture| {
            *then < time && time - *then < SAME_STREAM && past.size() == picture.size()
        };
        if let Some((_, past)) = self.before.take().filter(|(then, past)| follows(then, past)) {
            let stays = stays(strength);
            for (plane, past) in picture.planes.iter_mut().zip(&past.planes) {
                for (pixel, &past) in plane.data.iter_mut().zip(&past.data) {
                    let change = i32::from(past) - i32::from(*pixel);
                    let part = stays[change.unsigned_abs() as usize];
                    *pixel = (i32::from(*pixel) + ((change * part + 128) >> 8)) as u8;
                }
            }
        }
        self.before = Some((time, picture.clone()));
    }
}

/// How much of the past stays, in 256ths, by how far it is from the present.
fn stays(strength: f64) -> [i32; 256] {
    std::array::from_fn(|change| {
        let doubt = 1.0 - (change as f64 / f64::from(CHANGE)).min(1.0);
        (256.0 * strength * (0.25 + 0.75 * doubt)) as i32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_leaves_a_smear_and_noise_goes() {
        let mut filter = NoiseFilter::default();
        let mut last = Picture::grey(32, 24, 100);
        for number in 0..20 {
            last = Picture::grey(32, 24, 100 + (number % 2) * 4);
            filter.apply(0.8, Duration::from_millis(40 * u64::from(number)), &mut last);
        }
        assert!((100..=103).contains(&last.planes[0].data[0]), "{}", last.planes[0].data[0]);
        let mut bright = Picture::grey(32, 24, 220);
        filter.apply(0.8, Duration::from_millis(800), &mut bright);
        assert!((180..215).contains(&bright.planes[0].data[0]), "{}", bright.planes[0].data[0]);
        // Another stream begins afresh.
        let mut later = Picture::grey(32, 24, 50);
        filter.apply(0.8, Duration::from_secs(9), &mut later);
        assert_eq!(later, Picture::grey(32, 24, 50));
    }
}
