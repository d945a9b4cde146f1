// SPDX-License-Identifier: MPL-2.0

//! What became of an actuation, and what the camera told.

use std::mem;

use super::{Access, Actuation, ActuatorStatus, Capabilities, Motion, Servo};
use crate::Time;
use crate::model::{PanTilt, Position};

impl Servo {
    /// The camera accepted what was sent then: that is when it can begin to act, however late the answer is.
    pub fn accepted(&mut self, actuation: &Actuation, sent: Time, now: Time) {
        match actuation {
            Actuation::Move(Motion::Velocity { pan, tilt, zoom }) => {
                let parts = self.axes.exchanged((*pan, *tilt));
                self.camera.history.push_parts(sent, parts, &self.camera.speed_map);
                if let Some(zoom) = zoom {
                    self.zoom.commanded(sent, *zoom);
                }
            }
            _ => self.camera.history.push(sent, PanTilt::default()),
        }
        match actuation {
            Actuation::Move(motion) if motion.is_point_to_point() => {
                self.moves.begin(sent);
                self.frozen_picture.sent_off(sent);
            }
            // A move under way, from before the mode was changed, is over.
            _ => self.moves.rest(now),
        }
        if actuation.is_rest() {
            self.controller.levels = (0, 0);
        }
        match actuation {
            Actuation::Move(motion) if self.leads_home(motion) => {
                self.home.taken();
                self.zoom.leave();
            }
            _ if !actuation.is_rest() => self.home.strayed(),
            _ => {}
        }
    }

    /// It may have acted on this, or may yet.
    pub fn unanswered(&mut self, actuation: &Actuation, now: Time) {
        let Actuation::Move(Motion::Velocity { zoom, .. }) = actuation else { return };
        // A move home that was under way may be over by it.
        self.moves.rest(now);
        self.home.doubted();
        if let Some(zoom) = zoom.filter(|zoom| *zoom != 0.0) {
            self.zoom.commanded(now, zoom);
        }
    }

    /// The camera told where it looked at a time, or does not tell. Returns whether it has arrived by this.
    pub fn told_position(
        &mut self,
        position: Option<Position>,
        at: Time,
        actuator: &ActuatorStatus,
        now: Time,
    ) -> bool {
        if let Some(position) = position {
            self.take_position(position, at, actuator);
        }
        let delays = self.delays();
        let arrived = self.moves.position(position, now, &delays);
        if !self.moves.under_way() && !self.zooms_by_picture() {
            self.zoom.told(at, position.and_then(|position| position.zoom), &delays);
        }
        // It came before this was known.
        if let Some(measurement) = self.target.as_ref().map(|target| target.measurement).filter(|_| arrived) {
            self.measure_height(&measurement, actuator.mode);
        }
        if position.is_some() {
            self.revise();
        }
        arrived
    }

    fn take_position(&mut self, position: Position, at: Time, actuator: &ActuatorStatus) {
        let before = mem::replace(&mut self.camera.position, position);
        self.home.positioned(position);
        if position.zoom != before.zoom {
            self.calibration.zoomed();
        }
        let Some(place) = position.pan_tilt() else { return };
        if actuator.access == Access::Ours {
            self.calibration.positioned(at, place);
        }
        self.limits.told(at, place);
    }

    /// The camera told what it can. What was learned by other assumptions is void; what is told once more is no other.
    pub fn told_capabilities(&mut self, capabilities: Capabilities) {
        let before = mem::replace(&mut self.camera.capabilities, capabilities);
        let now = &self.camera.capabilities;
        let wide_deg = self.settings.fov_deg;
        let other_field = now.fov_zoomed_out_deg(wide_deg) != before.fov_zoomed_out_deg(wide_deg);
        if (&now.speeds, now.speed_unit) != (&before.speeds, before.speed_unit) {
            self.assume_speeds();
        }
        if other_field {
            self.calibration.assume_field();
        }
        self.revise();
    }
}
