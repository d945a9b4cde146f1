mod answers;
mod motion;
mod turns;

use std::mem;
use std::time::Duration;

use super::{
    Aim, Authority, Belief, Calibration, CameraModel, CommandHistory, Controller, Homing, Introduction, Job,
    Lens, LimitGuard, Link, Mode, OscillationGuard, PanTilt, Report, Scheduler, ServoSettings, Sight,
    SpeedMap, Status, Steps, View, Visibility, Ways, ZoomDrive, magnified,
};
use crate::vapix::Command;

/// Steers one camera: takes what is seen, says what to send, hears what is answered. Sends nothing
/// itself, and has no clock: both are the caller's.
#[derive(Debug)]
pub struct Pilot {
    settings: ServoSettings,
    camera: CameraModel,
    link: Link,
    scheduler: Scheduler,
    steps: Steps,
    authority: Authority,
    ways: Ways,
    /// How the camera is moved as far as anybody was told.
    mode_told: Mode,
    homing: Homing,
    aim: Aim,
    history: CommandHistory,
    calibration: Calibration,
    /// Speed steps as they are known by now.
    map: SpeedMap,
    controller: Controller,
    oscillation: OscillationGuard,
    /// How long the last command took.
    exchange: Duration,
    guard: LimitGuard,
    zoom: ZoomDrive,
    target: Option<Target>,
    introduction: Introduction,
    /// What was last told of it.
    met_as: Option<String>,
    next_poll: Duration,
    /// When the camera last answered a question, or did not.
    asked_at: Duration,
    /// The speed steps in force, for the quantiser's hysteresis.
    speed_steps: (i8, i8),
    /// The words that end the last move, whatever the mode is by now.
    stop: Command,
    at_limit: bool,
    /// It was told that the limits cannot be kept.
    limits_unkept: bool,
    /// Since when there is a target and it is not known whether the camera is ours to follow it.
    unsteered_since: Option<Duration>,
    overtaken: u64,
    reports: Vec<Report>,
}

#[derive(Debug)]
struct Target {
    sight: Sight,
    last_seen: Duration,
    /// Whether it was looked at when there was time to send something.
    considered: bool,
}

impl Pilot {
    /// A position is asked for this often while the zoom moves, by which the picture changes most, ...
    const POLL_ZOOMING: Duration = Duration::from_millis(400);
    /// ... while the camera only turns, and ...
    const POLL_MOVING: Duration = Duration::from_secs(1);
    /// ... while it rests, so that an operator's zoom or a lost connection is noticed.
    const POLL_RESTING: Duration = Duration::from_secs(5);
    /// A camera that does not tell its position is asked again this much later.
    const POLL_REFUSED: Duration = Duration::from_secs(30);

    /// To be a swing, an offset goes so many dead zones beyond the middle: gait and tracker go beyond one.
    const SWING: f64 = 2.5;
    /// And this part of the picture's width.
    const SWING_LEAST: f64 = 0.04;

    /// Knows nothing of the camera yet.
    pub fn new(settings: ServoSettings) -> Self {
        Self {
            aim: Aim::new(settings.prediction),
            calibration: Calibration::new(settings.latency),
            map: settings.speed_map(),
            camera: CameraModel::default(),
            link: Link::default(),
            scheduler: Scheduler::default(),
            steps: Steps::default(),
            authority: Authority::default(),
            ways: Ways::default(),
            mode_told: settings.mode,
            homing: Homing::new(
                settings.home.clone(),
                settings.home_timeout,
                settings.home_at_start,
                settings.limits,
            ),
            history: CommandHistory::default(),
            controller: Controller::default(),
            oscillation: OscillationGuard::default(),
            exchange: Duration::ZERO,
            guard: LimitGuard::default(),
            zoom: ZoomDrive::default(),
            target: None,
            introduction: Introduction::default(),
            met_as: None,
            next_poll: Duration::ZERO,
            asked_at: Duration::ZERO,
            speed_steps: (0, 0),
            stop: Command::Halt,
            at_limit: false,
            limits_unkept: false,
            unsteered_since: None,
            overtaken: 0,
            reports: Vec::new(),
            settings,
        }
    }

