// SPDX-License-Identifier: MPL-2.0

use super::Luma;

/// How a pixel is told from the background.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ForegroundTest {
    /// Thesis (3.3): it differs from the mean by `threshold` (0 to 1) of the mean or more.
    Relative {
        /// Fraction of the mean.
        threshold: f64,
    },
    /// It differs from the mean by more than `factor` standard deviations, which are those of the
    /// preceding `window` pictures (thesis 3.2).
    Spread {
        /// Standard deviations.
        factor: f64,
        /// Pictures, 2 to 255.
        window: usize,
    },
}

/// Half a grey level, 8.8: less is rounding, and no difference. A fraction of a black mean is less still.
const ROUNDING: u16 = 128;

/// The averaging background model of thesis 3.2.1: the running mean (3.1) of every pixel, the windowed
/// variance (3.2) where the test asks for it, and the foreground (3.3).
///
/// All of it is one pass over the picture in 8.8 fixed point, simple enough for the compiler to turn
/// into vector code.
#[derive(Debug, Default)]
pub struct Background {
    width: usize,
    /// Running mean, 8.8 fixed point.
    mean: Vec<u16>,
    spread: Option<Spread>,
}

impl Background {
    /// Forgets everything: the next picture is the background.
    pub fn restart(&mut self) {
        self.mean.clear();
        self.spread = None;
    }

    /// Marks in `mask` (255 foreground, 0 background; one byte a pixel, rows packed) what in `luma`
    /// differs from the mean of the pictures before, then takes `luma` into the mean with weight
    /// `weight` (0 to 1; the α of thesis 3.1). A picture of another size than the last one starts anew.
    pub fn update(&mut self, luma: &Luma, weight: f64, test: ForegroundTest, mask: &mut [u8]) {
        let pixels = luma.width() * luma.height();
        if pixels == 0 {
            return;
        }
        let first = self.mean.len() != pixels || self.width != luma.width();
        if first {
            self.width = luma.width();
            self.mean = vec![0; pixels];
            self.spread = None;
        }
        let weights = Weights::new(if first { 1.0 } else { weight });
        match test {
            ForegroundTest::Relative { threshold } => {
                self.spread = None;
                let fraction = (threshold * 65536.0).round() as u16;
                let rows = self.mean.chunks_exact_mut(self.width).zip(mask.chunks_exact_mut(self.width));
                for (y, (mean, mask)) in rows.enumerate() {
                    relative_row(luma.row(y), mean, mask, weights, fraction);
                }
            }
            ForegroundTest::Spread { factor, window } => {
                let window = window.clamp(2, 255);
                let spread = self.spread.take().filter(|spread| spread.window == window);
                let mut spread = spread.unwrap_or_else(|| Spread::new(window, pixels));
                spread.update(luma, &mut self.mean, mask, weights, factor);
                self.spread = Some(spread);
            }
        }
        if first {
            mask.fill(0);
        }
    }
}

/// The two weights of (3.1) in 0.16 fixed point; they add up to 1.
#[derive(Debug, Clone, Copy)]
struct Weights {
    new: u16,
    old: u16,
}

impl Weights {
    fn new(weight: f64) -> Self {
        // 1 is as good as 0: what it adds to an 8.8 number is below its last bit.
        let new = (weight * 65536.0).round().clamp(1.0, 65535.0) as u16;
        Self { new, old: new.wrapping_neg() }
    }

    /// (3.1). The products lose half a last bit each on average, which `+ 1` gives back: without it a
    /// small α pulls the mean into the dark.
    #[inline(always)]
    fn mean(self, previous: u16, pixel: u16) -> u16 {
        high(previous, self.old).saturating_add(high(pixel, self.new)).saturating_add(1)
    }
}

/// The product of an 8.8 and a 0.16 number, as 8.8.
#[inline(always)]
fn high(number: u16, fraction: u16) -> u16 {
    ((u32::from(number) * u32::from(fraction)) >> 16) as u16
}

/// (3.3) and (3.1) for one row.
fn relative_row(luma: &[u8], mean: &mut [u16], mask: &mut [u8], weights: Weights, fraction: u16) {
    for ((&pixel, mean), mask) in luma.iter().zip(mean).zip(mask) {
        let pixel = u16::from(pixel) << 8;
        let limit = high(*mean, fraction).max(ROUNDING);
        *mask = if pixel.abs_diff(*mean) >= limit { 255 } else { 0 };
        *mean = weights.mean(*mean, pixel);
    }
}

/// The last pictures and their sums, so that (3.2) holds exactly for a window that moves by one
/// picture at a time.
#[derive(Debug)]
struct Spread {
    window: usize,
    /// Pictures in the sums.
    filled: usize,
    /// Which picture is overwritten next.
    next: usize,
    /// `window` pictures; black (so that they add nothing) until filled.
    pictures: Vec<u8>,
    /// Sum of each pixel over the window: 255 pictures of 255 fit.
    sum: Vec<u16>,
    /// Sum of the squares.
    squares: Vec<u32>,
}

