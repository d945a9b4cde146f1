// SPDX-License-Identifier: MPL-2.0

//! Who was followed, when and where: one [`Sighting`] for each track that was the target of a camera.
//!
//! ```text
//! pictures ─ Collector ─▶ Sighting ─▶ Store, one writer ─▶ events.db ─▶ Reader, anybody
//! ```
//!
//! Nothing here knows GStreamer, HTTP or a camera.

mod clock;
mod collector;
mod crop;
mod file;
mod filter;
mod looks;
mod reader;
mod sighting;
mod store;

pub use collector::{Collector, Ended, Target};
pub use crop::{Crop, sharpness};
pub use file::{Error, FILE};
pub use filter::{Area, Filter};
pub use looks::Looks;
pub use reader::{Entry, Reader};
pub use sighting::{Picture, Pointer, Sighting, Step};
pub use store::{Retention, Store};
