// SPDX-License-Identifier: MPL-2.0

//! Runs a pipeline until Ctrl-C, SIGTERM or SIGHUP, and starts it anew where it ends for any other reason: the video of a
//! camera that reboots ends, or fails, and `vapixptzsink` alone cannot bring that back.
//!
//! That nothing comes any more is for the pipeline to tell: by `souphttpsrc timeout=1`, or the element `watchdog`.

mod backoff;
mod log_in;
pub mod reach;
mod supervisor;
pub mod video;

use std::error::Error;

pub use backoff::Backoff;
pub use log_in::LogIn;
pub use supervisor::Supervisor;

/// SIGHUP, SIGINT and SIGTERM.
const ENDS: [i32; 3] = [1, 2, 15];

/// Runs what `build` makes, again and again, until the process is told to end; `on_message` hears every message. To be
/// called in the main thread: it runs the default main context. Nothing is started while nobody accepts the connection of a
/// `souphttpsrc`, or `build` ends with a [`video::Failure`] that may pass; standard error says why.
///
/// # Errors
/// Those of [`Supervisor::run`].
pub fn run(
    mut build: impl FnMut() -> Result<gst::Pipeline, Box<dyn Error>>,
    on_message: impl FnMut(&gst::Message) + 'static,
) -> Result<(), Box<dyn Error>> {
    let supervisor = Supervisor::default();
    let signals = ENDS.map(|signal| {
        let supervisor = supervisor.clone();
        glib_unix::unix_signal_add_local(signal, move || {
            supervisor.end();
            glib::ControlFlow::Continue
        })
    });
    let reached = || {
        let pipeline = match build().map_err(|err| err.downcast::<video::Failure>()) {
            Ok(pipeline) => pipeline,
            Err(Ok(failure)) if !failure.refused => {
                eprintln!("{failure}");
                return Ok(None);
            }
            Err(Ok(refused)) => return Err(refused.into()),
            Err(Err(err)) => return Err(err),
        };
        let reached = reach::check_sources(&pipeline).inspect_err(|reason| eprintln!("{reason}"));
        Ok(reached.is_ok().then_some(pipeline))
    };
    let result = supervisor.run(reached, on_message);
    signals.into_iter().for_each(glib::SourceId::remove);
    result
}
