// SPDX-License-Identifier: MPL-2.0

use std::sync::{LazyLock, Mutex};
use std::time::Duration;

use glib::Properties;
use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_base::prelude::*;
use gst_base::subclass::BaseTransformMode;
use gst_base::subclass::prelude::*;
use gst_video::subclass::prelude::*;
use gst_video::{VideoInfo, VideoRegionOfInterestMeta};
use ptztrack_contract::{
    BufferMeta, CameraEvent, MOTION_ROI, MotionChange, MotionMessage, MotionMeta, RefusedValues, Region,
    SceneMeta, TargetState, Times, TrackerEvent,
};

use super::settings::{Settings, ZoneSetting};
use super::stream::{Heard, Stream, StreamError};
use super::{Output, Profile, RegionSelection, Test, caps};
use crate::allocation::refuse_crop;
use crate::duration;
use crate::lock::lock;
use crate::luma_source;
use crate::pad_templates;
use crate::region_of_interest::remove_regions_of_interest;
use crate::vision::{Duty, Zones};

static CAT: LazyLock<gst::DebugCategory> = LazyLock::new(|| {
    gst::DebugCategory::new("bgavgdetect", gst::DebugColorFlags::empty(), Some("Motion detector"))
});

/// The locks are never held together, nor while anything computes or is pushed.
#[derive(Properties)]
#[properties(wrapper_type = super::BgAvgDetect)]
pub struct BgAvgDetect {
    #[property(
        name = "profile", get, set, type = Profile, member = profile, mutable_playing,
        blurb = "Which steps are taken; `thesis` overrides analysis-width, selection and confirm-frames",
        builder(Settings::default().profile)
    )]
    #[property(
        name = "analysis-width", get, set, type = u32, member = analysis_width, mutable_playing,
        default = Settings::default().analysis_width, maximum = 16384,
        blurb = "Wider pictures are reduced by the smallest whole number that makes them at most this wide, in pixels (0 = never)"
    )]
    #[property(
        name = "alpha", get, set, type = f64, member = alpha, mutable_playing,
        default = Settings::default().alpha, minimum = 0.0, maximum = 1.0,
        blurb = "With profile=thesis: weight of a new picture in the running mean"
    )]
    #[property(
        name = "test", get, set, type = Test, member = test, mutable_playing,
        blurb = "With profile=thesis: how foreground is told from background",
        builder(Settings::default().test)
    )]
    #[property(
        name = "threshold", get, set, type = f64, member = threshold, mutable_playing,
        default = Settings::default().threshold, minimum = 0.0, maximum = 0.99,
        blurb = "With profile=thesis and test=relative: difference from the mean that is foreground, as a fraction of the mean"
    )]
    #[property(
        name = "spread-factor", get, set, type = f64, member = spread_factor, mutable_playing,
        default = Settings::default().spread_factor, minimum = 0.0, maximum = 100.0,
        blurb = "With profile=thesis and test=spread: difference from the mean that is foreground, in standard deviations"
    )]
    #[property(
        name = "window", get, set, type = u32, member = window, mutable_playing,
        default = Settings::default().window, minimum = 2, maximum = 255,
        blurb = "With profile=thesis and test=spread: how many of the last pictures the standard deviation is taken over"
    )]
    #[property(
        name = "open-size", get, set, type = i32, member = open_size, mutable_playing,
        default = Settings::default().open_size, minimum = -1, maximum = 999,
        blurb = "Side of the square for opening, in pixels of the frame: smaller specks vanish (0 or 1 = none, -1 = chosen: one that leaves narrow limbs, or 3 with profile=thesis)"
    )]
    #[property(
        name = "close-size", get, set, type = i32, member = close_size, mutable_playing,
        default = Settings::default().close_size, minimum = -1, maximum = 999,
        blurb = "Side of the square for closing, in pixels of the frame: smaller gaps are filled (0 or 1 = none, -1 = an upright rectangle chosen by the frame's height)"
    )]
    #[property(
        name = "selection", get, set, type = RegionSelection, member = selection, mutable_playing,
        blurb = "Which regions are reported",
        builder(Settings::default().selection)
    )]
    #[property(
        name = "min-area", get, set, type = f64, member = min_area, mutable_playing,
        default = Settings::default().min_area, minimum = 0.0, maximum = 1.0,
        blurb = "Smallest area of a region, as a fraction of the frame"
    )]
    #[property(
        name = "max-area", get, set, type = f64, member = max_area, mutable_playing,
        default = Settings::default().max_area, minimum = 0.0, maximum = 1.0,
        blurb = "Largest area of a region, as a fraction of the frame"
    )]
    #[property(
        name = "zones", type = String, mutable_playing, blurb = "Where regions are reported (empty = everywhere), in the picture at the time of setting: polygons separated by `;`, each of three or more points `x,y` (0 to 1) separated by spaces",
        get = |imp: &Self| lock(&imp.settings).zones.text.to_string(),
        set = |imp: &Self, text: Option<String>| imp.set_zones("zones", text, |settings| &mut settings.zones)
    )]
    #[property(
        name = "exclude-zones", type = String, mutable_playing, blurb = "Where no regions are reported: polygons as in zones",
        get = |imp: &Self| lock(&imp.settings).exclude_zones.text.to_string(),
        set = |imp: &Self, text: Option<String>| imp.set_zones("exclude-zones", text, |settings| &mut settings.exclude_zones)
    )]
    #[property(
        name = "warm-up", get, set, type = u32, member = warm_up, mutable_playing,
        default = Settings::default().warm_up, minimum = 1, maximum = 10_000,
        blurb = "Frames from which the background is learned before anything is reported"
    )]
    #[property(
        name = "confirm-frames", get, set, type = u32, member = confirm_frames, mutable_playing,
        default = Settings::default().confirm_frames, minimum = 1, maximum = 1000,
        blurb = "Frames in a row that must show a region before it is reported"
    )]
    #[property(
        name = "settle-time", get, type = u64, member = settle_time_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "settle-time", value) { lock(&imp.settings).settle_time_ns = value },
        default = Settings::default().settle_time_ns, maximum = 60_000_000_000,
        blurb = "With profile=thesis: how long pictures may still show the camera moving after it stopped, in nanoseconds"
    )]
    #[property(
        name = "max-gap", get, type = u64, member = max_gap_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "max-gap", value) { lock(&imp.settings).max_gap_ns = value },
        default = Settings::default().max_gap_ns, maximum = 3_600_000_000_000,
        blurb = "Longest interruption (DISCONT, gap) after which the background still holds, in nanoseconds"
    )]
    #[property(
        name = "end-delay", get, type = u64, member = end_delay_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "end-delay", value) { lock(&imp.settings).end_delay_ns = value },
        default = Settings::default().end_delay_ns, maximum = 3_600_000_000_000,
        blurb = "How long nothing must move before motion is reported to have ended, in nanoseconds"
    )]
    #[property(
        name = "post-messages", get, set, type = bool, member = post_messages, mutable_playing,
        default = Settings::default().post_messages,
        blurb = "Post a ptztrack-motion message on the bus when motion starts and ends"
    )]
    #[property(
        name = "output", get, set, type = Output, member = output, mutable_playing,
        blurb = "What leaves the element; changing it renegotiates the caps with the next frame",
        builder(Settings::default().output)
    )]
    settings: Mutex<Settings>,
    /// The output that caps were negotiated for; changed only by the streaming thread, between frames.
    output: Mutex<Output>,
    /// Taken out by the streaming thread while it works on a frame.
    stream: Mutex<Option<Stream>>,
    duty: Mutex<Duty>,
    heard: Mutex<Heard>,
    refused: RefusedValues,
}

