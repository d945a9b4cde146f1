// SPDX-License-Identifier: MPL-2.0

//! Everything that computes on pictures: plain types, tested by themselves.
//!
//! A picture's way: `camera_motion` and the background that travels with it (`scene_model`) → moving regions
//! (`detector`) → tracks: everybody, each region with one owner (`tracker/tracks`) → target, the number of a track
//! (`tracker/policy`) → figure and ground near it (`tracker/target`).
//!
//! ## Papers behind the tracks
//!
//! | paper | what is taken from it | where |
//! |---|---|---|
//! | Yi et al., "Detection of moving objects with non-stationary cameras in 5.8 ms", CVPRW 2013 | a background with an age that travels with the camera | `travelling` |
//! | Benhimane and Malis, "Real-time image-based tracking of planes using efficient second-order minimization", IROS 2004 | a picture is laid on the background to parts of a pixel | `travelling/alignment` |
//! | Bewley et al., "Simple online and realtime tracking" (SORT), ICIP 2016 | Kalman filter and Hungarian assignment | `tracker/tracks/track`, `association` |
//! | Aharon et al., "BoT-SORT", 2022 | prediction by the camera's motion | `tracker/tracks/track` |
//! | McKenna et al., "Tracking groups of people", CVIU 2000 | who merge keep their tracks; colours tell who is who after | `tracker/tracks/groups` |
//! | Senior et al., "Appearance models for occlusion handling", IVC 2006 | the nearer feet are in front | `tracker/tracks/groups` |
//! | Bertinetto et al., "Staple", CVPR 2016 | colours of figure and ground | `tracker/colour` |
//! | Lewis, "Fast normalized cross-correlation", Vision Interface 1995 | the target's greys | `tracker/figure/grey_template` |
//!
//! ## Equations of the thesis
//!
//! | equation | what it says | where |
//! |---|---|---|
//! | 3.1 | running mean of every pixel | `background` |
//! | 3.2 | variance over the last pictures | `background` |
//! | 3.3 | what lies far from the mean is foreground | `background` |
//! | 3.4, 3.5 | dilation and erosion | `morphology`, `bits` |
//! | 3.6, 3.7 | gradient matrix and corner strength; here its smaller eigenvalue (Shi and Tomasi) | `tracker/corners`, `tracker/corner_strength` |
//! | 3.8 to 3.11 | optical flow by least squares | `lucas_kanade`, for `tracker/flow` and `camera_motion/flow` |
//! | 3.12 | mean-shift vector | `tracker/grey_histogram` |
//! | 3.13 to 3.15 | moments, centre of mass | `tracker/grey_histogram`; of the figure in `tracker/figure` |
//! | 3.16 | average over one second | `TargetEstimator` of crate `servo` |
//!
//! Equation 3.16 as printed averages centroids, which would lag half a second behind; the text beside it speaks of "the
//! object's speed and direction", so rates are averaged.

mod background;
mod bits;
mod blur;
mod cadence;
mod camera_motion;
mod camera_moves;
mod carried_zones;
mod components;
mod contours;
mod coverage;
mod detector;
mod draw;
mod duty;
mod font;
mod ghosts;
mod lucas_kanade;
mod luma;
mod morphology;
mod observation;
mod persistence;
mod picture;
mod presence;
mod projective;
mod reduce;
mod reflections;
mod scene;
mod scene_model;
mod segmentation;
mod stillness;
mod surface;
#[cfg(test)]
mod synthetic;
mod tracker;
mod trail;
mod travelling;
mod zones;

pub use background::{Background, ForegroundTest};
pub use cadence::Cadence;
pub use camera_motion::CameraMotionEstimator;
pub use camera_moves::CameraMoves;
pub use carried_zones::CarriedZones;
pub use contours::{Grid, fill_regions, regions};
pub use detector::{Detector, DetectorConfig, DetectorError, RegionChoice};
pub use draw::{Colour, OverlayRectangle, Pen, Shape};
pub use duty::Duty;
pub use font::text_width;
pub use luma::{Luma, LumaError};
pub use observation::Observation;
pub use picture::{Chroma, Picture, Reduced, Samples};
pub use presence::Presence;
pub use scene::{FrameSize, Parts, Seen, Spot, scene};
pub use scene_model::{SceneModel, SceneView};
pub use surface::{ColourSpace, Component, Surface};
pub use tracker::{
    Choice, Config, Detection, Profile, Released, TargetRequest, TimeLimits, Tracked, Tracker,
};
pub use trail::Trail;
pub use travelling::{TravellingBackground, Way};
pub use zones::{ZoneError, Zones, zone_mask};
