// SPDX-License-Identifier: MPL-2.0

//! Flat surfaces in true perspective: which pixels they cover, and with what.

mod brush;
mod cover;
mod surface;
mod texture;

pub(super) use cover::cover;
pub(super) use surface::{LightMap, Surface};
pub(super) use texture::{Detail, Material, Texture};
