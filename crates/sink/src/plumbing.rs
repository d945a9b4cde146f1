// SPDX-License-Identifier: MPL-2.0

use std::iter::successors;
use std::sync::mpsc::SyncSender;
use std::sync::{Mutex, Weak};
use std::time::Duration;

use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_base::prelude::*;
use gst_base::subclass::prelude::*;
use ptztrack_contract::RefusedValues;

use ptztrack_contract::lock::lock;
use session::task::{CameraTask, Clock, Event, Outbox, wait_for};
use session::{Client, Status};

use crate::Particulars;
use crate::events::{PendingStatus, camera_event};
use crate::measure::{Measuring, nanoseconds};
use crate::messages::Telling;
use crate::picture::Picture;
use crate::properties::Property;
use crate::setters::Setting;
use crate::settings::{Settings, environment};
use crate::statistics::stats;
use crate::stream::Stream;
use crate::watchdog::watchdog;

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
#[derive(Debug)]
pub struct Core {
    pub(crate) settings: Mutex<Settings>,
    pub(crate) task: Mutex<Option<CameraTask>>,
    pub(crate) stream: Mutex<Stream>,
    waiting: Mutex<Waiting>,
    /// What upstream was not told yet; never pushed by the camera task, which would wait for whoever hears it.
    pending_status: Mutex<PendingStatus>,
    /// Held by whoever pushes it; nobody waits for this one.
    pushing: Mutex<()>,
    pub(crate) refused: RefusedValues,
}

impl Core {
    /// Of an element just made, with these defaults.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings: Mutex::new(settings),
            task: Mutex::default(),
            stream: Mutex::default(),
            waiting: Mutex::default(),
            pending_status: Mutex::default(),
            pushing: Mutex::default(),
            refused: RefusedValues::default(),
        }
    }
}

/// The element that steers a camera by some protocol.
pub trait PtzSink: BaseSinkImpl + ObjectSubclass<Type: Send + Sync> {
    /// What speaks the protocol.
    type Client: Client;

    /// What it is called, and what belongs to it.
    const PARTICULARS: Particulars;

    /// What sinks of all protocols have.
    fn core(&self) -> &Core;

    /// Its properties but `stats`, which comes last: GObject counts them from 1.
    fn table() -> &'static [Property];

    /// Where it logs.
    fn category() -> gst::DebugCategory;
}

/// The specification of the property `stats`.
pub fn stats_spec() -> glib::ParamSpec {
    glib::ParamSpecBoxed::builder::<gst::Structure>("stats")
                .blurb("What it does and what it knows of the camera: state; dead-man, which is off, ready, armed or unavailable; commands-sent, commands-failed, commands-coalesced; round-trip and round-trip-average in nanoseconds; pan-rate and tilt-rate in degrees per second; where known mode, pan and tilt in degrees, zoom in zoom steps, the camera's own limits camera-pan-min, camera-pan-max, camera-tilt-min, camera-tilt-max in degrees and camera-zoom-min, camera-zoom-max in zoom steps, camera-endless-pan, field-of-view in degrees, latency in nanoseconds, speeds of the steps 1 to 100 in degrees per second, last-error")
                .read_only()
                .build()
}

/// What GObject and GStreamer ask of a sink, whatever protocol it speaks.
pub trait Plumbing: PtzSink {
    /// Sets the property of this number.
    fn set(&self, id: usize, value: &glib::Value) {
        if let Some(property) = numbered::<Self>(id) {
            self.change(property, value);
        }
    }

    /// The value of the property of this number.
    fn get(&self, id: usize) -> glib::Value {
        match numbered::<Self>(id) {
            Some(property) => property.get(&lock(&self.core().settings)),
            None => self.stats().to_value(),
        }
    }

    /// Sets what the base class has otherwise.
    fn set_up(&self) {
        let obj = self.obj();
        let sink = obj.upcast_ref::<gst_base::BaseSink>();
        // A late target is worth nothing, and a pipeline must not wait for this sink to preroll.
        sink.set_sync(false);
        sink.set_async(false);
        sink.set_qos(false);
        // A buffer kept here would be shared, and copied whole by whoever draws into it in another branch.
        sink.set_property("enable-last-sample", false);
    }

