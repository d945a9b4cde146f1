//! What there is to see: a still wide picture that moves, and the view cut out of it.

mod blur;
mod footage;
mod panorama;
mod room;
mod synthetic;
mod timeline;
mod warp;

use std::sync::Arc;

pub use footage::FootageError;
pub(crate) use panorama::{Exposure, Panorama};
pub use room::{Change, Lighting, Occlusion, RoomSettings, Subject};
pub use synthetic::{SyntheticSettings, Waypoint};
use timeline::Timeline;

use crate::{
    picture::Picture,
    settings::{Settings, World},
};

/// A pinhole recording by a camera that stands still.
pub(crate) trait Recording: Send {
    /// Width and height in pixels.
    fn size(&self) -> (u32, u32);
    /// Which picture shows the world when.
    fn timeline(&self) -> Arc<Timeline>;
    /// The picture of that number.
    fn picture(&mut self, frame: u64) -> Result<Arc<Picture>, FootageError>;
}

/// Opens the world of a camera and looks how much of it a view shows.
pub(crate) fn open(settings: &Settings) -> Result<Panorama, FootageError> {
    let (recording, recording_fov_deg, wide_fov_deg): (Box<dyn Recording>, f64, f64) = match &settings.world {
        World::Footage(footage) => {
            let half = (footage.recording_fov_deg / 2.0).to_radians().tan();
            let wide = 2.0 * (footage.view_width * half).atan().to_degrees();
            (Box::new(footage::Footage::open(footage)?), footage.recording_fov_deg, wide)
        }
        World::Synthetic(synthetic) => (
            Box::new(synthetic::Synthetic::new(synthetic)),
            synthetic.recording_fov_deg,
            synthetic.wide_fov_deg,
        ),
    };
    Ok(Panorama::new(recording, recording_fov_deg, wide_fov_deg, settings))
}
