// SPDX-License-Identifier: MPL-2.0

use std::sync::{Arc, LazyLock, Mutex};

use glib::Properties;
use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_base::prelude::*;
use gst_base::subclass::BaseTransformMode;
use gst_base::subclass::prelude::*;
use gst_video::VideoInfo;
use gst_video::subclass::prelude::*;
use ptztrack_contract::{
    CameraEvent, MOTION_ROI, RefusedValues, TargetChange, TargetState, Times, TrackMessage, TrackerEvent,
};

use super::scene_source::SceneSource;
use super::{Profile, TargetSelection, buffer};
use crate::allocation::refuse_crop;
#[cfg(feature = "analytics")]
use crate::analytics::Analytics;
use crate::duration;
use crate::frame;
use crate::lock::lock;
use crate::luma_source::{self, LumaSource};
use crate::pad_templates;
use crate::unseen::Unseen;
use crate::vision::{self, CameraMoves, Observation, TargetRequest};

mod operator;

static CAT: LazyLock<gst::DebugCategory> = LazyLock::new(|| {
    gst::DebugCategory::new("lkfeaturetrack", gst::DebugColorFlags::empty(), Some("Feature point tracker"))
});

/// A frame's duration where neither timestamps nor caps tell.
const DEFAULT_FRAME: gst::ClockTime = gst::ClockTime::from_mseconds(40);

#[derive(Debug, Clone)]
struct Settings {
    profile: Profile,
    selection: TargetSelection,
    /// Shared with each picture's copy of the settings.
    roi_type: Arc<str>,
    ignored_tracks: Arc<[u64]>,
    confirm_frames: u32,
    coast_time_ns: u64,
    memory_time_ns: u64,
    post_tracks: bool,
    manual_size: f64,
    message_interval_ns: u64,
    stationary_timeout_ns: u64,
    max_tracking_time_ns: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            profile: Profile::default(),
            selection: TargetSelection::default(),
            roi_type: MOTION_ROI.into(),
            ignored_tracks: Arc::default(),
            confirm_frames: 3,
            coast_time_ns: 3_000_000_000,
            memory_time_ns: 60_000_000_000,
            post_tracks: false,
            manual_size: 0.25,
            message_interval_ns: 0,
            stationary_timeout_ns: 0,
            max_tracking_time_ns: 0,
        }
    }
}

/// Detectors of others, neural networks most of all, look at every nth frame.
const FOREIGN_DETECTOR_PAUSE_S: f64 = 1.0;

impl Settings {
    fn profile(&self) -> vision::Profile {
        match self.profile {
            Profile::Thesis => vision::Profile::Thesis,
            Profile::Robust => vision::Profile::Robust,
        }
    }

    fn config(&self) -> vision::Config {
        let own_detector = *self.roi_type == *MOTION_ROI;
        let profile = self.profile();
        vision::Config {
            profile,
            choice: match self.selection {
                TargetSelection::Largest => vision::Choice::Largest,
                TargetSelection::First => vision::Choice::First,
                TargetSelection::NearestCentre => vision::Choice::NearestCentre,
                TargetSelection::Group => vision::Choice::Group,
                TargetSelection::Manual => vision::Choice::Manual,
            },
            confirm_frames: self.confirm_frames,
            coast_s: gst::ClockTime::from_nseconds(self.coast_time_ns).seconds_f64(),
            memory_s: gst::ClockTime::from_nseconds(self.memory_time_ns).seconds_f64(),
            manual_size: self.manual_size,
            must_travel: profile.must_travel() && own_detector,
            detector_pause_s: if own_detector { 0.0 } else { FOREIGN_DETECTOR_PAUSE_S },
            limits: vision::TimeLimits {
                stationary_s: limit_s(self.stationary_timeout_ns),
                tracked_s: limit_s(self.max_tracking_time_ns),
            },
        }
    }
}

/// A time limit in seconds; none where it is 0.
fn limit_s(limit_ns: u64) -> f64 {
    if limit_ns == 0 { f64::INFINITY } else { gst::ClockTime::from_nseconds(limit_ns).seconds_f64() }
}

/// What the streaming thread keeps from frame to frame.
struct Stream {
    info: VideoInfo,
    source: LumaSource,
    scene: SceneSource,
    detections: buffer::Detections,
    tracker: vision::Tracker,
    #[cfg(feature = "analytics")]
    analytics: Analytics,
    state: TargetState,
    /// Running time of the last frame.
    last_time: Option<gst::ClockTime>,
    cadence: vision::Cadence,
    unseen: Unseen,
    since_message: gst::ClockTime,
    /// Whether a fault of this stream was already reported, so that one fault is not a flood.
    warned: bool,
}

