// SPDX-License-Identifier: MPL-2.0

//! A virtual Axis pan-tilt-zoom camera on loopback: VAPIX over HTTP, MJPEG, RTSP, kinematics and a live page.
//!
//! Its world is a wide still recording, a photograph of all around it or a made-up room; the picture is what a turning pinhole camera would see in it,
//! and who is in it and where is known. What is known of the AXIS Q6034-E is its default, what is not known or differs
//! between cameras is a setting. Its time is everybody's, or goes on step by step as its owner says.
//!
//! ```no_run
//! use std::time::Duration;
//! use virtual_camera::{Settings, VirtualCamera};
//!
//! let camera = VirtualCamera::start(Settings::default())?;
//! println!("{}/axis-cgi/mjpg/video.cgi", camera.url());
//! assert!(camera.wait_for(Duration::from_secs(60), |status| status.pan_deg > 5.0));
//! # Ok::<(), virtual_camera::Error>(())
//! ```

mod camera;
mod clock;
mod encode;
mod geometry;
mod http;
mod imaging;
mod kinematics;
mod onvif;
mod pace;
mod picture;
mod rtsp;
mod seeded;
mod settings;
mod status;
mod sync;
mod threads;
mod tls;
mod truth;
mod vapix;
mod wish;
mod world;

pub use camera::VirtualCamera;
pub use encode::EncodeError;
pub use geometry::{Matrix, aim, project};
pub use imaging::Imaging;
pub use kinematics::{
    Head, Kinematics, Limits, Motion, Optics, Pose, ProportionalRule, ProportionalSpeed, Snapshot, SpeedMap,
    ZOOM_RANGE,
};
pub use onvif::{OnvifSettings, Quirk, quirk_table};
pub use picture::{Picture, Plane};
pub use seeded::Seeded;
pub use settings::{Auth, Clock, FootageSettings, Moves, PtzApi, Settings, Stall, Video, World};
pub use status::{Fault, ReceivedCommand, Status};
pub use tls::Tls;
pub use truth::{Bounds, GroundTruth, Kind, Mask, Sighting, Silhouette};
pub use world::{
    Action, Change, Event, FootageError, Lane, Lighting, MotError, Occlusion, People, Person, PhotoError,
    PhotoPerson, PhotoPlace, PhotoSettings, Place, RoomSettings, Subject, SyntheticSettings, Waypoint,
    read_mot,
};

/// Why a camera does not start.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// GStreamer does not start, or lacks something.
    #[error("GStreamer: {0}")]
    GStreamer(#[from] glib::Error),
    /// A part of GStreamer is missing.
    #[error("GStreamer: {0}")]
    Missing(#[from] glib::BoolError),
    /// The recording cannot be shown.
    #[error(transparent)]
    Footage(#[from] FootageError),
    /// A port cannot be had.
    #[error("cannot serve {protocol} on port {port}: {reason}")]
    Port {
        /// HTTP or RTSP.
        protocol: &'static str,
        /// As asked for; 0 is any.
        port: u16,
        /// What the system says.
        reason: String,
    },
    /// It cannot let itself be found.
    #[error("cannot answer who looks for cameras (WS-Discovery, UDP port 3702): {source}")]
    Discovery {
        /// What the system says.
        source: std::io::Error,
    },
    /// TLS cannot be spoken.
    #[error("cannot speak TLS: {reason}")]
    Tls {
        /// What is wrong with the certificate, the key or a port.
        reason: String,
    },
    /// The system gives no thread.
    #[error("cannot start a thread: {source}")]
    Thread {
        /// What the system says.
        source: std::io::Error,
    },
}
