// SPDX-License-Identifier: MPL-2.0

use std::sync::mpsc::SyncSender;
use std::sync::{LazyLock, Mutex, Weak};
use std::time::Duration;

use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_base::prelude::*;
use gst_base::subclass::prelude::*;
use ptztrack_contract::RefusedValues;

use super::camera_task::{self, CameraTask, Event, Predecessor};
use super::clock::Clock;
use super::events::{PendingStatus, camera_event};
use super::outbox::Outbox;
use super::picture::Picture;
use super::properties::Property;
use super::settings::{Settings, environment};
use super::statistics::Statistics;
use super::stream::Stream;
use super::watchdog::watchdog;
use crate::control_loop::Status;
use crate::lock::lock;

pub(super) static CAT: LazyLock<gst::DebugCategory> = LazyLock::new(|| {
    gst::DebugCategory::new("vapixptzsink", gst::DebugColorFlags::empty(), Some("VAPIX PTZ servo"))
});

/// Longest wait for the camera's yes at EOS.
const REST_WAIT: Duration = Duration::from_secs(1);

/// Whether the streaming thread waits for the camera, which it does with `lockstep` only.
#[derive(Debug, Default)]
enum Waiting {
    #[default]
    Nobody,
    /// Until it is sent this.
    By(Weak<SyncSender<()>>),
    /// Nobody may: a flush or a change of state is under way.
    NotAllowed,
}

/// No lock is held while anything is posted, pushed or waited for. Of those here only two are held together, in this
/// order: `settings`, `task`, so that changes come to the camera task in the order in which they were made.
#[derive(Default)]
pub struct VapixPtzSink {
    pub(super) settings: Mutex<Settings>,
    pub(super) task: Mutex<Option<CameraTask>>,
    /// Of the camera tasks so far, that may still be about to stop their cameras.
    predecessors: Mutex<Vec<Predecessor>>,
    pub(super) stream: Mutex<Stream>,
    waiting: Mutex<Waiting>,
    /// What upstream was not told yet; never pushed by the camera task, which would wait for whoever hears it.
    pending_status: Mutex<PendingStatus>,
    /// Held by whoever pushes it; nobody waits for this one.
    pushing: Mutex<()>,
    pub(super) refused: RefusedValues,
}

#[glib::object_subclass]
impl ObjectSubclass for VapixPtzSink {
    const NAME: &'static str = "GstVapixPtzSink";
    type Type = super::VapixPtzSink;
    type ParentType = gst_base::BaseSink;
}

