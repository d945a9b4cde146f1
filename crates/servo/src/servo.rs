// SPDX-License-Identifier: MPL-2.0

mod feedback;
mod steering;

use std::mem;
use std::time::Duration;

use crate::Time;
use crate::control::{
    Access, Actuation, ActuatorStatus, Controller, HomeReturn, LimitEnforcer, Mode, Motion, PointToPoint,
    ZoomDrive,
};
use crate::estimation::{
    AxisEstimator, AxisFinding, Estimates, FrozenPictureDetector, Measurement, Mounting, SelfCalibration,
    TargetEstimator, Visibility,
};
use crate::model::{
    CameraModel, Capabilities, CommandHistory, Delays, Lens, PanTilt, SpeedMap, View, magnified,
};
use crate::settings::ServoSettings;

/// Steers one camera: takes what is measured, says what the camera is to do, hears what became of that. It speaks with
/// nobody, and has no clock: both are the caller's.
#[derive(Debug)]
pub struct Servo {
    settings: ServoSettings,
    camera: CameraModel,
    calibration: SelfCalibration,
    axes: AxisEstimator,
    /// What was found out about the axes, and nobody was told yet.
    axis_finding: Option<AxisFinding>,
    frozen_picture: FrozenPictureDetector,
    estimator: TargetEstimator,
    controller: Controller,
    limits: LimitEnforcer,
    zoom: ZoomDrive,
    moves: PointToPoint,
    home: HomeReturn,
    target: Option<Target>,
}

/// No camera is taken to be later than this, whatever it shows: the longest delay that is looked for, and a step.
const LONGEST_DELAY: Duration = Duration::from_millis(1600);

#[derive(Debug)]
struct Target {
    measurement: Measurement,
    last_seen: Time,
    /// Whether the camera was steered by this measurement.
    considered: bool,
    /// Since when it is not known whether the camera is ours to follow it.
    undecided_since: Option<Time>,
    /// It was going out of view when it was last seen.
    leaves: bool,
    /// When the newest picture was taken after it went out of view; `None`: it did not.
    missed_at: Option<Time>,
}

impl Servo {
    /// To be an oscillation, an offset goes so many dead zones beyond the middle: gait and tracker go beyond one.
    const OSCILLATION_ZONES: f64 = 2.5;
    /// And this part of the picture's width.
    const OSCILLATION_LEAST: f64 = 0.04;

    /// Knows nothing of the camera yet.
    pub fn new(settings: ServoSettings) -> Self {
        Self {
            camera: CameraModel::new(settings.speed_map()),
            calibration: SelfCalibration::new(settings.latency),
            axes: AxisEstimator::default(),
            axis_finding: None,
            frozen_picture: FrozenPictureDetector::default(),
            estimator: TargetEstimator::new(settings.prediction),
            controller: Controller::default(),
            limits: LimitEnforcer::default(),
            zoom: ZoomDrive::default(),
            moves: PointToPoint::default(),
            home: HomeReturn::new(
                settings.home.clone(),
                settings.home_timeout,
                settings.home_at_start,
                settings.limits,
            ),
            target: None,
            settings,
        }
    }

    /// Takes new settings.
    pub fn configure(&mut self, settings: ServoSettings) {
        if settings.prediction != self.estimator.prediction() {
            self.estimator = TargetEstimator::new(settings.prediction);
            if self.is_out_of_view() {
                self.lose();
            }
        }
        let before = mem::replace(&mut self.settings, settings);
        let now = &self.settings;
        let home = now.home.clone().map(|home| home.through(self.camera.capabilities.lens().as_ref()));
        self.home.configure(home.as_ref(), now.home_timeout, now.limits);
        if !now.learn {
            self.calibration = SelfCalibration::new(now.latency);
        }
        self.calibration.assume_latency(now.latency);
        if now.fov_deg != before.fov_deg {
            self.calibration.assume_field();
        }
        if now.speed_map() != before.speed_map() {
            self.assume_speeds();
        }
        self.revise();
    }

