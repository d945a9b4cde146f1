use std::sync::{LazyLock, Mutex};
use std::time::Duration;

use glib::Properties;
use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_base::prelude::*;
use gst_base::subclass::prelude::*;
use ptztrack_contract::{BufferMeta, TargetMeta};

use super::clock::Clock;
use super::news::camera_event;
use super::picture::Picture;
use super::settings::{Settings, environment};
use super::statistics::Statistics;
use super::worker::{self, Legacy, Worker};
use super::{Mode, Prediction, SpeedCurve};
use crate::lock::lock;
use crate::servo::{Sight, Status};

pub(super) static CAT: LazyLock<gst::DebugCategory> = LazyLock::new(|| {
    gst::DebugCategory::new("vapixptzsink", gst::DebugColorFlags::empty(), Some("VAPIX PTZ servo"))
});

/// Longest wait for the camera's yes when leaving PLAYING and at EOS.
const REST_WAIT: Duration = Duration::from_secs(1);

/// A picture older than this tells nothing: rather its timestamps are wrong.
const OLDEST_PICTURE: gst::ClockTime = gst::ClockTime::from_seconds(2);

/// What render keeps from buffer to buffer.
#[derive(Debug, Default)]
struct Stream {
    picture: Option<Picture>,
    /// Whether unreadable metas were already warned of.
    warned: bool,
    lockstep: bool,
}

