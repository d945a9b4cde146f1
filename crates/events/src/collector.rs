// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::clock::milliseconds;
use crate::sighting::thin;
use crate::{Crop, Sighting, Step};

/// Between two steps of a path, at first.
const STEP: Duration = Duration::from_secs(1);

/// A clock that is kept right by the network is never so far off.
const JUMP_MS: u64 = 60_000;

/// Whom a camera follows, in one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Number of the track.
    pub track: u64,
    /// Height of the box, picture heights.
    pub height: f64,
    /// How straight they come towards the camera: 1, to the side 0, away from it -1.
    pub towards: f64,
    /// Pan and tilt in degrees, where they are known.
    pub direction: Option<(f64, f64)>,
}

impl Target {
    /// How good a picture it is that is this sharp: they are large in it, and from behind it is worth a third of one from the front.
    fn quality(&self, sharpness: f64) -> f64 {
        self.height * sharpness * (2.0 + self.towards)
    }
}

/// Makes sightings of what one run of a tracker tells.
#[derive(Debug)]
pub struct Collector {
    camera: String,
    run_ms: i64,
    /// When it began, by the clock as it was when somebody was first seen; from then on another one counts, which never jumps.
    began_ms: i64,
    now: Option<Followed>,
}

/// Who is followed now.
#[derive(Debug)]
struct Followed {
    sighting: Sighting,
    best: Option<(f64, Crop)>,
    /// Between two steps.
    step: Duration,
}

/// A sighting that is over, with the best picture, and how good it is.
#[derive(Debug)]
pub struct Ended {
    /// Without its picture.
    pub sighting: Sighting,
    /// As it is to be encoded.
    pub best: Option<(f64, Crop)>,
}

impl Collector {
    /// For a tracker that was started at this time, in milliseconds since 1970.
    pub fn new(camera: &str, run_ms: i64) -> Self {
        Self { camera: camera.to_owned(), run_ms, began_ms: run_ms, now: None }
    }

    /// Who is followed so long after the start, and at this time, in milliseconds since 1970; what is over by that is returned.
    pub fn see(&mut self, elapsed: Duration, now_ms: i64, target: Option<&Target>) -> Option<Ended> {
        let track = target.map(|target| target.track);
        let ended = if self.now.as_ref().map(|now| now.sighting.track) == track { None } else { self.end() };
        if let Some(target) = target {
            if self.now.is_none() {
                self.begin(now_ms - milliseconds(elapsed));
            }
            let at_ms = self.began_ms + milliseconds(elapsed);
            let begin = || Followed::new(&self.camera, self.run_ms, target.track, at_ms);
            self.now.get_or_insert_with(begin).see(at_ms, target);
        }
        ended
    }

    /// The tracker was started then, by the clock as it is now: it may have been set meanwhile. Then nothing of before is of the same
    /// sighting, which would last as long as the clock was off.
    fn begin(&mut self, began_ms: i64) {
        if began_ms.abs_diff(self.began_ms) > JUMP_MS {
            self.run_ms = began_ms;
        }
        self.began_ms = began_ms;
    }

    /// Takes a picture of them that is this sharp, where it is better than those before.
    pub fn offer(&mut self, target: &Target, sharpness: f64, crop: impl FnOnce() -> Option<Crop>) {
        let quality = target.quality(sharpness);
        let Some(now) = &mut self.now else { return };
        if now.best.as_ref().is_none_or(|(best, _)| quality > *best)
            && let Some(crop) = crop()
        {
            now.best = Some((quality, crop));
        }
    }

    /// Nobody is followed any more.
    pub fn end(&mut self) -> Option<Ended> {
        let Followed { sighting, best, .. } = self.now.take()?;
        Some(Ended { sighting, best })
    }
}

impl Followed {
    fn new(camera: &str, run_ms: i64, track: u64, at_ms: i64) -> Self {
        let sighting = Sighting {
            camera: camera.to_owned(),
            run_ms,
            track,
            from_ms: at_ms,
            to_ms: at_ms,
            path: Vec::new(),
            picture: None,
            recording: None,
        };
        Self { sighting, best: None, step: STEP }
    }