    /// Takes the newest picture of the target. Returns what part of the gain is left where this shows that the loop
    /// oscillates.
    pub fn measure(&mut self, measurement: Measurement, actuator: &ActuatorStatus, now: Time) -> Option<f64> {
        let measurement = self.mounting().along_axes(measurement);
        let is_frozen = self.heed_frozen_picture(&measurement);
        if !is_frozen && self.zooms_by_picture() {
            self.zoom.watch(&measurement, &self.delays());
        }
        if is_frozen {
            self.lose();
            self.home.not_alone();
            return None;
        }
        let last_seen = match (measurement.visibility, &self.target) {
            (Visibility::Seen, _) => measurement.taken_at.min(now),
            (Visibility::Predicted, Some(target)) => target.last_seen,
            (Visibility::Predicted, None)
            | (Visibility::Lost | Visibility::Gone | Visibility::Released, _) => {
                if self.goes_after(&measurement, actuator, now) {
                    return None;
                }
                self.lose();
                self.home.alone(now, now + self.settings.stale_timeout);
                return None;
            }
        };
        self.home.not_alone();
        if self.calibrate(&measurement, actuator, now) {
            // What was seen so far was seen the wrong way round.
            self.lose();
            return None;
        }
        self.measure_height(&measurement, actuator.mode);
        if self.is_out_of_view() {
            // Back: it may go elsewhere by now.
            self.estimator.clear();
            self.controller.new_target();
        }
        let view = self.view(&measurement);
        self.estimator.see(&measurement, &view, &self.camera.history, &self.delays());
        let oscillates = self.oscillates(&measurement, &view);
        let undecided_since = self.target.as_ref().and_then(|target| target.undecided_since);
        let leaves = match (measurement.visibility, &self.target) {
            (Visibility::Seen, _) | (_, None) => self.leaves_view(&measurement),
            (_, Some(target)) => target.leaves,
        };
        let (considered, missed_at) = (false, None);
        self.target = Some(Target { measurement, last_seen, considered, undecided_since, leaves, missed_at });
        oscillates.then(|| self.controller.oscillation.gain_scale())
    }

    /// Whether the target goes out of view on a side that the camera is known to turn to.
    fn leaves_view(&self, measurement: &Measurement) -> bool {
        let (sideways, up_or_down) = measurement.leaves_view();
        let knows = |is_known: bool| !self.settings.learn_axes || is_known;
        sideways && knows(self.axes.is_pan_known()) || up_or_down && knows(self.axes.are_known())
    }

    /// Takes a picture without the target. Returns whether the camera turns on to where it would be by now, as it went out of view.
    fn goes_after(&mut self, picture: &Measurement, actuator: &ActuatorStatus, now: Time) -> bool {
        // A move to a position is over before anybody could tell where that is.
        let may_turn = actuator.access == Access::Ours && actuator.mode == Mode::Velocity;
        let Some(target) = &mut self.target else { return false };
        let is_lost = picture.visibility == Visibility::Lost && picture.id == target.measurement.id;
        let begins = target.leaves && is_lost;
        let goes_on = target.missed_at.is_some() && (is_lost || picture.visibility == Visibility::Gone);
        if !may_turn || !(begins || goes_on) || now >= target.last_seen + self.settings.search_time {
            return false;
        }
        if target.missed_at.is_none() {
            self.estimator.lose_sight();
        }
        (target.missed_at, target.considered) = (Some(picture.taken_at.min(now)), true);
        true
    }

    /// Whether nobody can steer by this picture, as it stays the same though the camera was told to turn.
    fn heed_frozen_picture(&mut self, measurement: &Measurement) -> bool {
        // A camera that is not known yet may only have to be told to turn faster.
        if !(self.settings.learn_axes && self.axes.seeks_speed()) {
            let (fov_deg, delays) = (self.fov_deg(None), self.delays());
            self.frozen_picture.see(measurement, fov_deg, &self.camera.history, &delays);
        }
        self.frozen_picture.is_frozen()
    }

    /// The camera does not answer: what it does, nobody knows.
    pub fn out_of_touch(&mut self, now: Time) {
        self.frozen_picture.out_of_touch(now);
    }

    /// Whether the picture stayed the same though the camera was told to turn.
    pub fn is_picture_frozen(&self) -> bool {
        self.frozen_picture.is_frozen()
    }