/// No lock is held while anything is posted, pushed or waited for. Of those here only two are held together, in this
/// order: `settings`, `worker`, so that changes come to the worker in the order in which they were made.
#[derive(Default, Properties)]
#[properties(wrapper_type = super::VapixPtzSink)]
pub struct VapixPtzSink {
    #[property(
        name = "location", type = Option<String>, get = Self::location, set = Self::set_location, mutable_ready,
        blurb = "Address of the camera, for example http://192.168.0.90; a user and a password in it are moved to the properties of that name"
    )]
    #[property(
        name = "camera", get, set, type = u32, member = camera, mutable_ready,
        default = Settings::default().camera, minimum = 1, maximum = 64,
        blurb = "Video channel of the camera"
    )]
    #[property(
        name = "user", get, set = Self::set_user, type = Option<String>, member = user, mutable_playing,
        blurb = "User, with the right to control PTZ; where user and password are unset, VAPIX_USER of the environment"
    )]
    #[property(
        name = "password", set = Self::set_password, type = Option<String>, mutable_playing,
        blurb = "Password (cannot be read); where user and password are unset, VAPIX_PASSWORD of the environment"
    )]
    #[property(
        name = "timeout", get, set, type = u32, member = timeout_ms, mutable_ready,
        default = Settings::default().timeout_ms, minimum = 100, maximum = 60_000,
        blurb = "Longest wait for one of the camera's answers, in milliseconds"
    )]
    #[property(
        name = "insecure", get, set, type = bool, member = insecure, mutable_ready,
        default = Settings::default().insecure,
        blurb = "With https believe any certificate: who sits on the wire can then take the camera"
    )]
    #[property(
        name = "ca-file", get, set, type = Option<String>, member = ca_file, mutable_ready,
        blurb = "With https believe only certificates signed by an authority in this PEM file (unset: those the system trusts)"
    )]
    #[property(
        name = "mode", get, set = Self::set_mode, type = Mode, member = mode, mutable_playing,
        blurb = "How the camera is moved",
        builder(Settings::default().mode)
    )]
    #[property(
        name = "gain", get, set = Self::set_gain, type = f64, member = gain, mutable_playing,
        default = Settings::default().gain, minimum = 0.0, maximum = 20.0,
        blurb = "Degrees per second for each degree off the middle, in 1/s"
    )]
    #[property(
        name = "dead-zone", get, set = Self::set_dead_zone, type = f64, member = dead_zone, mutable_playing,
        default = Settings::default().dead_zone, minimum = 0.0, maximum = 0.5,
        blurb = "Offset from the middle at which a camera at rest stays at rest, as a part of the picture's width"
    )]
    #[property(
        name = "max-speed", get, set = Self::set_max_speed, type = f64, member = max_speed_deg_s, mutable_playing,
        default = Settings::default().max_speed_deg_s, minimum = 0.1, maximum = 1000.0,
        blurb = "Pan and tilt never turn faster than this, in degrees per second"
    )]
    #[property(
        name = "max-acceleration", get, set = Self::set_max_acceleration, type = f64, member = max_acceleration_deg_s2, mutable_playing,
        default = Settings::default().max_acceleration_deg_s2, minimum = 1.0, maximum = 10_000.0,
        blurb = "By how much the speed of pan and tilt changes in a second at most, in degrees per second; a stop is at once"
    )]
    #[property(
        name = "max-rate", get, set = Self::set_max_rate, type = f64, member = max_rate_hz, mutable_playing,
        default = Settings::default().max_rate_hz, minimum = 0.1, maximum = 50.0,
        blurb = "Commands per second at most; stops are sent at once"
    )]
    #[property(
        name = "latency", get, set = Self::set_latency, type = u32, member = latency_ms, mutable_playing,
        default = Settings::default().latency_ms, maximum = 5000,
        blurb = "Delay of the camera: from the sending of a command until a picture that shows it arrives, in milliseconds"
    )]
    #[property(
        name = "field-of-view", get, set = Self::set_field_of_view, type = f64, member = field_of_view_deg, mutable_playing,
        default = Settings::default().field_of_view_deg, minimum = 0.0, maximum = 179.0,
        blurb = "Horizontal field of view zoomed out, in degrees (0: as the camera says)"
    )]
    #[property(
        name = "prediction", get, set = Self::set_prediction, type = Prediction, member = prediction, mutable_playing,
        blurb = "How the target's motion is carried forward",
        builder(Settings::default().prediction)
    )]
    #[property(
        name = "stale-timeout", get, set = Self::set_stale_timeout, type = u32, member = stale_timeout_ms, mutable_playing,
        default = Settings::default().stale_timeout_ms, minimum = 50, maximum = 60_000,
        blurb = "The camera is stopped when the target was not seen for this long, in milliseconds"
    )]
    #[property(
        name = "camera-speed", get, set = Self::set_camera_speed, type = f64, member = camera_speed_deg_s, mutable_playing,
        default = Settings::default().camera_speed_deg_s, minimum = 1.0, maximum = 1000.0,
        blurb = "What a camera that does not tell does at speed step 100, in degrees per second"
    )]
    #[property(
        name = "speed-curve", get, set = Self::set_speed_curve, type = SpeedCurve, member = speed_curve, mutable_playing,
        blurb = "How the speed of a camera that does not tell grows with the speed step",
        builder(Settings::default().speed_curve)
    )]
    #[property(
        name = "learn", get, set = Self::set_learn, type = bool, member = learn, mutable_playing,
        default = Settings::default().learn,
        blurb = "Learn latency, field of view and speed map while following; what is set or told is where that begins"
    )]
    #[property(
        name = "auto-zoom", get, set = Self::set_auto_zoom, type = bool, member = auto_zoom, mutable_playing,
        default = Settings::default().auto_zoom,
        blurb = "Zoom so that the target stays as tall as `target-height`, and out where it is not seen well"
    )]
    #[property(
        name = "target-height", get, set = Self::set_target_height, type = f64, member = target_height, mutable_playing,
        default = Settings::default().target_height, minimum = 0.05, maximum = 0.9,
        blurb = "Height that `auto-zoom` gives the target, as a part of the picture's"
    )]
    #[property(
        name = "pan-min", get, set = Self::set_pan_min, type = f64, member = pan_min_deg, mutable_playing,
        default = Settings::default().pan_min_deg, minimum = -180.0, maximum = 180.0,
        blurb = "The camera is turned no farther left than this, in degrees (-180 and 180 together: no limit)"
    )]
    #[property(
        name = "pan-max", get, set = Self::set_pan_max, type = f64, member = pan_max_deg, mutable_playing,
        default = Settings::default().pan_max_deg, minimum = -180.0, maximum = 180.0,
        blurb = "The camera is turned no farther right than this, in degrees (-180 and 180 together: no limit)"
    )]
    #[property(
        name = "tilt-min", get, set = Self::set_tilt_min, type = f64, member = tilt_min_deg, mutable_playing,
        default = Settings::default().tilt_min_deg, minimum = -180.0, maximum = 180.0,
        blurb = "The camera is tilted no farther down than this, in degrees"
    )]
    #[property(
        name = "tilt-max", get, set = Self::set_tilt_max, type = f64, member = tilt_max_deg, mutable_playing,
        default = Settings::default().tilt_max_deg, minimum = -180.0, maximum = 180.0,
        blurb = "The camera is tilted no farther up than this, in degrees"
    )]
    #[property(
        name = "zoom-min", get, set = Self::set_zoom_min, type = u32, member = zoom_min, mutable_playing,
        default = Settings::default().zoom_min, minimum = 1, maximum = 9999,
        blurb = "`auto-zoom` zooms out no farther than this, in steps of the optical zoom"
    )]
    #[property(
        name = "zoom-max", get, set = Self::set_zoom_max, type = u32, member = zoom_max, mutable_playing,
        default = Settings::default().zoom_max, minimum = 1, maximum = 9999,
        blurb = "`auto-zoom` zooms in no farther than this, in steps of the optical zoom"
    )]
    #[property(
        name = "home", get = Self::home, set = Self::set_home, type = Option<String>, mutable_playing,
        blurb = "Where the camera waits for a target: pan,tilt or pan,tilt,zoom in degrees and zoom steps, start (where it looked when it was met), or the name of one of its presets (unset: where the last target was)"
    )]
    #[property(
        name = "home-timeout", get, set = Self::set_home_timeout, type = u32, member = home_timeout_ms, mutable_playing,
        default = Settings::default().home_timeout_ms, maximum = 86_400_000,
        blurb = "The camera goes home when there was no target for this long, in milliseconds"
    )]
    #[property(
        name = "home-at-start", get, set = Self::set_home_at_start, type = bool, member = home_at_start, mutable_ready,
        default = Settings::default().home_at_start,
        blurb = "The camera goes home before the first target too, without waiting"
    )]
    #[property(
        name = "override-timeout", get, set = Self::set_override_timeout, type = u32, member = override_timeout_ms, mutable_playing,
        default = Settings::default().override_timeout_ms, maximum = 86_400_000,
        blurb = "Whoever else moves the camera keeps it until it was not moved for this long, in milliseconds (0: nobody is given way)"
    )]
    #[property(
        name = "lockstep", get, set, type = bool, member = lockstep, mutable_ready,
        default = Settings::default().lockstep,
        blurb = "Time is the stream's, and each buffer waits for the camera's answers: for simulated cameras"
    )]
    pub(super) settings: Mutex<Settings>,
    pub(super) worker: Mutex<Option<Worker>>,
    /// Of the workers so far, that may still be about to stop their cameras.
    legacies: Mutex<Vec<Legacy>>,
    stream: Mutex<Stream>,
    /// What upstream was not told yet; pushed by the streaming thread, so that the worker never waits for it.
    pub(super) news: Mutex<Option<Status>>,
}

