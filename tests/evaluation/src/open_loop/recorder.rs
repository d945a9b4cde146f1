// SPDX-License-Identifier: MPL-2.0

//! Records a scene: a camera that is steered by the truth, and an encoder behind it.

use std::time::Duration;

use virtual_camera::{Clock, Pose, Seeded, Settings, VirtualCamera};

use super::{
    recorded::{CameraState, RecordedPicture, RecordedScene},
    steering::{EVERY, HORIZON, Steering, speed_step},
};
use crate::{
    experiment::{self, Experiment, Target},
    lockstep::{RunError, clock_time, info},
    pipeline::{LastBytes, Pipeline, SINK, SOURCE},
};

/// Streams of chance: of the steering's error, and of when a camera without anybody before it turns.
const STEERING: u64 = 0x57ee;
const ROUND: u64 = 0x204d;
/// A camera that moves is said to be this often.
const REPEAT: Duration = Duration::from_millis(500);
/// How far and how fast a camera turns that nobody is before, degrees and degrees per second.
const ROUND_DEG: (f64, f64) = (10.0, 30.0);
const ROUND_DEG_S: f64 = 15.0;

/// What the camera of `experiment` sees from the scene's begin to its end.
pub(super) fn record(experiment: &Experiment, settings: &Settings) -> Result<RecordedScene, RunError> {
    let camera = experiment.camera(settings, Clock::Stepped)?;
    let (period, size) = (camera.frame_period(), experiment.size);
    let first = experiment.first_counted(&camera).ok_or(RunError::Nobody)?;
    let encoder = Encoder::new(experiment, period)?;
    let mut helm = Helm::new(experiment, settings, &camera, first);
    helm.lead()?;
    let (mut pictures, mut looked, mut arrived) = (Vec::new(), None::<Pose>, Duration::ZERO);
    for number in experiment.pictures(period) {
        let exposure = experiment::exposure(number, period);
        let arrival = camera.arrival(exposure).max(arrived + Duration::from_millis(1));
        arrived = arrival;
        camera.advance_to(arrival);
        let told = helm.steer(number, arrival)?;
        let (truth, people) = experiment.witness(&camera, number, first);
        let pose = camera.pose_at(exposure);
        let motion = looked.replace(pose).map(|before| camera.background_motion(&before, &pose, size));
        let encoded = encoder.encode(&camera.picture(exposure, size)?, arrival)?;
        pictures.push(RecordedPicture { arrival, encoded, truth, people, motion, told });
    }
    let begin = experiment.pictures(period).next().unwrap_or(0);
    let first = first.saturating_sub(begin) as usize;
    Ok(RecordedScene { caps: encoder.caps()?, period, first, pictures })
}

/// Has `camera` on the person when the scene begins, if it is to be.
pub(crate) fn lead(
    experiment: &Experiment,
    settings: &Settings,
    camera: &VirtualCamera,
) -> Result<(), RunError> {
    Helm::new(experiment, settings, camera, 0).lead()
}

/// Makes of each picture what the camera sends.
struct Encoder {
    pipeline: Pipeline,
    info: gst_video::VideoInfo,
    bytes: LastBytes,
}

impl Encoder {
    fn new(experiment: &Experiment, period: Duration) -> Result<Self, RunError> {
        let info = info(experiment.size, period)?;
        let description = format!(
            "appsrc name={SOURCE} ! {} ! fakesink name={SINK} sync=false async=false",
            experiment.codec.encoder()
        );
        let pipeline = Pipeline::new(&description, &info)?;
        experiment.codec.attach(pipeline.bin())?;
        let bytes = pipeline.last_bytes()?;
        pipeline.start()?;
        Ok(Self { pipeline, info, bytes })
    }

    fn encode(&self, picture: &virtual_camera::Picture, arrival: Duration) -> Result<Vec<u8>, RunError> {
        let (width, height) = picture.size();
        let mut buffer = picture.to_buffer(&self.info).ok_or(RunError::Size(width, height))?;
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(clock_time(arrival));
        }
        self.pipeline.finish(buffer)?;
        Ok(self.bytes.take())
    }

    fn caps(&self) -> Result<String, RunError> {
        Ok(self.pipeline.caps()?.to_string())
    }
}

/// Whoever steers, and what was said of it.
struct Helm<'a> {
    experiment: &'a Experiment,
    settings: &'a Settings,
    camera: &'a VirtualCamera,
    steering: Steering,
    /// Number of the first picture that counts.
    first: u32,
    /// With nobody there: from when to when the camera turns, and how fast.
    round: Option<(Duration, Duration, f64)>,
    /// When it was steered last, and at which speed steps.
    steered: Option<Duration>,
    steps: (i32, i32),
    /// When upstream was told last.
    told: Option<Duration>,
}

