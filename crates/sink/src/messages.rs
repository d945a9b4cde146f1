// SPDX-License-Identifier: MPL-2.0

//! What the camera task tells, told to the user.

use gst::prelude::*;
use gst::subclass::prelude::*;
use ptztrack_contract::{CameraChange, CameraMessage, MOVE_REFUSED, Times};
use servo::AxisFinding;

use session::session::{ConnectionChange, ControlOwner};
use session::task::{Event, Outbox};
use session::{LoopEvent, SessionEvent};

use crate::plumbing::{Plumbing, PtzSink};

/// Tells the user what the camera task tells.
pub trait Telling: PtzSink {
    /// Called by the camera task, which is not to wait: what may take its time is left in the outbox.
    fn happened(&self, event: Event, outbox: &Outbox) {
        match event {
            Event::Exchanged { request, failure: None, round_trip } => {
                gst::log!(Self::category(), imp = self, "{request} answered in {round_trip:?}");
            }
            Event::Exchanged { request, failure: Some(err), round_trip } => {
                gst::debug!(Self::category(), imp = self, "{request} failed after {round_trip:?}: {err}");
            }
            Event::Status(status) => self.status_changed(status, outbox),
            event => outbox.leave(event),
        }
    }

    /// Logs and posts what is to be told.
    fn tell(&self, event: Event) {
        match event {
            Event::Exchanged { .. } => {}
            // Who waits no longer is awake already.
            Event::Settled(waiting) => drop(waiting.try_send(())),
            Event::Status(_) => self.push_status(),
            Event::Loop(LoopEvent::Session(SessionEvent::Connection(change))) => self.link_changed(&change),
            Event::Loop(LoopEvent::Session(SessionEvent::Discovered(camera))) => gst::info!(Self::category(), imp = self, "the camera: {camera}"),
            Event::Loop(LoopEvent::Session(SessionEvent::Moving)) => self.post(CameraChange::Moving, "the camera moves"),
            Event::Loop(LoopEvent::Session(SessionEvent::Stopped)) => self.post(CameraChange::Stopped, "the camera has stopped"),
            Event::Loop(LoopEvent::AtLimit) => {
                self.post(
                    CameraChange::AtLimit,
                    "the target is beyond the camera's pan or tilt range, or beyond `pan-min`, `pan-max`, `tilt-min` or `tilt-max`",
                );
            }
            Event::Loop(LoopEvent::LimitsUnkept) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera does not report its position, so `pan-min`, `pan-max`, `tilt-min` and `tilt-max` cannot be enforced. Set limits in the camera itself")
            ),
            Event::Loop(LoopEvent::NoZoom) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera reports no zoom, or its picture does not change when it zooms: `auto-zoom` has no effect")
            ),
            Event::Loop(LoopEvent::ZoomLimitsUnkept) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera does not report what its zoom steps magnify, so `zoom-min` and `zoom-max` cannot be enforced. Set limits in the camera itself")
            ),
            Event::Loop(LoopEvent::Axes(AxisFinding::Exchanged)) => gst::element_imp_info!(
                self,
                gst::ResourceError::Settings,
                ("the camera tilts where it is told to pan, and pans where it is told to tilt: it is steered accordingly from here on")
            ),
            Event::Loop(LoopEvent::Axes(AxisFinding::Inverted)) => gst::element_imp_info!(
                self,
                gst::ResourceError::Settings,
                ("an axis of the camera turns the picture opposite to its setting: this is allowed for from now on. `invert-pan` or `invert-tilt` makes it right from the start")
            ),
            Event::Loop(LoopEvent::PictureFrozen) => gst::element_imp_warning!(
                self,
                gst::StreamError::Failed,
                ("the picture stays the same although the camera was told to turn: its video is frozen, or it does not turn. It is stopped, and steered again as soon as the picture changes. Check the video and whether the camera can turn that way")
            ),
            Event::Loop(LoopEvent::PictureLive) => gst::element_imp_info!(
                self,
                gst::StreamError::Failed,
                ("the picture changes again: the camera is steered by it")
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::StopInVain)) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Write,
                ("the camera accepts every stop, but the picture shows it still turning: another stop command is sent. Check it, and stop it by hand if need be")
            ),
            Event::Loop(LoopEvent::Oscillating(gain_scale)) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                (
                    "the camera oscillates about the target; the gain is lowered to {:.0} % until it is steady. Lower `gain`, or correct `latency` and `camera-speed`",
                    gain_scale * 100.0
                )
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::TakenOver(ControlOwner::Operator))) => self.post(
                CameraChange::TakenOver,
                "somebody else is moving the camera; steering resumes once nobody has moved it for `override-timeout`",
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::TakenOver(ControlOwner::Queue))) => self.post(
                CameraChange::TakenOver,
                "somebody else has control in the camera's control queue; steering resumes when it is our turn",
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::Resumed)) => self.post(CameraChange::Resumed, "the camera is steered again"),
            Event::Loop(LoopEvent::Session(SessionEvent::Orphan)) => {
                gst::warning!(Self::category(), imp = self, "the camera was already moving when the connection was made: stopping it");
            }
            Event::Loop(LoopEvent::NoSuchPreset(name)) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera has no preset `{name}`; it stays where it is. Correct `home`")
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::HomeRefused(err))) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera refuses to move to a position (`home` or `look-at`): {err}; it stays where it is. Correct or unset them"),
                details: gst::Structure::new_empty(MOVE_REFUSED)
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::Mode(mode))) => gst::element_imp_info!(
                self,
                gst::ResourceError::Settings,
                ("the camera does not support the `mode` that is set; it is moved by mode `{}` instead", mode.name())
            ),
            Event::GaveUp { halted: true } => gst::element_imp_warning!(
                self,
                gst::ResourceError::Write,
                ("the camera has not confirmed its stop and may still be moving; because it refuses `user` and `password`, nothing more is sent: stop it by hand")
            ),
            Event::GaveUp { halted: false } => gst::element_imp_warning!(
                self,
                gst::ResourceError::Write,
                ("the camera has not confirmed its stop in time and may still be moving; retrying for a minute. Check it, and stop it by hand if need be")
            ),
            Event::NoWatchdog(reason) => gst::element_imp_warning!(
                self,
                gst::ResourceError::NotFound,
                ("no watchdog process: {reason}. A camera that moves when this process is killed or hangs would go on turning. Install `{}` in `libexec` beside the plugin, or name it by {}_WATCHDOG; `dead-man=false` turns this protection off", Self::PARTICULARS.watchdog, Self::PARTICULARS.environment)
            ),
            Event::Warning(text) => gst::element_imp_warning!(self, gst::ResourceError::Settings, ("{text}")),
            Event::Died(reason) => gst::element_imp_error!(
                self,
                gst::LibraryError::Failed,
                ("the task that talks to the camera failed ({reason}); the camera may still be moving, and stopping it is retried for a minute. Restart the pipeline")
            ),
        }
    }

    fn link_changed(&self, change: &ConnectionChange) {
        match change {
            ConnectionChange::Connected => self.post(CameraChange::Connected, "the camera answers"),
            ConnectionChange::Disconnected(err) => {
                self.post(CameraChange::Disconnected, &err.to_string());
                gst::element_imp_warning!(self, gst::ResourceError::Write, ("{err}. {}", err.advice()));
            }
            ConnectionChange::Refused(err) => {
                self.post(CameraChange::Refused, &err.to_string());
                gst::element_imp_warning!(
                    self,
                    gst::ResourceError::NotAuthorized,
                    ("{err}. {}", err.advice())
                );
            }
        }
    }

    fn post(&self, change: CameraChange, detail: &str) {
        gst::info!(Self::category(), imp = self, "{}: {detail}", change.name());
        let sink = self.obj();
        let times = Times { running_time: sink.current_running_time(), ..Times::default() };
        let message = CameraMessage { change, times, detail: detail.to_owned() };
        let message = gst::message::Element::builder(message.to_structure()).src(&*sink).build();
        // Without a bus there is nobody to tell.
        let _ = sink.post_message(message);
    }
}

impl<S: PtzSink> Telling for S {}
