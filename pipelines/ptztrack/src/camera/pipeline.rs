// SPDX-License-Identifier: MPL-2.0

//! One camera's pipeline, as text and as elements.

use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use gst::prelude::*;
use pipeline_supervisor::video::{Failure, Video};
use ptztrack_contract::lock::lock;

use super::bounds;
use super::known::{Known, Steering};
use super::packets::{self, DECODER};
use super::recording::Recorder;
use super::running::Running;
use super::servo_stats::ServoStats;
use super::sight;
use super::sightings;
use super::video;
use super::view::{self, VIEW};
use super::{Abilities, Turn};
use crate::config::{CameraSettings, Codec, Credentials, Kind, Protocol};
use crate::log::Log;

/// Whatever the elements behind cannot keep up with is dropped here, oldest first.
const NEWEST: &str = "queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0";

/// Nobody is there to notice that it follows somebody asleep, or has taken the wall for somebody.
const TRACKER: &str = "lkfeaturetrack stationary-timeout=120000000000";

/// Without a packet for so long, RTSP has to begin anew; HTTP's source has a limit of its own.
const LONGEST_SILENCE: Duration = Duration::from_millis(1200);
/// On top of that before the first packet: to log in over a long way, and for the camera to start an encoder.
const LONGEST_START: Duration = Duration::from_secs(4);

/// Copies of what is recorded, for a pipeline of its own: whatever becomes of that, nobody is followed the worse for it.
const TAP: &str = "appsink name=tap sync=false async=false enable-last-sample=false";

/// The pipeline, as `gst-launch-1.0` takes it; addresses and passwords are not in it.
pub fn description(camera: &CameraSettings) -> String {
    if let Some(pipeline) = &camera.pipeline {
        return pipeline.clone();
    }
    let recording = camera.recording.as_ref();
    let mut text = source(camera.codec, recording.is_some_and(|recording| !recording.overlay));
    write_all(&mut text, &format!(" ! {NEWEST} name=newest ! bgavgdetect ! {TRACKER} ! tee name=followed "));
    if camera.kind == Kind::Ptz {
        write_all(&mut text, &format!("followed. ! {NEWEST} ! {} ", camera.protocol.sink()));
    }
    write_all(&mut text, &format!("followed. ! {NEWEST} ! {VIEW} "));
    if camera.kept.is_some() {
        write_all(&mut text, &format!("followed. ! {NEWEST} ! {} ", sightings::SINK));
    }
    if recording.is_some_and(|recording| recording.overlay) {
        write_all(&mut text, &format!("followed. ! {NEWEST} ! ptzoverlay ! {TAP} "));
    }
    if camera.show {
        write_all(
            &mut text,
            &format!("followed. ! {NEWEST} ! ptzoverlay ! videoconvert ! autovideosink sync=false "),
        );
    }
    text
}

/// Pictures of the camera; `tapped`: they are recorded as they come.
fn source(codec: Codec, tapped: bool) -> String {
    let tap =
        if tapped { format!(" ! tee name=encoded encoded. ! {TAP} encoded. ! queue") } else { String::new() };
    let rtsp = |depay: &str, decoder: &str| {
        format!(
            "rtspsrc name=source latency=0 protocols=tcp ! {depay} name=received{tap} ! {decoder} name={DECODER}"
        )
    };
    match codec {
        Codec::Mjpeg => {
            format!(
                "appsrc name=source is-live=true do-timestamp=true format=time ! multipartdemux{tap} ! jpegdec name={DECODER}"
            )
        }
        Codec::Mpeg4 => rtsp("rtpmp4vdepay", "avdec_mpeg4"),
        Codec::H264 => rtsp("rtph264depay", "avdec_h264"),
        Codec::H265 => rtsp("rtph265depay", "avdec_h265"),
    }
}

/// Writing to a text cannot fail.
fn write_all(text: &mut String, more: &str) {
    let _ = text.write_str(more);
}

/// Why there is no pipeline.
pub enum NotBuilt {
    /// There are no pictures to be had.
    Video(Failure),
    /// GStreamer cannot make it.
    Pipeline(Box<dyn Error>),
}

