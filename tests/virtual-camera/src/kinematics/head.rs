// SPDX-License-Identifier: MPL-2.0

//! The whole pan-tilt-zoom head: commands in, poses out, over time.

use std::{collections::VecDeque, time::Duration};

use super::{
    Kinematics, Limits, Optics, Pose, ZOOM_RANGE,
    motor::{Drive, Motor},
    within_a_turn,
};
use crate::{geometry, seeded::Seeded};

/// The head moves in steps of this length: fine enough for 450 °/s, and the same result however it is asked.
const STEP: Duration = Duration::from_millis(2);
/// Zoom has no acceleration worth a setting.
const ZOOM_ACCELERATION_STEP_S2: f64 = 20_000.0;
/// `move=left` and its like turn by this part of the field of view (VAPIX, absolute drivers).
const NUDGE: f64 = 0.25;

/// What the head can be told to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Turn at these speed steps (−100 to 100) until told otherwise; 0, 0 stops.
    PanTilt {
        /// Positive to the right.
        pan: f64,
        /// Positive upwards.
        tilt: f64,
    },
    /// The continuous move just begun is free of proportional speed (`proportionalspeed=disabled`).
    Unlimited,
    /// Zoom at this speed step (−100 to 100) until told otherwise; 0 stops.
    Zoom(f64),
    /// Go there; what is `None` stays as it is.
    Absolute {
        /// Degrees.
        pan_deg: Option<f64>,
        /// Degrees.
        tilt_deg: Option<f64>,
        /// Zoom steps.
        zoom_step: Option<f64>,
    },
    /// Go there from here.
    Relative {
        /// Degrees.
        pan_deg: f64,
        /// Degrees.
        tilt_deg: f64,
        /// Zoom steps.
        zoom_step: f64,
    },
    /// Turn a quarter of the field of view towards these signs.
    Nudge {
        /// −1, 0 or 1.
        pan: f64,
        /// −1, 0 or 1.
        tilt: f64,
    },
    /// Bring a place in the picture to its centre.
    Centre {
        /// From the centre to the right, in picture widths.
        x: f64,
        /// From the centre downwards, in picture widths too.
        y: f64,
        /// By how much to magnify what is seen.
        magnify: f64,
    },
    /// Stop pan and tilt.
    Stop,
    /// The speed step (1 to 100) of absolute and relative moves from now on.
    Speed(f64),
}

/// The head at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// Since the camera's start.
    pub time: Duration,
    /// Where it looks.
    pub pose: Pose,
    /// Degrees per second.
    pub pan_rate_deg_s: f64,
    /// Degrees per second.
    pub tilt_rate_deg_s: f64,
    /// Zoom steps per second.
    pub zoom_rate_step_s: f64,
}

/// The moving part of the camera.
#[derive(Debug)]
pub struct Head {
    kinematics: Kinematics,
    optics: Optics,
    ticks: u64,
    pan: Motor,
    tilt: Motor,
    zoom: Motor,
    /// Speed steps of the continuous pan/tilt move in force: its speed depends on the zoom.
    continuous: Option<(f64, f64)>,
    unlimited: bool,
    move_speed: f64,
    pending: VecDeque<(u64, Motion)>,
    /// When the continuous move in force ends by itself.
    ends: Option<u64>,
    /// Commands that ever came.
    commands: u64,
    /// Where the camera itself looks, behind the play of the gears.
    view: Pose,
    history: VecDeque<Snapshot>,
    memory: Duration,
}

impl Head {
    /// A head at rest at `home`, which remembers its poses for `memory`.
    pub fn new(kinematics: Kinematics, optics: Optics, limits: Limits, home: Pose, memory: Duration) -> Self {
        let acceleration = kinematics.acceleration_deg_s2;
        let pan_deg =
            if kinematics.endless_pan { (f64::NEG_INFINITY, f64::INFINITY) } else { limits.pan_deg };
        let mut head = Self {
            pan: Motor::at(home.pan_deg, pan_deg, acceleration),
            tilt: Motor::at(home.tilt_deg, limits.tilt_deg, acceleration),
            zoom: Motor::at(home.zoom_step, ZOOM_RANGE, ZOOM_ACCELERATION_STEP_S2),
            kinematics,
            optics,
            ticks: 0,
            continuous: None,
            unlimited: false,
            move_speed: 100.0,
            pending: VecDeque::new(),
            ends: None,
            commands: 0,
            view: home,
            history: VecDeque::new(),
            memory,
        };
        head.view = head.pose();
        head.remember();
        head
    }

