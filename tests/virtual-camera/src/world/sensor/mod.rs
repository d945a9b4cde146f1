// SPDX-License-Identifier: MPL-2.0

//! From light to numbers: exposure, tone curve, flickering lamps, noise; and the lens' softness.

mod exposure;
mod tone;

use std::time::Duration;

use exposure::{Control, Setting, wanted};

use super::room::Lighting;
use crate::{
    picture::{Picture, Plane},
    seeded::Seeded,
};

/// The longest that a shutter is open, in times of how long it is set for good light.
pub(crate) const LONGEST_SHUTTER: u32 = 2;
/// Black in luma, and how far above it white is.
const BLACK: i32 = 16;
const WHITE: f64 = 219.0;
/// Electrons that white light gives with the shutter as set, and those of reading them out (standard deviation).
const FULL: f64 = 10_000.0;
const READING: f64 = 3.0;
/// Noise of what follows, in grey levels.
const CONVERTING: f64 = 0.7;
/// The camera's noise filter: it softens the picture once for so many doublings of the gain.
const SOFTENS_EVERY: f64 = 1.6;
/// Chance, made once: wherever a row starts in it, what follows is its noise.
const NOISE_LENGTH: usize = 1 << 16;
/// Standard deviation of the table's values.
const NOISE_SIGMA: f64 = 30.0;
/// Pixels of noise after the last start.
const LONGEST_ROW: usize = 1 << 13;
/// One pixel of so many across and down is metered.
const METERED: usize = 4;
/// Cycles per second of the lamps' 100 Hz against 25 pictures a second: what the mains is off by.
const BEAT_HZ: f64 = 0.63;
/// Part by which lamps grow brighter and darker.
const FLICKER: f64 = 0.012;
/// Lamp periods while the shutter runs from the first row to the last.
const ROLLING_PERIODS: f64 = 0.6;

/// A part of the light that a picture was painted in.
fn part(lighting: Lighting) -> f64 {
    match lighting {
        Lighting::Optimal => 1.0,
        Lighting::Dim => 0.15,
        // More than the control can make up for.
        Lighting::Dark => 0.0012,
    }
}

/// A sensor that turns the same light into the same numbers, picture by picture, and the control that sets it.
pub(crate) struct Sensor {
    /// Part of the light that pictures are painted in.
    light: f64,
    /// `None` is set for full light once and for all.
    control: Option<Control>,
    noise: Vec<i8>,
    seeded: Seeded,
    phase: f64,
}

impl Sensor {
    /// Where there is so much of the light that pictures are painted in, which is `painted` of a bright room's. The
    /// exposure is `fixed`, or the control chooses it.
    pub fn new(lighting: Lighting, painted: f64, fixed: bool, seeded: &Seeded) -> Self {
        let mut chance = seeded.fork(1);
        let gauss = |chance: &mut Seeded| {
            let sum: f64 = (0..12).map(|_| chance.unit()).sum();
            ((sum - 6.0) * NOISE_SIGMA).round().clamp(-127.0, 127.0) as i8
        };
        let noise = (0..NOISE_LENGTH + LONGEST_ROW).map(|_| gauss(&mut chance)).collect();
        Self {
            light: part(lighting) * painted,
            control: (!fixed).then(Control::default),
            noise,
            phase: chance.unit(),
            seeded: seeded.fork(2),
        }
    }

    /// How long the shutter is open at a time where `set` is for good light.
    pub fn shutter(&self, set: Duration, time: Duration) -> Duration {
        let stops = self.control.as_ref().and_then(|control| control.stops_at(time.as_secs_f64()));
        set.mul_f64(Setting::of(stops.unwrap_or_default()).shutter)
    }

    /// Counts the light of a picture; `frame` and its `time_s` say which noise and flicker. The control learns from it.
    pub fn expose(&self, picture: &mut Picture, frame: u64, time_s: f64) {
        let metered = Metered::new(&picture.planes[0]);
        let stops = self.control.as_ref().map_or(0.0, |control| {
            control.meter(time_s, |stops| metered.mean(self.light, Setting::of(stops)))
        });
        self.count(picture, Setting::of(stops), frame, time_s);
    }