impl From<Failure> for NotBuilt {
    fn from(failure: Failure) -> Self {
        Self::Video(failure)
    }
}

/// Builds it, with everything that watches it, once there is a way to the camera's pictures.
///
/// # Errors
/// Where there is none, where GStreamer lacks an element, or a pipeline of one's own is none.
pub fn build(
    camera: &CameraSettings,
    known: &Arc<Known>,
    recorder: Option<Recorder>,
    log: &Arc<Log>,
) -> Result<gst::Pipeline, NotBuilt> {
    let open = || video::open(camera, known.ended.clone());
    let video = camera.pipeline.is_none().then(open).transpose()?;
    let pipeline = parse(camera).map_err(NotBuilt::Pipeline)?;
    for element in pipeline.iterate_recurse().into_iter().flatten() {
        configure(&element, camera);
        known.times.iter().for_each(|stopwatch| stopwatch.watch(&element));
    }
    let source = pipeline.by_name("source");
    // `rtspsrc` has no pad yet.
    bounds::keep(&pipeline, pipeline.by_name("received").or_else(|| source.clone()).as_ref());
    if let Some(source) = source {
        // Of a pipeline of one's own it is not known before.
        let fed = of_factory(&pipeline, "appsrc").is_some() || of_factory(&pipeline, "rtspsrc").is_some();
        let video = if video.is_none() && fed { Some(open()?) } else { video };
        connect(&source, camera, video);
    }
    let segments = recorder.as_ref().map(Recorder::segments);
    if let Some((recorder, tap)) = recorder.zip(of_name::<gst_app::AppSink>(&pipeline, "tap")) {
        recorder.record(&tap);
    }
    if let Some(tracker) = of_factory(&pipeline, "lkfeaturetrack") {
        sight::watch(&tracker, known);
    }
    if let Some(sink) = of_name(&pipeline, "sightings") {
        sightings::watch(&sink, known, camera, segments, log.clone());
    }
    if camera.pipeline.is_none() {
        end_in_silence(&pipeline);
    }
    count(&pipeline, known);
    packets::tap(&pipeline, of_factory(&pipeline, "lkfeaturetrack").as_ref(), known);
    let elements = Elements::of(&pipeline);
    view::show(elements.view.as_ref(), elements.picture.as_ref(), known);
    elements.look(known.looking.load(Ordering::Relaxed) > 0);
    let override_timeout = elements.override_timeout();
    // Whoever takes the camera from here on is heard by these elements, and who took it before is told to them.
    *lock(&known.running) = Some(Arc::new(elements));
    known.steer_at_start(override_timeout);
    Ok(pipeline)
}

fn parse(camera: &CameraSettings) -> Result<gst::Pipeline, Box<dyn Error>> {
    let pipeline = gst::parse::launch(&description(camera))?;
    Ok(pipeline.downcast::<gst::Pipeline>().map_err(|_| "a pipeline has more than one element")?)
}

/// Address, password and properties.
fn configure(element: &gst::Element, camera: &CameraSettings) {
    let Some(factory) = element.factory() else { return };
    if Protocol::SINKS.contains(&factory.name().as_str()) {
        element.set_property("location", &camera.address);
        log_in(element, camera.credentials.as_ref(), ["user", "password"]);
    }
    for property in camera.properties.iter().filter(|property| factory.name() == property.element) {
        property.set(element);
    }
}

/// Gives the pictures to the pipeline, by whatever its source is.
fn connect(source: &gst::Element, camera: &CameraSettings, video: Option<Video>) {
    if let Some(video) = video {
        video.connect(source);
    } else if source.has_property_with_type("location", glib::Type::STRING) {
        // Of a pipeline of one's own, for which the password was allowed to be seen.
        source.set_property("location", format!("{}{}", camera.address, video::target(camera)));
        if source.has_property_with_type("user-id", glib::Type::STRING) {
            log_in(source, camera.credentials.as_ref(), ["user-id", "user-pw"]);
        }
        if source.has_property_with_type("automatic-redirect", glib::Type::BOOL) {
            source.set_property("automatic-redirect", false);
        }
    }
}