impl ObjectImpl for VapixPtzSink {
    fn properties() -> &'static [glib::ParamSpec] {
        static PROPERTIES: LazyLock<Vec<glib::ParamSpec>> = LazyLock::new(|| {
            let stats = glib::ParamSpecBoxed::builder::<gst::Structure>("stats")
                .blurb("What it does and what it knows of the camera: state; dead-man, which is off, ready, armed or unavailable; commands-sent, commands-failed, commands-coalesced; round-trip and round-trip-average in nanoseconds; pan-rate and tilt-rate in degrees per second; where known mode, pan and tilt in degrees, zoom in zoom steps, the camera's own limits camera-pan-min, camera-pan-max, camera-tilt-min, camera-tilt-max in degrees and camera-zoom-min, camera-zoom-max in zoom steps, camera-endless-pan, field-of-view in degrees, latency in nanoseconds, speeds of the steps 1 to 100 in degrees per second, last-error")
                .read_only()
                .build();
            Property::all().iter().map(|property| property.spec.clone()).chain([stats]).collect()
        });
        &PROPERTIES
    }

    fn set_property(&self, id: usize, value: &glib::Value, _: &glib::ParamSpec) {
        if let Some(property) = Property::numbered(id) {
            self.change(property, value);
        }
    }

    fn property(&self, id: usize, _: &glib::ParamSpec) -> glib::Value {
        match Property::numbered(id) {
            Some(property) => property.get(&lock(&self.settings)),
            None => self.stats().to_value(),
        }
    }

    fn constructed(&self) {
        self.parent_constructed();
        let sink = self.obj();
        // A late target is worth nothing, and a pipeline must not wait for this sink to preroll.
        sink.set_sync(false);
        sink.set_async(false);
        sink.set_qos(false);
        // A buffer kept here would be shared, and copied whole by whoever draws into it in another branch.
        sink.set_property("enable-last-sample", false);
    }

    fn dispose(&self) {
        // There is one if the element was never brought to NULL.
        self.finish_task();
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
            self.start_task()?;
        }
        if transition == gst::StateChange::PausedToPlaying {
            self.with_task(CameraTask::play);
        }
        let result = self.parent_change_state(transition);
        match transition {
            gst::StateChange::PlayingToPaused => {
                // The base class may go on rendering: where it was PLAYING for so short a time that the streaming
                // thread did not wake from its preroll, it takes the preroll for done and waits for none.
                self.with_task(CameraTask::pause);
            }
            gst::StateChange::PausedToReady => self.finish_task(),
            gst::StateChange::ReadyToPaused if result.is_err() => self.finish_task(),
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
                self.with_task(|task| drop(task.mailbox().rest()));
                return handled;
            }
            _ => {}
        }
        self.parent_event(event)
    }

    fn render(&self, buffer: &gst::Buffer) -> Result<gst::FlowSuccess, gst::FlowError> {
        let now = self.time();
        lock(&self.pending_status).repeat(now);
        self.push_status();
        let step = self.lockstep_time(buffer.pts());
        if let Some(time) = step {
            // What is still under way, as the first questions to the camera are, belongs to the time before.
            self.settle();
            self.with_task(|task| task.mailbox().hold_at(time));
        }
        self.measure(buffer);
        if step.is_some() {
            self.settle();
        }
        Ok(gst::FlowSuccess::Ok)
    }

    /// Whoever waits in `render` for the camera returns at once, and so does whoever would wait: a flush does not wait
    /// for the network.
    fn unlock(&self) -> Result<(), gst::ErrorMessage> {
        let waiting = std::mem::replace(&mut *lock(&self.waiting), Waiting::NotAllowed);
        if let Waiting::By(waker) = waiting
            && let Some(waker) = waker.upgrade()
        {
            // It is awake already where that fails.
            let _ = waker.try_send(());
        }
        Ok(())
    }

    fn unlock_stop(&self) -> Result<(), gst::ErrorMessage> {
        *lock(&self.waiting) = Waiting::Nobody;
        Ok(())
    }
}

impl VapixPtzSink {
    fn start_task(&self) -> Result<(), gst::StateChangeError> {
        let (settings, refused) = {
            let mut settings = lock(&self.settings);
            let refused = settings.judge_limits();
            (settings.clone(), refused)
        };
        self.warn_of_refused(refused);
        let Some(client) = settings.client(environment) else {
            gst::element_imp_error!(
                self,
                gst::ResourceError::NotFound,
                ("no camera: set `location`, for example location=http://192.168.0.90")
            );
            return Err(gst::StateChangeError);
        };
        *lock(&self.stream) = Stream::new(settings.lockstep);
        let clock = if settings.lockstep { Clock::held() } else { Clock::running() };
        *lock(&self.pending_status) = PendingStatus::default();
        gst::debug!(CAT, imp = self, "camera {} at {}", client.camera, client.location);
        let element = self.obj().downgrade();
        let told = element.clone();
        let outbox = Outbox::new(move |event| {
            if let Some(element) = told.upgrade() {
                element.imp().tell(event);
            }
        })
        .map_err(|reason| {
            gst::element_imp_error!(self, gst::LibraryError::Init, ("no thread for messages: {reason}"));
            gst::StateChangeError
        })?;
        let watchdog = watchdog(&settings, self.obj().upcast_ref());
        let task = CameraTask::start(client, settings.servo(), clock, watchdog, move |event| {
            if let Some(element) = element.upgrade() {
                element.imp().happened(event, &outbox);
            }
        })
        .map_err(|reason| {
            gst::element_imp_error!(self, gst::ResourceError::Settings, ("{reason}"));
            gst::StateChangeError
        })?;
        {
            let mut predecessors = lock(&self.predecessors);
            predecessors.retain(|predecessor| !predecessor.is_void() && !task.succeed(predecessor));
            predecessors.push(task.predecessor());
        }
        self.install(task, &settings);
        Ok(())
    }