    /// The same for a picture that no control learns from; it is set as it should be for that.
    pub fn expose_once(&self, picture: &mut Picture, frame: u64, time_s: f64) {
        let metered = Metered::new(&picture.planes[0]);
        let stops = self
            .control
            .as_ref()
            .map_or(0.0, |_| wanted(0.0, |stops| metered.mean(self.light, Setting::of(stops))));
        self.count(picture, Setting::of(stops), frame, time_s);
    }

    fn count(&self, picture: &mut Picture, setting: Setting, frame: u64, time_s: f64) {
        let tones = Tones::new(self.light, setting);
        for (index, plane) in picture.planes.iter_mut().enumerate() {
            let mut rows = self.seeded.fork(frame * 3 + index as u64);
            let height = plane.height as f64;
            let length = plane.width.clamp(1, LONGEST_ROW);
            for (row, line) in plane.data.chunks_exact_mut(plane.width.max(1)).enumerate() {
                let flicker = self.flicker(time_s, row as f64 / height);
                for pixels in line.chunks_mut(length) {
                    let noise = &self.noise[rows.below(NOISE_LENGTH)..];
                    if index == 0 { tones.count(pixels, noise, flicker) } else { tones.colour(pixels, noise) }
                }
            }
        }
        let passes = (setting.gain.log2() / SOFTENS_EVERY) as usize;
        picture.planes.iter_mut().for_each(|plane| (0..passes).for_each(|_| soften(plane)));
    }

    /// Brightness of the lamps while a row is exposed, `down` being 0 for the first and 1 for the last.
    fn flicker(&self, time_s: f64, down: f64) -> f64 {
        let turns = self.phase + BEAT_HZ * time_s + ROLLING_PERIODS * down;
        1.0 + FLICKER * (turns * std::f64::consts::TAU).sin()
    }
}

/// What the control looks at: how much light how many pixels get.
struct Metered {
    /// Painted light, 1 being white, and number of pixels.
    count: Vec<(f64, f64)>,
    pixels: f64,
}

impl Metered {
    fn new(luma: &Plane) -> Self {
        let mut count = [0u32; 256];
        for line in luma.data.chunks_exact(luma.width.max(1)).step_by(METERED) {
            line.iter().step_by(METERED).for_each(|pixel| count[usize::from(*pixel)] += 1);
        }
        let pixels = count.iter().sum::<u32>().max(1);
        let count = (0..=255).zip(count).filter(|(_, count)| *count > 0);
        Self {
            count: count.map(|(value, count)| (painted(value), f64::from(count))).collect(),
            pixels: f64::from(pixels),
        }
    }

    /// Mean luma of the picture, in a part of the light that it was painted in.
    fn mean(&self, light: f64, Setting { shutter, gain }: Setting) -> f64 {
        let level = |&(painted, count): &(f64, f64)| count * tone::signal(painted * light * shutter * gain);
        f64::from(BLACK) + WHITE * self.count.iter().map(level).sum::<f64>() / self.pixels
    }
}

/// The light, 1 being white, that a luma value was painted for.
fn painted(value: u8) -> f64 {
    tone::light((f64::from(i32::from(value) - BLACK) / WHITE).max(0.0))
}

/// What becomes of every value of a painted picture.
struct Tones {
    /// By luma: how far above black it comes, in 1/128, and how much of the noise's table is added, in 1/128 too.
    luma: [(i16, i16); 256],
    /// Strength of colours, and of their noise, in 1/128.
    colour: (i32, i32),
}

