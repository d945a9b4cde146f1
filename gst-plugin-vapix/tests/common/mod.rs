// SPDX-License-Identifier: MPL-2.0

//! A sink under test before a virtual camera.
#![allow(missing_docs, dead_code, clippy::unwrap_used, clippy::expect_used)]

pub mod stage;

use std::sync::Once;
use std::time::{Duration, Instant};

use gst::prelude::*;
use ptztrack_contract::{BufferMeta, CameraChange, CameraMessage, Point, TargetMeta, TargetState};
use virtual_camera::{Auth, Settings, Status, VirtualCamera};

/// Longer than anything here takes on a busy machine; only a failure takes this long.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// What elapses between two pictures; no test depends on it.
pub const FRAME: Duration = Duration::from_millis(20);

pub fn init() {
    static INIT: Once = Once::new();
    INIT.call_once(|| {
        gst::init().unwrap();
        gstvapix::plugin_register_static().unwrap();
    });
}

pub fn camera(auth: Auth) -> VirtualCamera {
    VirtualCamera::start(Settings { auth, ..Settings::default() }).unwrap()
}

/// A target in the state and place.
pub fn target(state: TargetState, x: f64, y: f64) -> TargetMeta {
    TargetMeta { state, id: 1, centroid: Point { x, y }, confidence: 1.0, ..TargetMeta::default() }
}

/// Timestamps as a live source gives them.
pub struct Stamps {
    begin: Instant,
    /// By how much they are ahead of the time since the beginning.
    pub ahead: Duration,
    /// How fast they grow; by less than 1 pictures come later and later.
    pub pace: f64,
}

impl Default for Stamps {
    fn default() -> Self {
        Self { begin: Instant::now(), ahead: Duration::ZERO, pace: 1.0 }
    }
}

impl Stamps {
    fn next(&self) -> gst::ClockTime {
        gst::ClockTime::try_from(self.begin.elapsed().mul_f64(self.pace) + self.ahead).unwrap()
    }
}

pub struct Rig {
    pub sink: gst::Element,
    pub bus: gst::Bus,
    /// Where pictures have timestamps.
    pub stamps: Option<Stamps>,
    /// Of buffers.
    pub flags: gst::BufferFlags,
    harness: Option<gst_check::Harness>,
}

impl Rig {
    /// A sink for the camera at `location`, by the protocol that is spoken there, not yet playing. The watchdog process has its own tests: these need none to be
    /// built.
    pub fn ready(location: &str) -> Self {
        init();
        let sink = if location.contains("/onvif/") { "onvifptzsink" } else { "vapixptzsink" };
        let sink = gst::ElementFactory::make(sink)
            .property("location", location)
            .property("dead-man", false)
            .build()
            .unwrap();
        let bus = gst::Bus::new();
        sink.set_bus(Some(&bus));
        Self { sink, bus, stamps: None, flags: gst::BufferFlags::empty(), harness: None }
    }

    /// The same, playing.
    pub fn playing(location: &str) -> Self {
        Self::ready(location).play()
    }

    pub fn with(self, property: &str, value: impl Into<glib::Value>) -> Self {
        self.sink.set_property_from_value(property, &value.into());
        self
    }

    pub fn with_str(self, property: &str, value: &str) -> Self {
        self.sink.set_property_from_str(property, value);
        self
    }

    pub fn play(mut self) -> Self {
        let mut harness = gst_check::Harness::with_element(&self.sink, Some("sink"), None);
        harness.set_src_caps_str("video/x-raw,format=GRAY8,width=320,height=240,framerate=25/1");
        harness.play();
        self.harness = Some(harness);
        self
    }

    pub fn harness(&mut self) -> &mut gst_check::Harness {
        self.harness.as_mut().unwrap()
    }

    /// Pushes one picture.
    #[track_caller]
    pub fn push(&mut self, meta: &TargetMeta) {
        let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
        let content = buffer.get_mut().unwrap();
        content.set_pts(self.stamps.as_ref().map(Stamps::next));
        content.set_flags(self.flags);
        meta.attach(content).unwrap();
        assert_eq!(self.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
    }

    /// Pushes pictures until the camera is as wanted.
    #[track_caller]
    pub fn push_until(
        &mut self,
        meta: &TargetMeta,
        camera: &VirtualCamera,
        mut wanted: impl FnMut(&Status) -> bool,
    ) {
        let start = Instant::now();
        loop {
            self.push(meta);
            if camera.wait_for(FRAME, &mut wanted) {
                return;
            }
            assert!(start.elapsed() < PATIENCE, "the camera is {:?}", camera.status());
        }
    }

    /// Pushes pictures until this is on the bus; returns everything that was there till then.
    #[track_caller]
    pub fn push_until_message(&mut self, meta: &TargetMeta, wanted: impl Fn(&Heard) -> bool) -> Vec<Heard> {
        let (start, mut heard) = (Instant::now(), Vec::new());
        loop {
            self.push(meta);
            if let Some(message) = self.hear(FRAME) {
                let found = wanted(&message);
                heard.push(message);
                if found {
                    return heard;
                }
            }
            assert!(start.elapsed() < PATIENCE, "heard only {heard:?}");
        }
    }

    /// Sets the camera going to the upper right.
    #[track_caller]
    pub fn set_going(&mut self, camera: &VirtualCamera) {
        self.push_until(&target(TargetState::Tracking, 0.9, 0.4), camera, |status| {
            status.pan_rate_deg_s > 0.0
        });
    }

    /// The next that matters on the bus, if it comes in time.
    pub fn hear(&self, wait: Duration) -> Option<Heard> {
        let end = Instant::now() + wait;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let message = self.bus.timed_pop(gst::ClockTime::try_from(left).unwrap())?;
            if let Some(heard) = Heard::of(&message) {
                return Some(heard);
            }
        }
    }

    /// Everything that matters and is already on the bus.
    pub fn heard(&self) -> Vec<Heard> {
        std::iter::from_fn(|| self.bus.pop()).filter_map(|message| Heard::of(&message)).collect()
    }

    pub fn stats(&self) -> gst::Structure {
        self.sink.property("stats")
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        // The harness brings the sink to NULL by itself; without one there is only the sink.
        drop(self.harness.take());
        let _ = self.sink.set_state(gst::State::Null);
        // Messages refer to the sink, and the sink to the bus.
        self.bus.set_flushing(true);
    }
}

/// What matters on the bus.
#[derive(Debug, Clone, PartialEq)]
pub enum Heard {
    Camera(CameraChange),
    Info(String),
    Warning(String),
    Error(String),
}

impl Heard {
    fn of(message: &gst::Message) -> Option<Self> {
        match message.view() {
            gst::MessageView::Element(element) => {
                let camera = CameraMessage::from_structure(element.structure()?).ok()?;
                Some(Self::Camera(camera.change))
            }
            gst::MessageView::Info(info) => Some(Self::Info(info.error().message().to_owned())),
            gst::MessageView::Warning(warning) => Some(Self::Warning(warning.error().message().to_owned())),
            gst::MessageView::Error(error) => Some(Self::Error(error.error().message().to_owned())),
            _ => None,
        }
    }

    pub fn is_warning(&self) -> bool {
        matches!(self, Self::Warning(_))
    }

    pub fn into_warning(self) -> Option<String> {
        if let Self::Warning(text) = self { Some(text) } else { None }
    }
}

/// The moves among what the camera received: its queries are not counted.
pub fn moves(camera: &VirtualCamera) -> Vec<String> {
    let queries = camera.commands().into_iter().map(|command| command.query);
    queries.filter(|query| !query.contains("query=")).collect()
}
