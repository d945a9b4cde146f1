//! A made-up room around the camera, with one person walking in it.

pub(crate) mod light;
mod settings;
pub(crate) mod view;

pub use settings::{Change, Lighting, Occlusion, RoomSettings, Subject};