    /// Brings the element from state to state; `parent`: the base class.
    fn bring(&self, transition: gst::StateChange) -> Result<gst::StateChangeSuccess, gst::StateChangeError> {
        // Not in the base class' start() and stop(): those are at NULL to READY and back, and
        // what can be set in READY shall count.
        if transition == gst::StateChange::ReadyToPaused {
            self.start_task()?;
        }
        if transition == gst::StateChange::PausedToPlaying {
            let now = self.time();
            lock(&self.core().stream).resume(now);
            self.with_task(CameraTask::play);
        }
        if transition == gst::StateChange::PlayingToPaused {
            let running_time = self.obj().current_running_time().map(nanoseconds);
            lock(&self.core().stream).suspend(running_time);
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

    /// Takes the shape of the picture.
    fn take_caps(&self, caps: &gst::Caps) -> Result<(), gst::LoggableError> {
        let picture = Picture::of(caps)
            .ok_or_else(|| gst::loggable_error!(Self::category(), "caps without a size: {caps}"))?;
        lock(&self.core().stream).shows(picture);
        // Of a field of view it can only be said now how high it is.
        lock(&self.core().pending_status).renew();
        Ok(())
    }

    /// Pixels are never read here, so any layout will do: a `tee` offers upstream only what all its branches take.
    fn propose(&self, query: &mut gst::query::Allocation) -> Result<(), gst::LoggableError> {
        query.add_allocation_meta::<gst_video::VideoMeta>(None);
        self.parent_propose_allocation(query)
    }

    /// Has the camera stopped where the stream ends.
    fn heed(&self, event: gst::Event) -> bool {
        match event.type_() {
            gst::EventType::Eos => self.rest(),
            gst::EventType::FlushStop => lock(&self.core().stream).seek(),
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

    /// Leaves what a buffer tells for the camera task.
    fn take(&self, buffer: &gst::Buffer) -> Result<gst::FlowSuccess, gst::FlowError> {
        let now = self.time();
        lock(&self.core().pending_status).repeat(now);
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
    fn wake(&self) -> Result<(), gst::ErrorMessage> {
        let waiting = std::mem::replace(&mut *lock(&self.core().waiting), Waiting::NotAllowed);
        if let Waiting::By(waker) = waiting
            && let Some(waker) = waker.upgrade()
        {
            // It is awake already where that fails.
            let _ = waker.try_send(());
        }
        Ok(())
    }

    /// Whoever waits may wait again.
    fn let_wait(&self) -> Result<(), gst::ErrorMessage> {
        *lock(&self.core().waiting) = Waiting::Nobody;
        Ok(())
    }

    /// Begins to talk to the camera.
    fn start_task(&self) -> Result<(), gst::StateChangeError> {
        let (settings, refused) = {
            let mut settings = lock(&self.core().settings);
            let refused = settings.judge_limits();
            (settings.clone(), refused)
        };
        self.warn_of_refused(refused);
        let Some(client) = settings.client(environment) else {
            gst::element_imp_error!(
                self,
                gst::ResourceError::NotFound,
                (
                    "no camera: `location` is not set, or is no address. Set it, for example location={}",
                    Self::PARTICULARS.example
                )
            );
            return Err(gst::StateChangeError);
        };
        *lock(&self.core().stream) = Stream::new(settings.lockstep);
        let clock = if settings.lockstep { Clock::held() } else { Clock::running() };
        *lock(&self.core().pending_status) = PendingStatus::default();
        gst::debug!(Self::category(), imp = self, "camera {} at {}", client.channel, client.location);
        let element = self.obj().downgrade();
        let told = element.clone();
        let outbox = Outbox::new(move |event| {
            if let Some(element) = told.upgrade() {
                // GStreamer hands a bin what its elements post without holding it: an application may drop it at any time.
                let _bins: Vec<gst::Object> = successors(element.parent(), GstObjectExt::parent).collect();
                Self::from_obj(&element).tell(event);
            }
        })
        .map_err(|reason| {
            gst::element_imp_error!(self, gst::LibraryError::Init, ("no thread for messages: {reason}"));
            gst::StateChangeError
        })?;
        let watchdog = watchdog(&settings, &Self::PARTICULARS, self.obj().upcast_ref());
        let task =
            CameraTask::start::<Self::Client>(client, settings.control(), clock, watchdog, move |event| {
                if let Some(element) = element.upgrade() {
                    Self::from_obj(&element).happened(event, &outbox);
                }
            })
            .map_err(|reason| {
                gst::element_imp_error!(self, gst::ResourceError::Settings, ("{reason}"));
                gst::StateChangeError
            })?;
        self.install(task, &settings);
        Ok(())
    }

    /// Ends the conversation with the camera, which is stopped.
    fn finish_task(&self) {
        // Waited for without the lock.
        let task = lock(&self.core().task).take();
        drop(task);
    }

    /// The time of a step, where time goes by the stream's.
    fn lockstep_time(&self, pts: Option<gst::ClockTime>) -> Option<Duration> {
        lock(&self.core().stream).lockstep.then(|| self.running_time(pts)).flatten().map(Duration::from)
    }

    /// Waits, not under the lock, until the camera has answered what is due, or [`Self::unlock`] is called.
    fn settle(&self) {
        let Some((settled, waker)) = lock(&self.core().task).as_ref().map(|task| task.mailbox().settled())
        else {
            return;
        };
        match &mut *lock(&self.core().waiting) {
            Waiting::NotAllowed => return,
            waiting => *waiting = Waiting::By(waker),
        }
        // An error says that the camera task is gone; it has told why.
        let _ = settled.recv();
    }

    /// The running time of a buffer, where the segment has one.
    fn running_time(&self, pts: Option<gst::ClockTime>) -> Option<gst::ClockTime> {
        self.obj().segment().downcast_ref::<gst::ClockTime>().and_then(|segment| segment.to_running_time(pts))
    }

    /// Has the camera stopped, and waits for that for a while.
    fn rest(&self) {
        // The wait is for the camera task's answer, not under the lock that everybody else needs.
        let rest = lock(&self.core().task).as_ref().map(|task| task.mailbox().rest());
        if rest.is_some_and(|rest| !wait_for(&rest, REST_WAIT)) {
            gst::warning!(Self::category(), imp = self, "no stop confirmed within {REST_WAIT:?}; retrying");
        }
    }

    /// Does something with the camera task, where there is one.
    fn with_task(&self, action: impl FnOnce(&CameraTask)) {
        if let Some(task) = &*lock(&self.core().task) {
            action(task);
        }
    }

    /// The camera task's.
    fn time(&self) -> servo::Time {
        lock(&self.core().task).as_ref().map_or(servo::Time::ZERO, |task| task.mailbox().now())
    }

    /// Tells upstream what the camera does, if that has changed. Whoever comes while somebody else does leaves it to him,
    /// so that the last to be told is the newest.
    fn push_status(&self) {
        while lock(&self.core().pending_status).is_due() {
            let Ok(_pushing) = self.core().pushing.try_lock() else { return };
            let now = self.time();
            let Some(status) = lock(&self.core().pending_status).take(now) else { continue };
            let aspect = lock(&self.core().stream).picture().map(|picture| picture.aspect);
            let mounting = lock(&self.core().settings).servo.mounting;
            let event = camera_event(&status, &mounting, aspect);
            // Nobody upstream needs to care.
            let _ = self.obj().sink_pad().push_event(event.to_event());
        }
    }

    /// Keeps what upstream is to be told; the streaming thread tells it. But that the camera rests is told where no buffer
    /// comes any more too: whoever believes that it moves looks for nobody.
    fn status_changed(&self, status: Status, outbox: &Outbox) {
        lock(&self.core().pending_status).changed(status);
        // In lockstep upstream hears of it with a buffer only, the same in every run.
        if !status.moving && !lock(&self.core().stream).lockstep {
            outbox.leave(Event::Status(status));
        }
    }

    /// The value of the property `stats`.
    fn stats(&self) -> gst::Structure {
        let statistics = lock(&self.core().task).as_ref().map(CameraTask::statistics);
        stats(Self::PARTICULARS.name, statistics.as_ref())
    }
}

impl<S: PtzSink> Plumbing for S {}

/// The property with a GObject number, which counts from 1.
fn numbered<S: PtzSink>(id: usize) -> Option<&'static Property> {
    S::table().get(id.checked_sub(1)?)
}