    /// How the picture lies to the camera's axes, as far as is known by now.
    pub(super) fn mounting(&self) -> Mounting {
        self.axes.mounting(self.settings.mounting)
    }

    /// What was found out about the axes since this was last asked.
    pub fn take_axis_finding(&mut self) -> Option<AxisFinding> {
        self.axis_finding.take()
    }

    /// Learns of the camera what the picture shows, if nothing else moves it. Returns whether an axis is now taken to turn
    /// the picture otherwise.
    fn calibrate(&mut self, measurement: &Measurement, actuator: &ActuatorStatus, now: Time) -> bool {
        let zooms = self.zoom.moves(measurement.taken_at, &self.calibration.delays(), now);
        let turned = match zooms {
            false => Some(*measurement),
            true if self.zooms_by_picture() => measurement.without_zoom(),
            true => None,
        };
        let Some(measurement) = &turned else { return false };
        if !self.settings.learn || actuator.access != Access::Ours {
            return false;
        }
        let maps = [&self.assumed_speeds(), &self.camera.speed_map];
        let view = self.view(measurement);
        let turn = self.calibration.see(measurement, &view, &self.camera.history, maps);
        let fov_deg = view.horizontal_fov_deg;
        let turn = turn.filter(|_| self.settings.learn_axes);
        let finding = turn.and_then(|turn| self.axes.see(&turn, &self.camera.history, fov_deg));
        if finding == Some(AxisFinding::Exchanged) {
            self.camera.history.exchange();
        }
        if finding.is_some() {
            self.axis_finding = finding;
            self.calibration = SelfCalibration::new(self.settings.latency);
            self.assume_speeds();
        }
        self.revise();
        finding.is_some()
    }

    /// Finds how tall the target is, to zoom by.
    fn measure_height(&mut self, measurement: &Measurement, mode: Mode) {
        let delays = self.delays();
        // How much a picture is magnified nobody knows while a move to a position is under way.
        let known = mode == Mode::Velocity || self.moves.shows_last_rest(measurement.taken_at, &delays);
        if self.settings.target_height.is_some() && known {
            self.zoom.see(measurement, &self.lens(), &delays);
        }
    }

    /// Whether this is one half-cycle too many about the target.
    fn oscillates(&mut self, measurement: &Measurement, view: &View) -> bool {
        if self.target.as_ref().is_some_and(|target| target.measurement.id != measurement.id) {
            self.controller.new_target();
        }
        let tolerated = (Self::OSCILLATION_ZONES * self.settings.dead_zone).max(Self::OSCILLATION_LEAST);
        let tolerated_deg = self.zone_deg(view, tolerated);
        // Derived from the commands it would say nothing of whether they are right.
        let by_itself = measurement.ego_velocity.map_or(PanTilt::default(), |_| self.estimator.pace());
        let error = self.estimator.error();
        self.controller.oscillation.see(error, by_itself, tolerated_deg, measurement.taken_at)
    }

    /// What the camera is to do now.
    pub fn control(&mut self, actuator: &ActuatorStatus, now: Time) -> Actuation {
        let actuation = self.decide(actuator, now);
        match actuation {
            Actuation::Move(motion) => Actuation::Move(self.exchanged_motion(motion)),
            other => other,
        }
    }

    fn decide(&mut self, actuator: &ActuatorStatus, now: Time) -> Actuation {
        if actuator.access == Access::Others {
            // What moves it is theirs; what we last said must not outlive our hold on it.
            if self.is_out_of_view() {
                self.lose();
            }
            return Actuation::Rest;
        }
        if !self.has_target(now) {
            self.lose();
        }
        let Some(target) = &mut self.target else { return self.idle(actuator, now) };
        if actuator.access == Access::Undecided {
            target.undecided_since.get_or_insert(now);
            return if self.undecided_until(now).is_some() { Actuation::Continue } else { Actuation::Rest };
        }
        target.undecided_since = None;
        target.considered = true;
        let measurement = target.measurement;
        match actuator.mode {
            Mode::Velocity => self.velocity(&measurement, actuator, now),
            _ => self.point_to_point(&measurement, actuator, now),
        }
    }

