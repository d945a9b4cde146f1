// SPDX-License-Identifier: MPL-2.0

//! A camera and a sink whose time goes on together, picture by picture.

use std::time::Duration;

use ptztrack_contract::{BufferMeta, Rect, TargetMeta, TargetState, Vector};
use virtual_camera::{
    Bounds, Clock, Kinematics, Pose, Settings, SyntheticSettings, VirtualCamera, Waypoint, World,
};

use super::{Heard, Rig, moves, target};

/// From one picture to the next.
pub const FRAME: Duration = Duration::from_millis(40);

/// Answers are waited for by the clock, in stepped time too: a busy machine is not to be taken for a fault.
pub const PATIENT_NS: u64 = 60_000_000_000;

/// Width and height of the pictures.
const SIZE: (u32, u32) = (320, 240);

/// Somebody who stands for a while and then paces to and fro, `stretch_s` for 30 degrees and 1 s of rest in between; the
/// camera, `wide_fov_deg` wide, looks at where they begin.
pub fn pacing(stands_s: u64, stretch_s: u64, wide_fov_deg: f64, kinematics: Kinematics) -> Settings {
    let turn = |turn: u64| {
        let from = stands_s + (stretch_s + 1) * turn;
        [(from, turn), (from + stretch_s, turn + 1)]
    };
    let point = |(seconds, side): (u64, u64)| Waypoint {
        time: Duration::from_secs(seconds),
        pan_deg: if side.is_multiple_of(2) { -15.0 } else { 15.0 },
        tilt_deg: -2.0,
    };
    let path = [(0, 0)].into_iter().chain((0..10).flat_map(turn)).map(point).collect();
    Settings {
        world: World::Synthetic(SyntheticSettings { path, wide_fov_deg, stays: true, ..Default::default() }),
        home: Some(Pose { pan_deg: -15.0, tilt_deg: -2.0, zoom_step: 1.0 }),
        kinematics,
        ..Settings::default()
    }
}

/// A stepped camera and a sink in lockstep with it; or both by the clock.
pub struct Stage {
    /// Goes before the camera: a sink whose last stop nobody answers tries again, and may meet the next test's camera at that port.
    pub rig: Rig,
    pub camera: VirtualCamera,
    pub now: Duration,
    /// What was on the bus so far.
    pub heard: Vec<Heard>,
    stepped: bool,
    /// What the picture's way to the tracker makes of what it would say.
    shown_as: Box<dyn Fn(TargetMeta) -> TargetMeta>,
}

/// Where a person is in one picture, in parts of it.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// When the picture was pushed.
    pub at: Duration,
    /// Off the middle, to the right and down.
    pub offset: (f64, f64),
    pub height: f64,
}

impl Shown {
    pub fn distance(&self) -> f64 {
        self.offset.0.hypot(self.offset.1)
    }

    /// Whether no part of the person is beyond the picture's edge.
    pub fn is_whole(&self) -> bool {
        self.offset.0.abs() < 0.5 && self.offset.1.abs() + self.height / 2.0 < 0.5
    }
}

/// Mean distance from the middle, in parts of the picture.
pub fn mean_distance(shown: &[Shown]) -> f64 {
    shown.iter().map(Shown::distance).sum::<f64>() / shown.len() as f64
}

impl Stage {
    pub fn new(settings: Settings, set: impl FnOnce(Rig) -> Rig) -> Self {
        Self::before(VirtualCamera::start(Settings { clock: Clock::Stepped, ..settings }).unwrap(), set)
    }

    pub fn before(camera: VirtualCamera, set: impl FnOnce(Rig) -> Rig) -> Self {
        let rig =
            set(Rig::ready(&location(&camera)).with("lockstep", true).with("timeout", PATIENT_NS)).play();
        let now = camera.status().time;
        Self { camera, rig, now, heard: Vec::new(), stepped: true, shown_as: Box::new(|meta| meta) }
    }

    /// Time passes as everybody's, and pictures come when they come.
    pub fn by_the_clock(camera: VirtualCamera, set: impl FnOnce(Rig) -> Rig) -> Self {
        let rig = set(Rig::ready(&location(&camera))).play();
        let now = camera.status().time;
        Self { camera, rig, now, heard: Vec::new(), stepped: false, shown_as: Box::new(|meta| meta) }
    }

    /// The tracker's pictures are mirrored, turned or the like: it says something else of the same.
    pub fn show_as(&mut self, shown_as: impl Fn(TargetMeta) -> TargetMeta + 'static) {
        self.shown_as = Box::new(shown_as);
    }

    /// Lets time pass until the next picture.
    fn step(&mut self) {
        self.now += FRAME;
        if self.stepped {
            self.camera.advance_to(self.now);
        } else {
            std::thread::sleep(self.now.saturating_sub(self.camera.now()));
            self.now = self.camera.now();
        }
    }

    /// The next picture comes, with these words of a tracker.
    pub fn picture(&mut self, meta: Option<&TargetMeta>) {
        self.step();
        self.push(meta);
    }

