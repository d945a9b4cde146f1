// SPDX-License-Identifier: MPL-2.0

//! The view of a turning camera inside a still recording.

use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

use super::{Exposure, FootageError, World, aspect, blur::motion_blur, timeline::Timeline, warp::warp};
use crate::{
    geometry::{self, Matrix, Pinhole},
    kinematics::{Limits, Optics, Pose},
    picture::Picture,
    settings::Settings,
    sync::lock,
    truth::{Bounds, GroundTruth, Mask, Sighting},
};

/// A pinhole recording by a camera that stands still.
pub(crate) trait Recording: Send {
    /// Width and height in pixels.
    fn size(&self) -> (u32, u32);
    /// Which picture shows the world when.
    fn timeline(&self) -> Arc<Timeline>;
    /// The picture of that number.
    fn picture(&mut self, frame: u64) -> Result<Arc<Picture>, FootageError>;
    /// Who is known to be in it.
    fn people(&self, frame: u64) -> Vec<Person>;
}

/// Somebody in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// The same in all pictures.
    pub id: u32,
    /// In pixels of the recording.
    pub bounds: Bounds,
    /// Part of them that nothing hides, 0 to 1.
    pub unhidden: f64,
}

/// That of the AXIS Q6034-E (thesis, table 5.1).
const MAX_MAGNIFICATION: f64 = 18.0;

/// A recording, seen by a camera that turns and zooms in it.
pub(crate) struct Panorama {
    recording: Mutex<Box<dyn Recording>>,
    recording_size: (u32, u32),
    recording_fov_deg: f64,
    timeline: Arc<Timeline>,
    optics: Optics,
    view_size: (u32, u32),
}

impl Panorama {
    pub fn new(
        recording: Box<dyn Recording>,
        recording_fov_deg: f64,
        wide_fov_deg: f64,
        settings: &Settings,
    ) -> Self {
        let recording_size = recording.size();
        Self {
            recording_size,
            recording_fov_deg,
            timeline: recording.timeline(),
            optics: Optics {
                wide_fov_deg,
                max_magnification: settings.kinematics.max_magnification.unwrap_or(MAX_MAGNIFICATION),
            },
            view_size: settings.video.size.unwrap_or_else(|| default_size(recording_size)),
            recording: Mutex::new(recording),
        }
    }

    fn recording_pinhole(&self) -> Pinhole {
        Pinhole::new(self.recording_size.0, self.recording_size.1, self.recording_fov_deg)
    }

    /// A person of the recording, as they are in a view.
    fn seen(&self, person: &Person, to_view: &Matrix, size: (u32, u32)) -> Option<GroundTruth> {
        let Bounds { left, top, width, height } = person.bounds;
        let corners = [(left, top), (left + width, top), (left + width, top + height), (left, top + height)];
        // Homographies count from the middle of the first pixel, boxes from its edge.
        let seen = corners.map(|(x, y)| geometry::project_ahead(to_view, x - 0.5, y - 0.5));
        let seen = seen.into_iter().collect::<Option<Vec<_>>>()?;
        let bounds = Bounds::around(seen.into_iter().map(|(x, y)| (x + 0.5, y + 0.5)))?;
        let in_view = bounds.part_inside(size);
        let (x, y) = person.bounds.centre();
        let recording = self.recording_pinhole();
        let ray = |place: f64, centre: f64| (place - 0.5 - centre) / recording.focal;
        let direction =
            geometry::aim(&Pose::default(), ray(x, recording.centre_x), ray(y, recording.centre_y));
        Some(GroundTruth {
            id: person.id,
            bounds,
            centroid: bounds.centre(),
            visible: in_view * person.unhidden,
            unhidden: person.unhidden,
            in_view,
            position_m: None,
            direction_deg: Some(direction),
        })
    }
}

impl World for Panorama {
    fn optics(&self) -> Optics {
        self.optics
    }

    /// How far the widest view may turn; narrower ones stay inside all the more.
    fn limits(&self) -> Limits {
        geometry::limits_inside(
            self.optics.wide_fov_deg,
            aspect(self.view_size),
            self.recording_fov_deg,
            aspect(self.recording_size),
        )
    }

    fn view_size(&self) -> (u32, u32) {
        self.view_size
    }

    fn frame_rate(&self) -> f64 {
        self.timeline.frame_rate()
    }

    fn frame_at(&self, time: Duration) -> u64 {
        self.timeline.frame_at(time)
    }

    fn render(&self, exposure: &Exposure, size: (u32, u32)) -> Result<Picture, FootageError> {
        let source = self.overview(exposure.time)?;
        let (view, recording) = (self.pinhole(exposure.opening.zoom_step, size), self.recording_pinhole());
        let luma = geometry::view_to_recording(&exposure.opening, &view, &recording);
        let chroma = geometry::view_to_recording(&exposure.opening, &view.halved(), &recording.halved());
        let mut picture = Picture::grey(size.0, size.1, 0);
        for (index, target) in picture.planes.iter_mut().enumerate() {
            let homography = if index == 0 { &luma } else { &chroma };
            warp(&source.planes[index], target, |x, y| geometry::project(homography, x, y));
        }
        let (x, y) = self.sweep(exposure, size);
        motion_blur(&mut picture, x, y);
        Ok(picture)
    }

    fn people(&self, exposure: &Exposure, size: (u32, u32)) -> Vec<Sighting> {
        let people = lock(&self.recording).people(self.timeline.frame_at(exposure.time));
        let to_view = self.overview_to_view(&exposure.opening, size);
        let seen = people.iter().filter_map(|person| self.seen(person, &to_view, size));
        seen.map(|truth| Sighting::of_box(truth, size)).collect()
    }

    fn silhouette(&self, _: &Exposure, _: (u32, u32)) -> Option<Mask> {
        None
    }

    /// The whole recording at a time.
    fn overview(&self, time: Duration) -> Result<Arc<Picture>, FootageError> {
        lock(&self.recording).picture(self.timeline.frame_at(time))
    }

    fn overview_size(&self) -> (u32, u32) {
        self.recording_size
    }

    fn overview_view(&self) -> (Pose, Pinhole) {
        (Pose::default(), self.recording_pinhole())
    }
}

/// 640 pixels wide, as high as the recording's shape has it.
fn default_size(recording: (u32, u32)) -> (u32, u32) {
    let height = (640.0 * aspect(recording) / 2.0).round() as u32 * 2;
    (640, height)
}
