// SPDX-License-Identifier: MPL-2.0

//! How fast the room is painted and encoded, on one core: `cargo run --release -p virtual-camera --example speed -- [WxH]`.
//!
//! The camera turns all the while, so that every picture is another one, and blurred. Counted is processor time, of
//! all threads together, so that it matters little what else the machine does.

use std::{error::Error, time::Duration};

use gst::prelude::*;
use virtual_camera::{Auth, Clock, Picture, RoomSettings, Settings, VirtualCamera, World};

/// Seconds of the room that are painted.
const PAINTED_S: u32 = 6;
const CODECS: [(&str, &str); 3] = [
    ("nothing", "identity"),
    ("jpegenc", "jpegenc quality=70"),
    ("avenc_mpeg4", "avenc_mpeg4 pass=quant quantizer=5"),
];

fn main() -> Result<(), Box<dyn Error>> {
    gst::init()?;
    let size = std::env::args().nth(1).unwrap_or_else(|| "1280x720".into());
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let size = (width.parse()?, height.parse()?);
    for (name, encoder) in CODECS {
        println!("{}x{} into {name}: {:.1} times real time", size.0, size.1, speed(encoder, size)?);
    }
    Ok(())
}

fn speed(encoder: &str, size: (u32, u32)) -> Result<f64, Box<dyn Error>> {
    let room = RoomSettings::test(1, 1).ok_or("no such test")?;
    let settings =
        Settings { auth: Auth::None, world: World::Room(room), clock: Clock::Stepped, ..Settings::default() };
    let camera = VirtualCamera::start(Settings { service_time: Duration::ZERO, ..settings })?;
    // A slow turn to the right.
    if !camera.operate("continuouspantiltmove=5,0") {
        return Err("the camera does not turn".into());
    }
    let (pipeline, source, info) = encoding(encoder, size)?;
    let period = camera.frame_period();
    let pictures = (Duration::from_secs(PAINTED_S.into()).as_nanos() / period.as_nanos()) as u32;
    let begin = processor_time()?;
    for number in 0..pictures {
        let exposure = number * period;
        camera.advance_to(exposure + period);
        let picture: Picture = camera.picture(exposure, size)?;
        source.push_buffer(picture.to_buffer(&info).ok_or("no buffer")?)?;
    }
    source.end_of_stream()?;
    let bus = pipeline.bus().ok_or("no bus")?;
    bus.timed_pop_filtered(gst::ClockTime::NONE, &[gst::MessageType::Eos, gst::MessageType::Error]);
    pipeline.set_state(gst::State::Null)?;
    Ok(f64::from(PAINTED_S) / (processor_time()? - begin).as_secs_f64())
}

/// What this process has used so far, from Linux' accounts.
fn processor_time() -> Result<Duration, Box<dyn Error>> {
    // Nanoseconds on the processor come first in each thread's line.
    let mut total = Duration::ZERO;
    for thread in std::fs::read_dir("/proc/self/task")? {
        let line = std::fs::read_to_string(thread?.path().join("schedstat"))?;
        total += Duration::from_nanos(line.split(' ').next().ok_or("no account")?.parse()?);
    }
    Ok(total)
}

fn encoding(
    encoder: &str,
    size: (u32, u32),
) -> Result<(gst::Pipeline, gst_app::AppSrc, gst_video::VideoInfo), Box<dyn Error>> {
    let launch = format!(
        "appsrc name=source format=time do-timestamp=true max-buffers=2 block=true ! {encoder} ! fakesink sync=false"
    );
    let pipeline = gst::parse::launch(&launch)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
    let source = pipeline.by_name("source").and_downcast::<gst_app::AppSrc>().ok_or("no source")?;
    let info = gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, size.0, size.1)
        .fps(gst::Fraction::new(25, 1))
        .build()?;
    source.set_caps(Some(&info.to_caps()?));
    pipeline.set_state(gst::State::Playing)?;
    Ok((pipeline, source, info))
}