impl Stream {
    fn new(info: VideoInfo, config: vision::Config) -> Self {
        Self {
            info,
            source: LumaSource::default(),
            scene: SceneSource::default(),
            detections: buffer::Detections::default(),
            tracker: vision::Tracker::new(config),
            #[cfg(feature = "analytics")]
            analytics: Analytics::default(),
            state: TargetState::Searching,
            last_time: None,
            cadence: vision::Cadence::default(),
            unseen: Unseen::default(),
            since_message: gst::ClockTime::ZERO,
            warned: false,
        }
    }

    /// The time since the last frame.
    fn step(&mut self, now: Option<gst::ClockTime>) -> gst::ClockTime {
        let last = std::mem::replace(&mut self.last_time, now);
        let Some((now, last)) = now.zip(last).filter(|(now, last)| now != last) else {
            return self.frame_duration();
        };
        let elapsed = self.cadence.elapsed(now.checked_sub(last).map(std::time::Duration::from));
        elapsed.and_then(|elapsed| elapsed.try_into().ok()).unwrap_or_else(|| self.frame_duration())
    }

    fn frame_duration(&self) -> gst::ClockTime {
        let (frames, seconds) = (self.info.fps().numer(), self.info.fps().denom());
        match (u64::try_from(frames), u64::try_from(seconds)) {
            (Ok(frames), Ok(seconds)) if frames > 0 => {
                gst::ClockTime::SECOND.mul_div_round(seconds, frames).unwrap_or(DEFAULT_FRAME)
            }
            _ => DEFAULT_FRAME,
        }
    }
}

/// The locks are never held together, nor while anything is computed, posted or pushed.
#[derive(Properties, Default)]
#[properties(wrapper_type = super::LkFeatureTrack)]
pub struct LkFeatureTrack {
    #[property(
        name = "profile", get, set, type = Profile, member = profile, mutable_playing,
        blurb = "Which steps are taken, from the next target on",
        builder(Settings::default().profile)
    )]
    #[property(
        name = "selection", get, set, type = TargetSelection, member = selection, mutable_playing,
        blurb = "Which detection becomes the target",
        builder(Settings::default().selection)
    )]
    #[property(
        name = "roi-type", type = String, default = Some(MOTION_ROI), mutable_playing,
        blurb = "Name of the region-of-interest metas, or class of the object detections (GStreamer 1.24), that count as detections (motion: those of bgavgdetect); another detector need not see every frame, once a second will do",
        get = |imp: &Self| lock(&imp.settings).roi_type.to_string(),
        set = |imp: &Self, name: Option<String>| lock(&imp.settings).roi_type = name.unwrap_or_default().into()
    )]
    #[property(
        name = "confirm-frames", get, set, type = u32, member = confirm_frames, mutable_playing,
        minimum = 1, maximum = 100, default = Settings::default().confirm_frames,
        blurb = "Frames in which a detection must be seen before it becomes the target"
    )]
    #[property(
        name = "coast-time", get, type = u64, member = coast_time_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "coast-time", value) { lock(&imp.settings).coast_time_ns = value },
        maximum = 60_000_000_000, default = Settings::default().coast_time_ns,
        blurb = "How long a hidden target is looked for where it should be, in nanoseconds (0: it is lost at once)"
    )]
    #[property(
        name = "manual-size", get, set, type = f64, member = manual_size, mutable_playing,
        minimum = 0.02, maximum = 1.0, default = Settings::default().manual_size,
        blurb = "Height of the box around a place selected by hand where nothing was detected, in frame heights"
    )]
    #[property(
        name = "memory-time", get, type = u64, member = memory_time_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "memory-time", value) { lock(&imp.settings).memory_time_ns = value },
        maximum = 3_600_000_000_000, default = Settings::default().memory_time_ns,
        blurb = "How long somebody who is gone is remembered, in nanoseconds: whoever comes back within it has their old number (0: not at all)"
    )]
    #[property(
        name = "ignored-tracks", type = String, mutable_playing,
        blurb = "Numbers of tracks that become the target only when selected by hand, for example 3,7",
        get = |imp: &Self| operator::in_words(&lock(&imp.settings).ignored_tracks),
        set = |imp: &Self, numbers: Option<String>| imp.ignore(&numbers.unwrap_or_default())
    )]
    #[property(
        name = "post-tracks", get, set, type = bool, member = post_tracks, default = Settings::default().post_tracks, mutable_playing,
        blurb = "Post an element message ptztrack-track for everybody who comes or goes, target or not"
    )]
    #[property(
        name = "message-interval", get, type = u64, member = message_interval_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "message-interval", value) { lock(&imp.settings).message_interval_ns = value },
        maximum = 3_600_000_000_000, default = Settings::default().message_interval_ns,
        blurb = "Time between two position messages while there is a target, in nanoseconds (0: none)"
    )]
    #[property(
        name = "stationary-timeout", get, type = u64, member = stationary_timeout_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "stationary-timeout", value) { lock(&imp.settings).stationary_timeout_ns = value },
        maximum = 86_400_000_000_000, default = Settings::default().stationary_timeout_ns,
        blurb = "A target that stands still longer than this is released and not taken again until it moves, in nanoseconds (0: never)"
    )]
    #[property(
        name = "max-tracking-time", get, type = u64, member = max_tracking_time_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "max-tracking-time", value) { lock(&imp.settings).max_tracking_time_ns = value },
        maximum = 86_400_000_000_000, default = Settings::default().max_tracking_time_ns,
        blurb = "A target tracked for longer than this is released and not taken again until it has moved and 3 s have passed, in nanoseconds (0: never)"
    )]
    settings: Mutex<Settings>,
    /// Taken out by the streaming thread while it computes.
    stream: Mutex<Option<Stream>>,
    /// Width and height of the frames, for clicks from other threads.
    size: Mutex<Option<(u32, u32)>>,
    request: Mutex<Option<TargetRequest>>,
    /// Numbers of the tracks in the last frame, ascending, for requests from other threads.
    numbers: Mutex<Vec<u64>>,
    camera: Mutex<CameraMoves>,
    refused: RefusedValues,
}