    /// The same head turning already, at these speed steps (−100 to 100) of pan and tilt, until told otherwise.
    pub fn turning(mut self, (pan, tilt): (f64, f64)) -> Self {
        self.start(Motion::PanTilt { pan, tilt });
        (self.pan.rate, self.tilt.rate) = (self.continuous_deg_s(pan), self.continuous_deg_s(tilt));
        self.history.clear();
        self.remember();
        self
    }

    /// A command that arrives `at` this time: it acts after the command delay.
    pub fn command(&mut self, at: Duration, motion: Motion) {
        self.advance(at);
        self.commands += 1;
        let late = self.kinematics.command_jitter.mul_f64(Seeded::new(self.commands).unit());
        let acts = (at + self.kinematics.command_delay + late).as_nanos().div_ceil(STEP.as_nanos()) as u64;
        // They act in the order in which they came.
        let acts = self.pending.back().map_or(acts, |&(before, _)| acts.max(before));
        self.pending.push_back((acts, motion));
    }

    /// Continuous moves end by themselves at this time; `None`: not.
    pub fn end_at(&mut self, time: Option<Duration>) {
        self.ends = time.map(|time| time.as_nanos().div_ceil(STEP.as_nanos()) as u64);
    }

    /// Lets time pass until `to`; time already past stays as it was.
    pub fn advance(&mut self, to: Duration) {
        let end = (to.as_nanos() / STEP.as_nanos()) as u64;
        while self.ticks < end {
            while self.pending.front().is_some_and(|&(acts, _)| acts <= self.ticks) {
                if let Some((_, motion)) = self.pending.pop_front() {
                    self.start(motion);
                }
            }
            if self.ends.is_some_and(|end| end <= self.ticks) {
                self.ends = None;
                self.stop_pan_tilt();
                self.zoom.drive = Drive::Rate(0.0);
            }
            if self.motors_idle() {
                // Nothing happens until the next command acts: hours pass at once.
                self.ticks = self.pending.front().map_or(end, |&(acts, _)| acts.min(end));
            } else {
                self.step();
            }
            self.remember();
        }
    }

    fn step(&mut self) {
        if let Some((pan, tilt)) = self.continuous {
            self.pan.drive = Drive::Rate(self.continuous_deg_s(pan));
            self.tilt.drive = Drive::Rate(self.continuous_deg_s(tilt));
        }
        for motor in [&mut self.pan, &mut self.tilt, &mut self.zoom] {
            motor.step(STEP.as_secs_f64());
        }
        let play = self.kinematics.backlash_deg / 2.0;
        self.view = Pose {
            pan_deg: self.view.pan_deg.clamp(self.pan.position - play, self.pan.position + play),
            tilt_deg: self.view.tilt_deg.clamp(self.tilt.position - play, self.tilt.position + play),
            zoom_step: self.zoom.position,
        };
        self.ticks += 1;
    }

    fn continuous_deg_s(&self, step: f64) -> f64 {
        let map = &self.kinematics.speed_map;
        if self.unlimited {
            return map.deg_s(step);
        }
        let fov_deg = self.optics.fov_deg(self.zoom.position);
        self.kinematics.proportional_speed.apply(map.deg_s(step), map.deg_s(100.0), fov_deg)
    }

