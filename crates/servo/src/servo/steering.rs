// SPDX-License-Identifier: MPL-2.0

//! From the target's place to what the camera is to do.

use std::time::Duration;

use ptztrack_contract::Point;

use super::{Access, Actuation, ActuatorStatus, Motion, Servo};
use crate::Time;
use crate::control::{ControlLaw, Jump, Mode, ZoomGoal};
use crate::estimation::Measurement;
use crate::model::{PanTilt, Position, View, around_deg, narrower};

impl Servo {
    /// The part of the dead zone that tilt keeps while the camera pans.
    const ZONE_WHILE_PANNING: f64 = 1.0 / 3.0;

    /// A new target is sought at this multiple of the gain. With 2.5 it is nearer in the first second, by 4 %, but passed by more.
    const SEEK_GAIN_FACTOR: f64 = 2.0;

    pub(super) fn velocity(
        &mut self,
        measurement: &Measurement,
        actuator: &ActuatorStatus,
        now: Time,
    ) -> Actuation {
        let law = self.control_law(&self.view(measurement), actuator.interval, now);
        let delays = self.delays();
        let history = &self.camera.history;
        let mut offset = self.estimator.offset(now, history, &delays);
        if self.is_out_of_view() {
            // As fast as it passed it goes on for a moment only: who walks straight on is seen to slow down.
            offset.target = PanTilt::default();
        }
        let wanted = self.controller.rate(&offset, history.rate_at(now), &law);
        let position = self.limits.position(history, delays.command, now);
        let wanted = if self.settings.learn_axes { self.axes.cautious(wanted, history, now) } else { wanted };
        let rate = self.limited(wanted, position, (delays.sum() + actuator.interval).as_secs_f64());
        let (pan, tilt) = self.controller.quantise(rate, &self.camera.speed_map);
        let motion = Motion::Velocity { pan, tilt, zoom: self.zoom_speed(measurement, now) };
        if motion.is_still() { Actuation::Rest } else { Actuation::Move(motion) }
    }

    /// What the zoom is to do; `None` leaves it alone.
    fn zoom_speed(&mut self, measurement: &Measurement, now: Time) -> Option<f64> {
        let delays = self.delays();
        let wanted = self
            .zoom_goal()
            .zip(self.zoom_lens())
            .and_then(|(goal, lens)| self.zoom.speed(&goal, &lens, measurement, &delays, now));
        wanted.or(self.zoom.is_moving(now).then_some(0.0))
    }

    fn zoom_goal(&self) -> Option<ZoomGoal> {
        let travel = if self.zooms_by_picture() {
            self.zoom.ends()
        } else {
            narrower(self.camera.capabilities.limits.zoom, self.settings.limits.zoom)
        };
        Some(ZoomGoal { target_height: self.settings.target_height?, travel })
    }

    /// What of a motion from `position` the limits leave, if it goes on for so long.
    fn limited(&mut self, motion: PanTilt, position: Option<PanTilt>, lasting_s: f64) -> PanTilt {
        let hard = self.camera.capabilities.limits;
        let (motion, position) = (self.exchanged(motion), position.map(|position| self.exchanged(position)));
        let limited = self.limits.apply(motion, position, (&hard, &self.settings.limits), lasting_s);
        self.exchanged(limited)
    }

    /// An angle along the picture's sides along the camera's axes, or back.
    fn exchanged(&self, angle: PanTilt) -> PanTilt {
        let (pan, tilt) = self.axes.exchanged((angle.pan, angle.tilt));
        PanTilt::new(pan, tilt)
    }

    /// The same of what is to be done.
    pub(super) fn exchanged_motion(&self, motion: Motion) -> Motion {
        match motion {
            Motion::Velocity { pan, tilt, zoom } => {
                let (pan, tilt) = self.axes.exchanged((pan, tilt));
                Motion::Velocity { pan, tilt, zoom }
            }
            Motion::Absolute { pan_deg, tilt_deg, speed, zoom } => {
                let (pan_deg, tilt_deg) = self.axes.exchanged((pan_deg, tilt_deg));
                Motion::Absolute { pan_deg, tilt_deg, speed, zoom }
            }
            other => other,
        }
    }

    /// A position as the camera tells it, along the picture's sides: only so do positions compare to what was commanded.
    pub fn along_picture(&self, position: Position) -> Position {
        let (pan_deg, tilt_deg) = self.axes.exchanged((position.pan_deg, position.tilt_deg));
        Position { pan_deg, tilt_deg, ..position }
    }

    fn control_law(&self, view: &View, interval: Duration, now: Time) -> ControlLaw {
        let settings = &self.settings;
        let interval_s = interval.as_secs_f64();
        // No error is worth a move that would leave nearly as large a one on the other side.
        let least_deg = 0.75 * self.camera.speed_map.deg_s(1) * interval_s;
        let mut zone_deg = self.zone_deg(view, settings.dead_zone);
        if self.camera.history.rate_at(now).pan != 0.0 {
            // The zone lets the camera stand still before somebody who stands. A camera that pans moves anyway.
            zone_deg.tilt *= Self::ZONE_WHILE_PANNING;
        }
        // The camera must not turn by more than the error before the next command.
        let gain = settings.gain.min(1.0 / interval_s);
        // Nor, while seeking, before a picture shows the effect, which may be later than assumed by the latency's uncertainty.
        let seen_within_s = interval_s + self.delays().uncertainty.as_secs_f64();
        ControlLaw {
            gain,
            seek_gain: (Self::SEEK_GAIN_FACTOR * gain).min(1.0 / seen_within_s).max(gain),
            dead_zone_deg: PanTilt::new(zone_deg.pan.max(least_deg), zone_deg.tilt.max(least_deg)),
            max_deg_s: settings.max_speed_deg_s,
            max_change_deg_s: settings.max_acceleration_deg_s2 * interval_s,
        }
    }

