// SPDX-License-Identifier: MPL-2.0

//! Made-up pictures and the elements they go through, for what is measured here: see `docs/benchmarks.md`.

mod footage;
mod stages;

pub use footage::{Camera, Footage};
pub use stages::{Stage, Stages};