#[glib::object_subclass]
impl ObjectSubclass for VapixPtzSink {
    const NAME: &'static str = "GstVapixPtzSink";
    type Type = super::VapixPtzSink;
    type ParentType = gst_base::BaseSink;
}

impl ObjectImpl for VapixPtzSink {
    fn properties() -> &'static [glib::ParamSpec] {
        // The macro has no notion of a structure.
        static PROPERTIES: LazyLock<Vec<glib::ParamSpec>> = LazyLock::new(|| {
            let stats = glib::ParamSpecBoxed::builder::<gst::Structure>("stats")
                .blurb("What it does and what it knows of the camera: state; commands-sent, commands-failed, commands-coalesced; round-trip and round-trip-average in nanoseconds; pan-rate and tilt-rate in degrees per second; where known mode, pan and tilt in degrees, zoom in zoom steps, the camera's own ends camera-pan-min, camera-pan-max, camera-tilt-min, camera-tilt-max in degrees and camera-zoom-min, camera-zoom-max in zoom steps, camera-endless-pan, field-of-view in degrees, latency in nanoseconds, speeds of the steps 1 to 100 in degrees per second, last-error")
                .read_only()
                .build();
            VapixPtzSink::derived_properties().iter().cloned().chain([stats]).collect()
        });
        &PROPERTIES
    }

    fn set_property(&self, id: usize, value: &glib::Value, pspec: &glib::ParamSpec) {
        self.derived_set_property(id, value, pspec);
    }

    fn property(&self, id: usize, pspec: &glib::ParamSpec) -> glib::Value {
        match pspec.name() {
            "stats" => self.stats().to_value(),
            _ => self.derived_property(id, pspec),
        }
    }

    fn constructed(&self) {
        self.parent_constructed();
        let sink = self.obj();
        // A late target is worth nothing, and a pipeline must not wait for this sink to preroll.
        sink.set_sync(false);
        sink.set_async(false);
        sink.set_qos(false);
    }

    fn dispose(&self) {
        // There is one if the element was never brought to NULL.
        self.finish_worker();
    }
}

