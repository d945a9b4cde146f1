//! What the target's place means to the pilot.

use std::time::Duration;

use ptztrack_contract::Point;

use super::Pilot;
use super::turns::Wish;
use crate::servo::{ControlLaw, Jump, Mode, PanTilt, Report, Sight, View, ZoomGoal, around_deg, narrower};
use crate::vapix::Command;

impl Pilot {
    pub(super) fn velocity(&mut self, sight: &Sight, now: Duration) -> Wish {
        let law = self.control_law(&self.view(sight));
        let latency = self.calibration.latency();
        let offset = self.aim.offset(now, &self.history, latency);
        let wanted = self.controller.rate(&offset, self.history.rate_at(now), &law);
        let position = self.guard.position(&self.history, latency / 2, now);
        let rate = self.limited(wanted, position, (latency + self.interval()).as_secs_f64());
        let map = &self.map;
        self.speed_steps = (map.step(rate.pan, self.speed_steps.0), map.step(rate.tilt, self.speed_steps.1));
        let (pan, tilt) = self.speed_steps;
        let free = (pan, tilt) != (0, 0) && self.camera.wants_free_moves();
        let command = Command::Velocity { pan, tilt, zoom: self.zoom_speed(sight, now), free };
        if command.is_stop() { Wish::Rest } else { Wish::Move(command) }
    }

    /// What the zoom is to do; `None` leaves it alone.
    fn zoom_speed(&mut self, sight: &Sight, now: Duration) -> Option<i8> {
        let latency = self.calibration.latency();
        let wanted = self
            .zoom_goal()
            .and_then(|goal| self.zoom.speed(&goal, &self.camera.lens()?, sight, latency, now));
        wanted.or(self.zoom.is_moving(now).then_some(0))
    }

    fn zoom_goal(&self) -> Option<ZoomGoal> {
        let steps = narrower(self.camera.limits().zoom_steps, self.settings.limits.zoom_steps);
        Some(ZoomGoal { target_height: self.settings.target_height?, steps })
    }

    /// What of a motion from `position` the limits leave, if it goes on for so long.
    fn limited(&mut self, motion: PanTilt, position: Option<PanTilt>, lasting_s: f64) -> PanTilt {
        let hard = self.camera.limits();
        let limited = self.guard.apply(motion, position, (&hard, &self.settings.limits), lasting_s);
        self.report_limit();
        limited
    }

    /// From one command to the next.
    pub(super) fn interval(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.settings.max_rate_hz).max(self.exchange)
    }

    fn control_law(&self, view: &View) -> ControlLaw {
        let settings = &self.settings;
        let interval_s = self.interval().as_secs_f64();
        // No error is worth a move that would leave nearly as large a one on the other side.
        let least_deg = 0.75 * self.map.deg_s(1) * interval_s;
        let zone_deg = self.zone_deg(view, settings.dead_zone);
        ControlLaw {
            gain: settings.gain,
            trust: self.oscillation.trust(),
            dead_zone_deg: PanTilt::new(zone_deg.pan.max(least_deg), zone_deg.tilt.max(least_deg)),
            max_deg_s: settings.max_speed_deg_s,
            max_change_deg_s: settings.max_acceleration_deg_s2 * interval_s,
        }
    }

    /// One step of [`Mode::Absolute`] or [`Mode::Centre`].
    pub(super) fn step(&mut self, mode: Mode, sight: &Sight, now: Duration) -> Wish {
        if self.scheduler.may_move() && !self.steps.under_way() {
            // By speed, before the mode was changed; or who knows, as a step went unanswered.
            return Wish::Rest;
        }
        if !self.steps.shows_rest(sight.taken_at, self.calibration.latency()) {
            return Wish::AsIs;
        }
        let view = self.view(sight);
        let error = self.aim.error_at_effect(now, &self.history, self.calibration.latency());
        let jump = self.jump(sight, now);
        let zooms = jump.is_some_and(|jump| jump.pressing);
        let zone_deg = self.zone_deg(&view, self.settings.dead_zone);
        let (pans, tilts) = (error.pan.abs() > zone_deg.pan, error.tilt.abs() > zone_deg.tilt);
        if !pans && !tilts && !zooms {
            return Wish::AsIs;
        }
        let position = self.camera.pan_tilt();
        let turn = self.limited(error, position, 1.0);
        // An axis that is at its end is no reason to correct the other by next to nothing.
        let worth_it = pans && turn.pan != 0.0 || tilts && turn.tilt != 0.0;
        if !worth_it && !zooms {
            return Wish::AsIs;
        }
        match mode {
            // What is wrong with the field of view made the angle of the place, and makes a place of it again.
            Mode::Centre => {
                Wish::Move(centre(view.point_within(turn), sight.size, jump.map(|jump| jump.factor)))
            }
            _ => position.map_or(Wish::AsIs, |position| {
                Wish::Move(absolute(position + turn, self.camera.move_speed, jump.map(|jump| jump.step)))
            }),
        }
    }

    /// Finds how tall the target is, to zoom by.
    pub(super) fn measure(&mut self, sight: &Sight, now: Duration) {
        let latency = self.calibration.latency();
        // How much a picture is magnified nobody knows while a step is under way.
        let known = self.mode(now) == Mode::Velocity || self.steps.shows_last_rest(sight.taken_at, latency);
        if self.settings.target_height.is_some() && known {
            self.zoom.see(sight, &self.lens(), latency);
        }
    }

    /// How a step is to zoom: so that the height is right half way to the next one.
    fn jump(&self, sight: &Sight, now: Duration) -> Option<Jump> {
        let latency = self.calibration.latency();
        let shown_after = now.saturating_sub(sight.taken_at) + latency;
        let lead = shown_after + self.steps.interval(latency) / 2;
        self.zoom.jump(&self.zoom_goal()?, &self.camera.lens()?, latency, now, lead)
    }

    fn report_limit(&mut self) {
        let at_limit = self.guard.at_limit();
        if at_limit && !self.at_limit {
            self.reports.push(Report::AtLimit);
        }
        self.at_limit = at_limit;
    }
}

/// The command to bring a place in the picture of that size to its middle.
fn centre(place: Point, (width, height): (u32, u32), magnify: Option<f64>) -> Command {
    let pixel = |place: f64, size: u32| {
        let last = f64::from(size.saturating_sub(1));
        // Saturates; inside the picture by the clamp.
        (place * f64::from(size)).round().clamp(0.0, last) as u32
    };
    Command::Centre {
        x: pixel(place.x, width),
        y: pixel(place.y, height),
        width,
        height,
        zoom_percent: magnify.map(|factor| (factor * 100.0).round() as u32),
    }
}

/// The command to look there, the short way round.
fn absolute(position: PanTilt, speed: Option<u8>, zoom: Option<u16>) -> Command {
    Command::Absolute {
        pan_deg: around_deg(0.0, position.pan),
        tilt_deg: position.tilt.clamp(-180.0, 180.0),
        speed: speed.unwrap_or(Command::FULL_SPEED),
        zoom,
    }
}