#[glib::object_subclass]
impl ObjectSubclass for LkFeatureTrack {
    const NAME: &'static str = "GstLkFeatureTrack";
    type Type = super::LkFeatureTrack;
    type ParentType = gst_video::VideoFilter;
}

#[glib::derived_properties]
impl ObjectImpl for LkFeatureTrack {
    fn constructed(&self) {
        self.parent_constructed();
        // Optical flow needs every frame that comes: dropping belongs to the queue in front.
        self.obj().set_qos(false);
        // Else the base class takes the flag off frames that pass untouched.
        self.obj().set_gap_aware(true);
    }

    fn signals() -> &'static [glib::subclass::Signal] {
        operator::signals()
    }
}

impl GstObjectImpl for LkFeatureTrack {}

impl ElementImpl for LkFeatureTrack {
    fn metadata() -> Option<&'static gst::subclass::ElementMetadata> {
        static METADATA: LazyLock<gst::subclass::ElementMetadata> = LazyLock::new(|| {
            gst::subclass::ElementMetadata::new(
                "Feature point tracker",
                "Filter/Analyzer/Video",
                "Follows one moving target by its feature points, also while the camera turns",
                env!("CARGO_PKG_AUTHORS"),
            )
        });
        Some(&METADATA)
    }

    fn pad_templates() -> &'static [gst::PadTemplate] {
        static TEMPLATES: LazyLock<Vec<gst::PadTemplate>> =
            LazyLock::new(|| pad_templates::in_and_out(&luma_source::template_caps()));
        &TEMPLATES
    }
}

impl BaseTransformImpl for LkFeatureTrack {
    const MODE: BaseTransformMode = BaseTransformMode::AlwaysInPlace;
    const PASSTHROUGH_ON_SAME_CAPS: bool = false;
    const TRANSFORM_IP_ON_PASSTHROUGH: bool = false;

    fn start(&self) -> Result<(), gst::ErrorMessage> {
        self.refused.warn(&*self.obj());
        // What was asked for while nothing was to be seen was meant for what was seen before.
        *lock(&self.request) = None;
        Ok(())
    }

    fn stop(&self) -> Result<(), gst::ErrorMessage> {
        let stream = lock(&self.stream).take();
        if stream.is_some_and(|stream| has_target(stream.state)) {
            self.wake_detector();
        }
        *lock(&self.size) = None;
        *lock(&self.request) = None;
        lock(&self.numbers).clear();
        *lock(&self.camera) = CameraMoves::default();
        Ok(())
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
        if event.type_() == gst::EventType::FlushStop
            && let Some(stream) = lock(&self.stream).as_mut()
        {
            stream.tracker.interrupt();
            stream.scene.restart();
            stream.last_time = None;
        }
        self.parent_sink_event(event)
    }