impl GstObjectImpl for VapixPtzSink {}

impl ElementImpl for VapixPtzSink {
    fn metadata() -> Option<&'static gst::subclass::ElementMetadata> {
        static METADATA: LazyLock<gst::subclass::ElementMetadata> = LazyLock::new(|| {
            gst::subclass::ElementMetadata::new(
                "VAPIX PTZ servo",
                "Sink/Network",
                "Steers an Axis pan-tilt-zoom camera after the tracked target",
                "The ptztrack developers",
            )
        });
        Some(&METADATA)
    }

    fn pad_templates() -> &'static [gst::PadTemplate] {
        static TEMPLATES: LazyLock<Vec<gst::PadTemplate>> = LazyLock::new(|| {
            let caps = gst::Caps::builder("video/x-raw").any_features().build();
            gst::PadTemplate::new("sink", gst::PadDirection::Sink, gst::PadPresence::Always, &caps)
                .into_iter()
                .collect()
        });
        &TEMPLATES
    }

    fn change_state(
        &self,
        transition: gst::StateChange,
    ) -> Result<gst::StateChangeSuccess, gst::StateChangeError> {
        // Not in the base class' start() and stop(): those are at NULL to READY and back, and
        // what can be set in READY shall count.
        if transition == gst::StateChange::ReadyToPaused {
            self.start_worker()?;
        }
        if transition == gst::StateChange::PausedToPlaying {
            self.with_worker(|worker| worker.inbox().heed(true));
        }
        let result = self.parent_change_state(transition);
        match transition {
            gst::StateChange::PlayingToPaused => {
                // The base class may go on rendering: where it was PLAYING for so short a time that the streaming
                // thread did not wake from its preroll, it takes the preroll for done and waits for none.
                self.with_worker(|worker| worker.inbox().heed(false));
                self.rest();
            }
            gst::StateChange::PausedToReady => self.finish_worker(),
            gst::StateChange::ReadyToPaused if result.is_err() => self.finish_worker(),
            _ => {}
        }
        result
    }
}

impl BaseSinkImpl for VapixPtzSink {
    fn set_caps(&self, caps: &gst::Caps) -> Result<(), gst::LoggableError> {
        let picture =
            Picture::of(caps).ok_or_else(|| gst::loggable_error!(CAT, "caps without a size: {caps}"))?;
        lock(&self.stream).picture = Some(picture);
        Ok(())
    }

    /// Pixels are never read here, so any layout will do: a `tee` offers upstream only what all its branches take.
    fn propose_allocation(&self, query: &mut gst::query::Allocation) -> Result<(), gst::LoggableError> {
        query.add_allocation_meta::<gst_video::VideoMeta>(None);
        self.parent_propose_allocation(query)
    }

    fn event(&self, event: gst::Event) -> bool {
        match event.type_() {
            gst::EventType::Eos => self.rest(),
            gst::EventType::FlushStart => {
                let handled = self.parent_event(event);
                // After the parent, see above; and without a wait, as this is the seeking thread.
                self.with_worker(|worker| drop(worker.inbox().rest()));
                return handled;
            }
            _ => {}
        }
        self.parent_event(event)
    }

    fn render(&self, buffer: &gst::Buffer) -> Result<gst::FlowSuccess, gst::FlowError> {
        self.push_news();
        let step = self.lockstep_time(buffer.pts());
        if let Some(time) = step {
            // What is still under way, as the first questions to the camera are, belongs to the time before.
            self.settle();
            self.with_worker(|worker| worker.inbox().hold_at(time));
        }
        match TargetMeta::of(buffer) {
            Some(Ok(target)) => self.see(&target, buffer.pts()),
            Some(Err(err)) => self.warn_of_meta(&err),
            None => {}
        }
        if step.is_some() {
            self.settle();
        }
        Ok(gst::FlowSuccess::Ok)
    }
}