impl Default for BgAvgDetect {
    fn default() -> Self {
        let settings = Settings::default();
        Self {
            output: Mutex::new(settings.output),
            settings: Mutex::new(settings),
            stream: Mutex::default(),
            duty: Mutex::default(),
            heard: Mutex::default(),
            refused: RefusedValues::default(),
        }
    }
}

#[glib::object_subclass]
impl ObjectSubclass for BgAvgDetect {
    const NAME: &'static str = "GstBgAvgDetect";
    type Type = super::BgAvgDetect;
    type ParentType = gst_video::VideoFilter;
}

#[glib::derived_properties]
impl ObjectImpl for BgAvgDetect {
    fn constructed(&self) {
        self.parent_constructed();
        // A mean over time needs all the frames there are; dropping is for a leaky queue in front.
        self.obj().set_qos(false);
        self.obj().set_in_place(true);
        self.obj().set_gap_aware(true);
    }
}

impl GstObjectImpl for BgAvgDetect {}

impl ElementImpl for BgAvgDetect {
    fn metadata() -> Option<&'static gst::subclass::ElementMetadata> {
        static METADATA: LazyLock<gst::subclass::ElementMetadata> = LazyLock::new(|| {
            gst::subclass::ElementMetadata::new(
                "Motion detector by background averaging",
                "Filter/Analyzer/Video",
                "Finds what moves, the camera at rest or turning",
                env!("CARGO_PKG_AUTHORS"),
            )
        });
        Some(&*METADATA)
    }

    fn pad_templates() -> &'static [gst::PadTemplate] {
        static TEMPLATES: LazyLock<Vec<gst::PadTemplate>> =
            LazyLock::new(|| pad_templates::in_and_out(&luma_source::template_caps()));
        &TEMPLATES
    }
}