    /// Forgets the target; the camera is to be stopped, whatever it does.
    pub fn release(&mut self) {
        self.lose();
        self.zoom.leave();
        self.home.interrupt();
    }

    /// Nobody knows where the target is any more.
    pub fn lose(&mut self) {
        self.target = None;
        self.estimator.clear();
        self.controller.rest();
        self.controller.oscillation.clear();
        self.zoom.forget();
    }

    /// Whether there is a target that was seen lately.
    pub fn has_target(&self, now: Time) -> bool {
        self.stale_at().is_some_and(|at| now < at)
    }

    /// Whether there is one that went out of view.
    fn is_out_of_view(&self) -> bool {
        self.target.as_ref().is_some_and(|target| target.missed_at.is_some())
    }

    /// Whether there is one, seen lately or not.
    pub fn holds_target(&self) -> bool {
        self.target.is_some()
    }

    /// Whether the newest measurement was not steered by.
    pub fn is_behind(&self) -> bool {
        self.target.as_ref().is_some_and(|target| !target.considered)
    }

    /// When the newest picture was taken that tells of the target, where there is one, or that it is out of view.
    pub fn newest_picture(&self) -> Option<Time> {
        self.target.as_ref().map(|target| target.missed_at.unwrap_or(target.measurement.taken_at))
    }

    /// When the target will not have been seen for too long, where there is one.
    pub fn stale_at(&self) -> Option<Time> {
        let ServoSettings { stale_timeout, search_time, .. } = self.settings;
        self.target.as_ref().map(|target| match target.missed_at {
            Some(missed_at) => (missed_at + stale_timeout).min(target.last_seen + search_time),
            None => target.last_seen + stale_timeout,
        })
    }

    /// Until when the camera goes on as it was last told, while it is found out whether it is ours.
    pub fn undecided_until(&self, now: Time) -> Option<Time> {
        // As long as it goes on without a picture of the target, by default.
        const LONGEST: Duration = Duration::from_secs(1);
        let since = self.target.as_ref()?.undecided_since?;
        Some(since + LONGEST).filter(|until| now < *until)
    }

    /// What holds whatever is measured and answered; asked after every step where debug assertions are on.
    pub fn check_invariants(&self) {
        self.controller.check_invariants();
        self.limits.check_invariants();
        self.home.check_invariants();
        self.moves.check_invariants();
        self.zoom.check_invariants();
        self.camera.history.check_invariants();
        self.calibration.check_invariants();
        self.estimator.check_invariants();
        let sum = self.calibration.delays().sum();
        assert!(sum <= LONGEST_DELAY.max(self.settings.latency), "a delay of {sum:?}");
        let fov_deg = self.fov_deg(None);
        assert!(fov_deg > 0.0 && fov_deg < 180.0, "a field of view of {fov_deg} degrees");
    }

    /// What was set.
    pub fn settings(&self) -> &ServoSettings {
        &self.settings
    }

    /// The camera as it is known.
    pub fn camera(&self) -> &CameraModel {
        &self.camera
    }

    /// Where it goes without a target.
    pub fn home(&mut self) -> &mut HomeReturn {
        &mut self.home
    }

    /// When the camera is to be asked for its presets, where it is.
    pub fn presets_due(&self) -> Option<Time> {
        self.home.presets_due()
    }

    /// Whether a move to a position is under way.
    pub fn is_under_way(&self) -> bool {
        self.moves.under_way()
    }

    /// Whether the zoom was last told to move.
    pub fn is_zooming(&self, now: Time) -> bool {
        self.zoom.is_moving(now)
    }

    /// The speeds that the zoom was told, as the pan of a history; `None`: it is anybody's to move.
    pub fn zoom_commands(&self) -> Option<&CommandHistory> {
        self.settings.target_height.map(|_| self.zoom.commands())
    }

    /// Whether the zoom is known by what the picture shows only.
    pub fn zooms_by_picture(&self) -> bool {
        let ServoSettings { learn, learn_zoom, target_height, .. } = self.settings;
        let capabilities = &self.camera.capabilities;
        let zooms = capabilities.continuous_zoom != Some(false);
        learn && learn_zoom && target_height.is_some() && zooms && capabilities.lens().is_none()
    }

