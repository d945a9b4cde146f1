// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::Time;
use crate::model::PanTilt;

/// Notices a loop that oscillates about its target, as one does whose delays or speeds are wrong, and lowers the gain
/// until it is steady.
#[derive(Debug)]
pub struct OscillationGuard {
    pan: HalfCycles,
    tilt: HalfCycles,
    gain_scale: f64,
    changed_at: Time,
}

impl Default for OscillationGuard {
    fn default() -> Self {
        Self {
            pan: HalfCycles::default(),
            tilt: HalfCycles::default(),
            gain_scale: 1.0,
            changed_at: Time::ZERO,
        }
    }
}

impl OscillationGuard {
    /// The gain is scaled by this at each oscillation ...
    const LOWER: f64 = 0.6;

    /// ... down to this part of what was set: slow, but still following.
    const LOWEST: f64 = 0.2;

    /// It is scaled by this, up to what was set, ...
    const RAISE: f64 = 1.2;

    /// ... after each such time without an oscillation.
    const CALM: Duration = Duration::from_secs(30);

    /// Takes the error of a picture, and the target's own rate, where the background tells that; what each axis
    /// is `tolerated_deg` does not count. Returns whether the gain was lowered by this.
    pub fn see(&mut self, error: PanTilt, target: PanTilt, tolerated_deg: PanTilt, at: Time) -> bool {
        let swings = [
            self.pan.see(error.pan, target.pan, tolerated_deg.pan, at),
            self.tilt.see(error.tilt, target.tilt, tolerated_deg.tilt, at),
        ];
        if swings.contains(&true) {
            let before = self.gain_scale;
            self.gain_scale = (before * Self::LOWER).max(Self::LOWEST);
            (self.pan, self.tilt, self.changed_at) = (HalfCycles::default(), HalfCycles::default(), at);
            return self.gain_scale < before;
        }
        if self.gain_scale < 1.0 && at - self.changed_at > Self::CALM {
            self.gain_scale = (self.gain_scale * Self::RAISE).min(1.0);
            self.changed_at = at;
        }
        false
    }

    #[cfg(test)]
    pub fn lowered_to(gain_scale: f64) -> Self {
        Self { gain_scale, ..Self::default() }
    }

    /// What part of the wanted rate is to be commanded, up to 1.
    pub fn gain_scale(&self) -> f64 {
        self.gain_scale
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        let scale = self.gain_scale;
        assert!((Self::LOWEST..=1.0).contains(&scale), "a gain scaled by {scale}");
        for axis in [&self.pan, &self.tilt] {
            assert!(axis.steady < HalfCycles::ENOUGH, "{} half-cycles and no lower gain", axis.steady);
        }
    }

    /// Another target: what was seen so far tells nothing of it.
    pub fn clear(&mut self) {
        (self.pan, self.tilt) = (HalfCycles::default(), HalfCycles::default());
    }
}

/// Half waves of one axis' error, from one crossing to the next.
#[derive(Debug, Default)]
struct HalfCycles {
    /// The farthest of the half wave under way, signed; 0 before the first.
    peak: f64,
    /// The slowest and the fastest that the target went by itself meanwhile.
    pace: (f64, f64),
    since: Time,
    /// The size of the one before, and how many in a row were no smaller.
    last: f64,
    steady: u32,
}

impl HalfCycles {
    /// A half wave that lasts longer is the target's own pacing.
    const LONGEST: Duration = Duration::from_secs(2);

    /// A shorter one is no head's: a target that jumps.
    const SHORTEST: Duration = Duration::from_millis(150);

    /// A half wave counts that has at least this part of the size of the one before: else it dies away by itself.
    const STEADY: f64 = 0.8;

    /// So many half waves in a row are no accident.
    const ENOUGH: u32 = 4;