    fn start(&mut self, motion: Motion) {
        match motion {
            Motion::PanTilt { pan, tilt } if pan == 0.0 && tilt == 0.0 => self.stop_pan_tilt(),
            Motion::PanTilt { pan, tilt } => (self.continuous, self.unlimited) = (Some((pan, tilt)), false),
            Motion::Unlimited => self.unlimited = true,
            Motion::Zoom(step) => {
                self.zoom.drive = Drive::Rate(self.kinematics.zoom_speed_step_s * step / 100.0);
            }
            Motion::Absolute { pan_deg, tilt_deg, zoom_step } => {
                let pose = self.pose();
                self.go_to(Pose {
                    pan_deg: pan_deg.map_or(pose.pan_deg, |pan_deg| self.nearest(pan_deg)),
                    tilt_deg: tilt_deg.unwrap_or(pose.tilt_deg),
                    zoom_step: zoom_step.unwrap_or(pose.zoom_step),
                });
            }
            Motion::Relative { pan_deg, tilt_deg, zoom_step } => self.go_by(pan_deg, tilt_deg, zoom_step),
            Motion::Nudge { pan, tilt } => {
                let angle = NUDGE * self.optics.fov_deg(self.zoom.position);
                self.go_by(pan * angle, tilt * angle, 0.0);
            }
            Motion::Centre { x, y, magnify } => self.centre(x, y, magnify),
            Motion::Stop => self.stop_pan_tilt(),
            Motion::Speed(step) => self.move_speed = step,
        }
    }

    fn stop_pan_tilt(&mut self) {
        self.continuous = None;
        self.pan.drive = Drive::Rate(0.0);
        self.tilt.drive = Drive::Rate(0.0);
    }

    fn go_by(&mut self, pan_deg: f64, tilt_deg: f64, zoom_step: f64) {
        let pose = self.pose();
        self.go_to(Pose {
            pan_deg: pose.pan_deg + pan_deg,
            tilt_deg: pose.tilt_deg + tilt_deg,
            zoom_step: pose.zoom_step + zoom_step,
        });
    }

    fn centre(&mut self, x: f64, y: f64, magnify: f64) {
        let pose = self.pose();
        let width = 2.0 * (self.optics.fov_deg(pose.zoom_step) / 2.0).to_radians().tan();
        let (pan_deg, tilt_deg) = geometry::aim(&pose, x * width, y * width);
        let magnification = self.optics.magnification(pose.zoom_step) * magnify;
        let pan_deg = self.nearest(pan_deg);
        self.go_to(Pose { pan_deg, tilt_deg, zoom_step: self.optics.zoom_step(magnification) });
    }

    /// The same direction by the shorter way round, where both lead there.
    fn nearest(&self, pan_deg: f64) -> f64 {
        let pan = self.pan.position;
        if self.kinematics.endless_pan { pan + within_a_turn(pan_deg - pan) } else { pan_deg }
    }

    fn go_to(&mut self, target: Pose) {
        self.continuous = None;
        let speed = self.kinematics.speed_map.deg_s(self.move_speed);
        self.pan.go_to(target.pan_deg, speed);
        self.tilt.go_to(target.tilt_deg, speed);
        if target.zoom_step != self.zoom.position {
            self.zoom.go_to(target.zoom_step, self.kinematics.zoom_speed_step_s);
        }
    }

    /// Whether nothing moves, no move is in force (not even one against a limit) and no command is under way.
    pub fn is_at_rest(&self) -> bool {
        self.pending.is_empty() && self.motors_idle()
    }

    fn motors_idle(&self) -> bool {
        self.continuous.is_none() && [&self.pan, &self.tilt, &self.zoom].iter().all(|motor| motor.is_idle())
    }

    fn pose(&self) -> Pose {
        Pose { pan_deg: self.pan.position, tilt_deg: self.tilt.position, zoom_step: self.zoom.position }
    }

    /// The head as it is now.
    pub fn now(&self) -> Snapshot {
        Snapshot {
            time: Duration::from_nanos(self.ticks * STEP.as_nanos() as u64),
            pose: self.pose(),
            pan_rate_deg_s: self.pan.rate,
            tilt_rate_deg_s: self.tilt.rate,
            zoom_rate_step_s: self.zoom.rate,
        }
    }

    /// The same, with where the camera itself looks.
    fn seen(&self) -> Snapshot {
        Snapshot { pose: self.view, ..self.now() }
    }