impl Tones {
    fn new(light: f64, Setting { shutter, gain }: Setting) -> Self {
        let amount = |sigma: f64| (128.0 * sigma / NOISE_SIGMA).round() as i16;
        let tone = |value: usize| {
            let caught = painted(value as u8) * light * shutter;
            let noise = (caught * FULL + READING * READING).sqrt() / FULL * gain;
            let shown = caught * gain;
            let below = noise.min(shown);
            let (low, high) = (tone::signal(shown - below), tone::signal(shown + noise));
            let sigma = WHITE * (high - low) * noise / (noise + below);
            ((128.0 * WHITE * tone::signal(shown)) as i16, amount(sigma.hypot(CONVERTING)))
        };
        let luma = std::array::from_fn(tone);
        // Of a middle grey: how much brighter or darker it comes than it was painted.
        let (middle, sigma) = luma[126];
        let strength = f64::from(middle) / 128.0 / 110.0;
        Self { luma, colour: ((128.0 * strength.min(2.5)).round() as i32, i32::from(sigma) * 2 / 3) }
    }

    fn count(&self, pixels: &mut [u8], noise: &[i8], flicker: f64) {
        let flicker = (256.0 * flicker).round() as i32;
        for (pixel, &noise) in pixels.iter_mut().zip(noise) {
            let (level, amount) = self.luma[usize::from(*pixel)];
            let counts = ((i32::from(level) * flicker) >> 8) + i32::from(noise) * i32::from(amount);
            *pixel = (((counts.max(0) + 64) >> 7) + BLACK).min(255) as u8;
        }
    }

    fn colour(&self, pixels: &mut [u8], noise: &[i8]) {
        let (strength, amount) = self.colour;
        for (pixel, &noise) in pixels.iter_mut().zip(noise) {
            let colour = (i32::from(*pixel) - 128) * strength + i32::from(noise) * amount;
            *pixel = (((colour + 64) >> 7) + 128).clamp(0, 255) as u8;
        }
    }
}

