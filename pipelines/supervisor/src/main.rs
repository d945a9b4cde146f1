// SPDX-License-Identifier: MPL-2.0

//! Runs a pipeline unattended, as `gst-launch-1.0 -e -m` does with somebody there: it ends the stream on Ctrl-C, SIGTERM and
//! SIGHUP, starts anew where the picture is gone, and prints what elements have to say: a fault
//! once, however often it is tried again.
//!
//! ```sh
//! CAMERA_PASSWORD=... ptztrack-launch souphttpsrc user-id=operator location=... ! ... ! vapixptzsink user=operator location=...
//! ```
//! Whoever is given a user is logged in with the password in the environment variable `CAMERA_PASSWORD`, so that no list of
//! processes shows it. A `souphttpsrc` or `rtspsrc` is not told it, and an `appsrc` takes the place of the first: they would tell it to
//! anybody who asks for it in the camera's place. `{run}` in an argument is nothing in the first run, then `-2`, `-3` and so on.

mod teller;

use std::cell::RefCell;
use std::error::Error;
use std::io::{stderr, stdout};
use std::process::ExitCode;
use std::rc::Rc;
use std::time::Duration;

use gst::prelude::*;
use pipeline_supervisor::LogIn;
use teller::{Teller, run_suffix};

/// A fault that comes and goes is told no more often.
const QUIET: Duration = Duration::from_secs(5);

fn main() -> ExitCode {
    let log_in = Rc::new(LogIn::new(std::env::var("CAMERA_PASSWORD").unwrap_or_default()));
    let teller = Rc::new(RefCell::new(Teller::new(log_in.clone(), stdout(), stderr(), QUIET)));
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let hears = teller.clone();
    let next = || {
        let run = teller.borrow_mut().next_run();
        let pipeline = pipeline(&arguments, run)?;
        teller.borrow_mut().watch(&pipeline);
        log_in.apply(&pipeline)?;
        Ok(pipeline)
    };
    let result = gst::init()
        .map_err(Into::into)
        .and_then(|()| pipeline_supervisor::run(next, move |message| hears.borrow_mut().hear(message)));
    teller.borrow_mut().end(&result);
    if result.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn pipeline(arguments: &[String], run: u32) -> Result<gst::Pipeline, Box<dyn Error>> {
    let arguments = arguments.iter().map(|argument| argument.replace("{run}", &run_suffix(run)));
    let arguments: Vec<String> = arguments.collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let pipeline = gst::parse::launchv(&arguments)?.downcast::<gst::Pipeline>();
    Ok(pipeline.map_err(|_| "a pipeline has more than one element")?)
}
