// SPDX-License-Identifier: MPL-2.0

//! A small made-up world for tests: a textured wall and one textured person who walks where told.

use std::{sync::Arc, time::Duration};

use super::{
    FootageError,
    panorama::{Person, Recording},
    timeline::Timeline,
};
use crate::{
    picture::{Picture, Plane},
    truth::Bounds,
};

/// Where the person is at a time; between two of these they walk straight on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Since the camera's start.
    pub time: Duration,
    /// Pan angle of the person's middle as seen from the camera, in degrees.
    pub pan_deg: f64,
    /// Tilt angle of it, in degrees.
    pub tilt_deg: f64,
}

/// The made-up world.
#[derive(Debug, Clone)]
pub struct SyntheticSettings {
    /// Width and height of the whole world's picture in pixels.
    pub size: (u32, u32),
    /// What its width covers, in degrees.
    pub recording_fov_deg: f64,
    /// What the camera's widest view covers, in degrees.
    pub wide_fov_deg: f64,
    /// Pictures per second: the person's steps are that fine.
    pub frame_rate: f64,
    /// Height of the person, in degrees.
    pub person_height_deg: f64,
    /// The person's way, in order of time. They are there from the first to the last point; an empty way is an empty world.
    pub path: Vec<Waypoint>,
    /// Whether the person stands at the last point for ever instead of vanishing there.
    pub stays: bool,
    /// Of the textures.
    pub seed: u32,
}

impl Default for SyntheticSettings {
    fn default() -> Self {
        Self {
            size: (1024, 768),
            recording_fov_deg: 80.0,
            wide_fov_deg: 36.0,
            frame_rate: 50.0,
            person_height_deg: 9.0,
            path: Self::walk((-30.0, -2.0), (30.0, -2.0), 6.0, Duration::from_secs(2)),
            stays: false,
            seed: 1,
        }
    }
}

impl SyntheticSettings {
    /// The way from one pair of pan and tilt to another in degrees, at a speed in degrees per second.
    pub fn walk(from: (f64, f64), to: (f64, f64), speed_deg_s: f64, start: Duration) -> Vec<Waypoint> {
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        let point = |time, at: (f64, f64)| Waypoint { time, pan_deg: at.0, tilt_deg: at.1 };
        vec![point(start, from), point(start + Duration::from_secs_f64(length / speed_deg_s), to)]
    }

    /// Pan and tilt of the person at a time, `None` while they are not there.
    pub fn person_at(&self, time: Duration) -> Option<(f64, f64)> {
        let next = self.path.partition_point(|point| point.time <= time);
        let before = self.path.get(next.checked_sub(1)?)?;
        let Some(after) = self.path.get(next) else {
            let there = self.stays || before.time == time;
            return there.then_some((before.pan_deg, before.tilt_deg));
        };
        let whole = (after.time - before.time).as_secs_f64();
        let share = (time - before.time).as_secs_f64() / whole;
        let between = |a: f64, b: f64| a + (b - a) * share;
        Some((between(before.pan_deg, after.pan_deg), between(before.tilt_deg, after.tilt_deg)))
    }
}

/// Draws the made-up world.
pub(super) struct Synthetic {
    settings: SyntheticSettings,
    background: Arc<Picture>,
    person: Picture,
    focal: f64,
}

impl Synthetic {
    pub fn new(settings: &SyntheticSettings) -> Self {
        let (width, height) = settings.size;
        let focal = f64::from(width) / 2.0 / (settings.recording_fov_deg / 2.0).to_radians().tan();
        let person_height = (focal * settings.person_height_deg.to_radians().tan()).max(4.0) as u32 & !1;
        let person_width = (person_height * 2 / 5).max(2) & !1;
        // Soft blotches for the wall, small strong ones for clothes: corners everywhere, most on the person.
        let mut background = Picture::grey(width, height, 0);
        paint(&mut background.planes[0], settings.seed, 12, (95, 165));
        let mut person = Picture::grey(person_width, person_height, 0);
        paint(&mut person.planes[0], settings.seed ^ 0x5eed, 5, (0, 255));
        paint(&mut person.planes[1], settings.seed ^ 0xb10e, 8, (60, 200));
        Self { settings: settings.clone(), background: Arc::new(background), person, focal }
    }

    /// The person's left and top edge in a picture, in pixels of the chroma planes.
    fn corner(&self, frame: u64) -> Option<(isize, isize)> {
        let time = Duration::from_secs_f64(frame as f64 / self.settings.frame_rate);
        let (pan_deg, tilt_deg) = self.settings.person_at(time)?;
        let (pan, tilt) = (pan_deg.to_radians(), tilt_deg.to_radians());
        let x = f64::from(self.settings.size.0) / 2.0 + self.focal * pan.tan();
        let y = f64::from(self.settings.size.1) / 2.0 - self.focal * tilt.tan() / pan.cos();
        let (width, height) = self.person.size();
        let left = ((x - f64::from(width) / 2.0) / 2.0).round() as isize;
        let top = ((y - f64::from(height) / 2.0) / 2.0).round() as isize;
        Some((left, top))
    }
}

impl Recording for Synthetic {
    fn size(&self) -> (u32, u32) {
        self.settings.size
    }

    fn timeline(&self) -> Arc<Timeline> {
        Arc::new(Timeline::new(self.settings.frame_rate, 0, u64::MAX, false))
    }

