// SPDX-License-Identifier: MPL-2.0

//! What is fuzzed: each parser of something that others say. `scripts/fuzz` feeds them; a test of the whole runs all of them over the
//! seeds in `corpus`.
#![allow(missing_docs, clippy::expect_used)]

mod camera;
mod others;
mod structure;
mod video;

pub use camera::*;
pub use others::*;
pub use video::*;

/// A target: takes anything, says whether it was understood, and never panics.
pub type Target = fn(&[u8]) -> bool;

pub const TARGETS: [(&str, Target); 23] = [
    ("challenge", challenge),
    ("position", position),
    ("limits", limits),
    ("attributes", attributes),
    ("move_speed", move_speed),
    ("parameters", parameters),
    ("queue", queue),
    ("presets", presets),
    ("cookies", cookies),
    ("onvif", onvif),
    ("location", location),
    ("rtsp", rtsp),
    ("media", media),
    ("multipart", multipart),
    ("picture", picture),
    ("configuration", configuration),
    ("page", page),
    ("log_in", log_in),
    ("broker", broker),
    ("word", word),
    ("tracks", tracks),
    ("watchdog", watchdog),
    ("structure", structure),
];

/// As who hears it reads it.
fn text(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}
