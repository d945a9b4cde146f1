// SPDX-License-Identifier: MPL-2.0

//! ptztrack inside a Rust program: prints what happens to the target until Ctrl-C, SIGTERM or SIGHUP. Where the picture is
//! gone, as when the camera reboots, it starts anew until it is back.
//!
//! ```sh
//! GST_PLUGIN_PATH=target/release cargo run --release --example follow -- http://192.168.0.90 [USER]
//! ```
//! The password comes from the environment variable `CAMERA_PASSWORD`, so that no list of processes shows it.

use std::error::Error;

use gst::prelude::*;
use pipeline_supervisor::LogIn;
use ptztrack_contract::TargetMessage;

/// A source that hears nothing for a second fails, so that it is started anew.
const PIPELINE: &str = "souphttpsrc name=source is-live=true do-timestamp=true timeout=1 retries=0 ! multipartdemux \
    ! jpegdec ! queue leaky=downstream max-size-buffers=1 ! bgavgdetect ! lkfeaturetrack ! vapixptzsink name=servo";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let camera = arguments.next().ok_or("usage: follow http://CAMERA [USER]")?;
    let user = arguments.next();
    gst::init()?;
    let log_in = LogIn::new(std::env::var("CAMERA_PASSWORD").unwrap_or_default());
    // The sink has stopped the camera when this is over.
    pipeline_supervisor::run(move || pipeline(&camera, user.as_deref(), &log_in), show)
}

fn pipeline(camera: &str, user: Option<&str>, log_in: &LogIn) -> Result<gst::Pipeline, Box<dyn Error>> {
    let pipeline = gst::parse::launch(PIPELINE)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
    let source = pipeline.by_name("source").ok_or("no source")?;
    let servo = pipeline.by_name("servo").ok_or("no servo")?;
    source.set_property("location", format!("{camera}/axis-cgi/mjpg/video.cgi"));
    servo.set_property("location", camera);
    if let Some(user) = user {
        source.set_property("user-id", user);
        servo.set_property("user", user);
    }
    // The source would tell a password to anybody who asks for it in the camera's place.
    log_in.apply(&pipeline)?;
    Ok(pipeline)
}

/// Prints what there is to tell.
fn show(message: &gst::Message) {
    match message.view() {
        gst::MessageView::Error(err) => eprintln!("{}", err.error()),
        gst::MessageView::Element(element) => {
            if let Some(Ok(target)) = element.structure().map(TargetMessage::from_structure) {
                println!("target {} {}", target.id, target.change.name());
            }
        }
        _ => (),
    }
}
