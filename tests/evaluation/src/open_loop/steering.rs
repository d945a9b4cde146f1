// SPDX-License-Identifier: MPL-2.0

//! How a camera is steered by the truth as if by us: where it aims is off by an error with a memory, and it gets there as fast as
//! its motors let it.
//!
//! The error is autoregressive of the first order, AR(1), for pan and tilt each. Its size and memory are those that the pointing
//! error had in closed loop, see [`pointing_error`] and `docs/scenes.md`.

use std::time::Duration;

use virtual_camera::{Pose, Seeded, SpeedMap};

use crate::{
    metrics,
    record::{FrameRecord, Run},
};

/// From one command to the next.
pub(super) const EVERY: Duration = Duration::from_millis(100);
/// The camera is to be where it aims after so long.
pub(super) const HORIZON: Duration = Duration::from_millis(300);
/// Standard deviation of the error, of pan and of tilt, degrees.
const SIZE_DEG: (f64, f64) = (0.85, 1.0);
/// Time after which e⁻¹ of an error is left.
const MEMORY: Duration = Duration::from_millis(1300);
/// Slower than this the camera stands still, degrees per second.
const SLOWEST_DEG_S: f64 = 0.5;

/// What steers.
#[derive(Debug, Clone)]
pub(super) struct Steering {
    chance: Seeded,
    error_deg: (f64, f64),
}

impl Steering {
    pub fn new(mut chance: Seeded) -> Self {
        let error_deg = (SIZE_DEG.0 * chance.normal(), SIZE_DEG.1 * chance.normal());
        Self { chance, error_deg }
    }

    /// Pan and tilt in degrees per second at which a camera that looks along `pose` gets near the `target` (pan and tilt in degrees)
    /// within [`HORIZON`]; to be asked for every [`EVERY`].
    pub fn rates(&mut self, pose: &Pose, target: (f64, f64)) -> (f64, f64) {
        let kept = (-EVERY.as_secs_f64() / MEMORY.as_secs_f64()).exp();
        let fresh = (1.0 - kept * kept).sqrt();
        let mut next = |error: f64, size: f64| kept * error + fresh * size * self.chance.normal();
        self.error_deg = (next(self.error_deg.0, SIZE_DEG.0), next(self.error_deg.1, SIZE_DEG.1));
        let rate = |target: f64, error: f64, now: f64| {
            let rate = (target + error - now) / HORIZON.as_secs_f64();
            if rate.abs() < SLOWEST_DEG_S { 0.0 } else { rate }
        };
        (rate(target.0, self.error_deg.0, pose.pan_deg), rate(target.1, self.error_deg.1, pose.tilt_deg))
    }
}

/// The whole speed step whose speed is nearest to `rate_deg_s`.
pub(super) fn speed_step(map: &SpeedMap, rate_deg_s: f64) -> i32 {
    let off = |step: &i32| (map.deg_s(f64::from(*step)) - rate_deg_s).abs();
    (-100..=100).min_by(|one, other| off(one).total_cmp(&off(other))).unwrap_or(0)
}

/// How far the middle of the picture is from the person while they are followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointingError {
    /// Root mean square, pan and tilt, degrees.
    pub size_deg: (f64, f64),
    /// Time after which e⁻¹ of it is left, by its correlation over 0.2 s, seconds.
    pub memory_s: (f64, f64),
}

/// The time over which correlation is measured, seconds.
const LAG_S: f64 = 0.2;
/// The person is followed from when d_gc first was less than this: what is before belongs to getting them into the middle.
const REACHED_DGC: f64 = 0.1;

