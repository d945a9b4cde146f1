// SPDX-License-Identifier: MPL-2.0

//! The virtual camera's head, everything late, before somebody who walks: closed loops for tests, without a picture and
//! without a network.

use std::collections::VecDeque;
use std::iter;
use std::time::Duration;

use ptztrack_contract::{Point, Rect, Vector};

use servo::{
    Estimates, HardLimits, Measurement, PanTilt, Position, Range, ServoSettings, Time, View, Visibility,
    around_deg,
};
use session::{Command, Error, Stop, ZoomStep};
use session::{Next, Query, Request, Response};
use virtual_camera::{Head, Kinematics, Motion, Optics, Pose, ProportionalSpeed, ZOOM_RANGE};

use session::{ControlLoop, LoopEvent};

const TICK: Duration = Duration::from_millis(5);
const PICTURE: Duration = Duration::from_millis(40);
pub const ASPECT: f64 = 4.0 / 3.0;
pub const WIDE_FOV_DEG: f64 = 55.2;
const OPTICS: Optics = Optics { wide_fov_deg: WIDE_FOV_DEG, max_magnification: 18.0 };
const TILT_LIMITS_DEG: (f64, f64) = (-90.0, 20.0);

/// What the world is, whatever the servo believes.
pub struct Setup {
    pub settings: ServoSettings,
    /// How the camera moves, and how late.
    pub kinematics: Kinematics,
    pub video_delay: Duration,
    pub round_trip: Duration,
    pub magnification: f64,
    /// Where it looks at first.
    pub pose: PanTilt,
    /// Half the width of the noise in the target's place and height, parts of the picture.
    pub jitter: f64,
    /// Whether the tracker's velocity is the difference of its noisy places; else it is the true one.
    pub noisy_velocity: bool,
    /// Whether the tracker sees the background's motion.
    pub sees_ground: bool,
    /// Half the width of the noise in the background's motion, pictures per second.
    pub ground_jitter: f64,
    /// Whether the camera tells where it looks.
    pub tells_position: bool,
    /// Whether the camera tells how it zooms, and where its zoom is.
    pub tells_lens: bool,
    /// Whether the target is seen though it has left the picture.
    pub sees_beyond: bool,
    /// Where the noise begins.
    pub seed: u64,
    pub visible: fn(f64) -> Visibility,
    /// How fast the lens moves where it is told a speed, both in parts of its fastest.
    pub lens: fn(f64) -> f64,
    /// Commands that this camera does not know.
    pub refuses: fn(&Command) -> bool,
}

impl Setup {
    /// A dome that turns round and round, zoomed so that it magnifies so many times, with so much delay in all; the servo
    /// knows the delay.
    pub fn new(total_delay_ms: u64, magnification: f64) -> Self {
        Self {
            settings: ServoSettings {
                latency: Duration::from_millis(total_delay_ms),
                ..ServoSettings::default()
            },
            video_delay: Duration::from_millis(total_delay_ms * 2 / 5 / 5 * 5),
            kinematics: Kinematics {
                command_delay: Duration::from_millis(total_delay_ms * 3 / 5),
                endless_pan: true,
                proportional_speed: ProportionalSpeed {
                    enabled: false,
                    ..Kinematics::default().proportional_speed
                },
                ..Kinematics::default()
            },
            round_trip: Duration::from_millis(30),
            magnification,
            pose: PanTilt::default(),
            jitter: 0.0,
            noisy_velocity: false,
            sees_ground: true,
            ground_jitter: 0.0,
            tells_position: true,
            tells_lens: true,
            sees_beyond: true,
            seed: 1,
            visible: |_| Visibility::Seen,
            lens: |told| told,
            refuses: |_| false,
        }
    }

    fn pan_limits_deg(&self) -> (f64, f64) {
        self.kinematics.limits.map_or((-180.0, 180.0), |limits| limits.pan_deg)
    }

