// SPDX-License-Identifier: MPL-2.0

//! Stages replaced by the truth, to see what each costs: what the metas say is changed between detector and tracker, which know
//! nothing of it. What is replaced after the tracker is in [`super::placement`].

use std::sync::{Arc, Mutex};

use gst::prelude::*;
use ptztrack_contract::{
    BufferMeta, CameraMotion, Homography, MotionMeta, Plane, Point, Rect, Region, SceneMeta,
};
use virtual_camera::{Matrix, Sighting};

use super::recorded::RecordedPicture;
use crate::{
    metrics::SPECK,
    pipeline::{Elements, PipelineError, lock},
    record::{Bounds, named},
    trackers::normalised,
};

named! {
    /// What can be replaced by the truth.
    Stage, "stage" {
        /// The camera's motion, as the tracker is told of it; the detector goes on by its own.
        Motion = "motion",
        /// The regions, and how likely what is foreground: what is to be seen of everybody.
        Regions = "regions",
        /// Whose region it is: only those of the person to be followed are left.
        Owner = "owner",
        /// What is hidden: there is a region where all of the person is, as long as a part of them is hidden.
        Hidden = "hidden",
        /// The speed at hiding: the place of who is hidden goes on as they really do.
        Speed = "speed",
        /// The size of the box: around its middle it has the true one.
        Size = "size",
        /// What of the error of the box's place stays over a second, in the direction of the person's motion.
        Lag = "lag",
        /// What of it stays, across that.
        Bias = "bias",
        /// What of it does not stay.
        Jitter = "jitter",
    }
}

/// What is true of the picture that is under way.
#[derive(Clone)]
struct Truth {
    motion: Option<Matrix>,
    people: Vec<Sighting>,
    /// Number of the person to be followed.
    target: Option<u32>,
    size: (u32, u32),
}

/// Replaces what the detector said.
pub(super) struct Replacement {
    stages: Vec<Stage>,
    truth: Arc<Mutex<Option<Truth>>>,
}

/// A box with less of somebody in it than this is not theirs.
const OWNED: f64 = 0.05;

impl Replacement {
    /// Puts up its probe before the tracker of `pipeline`, where there is anything to replace.
    pub fn attach(pipeline: &gst::Pipeline, stages: &[Stage]) -> Result<Self, PipelineError> {
        let replacement = Self { stages: stages.to_vec(), truth: Arc::default() };
        if !stages.is_empty() {
            let (stages, truth) = (replacement.stages.clone(), replacement.truth.clone());
            pipeline.pad("tracker", "sink")?.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
                let truth = lock(&truth).clone();
                if let Some((truth, buffer)) = truth.zip(info.buffer_mut().map(gst::Buffer::make_mut))
                    && let Err(error) = truth.replace(&stages, buffer)
                {
                    gst::error!(gst::CAT_DEFAULT, "no truth: {error}");
                }
                gst::PadProbeReturn::Ok
            });
        }
        Ok(replacement)
    }

    /// To be called before each picture.
    pub fn next(&self, picture: &RecordedPicture) {
        if !self.stages.is_empty() {
            *lock(&self.truth) = Some(Truth {
                motion: picture.motion,
                people: picture.people.clone(),
                target: picture.truth.truth.as_ref().map(|person| person.id),
                size: picture.truth.size,
            });
        }
    }
}

impl Truth {
    fn replace(&self, stages: &[Stage], buffer: &mut gst::BufferRef) -> Result<(), glib::BoolError> {
        let with = |stage| stages.contains(&stage);
        if with(Stage::Motion) || with(Stage::Regions) {
            self.replace_scene(stages, buffer)?;
        }
        let seen = MotionMeta::of(buffer).and_then(Result::ok);
        let mut regions = if with(Stage::Regions) {
            Some(self.people.iter().filter_map(|one| self.region(one, false)).collect())
        } else {
            seen.as_ref().map(|seen| seen.regions.clone())
        };
        let hidden = self.target().filter(|one| with(Stage::Hidden) && one.truth.unhidden < 1.0);
        if let Some(whole) = hidden.and_then(|one| self.region(one, true)) {
            let regions = regions.get_or_insert_default();
            regions.retain(|region| self.owner(region) != self.target);
            regions.push(whole);
        }
        if let Some(regions) = regions.as_mut().filter(|_| with(Stage::Owner)) {
            regions.retain(|region| self.owner(region) == self.target);
        }
        match regions {
            Some(regions) => MotionMeta { regions, ..seen.unwrap_or_default() }.attach(buffer),
            None => Ok(()),
        }
    }

