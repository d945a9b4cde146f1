// SPDX-License-Identifier: MPL-2.0

//! A photograph of everything around the camera, with somebody cut out of film, or drawn, walking in it.

mod equirectangular;
mod film;
mod light;
mod obstacle;
mod place;
mod rgba;
mod settings;
mod sprite;
mod way;
mod world;

pub use place::{Lane, PhotoPlace};
pub use settings::{PhotoError, PhotoPerson, PhotoSettings};
pub(crate) use world::Photo;

#[cfg(test)]
mod tests;
