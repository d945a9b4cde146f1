//! The view of a turning camera inside a still recording.

use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

use super::{FootageError, Recording, blur::motion_blur, timeline::Timeline, warp::warp};
use crate::{
    geometry::{self, Matrix, Pinhole},
    kinematics::{Limits, Optics, Pose},
    picture::Picture,
    settings::Settings,
    sync::lock,
};

/// One picture's worth of light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Exposure {
    /// When the shutter opens, since the camera's start.
    pub time: Duration,
    /// Where the camera looks then.
    pub opening: Pose,
    /// Where it looks when the shutter closes.
    pub closing: Pose,
}

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
            optics: Optics { wide_fov_deg, max_magnification: settings.kinematics.max_magnification },
            view_size: settings.video.size.unwrap_or_else(|| default_size(recording_size)),
            recording: Mutex::new(recording),
        }
    }

    pub fn optics(&self) -> Optics {
        self.optics
    }

    /// Width and height in pixels that the camera sends unless asked for others.
    pub fn view_size(&self) -> (u32, u32) {
        self.view_size
    }

    pub fn frame_rate(&self) -> f64 {
        self.timeline.frame_rate()
    }

    /// How far the widest view may turn; narrower ones stay inside all the more.
    pub fn limits(&self) -> Limits {
        geometry::limits_inside(
            self.optics.wide_fov_deg,
            aspect(self.view_size),
            self.recording_fov_deg,
            aspect(self.recording_size),
        )
    }

    pub fn frame_at(&self, time: Duration) -> u64 {
        self.timeline.frame_at(time)
    }

    /// The whole recording at a time.
    pub fn overview(&self, time: Duration) -> Result<Arc<Picture>, FootageError> {
        lock(&self.recording).picture(self.timeline.frame_at(time))
    }

    /// From a pixel of the recording to the pixel of a view of `size`.
    pub fn recording_to_view(&self, pose: &Pose, size: (u32, u32)) -> Matrix {
        geometry::recording_to_view(pose, &self.view(pose, size), &self.pinhole())
    }

    /// From a pixel of a view of `size` to the pixel of the recording.
    pub fn view_to_recording(&self, pose: &Pose, size: (u32, u32)) -> Matrix {
        geometry::view_to_recording(pose, &self.view(pose, size), &self.pinhole())
    }

    /// The corners of a view in the recording, from 0 to 1 of its width and height.
    pub fn outline(&self, pose: &Pose) -> [(f64, f64); 4] {
        let homography = self.view_to_recording(pose, self.view_size);
        let [right, bottom] = [self.view_size.0, self.view_size.1].map(|length| f64::from(length) - 0.5);
        [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)].map(|(x, y)| {
            let (u, v) = geometry::project(&homography, x, y);
            let (width, height) = self.recording_size;
            ((u + 0.5) / f64::from(width), (v + 0.5) / f64::from(height))
        })
    }

    /// What the sensor catches, at any `size`.
    pub fn render(&self, exposure: &Exposure, size: (u32, u32)) -> Result<Picture, FootageError> {
        let source = self.overview(exposure.time)?;
        let (view, recording) = (self.view(&exposure.opening, size), self.pinhole());
        let luma = geometry::view_to_recording(&exposure.opening, &view, &recording);
        let chroma = geometry::view_to_recording(&exposure.opening, &view.halved(), &recording.halved());
        let mut picture = Picture::grey(size.0, size.1, 0);
        for (index, target) in picture.planes.iter_mut().enumerate() {
            let homography = if index == 0 { &luma } else { &chroma };
            warp(&source.planes[index], target, homography);
        }
        let centre = (view.centre_x, view.centre_y);
        let (x, y) = geometry::project(&luma, centre.0, centre.1);
        let (x, y) = geometry::project(&self.recording_to_view(&exposure.closing, size), x, y);
        motion_blur(&mut picture, x - centre.0, y - centre.1);
        Ok(picture)
    }

    fn pinhole(&self) -> Pinhole {
        Pinhole::new(self.recording_size.0, self.recording_size.1, self.recording_fov_deg)
    }

    /// The pinhole of a view. One relatively taller than the camera's own shows less at its sides, not more above.
    fn view(&self, pose: &Pose, size: (u32, u32)) -> Pinhole {
        let half_width = (self.optics.fov_deg(pose.zoom_step) / 2.0).to_radians().tan();
        let narrowed = half_width * (aspect(self.view_size) / aspect(size)).min(1.0);
        Pinhole::new(size.0, size.1, 2.0 * narrowed.atan().to_degrees())
    }
}

fn aspect(size: (u32, u32)) -> f64 {
    f64::from(size.1) / f64::from(size.0)
}

/// 640 pixels wide, as high as the recording's shape has it.
fn default_size(recording: (u32, u32)) -> (u32, u32) {
    let height = (640.0 * aspect(recording) / 2.0).round() as u32 * 2;
    (640, height)
}