fn of_name<T: IsA<gst::Element>>(pipeline: &gst::Pipeline, name: &str) -> Option<T> {
    pipeline.by_name(name)?.downcast().ok()
}

fn log_in(element: &gst::Element, credentials: Option<&Credentials>, [user, password]: [&str; 2]) {
    if let Some(credentials) = credentials {
        element.set_property(user, &credentials.user);
        element.set_property(password, credentials.password.reveal());
    }
}

/// An error where packets stop. Not by GStreamer's `watchdog`: that would be all that is needed of the plugins called bad, which
/// bring more packages along than everything else.
fn end_in_silence(pipeline: &gst::Pipeline) {
    let packets = pipeline.by_name("received").and_then(|depay| depay.static_pad("sink"));
    let (Some(packets), Some(source)) = (packets, pipeline.by_name("source")) else { return };
    // Nothing comes after the stream's end.
    let last = Arc::new(Mutex::new(Some(Instant::now() + LONGEST_START)));
    let kinds =
        gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST | gst::PadProbeType::EVENT_DOWNSTREAM;
    packets.add_probe(kinds, {
        let last = last.clone();
        move |_, info| {
            match info.event().map(|event| event.type_()) {
                None => *lock(&last) = Some(Instant::now()),
                Some(gst::EventType::Eos) => *lock(&last) = None,
                Some(_) => {}
            }
            gst::PadProbeReturn::Ok
        }
    });
    let source = source.downgrade();
    // Not a local one: where the stream never ends it outlives the thread, and whoever has the context last ends it.
    glib::MainContext::ref_thread_default().spawn(async move {
        loop {
            let last = *lock(&last);
            let (Some(source), Some(last)) = (source.upgrade(), last) else { break };
            if last.elapsed() > LONGEST_SILENCE {
                let silence = LONGEST_SILENCE.as_secs_f64();
                gst::element_error!(source, gst::ResourceError::Read, ("no packet for {silence} s"));
                break;
            }
            drop(source);
            glib::timeout_future(LONGEST_SILENCE / 4).await;
        }
    });
}

/// Counts pictures that come, and those that go all the way.
fn count(pipeline: &gst::Pipeline, known: &Arc<Known>) {
    let by_factory = |name: &str| of_factory(pipeline, name);
    let tracker = by_factory("lkfeaturetrack").or_else(|| by_factory("bgavgdetect"));
    let first = pipeline.by_name("newest").or_else(|| by_factory("bgavgdetect")).or_else(|| tracker.clone());
    if let Some(pad) = first.and_then(|element| element.static_pad("sink")) {
        let known = known.clone();
        pad.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
            known.pictures.fetch_add(1, Ordering::Relaxed);
            gst::PadProbeReturn::Ok
        });
    }
    if let Some(pad) = tracker.and_then(|element| element.static_pad("src")) {
        let known = known.clone();
        pad.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
            known.saw_picture();
            gst::PadProbeReturn::Ok
        });
    }
}

fn of_factory(pipeline: &gst::Pipeline, name: &str) -> Option<gst::Element> {
    pipeline
        .iterate_recurse()
        .into_iter()
        .flatten()
        .find(|element| element.factory().is_some_and(|factory| factory.name() == name))
}

/// What can be told to a running pipeline.
#[derive(Debug, Clone)]
pub struct Elements {
    tracker: Option<gst::Element>,
    servo: Option<gst::Element>,
    view: Option<gst::Element>,
    picture: Option<gst_app::AppSink>,
}

impl Elements {
    fn of(pipeline: &gst::Pipeline) -> Self {
        Self {
            tracker: of_factory(pipeline, "lkfeaturetrack"),
            servo: Protocol::SINKS.into_iter().find_map(|sink| of_factory(pipeline, sink)),
            view: pipeline.by_name("view"),
            picture: pipeline.by_name("picture").and_then(|element| element.downcast().ok()),
        }
    }

    /// How long a camera is left to who has moved it.
    fn override_timeout(&self) -> Duration {
        let of = |servo: &gst::Element| servo.property::<u64>("override-timeout");
        Duration::from_nanos(self.servo.as_ref().map_or(0, of))
    }
}

