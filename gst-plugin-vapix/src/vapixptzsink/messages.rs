//! What the worker tells, told to the user.

use gst::prelude::*;
use gst::subclass::prelude::*;
use ptztrack_contract::{CameraChange, CameraMessage, Times};

use super::imp::{CAT, VapixPtzSink};
use super::worker::Event;
use crate::control_loop::LoopEvent;
use crate::lock::lock;
use vapix::session::{ConnectionChange, ControlOwner, SessionEvent};

impl VapixPtzSink {
    /// Called by the worker.
    pub(super) fn happened(&self, event: Event) {
        match event {
            Event::Exchanged { request, failure: None, round_trip } => {
                gst::log!(CAT, imp = self, "{request} answered in {round_trip:?}");
            }
            Event::Exchanged { request, failure: Some(err), round_trip } => {
                gst::debug!(CAT, imp = self, "{request} failed after {round_trip:?}: {err}");
            }
            Event::Loop(LoopEvent::Session(SessionEvent::Connection(change))) => self.link_changed(&change),
            Event::Loop(LoopEvent::Session(SessionEvent::Discovered(camera))) => gst::info!(CAT, imp = self, "the camera: {camera}"),
            Event::Loop(LoopEvent::Session(SessionEvent::Moving)) => self.post(CameraChange::Moving, "the camera moves"),
            Event::Loop(LoopEvent::Session(SessionEvent::Stopped)) => self.post(CameraChange::Stopped, "the camera has stopped"),
            Event::Loop(LoopEvent::AtLimit) => {
                self.post(
                    CameraChange::AtLimit,
                    "the target is beyond the end of the camera's pan or tilt range, or of `pan-min` … `tilt-max`",
                );
            }
            Event::Loop(LoopEvent::Session(SessionEvent::LimitsUnkept)) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera does not tell where it looks: `pan-min` … `tilt-max` cannot be kept. Set limits in the camera itself")
            ),
            Event::Loop(LoopEvent::Oscillating(gain_scale)) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                (
                    "the camera swings to and fro about the target; its speed is lowered to {:.0} % until it is calm. Lower `gain`, or set `latency` and `camera-speed` right",
                    gain_scale * 100.0
                )
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::TakenOver(ControlOwner::Operator))) => self.post(
                CameraChange::TakenOver,
                "somebody else moves the camera; it is not steered until nobody has moved it for `override-timeout`",
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::TakenOver(ControlOwner::Queue))) => self.post(
                CameraChange::TakenOver,
                "somebody else is in control by the camera's control queue; it is not steered until our turn",
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::Resumed)) => self.post(CameraChange::Resumed, "the camera is steered again"),
            Event::Loop(LoopEvent::Session(SessionEvent::Orphan)) => {
                gst::warning!(CAT, imp = self, "the camera was already moving when it was met: stopping it");
            }
            Event::Loop(LoopEvent::Session(SessionEvent::NoSuchPreset(name))) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera tells of no preset `{name}`; it stays where it is. Correct `home`")
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::HomeRefused(err))) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("the camera does not go home: {err}; it stays where it is. Correct `home`")
            ),
            Event::Loop(LoopEvent::Session(SessionEvent::Mode(mode))) => gst::element_imp_info!(
                self,
                gst::ResourceError::Settings,
                ("the camera is moved by mode `{}` now, the best of those that it takes; `mode` stays as it is set", mode.name())
            ),
            Event::Status(status) => *lock(&self.news) = Some(status),
            Event::GaveUp { halted: true } => gst::element_imp_warning!(
                self,
                gst::ResourceError::Write,
                ("the camera has not confirmed its stop and may still be moving; as it refuses `user` and `password`, nothing more is sent: stop it by hand")
            ),
            Event::GaveUp { halted: false } => gst::element_imp_warning!(
                self,
                gst::ResourceError::Write,
                ("the camera has not confirmed its stop in time and may still be moving; trying on for a minute, or stop it by hand")
            ),
            Event::Died(reason) => gst::element_imp_error!(
                self,
                gst::LibraryError::Failed,
                ("the camera's task broke ({reason}); the camera may still be moving, trying on for a minute to stop it; restart the pipeline")
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
        gst::info!(CAT, imp = self, "{}: {detail}", change.name());
        let sink = self.obj();
        let times = Times { running_time: sink.current_running_time(), ..Times::default() };
        let message = CameraMessage { change, times, detail: detail.to_owned() };
        let message = gst::message::Element::builder(message.to_structure()).src(&*sink).build();
        // Without a bus there is nobody to tell.
        let _ = sink.post_message(message);
    }
}