    fn picture(&mut self, frame: u64) -> Result<Arc<Picture>, FootageError> {
        let Some((left, top)) = self.corner(frame) else {
            return Ok(self.background.clone());
        };
        let mut picture = (*self.background).clone();
        for (index, plane) in picture.planes.iter_mut().enumerate() {
            let scale = if index == 0 { 2 } else { 1 };
            paste(plane, &self.person.planes[index], left * scale, top * scale);
        }
        Ok(Arc::new(picture))
    }

    fn people(&self, frame: u64) -> Vec<Person> {
        let (width, height) = self.person.size();
        let person = self.corner(frame).map(|(left, top)| Person {
            id: 1,
            bounds: Bounds {
                left: 2.0 * left as f64,
                top: 2.0 * top as f64,
                width: width.into(),
                height: height.into(),
            },
            unhidden: 1.0,
        });
        person.into_iter().collect()
    }
}

/// Fills a plane with random values at every `grain` pixels, smooth between them.
fn paint(plane: &mut Plane, seed: u32, grain: usize, range: (u8, u8)) {
    let value = |column: usize, row: usize| {
        let noise = hash(seed, column as u32, row as u32);
        f32::from(range.0) + f32::from(range.1 - range.0) * noise
    };
    for (row, line) in plane.data.chunks_exact_mut(plane.width).enumerate() {
        for (column, pixel) in line.iter_mut().enumerate() {
            let (x, y) = (column / grain, row / grain);
            let right = (column % grain) as f32 / grain as f32;
            let down = (row % grain) as f32 / grain as f32;
            let above = value(x, y) * (1.0 - right) + value(x + 1, y) * right;
            let below = value(x, y + 1) * (1.0 - right) + value(x + 1, y + 1) * right;
            *pixel = (above * (1.0 - down) + below * down) as u8;
        }
    }
}

/// A number from 0 to 1 that only depends on its arguments.
fn hash(seed: u32, x: u32, y: u32) -> f32 {
    let mut bits = seed.wrapping_mul(0x9e37_79b9) ^ x.wrapping_mul(0x85eb_ca6b) ^ y.wrapping_mul(0xc2b2_ae35);
    for _ in 0..2 {
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
        bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    }
    (bits >> 8) as f32 / (1 << 24) as f32
}

/// Copies `what` into `plane` with its corner at (`left`, `top`), as far as it lies inside.
fn paste(plane: &mut Plane, what: &Plane, left: isize, top: isize) {
    let columns =
        left.clamp(0, plane.width as isize)..(left + what.width as isize).clamp(0, plane.width as isize);
    for (row, line) in what.data.chunks_exact(what.width).enumerate() {
        let y = top + row as isize;
        if (0..plane.height as isize).contains(&y) && !columns.is_empty() {
            let start = y as usize * plane.width;
            let source = (columns.start - left) as usize..(columns.end - left) as usize;
            plane.data[start + columns.start as usize..start + columns.end as usize]
                .copy_from_slice(&line[source]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secs(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    #[test]
    fn the_person_walks_from_point_to_point() {
        let settings = SyntheticSettings {
            path: SyntheticSettings::walk((-10.0, 0.0), (10.0, 0.0), 4.0, secs(1.0)),
            ..SyntheticSettings::default()
        };
        assert_eq!(settings.person_at(secs(0.9)), None);
        assert_eq!(settings.person_at(secs(1.0)), Some((-10.0, 0.0)));
        assert_eq!(settings.person_at(secs(3.5)), Some((0.0, 0.0)));
        assert_eq!(settings.person_at(secs(6.5)), None);
        let staying = SyntheticSettings { stays: true, ..settings };
        assert_eq!(staying.person_at(secs(99.0)), Some((10.0, 0.0)));
    }

    #[test]
    fn the_person_is_drawn_where_the_angles_say_even_at_the_edge() {
        let settings = SyntheticSettings {
            path: SyntheticSettings::walk((-60.0, 0.0), (60.0, 0.0), 10.0, secs(0.0)),
            ..SyntheticSettings::default()
        };
        let mut world = Synthetic::new(&settings);
        let background = world.background.clone();
        for (time, expected) in
            [(6.0, Some(512.0)), (7.0, Some(512.0 + world.focal * 10f64.to_radians().tan())), (0.1, None)]
        {
            let frame = world.timeline().frame_at(secs(time));
            let picture = world.picture(frame).unwrap();
            let changed: Vec<usize> = (0..1024)
                .filter(|column| {
                    (0..768).any(|row| {
                        picture.planes[0].data[row * 1024 + column]
                            != background.planes[0].data[row * 1024 + column]
                    })
                })
                .collect();
            let middle =
                (!changed.is_empty()).then(|| (changed[0] + changed[changed.len() - 1]) as f64 / 2.0);
            match (middle, expected) {
                (Some(middle), Some(expected)) => {
                    assert!((middle - expected).abs() < 3.0, "{middle} {expected}")
                }
                (found, expected) => assert_eq!(found, expected),
            }
        }
    }

    #[test]
    fn the_same_seed_is_the_same_world() {
        let picture = |seed| {
            let mut world = Synthetic::new(&SyntheticSettings { seed, ..SyntheticSettings::default() });
            world.picture(500).unwrap()
        };
        assert_eq!(picture(3), picture(3));
        assert_ne!(picture(3), picture(4));
    }
}
