// SPDX-License-Identifier: MPL-2.0

//! From light to numbers: the lens' softness, exposure, flickering lamps, noise.

use std::time::Duration;

use super::settings::Lighting;
use crate::{
    picture::{Picture, Plane},
    seeded::Seeded,
};

/// Black in luma.
const BLACK: i16 = 16;
/// Chance, made once: wherever a row starts in it, what follows is its noise.
const NOISE_LENGTH: usize = 1 << 16;
/// Standard deviation of the table's values.
const NOISE_SIGMA: f64 = 30.0;
/// Pixels of noise after the last start.
const LONGEST_ROW: usize = 1 << 13;
/// Cycles per second of the lamps' 100 Hz against 25 pictures a second: what the mains is off by.
const BEAT_HZ: f64 = 0.63;
/// Part by which lamps grow brighter and darker.
const FLICKER: f64 = 0.012;
/// Lamp periods while the shutter runs from the first row to the last.
const ROLLING_PERIODS: f64 = 0.6;

/// How the sensor is set for the light there is.
#[derive(Debug, Clone, Copy)]
struct Exposure {
    /// How much longer the shutter is open than set, for good light.
    shutter: f64,
    /// Part of full light that falls on it meanwhile.
    light: f64,
    /// How often what it counts is enlarged.
    gain: f64,
    /// Counts that one step of its converter takes, a power of two.
    step: i16,
    /// Noise in counts, in the dark and in white.
    noise: (f64, f64),
}

impl Exposure {
    /// In a room with lamps all over, or by night with a few, whose light is painted as a shutter catches it that is open as
    /// long as can be.
    fn of(lighting: Lighting, night: bool) -> Self {
        match (lighting, night) {
            (Lighting::Optimal, false) => {
                Self { shutter: 1.0, light: 1.0, gain: 1.0, step: 1, noise: (1.9, 1.3) }
            }
            // Half the light: first the shutter is open longer, then the gain makes up for a part of what is missing.
            (Lighting::Dim, false) => {
                Self { shutter: 1.6, light: 0.8, gain: 1.1, step: 2, noise: (3.0, 2.2) }
            }
            (Lighting::Optimal, true) => {
                Self { shutter: 2.2, light: 1.0, gain: 1.5, step: 1, noise: (3.0, 2.0) }
            }
            (Lighting::Dim, true) => Self { shutter: 2.2, light: 0.5, gain: 2.0, step: 2, noise: (3.4, 2.4) },
        }
    }
}

/// A sensor that turns the same light into the same numbers, picture by picture.
pub(crate) struct Sensor {
    exposure: Exposure,
    noise: Vec<i8>,
    seeded: Seeded,
    phase: f64,
}

impl Sensor {
    pub fn new(lighting: Lighting, night: bool, seeded: &Seeded) -> Self {
        let mut chance = seeded.fork(1);
        let gauss = |chance: &mut Seeded| {
            let sum: f64 = (0..12).map(|_| chance.unit()).sum();
            ((sum - 6.0) * NOISE_SIGMA).round().clamp(-127.0, 127.0) as i8
        };
        let noise = (0..NOISE_LENGTH + LONGEST_ROW).map(|_| gauss(&mut chance)).collect();
        Self { exposure: Exposure::of(lighting, night), noise, phase: chance.unit(), seeded: seeded.fork(2) }
    }

    /// How long the shutter is open where `set` is for good light.
    pub fn shutter(&self, set: Duration) -> Duration {
        set.mul_f64(self.exposure.shutter)
    }

    /// Counts the light of a picture; `frame` and its `time_s` say which noise and flicker.
    pub fn expose(&self, picture: &mut Picture, frame: u64, time_s: f64) {
        for (index, plane) in picture.planes.iter_mut().enumerate() {
            let mut rows = self.seeded.fork(frame * 3 + index as u64);
            let height = plane.height as f64;
            let length = plane.width.clamp(1, LONGEST_ROW);
            for (row, line) in plane.data.chunks_exact_mut(plane.width.max(1)).enumerate() {
                let flicker = self.flicker(time_s, row as f64 / height);
                for pixels in line.chunks_mut(length) {
                    let noise = &self.noise[rows.below(NOISE_LENGTH)..];
                    if index == 0 {
                        self.count(pixels, noise, flicker)
                    } else {
                        self.count_chroma(pixels, noise)
                    }
                }
            }
        }
    }

    /// Brightness of the lamps while a row is exposed, `down` being 0 for the first and 1 for the last.
    fn flicker(&self, time_s: f64, down: f64) -> f64 {
        let turns = self.phase + BEAT_HZ * time_s + ROLLING_PERIODS * down;
        1.0 + FLICKER * (turns * std::f64::consts::TAU).sin()
    }

