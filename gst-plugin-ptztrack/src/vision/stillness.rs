// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use multiversion::multiversion;

use super::Luma;

/// For how long pictures have shown the same: what an encoder makes anew of one picture, the sensor's noise and a clock
/// written into the picture are no change; a camera that turns is.
#[derive(Debug, Default)]
pub struct Stillness {
    /// The first picture that showed it, rows packed.
    reference: Vec<u8>,
    width: usize,
    lasted: Duration,
}

impl Stillness {
    /// A pixel that differs by more shows something else.
    const NOISE: u8 = 8;

    /// A picture is another where a larger part of its pixels shows something else.
    const SHARE: f64 = 0.01;

    /// Takes the next picture, so many seconds after the last one.
    pub fn see(&mut self, luma: &Luma, elapsed_s: f64) -> Duration {
        if self.is_same(luma) {
            self.lasted =
                self.lasted.saturating_add(Duration::try_from_secs_f64(elapsed_s).unwrap_or_default());
        } else {
            self.reference.clear();
            (0..luma.height()).for_each(|y| self.reference.extend_from_slice(luma.row(y)));
            (self.width, self.lasted) = (luma.width(), Duration::ZERO);
        }
        self.lasted
    }

    fn is_same(&self, luma: &Luma) -> bool {
        let pixels = luma.width() * luma.height();
        if self.width != luma.width() || self.reference.len() != pixels || pixels == 0 {
            return false;
        }
        let rows = self.reference.chunks_exact(self.width).zip((0..).map(|y| luma.row(y)));
        let differing: usize = rows.map(|(before, now)| differing(before, now)).sum();
        differing as f64 <= Self::SHARE * pixels as f64
    }
}

/// How many pixels of a row show something else.
#[multiversion(targets("x86_64+avx2"))]
fn differing(before: &[u8], now: &[u8]) -> usize {
    // As few as a byte can count.
    const TOGETHER: usize = 255;
    let parts = before.chunks(TOGETHER).zip(now.chunks(TOGETHER));
    parts.map(|(before, now)| usize::from(differing_of_few(before, now))).sum()
}

#[inline(always)]
fn differing_of_few(before: &[u8], now: &[u8]) -> u8 {
    let pairs = before.iter().zip(now);
    pairs.map(|(before, now)| u8::from(before.abs_diff(*now) > Stillness::NOISE)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (160, 120);

    /// Stripes, shifted by so many pixels.
    fn stripes(shift: usize) -> Vec<u8> {
        let pixel = |index: usize| if ((index % SIZE.0 + shift) / 20).is_multiple_of(2) { 60 } else { 120 };
        (0..SIZE.0 * SIZE.1).map(pixel).collect()
    }

    fn see(stillness: &mut Stillness, pixels: &[u8]) -> Duration {
        stillness.see(&Luma::packed(pixels, SIZE.0), 0.04)
    }

    #[test]
    fn noise_and_a_clock_in_the_picture_change_nothing() {
        let mut stillness = Stillness::default();
        let mut lasted = Duration::ZERO;
        for picture in 0..26u8 {
            let mut pixels = stripes(0);
            let noise = |index: usize| ((index + usize::from(picture) * 7) % 9) as u8;
            pixels.iter_mut().enumerate().for_each(|(index, pixel)| *pixel += noise(index));
            pixels[..100].fill(if picture % 2 == 0 { 0 } else { 255 });
            lasted = see(&mut stillness, &pixels);
        }
        assert_eq!(lasted, Duration::from_secs(1));
    }

    #[test]
    fn a_camera_that_turns_however_slowly_changes_the_picture() {
        let mut stillness = Stillness::default();
        let longest = (0..100).map(|picture| see(&mut stillness, &stripes(picture / 10))).max();
        assert_eq!(longest, Some(Duration::from_millis(360)));
    }

    #[test]
    fn a_picture_of_another_size_is_another() {
        let mut stillness = Stillness::default();
        for _ in 0..5 {
            see(&mut stillness, &stripes(0));
        }
        let pixels = stripes(0);
        assert_eq!(stillness.see(&Luma::packed(&pixels, SIZE.0 / 2), 0.04), Duration::ZERO);
        assert_eq!(stillness.see(&Luma::packed(&[], 0), 0.04), Duration::ZERO);
    }
}
