// SPDX-License-Identifier: MPL-2.0

//! A made-up room around the camera, with people walking in it.

mod action;
mod effects;
mod event;
pub(crate) mod light;
mod raster;
mod scene;
mod settings;
pub(crate) mod view;
pub(in crate::world) mod walker;
mod weather;
mod world;

pub use action::Action;
pub use event::Event;
pub use settings::{Change, Lighting, Occlusion, Place, RoomSettings, Subject};
pub(crate) use world::Room;
