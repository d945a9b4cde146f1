//! A made-up room around the camera, with one person walking in it.

pub(crate) mod light;
pub(crate) mod view;