    fn push(&mut self, meta: Option<&TargetMeta>) {
        let mut buffer = gst::Buffer::with_size((SIZE.0 * SIZE.1) as usize).unwrap();
        let content = buffer.get_mut().unwrap();
        if self.stepped {
            content.set_pts(gst::ClockTime::try_from(self.now).unwrap());
        }
        if let Some(meta) = meta {
            meta.attach(content).unwrap();
        }
        assert_eq!(self.rig.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
        self.heard.extend(self.rig.heard());
    }

    /// The same words for some time.
    pub fn run(&mut self, seconds: f64, meta: &TargetMeta) {
        for _ in 0..frames(seconds) {
            self.picture(Some(meta));
        }
    }

    /// Pushes what a perfect tracker says of the world's person for some time; returns what was to be seen.
    pub fn follow(&mut self, seconds: f64) -> Vec<Shown> {
        let step = |_| {
            self.step();
            let meta = self.tracked(self.now.saturating_sub(self.camera.video_delay()));
            self.push(meta.clone().map(&self.shown_as).as_ref());
            let meta = meta?;
            let offset = (meta.centroid.x - 0.5, meta.centroid.y - 0.5);
            Some(Shown { at: self.now, offset, height: meta.bounds.height })
        };
        (0..frames(seconds)).filter_map(step).collect()
    }

    /// What a tracker says of a picture, and the one before; `None` where nobody is in it.
    fn tracked(&self, exposure: Duration) -> Option<TargetMeta> {
        let before = exposure.checked_sub(FRAME)?;
        let bounds = self.bounds(exposure, exposure)?;
        let per_s = |from: Bounds, to: Bounds| {
            let (from, to) = (middle(&from), middle(&to));
            Vector { x: (to.0 - from.0) / FRAME.as_secs_f64(), y: (to.1 - from.1) / FRAME.as_secs_f64() }
        };
        let (from, turned) = (self.bounds(before, before)?, self.bounds(before, exposure)?);
        let (x, y) = middle(&bounds);
        let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
        Some(TargetMeta {
            bounds: Rect {
                x: bounds.left / width,
                y: bounds.top / height,
                width: bounds.width / width,
                height: bounds.height / height,
            },
            velocity: per_s(from, bounds),
            // Of the place where the person was: what the camera alone did.
            ego_velocity: Some(per_s(from, turned)),
            ego_zoom: Some(self.growth(before, exposure)),
            ..target(TargetState::Tracking, x, y)
        })
    }

    /// How fast the picture grows from one moment to the next, as a logarithm per second.
    pub fn growth(&self, before: Duration, exposure: Duration) -> f64 {
        let magnification = |time| self.camera.optics().magnification(self.camera.pose_at(time).zoom_step);
        (magnification(exposure) / magnification(before)).ln() / FRAME.as_secs_f64()
    }

    /// The person of a moment as seen from where the camera looked at another, in pixels.
    fn bounds(&self, at: Duration, looking: Duration) -> Option<Bounds> {
        let pose = self.camera.pose_at(looking);
        self.camera.ground_truth_from(&pose, at, SIZE).first().map(|person| person.bounds)
    }

    /// The moves that the camera received.
    pub fn moves(&self) -> Vec<String> {
        moves(&self.camera)
    }

    pub fn times(&self, wanted: &Heard) -> usize {
        self.heard.iter().filter(|heard| *heard == wanted).count()
    }
}

/// Where a camera is spoken to: by ONVIF, if it speaks that.
fn location(camera: &VirtualCamera) -> String {
    camera.onvif_url().unwrap_or_else(|| camera.url())
}

fn frames(seconds: f64) -> u32 {
    (seconds / FRAME.as_secs_f64()).round() as u32
}

fn middle(bounds: &Bounds) -> (f64, f64) {
    let (x, y) = bounds.centre();
    (x / f64::from(SIZE.0), y / f64::from(SIZE.1))
}

/// Somebody 1.75 m tall who stands 4 m away, walks off to 15 m at 1.2 m/s and somewhat aside, and stands there: how far
/// away they are at a time, in metres, and to which pan.
pub fn departing(time: Duration) -> (f64, f64) {
    let walked = 1.2 * (time.as_secs_f64() - 8.0).clamp(0.0, 11.0 / 1.2);
    let (far, aside) = (4.0 + walked, 0.2 * walked);
    (far.hypot(aside), aside.atan2(far).to_degrees())
}

/// The same of somebody of whom the tracker holds the middle only.
pub fn in_part(meta: &TargetMeta) -> TargetMeta {
    let Rect { y, height, .. } = meta.bounds;
    let bounds = Rect { y: y + 0.375 * height, height: height / 4.0, ..meta.bounds };
    TargetMeta { bounds, ..meta.clone() }
}

/// What a tracker says of somebody 1.75 m tall who is so far away and in that direction, where their middle is in the
/// picture.
pub fn seen(stage: &Stage, exposure: Duration, (distance_m, pan_deg): (f64, f64)) -> Option<TargetMeta> {
    let pose = stage.camera.pose_at(exposure);
    if (pan_deg - pose.pan_deg).to_radians().cos() <= 0.0 {
        return None;
    }
    let wide = (stage.camera.optics().fov_deg(pose.zoom_step) / 2.0).to_radians().tan();
    let (right, down) = ((pan_deg - pose.pan_deg).to_radians().tan(), pose.tilt_deg.to_radians().tan());
    let tall = wide * 240.0 / 320.0;
    let (x, y) = (0.5 + right / (2.0 * wide), 0.5 + down / (2.0 * tall));
    let height = (1.75 / distance_m / (2.0 * tall)).min(1.0);
    let bounds = Rect { x: x - height / 8.0, y: y - height / 2.0, width: height / 4.0, height };
    let visible = (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y);
    visible.then(|| TargetMeta { bounds, ..target(TargetState::Tracking, x, y) })
}