impl Spread {
    fn new(window: usize, pixels: usize) -> Self {
        Self {
            window,
            filled: 0,
            next: 0,
            pictures: vec![0; window * pixels],
            sum: vec![0; pixels],
            squares: vec![0; pixels],
        }
    }

    fn update(&mut self, luma: &Luma, mean: &mut [u16], mask: &mut [u8], weights: Weights, factor: f64) {
        let (width, pixels) = (luma.width(), self.sum.len());
        let count = self.filled as u32;
        // Of fewer than two pictures there is no spread to exceed.
        let factor = if count < 2 { f32::INFINITY } else { factor as f32 };
        let limits = SpreadLimits { count, factor_squared: factor * factor };
        let oldest = &mut self.pictures[self.next * pixels..][..pixels];
        let rows = mean
            .chunks_exact_mut(width)
            .zip(mask.chunks_exact_mut(width))
            .zip(oldest.chunks_exact_mut(width))
            .zip(self.sum.chunks_exact_mut(width).zip(self.squares.chunks_exact_mut(width)));
        for (y, (((mean, mask), oldest), (sum, squares))) in rows.enumerate() {
            let row = luma.row(y);
            limits.test_row(row, mean, sum, squares, mask);
            for (mean, &pixel) in mean.iter_mut().zip(row) {
                *mean = weights.mean(*mean, u16::from(pixel) << 8);
            }
            shift_row(row, oldest, sum, squares);
        }
        self.filled = (self.filled + 1).min(self.window);
        self.next = (self.next + 1) % self.window;
    }
}

#[derive(Debug, Clone, Copy)]
struct SpreadLimits {
    count: u32,
    factor_squared: f32,
}

impl SpreadLimits {
    /// |I − mean| > k·σ, squared and multiplied by N² so that neither root nor division is needed.
    fn test_row(self, luma: &[u8], mean: &[u16], sum: &[u16], squares: &[u32], mask: &mut [u8]) {
        let scale = (self.count * self.count) as f32 / 65536.0;
        let pixels = luma.iter().zip(mean).zip(sum.iter().zip(squares)).zip(mask);
        for (((&pixel, &mean), (&sum, &squares)), mask) in pixels {
            let difference = (u16::from(pixel) << 8).abs_diff(mean);
            let spread = (self.count * squares - u32::from(sum) * u32::from(sum)) as f32;
            let square = f32::from(difference) * f32::from(difference) * scale;
            // In this order an infinite factor times no spread (not a number) is background.
            let exceeds = square > self.factor_squared * spread;
            *mask = if exceeds & (difference >= ROUNDING) { 255 } else { 0 };
        }
    }
}

