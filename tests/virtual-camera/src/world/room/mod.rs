//! A made-up room around the camera, with one person walking in it.

pub(crate) mod light;
mod raster;
mod scene;
mod sensor;
mod settings;
pub(crate) mod view;
mod walker;
mod world;

pub use settings::{Change, Lighting, Occlusion, RoomSettings, Subject};
pub(crate) use world::Room;