/// Of all `runs` together; `None` where the person was never followed for long enough.
pub fn pointing_error<'a>(runs: impl IntoIterator<Item = &'a Run>) -> Option<PointingError> {
    let mut sums = [Correlation::default(); 2];
    for run in runs {
        let is_reached =
            |frame: &FrameRecord| metrics::d_gc(frame).is_some_and(|distance| distance < REACHED_DGC);
        let reached = run.frames.iter().skip_while(|frame| !is_reached(frame));
        let errors: Vec<Option<[f64; 2]>> = reached
            .map(|frame| {
                let (pan, tilt) = frame.truth.as_ref().filter(|_| metrics::holds(frame))?.direction_deg?;
                Some([pan - frame.pan_deg, tilt - frame.tilt_deg])
            })
            .collect();
        let lag = (LAG_S * run.frame_rate).round().max(1.0) as usize;
        for (before, after) in errors.iter().zip(errors.iter().skip(lag)) {
            let Some((before, after)) = before.zip(*after) else { continue };
            (0..2).for_each(|axis| sums[axis].add(before[axis], after[axis]));
        }
    }
    let [pan, tilt] = sums;
    let size_deg = (pan.size()?, tilt.size()?);
    Some(PointingError { size_deg, memory_s: (pan.memory_s()?, tilt.memory_s()?) })
}

/// Sums of squares and of products of what is a lag apart.
#[derive(Clone, Copy, Default)]
struct Correlation {
    count: f64,
    squares: f64,
    products: f64,
}

impl Correlation {
    fn add(&mut self, before: f64, after: f64) {
        self.count += 1.0;
        self.squares += (before * before + after * after) / 2.0;
        self.products += before * after;
    }

    fn size(&self) -> Option<f64> {
        (self.count > 0.0).then(|| (self.squares / self.count).sqrt())
    }

    fn memory_s(&self) -> Option<f64> {
        let correlation = self.products / self.squares;
        (0.0..1.0).contains(&correlation).then(|| -LAG_S / correlation.ln())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::made_up;

    #[test]
    fn the_aim_is_off_by_an_error_of_that_size_and_memory() {
        let mut steering = Steering::new(Seeded::new(5));
        let (mut square, mut product, mut before) = (0.0, 0.0, steering.error_deg.0);
        for _ in 0..50_000 {
            steering.rates(&Pose::default(), (0.0, 0.0));
            square += steering.error_deg.0.powi(2);
            product += steering.error_deg.0 * before;
            before = steering.error_deg.0;
        }
        assert!(((square / 5e4).sqrt() - SIZE_DEG.0).abs() < 0.1 * SIZE_DEG.0);
        let memory_s = -EVERY.as_secs_f64() / (product / square).ln();
        assert!((memory_s - MEMORY.as_secs_f64()).abs() < 0.1, "{memory_s}");
    }

    #[test]
    fn a_camera_that_is_off_turns_towards_the_target() {
        let mut steering = Steering::new(Seeded::new(5));
        let (pan, tilt) = steering.rates(&Pose::default(), (30.0, -20.0));
        assert!(pan > 60.0 && tilt < -40.0, "{pan} {tilt}");
        let map = SpeedMap::Linear { max_deg_s: 100.0 };
        assert_eq!([-12.4, 0.2, 300.0].map(|rate| speed_step(&map, rate)), [-12, 0, 100]);
    }

    #[test]
    fn the_pointing_error_of_a_run_is_measured() {
        // A walk of AR(1) whose memory is 0.5 s, at ten pictures a second.
        let (mut chance, mut error, kept) = (Seeded::new(9), 0.0, (-0.1f64 / 0.5).exp());
        let frames = (0..20_000).map(|number| {
            error = kept * error + (1.0 - kept * kept).sqrt() * 2.0 * chance.normal();
            let mut frame = made_up::tracked((80, 60));
            frame.time_s = f64::from(number) * 0.1;
            if let Some(truth) = &mut frame.truth {
                truth.direction_deg = Some((error, 0.5 * error));
            }
            frame
        });
        let run = made_up::run(frames.collect());
        let found = pointing_error([&run]).unwrap();
        assert!((found.size_deg.0 - 2.0).abs() < 0.1 && (found.size_deg.1 - 1.0).abs() < 0.05, "{found:?}");
        assert!((found.memory_s.0 - 0.5).abs() < 0.05, "{found:?}");
        assert_eq!(pointing_error([&made_up::run(Vec::new())]), None);
    }
}