    /// Lets it follow a target for some seconds. `target`: its direction and height in degrees at a time in seconds.
    pub fn run(self, seconds: f64, target: impl Fn(f64) -> (PanTilt, f64)) -> Run {
        let mut simulation = Simulation::new(self);
        let mut run = Run::default();
        while simulation.now.since_zero().as_secs_f64() < Simulation::START_S + seconds {
            simulation.tick(&|time| target(time - Simulation::START_S), &mut run);
        }
        run.reports = simulation.control.take_events();
        run.estimates = Some(simulation.control.estimates());
        run
    }
}

/// One picture, as it really is.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    pub time_s: f64,
    /// Offset of the target from the middle, in picture widths and heights.
    pub offset: Vector,
    pub height: f64,
    pub pose: PanTilt,
    pub rate: PanTilt,
}

/// What happened, time counted from the target's begin.
#[derive(Debug, Default)]
pub struct Run {
    pub frames: Vec<Frame>,
    pub commands: Vec<(f64, Command)>,
    pub reports: Vec<LoopEvent>,
    /// What the servo takes the camera for in the end.
    pub estimates: Option<Estimates>,
}

impl Run {
    pub fn frames_between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &Frame> {
        self.frames.iter().filter(move |frame| (from_s..to_s).contains(&frame.time_s))
    }

    /// Mean distance from the middle in picture widths.
    pub fn mean_offset(&self, from_s: f64, to_s: f64) -> f64 {
        let distances =
            self.frames_between(from_s, to_s).map(|frame| frame.offset.x.hypot(frame.offset.y / ASPECT));
        let (sum, count) = distances.fold((0.0, 0), |(sum, count), distance| (sum + distance, count + 1));
        sum / f64::from(count)
    }

    /// Farthest to that side (-1: the camera is ahead of a target that goes right), in half picture widths.
    pub fn farthest(&self, side: f64, from_s: f64, to_s: f64) -> f64 {
        self.frames_between(from_s, to_s).map(|frame| frame.offset.x * side * 2.0).fold(0.0, f64::max)
    }

    pub fn commands_between(&self, from_s: f64, to_s: f64) -> usize {
        self.commands.iter().filter(|(at, _)| (from_s..to_s).contains(at)).count()
    }
}

struct Shot {
    frame: Frame,
    place: Point,
    ego: Vector,
    velocity: Vector,
    /// How the background grows.
    zoom: f64,
    bounds: Rect,
    at: Time,
}

struct Simulation {
    setup: Setup,
    control: ControlLoop,
    now: Time,
    head: Head,
    in_flight: Option<(Request, Time)>,
    shots: VecDeque<Shot>,
    last_shot: Option<(Time, PanTilt, View, PanTilt, Point)>,
    noise: u64,
}

impl Simulation {
    /// The clock does not begin at zero; by then the camera has introduced itself.
    const START_S: f64 = 2.0;

    fn new(setup: Setup) -> Self {
        let limits = virtual_camera::Limits { pan_deg: setup.pan_limits_deg(), tilt_deg: TILT_LIMITS_DEG };
        let home = Pose {
            pan_deg: setup.pose.pan,
            tilt_deg: setup.pose.tilt,
            zoom_step: OPTICS.zoom_step(setup.magnification),
        };
        Self {
            control: crate::control_loop(setup.settings.clone()),
            now: Time::from_millis(1000),
            head: Head::new(setup.kinematics.clone(), OPTICS, limits, home, Duration::ZERO),
            in_flight: None,
            shots: VecDeque::new(),
            last_shot: None,
            noise: setup.seed,
            setup,
        }
    }

    fn tick(&mut self, target: &impl Fn(f64) -> (PanTilt, f64), run: &mut Run) {
        self.now += TICK;
        self.head.advance(self.now.since_zero());
        if self.now.since_zero().as_millis().is_multiple_of(PICTURE.as_millis()) {
            self.expose(target);
        }
        while self.shots.front().is_some_and(|shot| shot.at + self.setup.video_delay <= self.now) {
            if let Some(shot) = self.shots.pop_front() {
                self.show(&shot, run);
            }
        }
        self.exchange(run);
    }

    fn pose(&self) -> PanTilt {
        let Pose { pan_deg, tilt_deg, .. } = self.head.now().pose;
        PanTilt::new(pan_deg, tilt_deg)
    }

