//! Writes what the camera sees of somebody in the room, as a recording to measure with:
//! `record FILE WxH SECONDS DEGREES_PER_SECOND`.
//!
//! The camera turns to and fro at that speed, two seconds each way, or rests at 0. Time is the room's own: the same
//! arguments give the same pictures. The file is MJPEG in AVI.

use std::{error::Error, time::Duration};

use gst::prelude::*;
use virtual_camera::{Auth, Clock, Picture, RoomSettings, Settings, VirtualCamera, World};

/// How long it turns to one side.
const SWEEP_S: u32 = 2;

fn main() -> Result<(), Box<dyn Error>> {
    gst::init()?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, size, seconds, speed] = arguments.as_slice() else {
        return Err("record FILE WxH SECONDS DEGREES_PER_SECOND".into());
    };
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    record(file, (width.parse()?, height.parse()?), seconds.parse()?, speed.parse()?)
}

fn record(file: &str, size: (u32, u32), seconds: u32, speed: i32) -> Result<(), Box<dyn Error>> {
    let room = RoomSettings::test(1, 1).ok_or("no such test")?;
    let settings =
        Settings { auth: Auth::None, world: World::Room(room), clock: Clock::Stepped, ..Settings::default() };
    let camera = VirtualCamera::start(Settings { service_time: Duration::ZERO, ..settings })?;
    let (pipeline, source, info) = writing(file, size)?;
    let period = camera.frame_period();
    for second in 0..seconds {
        let direction = if (second / SWEEP_S).is_multiple_of(2) { speed } else { -speed };
        if second % SWEEP_S == 0 && !camera.operate(&format!("continuouspantiltmove={direction},0")) {
            return Err("the camera does not turn".into());
        }
        let first = Duration::from_secs(second.into());
        let pictures = (1.0 / period.as_secs_f64()).round() as u32;
        for exposure in (0..pictures).map(|number| first + number * period) {
            camera.advance_to(exposure + period);
            let picture: Picture = camera.picture(exposure, size)?;
            let mut buffer = picture.to_buffer(&info).ok_or("no buffer")?;
            let times = buffer.get_mut().ok_or("the buffer is shared")?;
            times.set_pts(gst::ClockTime::try_from(exposure)?);
            times.set_duration(gst::ClockTime::try_from(period)?);
            source.push_buffer(buffer)?;
        }
    }
    source.end_of_stream()?;
    let bus = pipeline.bus().ok_or("no bus")?;
    let end = bus.timed_pop_filtered(gst::ClockTime::NONE, &[gst::MessageType::Eos, gst::MessageType::Error]);
    pipeline.set_state(gst::State::Null)?;
    match end.as_ref().map(|message| message.view()) {
        Some(gst::MessageView::Error(error)) => Err(error.error().to_string().into()),
        _ => Ok(()),
    }
}

fn writing(
    file: &str,
    size: (u32, u32),
) -> Result<(gst::Pipeline, gst_app::AppSrc, gst_video::VideoInfo), Box<dyn Error>> {
    let launch = "appsrc name=source format=time max-buffers=2 block=true ! jpegenc quality=70 ! avimux ! filesink name=sink";
    let pipeline = gst::parse::launch(launch)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
    pipeline.by_name("sink").ok_or("no sink")?.set_property("location", file);
    let source = pipeline.by_name("source").and_downcast::<gst_app::AppSrc>().ok_or("no source")?;
    let info = gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, size.0, size.1)
        .fps(gst::Fraction::new(25, 1))
        .build()?;
    source.set_caps(Some(&info.to_caps()?));
    pipeline.set_state(gst::State::Playing)?;
    Ok((pipeline, source, info))
}