    fn target(&self) -> Option<&Sighting> {
        self.people.iter().find(|one| Some(one.truth.id) == self.target)
    }

    fn replace_scene(&self, stages: &[Stage], buffer: &mut gst::BufferRef) -> Result<(), glib::BoolError> {
        let Some(mut scene) = SceneMeta::of(buffer).and_then(Result::ok) else { return Ok(()) };
        if stages.contains(&Stage::Motion) {
            scene.camera_motion = self.motion.map(|motion| self.camera_motion(motion));
            scene.coasted_motion = None;
        }
        if stages.contains(&Stage::Regions) {
            scene.foreground = self.foreground(&scene.foreground);
        }
        scene.attach(buffer)
    }

    fn camera_motion(&self, motion: Matrix) -> CameraMotion {
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        // These matrices count from the middle of the first pixel, the metas from its corner.
        let [to_middle, to_corner] = [-0.5, 0.5].map(|by| Homography::translation(by, by));
        let pixels = to_middle.then(&Homography(motion)).then(&to_corner);
        let certain = (0.1 / width).powi(2);
        CameraMotion {
            homography: pixels.scaled(1.0 / width, 1.0 / height),
            covariance: [certain, 0.0, certain],
            inliers: 1000,
        }
    }

    /// A plane of that size in which what is to be seen of somebody is foreground.
    fn foreground(&self, like: &Plane) -> Plane {
        let (wide, high) = (like.width as usize, like.height as usize);
        let (x_px, y_px) =
            (f64::from(self.size.0) / wide.max(1) as f64, f64::from(self.size.1) / high.max(1) as f64);
        let mut pixels = vec![0u8; wide * high];
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let place = ((index % wide) as f64 + 0.5, (index / wide) as f64 + 0.5);
            let place = (place.0 * x_px, place.1 * y_px);
            if self.people.iter().any(|one| one.silhouette.shows(place)) {
                *pixel = 255;
            }
        }
        Plane { pixels: glib::Bytes::from_owned(pixels), ..like.clone() }
    }

    /// What is to be seen of somebody, or all of them that is in the picture.
    fn region(&self, one: &Sighting, whole: bool) -> Option<Region> {
        let (part, outline) = if whole {
            (one.truth.in_view, one.silhouette.outline_of_whole())
        } else {
            (one.truth.visible, one.silhouette.outline_of_visible())
        };
        let inside = outline
            .into_iter()
            .map(|(x, y)| (x.clamp(0.0, f64::from(self.size.0)), y.clamp(0.0, f64::from(self.size.1))));
        let outline: Vec<_> = inside.collect();
        let bounds = Bounds::around(outline.iter().copied()).filter(|_| part >= SPECK)?;
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let contour: Vec<_> = outline.iter().map(|(x, y)| Point { x: x / width, y: y / height }).collect();
        let ends = outline.iter().zip(outline.iter().cycle().skip(1));
        let (length, twice) = ends.fold((0.0, 0.0), |(length, twice), (a, b)| {
            (length + (a.0 - b.0).hypot(a.1 - b.1), twice + a.0 * b.1 - b.0 * a.1)
        });
        let centroid = bounds.centre();
        Some(Region {
            bounds: normalised(bounds, self.size),
            contour,
            perimeter: length / (2.0 * (width + height)),
            area: f64::abs(twice) / 2.0 / (width * height),
            centroid: Point { x: centroid.0 / width, y: centroid.1 / height },
        })
    }

    /// Number of whoever has most of themselves in a region, if anybody has.
    fn owner(&self, region: &Region) -> Option<u32> {
        let Rect { x, y, width, height } = region.bounds;
        let (wide, high) = (f64::from(self.size.0), f64::from(self.size.1));
        let bounds = Bounds { left: x * wide, top: y * high, width: width * wide, height: height * high };
        let parts = self.people.iter().map(|one| (one.silhouette.part_in(&bounds), one.truth.id));
        let owned = parts.filter(|(part, _)| *part >= OWNED);
        owned.max_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, id)| id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{record::GroundTruth, report::made_up};

    fn truth() -> Truth {
        let size = (80, 60);
        let person = made_up::tracked(size).truth.unwrap();
        let beside = Bounds { left: 60.0, ..person.bounds };
        let sighting = |id, bounds: Bounds| {
            Sighting::of_box(GroundTruth { id, bounds, centroid: bounds.centre(), ..person.clone() }, size)
        };
        let people = vec![sighting(1, person.bounds), sighting(2, beside)];
        Truth { motion: None, people, target: Some(1), size }
    }

    fn plane(value: u8) -> Plane {
        Plane { width: 40, height: 30, pixels: glib::Bytes::from_owned(vec![value; 1200]) }
    }

    fn buffer(regions: Vec<Region>) -> gst::Buffer {
        gst::init().unwrap();
        let mut buffer = gst::Buffer::new();
        let writable = buffer.get_mut().unwrap();
        MotionMeta { regions, ..MotionMeta::default() }.attach(writable).unwrap();
        let scene = SceneMeta {
            from_pts: None,
            camera_motion: None,
            coasted_motion: None,
            luma: plane(90),
            chroma: None,
            foreground: plane(7),
            background: plane(90),
        };
        scene.attach(writable).unwrap();
        buffer
    }

    fn replaced(truth: &Truth, stages: &[Stage], mut buffer: gst::Buffer) -> (Vec<Region>, SceneMeta) {
        truth.replace(stages, buffer.get_mut().unwrap()).unwrap();
        let motion = MotionMeta::of(&buffer).unwrap().unwrap();
        (motion.regions, SceneMeta::of(&buffer).unwrap().unwrap())
    }

    #[test]
    fn regions_and_foreground_are_what_is_to_be_seen_of_everybody() {
        let (regions, scene) = replaced(&truth(), &[Stage::Regions], buffer(vec![Region::default()]));
        assert_eq!(regions.len(), 2);
        let bounds = regions[0].bounds;
        assert!((bounds.x - 0.4).abs() < 0.02 && (bounds.height - 0.5).abs() < 0.02, "{bounds:?}");
        assert!((regions[0].area - 0.1).abs() < 0.01, "{regions:?}");
        assert_eq!([scene.foreground.pixels[15 * 40 + 20], scene.foreground.pixels[15 * 40 + 5]], [255, 0]);
        assert_eq!(scene.camera_motion, None);
    }

    #[test]
    fn of_the_owner_s_regions_only_theirs_are_left() {
        let (regions, scene) = replaced(&truth(), &[Stage::Regions, Stage::Owner], buffer(Vec::new()));
        assert!(regions.len() == 1 && regions[0].bounds.x < 0.5, "{regions:?}");
        assert_eq!(scene.foreground.pixels[15 * 40 + 33], 255);
        let nobodys =
            Region { bounds: Rect { x: 0.0, y: 0.0, width: 0.1, height: 0.1 }, ..Region::default() };
        assert!(replaced(&truth(), &[Stage::Owner], buffer(vec![nobodys])).0.is_empty());
    }

    #[test]
    fn who_is_hidden_has_a_region_all_the_same() {
        let mut hidden = truth();
        hidden.people.truncate(1);
        (hidden.people[0].truth.visible, hidden.people[0].truth.unhidden) = (0.0, 0.0);
        assert!(replaced(&hidden, &[Stage::Regions], buffer(Vec::new())).0.is_empty());
        assert_eq!(replaced(&hidden, &[Stage::Hidden], buffer(Vec::new())).0.len(), 1);
        assert!(replaced(&truth(), &[Stage::Hidden], buffer(Vec::new())).0.is_empty());
    }

    #[test]
    fn the_camera_s_motion_is_told_in_the_meta_s_coordinates() {
        // Eight pixels to the right, and half as large around the corner of the first pixel.
        let mut moved = truth();
        moved.motion = Some([[1.0, 0.0, 8.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let motion = replaced(&moved, &[Stage::Motion], buffer(Vec::new())).1.camera_motion.unwrap();
        let there = motion.homography.apply(Point { x: 0.25, y: 0.5 });
        assert!((there.x - 0.35).abs() < 1e-9 && (there.y - 0.5).abs() < 1e-9, "{there:?}");
        moved.motion = Some([[0.5, 0.0, -0.25], [0.0, 0.5, -0.25], [0.0, 0.0, 1.0]]);
        let motion = replaced(&moved, &[Stage::Motion], buffer(Vec::new())).1.camera_motion.unwrap();
        let there = motion.homography.apply(Point { x: 1.0, y: 0.5 });
        assert!((there.x - 0.5).abs() < 1e-9 && (there.y - 0.25).abs() < 1e-9, "{there:?}");
    }
}