    fn src_event(&self, event: gst::Event) -> bool {
        if event.type_() == gst::EventType::Navigation {
            self.navigate(&event);
        } else if let Some(Ok(camera)) = CameraEvent::of(&event) {
            lock(&self.camera).hear(&camera);
        }
        self.parent_src_event(event)
    }

    /// In place of the base class's, which would map the pixels writable and so copy a shared frame.
    fn transform_ip(&self, buffer: &mut gst::BufferRef) -> Result<gst::FlowSuccess, gst::FlowError> {
        let mut stream = lock(&self.stream).take().ok_or(gst::FlowError::NotNegotiated)?;
        if stream.unseen.skips(buffer) {
            // What was asked for waits for the next one.
            *lock(&self.stream) = Some(stream);
            return Ok(gst::FlowSuccess::Ok);
        }
        let settings = lock(&self.settings).clone();
        let request = lock(&self.request).take();
        stream.tracker.configure(settings.config());
        stream.tracker.ignore(settings.ignored_tracks.clone());
        stream.tracker.set_camera_rests(!lock(&self.camera).is_moving());
        if let Some(request) = request {
            stream.tracker.request(request);
        }
        self.track(&mut stream, &settings, buffer);
        *lock(&self.stream) = Some(stream);
        Ok(gst::FlowSuccess::Ok)
    }
}

impl VideoFilterImpl for LkFeatureTrack {
    fn set_info(
        &self,
        incaps: &gst::Caps,
        in_info: &VideoInfo,
        outcaps: &gst::Caps,
        out_info: &VideoInfo,
    ) -> Result<(), gst::LoggableError> {
        self.parent_set_info(incaps, in_info, outcaps, out_info)?;
        gst::debug!(CAT, imp = self, "{incaps}");
        *lock(&self.size) = Some((in_info.width(), in_info.height()));
        let config = lock(&self.settings).config();
        let mut stream = lock(&self.stream);
        match stream.as_mut() {
            // The tracker stays: it tells that the target of the old picture is lost.
            Some(stream) => stream.info = in_info.clone(),
            None => *stream = Some(Stream::new(in_info.clone(), config)),
        }
        Ok(())
    }
}

/// One frame.
impl LkFeatureTrack {
    fn track(&self, stream: &mut Stream, settings: &Settings, buffer: &mut gst::BufferRef) {
        let times = match self.obj().segment() {
            segment if segment.format() == gst::Format::Time => Times::of(&segment, buffer.pts()),
            _ => Times { timestamp: buffer.pts(), ..Times::default() },
        };
        let before = stream.last_time;
        let step = stream.step(times.running_time);
        lock(&self.camera).pass(step.into());
        let tracked = match self.look(stream, settings, buffer, step) {
            Ok(tracked) => tracked,
            Err(reason) => {
                // Says nothing about the target: the next frame continues the last one that could be read.
                stream.last_time = before;
                self.warn_once(stream, &reason);
                return;
            }
        };
        self.announce(stream, settings, &tracked, times, step);
        self.count(settings, &tracked, times);
        #[cfg(feature = "analytics")]
        if let Err(err) = stream.analytics.attach(
            buffer,
            &stream.info,
            &settings.roi_type,
            &tracked.tracks,
            times.running_time,
        ) {
            self.warn_once(stream, &format!("no object can be attached: {err}"));
        }
        let held_back = gst::ClockTime::try_from(stream.cadence.held_back()).unwrap_or_default();
        let captured = times.running_time.map(|time| time.saturating_sub(held_back));
        match buffer::attach(buffer, &stream.info, tracked, captured) {
            Ok((features, tracks)) => stream.tracker.recycle(features, tracks),
            Err(err) => self.warn_once(stream, &format!("no meta can be attached: {err}")),
        }
    }