    /// Where it looked at a time not longer ago than its memory.
    pub fn pose_at(&self, time: Duration) -> Pose {
        let after = self.history.partition_point(|past| past.time < time);
        let later = self.history.get(after).copied().unwrap_or_else(|| self.seen());
        let Some(earlier) = after.checked_sub(1).and_then(|before| self.history.get(before)) else {
            return later.pose;
        };
        let whole = later.time.saturating_sub(earlier.time).as_secs_f64();
        let part = time.saturating_sub(earlier.time).as_secs_f64();
        let share = if whole > 0.0 { (part / whole).min(1.0) } else { 1.0 };
        let between = |a: f64, b: f64| a + (b - a) * share;
        Pose {
            pan_deg: between(earlier.pose.pan_deg, later.pose.pan_deg),
            tilt_deg: between(earlier.pose.tilt_deg, later.pose.tilt_deg),
            zoom_step: between(earlier.pose.zoom_step, later.pose.zoom_step),
        }
    }

    fn remember(&mut self) {
        let now = self.seen();
        self.history.push_back(now);
        while self.history.get(1).is_some_and(|past| past.time + self.memory < now.time) {
            self.history.pop_front();
        }
    }

    /// The lens.
    pub fn optics(&self) -> Optics {
        self.optics
    }

    /// The speed step of absolute and relative moves.
    pub fn move_speed(&self) -> f64 {
        self.move_speed
    }

