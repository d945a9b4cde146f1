// SPDX-License-Identifier: MPL-2.0

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::Looks;

/// A path that has more steps loses every other one.
pub(crate) const MOST_STEPS: usize = 1024;

/// Somebody who was followed, from when to when. Times are milliseconds since 1970, UTC.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sighting {
    /// Name of the camera.
    pub camera: String,
    /// When the tracker was started that gave the track its number.
    pub run_ms: i64,
    /// The track's number, in that run of the tracker.
    pub track: u64,
    /// When the camera began to follow.
    pub from_ms: i64,
    /// When it ceased to.
    pub to_ms: i64,
    /// Where they went; empty where the camera does not say where it looks.
    pub path: Vec<Step>,
    /// The best picture of them.
    pub picture: Option<Picture>,
    /// Where they are in the recording.
    pub recording: Option<Pointer>,
}

/// Where somebody was.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Milliseconds since 1970, UTC.
    pub at_ms: i64,
    /// Degrees, positive to the right.
    pub pan_deg: f64,
    /// Degrees, positive up.
    pub tilt_deg: f64,
}

/// A picture of somebody.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// The picture, JPEG.
    pub jpeg: Vec<u8>,
    /// The larger, the better the picture.
    pub quality: f64,
    /// What they look like.
    pub looks: Looks,
}

/// A place in a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pointer {
    /// The file.
    pub file: PathBuf,
    /// Milliseconds from its beginning.
    pub offset_ms: i64,
}

impl Sighting {
    /// How far they went, as seen from the camera, in degrees.
    pub fn way_deg(&self) -> f64 {
        self.path.windows(2).map(|pair| angle_deg(pair[0], pair[1])).sum()
    }

    /// What it takes in memory, about.
    pub fn bytes(&self) -> usize {
        let picture =
            self.picture.as_ref().map_or(0, |picture| picture.jpeg.len() + picture.looks.bytes().len());
        size_of::<Self>() + size_of_val(&*self.path) + picture
    }

    /// One sighting of both, the other one being of the same track, later: somebody whom the camera took up again.
    pub(crate) fn join(&mut self, later: Self) {
        self.from_ms = self.from_ms.min(later.from_ms);
        self.to_ms = self.to_ms.max(later.to_ms);
        self.path.extend(later.path);
        self.path.sort_by_key(|step| step.at_ms);
        while thin(&mut self.path) {}
        let quality = |picture: &Option<Picture>| picture.as_ref().map(|picture| picture.quality);
        if quality(&later.picture) > quality(&self.picture) {
            self.picture = later.picture;
        }
        self.recording = self.recording.take().or(later.recording);
    }
}

/// Takes every other step out of a path that has too many, and says whether it had.
pub(crate) fn thin(path: &mut Vec<Step>) -> bool {
    let has_too_many = path.len() > MOST_STEPS;
    if has_too_many {
        let mut nth = 0..;
        path.retain(|_| nth.next().is_some_and(|nth| nth % 2 == 0));
    }
    has_too_many
}

/// Between two directions.
fn angle_deg(a: Step, b: Step) -> f64 {
    let [pan, tilt, other_tilt] = [b.pan_deg - a.pan_deg, a.tilt_deg, b.tilt_deg].map(f64::to_radians);
    // By the haversine, which is exact where they are close.
    let half = |angle: f64| (angle / 2.0).sin().powi(2);
    let haversine = half(other_tilt - tilt) + tilt.cos() * other_tilt.cos() * half(pan);
    2.0 * haversine.clamp(0.0, 1.0).sqrt().asin().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(at_ms: i64, pan_deg: f64, tilt_deg: f64) -> Step {
        Step { at_ms, pan_deg, tilt_deg }
    }

    fn sighting(from_ms: i64, path: Vec<Step>, quality: f64) -> Sighting {
        let picture = Picture { jpeg: vec![quality as u8], quality, looks: Looks::default() };
        Sighting {
            camera: "door".to_owned(),
            run_ms: 0,
            track: 1,
            from_ms,
            to_ms: from_ms + 10,
            path,
            picture: Some(picture),
            recording: None,
        }
    }

    #[test]
    fn the_way_is_as_seen_from_the_camera() {
        let way = |path| sighting(0, path, 1.0).way_deg();
        assert_eq!((way(vec![]), way(vec![step(0, 5.0, 5.0)])), (0.0, 0.0));
        let to_and_fro = vec![step(0, 0.0, 0.0), step(1, 30.0, 0.0), step(2, 0.0, 0.0)];
        assert!((way(to_and_fro) - 60.0).abs() < 1e-9);
        // Over the seam, and below the camera, where a turn by half a circle is a short way.
        assert!((way(vec![step(0, 179.0, 0.0), step(1, -179.0, 0.0)]) - 2.0).abs() < 1e-9);
        assert!((way(vec![step(0, 0.0, -89.0), step(1, 180.0, -89.0)]) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn who_is_taken_up_again_is_one_sighting_with_the_better_picture() {
        let mut first = sighting(100, vec![step(100, 0.0, 0.0)], 5.0);
        first.join(sighting(200, vec![step(200, 1.0, 0.0)], 3.0));
        assert_eq!((first.from_ms, first.to_ms, first.path.len()), (100, 210, 2));
        assert_eq!(first.picture.as_ref().map(|picture| picture.quality), Some(5.0));
        first.join(sighting(300, vec![], 7.0));
        assert_eq!(first.picture.map(|picture| picture.quality), Some(7.0));
    }

    #[test]
    fn who_is_taken_up_again_all_night_has_a_path_that_can_be_kept() {
        let steps = |from: i64| (from..from + 600).map(|second| step(1000 * second, 1.0, 0.0)).collect();
        let mut night = sighting(0, steps(0), 1.0);
        (1..50).for_each(|nth| night.join(sighting(600_000 * nth, steps(600 * nth), 1.0)));
        assert!((MOST_STEPS / 2..=MOST_STEPS).contains(&night.path.len()), "{}", night.path.len());
        assert_eq!(night.path[0].at_ms, 0);
        assert!(night.path.is_sorted_by_key(|step| step.at_ms) && night.to_ms > 29_000_000);
    }
}