    fn see(&mut self, at_ms: i64, target: &Target) {
        self.sighting.to_ms = at_ms;
        let path = &mut self.sighting.path;
        let is_due = path.last().is_none_or(|last| at_ms - last.at_ms >= milliseconds(self.step));
        if let Some((pan_deg, tilt_deg)) = target.direction.filter(|_| is_due) {
            path.push(Step { at_ms, pan_deg, tilt_deg });
        }
        if thin(path) {
            self.step *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sighting::MOST_STEPS;

    const FIRST: Target = Target { track: 1, height: 0.5, towards: 0.0, direction: Some((10.0, -5.0)) };
    const SECOND: Target = Target { track: 2, ..FIRST };

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn crop(width: u32) -> Option<Crop> {
        Some(Crop { width, height: 1, rgb: Vec::new(), person: [0; 4] })
    }

    #[test]
    fn each_track_that_was_followed_is_one_sighting() {
        let mut collector = Collector::new("door", 1_000_000);
        assert!(collector.see(at(0), 1_000_000, None).is_none());
        assert!(collector.see(at(100), 1_000_100, Some(&FIRST)).is_none());
        assert!(collector.see(at(900), 1_000_900, Some(&FIRST)).is_none());
        let first = collector.see(at(1000), 1_001_000, Some(&SECOND)).unwrap().sighting;
        assert_eq!((first.track, first.from_ms, first.to_ms), (1, 1_000_100, 1_000_900));
        let second = collector.see(at(1100), 1_001_100, None).unwrap().sighting;
        assert_eq!((second.track, second.from_ms, second.to_ms), (2, 1_001_000, 1_001_000));
        assert!(collector.end().is_none());
        collector.see(at(2000), 1_002_000, Some(&FIRST));
        assert_eq!(collector.end().unwrap().sighting.camera, "door");
    }

    /// As where a board without a battery hears what time it is.
    #[test]
    fn a_clock_that_is_set_counts_from_the_next_sighting_on() {
        let mut collector = Collector::new("door", 1_000_000);
        collector.see(at(0), 1_000_000, Some(&FIRST));
        let first =
            collector.see(at(1000), 90_000_000, Some(&FIRST)).or_else(|| collector.end()).unwrap().sighting;
        assert_eq!((first.from_ms, first.to_ms), (1_000_000, 1_001_000));
        collector.see(at(2000), 90_001_000, Some(&SECOND));
        collector.see(at(3000), 90_002_000, Some(&SECOND));
        let second = collector.end().unwrap().sighting;
        assert_eq!((second.run_ms, second.from_ms, second.to_ms), (89_999_000, 90_001_000, 90_002_000));
        collector.see(at(4000), 90_003_010, Some(&FIRST));
        let third = collector.end().unwrap().sighting;
        assert_eq!((third.run_ms, third.from_ms), (89_999_000, 90_003_010), "of the same run");
    }

    #[test]
    fn the_best_picture_is_large_sharp_and_from_the_front() {
        let quality = |height, sharpness, towards| Target { height, towards, ..FIRST }.quality(sharpness);
        assert!(quality(0.6, 0.1, 0.0) > quality(0.5, 0.1, 0.0));
        assert!(quality(0.5, 0.2, 0.0) > quality(0.5, 0.1, 0.0));
        assert!(quality(0.5, 0.1, 1.0) > quality(0.5, 0.1, 0.0));
        assert!(quality(0.5, 0.1, 0.0) > quality(0.5, 0.1, -1.0) && quality(0.5, 0.1, -1.0) > 0.0);
        let mut collector = Collector::new("door", 0);
        collector.offer(&FIRST, 0.9, || crop(9));
        collector.see(at(0), 0, Some(&FIRST));
        for (sharpness, width) in [(0.1, 1), (0.3, 3), (0.2, 2)] {
            collector.offer(&FIRST, sharpness, || crop(width));
        }
        collector.offer(&FIRST, 0.5, || None);
        assert_eq!(collector.end().unwrap().best.unwrap().1.width, 3);
    }

    #[test]
    fn a_path_has_a_step_a_second_and_does_not_grow_for_ever() {
        let path = |seconds: u64| {
            let mut collector = Collector::new("door", 0);
            (0..seconds * 4).for_each(|n| drop(collector.see(at(n * 250), 0, Some(&FIRST))));
            collector.end().unwrap().sighting.path
        };
        assert_eq!(path(10).len(), 10);
        let day = path(24 * 3600);
        assert!((MOST_STEPS / 2..=MOST_STEPS).contains(&day.len()), "{}", day.len());
        assert!(day.windows(2).all(|pair| pair[0].at_ms < pair[1].at_ms));
    }
}
