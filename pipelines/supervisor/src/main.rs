// SPDX-License-Identifier: MPL-2.0

//! Runs a pipeline unattended, as `gst-launch-1.0 -e -m` does with somebody there: it ends the stream on Ctrl-C, SIGTERM and
//! SIGHUP, starts anew where the picture is gone, and prints what elements have to say.
//!
//! ```sh
//! CAMERA_PASSWORD=... ptztrack-launch souphttpsrc user-id=operator location=... ! ... ! vapixptzsink user=operator location=...
//! ```
//! Whoever is given a user is logged in with the password in the environment variable `CAMERA_PASSWORD`, so that no list of
//! processes shows it. A `souphttpsrc` or `rtspsrc` is not told it, and an `appsrc` takes the place of the first: they would tell it to
//! anybody who asks for it in the camera's place. `{run}` in an argument is nothing in the first run, then `-2`, `-3` and so on.

use std::cell::Cell;
use std::error::Error;
use std::process::ExitCode;

use gst::prelude::*;
use pipeline_supervisor::LogIn;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(err) => {
            eprintln!("{err}\nNot restarted: it would fail in the same way.");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    gst::init()?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let log_in = LogIn::new(std::env::var("CAMERA_PASSWORD").unwrap_or_default());
    let runs = Cell::new(0);
    let next = || {
        runs.set(runs.get() + 1);
        if runs.get() > 1 {
            eprintln!("The picture is gone; starting anew.");
        }
        pipeline(&arguments, runs.get(), &log_in)
    };
    pipeline_supervisor::run(next, print)
}

fn pipeline(arguments: &[String], run: u32, log_in: &LogIn) -> Result<gst::Pipeline, Box<dyn Error>> {
    let run = if run == 1 { String::new() } else { format!("-{run}") };
    let arguments: Vec<String> = arguments.iter().map(|argument| argument.replace("{run}", &run)).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let pipeline = gst::parse::launchv(&arguments)?
        .downcast::<gst::Pipeline>()
        .map_err(|_| "a pipeline has more than one element")?;
    log_in.apply(&pipeline)?;
    Ok(pipeline)
}

/// Messages as `gst-launch-1.0 -m` has them, but only those that say something to a user.
fn print(message: &gst::Message) {
    let from = || message.src().map_or_else(String::new, |source| source.path_string().to_string());
    match message.view() {
        gst::MessageView::Error(err) => eprintln!("ERROR: {}: {}", from(), err.error()),
        gst::MessageView::Warning(warning) => eprintln!("WARNING: {}: {}", from(), warning.error()),
        gst::MessageView::Info(info) => println!("INFO: {}: {}", from(), info.error()),
        gst::MessageView::Element(element) => {
            if let Some(structure) = element.structure() {
                println!("{structure}");
            }
        }
        _ => {}
    }
}
