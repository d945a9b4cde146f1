//! ptztrack inside a Rust program: prints what happens to the target until Ctrl-C.
//!
//! ```sh
//! GST_PLUGIN_PATH=target/release cargo run --release --example follow -- http://192.168.0.90 [USER]
//! ```
//! The password comes from the environment variable `CAMERA_PASSWORD`, so that no list of processes shows it.

use std::error::Error;

use gst::prelude::*;
use ptztrack_contract::TargetMessage;

const SIGINT: i32 = 2;

const PIPELINE: &str = "souphttpsrc name=source is-live=true do-timestamp=true ! multipartdemux ! jpegdec \
    ! queue leaky=downstream max-size-buffers=1 ! bgavgdetect ! lkfeaturetrack ! vapixptzsink name=servo";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let camera = arguments.next().ok_or("usage: follow http://CAMERA [USER]")?;
    gst::init()?;
    let pipeline = gst::parse::launch(PIPELINE)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
    let source = pipeline.by_name("source").ok_or("no source")?;
    let servo = pipeline.by_name("servo").ok_or("no servo")?;
    source.set_property("location", format!("{camera}/axis-cgi/mjpg/video.cgi"));
    servo.set_property("location", &camera);
    if let Some(user) = arguments.next() {
        let password = std::env::var("CAMERA_PASSWORD").unwrap_or_default();
        source.set_property("user-id", &user);
        source.set_property("user-pw", &password);
        servo.set_property("user", &user);
        servo.set_property("password", &password);
    }

    let main_loop = glib::MainLoop::new(None, false);
    let bus = pipeline.bus().ok_or("no bus")?;
    let stop = main_loop.clone();
    let _watch = bus.add_watch(move |_, message| {
        if show(message) {
            stop.quit();
        }
        glib::ControlFlow::Continue
    })?;
    // Ctrl-C ends the stream; the sink has stopped the camera when the end arrives.
    let interrupted = pipeline.clone();
    glib_unix::unix_signal_add(SIGINT, move || {
        interrupted.send_event(gst::event::Eos::new());
        glib::ControlFlow::Continue
    });
    pipeline.set_state(gst::State::Playing)?;
    main_loop.run();
    pipeline.set_state(gst::State::Null)?;
    Ok(())
}

/// Prints what there is to tell; says whether it is over.
fn show(message: &gst::Message) -> bool {
    match message.view() {
        gst::MessageView::Eos(_) => return true,
        gst::MessageView::Error(err) => {
            eprintln!("{}", err.error());
            return true;
        }
        gst::MessageView::Element(element) => {
            if let Some(Ok(target)) = element.structure().map(TargetMessage::from_structure) {
                println!("target {} {}", target.id, target.change.name());
            }
        }
        _ => (),
    }
    false
}
