// SPDX-License-Identifier: MPL-2.0

//! The thesis' 72 closed-loop experiments (chapter 5), rerun by anyone: real elements in a real pipeline against the
//! virtual camera, in virtual time, so that the same seed gives the same table on any x86-64 machine.
//!
//! ## What is counted
//! Counting begins with the *first box*: the first picture, with the camera still at home, in which the person's whole
//! box lies inside the view. That is decided before anything runs, so that it is the same picture for every tracker. Those
//! with a detector find the person themselves, all others are given the true box in it (`--first-box given`: all are). It ends with
//! the person's walk. Pictures are counted by when they were taken, whatever the delays.
//!
//! ## Recordings
//! [`Scene::footage`] puts a turning camera into a recording of real people, in closed loop like the tests. Beside them it
//! is counted how often somebody else is followed. [`Scene::recording`] shows a recording as it is to the tracker alone,
//! from the first picture with the person in it to the last, and only what it says of the boxes is judged.

mod album;
mod batch;
pub mod cli;
mod codec;
mod experiment;
mod film;
mod footage;
pub mod gallery;
mod lockstep;
pub mod metrics;
pub mod motchallenge;
pub mod open_loop;
mod people;
mod pipeline;
mod provenance;
pub mod record;
pub mod report;
mod still;
pub mod store;
pub mod strata;
pub mod suite;
mod trackers;
pub mod verdict;

pub use batch::run_all;
pub use experiment::{Experiment, Place, Protocol, Scene, Target};
pub use footage::{SceneError, Whom};
pub use lockstep::run;
pub use people::TruthError;
pub use still::Recording;
pub use trackers::missing;

/// Makes GStreamer and our elements ready; again does nothing.
///
/// OpenCV gets one thread and only those instructions that every processor has: a run shall not depend on how many cores
/// there are or on what they are, and several go on at once. That makes everything that is OpenCV's slower than it is for a
/// user, the trackers of `cvtracker` most of all: what is measured here says nothing of speed.
///
/// # Errors
/// Where GStreamer does not start.
pub fn init() -> Result<(), glib::Error> {
    static READY: std::sync::OnceLock<Result<(), glib::Error>> = std::sync::OnceLock::new();
    let ready = READY.get_or_init(|| {
        gst::init()?;
        opencv::core::set_num_threads(1)
            .and_then(|()| opencv::core::set_use_optimized(false))
            .map_err(|error| glib::Error::new(gst::LibraryError::Init, &error.message))?;
        let register = || {
            gstptztrack::plugin_register_static()?;
            gstvapix::plugin_register_static()?;
            gstonvifptz::plugin_register_static()
        };
        register().map_err(|error| glib::Error::new(gst::CoreError::Failed, &error.message))
    });
    ready.clone()
}