impl BaseTransformImpl for BgAvgDetect {
    const MODE: BaseTransformMode = BaseTransformMode::Both;
    const PASSTHROUGH_ON_SAME_CAPS: bool = false;
    const TRANSFORM_IP_ON_PASSTHROUGH: bool = false;

    fn start(&self) -> Result<(), gst::ErrorMessage> {
        self.refused.warn(&*self.obj());
        *lock(&self.duty) = Duty::default();
        *lock(&self.heard) = Heard::default();
        self.apply_output();
        Ok(())
    }

    fn stop(&self) -> Result<(), gst::ErrorMessage> {
        *lock(&self.stream) = None;
        Ok(())
    }

    fn transform_caps(
        &self,
        direction: gst::PadDirection,
        caps: &gst::Caps,
        filter: Option<&gst::Caps>,
    ) -> Option<gst::Caps> {
        let output = *lock(&self.output);
        let caps = caps::transformed(caps, direction, output);
        Some(match filter {
            Some(filter) => filter.intersect_with_mode(&caps, gst::CapsIntersectMode::First),
            None => caps,
        })
    }

    fn propose_allocation(
        &self,
        decided: Option<&gst::query::Allocation>,
        query: &mut gst::query::Allocation,
    ) -> Result<(), gst::LoggableError> {
        self.parent_propose_allocation(decided, query)?;
        refuse_crop(query);
        Ok(())
    }

    fn sink_event(&self, event: gst::Event) -> bool {
        match event.view() {
            gst::EventView::FlushStop(_) => self.with_stream(Stream::flush),
            gst::EventView::Gap(_) => self.with_stream(Stream::interrupt),
            gst::EventView::Eos(_) => {
                let (end, pts) = lock(&self.stream).as_mut().map_or((None, None), Stream::finish);
                self.post(end, pts, &[]);
            }
            _ => (),
        }
        self.parent_sink_event(event)
    }

    fn src_event(&self, event: gst::Event) -> bool {
        if let Some(tracker) = TrackerEvent::of(&event) {
            match tracker {
                Ok(tracker) => self.heed_tracker(&tracker),
                Err(error) => gst::warning!(CAT, imp = self, "Unreadable event of a tracker: {error}"),
            }
        } else if let Some(camera) = CameraEvent::of(&event) {
            match camera {
                Ok(camera) => self.heed_camera(&camera),
                Err(error) => gst::warning!(CAT, imp = self, "Unreadable event of a servo: {error}"),
            }
        }
        self.parent_src_event(event)
    }

