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

use std::cell::RefCell;
use std::error::Error;
use std::rc::Rc;

pub use backoff::Backoff;
pub use log_in::LogIn;
pub use supervisor::Supervisor;

/// SIGHUP, SIGINT and SIGTERM.
const ENDS: [i32; 3] = [1, 2, 15];

/// Runs what `build` makes, again and again, until the process is told to end; `on_message` hears every message. To be
/// called in the main thread: it runs the default main context. Nothing is started while nobody accepts the connection of a
/// `souphttpsrc`, or `build` ends with a [`video::Failure`] that may pass; an error of no element says why.
///
/// # Errors
/// Those of [`Supervisor::run`], and an address of a `souphttpsrc` that is none.
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
    let on_message = Rc::new(RefCell::new(on_message));
    let hears = on_message.clone();
    let reached = || {
        let built = build().and_then(|pipeline| reach::check_sources(&pipeline).map(|()| pipeline));
        match built.map_err(|err| err.downcast::<video::Failure>()) {
            Ok(pipeline) => Ok(Some(pipeline)),
            Err(Ok(failure)) if !failure.refused => {
                let said = gst::message::Error::new(gst::ResourceError::OpenRead, &failure.reason);
                on_message.borrow_mut()(&said);
                Ok(None)
            }
            Err(Ok(refused)) => Err(refused.into()),
            Err(Err(err)) => Err(err),
        }
    };
    let result = supervisor.run(reached, move |message| hears.borrow_mut()(message));
    signals.into_iter().for_each(glib::SourceId::remove);
    result
}