    /// Reads the frame and follows the target; the error says why the frame cannot be read.
    fn look(
        &self,
        stream: &mut Stream,
        settings: &Settings,
        buffer: &gst::BufferRef,
        step: gst::ClockTime,
    ) -> Result<vision::Tracked, String> {
        let mut fault = None;
        let detections = stream.detections.read(buffer, &stream.info, &settings.roi_type);
        let detections = detections.unwrap_or_else(|err| {
            fault = Some(format!("the detector's meta cannot be read: {err}"));
            &[]
        });
        let frame = frame::readable(buffer, &stream.info)
            .ok_or("the buffer does not hold a frame of the negotiated caps")?;
        let picture =
            stream.source.picture(&frame).map_err(|err| format!("the frame has no readable luma: {err}"))?;
        let mut seen = Observation::from(picture.luma);
        if settings.profile().sees_the_scene() {
            let expected = lock(&self.camera).expected_motion(step.into());
            match stream.scene.look(buffer, &picture, step.into(), expected) {
                Ok(Ok(scene)) => seen.scene = Some(scene),
                Ok(Err(err)) => fault = Some(format!("the detector's scene cannot be read: {err}")),
                Err(err) => fault = Some(format!("camera motion cannot be measured: {err}")),
            }
        }
        let tracked = stream.tracker.process(&seen, step.seconds_f64(), detections).unwrap_or_else(|err| {
            fault = Some(format!("tracking failed: {err}"));
            lost(stream.state)
        });
        if let Some(fault) = fault {
            self.warn_once(stream, &fault);
        }
        Ok(tracked)
    }

    /// Tells the bus and upstream what changed.
    fn announce(
        &self,
        stream: &mut Stream,
        settings: &Settings,
        tracked: &vision::Tracked,
        times: Times,
        step: gst::ClockTime,
    ) {
        for change in &tracked.changes {
            gst::info!(CAT, imp = self, "target {} {change:?}", tracked.id);
            self.post(tracked, *change, times);
        }
        if let Some(id) = tracked.without_corners {
            gst::element_imp_warning!(
                self,
                gst::StreamError::Failed,
                ("Track {id} cannot be followed, as nothing in it stands out; the target stays. Select somebody with more contrast.")
            );
        }
        let has_target = has_target(tracked.state);
        let interval = gst::ClockTime::from_nseconds(settings.message_interval_ns);
        stream.since_message = stream.since_message.saturating_add(step);
        if has_target && !interval.is_zero() && stream.since_message >= interval {
            stream.since_message = gst::ClockTime::ZERO;
            self.post(tracked, TargetChange::Position, times);
        }
        // While there is a target the detector must know where, so that it does not take who is seen there for background.
        if std::mem::replace(&mut stream.state, tracked.state) != tracked.state || has_target {
            let event = TrackerEvent { state: tracked.state, bounds: has_target.then_some(tracked.bounds) };
            // Nobody has to listen.
            let _ = self.obj().sink_pad().push_event(event.to_event());
        }
    }

    /// Keeps the numbers of the tracks, and tells the bus who comes and goes.
    fn count(&self, settings: &Settings, tracked: &vision::Tracked, times: Times) {
        {
            let mut numbers = lock(&self.numbers);
            numbers.clear();
            numbers.extend(tracked.tracks.iter().map(|track| track.id));
            numbers.sort_unstable();
        }
        if settings.post_tracks {
            for &(change, id, into) in &tracked.track_changes {
                self.post_structure(TrackMessage { change, times, id, into }.to_structure());
            }
        }
    }

    /// A detector must not sleep on when nobody is left to wake it. The own pad is no longer active then.
    fn wake_detector(&self) {
        if let Some(detector) = self.obj().sink_pad().peer() {
            let event = TrackerEvent { state: TargetState::Searching, bounds: None };
            // Fails where it has stopped, too.
            let _ = detector.send_event(event.to_event());
        }
    }

    fn post(&self, tracked: &vision::Tracked, change: TargetChange, times: Times) {
        self.post_structure(buffer::message(tracked, change, times).to_structure());
    }

    fn post_structure(&self, structure: gst::Structure) {
        let obj = self.obj();
        let message = gst::message::Element::builder(structure).src(&*obj).build();
        if obj.post_message(message).is_err() {
            gst::debug!(CAT, imp = self, "no bus to post to");
        }
    }

    fn warn_once(&self, stream: &mut Stream, reason: &str) {
        gst::warning!(CAT, imp = self, "{reason}");
        if !std::mem::replace(&mut stream.warned, true) {
            gst::element_imp_warning!(
                self,
                gst::StreamError::Failed,
                ("{reason}. The video goes on; further faults of this stream are not reported.")
            );
        }
    }
}

/// What there is to tell after the tracker failed in that state: it has let go of its target, if any.
fn lost(state: TargetState) -> vision::Tracked {
    if !has_target(state) {
        return vision::Tracked::default();
    }
    vision::Tracked {
        state: TargetState::Lost,
        changes: vec![TargetChange::Lost],
        ..vision::Tracked::default()
    }
}

/// Whether there is a target in that state: the detector sleeps, the bus hears of positions.
fn has_target(state: TargetState) -> bool {
    matches!(state, TargetState::Tracking | TargetState::Occluded)
}