    /// One step of [`Mode::Absolute`] or [`Mode::Centre`].
    pub(super) fn point_to_point(
        &mut self,
        measurement: &Measurement,
        actuator: &ActuatorStatus,
        now: Time,
    ) -> Actuation {
        if actuator.may_move && !self.moves.under_way() {
            // By speed, before the mode was changed; or who knows, as a step went unanswered.
            return Actuation::Rest;
        }
        let delays = self.delays();
        if !self.moves.shows_rest(measurement.taken_at, &delays) {
            return Actuation::Continue;
        }
        let view = self.view(measurement);
        let error = self.estimator.error_at_effect(now, &self.camera.history, &delays);
        let jump = self.jump(measurement, now);
        let zooms = jump.is_some_and(|jump| jump.pressing);
        let zone_deg = self.zone_deg(&view, self.settings.dead_zone);
        let (pans, tilts) = (error.pan.abs() > zone_deg.pan, error.tilt.abs() > zone_deg.tilt);
        if !pans && !tilts && !zooms {
            return Actuation::Continue;
        }
        let position = self.camera.pan_tilt();
        let turn = self.limited(error, position, 1.0);
        // An axis that is at its end is no reason to correct the other by next to nothing.
        let worth_it = pans && turn.pan != 0.0 || tilts && turn.tilt != 0.0;
        if !worth_it && !zooms {
            return Actuation::Continue;
        }
        match actuator.mode {
            // What is wrong with the field of view made the angle of the place, and makes a place of it again.
            Mode::Centre => {
                let place = self.mounting().mirrored(view.point_within(turn));
                centre(place, measurement.size, jump.map(|jump| jump.factor))
            }
            _ => position.map_or(Actuation::Continue, |position| {
                absolute(position + turn, self.move_speed(), jump.map(|jump| jump.travel))
            }),
        }
    }

    /// How a step is to zoom: so that the height is right half way to the next one.
    fn jump(&self, measurement: &Measurement, now: Time) -> Option<Jump> {
        let delays = self.delays();
        let shown_after = now - measurement.taken_at + delays.sum();
        let lead = shown_after + self.moves.interval(&delays) / 2;
        self.zoom.jump(&self.zoom_goal()?, &self.camera.capabilities.lens()?, &delays, now, lead)
    }

    /// Without a target.
    pub(super) fn idle(&self, actuator: &ActuatorStatus, now: Time) -> Actuation {
        if self.moves.under_way() && self.home.is_settled() {
            return Actuation::Continue;
        }
        self.way_home(actuator, now).or_else(|| self.widen(actuator, now)).unwrap_or(Actuation::Rest)
    }

    /// A view that was narrowed for somebody is widened where nobody is, unless the camera is to go home.
    fn widen(&self, actuator: &ActuatorStatus, now: Time) -> Option<Actuation> {
        let is_free = actuator.access == Access::Ours && actuator.mode == Mode::Velocity;
        let is_to_stay = is_free && self.home.due(now, self.move_speed()).is_none();
        let wanted = is_to_stay && self.zooms_by_picture() && !self.frozen_picture.is_frozen();
        let zoom = self.zoom.widening(now).filter(|_| wanted)?;
        Some(Actuation::Move(Motion::Velocity { pan: 0.0, tilt: 0.0, zoom: Some(zoom) }))
    }

    /// Whether this takes the camera home.
    pub fn leads_home(&self, motion: &Motion) -> bool {
        self.home.leads(&self.exchanged_motion(*motion), self.move_speed())
    }

    /// Speed of moves to a position.
    fn move_speed(&self) -> f64 {
        self.camera.capabilities.move_speed.unwrap_or(Motion::FULL_SPEED)
    }

    /// Whether the camera is on its way home, or is to go there.
    pub fn is_homeward(&self, actuator: &ActuatorStatus, now: Time) -> bool {
        self.moves.under_way() && self.home.is_settled() || self.way_home(actuator, now).is_some()
    }

    /// The move home, where it is time. A zoom that goes on at its own speed, or may yet begin to, is no part of that
    /// move, and has to be ended first.
    fn way_home(&self, actuator: &ActuatorStatus, now: Time) -> Option<Actuation> {
        let zooms = self.zoom.is_moving(now) || actuator.in_doubt;
        let due = self.home.due(now, self.move_speed()).map(Actuation::Move);
        due.filter(|_| actuator.access == Access::Ours && !zooms)
    }
}

/// The actuation to bring a place in the picture of that size to its middle.
fn centre(place: Point, (width, height): (u32, u32), magnify: Option<f64>) -> Actuation {
    let pixel = |place: f64, size: u32| {
        let last = f64::from(size.saturating_sub(1));
        // Saturates; inside the picture by the clamp.
        (place * f64::from(size)).round().clamp(0.0, last) as u32
    };
    Actuation::Move(Motion::Centre {
        x: pixel(place.x, width),
        y: pixel(place.y, height),
        width,
        height,
        magnify,
    })
}

/// The actuation to look there, the short way round.
fn absolute(position: PanTilt, speed: f64, zoom: Option<f64>) -> Actuation {
    Actuation::Move(Motion::Absolute {
        pan_deg: around_deg(0.0, position.pan),
        tilt_deg: position.tilt.clamp(-180.0, 180.0),
        speed,
        zoom,
    })
}