    /// Takes new settings.
    pub fn configure(&mut self, settings: ServoSettings) {
        if settings.prediction != self.aim.prediction() {
            self.aim = Aim::new(settings.prediction);
        }
        let before = mem::replace(&mut self.settings, settings);
        let now = &self.settings;
        self.homing.configure(now.home.as_ref(), now.home_timeout, now.limits);
        if now.mode != before.mode {
            self.ways.forget_refusals();
            self.mode_told = now.mode;
        }
        if !now.learn {
            self.calibration = Calibration::new(now.latency);
        }
        self.calibration.assume_latency(now.latency);
        if now.fov_deg != before.fov_deg {
            self.calibration.assume_field();
        }
        if now.speed_map() != before.speed_map() {
            self.assume_speeds();
        }
        if self.settings.limits != before.limits {
            self.judge_limits();
        }
        self.revise();
    }

    /// The camera may be asked anew: who we are has changed.
    pub fn credentials_changed(&mut self) {
        self.link = Link::default();
        self.introduction.renew();
        self.authority.queue.permitted();
        self.next_poll = Duration::ZERO;
    }

    /// What to send before we are somebody else to the camera: whom it does not know it does not stop for.
    pub fn parting_stop(&self) -> Option<Command> {
        let is_heard = !self.link.halted() && !self.authority.queue.is_deaf();
        (is_heard && !self.is_at_rest()).then_some(self.stop)
    }

    /// Takes the newest picture of the target.
    pub fn see(&mut self, sight: Sight, now: Duration) {
        let last_seen = match (sight.visibility, &self.target) {
            (Visibility::Seen, _) => now,
            (Visibility::Predicted, Some(target)) => target.last_seen,
            (Visibility::Predicted, None) | (Visibility::Gone, _) => {
                self.lose();
                return self.homing.alone(now, now + self.settings.stale_timeout);
            }
        };
        self.homing.not_alone();
        let zooms = self.zoom.moves(sight.taken_at, self.calibration.latency(), now);
        if self.settings.learn && self.authority.is_ours(now) && !zooms {
            let maps = [&self.assumed_speeds(), &self.map];
            self.calibration.see(&sight, &self.view(&sight), &self.history, maps);
            self.revise();
        }
        self.measure(&sight, now);
        let view = self.view(&sight);
        let uncertainty =
            if self.settings.learn { self.calibration.latency_uncertainty() } else { Duration::ZERO };
        self.aim.see(&sight, &view, &self.history, self.calibration.latency(), uncertainty);
        if self.target.as_ref().is_some_and(|target| target.sight.id != sight.id) {
            self.oscillation.clear();
        }
        let tolerated = (Self::SWING * self.settings.dead_zone).max(Self::SWING_LEAST);
        let tolerated_deg = self.zone_deg(&view, tolerated);
        // Told by the commands it would be no witness against them.
        let by_itself = sight.ego_velocity.map_or(PanTilt::default(), |_| self.aim.pace());
        if self.oscillation.see(self.aim.error(), by_itself, tolerated_deg, sight.taken_at) {
            self.reports.push(Report::Swinging(self.oscillation.trust()));
        }
        self.overtaken += u64::from(self.target.as_ref().is_some_and(|target| !target.considered));
        self.target = Some(Target { sight, last_seen, considered: false });
    }

    /// Forgets the target; the camera is to be stopped, whatever it does.
    pub fn rest(&mut self) {
        self.lose();
        self.homing.interrupt();
    }

    /// A predecessor left the camera in a move that this ends.
    pub fn inherit(&mut self, stop: Command, now: Duration) {
        self.stop = stop;
        self.scheduler.inherited(now);
    }

    /// What ends the last move.
    pub fn stop(&self) -> Command {
        self.stop
    }

    /// It is the end: with the stop, what is ours is given back.
    pub fn leave(&mut self) {
        self.authority.queue.leave();
    }

    fn lose(&mut self) {
        self.target = None;
        self.unsteered_since = None;
        self.aim.clear();
        self.controller.rest();
        self.oscillation.clear();
        self.zoom.forget();
    }

    /// Something is being sent.
    pub fn sending(&mut self, job: &Job, now: Duration) {
        let Job::Command(command) = job else { return };
        self.scheduler.attempted(command, now);
        match command {
            _ if command.is_stop() => {}
            Command::Velocity { zoom: Some(_), .. } => self.stop = Command::REST,
            // A zoom goes on until it is told otherwise.
            Command::Velocity { .. } if self.stop == Command::REST => {}
            Command::Velocity { .. } => self.stop = Command::Halt,
            Command::Absolute { .. } | Command::Centre { .. } | Command::Preset { .. } => {
                self.stop = Command::Stop;
            }
            Command::Halt | Command::Stop => {}
        }
    }