impl VapixPtzSink {
    fn start_worker(&self) -> Result<(), gst::StateChangeError> {
        let (settings, refused) = {
            let mut settings = lock(&self.settings);
            let refused = settings.judge_limits();
            (settings.clone(), refused)
        };
        self.limits_refused(&refused);
        let Some(client) = settings.client(environment) else {
            gst::element_imp_error!(
                self,
                gst::ResourceError::NotFound,
                ("no camera: set `location`, for example location=http://192.168.0.90")
            );
            return Err(gst::StateChangeError);
        };
        *lock(&self.stream) = Stream { lockstep: settings.lockstep, ..Stream::default() };
        let clock = if settings.lockstep { Clock::held() } else { Clock::running() };
        *lock(&self.news) = None;
        gst::debug!(CAT, imp = self, "camera {} at {}", client.camera, client.location);
        let element = self.obj().downgrade();
        let worker = Worker::start(client, settings.servo(), clock, move |event| {
            if let Some(element) = element.upgrade() {
                element.imp().happened(event);
            }
        })
        .map_err(|reason| {
            gst::element_imp_error!(self, gst::ResourceError::Settings, ("{reason}"));
            gst::StateChangeError
        })?;
        {
            let mut legacies = lock(&self.legacies);
            legacies.retain(|legacy| !legacy.is_void() && !worker.succeed(legacy));
            legacies.push(worker.legacy());
        }
        self.install(worker, &settings);
        Ok(())
    }

    fn finish_worker(&self) {
        // Waited for without the lock.
        let worker = lock(&self.worker).take();
        drop(worker);
    }

    /// Leaves the target for the worker.
    fn see(&self, target: &TargetMeta, pts: Option<gst::ClockTime>) {
        let Some(picture) = lock(&self.stream).picture else { return };
        let age = self.age(target, pts);
        self.with_worker(|worker| {
            let inbox = worker.inbox();
            inbox.see(Sight {
                visibility: target.state.into(),
                id: target.id,
                centroid: target.centroid,
                bounds: target.bounds,
                velocity: target.velocity,
                ego_velocity: target.ego_velocity,
                size: picture.size,
                aspect: picture.aspect,
                taken_at: inbox.now().saturating_sub(age),
            });
        });
    }

    /// The time of a step, where time goes by the stream's.
    fn lockstep_time(&self, pts: Option<gst::ClockTime>) -> Option<Duration> {
        lock(&self.stream).lockstep.then(|| self.running_time(pts)).flatten().map(Duration::from)
    }

    /// Waits, not under the lock, until the camera has answered what is due.
    fn settle(&self) {
        let settled = lock(&self.worker).as_ref().map(|worker| worker.inbox().settled());
        // An error says that the worker is gone; it has told why.
        let _ = settled.map(|settled| settled.recv());
    }

    fn running_time(&self, pts: Option<gst::ClockTime>) -> Option<gst::ClockTime> {
        self.obj().segment().downcast_ref::<gst::ClockTime>().and_then(|segment| segment.to_running_time(pts))
    }

    /// How long ago the picture was taken, as far as its timestamp tells.
    fn age(&self, target: &TargetMeta, pts: Option<gst::ClockTime>) -> Duration {
        if lock(&self.stream).lockstep {
            return Duration::ZERO;
        }
        let sink = self.obj();
        let captured = target.capture_time.or_else(|| self.running_time(pts));
        let age =
            sink.current_running_time().zip(captured).map(|(now, captured)| now.saturating_sub(captured));
        age.filter(|age| *age <= OLDEST_PICTURE).unwrap_or_default().into()
    }

    fn rest(&self) {
        // The wait is for the worker's answer, not under the lock that everybody else needs.
        let rest = lock(&self.worker).as_ref().map(|worker| worker.inbox().rest());
        if rest.is_some_and(|rest| !worker::wait_for(&rest, REST_WAIT)) {
            gst::warning!(CAT, imp = self, "no stop confirmed within {REST_WAIT:?}; trying on");
        }
    }

    pub(super) fn with_worker(&self, action: impl FnOnce(&Worker)) {
        if let Some(worker) = &*lock(&self.worker) {
            action(worker);
        }
    }

    fn warn_of_meta(&self, err: &ptztrack_contract::ContractError) {
        if !std::mem::replace(&mut lock(&self.stream).warned, true) {
            gst::element_imp_warning!(
                self,
                gst::StreamError::Format,
                ("a target meta cannot be read ({err}); are all plugins of the same version?")
            );
        }
    }

    /// Tells upstream what the camera does, if that has changed.
    fn push_news(&self) {
        let Some(status) = lock(&self.news).take() else { return };
        let aspect = lock(&self.stream).picture.map(|picture| picture.aspect);
        let event = camera_event(&status, aspect);
        // Nobody upstream needs to care.
        let _ = self.obj().sink_pad().push_event(event.to_event());
    }

    fn stats(&self) -> gst::Structure {
        let statistics = lock(&self.worker).as_ref().map(Worker::statistics);
        statistics.map_or_else(Statistics::stopped, |statistics| statistics.to_structure())
    }
}