/// Puts a row in place of the oldest one, in the picture and in the sums.
fn shift_row(luma: &[u8], oldest: &mut [u8], sum: &mut [u16], squares: &mut [u32]) {
    for ((&pixel, oldest), (sum, squares)) in luma.iter().zip(oldest).zip(sum.iter_mut().zip(squares)) {
        let (new, old) = (u16::from(pixel), u16::from(*oldest));
        *sum = *sum + new - old;
        *squares = *squares + u32::from(new * new) - u32::from(old * old);
        *oldest = pixel;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RELATIVE: ForegroundTest = ForegroundTest::Relative { threshold: 0.25 };

    fn feed(background: &mut Background, picture: &[u8], weight: f64, test: ForegroundTest) -> Vec<u8> {
        let luma = Luma::new(picture, picture.len(), 1, picture.len()).unwrap();
        let mut mask = vec![7; picture.len()];
        background.update(&luma, weight, test, &mut mask);
        mask
    }

    fn means(background: &Background) -> Vec<f64> {
        background.mean.iter().map(|mean| f64::from(*mean) / 256.0).collect()
    }

    #[track_caller]
    fn assert_near(found: &[f64], expected: &[f64], tolerance: f64) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
        }
    }

    #[test]
    fn running_mean_of_three_pictures() {
        let mut background = Background::default();
        feed(&mut background, &[0, 100, 255], 0.5, RELATIVE);
        assert_near(&means(&background), &[0.0, 100.0, 255.0], 0.01);
        feed(&mut background, &[100, 50, 255], 0.5, RELATIVE);
        assert_near(&means(&background), &[50.0, 75.0, 255.0], 0.02);
        feed(&mut background, &[10, 51, 0], 0.25, RELATIVE);
        assert_near(&means(&background), &[40.0, 69.0, 191.25], 0.03);
    }

    #[test]
    fn weights_nought_and_one_freeze_and_replace() {
        let mut background = Background::default();
        feed(&mut background, &[80, 0, 255], 0.5, RELATIVE);
        for _ in 0..1000 {
            feed(&mut background, &[200, 255, 0], 0.0, RELATIVE);
        }
        assert_near(&means(&background), &[80.0, 0.0, 255.0], 0.02);
        feed(&mut background, &[200, 255, 0], 1.0, RELATIVE);
        assert_near(&means(&background), &[200.0, 255.0, 0.0], 0.02);
    }

    #[test]
    fn background_lies_strictly_within_the_fraction_of_the_previous_mean() {
        let mut background = Background::default();
        feed(&mut background, &[100; 5], 0.5, RELATIVE);
        // 100 ± 25: the ends themselves are foreground (3.3).
        assert_eq!(feed(&mut background, &[75, 76, 100, 124, 125], 0.5, RELATIVE), [255, 0, 0, 0, 255]);
    }

    #[test]
    fn first_picture_and_new_size_are_background() {
        let mut background = Background::default();
        assert_eq!(feed(&mut background, &[9, 200], 0.5, RELATIVE), [0, 0]);
        assert_eq!(feed(&mut background, &[9, 200, 3], 0.5, RELATIVE), [0, 0, 0]);
        background.restart();
        assert_eq!(feed(&mut background, &[90, 20, 30], 0.5, RELATIVE), [0, 0, 0]);
    }

    #[test]
    fn spread_is_that_of_the_preceding_window() {
        let spread = |factor| ForegroundTest::Spread { factor, window: 4 };
        let mut background = Background::default();
        // 250 leaves the window before the test; of 8, 12, 8, 12 the variance is 4 (3.2), σ = 2.
        for pixel in [250, 8, 12, 8, 12] {
            feed(&mut background, &[pixel], 0.0, spread(3.0));
        }
        background.mean[0] = 10 << 8;
        assert_eq!(feed(&mut background, &[15], 0.0, spread(2.0)), [255]);
        let mut again = Background::default();
        for pixel in [250, 8, 12, 8, 12] {
            feed(&mut again, &[pixel], 0.0, spread(3.0));
        }
        again.mean[0] = 10 << 8;
        assert_eq!(feed(&mut again, &[15], 0.0, spread(3.0)), [0]);
    }

    #[test]
    fn other_window_starts_its_spread_anew() {
        let test = |window| ForegroundTest::Spread { factor: 1.0, window };
        let mut background = Background::default();
        for _ in 0..5 {
            feed(&mut background, &[50], 0.5, test(4));
        }
        assert_eq!(feed(&mut background, &[60], 0.5, test(4)), [255]);
        assert_eq!(feed(&mut background, &[200], 0.5, test(8)), [0]);
    }

    proptest! {
        #[test]
        fn mean_follows_its_definition(
            pixels in proptest::collection::vec(any::<u8>(), 2..40), weight in 0.01f64..1.0,
        ) {
            let mut background = Background::default();
            let mut mean = f64::from(pixels[0]);
            feed(&mut background, &pixels[..1], weight, RELATIVE);
            for pixel in &pixels[1..] {
                mean = (1.0 - weight) * mean + weight * f64::from(*pixel);
                feed(&mut background, &[*pixel], weight, RELATIVE);
            }
            prop_assert!((means(&background)[0] - mean).abs() <= 0.5, "{:?} {}", means(&background), mean);
        }

        #[test]
        fn spread_follows_its_definition(
            pixels in proptest::collection::vec(any::<u8>(), 3..30), window in 2usize..9, factor in 0.5f64..4.0,
        ) {
            let test =
                ForegroundTest::Spread { factor, window };
            let mut background = Background::default();
            let (last, before) = pixels.split_last().unwrap();
            for pixel in before {
                feed(&mut background, &[*pixel], 0.5, test);
            }
            let samples: Vec<f64> = before.iter().rev().take(window).map(|p| f64::from(*p)).collect();
            let count = samples.len() as f64;
            let mean = samples.iter().sum::<f64>() / count;
            let sigma = (samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / count).sqrt();
            let difference = (f64::from(*last) - means(&background)[0]).abs();
            // Too close to the limit, rounding decides.
            prop_assume!((difference - factor * sigma).abs() > 0.05);
            let foreground = feed(&mut background, &[*last], 0.5, test)[0] == 255;
            prop_assert_eq!(foreground, difference > factor * sigma);
        }

        #[test]
        fn relative_test_follows_its_definition(
            before in any::<u8>(), now in any::<u8>(), threshold in 0.0f64..0.99,
        ) {
            let test = ForegroundTest::Relative { threshold };
            let mut background = Background::default();
            feed(&mut background, &[before], 0.5, test);
            let difference = f64::from(before.abs_diff(now));
            let limit = (f64::from(before) * threshold).max(0.5);
            prop_assume!((difference - limit).abs() > 0.02);
            prop_assert_eq!(feed(&mut background, &[now], 0.5, test)[0] == 255, difference > limit);
        }

        #[test]
        fn extremes_never_overflow(
            pixels in proptest::collection::vec(prop_oneof![Just(0u8), Just(255u8)], 1..600),
        ) {
            let test = ForegroundTest::Spread { factor: 100.0, window: 255 };
            let mut background = Background::default();
            for pixel in pixels {
                feed(&mut background, &[pixel], 0.001, test);
            }
        }
    }
}
