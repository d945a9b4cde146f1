// SPDX-License-Identifier: MPL-2.0

//! An application that follows unattended while everything happens to it: run by `soak`, one process for each camera.
//!
//! `unattended mjpeg|h264 SEED`, with CAMERA, RTSP, CAMERA_USER and CAMERA_PASSWORD in the environment. At random, by the
//! seed, it changes the size of its pictures in mid-stream, and takes its pipeline to READY and back.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::cell::RefCell;
use std::env::var;
use std::rc::Rc;
use std::time::Duration;

use end_to_end::Chance;
use gst::prelude::*;

/// From one change to the next, s.
const EVERY_S: (u64, u64) = (3, 20);
const SIZES: [(i32, i32); 3] = [(320, 240), (240, 180), (176, 144)];

const MJPEG: &str =
    "souphttpsrc name=source is-live=true do-timestamp=true timeout=1 retries=0 ! multipartdemux ! jpegdec";
const H264: &str = "rtspsrc name=source latency=0 protocols=tcp ! tee name=received \
    received. ! watchdog timeout=1200 ! fakesink sync=false async=false received. ! rtph264depay ! avdec_h264";
const FOLLOW: &str = "videoscale ! capsfilter name=size ! queue leaky=downstream max-size-buffers=1 ! bgavgdetect \
    ! lkfeaturetrack ! tee name=followed followed. ! queue leaky=downstream max-size-buffers=1 ! ptzoverlay ! fakesink \
    followed. ! queue leaky=downstream max-size-buffers=1 ! vapixptzsink name=servo";

/// The pipeline that runs now.
type Current = Rc<RefCell<Option<gst::Pipeline>>>;

fn main() {
    gst::init().unwrap();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let rtsp = match arguments[0].as_str() {
        "mjpeg" => false,
        "h264" => true,
        other => panic!("codec {other}?"),
    };
    let current = Current::default();
    disturb(current.clone(), Chance::new(arguments[1].parse().unwrap()));
    let build = || {
        let pipeline = pipeline(rtsp);
        current.replace(Some(pipeline.clone()));
        Ok(pipeline)
    };
    pipeline_supervisor::run(build, |_| ()).unwrap();
}

fn pipeline(rtsp: bool) -> gst::Pipeline {
    let (source, location) = match rtsp {
        false => {
            (MJPEG, format!("{}/axis-cgi/mjpg/video.cgi?resolution=320x240&fps=15", var("CAMERA").unwrap()))
        }
        true => (
            H264,
            format!("{}/axis-media/media.amp?videocodec=h264&resolution=320x240", var("RTSP").unwrap()),
        ),
    };
    let pipeline = gst::parse::launch(&format!("{source} ! {FOLLOW}")).unwrap();
    let pipeline = pipeline.downcast::<gst::Pipeline>().unwrap();
    let (user, password) = (var("CAMERA_USER").unwrap(), var("CAMERA_PASSWORD").unwrap());
    let element = |name: &str| pipeline.by_name(name).unwrap();
    element("source").set_property("location", location);
    element("source").set_property("user-id", &user);
    element("source").set_property("user-pw", &password);
    element("servo").set_property("location", var("CAMERA").unwrap());
    element("servo").set_property("user", user);
    element("servo").set_property("password", password);
    pipeline
}

/// Disturbs what runs now, and again after a while.
fn disturb(current: Current, mut chance: Chance) {
    let after = Duration::from_secs(chance.within(EVERY_S));
    glib::timeout_add_local_once(after, move || {
        // One that has failed is left alone: it is over.
        let runs = |pipeline: &&gst::Pipeline| pipeline.current_state() > gst::State::Ready;
        if let Some(pipeline) = current.borrow().as_ref().filter(runs) {
            if chance.within((0, 3)) == 0 {
                // Where either fails, a message says so, and the pipeline is built anew.
                let _ = pipeline.set_state(gst::State::Ready);
                let _ = pipeline.set_state(gst::State::Playing);
            } else {
                let (width, height) = SIZES[chance.within((0, SIZES.len() as u64)) as usize];
                let caps =
                    gst::Caps::builder("video/x-raw").field("width", width).field("height", height).build();
                pipeline.by_name("size").unwrap().set_property("caps", caps);
            }
        }
        disturb(current, chance);
    });
}