    fn finish_task(&self) {
        // Waited for without the lock.
        let task = lock(&self.task).take();
        drop(task);
    }

    /// The time of a step, where time goes by the stream's.
    fn lockstep_time(&self, pts: Option<gst::ClockTime>) -> Option<Duration> {
        lock(&self.stream).lockstep.then(|| self.running_time(pts)).flatten().map(Duration::from)
    }

    /// Waits, not under the lock, until the camera has answered what is due, or [`Self::unlock`] is called.
    fn settle(&self) {
        let Some((settled, waker)) = lock(&self.task).as_ref().map(|task| task.mailbox().settled()) else {
            return;
        };
        match &mut *lock(&self.waiting) {
            Waiting::NotAllowed => return,
            waiting => *waiting = Waiting::By(waker),
        }
        // An error says that the camera task is gone; it has told why.
        let _ = settled.recv();
    }

    pub(super) fn running_time(&self, pts: Option<gst::ClockTime>) -> Option<gst::ClockTime> {
        self.obj().segment().downcast_ref::<gst::ClockTime>().and_then(|segment| segment.to_running_time(pts))
    }

    fn rest(&self) {
        // The wait is for the camera task's answer, not under the lock that everybody else needs.
        let rest = lock(&self.task).as_ref().map(|task| task.mailbox().rest());
        if rest.is_some_and(|rest| !camera_task::wait_for(&rest, REST_WAIT)) {
            gst::warning!(CAT, imp = self, "no stop confirmed within {REST_WAIT:?}; retrying");
        }
    }

    pub(super) fn with_task(&self, action: impl FnOnce(&CameraTask)) {
        if let Some(task) = &*lock(&self.task) {
            action(task);
        }
    }

    /// The camera task's.
    pub(super) fn time(&self) -> Duration {
        lock(&self.task).as_ref().map_or(Duration::ZERO, |task| task.mailbox().now())
    }

    /// Tells upstream what the camera does, if that has changed. Whoever comes while somebody else does leaves it to him,
    /// so that the last to be told is the newest.
    pub(super) fn push_status(&self) {
        while lock(&self.pending_status).is_due() {
            let Ok(_pushing) = self.pushing.try_lock() else { return };
            let now = self.time();
            let Some(status) = lock(&self.pending_status).take(now) else { continue };
            let aspect = lock(&self.stream).picture.map(|picture| picture.aspect);
            let mounting = lock(&self.settings).servo.mounting;
            let event = camera_event(&status, &mounting, aspect);
            // Nobody upstream needs to care.
            let _ = self.obj().sink_pad().push_event(event.to_event());
        }
    }

    /// Keeps what upstream is to be told; the streaming thread tells it. But that the camera rests is told where no buffer
    /// comes any more too: whoever believes that it moves looks for nobody.
    pub(super) fn status_changed(&self, status: Status, outbox: &Outbox) {
        lock(&self.pending_status).changed(status);
        // In lockstep upstream hears of it with a buffer only, the same in every run.
        if !status.moving && !lock(&self.stream).lockstep {
            outbox.leave(Event::Status(status));
        }
    }

    fn stats(&self) -> gst::Structure {
        let statistics = lock(&self.task).as_ref().map(CameraTask::statistics);
        statistics.map_or_else(Statistics::stopped, |statistics| statistics.to_structure())
    }
}