    fn see(&mut self, error: f64, target: f64, tolerated: f64, at: Time) -> bool {
        self.pace = (self.pace.0.min(target), self.pace.1.max(target));
        if error.abs() <= tolerated {
            return false;
        }
        if error * self.peak >= 0.0 && self.peak != 0.0 {
            self.peak = self.peak.abs().max(error.abs()).copysign(error);
            return false;
        }
        let lasted = at - self.since;
        // A target that went to and fro itself leaves the middle as far as that.
        let by_itself = (self.pace.1 - self.pace.0) * lasted.as_secs_f64() >= self.peak.abs();
        let swings = (Self::SHORTEST..=Self::LONGEST).contains(&lasted) && !by_itself;
        let steady = self.peak.abs() >= Self::STEADY * self.last;
        self.steady = if swings && steady && self.peak != 0.0 { self.steady + 1 } else { 0 };
        (self.last, self.peak, self.since) = (self.peak.abs(), error, at);
        self.pace = (target, target);
        self.steady >= Self::ENOUGH
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// How often the gain is lowered by an error over 20 s.
    fn lowered(guard: &mut OscillationGuard, error: impl Fn(f64) -> f64) -> usize {
        lowered_before(guard, error, |_| 12.0)
    }

    /// The same before a target that goes at a rate by itself.
    fn lowered_before(
        guard: &mut OscillationGuard,
        error: impl Fn(f64) -> f64,
        target: impl Fn(f64) -> f64,
    ) -> usize {
        let mut see = |time: f64| {
            let [error, target] = [error(time), target(time)].map(|pan| PanTilt::new(pan, 0.0));
            guard.see(error, target, PanTilt::new(1.0, 1.0), Duration::from_secs_f64(time).into())
        };
        (0..500).filter(|frame| see(f64::from(*frame) / 25.0)).count()
    }

    #[test]
    fn a_steady_or_growing_swing_lowers_the_gain() {
        let mut guard = OscillationGuard::default();
        assert!(lowered(&mut guard, |t| 5.0 * (4.0 * t).sin()) > 1);
        assert!(guard.gain_scale() < 0.5 && guard.gain_scale() >= OscillationGuard::LOWEST);
        assert!(lowered(&mut OscillationGuard::default(), |t| t * (4.0 * t).sin()) > 0);
    }

    #[test]
    fn a_swing_that_goes_on_at_the_lowest_gain_is_not_reported_again() {
        let mut guard = OscillationGuard::default();
        let times = lowered(&mut guard, |t| 5.0 * (4.0 * t).sin());
        assert_eq!((times, guard.gain_scale()), (4, OscillationGuard::LOWEST), "1, 0.6, 0.36, 0.216");
        assert_eq!(lowered(&mut guard, |t| 5.0 * (4.0 * t).sin()), 0);
    }

    #[test]
    fn a_swing_that_dies_away_and_a_pacing_target_do_not() {
        let mut guard = OscillationGuard::default();
        assert_eq!(lowered(&mut guard, |t| 20.0 * (-0.5 * t).exp() * (4.0 * t).sin()), 0);
        assert_eq!(lowered(&mut guard, |t| 8.0 * (1.2 * t).sin()), 0);
        assert_eq!(lowered(&mut guard, |t| 0.9 * (9.0 * t).sin()), 0);
        assert_eq!(lowered(&mut guard, |t| 9.0 * (35.0 * t).sin()), 0, "jumps");
        assert_eq!(lowered(&mut guard, |t| 5.0 + 3.0 * (4.0 * t).sin()), 0);
        let (error, target) = (|t: f64| 3.0 * (2.0 * t).sin(), |t: f64| 10.0 * (2.0 * t).cos());
        assert_eq!(lowered_before(&mut guard, error, target), 0);
        assert!(lowered(&mut OscillationGuard::default(), error) > 0);
        assert_eq!(guard.gain_scale(), 1.0);
    }

    #[test]
    fn when_it_is_calm_the_gain_comes_back() {
        let mut guard = OscillationGuard::default();
        lowered(&mut guard, |t| 5.0 * (4.0 * t).sin());
        for second in 20..600 {
            assert!(!guard.see(
                PanTilt::default(),
                PanTilt::default(),
                PanTilt::new(1.0, 1.0),
                Time::from_millis(1000 * second)
            ));
        }
        assert_eq!(guard.gain_scale(), 1.0);
    }

    proptest! {
        #[test]
        fn trust_stays_in_range(errors in prop::collection::vec(-90.0..90.0f64, 0..400)) {
            let mut guard = OscillationGuard::default();
            for (frame, error) in (0..).zip(errors) {
                guard.see(PanTilt::new(error, -error), PanTilt::default(), PanTilt::new(0.5, 0.5), Time::from_millis(40 * frame));
                prop_assert!((OscillationGuard::LOWEST..=1.0).contains(&guard.gain_scale()));
            }
        }
    }
}