    fn view(&self) -> View {
        let Pose { tilt_deg, zoom_step, .. } = self.head.now().pose;
        View { horizontal_fov_deg: OPTICS.fov_deg(zoom_step), aspect: ASPECT, tilt_deg }
    }

    fn expose(&mut self, target: &impl Fn(f64) -> (PanTilt, f64)) {
        let time_s = self.now.since_zero().as_secs_f64();
        let (direction, height_deg) = target(time_s);
        let (pose, view, head) = (self.pose(), self.view(), self.head.now());
        let point = |direction: PanTilt| view.point(direction - pose);
        let place = point(direction);
        let above = point(direction + PanTilt::new(0.0, height_deg / 2.0));
        let below = point(direction - PanTilt::new(0.0, height_deg / 2.0));
        let jitter = self.setup.jitter;
        let noisy = Point { x: place.x + self.noise(jitter), y: place.y + self.noise(jitter) };
        let (mut ego, mut velocity, mut zoom) = (Vector::default(), Vector::default(), 0.0);
        if let Some((at, last_pose, last_view, last_direction, last_noisy)) = self.last_shot {
            let dt = (self.now - at).as_secs_f64();
            let per_s = |to: Point, from: Point| Vector { x: (to.x - from.x) / dt, y: (to.y - from.y) / dt };
            let before = last_view.point(last_direction - last_pose);
            ego = per_s(point(last_direction), before);
            let half_tangent = |view: &View| (view.horizontal_fov_deg / 2.0).to_radians().tan();
            zoom = (half_tangent(&last_view) / half_tangent(&view)).ln() / dt;
            velocity =
                if self.setup.noisy_velocity { per_s(noisy, last_noisy) } else { per_s(place, before) };
        }
        let shaken = self.setup.ground_jitter;
        ego = Vector { x: ego.x + self.noise(shaken), y: ego.y + self.noise(shaken) };
        if !self.setup.tells_lens {
            zoom += self.noise(2.0 * shaken);
        }
        self.last_shot = Some((self.now, pose, view, direction, noisy));
        let frame = Frame {
            time_s: time_s - Self::START_S,
            offset: Vector { x: place.x - 0.5, y: place.y - 0.5 },
            height: below.y - above.y,
            pose,
            rate: PanTilt::new(head.pan_rate_deg_s, head.tilt_rate_deg_s),
        };
        let height = (frame.height + self.noise(jitter)).max(0.0);
        let bounds = box_about(noisy, height);
        self.shots.push_back(Shot { frame, place: noisy, ego, velocity, zoom, bounds, at: self.now });
    }

    fn show(&mut self, shot: &Shot, run: &mut Run) {
        if shot.frame.time_s < 0.0 {
            return;
        }
        run.frames.push(shot.frame);
        let inside = shot.frame.offset.x.abs().max(shot.frame.offset.y.abs()) < 0.5;
        let sees = inside || self.setup.sees_beyond;
        let measurement = Measurement {
            visibility: if sees { (self.setup.visible)(shot.frame.time_s) } else { Visibility::Gone },
            id: 1,
            centroid: shot.place,
            bounds: shot.bounds,
            velocity: shot.velocity,
            ego_velocity: Some(shot.ego).filter(|_| self.setup.sees_ground),
            ego_zoom: Some(shot.zoom).filter(|_| self.setup.sees_ground),
            unchanged_for: None,
            size: (640, 480),
            aspect: ASPECT,
            taken_at: self.now,
        };
        self.control.measure(measurement, self.now);
    }

    fn exchange(&mut self, run: &mut Run) {
        if let Some((request, sent)) = self.in_flight {
            if self.now < sent + self.setup.round_trip {
                return;
            }
            self.in_flight = None;
            let answer = self.answer(&request);
            self.control.on_response(&request, answer, sent, self.now);
        }
        if let Next::Do(request) = self.control.next_request(self.now) {
            self.control.sending(&request, self.now);
            self.in_flight = Some((request, self.now));
            if let Request::Command(command) = request {
                run.commands.push((self.now.since_zero().as_secs_f64() - Self::START_S, command));
                if !(self.setup.refuses)(&command) {
                    for motion in motions(&command, self.setup.lens) {
                        self.head.command(self.now.since_zero(), motion);
                    }
                }
            }
        }
    }