/// The lens: every pixel takes an eighth of each neighbour, sideways and upright.
pub(crate) fn soften(plane: &mut Plane) {
    let (width, height) = (plane.width, plane.height);
    if width < 3 || height < 3 {
        return;
    }
    let sideways = |line: &[u8], into: &mut [u16]| {
        let mix = |a: u8, b: u8, c: u8| u16::from(a) + 6 * u16::from(b) + u16::from(c);
        into[0] = mix(line[0], line[0], line[1]);
        into[width - 1] = mix(line[width - 2], line[width - 1], line[width - 1]);
        let (left, middle, right) = (&line[..width - 2], &line[1..width - 1], &line[2..]);
        for (((cell, &a), &b), &c) in into[1..width - 1].iter_mut().zip(left).zip(middle).zip(right) {
            *cell = mix(a, b, c);
        }
    };
    let mut lines = [vec![0u16; width], vec![0u16; width], vec![0u16; width]];
    sideways(&plane.data[..width], &mut lines[1]);
    lines[0] = lines[1].clone();
    for row in 0..height {
        let next = (row + 1).min(height - 1) * width;
        sideways(&plane.data[next..next + width], &mut lines[2]);
        let [above, middle, below] = &lines;
        let line = &mut plane.data[row * width..][..width];
        for (((pixel, &a), &b), &c) in line.iter_mut().zip(above).zip(middle).zip(below) {
            *pixel = ((a + 6 * b + c + 32) >> 6) as u8;
        }
        lines.rotate_left(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO_LIGHT_LOST: f64 = 1.0;

    fn sensor(lighting: Lighting, fixed: bool) -> Sensor {
        Sensor::new(lighting, NO_LIGHT_LOST, fixed, &Seeded::new(3))
    }

    /// Mean of a picture painted in one grey, and its noise within rows: from row to row the lamps flicker.
    fn spread(sensor: &Sensor, luma: u8) -> (f64, f64) {
        let mut picture = Picture::grey(320, 240, luma);
        sensor.expose(&mut picture, 7, 0.28);
        let mean = |line: &[u8]| line.iter().map(|&value| f64::from(value)).sum::<f64>() / line.len() as f64;
        let luma = &picture.planes[0].data;
        let variance = |line: &[u8]| {
            let mean = mean(line);
            line.iter().map(|&value| (f64::from(value) - mean).powi(2)).sum::<f64>() / line.len() as f64
        };
        (mean(luma), (luma.chunks(320).map(variance).sum::<f64>() / 240.0).sqrt())
    }

    #[test]
    fn full_light_comes_as_it_was_painted_with_little_noise() {
        let fixed = sensor(Lighting::Optimal, true);
        let (mean, sigma) = spread(&fixed, 126);
        assert!((mean - 126.0).abs() < 2.5 && (0.8..1.8).contains(&sigma), "{mean} {sigma}");
        assert!(spread(&fixed, 40).1 > spread(&fixed, 200).1, "more in the dark");
        let (mean, _) = spread(&sensor(Lighting::Dim, true), 126);
        assert!(mean < 65.0, "{mean}");
    }

    #[test]
    fn the_control_makes_dim_light_up_and_noise_tells() {
        for (luma, lighting) in [(60, Lighting::Optimal), (126, Lighting::Dim), (200, Lighting::Optimal)] {
            let (mean, sigma) = spread(&sensor(lighting, false), luma);
            let (low, high) = exposure::MEAN;
            assert!((low - 2.0..high + 2.0).contains(&mean), "{luma} {lighting:?}: {mean}");
            assert!(sigma < 4.0, "{luma} {lighting:?}: {sigma}");
        }
        let noise = |lighting| spread(&sensor(lighting, false), 126).1;
        assert!(noise(Lighting::Dim) > noise(Lighting::Optimal));
        let (mean, sigma) = spread(&sensor(Lighting::Dark, false), 126);
        assert!(mean < 45.0 && (1.5..4.5).contains(&sigma), "beyond its limits: {mean} {sigma}");
    }

    #[test]
    fn in_dim_light_the_shutter_is_open_longer_but_never_from_picture_to_picture() {
        let set = Duration::from_micros(16_667);
        let shutter = |lighting, fixed| {
            let sensor = sensor(lighting, fixed);
            spread(&sensor, 126);
            sensor.shutter(set, Duration::from_secs(1)).as_secs_f64()
        };
        assert!(shutter(Lighting::Optimal, false) <= 0.0167 && shutter(Lighting::Dim, true) < 0.0167);
        assert!((0.02..0.034).contains(&shutter(Lighting::Dim, false)));
        assert!(shutter(Lighting::Dark, false) <= (set * LONGEST_SHUTTER).as_secs_f64() + 1e-9);
    }

    #[test]
    fn every_picture_has_its_own_noise_and_always_the_same() {
        let sensor = sensor(Lighting::Optimal, false);
        let picture = |frame| {
            let mut picture = Picture::grey(64, 48, 100);
            sensor.expose(&mut picture, frame, 0.04 * frame as f64);
            picture
        };
        assert_eq!(picture(4), picture(4));
        assert_ne!(picture(4), picture(5));
    }

    #[test]
    fn flicker_is_slight() {
        let sensor = sensor(Lighting::Optimal, false);
        let values: Vec<f64> = (0..100).map(|i| sensor.flicker(f64::from(i) * 0.04, 0.5)).collect();
        let (low, high) = values.iter().fold((9.0f64, 0.0f64), |(l, h), &v| (l.min(v), h.max(v)));
        assert!(low > 0.98 && high < 1.02 && high - low > 0.01, "{low} {high}");
    }

    #[test]
    fn softening_keeps_brightness_and_spreads_a_spot() {
        let mut plane = Plane::filled(9, 7, 40);
        soften(&mut plane);
        assert!(plane.data.iter().all(|&pixel| pixel == 40));
        let mut plane = Plane::filled(9, 7, 0);
        plane.data[3 * 9 + 4] = 128;
        soften(&mut plane);
        assert_eq!([plane.data[3 * 9 + 4], plane.data[3 * 9 + 3], plane.data[2 * 9 + 4]], [72, 12, 12]);
    }
}