    fn submit_input_buffer(
        &self,
        is_discont: bool,
        inbuf: gst::Buffer,
    ) -> Result<gst::FlowSuccess, gst::FlowError> {
        self.apply_output();
        self.parent_submit_input_buffer(is_discont, inbuf)
    }

    fn transform_ip(&self, buffer: &mut gst::BufferRef) -> Result<gst::FlowSuccess, gst::FlowError> {
        // Mapped for reading only: memory shared with others is then not copied.
        let mut stream = lock(&self.stream).take().ok_or(gst::FlowError::NotNegotiated)?;
        let seen = self.look(&mut stream, buffer);
        let attached = attach(buffer, &seen, &stream.in_info);
        stream.recycle(seen.motion);
        *lock(&self.stream) = Some(stream);
        self.posted(attached)
    }

    fn transform(
        &self,
        inbuf: &gst::Buffer,
        outbuf: &mut gst::BufferRef,
    ) -> Result<gst::FlowSuccess, gst::FlowError> {
        let output = *lock(&self.output);
        let mut stream = lock(&self.stream).take().ok_or(gst::FlowError::NotNegotiated)?;
        let seen = self.look(&mut stream, inbuf);
        let regions = seen.motion.as_ref().map_or(&[][..], |motion| &motion.regions);
        let drawn = stream.draw(inbuf, outbuf, regions, output);
        let attached = attach(outbuf, &seen, &stream.in_info);
        if let Err(error) = &drawn {
            self.warn_once(&mut stream, error);
        }
        stream.recycle(seen.motion);
        *lock(&self.stream) = Some(stream);
        self.posted(attached)?;
        // What could not be drawn is not shown: its memory holds anything.
        if drawn.is_ok() { Ok(gst::FlowSuccess::Ok) } else { Ok(gst_base::BASE_TRANSFORM_FLOW_DROPPED) }
    }
}

impl VideoFilterImpl for BgAvgDetect {
    fn set_info(
        &self,
        _incaps: &gst::Caps,
        in_info: &VideoInfo,
        _outcaps: &gst::Caps,
        out_info: &VideoInfo,
    ) -> Result<(), gst::LoggableError> {
        let before = lock(&self.stream).take();
        *lock(&self.stream) = Some(Stream::negotiated(before, in_info.clone(), out_info.clone()));
        Ok(())
    }
}

impl BgAvgDetect {
    fn set_zones(
        &self,
        name: &str,
        text: Option<String>,
        field: impl FnOnce(&mut Settings) -> &mut ZoneSetting,
    ) {
        match text.unwrap_or_default().parse::<ZoneSetting>() {
            Ok(zones) => *field(&mut lock(&self.settings)) = zones,
            Err(error) => {
                let reason = format!("{name} stays as it was: {error}. Write {}", Zones::GRAMMAR);
                self.refused.add(&*self.obj(), reason);
            }
        }
    }

    /// Takes over the `output` property; only between frames, so that a frame and its caps agree.
    fn apply_output(&self) {
        let wanted = lock(&self.settings).output;
        let before = std::mem::replace(&mut *lock(&self.output), wanted);
        if before != wanted {
            self.obj().set_in_place(wanted == Output::Frame);
            self.obj().reconfigure_src();
        }
    }

    fn with_stream(&self, change: impl FnOnce(&mut Stream)) {
        if let Some(stream) = lock(&self.stream).as_mut() {
            change(stream);
        }
    }

    fn heed_tracker(&self, tracker: &TrackerEvent) {
        let follows = matches!(tracker.state, TargetState::Tracking | TargetState::Occluded);
        gst::debug!(CAT, imp = self, "Tracker is {}", tracker.state.name());
        lock(&self.duty).sleep(follows);
        // A tracker that does not see its target only guesses where it is: what is seen there is mostly background.
        let is_seen = tracker.state == TargetState::Tracking;
        lock(&self.heard).target = tracker.bounds.filter(|_| is_seen);
    }