    /// How it moves.
    pub fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// How it moves, to be changed while it does (`param.cgi?action=update`).
    pub fn kinematics_mut(&mut self) -> &mut Kinematics {
        &mut self.kinematics
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn head() -> Head {
        let optics = Optics { wide_fov_deg: 55.2, max_magnification: 18.0 };
        let limits = Limits { pan_deg: (-180.0, 180.0), tilt_deg: (-90.0, 20.0) };
        Head::new(Kinematics::default(), optics, limits, Pose::default(), Duration::from_secs(2))
    }

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn play_is_taken_up_before_the_camera_turns_back() {
        let kinematics = Kinematics { backlash_deg: 0.3, ..Kinematics::default() };
        let optics = Optics { wide_fov_deg: 55.2, max_magnification: 18.0 };
        let limits = Limits { pan_deg: (-180.0, 180.0), tilt_deg: (-90.0, 20.0) };
        let mut head = Head::new(kinematics, optics, limits, Pose::default(), Duration::from_secs(2));
        let to = |pan_deg| Motion::Absolute { pan_deg: Some(pan_deg), tilt_deg: None, zoom_step: None };
        head.command(ms(0), to(10.0));
        head.advance(ms(2000));
        assert!((head.now().pose.pan_deg - 10.0).abs() < 1e-9);
        assert!((head.pose_at(ms(2000)).pan_deg - 9.85).abs() < 1e-9);
        head.command(ms(2000), to(9.8));
        head.advance(ms(3000));
        assert!((head.pose_at(ms(3000)).pan_deg - 9.85).abs() < 1e-9, "within the play");
        head.command(ms(3000), to(9.0));
        head.advance(ms(5000));
        assert!((head.pose_at(ms(5000)).pan_deg - 9.15).abs() < 1e-9);
    }

    #[test]
    fn late_commands_act_in_order() {
        let kinematics = Kinematics { command_jitter: ms(245), ..Kinematics::default() };
        let mut head = Head { kinematics, ..head() };
        for number in 0..20 {
            head.command(ms(10 * number), Motion::Speed(1.0 + number as f64));
        }
        head.advance(ms(1000));
        assert_eq!(head.move_speed(), 20.0);
        assert!(head.is_at_rest());
    }

    #[test]
    fn a_command_acts_after_the_command_delay() {
        let mut head = head();
        head.command(ms(1000), Motion::PanTilt { pan: 30.0, tilt: 0.0 });
        head.advance(ms(1060));
        assert_eq!(head.now().pose.pan_deg, 0.0);
        assert!(!head.is_at_rest(), "a command under way counts");
        head.advance(ms(1070));
        assert!(head.now().pose.pan_deg > 0.0);
    }

    #[test]
    fn a_continuous_move_keeps_its_mapped_speed_until_stopped() {
        let mut head = head();
        head.command(ms(0), Motion::PanTilt { pan: 40.0, tilt: -20.0 });
        head.advance(ms(1000));
        assert!((head.now().pan_rate_deg_s - 28.8).abs() < 1e-6);
        assert!((head.now().tilt_rate_deg_s + 3.6).abs() < 1e-6);
        head.command(ms(1000), Motion::PanTilt { pan: 0.0, tilt: 0.0 });
        head.advance(ms(2000));
        assert!(head.is_at_rest());
    }

    #[test]
    fn proportional_speed_follows_the_zoom() {
        let mut head = head();
        head.command(ms(0), Motion::PanTilt { pan: 100.0, tilt: 0.0 });
        head.advance(ms(1000));
        assert!((head.now().pan_rate_deg_s - 110.4).abs() < 1e-6);
        head.command(ms(1000), Motion::Stop);
        head.command(ms(1000), Motion::Absolute { pan_deg: None, tilt_deg: None, zoom_step: Some(9999.0) });
        head.command(ms(8000), Motion::PanTilt { pan: -100.0, tilt: 0.0 });
        head.advance(ms(9000));
        assert!((head.now().pan_rate_deg_s + 6.654).abs() < 0.01, "{}", head.now().pan_rate_deg_s);
        head.command(ms(9000), Motion::PanTilt { pan: 40.0, tilt: 0.0 });
        head.command(ms(9000), Motion::Unlimited);
        head.advance(ms(9500));
        assert!((head.now().pan_rate_deg_s - 28.8).abs() < 1e-6, "{}", head.now().pan_rate_deg_s);
    }

    #[test]
    fn a_move_against_the_limit_is_not_rest() {
        let mut head = head();
        head.command(ms(0), Motion::PanTilt { pan: 0.0, tilt: 90.0 });
        head.advance(ms(20_000));
        assert!((head.now().pose.tilt_deg - 20.0).abs() < 0.01);
        assert!(!head.is_at_rest());
        head.command(ms(20_000), Motion::Stop);
        head.advance(ms(21_000));
        assert!(head.is_at_rest());
    }

    fn endless(pan_deg: f64) -> Head {
        let optics = Optics { wide_fov_deg: 55.2, max_magnification: 18.0 };
        let kinematics = Kinematics { endless_pan: true, ..Kinematics::default() };
        let world = Limits { pan_deg: (-20.0, 20.0), tilt_deg: (-90.0, 20.0) };
        let limits = kinematics.limits_in(world);
        assert_eq!(limits, Limits { pan_deg: (-180.0, 180.0), ..world });
        Head::new(kinematics, optics, limits, Pose { pan_deg, ..Pose::default() }, Duration::from_secs(2))
    }

    #[test]
    fn endless_pan_goes_round_and_round() {
        let mut head = endless(175.0);
        head.command(ms(0), Motion::PanTilt { pan: 60.0, tilt: 0.0 });
        head.advance(ms(20_000));
        assert!((head.now().pan_rate_deg_s - 97.2).abs() < 1e-6, "{:?}", head.now());
        assert!(head.now().pose.pan_deg > 175.0 + 19.0 * 97.2);
        head.command(ms(20_000), Motion::Stop);
        head.advance(ms(21_000));
        assert!(head.is_at_rest());
    }

    #[test]
    fn endless_pan_takes_the_shorter_way_to_a_position_and_the_named_one_by_an_angle() {
        for (from, to, way) in [(170.0, -170.0, 20.0), (-170.0, 170.0, -20.0), (-100.0, 60.0, 160.0)] {
            let mut head = endless(from);
            head.command(ms(0), Motion::Absolute { pan_deg: Some(to), tilt_deg: None, zoom_step: None });
            head.advance(ms(4000));
            assert!((head.now().pose.pan_deg - from - way).abs() < 1e-9, "{:?}", head.now());
            assert_eq!(within_a_turn(head.now().pose.pan_deg), to);
        }
        let mut head = endless(170.0);
        head.command(ms(0), Motion::Relative { pan_deg: 270.0, tilt_deg: 0.0, zoom_step: 0.0 });
        head.advance(ms(4000));
        assert_eq!(head.now().pose.pan_deg, 440.0);
        head.command(ms(4000), Motion::Centre { x: 0.5, y: 0.0, magnify: 1.0 });
        head.advance(ms(8000));
        assert!((head.now().pose.pan_deg - 467.6).abs() < 1e-6, "{:?}", head.now());
    }

    #[test]
    fn a_new_move_replaces_the_old() {
        let mut head = head();
        head.command(ms(0), Motion::Absolute { pan_deg: Some(90.0), tilt_deg: None, zoom_step: None });
        head.command(ms(100), Motion::PanTilt { pan: -20.0, tilt: 0.0 });
        head.advance(ms(2000));
        assert!(head.now().pan_rate_deg_s < 0.0);
        head.command(
            ms(2000),
            Motion::Absolute { pan_deg: Some(5.0), tilt_deg: Some(-5.0), zoom_step: None },
        );
        head.advance(ms(6000));
        assert!(head.is_at_rest());
        assert_eq!((head.now().pose.pan_deg, head.now().pose.tilt_deg), (5.0, -5.0));
    }

    #[test]
    fn centring_and_nudging_turn_by_what_is_seen() {
        let mut head = head();
        // The right edge of the picture is half a field of view away.
        head.command(ms(0), Motion::Centre { x: 0.5, y: 0.0, magnify: 2.0 });
        head.advance(ms(5000));
        assert!((head.now().pose.pan_deg - 27.6).abs() < 1e-6);
        assert!((head.optics.magnification(head.now().pose.zoom_step) - 2.0).abs() < 1e-6);
        head.command(ms(5000), Motion::Absolute { pan_deg: Some(0.0), tilt_deg: None, zoom_step: Some(1.0) });
        head.command(ms(9000), Motion::Nudge { pan: -1.0, tilt: -1.0 });
        head.advance(ms(12_000));
        assert!((head.now().pose.pan_deg + 13.8).abs() < 1e-6);
        assert!((head.now().pose.tilt_deg + 13.8).abs() < 1e-6);
    }

    #[test]
    fn the_past_is_remembered() {
        let mut head = head();
        head.command(ms(0), Motion::PanTilt { pan: 30.0, tilt: 0.0 });
        head.advance(ms(500));
        let then = head.now().pose;
        head.advance(ms(1500));
        assert_eq!(head.pose_at(ms(500)), then);
        assert_eq!(head.pose_at(ms(9999)), head.now().pose);
        let hours = Duration::from_secs(7200);
        head.command(ms(1500), Motion::Stop);
        head.advance(hours);
        assert_eq!(head.pose_at(hours - ms(100)), head.now().pose);
        assert!(head.history.len() < 2000);
    }

    proptest! {
        #[test]
        fn the_result_does_not_depend_on_how_often_it_is_asked(stops in prop::collection::vec(0u64..3000, 0..20)) {
            let drive = |head: &mut Head| {
                head.command(ms(0), Motion::PanTilt { pan: 37.0, tilt: 11.0 });
                head.command(ms(0), Motion::Zoom(50.0));
            };
            let (mut once, mut often) = (head(), head());
            drive(&mut once);
            drive(&mut often);
            let mut stops = stops;
            stops.sort_unstable();
            for stop in stops {
                often.advance(ms(stop));
            }
            once.advance(ms(3000));
            often.advance(ms(3000));
            prop_assert_eq!(once.now(), often.now());
        }

        #[test]
        fn no_command_leads_out_of_the_limits(commands in prop::collection::vec((-100.0f64..100.0, -100.0f64..100.0, 0u64..500), 1..12)) {
            let mut head = head();
            let mut time = ms(0);
            for (pan, tilt, wait) in commands {
                head.command(time, Motion::PanTilt { pan, tilt });
                for _ in 0..10 {
                    time += ms(wait);
                    head.advance(time);
                    let now = head.now();
                    prop_assert!(now.pose.pan_deg.abs() <= 180.0);
                    prop_assert!((-90.0..=20.0).contains(&now.pose.tilt_deg));
                }
            }
        }
    }
}