impl<'a> Helm<'a> {
    fn new(
        experiment: &'a Experiment,
        settings: &'a Settings,
        camera: &'a VirtualCamera,
        first: u32,
    ) -> Self {
        let scene = &experiment.scene;
        let name = scene.title.bytes().fold(0u64, |sum, byte| sum.wrapping_mul(31).wrapping_add(byte.into()));
        let chance = Seeded::new(experiment.seed).fork(name).fork(u64::from(experiment.replicate));
        let round =
            (scene.target == Target::Nobody).then(|| Self::round(experiment, chance.fork(ROUND))).flatten();
        let steering = Steering::new(chance.fork(STEERING));
        let (steered, steps, told) = (None, (0, 0), None);
        Self { experiment, settings, camera, steering, first, round, steered, steps, told }
    }

    /// One camera in two turns once, as if it went home after somebody was lost.
    fn round(experiment: &Experiment, mut chance: Seeded) -> Option<(Duration, Duration, f64)> {
        if chance.unit() < 0.5 {
            return None;
        }
        let begin = experiment.scene.begin + Duration::from_secs_f64(chance.range(1.0, 6.0));
        let lasts = Duration::from_secs_f64(chance.range(ROUND_DEG.0, ROUND_DEG.1) / ROUND_DEG_S);
        Some((begin, begin + lasts, chance.pick(&[-ROUND_DEG_S, ROUND_DEG_S])))
    }

    /// Steers up to the first picture.
    fn lead(&mut self) -> Result<(), RunError> {
        let scene = &self.experiment.scene;
        let mut now = scene.begin.saturating_sub(scene.lead);
        while now < scene.begin {
            self.camera.advance_to(now);
            self.steer(self.first, now)?;
            now += EVERY;
        }
        Ok(())
    }

    /// Steers when it is time to; gives what upstream is told.
    fn steer(&mut self, number: u32, now: Duration) -> Result<Option<CameraState>, RunError> {
        let follows = number >= self.first;
        let due = self.steered.is_none_or(|before| now >= before + EVERY);
        let mut changed = self.told.is_none();
        if follows && due {
            self.steered = Some(now);
            let rates = self.rates(now);
            let map = &self.settings.kinematics.speed_map;
            let steps = (speed_step(map, rates.0), speed_step(map, rates.1));
            if steps != self.steps {
                changed = true;
                self.steps = steps;
                let query = format!("continuouspantiltmove={},{}", steps.0, steps.1);
                if !self.camera.operate(&query) {
                    return Err(RunError::Aim(query));
                }
            }
        }
        let repeats = self.steps != (0, 0) && self.told.is_none_or(|before| now >= before + REPEAT);
        if !(changed || repeats) {
            return Ok(None);
        }
        self.told = Some(now);
        Ok(Some(self.state()))
    }

    fn rates(&mut self, now: Duration) -> (f64, f64) {
        if let Some((begin, end, rate)) = self.round {
            return if (begin..end).contains(&now) { (rate, 0.0) } else { (0.0, 0.0) };
        }
        let then = now + self.settings.kinematics.command_delay + HORIZON;
        let pose = self.camera.pose_at(now);
        let people = self.camera.ground_truth_from(&pose, then, SMALL);
        let target = self.experiment.scene.split(people).0.and_then(|person| person.direction_deg);
        target.map_or((0.0, 0.0), |target| self.steering.rates(&pose, target))
    }

    fn state(&self) -> CameraState {
        let now = self.camera.now();
        let (pose, map) = (self.camera.pose_at(now), &self.settings.kinematics.speed_map);
        let horizontal = self.camera.optics().fov_deg(pose.zoom_step);
        let (width, height) = self.experiment.size;
        let tangent = (horizontal / 2.0).to_radians().tan() * f64::from(height) / f64::from(width);
        CameraState {
            moving: self.steps != (0, 0),
            position_deg: (pose.pan_deg, pose.tilt_deg),
            rate_deg_s: (map.deg_s(self.steps.0.into()), map.deg_s(self.steps.1.into())),
            fov_deg: (horizontal, 2.0 * tangent.atan().to_degrees()),
        }
    }
}

/// Where somebody is shows in small pictures too.
const SMALL: (u32, u32) = (160, 120);