    fn heed_camera(&self, camera: &CameraEvent) {
        let settle_time = lock(&self.settings).settle_time_ns;
        gst::debug!(CAT, imp = self, "Camera {}", if camera.moving { "moves" } else { "is at rest" });
        lock(&self.duty).camera(camera, Duration::from_nanos(settle_time));
        let mut heard = lock(&self.heard);
        heard.view = camera.view();
        heard.camera.hear(camera);
    }

    /// The regions of a frame, `None` where it was not looked at or while it learns, and the scene.
    fn look(&self, stream: &mut Stream, buffer: &gst::BufferRef) -> Seen {
        let settings = lock(&self.settings).clone();
        if buffer.flags().contains(gst::BufferFlags::DISCONT) {
            stream.interrupt();
        }
        if stream.unseen.skips(buffer) {
            return Seen::default();
        }
        let elapsed = stream.advance(buffer.pts(), Duration::from_nanos(settings.max_gap_ns));
        let seen = match settings.profile {
            Profile::Robust => {
                let heard = {
                    let mut heard = lock(&self.heard);
                    heard.camera.pass(elapsed);
                    *heard
                };
                let seen = stream.look_at_scene(buffer, elapsed, &settings, &heard);
                seen.map(|(motion, scene)| Seen { motion, scene: Some(scene) })
            }
            Profile::Thesis => {
                if !lock(&self.duty).looks(elapsed) {
                    stream.skip();
                    return Seen::default();
                }
                let found = stream.look(buffer, &settings);
                found.map(|regions| Seen {
                    motion: regions.map(|regions| MotionMeta { regions, ..MotionMeta::default() }),
                    scene: None,
                })
            }
        };
        let seen = seen.unwrap_or_else(|error| {
            self.warn_once(stream, &error);
            Seen::default()
        });
        if let Some(MotionMeta { regions, .. }) = &seen.motion {
            let change = stream.change(regions, elapsed, &settings);
            self.post(change, buffer.pts(), regions);
        }
        seen
    }

    fn post(&self, change: Option<MotionChange>, pts: Option<gst::ClockTime>, regions: &[Region]) {
        let Some(change) = change else { return };
        if !lock(&self.settings).post_messages {
            return;
        }
        let message = MotionMessage {
            change,
            times: Times::of(&self.obj().segment(), pts),
            regions: u32::try_from(regions.len()).unwrap_or(u32::MAX),
            bounds: regions.first().map(|region| region.bounds),
        };
        let message = gst::message::Element::builder(message.to_structure()).src(&*self.obj()).build();
        // Fails only where nobody has given the element a bus.
        let _ = self.obj().post_message(message);
    }

    fn warn_once(&self, stream: &mut Stream, error: &StreamError) {
        if !std::mem::replace(&mut stream.warned, true) {
            gst::element_imp_warning!(
                self,
                gst::StreamError::Failed,
                ("A frame was not analysed: {error}. Further faults of this stream are not reported")
            );
        }
    }

    fn posted(&self, attached: Result<(), glib::BoolError>) -> Result<gst::FlowSuccess, gst::FlowError> {
        attached.map(|()| gst::FlowSuccess::Ok).map_err(|error| {
            gst::element_imp_error!(self, gst::StreamError::Failed, ("Motion cannot be attached: {error}"));
            gst::FlowError::Error
        })
    }
}

/// What there is to say of a frame.
#[derive(Default)]
struct Seen {
    motion: Option<MotionMeta>,
    scene: Option<SceneMeta>,
}

/// Says on `buffer` what was seen; nothing where nobody looked.
fn attach(buffer: &mut gst::BufferRef, seen: &Seen, info: &VideoInfo) -> Result<(), glib::BoolError> {
    if let Some(scene) = &seen.scene {
        scene.attach(buffer)?;
    }
    let Some(motion) = &seen.motion else { return Ok(()) };
    remove_regions_of_interest(buffer, MOTION_ROI);
    for region in &motion.regions {
        let pixels = region.bounds.to_pixels(info.width(), info.height());
        VideoRegionOfInterestMeta::add(buffer, MOTION_ROI, pixels);
    }
    motion.attach(buffer)
}
