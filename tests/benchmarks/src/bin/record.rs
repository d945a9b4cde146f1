// SPDX-License-Identifier: MPL-2.0

//! Writes what the camera sees, as a recording to measure with:
//! `record FILE WxH SECONDS DEGREES_PER_SECOND [WORLD [PICTURES_PER_SECOND]]`.
//!
//! The world is the room with so many people in it, 1 unless given, or a recording, whose file is named. The camera turns to and fro
//! at that speed, two seconds each way, or rests at 0. Time is the world's own: the same arguments give the same pictures, 25 a
//! second unless given. The file is AVI: MJPEG, or MPEG-4 where its name ends in `.mpeg4`.

use std::{error::Error, time::Duration};

use gst::prelude::*;
use virtual_camera::{
    Auth, Clock, FootageSettings, Picture, RoomSettings, Settings, Video, VirtualCamera, World,
};

/// Arguments that there are in any case.
const NEEDED: usize = 4;
/// How long it turns to one side.
const SWEEP_S: u32 = 2;

/// Pictures that wait for the encoder.
const WAITING: u64 = 2;

fn main() -> Result<(), Box<dyn Error>> {
    gst::init()?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (needed, optional) =
        arguments
            .split_at_checked(NEEDED)
            .filter(|(_, optional)| optional.len() <= 2)
            .ok_or("record FILE WxH SECONDS DEGREES_PER_SECOND [WORLD [PICTURES_PER_SECOND]]")?;
    let [file, size, seconds, speed] = needed else { return Ok(()) };
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let world = world(optional.first().map_or("1", String::as_str))?;
    let rate = optional.get(1).map_or("25", String::as_str).parse()?;
    record(file, (width.parse()?, height.parse()?), seconds.parse()?, speed.parse()?, world, rate)
}

/// The room with so many people in it, or the recording of that name.
fn world(name: &str) -> Result<World, Box<dyn Error>> {
    let Ok(people) = name.parse::<usize>() else {
        return Ok(World::Footage(FootageSettings::new(name)));
    };
    let room = RoomSettings::test(1, 1).ok_or("no such test")?;
    Ok(World::Room(RoomSettings { others: people.checked_sub(1).ok_or("nobody")?, ..room }))
}

fn record(
    file: &str,
    size: (u32, u32),
    seconds: u32,
    speed: i32,
    world: World,
    rate: u32,
) -> Result<(), Box<dyn Error>> {
    let video = Video { frame_rate: Some(rate.into()), ..Video::default() };
    let settings = Settings { auth: Auth::None, world, clock: Clock::Stepped, video, ..Settings::default() };
    let camera = VirtualCamera::start(Settings { service_time: Duration::ZERO, ..settings })?;
    let writing = Writing::to(file, size, rate)?;
    let period = camera.frame_period();
    for second in 0..seconds {
        let direction = if (second / SWEEP_S).is_multiple_of(2) { speed } else { -speed };
        if second % SWEEP_S == 0 && !camera.operate(&format!("continuouspantiltmove={direction},0")) {
            return Err("the camera does not turn".into());
        }
        let first = Duration::from_secs(second.into());
        for exposure in (0..rate).map(|number| first + number * period) {
            camera.advance_to(exposure + period);
            let picture: Picture = camera.picture(exposure, size)?;
            writing.push(&picture, exposure, period)?;
        }
    }
    writing.end()
}

/// A recording that is being written.
struct Writing {
    pipeline: gst::Pipeline,
    source: gst_app::AppSrc,
    bus: gst::Bus,
    info: gst_video::VideoInfo,
}

impl Writing {
    fn to(file: &str, size: (u32, u32), rate: u32) -> Result<Self, Box<dyn Error>> {
        // AVI counts pictures. `avenc_mpeg4` of GStreamer 1.22 gives them no timestamps to speak of, so that MP4 would show them all
        // at once, or, behind `mpeg4videoparse`, refuse them.
        let encoder =
            if file.ends_with(".mpeg4") { "avenc_mpeg4 bitrate=4000000" } else { "jpegenc quality=70" };
        let launch = format!("appsrc name=source format=time ! {encoder} ! avimux ! filesink name=sink");
        let pipeline = gst::parse::launch(&launch)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
        pipeline.by_name("sink").ok_or("no sink")?.set_property("location", file);
        let source = pipeline.by_name("source").and_downcast::<gst_app::AppSrc>().ok_or("no source")?;
        let info = gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, size.0, size.1)
            .fps(gst::Fraction::new(rate.try_into()?, 1))
            .build()?;
        source.set_caps(Some(&info.to_caps()?));
        pipeline.set_state(gst::State::Playing)?;
        let bus = pipeline.bus().ok_or("no bus")?;
        Ok(Self { pipeline, source, bus, info })
    }

    fn push(&self, picture: &Picture, time: Duration, period: Duration) -> Result<(), Box<dyn Error>> {
        // `block` of the source would wait for ever for a pipeline that failed.
        while self.source.current_level_buffers() >= WAITING {
            self.failure(gst::ClockTime::from_mseconds(1))?;
        }
        let mut buffer = picture.to_buffer(&self.info).ok_or("no buffer")?;
        let times = buffer.get_mut().ok_or("the buffer is shared")?;
        times.set_pts(gst::ClockTime::try_from(time)?);
        times.set_duration(gst::ClockTime::try_from(period)?);
        self.source.push_buffer(buffer)?;
        Ok(())
    }

    /// Waits so long for an error.
    fn failure(&self, patience: gst::ClockTime) -> Result<(), Box<dyn Error>> {
        let message = self.bus.timed_pop_filtered(patience, &[gst::MessageType::Error]);
        match message.as_ref().map(|message| message.view()) {
            Some(gst::MessageView::Error(error)) => Err(error.error().to_string().into()),
            _ => Ok(()),
        }
    }

    fn end(self) -> Result<(), Box<dyn Error>> {
        self.source.end_of_stream()?;
        let types = [gst::MessageType::Eos, gst::MessageType::Error];
        let end = self.bus.timed_pop_filtered(gst::ClockTime::NONE, &types);
        self.pipeline.set_state(gst::State::Null)?;
        match end.as_ref().map(|message| message.view()) {
            Some(gst::MessageView::Error(error)) => Err(error.error().to_string().into()),
            _ => Ok(()),
        }
    }
}