    fn answer(&self, request: &Request) -> Result<Response, Error> {
        Ok(match request {
            Request::Command(command) if (self.setup.refuses)(command) => {
                return Err(Error::Camera("unknown".to_owned()));
            }
            Request::Command(_) => Response::Accepted,
            Request::Query(Query::Position) if self.setup.tells_position => Response::Position(Position {
                pan_deg: Some(around_deg(0.0, self.pose().pan)),
                tilt_deg: Some(self.pose().tilt),
                zoom: Some(ZoomStep(self.head.now().pose.zoom_step.round()).travel())
                    .filter(|_| self.setup.tells_lens),
            }),
            Request::Query(Query::Limits) => Response::Limits(HardLimits {
                pan_deg: Some(range(self.setup.pan_limits_deg())),
                tilt_deg: Some(range(TILT_LIMITS_DEG)),
                zoom: Some(Range {
                    min: ZoomStep(ZOOM_RANGE.0).travel(),
                    max: ZoomStep(ZOOM_RANGE.1).travel(),
                }),
                field_angle_deg: Some(range((OPTICS.fov_deg(ZOOM_RANGE.1), WIDE_FOV_DEG)))
                    .filter(|_| self.setup.tells_lens),
            }),
            Request::Query(_) => return Err(Error::Camera("none".to_owned())),
        })
    }

    fn noise(&mut self, half_width: f64) -> f64 {
        // Knuth's linear congruence: the same noise every time.
        self.noise =
            self.noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.noise >> 33) as f64 / f64::from(1u32 << 31) * 2.0 - 1.0) * half_width
    }
}

fn range((min, max): (f64, f64)) -> Range {
    Range { min, max }
}

/// What the head is to do, which counts in steps.
fn motions(command: &Command, lens: fn(f64) -> f64) -> Vec<Motion> {
    let motion = match command {
        Command::Move { motion, .. } => motion,
        Command::Stop(Stop::AllAxes) => &servo::Motion::STILL,
        Command::Stop(_) => return vec![Motion::Stop],
    };
    let step = |part: f64| (part * 100.0).round();
    match *motion {
        servo::Motion::Velocity { pan, tilt, zoom } => {
            let turn = Motion::PanTilt { pan: step(pan), tilt: step(tilt) };
            iter::once(turn).chain(zoom.map(|zoom| Motion::Zoom(step(lens(zoom))))).collect()
        }
        servo::Motion::Absolute { pan_deg, tilt_deg, speed, zoom } => vec![
            Motion::Speed(step(speed)),
            Motion::Absolute {
                pan_deg: Some(pan_deg),
                tilt_deg: Some(tilt_deg),
                zoom_step: zoom.map(|travel| f64::from(ZoomStep::at(travel).whole())),
            },
        ],
        servo::Motion::Centre { x, y, width, height, magnify } => {
            let (width, height) = (f64::from(width), f64::from(height));
            vec![Motion::Centre {
                x: f64::from(x) / width - 0.5,
                y: (f64::from(y) - height / 2.0) / width,
                magnify: (magnify.unwrap_or(1.0) * 100.0).round() / 100.0,
            }]
        }
        servo::Motion::Preset { .. } => {
            vec![Motion::Absolute { pan_deg: Some(0.0), tilt_deg: Some(0.0), zoom_step: None }]
        }
    }
}

/// What of a standing person's box is inside the picture.
fn box_about(middle: Point, height: f64) -> Rect {
    let inside = |from: f64, length: f64| (from.clamp(0.0, 1.0), (from + length).clamp(0.0, 1.0));
    let (left, right) = inside(middle.x - height / 8.0, height / 4.0);
    let (top, bottom) = inside(middle.y - height / 2.0, height);
    Rect { x: left, y: top, width: right - left, height: bottom - top }
}