    fn count(&self, pixels: &mut [u8], noise: &[i8], flicker: f64) {
        let Exposure { light, gain, step, noise: (dark, white), .. } = self.exposure;
        let light = (128.0 * light * flicker).round() as i16;
        let gain = (64.0 * gain).round() as i16;
        // In 1/128 of a count by value of the table.
        let amount = |sigma: f64| 128.0 * sigma / NOISE_SIGMA;
        let (dark, fall) = (amount(dark) as i16, ((amount(dark) - amount(white)) * 256.0 / 219.0) as i16);
        for (pixel, &noise) in pixels.iter_mut().zip(noise) {
            let value = i16::from(*pixel) - BLACK;
            let amount = dark - ((value * fall) >> 8);
            let counts = ((value * light + 64) >> 7) + ((i16::from(noise) * amount + 64) >> 7);
            let counts = (counts + step / 2) & !(step - 1);
            *pixel = (((counts.clamp(0, 239) * gain) >> 6) + BLACK).clamp(0, 255) as u8;
        }
    }

    fn count_chroma(&self, pixels: &mut [u8], noise: &[i8]) {
        let Exposure { light, gain, noise: (_, white), .. } = self.exposure;
        let strength = (128.0 * light * gain).round() as i16;
        let amount = (64.0 * white * gain / NOISE_SIGMA) as i16;
        for (pixel, &noise) in pixels.iter_mut().zip(noise) {
            let colour = (i16::from(*pixel) - 128) * strength + i16::from(noise) * amount;
            *pixel = (((colour + 64) >> 7) + 128).clamp(0, 255) as u8;
        }
    }
}

/// The lens: every pixel takes an eighth of each neighbour, sideways and upright.
pub(super) fn soften(plane: &mut Plane) {
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

    fn spread(lighting: Lighting, luma: u8) -> (f64, f64) {
        let sensor = Sensor::new(lighting, false, &Seeded::new(3));
        let mut picture = Picture::grey(320, 240, luma);
        sensor.expose(&mut picture, 7, 0.28);
        let mean = |line: &[u8]| line.iter().map(|&value| f64::from(value)).sum::<f64>() / line.len() as f64;
        let luma = &picture.planes[0].data;
        // Within rows: from row to row the lamps flicker.
        let variance = |line: &[u8]| {
            let mean = mean(line);
            line.iter().map(|&value| (f64::from(value) - mean).powi(2)).sum::<f64>() / line.len() as f64
        };
        (mean(luma), (luma.chunks(320).map(variance).sum::<f64>() / 240.0).sqrt())
    }

    #[test]
    fn noise_is_as_strong_as_it_should_be() {
        let (mean, sigma) = spread(Lighting::Optimal, 126);
        assert!((mean - 126.0).abs() < 2.5 && (1.4..2.0).contains(&sigma), "{mean} {sigma}");
        let (mean, sigma) = spread(Lighting::Dim, 126);
        assert!((mean - 113.0).abs() < 4.0 && (2.4..4.0).contains(&sigma), "{mean} {sigma}");
        assert!(spread(Lighting::Optimal, 50).1 > spread(Lighting::Optimal, 200).1, "more in the dark");
    }

    #[test]
    fn in_dim_light_the_shutter_is_open_longer() {
        let shutter = |lighting, night| {
            Sensor::new(lighting, night, &Seeded::new(3)).shutter(Duration::from_millis(16)).as_secs_f64()
        };
        assert_eq!(shutter(Lighting::Optimal, false), 0.016);
        assert!(shutter(Lighting::Dim, false) > 0.024 && shutter(Lighting::Optimal, true) > 0.03);
        // Never longer than from picture to picture.
        assert!(shutter(Lighting::Dim, true) < 0.04);
    }

    #[test]
    fn in_dim_light_there_are_fewer_grey_levels() {
        let levels = |lighting| {
            let sensor = Sensor::new(lighting, false, &Seeded::new(3));
            let mut picture = Picture::grey(440, 220, 0);
            let ramp = |i: usize| (16 + i / 2 % 220) as u8;
            picture.planes[0].data.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = ramp(i));
            sensor.expose(&mut picture, 0, 0.0);
            picture.planes[0].data.iter().collect::<std::collections::BTreeSet<_>>().len()
        };
        assert!(levels(Lighting::Dim) * 2 < levels(Lighting::Optimal), "{}", levels(Lighting::Dim));
    }

    #[test]
    fn every_picture_has_its_own_noise_and_always_the_same() {
        let sensor = Sensor::new(Lighting::Optimal, false, &Seeded::new(3));
        let picture = |frame| {
            let mut picture = Picture::grey(64, 48, 100);
            sensor.expose(&mut picture, frame, 0.0);
            picture
        };
        assert_eq!(picture(4), picture(4));
        assert_ne!(picture(4), picture(5));
    }

    #[test]
    fn flicker_is_slight() {
        let sensor = Sensor::new(Lighting::Optimal, false, &Seeded::new(3));
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