impl Running for Elements {
    fn look(&self, somebody: bool) {
        if let Some(view) = &self.view {
            view.set_property("drop", !somebody);
        }
    }

    fn select(&self, x: f64, y: f64) {
        if let Some(tracker) = &self.tracker {
            tracker.emit_by_name::<()>("select-target", &[&x, &y]);
        }
    }

    fn select_track(&self, id: u64) {
        if let Some(tracker) = &self.tracker {
            tracker.emit_by_name::<()>("select-track", &[&id]);
        }
    }

    fn ignore(&self, ids: &BTreeSet<u64>) {
        if let Some(tracker) = &self.tracker {
            let ids: Vec<String> = ids.iter().map(u64::to_string).collect();
            tracker.set_property("ignored-tracks", ids.join(","));
        }
    }

    fn release(&self) {
        if let Some(tracker) = &self.tracker {
            tracker.emit_by_name::<()>("release-target", &[]);
        }
    }

    fn turn(&self, known: &Known, turn: Turn) -> bool {
        known.turn_here(turn, self.override_timeout())
    }

    fn abilities(&self, known: &Known) -> Abilities {
        let has_home = |servo: &gst::Element| servo.property::<Option<String>>("home").is_some();
        let turns = self.servo.is_some();
        Abilities {
            home: self.servo.as_ref().is_some_and(has_home),
            hand_over: turns,
            turn: turns && known.says_where_it_looks(),
        }
    }

    fn steer(&self, steering: Steering) {
        let Some(servo) = &self.servo else { return };
        let to = match steering {
            Steering::Follow => "follow",
            Steering::GoHome(_) => "home",
            Steering::LookAt(gaze, _) | Steering::TurnBack(gaze, _) | Steering::Turned(gaze, _) => {
                servo.set_property("look-at", gaze.to_string());
                "look-at"
            }
            Steering::HandedOver | Steering::Operator(_) => "off",
        };
        // On its way it is told another place without a stop in between.
        let looks = servo.property_value("steering").serialize().is_ok_and(|steering| steering == "look-at");
        if !(looks && to == "look-at") {
            servo.set_property_from_str("steering", to);
        }
    }

    fn servo_stats(&self) -> Option<ServoStats> {
        self.servo.as_ref().map(|servo| servo.property::<gst::Structure>("stats").as_ref().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    fn described(more: &str) -> String {
        gst::init().expect("GStreamer");
        let text = format!("[camera.door]\naddress = \"http://192.168.0.90\"\n{more}");
        description(&Config::parse(&text).expect("right").cameras[0])
    }

    #[test]
    fn a_fixed_camera_is_moved_by_nobody() {
        let fixed = described("kind = \"fixed\"\n");
        assert!(fixed.contains("lkfeaturetrack") && !fixed.contains("vapixptzsink"), "{fixed}");
    }

    #[test]
    fn who_stands_for_long_is_let_go_of_but_a_pipeline_of_ones_own_is_as_it_is_written() {
        let ours = described("");
        assert!(ours.contains("! lkfeaturetrack stationary-timeout=120000000000 !"), "{ours}");
        let own = "fakesrc name=source ! fakesink";
        assert_eq!(described(&format!("pipeline = \"{own}\"")), own);
    }

    /// As at the end of a camera whose stream does not end.
    #[test]
    fn who_waits_for_packets_may_be_ended_by_another_thread() {
        gst::init().unwrap();
        let pipeline = gst::parse::launch("fakesrc name=source ! identity name=received ! fakesink").unwrap();
        let pipeline = pipeline.downcast::<gst::Pipeline>().unwrap();
        let context = glib::MainContext::new();
        std::thread::spawn({
            let (context, pipeline) = (context.clone(), pipeline.clone());
            move || {
                let waits = || {
                    end_in_silence(&pipeline);
                    while context.iteration(false) {}
                };
                context.with_thread_default(waits).unwrap();
            }
        })
        .join()
        .unwrap();
        drop(context);
    }
}