    /// Whether the camera is to zoom, and cannot, by its own word or as the picture shows.
    pub fn lacks_zoom(&self) -> bool {
        let wanted = self.settings.learn_zoom && self.settings.target_height.is_some();
        wanted && (self.camera.capabilities.continuous_zoom == Some(false) || self.zoom.is_fixed())
    }

    /// Whether the last wish was held back at a limit.
    pub fn at_limit(&self) -> bool {
        self.limits.at_limit()
    }

    /// The camera as it was learned.
    pub fn estimates(&self) -> Estimates {
        Estimates {
            delays: self.calibration.delays(),
            fov_deg: self.fov_deg(None),
            map: self.camera.speed_map,
        }
    }

    /// Horizontal field of view in degrees, where it is set, told or learned.
    pub fn known_fov_deg(&self) -> Option<f64> {
        let learned = self.calibration.field_factor() != 1.0;
        let known = self.settings.fov_deg.is_some() || self.camera.capabilities.tells_fov() || learned;
        // To a tenth of a degree: those who are told need not hear of every picture's.
        known.then(|| (self.fov_deg(None) * 10.0).round() / 10.0)
    }

    fn delays(&self) -> Delays {
        let delays = self.calibration.delays();
        let uncertainty = if self.settings.learn { delays.uncertainty } else { Duration::ZERO };
        Delays { uncertainty, ..delays }
    }

    fn view(&self, measurement: &Measurement) -> View {
        let delays = self.delays();
        // Since it told where it looks it has turned on; steep downwards a few degrees of tilt make much of pan.
        let shown = delays.sent_by(measurement.taken_at);
        let position = self.limits.position(&self.camera.history, delays.command, shown);
        let tilt_deg = position.map(|position| position.tilt).or(self.camera.position.tilt_deg);
        View {
            horizontal_fov_deg: self.fov_deg(self.zoom.travel_shown(measurement.taken_at, &delays)),
            aspect: measurement.aspect,
            tilt_deg: tilt_deg.unwrap_or(0.0),
        }
    }

    /// How far off each axis may be for the target to be off the middle by a part of the picture's width.
    fn zone_deg(&self, view: &View, part: f64) -> PanTilt {
        view.turns(part * view.horizontal_fov_deg, self.estimator.error())
    }

    /// The field of view at a part of the zoom's travel, or at the last told one.
    fn fov_deg(&self, zoom: Option<f64>) -> f64 {
        let seen = || self.zoom.last_travel().filter(|_| self.zooms_by_picture());
        let assumed = match zoom.or_else(seen) {
            Some(travel) => self.lens().fov_deg(travel),
            None => self.camera.fov_deg(self.settings.fov_deg),
        };
        magnified(assumed, 1.0 / self.calibration.field_factor())
    }

    fn lens(&self) -> Lens {
        let (capabilities, wide_fov_deg) = (&self.camera.capabilities, self.settings.fov_deg);
        if self.zooms_by_picture() {
            Capabilities::lens_by_picture(wide_fov_deg)
        } else {
            capabilities.lens_or_fixed(wide_fov_deg)
        }
    }

    /// The lens to zoom by, where the camera tells of it or the picture does.
    pub(super) fn zoom_lens(&self) -> Option<Lens> {
        let by_picture = self.zooms_by_picture();
        self.camera.capabilities.lens().or_else(|| by_picture.then(|| Capabilities::lens_by_picture(None)))
    }

    fn assume_speeds(&mut self) {
        let told = self.camera.capabilities.told_speeds(self.fov_deg(None));
        self.calibration.assume_speeds(told.is_some());
    }

    /// The speed map before anything is learned.
    fn assumed_speeds(&self) -> SpeedMap {
        let told = self.camera.capabilities.told_speeds(self.fov_deg(None));
        told.unwrap_or_else(|| self.settings.speed_map())
    }

    /// Brings the speed map up to what is known by now.
    fn revise(&mut self) {
        let fov_deg = self.fov_deg(None);
        let map = self.calibration.correct(&self.assumed_speeds(), fov_deg);
        self.camera.speed_map = map.capped(self.camera.capabilities.proportional_cap_deg_s(fov_deg));
        self.camera.history.revise(&self.camera.speed_map);
    }
}
