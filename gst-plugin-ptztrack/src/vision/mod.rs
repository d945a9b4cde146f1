//! Everything that computes on pictures: plain types, tested by themselves.

mod afterimage;
mod background;
mod camera_motion;
mod contours;
mod detector;
mod draw;
mod duty;
mod luma;
mod morphology;
mod persistence;
mod picture;
mod presence;
mod reduce;
mod region_tracks;
mod scene;
mod scene_model;
mod segmentation;
#[cfg(test)]
mod synthetic;
mod tracker;
mod trail;
mod travelling;
mod zones;

pub use background::{Background, Criterion, ForegroundTest};
pub use camera_motion::CameraMotionEstimator;
pub use contours::{Grid, fill_regions, regions};
pub use detector::{Detector, DetectorConfig, DetectorError, RegionChoice};
pub use draw::{Colour, Patch, Shape, draw, text_width};
pub use duty::Duty;
pub use luma::{Luma, LumaError};
pub use picture::{Chroma, Picture, Reduced, Samples};
pub use presence::Presence;
pub use scene::{FrameSize, Parts, Seen, Spot, scene};
pub use scene_model::{SceneModel, SceneView};
pub use tracker::{Choice, Config, Detection, Limits, Profile, Report, Tracker};
pub use trail::Trail;
pub use travelling::TravellingBackground;
pub use zones::{ZoneError, Zones, zone_mask};