    /// The answer is waited for no longer, as something else is more urgent: no fault of the camera's.
    pub fn abandoned(&mut self, job: &Job, now: Duration) {
        if let Job::Command(command) = job {
            self.unanswered(command, now);
        }
    }

    /// Whether the camera does not move on our behalf, as far as can be known.
    pub fn is_at_rest(&self) -> bool {
        !self.scheduler.may_move()
    }

    /// Whether it rests for good: nothing that went unanswered can set it going any more.
    pub fn stays_at_rest(&self) -> bool {
        self.is_at_rest() && !self.scheduler.in_doubt()
    }

    /// Pictures of the target that came while a request was in flight, and were followed by newer ones in that time.
    pub fn overtaken(&self) -> u64 {
        self.overtaken
    }

    /// Whether the camera counts on hearing from us.
    pub fn is_queued(&self) -> bool {
        self.authority.queue.is_in()
    }

    /// Whether nothing may be sent until a setting changes.
    pub fn halted(&self) -> bool {
        self.link.halted()
    }

    /// What happened since the last call.
    pub fn take_reports(&mut self) -> Vec<Report> {
        mem::take(&mut self.reports)
    }

    /// The camera as it was learned.
    pub fn belief(&self) -> Belief {
        Belief { latency: self.calibration.latency(), fov_deg: self.fov_deg(None), map: self.map }
    }

    /// The camera as it is known.
    pub fn status(&self, now: Duration) -> Status {
        Status {
            connected: self.link.connected(),
            moving: self.scheduler.may_move(),
            taken_over: self.authority.holder(now).is_some(),
            position: self.camera.position,
            limits: self.camera.limits(),
            rate: self.history.rate_at(now),
            fov_deg: self.known_fov_deg(),
            mode: Some(self.mode(now)),
        }
    }

    fn view(&self, sight: &Sight) -> View {
        let latency = self.calibration.latency();
        // Since it told where it looks it has turned on; steep downwards a few degrees of tilt make much of pan.
        let position =
            self.guard.position(&self.history, latency / 2, sight.taken_at.saturating_sub(latency));
        View {
            horizontal_fov_deg: self.fov_deg(self.zoom.step_shown(sight.taken_at, latency)),
            aspect: sight.aspect,
            tilt_deg: position.map(|position| position.tilt).or(self.camera.position.tilt_deg).unwrap_or(0.0),
        }
    }

    /// How far off each axis may be for the target to be off the middle by a part of the picture's width.
    fn zone_deg(&self, view: &View, part: f64) -> PanTilt {
        view.turns(part * view.horizontal_fov_deg, self.aim.error())
    }

    /// The field of view at a zoom step, or at the last told one.
    fn fov_deg(&self, zoom_step: Option<f64>) -> f64 {
        let assumed = match zoom_step {
            Some(step) => self.lens().fov_deg(step),
            None => self.camera.fov_deg(self.settings.fov_deg),
        };
        magnified(assumed, 1.0 / self.calibration.field_factor())
    }

    fn lens(&self) -> Lens {
        self.camera.lens_or_fixed(self.settings.fov_deg)
    }

    fn known_fov_deg(&self) -> Option<f64> {
        let learned = self.calibration.field_factor() != 1.0;
        let known = self.settings.fov_deg.is_some() || self.camera.tells_fov() || learned;
        // To a tenth of a degree: those who are told need not hear of every picture's.
        known.then(|| (self.fov_deg(None) * 10.0).round() / 10.0)
    }

    fn assume_speeds(&mut self) {
        self.calibration.assume_speeds(self.camera.told_speeds().is_some());
    }

    /// The speed map before anything is learned.
    fn assumed_speeds(&self) -> SpeedMap {
        self.camera.told_speeds().unwrap_or_else(|| self.settings.speed_map())
    }

    /// Brings the speed map up to what is known by now.
    fn revise(&mut self) {
        let fov_deg = self.fov_deg(None);
        let map = self.calibration.correct(&self.assumed_speeds(), fov_deg);
        self.map = map.capped(self.camera.proportional_cap_deg_s(fov_deg));
        self.history.revise(&self.map);
    }
}

#[cfg(test)]
#[path = "pilot_tests.rs"]
mod tests;
