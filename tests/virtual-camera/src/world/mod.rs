// SPDX-License-Identifier: MPL-2.0

//! What there is to see: something around the camera, and the view of it.

mod blur;
mod footage;
mod layer;
mod mot;
mod panorama;
mod photo;
pub(crate) mod room;
mod sensor;
mod sighting;
mod synthetic;
mod timeline;
mod warp;

use std::{sync::Arc, time::Duration};

pub use footage::FootageError;
pub use mot::{MotError, People, read as read_mot};
use panorama::Panorama;
pub use panorama::Person;
pub use photo::{Lane, PhotoError, PhotoPerson, PhotoPlace, PhotoSettings};
pub use room::{Action, Change, Event, Lighting, Occlusion, Place, RoomSettings, Subject};
pub(crate) use sensor::LONGEST_SHUTTER;
pub use synthetic::{SyntheticSettings, Waypoint};
pub(crate) use warp::warp;

use crate::{
    geometry::{self, Matrix, Pinhole},
    kinematics::{Limits, Optics, Pose},
    picture::Picture,
    settings::{self, Settings},
    truth::{Mask, Sighting},
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
    /// How long the shutter is open.
    pub duration: Duration,
}

impl Exposure {
    /// Only a moment.
    pub fn at(time: Duration, pose: Pose) -> Self {
        Self { time, opening: pose, closing: pose, duration: Duration::ZERO }
    }

    /// Where the camera looks when a part of it, 0 to 1, is over.
    pub fn pose(&self, share: f64) -> Pose {
        let between = |from: f64, to: f64| from + (to - from) * share;
        let (from, to) = (&self.opening, &self.closing);
        Pose {
            pan_deg: between(from.pan_deg, to.pan_deg),
            tilt_deg: between(from.tilt_deg, to.tilt_deg),
            zoom_step: between(from.zoom_step, to.zoom_step),
        }
    }
}

/// What a turning and zooming camera can be put into.
pub(crate) trait World: Send + Sync {
    /// The lens it is seen through.
    fn optics(&self) -> Optics;
    /// How far the camera turns in it.
    fn limits(&self) -> Limits;
    /// Width and height in pixels that the camera sends unless asked for others.
    fn view_size(&self) -> (u32, u32);
    /// Pictures per second unless asked for others.
    fn frame_rate(&self) -> f64;
    /// Number of the world's picture at a time.
    fn frame_at(&self, time: Duration) -> u64;
    /// How long the shutter is open at a time where it is set to `set`: longer where it is dim, as cameras do by
    /// themselves, but no longer than [`LONGEST_SHUTTER`] times that.
    fn shutter(&self, set: Duration, _time: Duration) -> Duration {
        set
    }
    /// What the sensor catches, at any `size`.
    fn render(&self, exposure: &Exposure, size: (u32, u32)) -> Result<Picture, FootageError>;
    /// Who is there as the shutter opens, wherever the camera looks, and in what shape.
    fn people(&self, exposure: &Exposure, size: (u32, u32)) -> Vec<Sighting>;
    /// Where people are seen as the shutter opens, if that is known to the pixel.
    fn silhouette(&self, exposure: &Exposure, size: (u32, u32)) -> Option<Mask>;
    /// All of it, or a good part, in one wide still picture.
    fn overview(&self, time: Duration) -> Result<Arc<Picture>, FootageError>;
    /// Width and height of the overview in pixels.
    fn overview_size(&self) -> (u32, u32);
    /// Where the overview looks, and through which pinhole.
    fn overview_view(&self) -> (Pose, Pinhole);

    /// The pinhole of a view of `size`. One relatively taller than the camera's own shows less at its sides, not more
    /// above.
    fn pinhole(&self, zoom_step: f64, size: (u32, u32)) -> Pinhole {
        let half_width = (self.optics().fov_deg(zoom_step) / 2.0).to_radians().tan();
        let narrowed = half_width * (aspect(self.view_size()) / aspect(size)).min(1.0);
        Pinhole::new(size.0, size.1, 2.0 * narrowed.atan().to_degrees())
    }

    /// By how many pixels the middle of a picture moves to the right and down while it is exposed.
    fn sweep(&self, exposure: &Exposure, size: (u32, u32)) -> (f64, f64) {
        let view = |pose: &Pose| self.pinhole(pose.zoom_step, size);
        let (opening, closing) = (view(&exposure.opening), view(&exposure.closing));
        let moved = geometry::between((&exposure.opening, &opening), (&exposure.closing, &closing));
        let (x, y) = geometry::project(&moved, opening.centre_x, opening.centre_y);
        (x - opening.centre_x, y - opening.centre_y)
    }

    /// From a pixel of the overview to the pixel of a view of `size`.
    fn overview_to_view(&self, pose: &Pose, size: (u32, u32)) -> Matrix {
        let (looking, overview) = self.overview_view();
        geometry::between((&looking, &overview), (pose, &self.pinhole(pose.zoom_step, size)))
    }

    /// The corners of a view in the overview, from 0 to 1 of its width and height inside; none where the view reaches
    /// behind it.
    fn outline(&self, pose: &Pose) -> Vec<(f64, f64)> {
        let (view_size, (looking, overview)) = (self.view_size(), self.overview_view());
        let homography =
            geometry::between((pose, &self.pinhole(pose.zoom_step, view_size)), (&looking, &overview));
        let [right, bottom] = [view_size.0, view_size.1].map(|length| f64::from(length) - 0.5);
        let [width, height] = [self.overview_size().0, self.overview_size().1].map(f64::from);
        let corners = [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)];
        let seen = corners.iter().map(|&(x, y)| {
            let (u, v) = geometry::project_ahead(&homography, x, y)?;
            Some(((u + 0.5) / width, (v + 0.5) / height))
        });
        seen.collect::<Option<Vec<_>>>().unwrap_or_default()
    }
}

/// Opens the world of a camera and looks how much of it a view shows.
pub(crate) fn open(settings: &Settings) -> Result<Box<dyn World>, FootageError> {
    Ok(match &settings.world {
        settings::World::Footage(footage) => {
            let half = (footage.recording_fov_deg / 2.0).to_radians().tan();
            let wide = 2.0 * (footage.view_width * half).atan().to_degrees();
            let recording = Box::new(footage::Footage::open(footage)?);
            Box::new(Panorama::new(recording, footage.recording_fov_deg, wide, settings))
        }
        settings::World::Photo(photo) => Box::new(photo::Photo::new(photo, settings)?),
        settings::World::Room(room) => Box::new(room::Room::new(room, settings)),
        settings::World::Synthetic(synthetic) => {
            let recording = Box::new(synthetic::Synthetic::new(synthetic));
            Box::new(Panorama::new(recording, synthetic.recording_fov_deg, synthetic.wide_fov_deg, settings))
        }
    })
}

/// Height over width.
pub(crate) fn aspect(size: (u32, u32)) -> f64 {
    f64::from(size.1) / f64::from(size.0)
}
