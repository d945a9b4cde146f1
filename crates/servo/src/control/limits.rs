// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::Time;
use crate::model::{
    CommandHistory, HardLimits, PanTilt, Range, SoftLimits, around_deg, is_endless, narrower,
};

/// Keeps the camera from being driven against its ends, and knows when it has got there.
#[derive(Debug, Default)]
pub struct LimitEnforcer {
    at_limit: bool,
    told: Option<(Time, PanTilt)>,
}

impl LimitEnforcer {
    /// This near to its end an axis counts as there.
    const NEAR_DEG: f64 = 0.1;

    /// Having been there, it has left by this; before, it only finds that it was not quite there.
    const LEFT_DEG: f64 = 3.0;

    /// The camera told where it looks.
    pub fn told(&mut self, at: Time, position: PanTilt) {
        self.told = Some((at, position));
    }

    /// Where everything commanded so far takes the camera, where that is known. `delay`: of commands.
    pub fn position(&self, history: &CommandHistory, delay: Duration, now: Time) -> Option<PanTilt> {
        let (at, position) = self.told.filter(|(at, _)| now <= *at + CommandHistory::SPAN)?;
        Some(position + history.rotation(at - delay, now))
    }

    /// `rate` without the part that would take an axis from `position` beyond its end in the next `lasting` seconds.
    pub fn apply(
        &mut self,
        rate: PanTilt,
        position: Option<PanTilt>,
        (hard, soft): (&HardLimits, &SoftLimits),
        lasting_s: f64,
    ) -> PanTilt {
        let Some(position) = position else {
            self.at_limit = false;
            return rate;
        };
        let pan = Some(narrower(hard.pan_deg, soft.pan_deg)).filter(|range| !is_endless(*range));
        let tilt = Some(narrower(hard.tilt_deg, soft.tilt_deg));
        // Without ends of its own the camera gets to a place either way round: by the angle nearest to the range.
        let ends = hard.pan_deg.is_some_and(|range| !is_endless(range));
        let pan_deg = match pan {
            Some(range) if !ends => around_deg((range.min + range.max) / 2.0, position.pan),
            _ => position.pan,
        };
        let near_deg = if self.at_limit { Self::LEFT_DEG } else { Self::NEAR_DEG };
        let (pan, pan_held) = held(rate.pan, pan_deg, pan, lasting_s, near_deg);
        let (tilt, tilt_held) = held(rate.tilt, position.tilt, tilt, lasting_s, near_deg);
        self.at_limit = pan_held || tilt_held;
        PanTilt::new(pan, tilt)
    }

    /// Whether the last rate was held back at an end.
    pub fn at_limit(&self) -> bool {
        self.at_limit
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        if let Some((_, position)) = self.told {
            assert!(position.is_finite(), "a position of {}, {} degrees", position.pan, position.tilt);
        }
        assert!(!self.at_limit || self.told.is_some(), "at a limit, and nobody knows where");
    }
}

/// The rate that is left of one that drives outwards near an end, and whether the end is reached, by `near_deg`.
fn held(rate: f64, position: f64, limits: Option<Range>, lasting_s: f64, near_deg: f64) -> (f64, bool) {
    let Some(limits) = limits else { return (rate, false) };
    let room = if rate > 0.0 { limits.max - position } else { position - limits.min };
    let left = if room <= LimitEnforcer::NEAR_DEG { 0.0 } else { rate.abs().min(room / lasting_s) };
    (left.copysign(rate), rate != 0.0 && room <= near_deg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits(pan: Option<(f64, f64)>) -> HardLimits {
        HardLimits { pan_deg: pan.map(|(min, max)| Range { min, max }), ..HardLimits::default() }
    }

    fn apply(rate: f64, pan: f64, limits: &HardLimits, soft: &SoftLimits) -> (f64, bool) {
        let mut guard = LimitEnforcer::default();
        let rate = guard.apply(PanTilt::new(rate, 3.0), Some(PanTilt::new(pan, 0.0)), (limits, soft), 0.5);
        assert_eq!(rate.tilt, 3.0);
        (rate.pan, guard.at_limit())
    }

    #[test]
    fn at_its_end_an_axis_only_moves_back() {
        let (hard, soft) = (limits(Some((-170.0, 170.0))), SoftLimits::default());
        assert_eq!(apply(10.0, 169.95, &hard, &soft), (0.0, true));
        assert_eq!(apply(-10.0, 169.95, &hard, &soft), (-10.0, false));
        assert_eq!(apply(10.0, 168.0, &hard, &soft), (4.0, false));
        assert_eq!(apply(0.0, 175.0, &hard, &soft), (0.0, false));
    }

    #[test]
    fn endless_pan_has_no_end_but_where_one_is_set() {
        let endless = limits(Some((-180.0, 180.0)));
        let soft = SoftLimits { pan_deg: Range { min: -30.0, max: 40.0 }, ..SoftLimits::default() };
        assert_eq!(apply(10.0, 180.0, &endless, &SoftLimits::default()), (10.0, false));
        assert_eq!(apply(10.0, 180.0, &limits(None), &SoftLimits::default()), (10.0, false));
        assert_eq!(apply(10.0, 40.0, &endless, &soft), (0.0, true));
        assert_eq!(apply(-10.0, 60.0, &endless, &soft), (-10.0, false), "back in");
        assert_eq!(apply(10.0, 40.0, &limits(None), &soft), (0.0, true));
    }

    #[test]
    fn between_answers_the_commands_tell_where_it_is() {
        let (mut guard, mut history) = (LimitEnforcer::default(), CommandHistory::default());
        let ms = Time::from_millis;
        assert_eq!(guard.position(&history, Duration::from_millis(100), ms(0)), None);
        guard.told(ms(1000), PanTilt::new(5.0, 0.0));
        history.push(ms(800), PanTilt::new(10.0, 0.0));
        assert_eq!(
            guard.position(&history, Duration::from_millis(100), ms(1400)),
            Some(PanTilt::new(10.0, 0.0))
        );
        assert_eq!(
            guard.position(&history, Duration::from_millis(100), ms(60_000)),
            None,
            "nobody knows what it was told since"
        );
    }

    /// A little beyond 180 degrees a camera tells a little more than -180.
    #[test]
    fn a_limit_at_the_seam_is_one_from_both_sides() {
        let soft = SoftLimits { pan_deg: Range { min: -60.0, max: 180.0 }, ..SoftLimits::default() };
        for pan in [180.0, -180.0, -179.8] {
            assert_eq!(apply(10.0, pan, &limits(None), &soft), (0.0, true), "{pan}");
            assert_eq!(apply(-10.0, pan, &limits(None), &soft), (-10.0, false), "{pan}: back in");
        }
        assert_eq!(apply(-10.0, -60.0, &limits(None), &soft), (0.0, true));
    }

    #[test]
    fn a_camera_with_ends_comes_back_the_way_it_went() {
        let soft = SoftLimits { pan_deg: Range { min: -60.0, max: 180.0 }, ..SoftLimits::default() };
        let hard = limits(Some((-170.0, 170.0)));
        assert_eq!(apply(10.0, -130.0, &hard, &soft), (10.0, false));
        assert_eq!(apply(-10.0, -130.0, &hard, &soft), (0.0, true));
    }

    #[test]
    fn the_nearest_direction_is_within() {
        let soft = SoftLimits {
            pan_deg: Range { min: -60.0, max: 180.0 },
            tilt_deg: Range { min: -30.0, max: 10.0 },
            ..SoftLimits::default()
        };
        for ((pan, tilt), expected) in
            [((100.0, 0.0), (100.0, 0.0)), ((-179.0, -80.0), (180.0, -30.0)), ((-80.0, 20.0), (-60.0, 10.0))]
        {
            let (pan_within, tilt_within) = expected;
            assert_eq!(soft.nearest(PanTilt::new(pan, tilt)), PanTilt::new(pan_within, tilt_within));
        }
        assert!(soft.bound_turns() && !SoftLimits::default().bound_turns());
        assert_eq!(SoftLimits::default().nearest(PanTilt::new(-180.0, 5.0)), PanTilt::new(180.0, 5.0));
    }

    #[test]
    fn an_end_that_was_a_little_farther_is_the_same_end() {
        let (hard, soft, mut guard) =
            (limits(Some((-170.0, 170.0))), SoftLimits::default(), LimitEnforcer::default());
        let mut at_limit = |rate: f64, pan: f64| {
            guard.apply(PanTilt::new(rate, 0.0), Some(PanTilt::new(pan, 0.0)), (&hard, &soft), 0.5);
            guard.at_limit()
        };
        assert!(!at_limit(10.0, 169.0) && at_limit(10.0, 169.95) && at_limit(10.0, 169.0));
        assert!(!at_limit(-10.0, 169.0) && !at_limit(10.0, 169.0));
    }

    proptest! {
        /// Between the ends that the camera told and those that are set, whatever it is told meanwhile.
        #[test]
        fn what_is_held_back_leads_to_no_end(
            steps in prop::collection::vec((-200.0..200.0f64, -185.0..185.0f64, any::<bool>(), 1u64..30_000), 1..60),
        ) {
            let (mut limits_enforcer, mut history) = (LimitEnforcer::default(), CommandHistory::default());
            let (hard, soft) = (limits(Some((-170.0, 170.0))), SoftLimits::default());
            let (delay, mut now) = (Duration::from_millis(100), Time::ZERO);
            for (rate, pan, tells, wait) in steps {
                now += Duration::from_millis(wait);
                if tells {
                    limits_enforcer.told(now, PanTilt::new(pan, 0.0));
                }
                let position = limits_enforcer.position(&history, delay, now);
                let held = limits_enforcer.apply(PanTilt::new(rate, 0.0), position, (&hard, &soft), 0.5);
                limits_enforcer.check_invariants();
                prop_assert!(held.pan * rate >= 0.0 && held.pan.abs() <= rate.abs());
                prop_assert!(position.is_some() || !limits_enforcer.at_limit());
                history.push(now, held);
            }
        }

        #[test]
        fn no_rate_leads_out(rate in -200.0..200.0f64, pan in -170.0..170.0f64) {
            let (held, _) = apply(rate, pan, &limits(Some((-170.0, 170.0))), &SoftLimits::default());
            prop_assert!((-170.0..=170.0).contains(&(pan + 0.5 * held)) && held * rate >= 0.0);
        }
    }

    #[test]
    fn tilt_has_its_own_ends() {
        let hard = HardLimits { tilt_deg: Some(Range { min: -90.0, max: 20.0 }), ..HardLimits::default() };
        let soft = SoftLimits { tilt_deg: Range { min: -30.0, max: 10.0 }, ..SoftLimits::default() };
        let apply = |rate: f64, tilt: f64, soft: &SoftLimits| {
            let mut guard = LimitEnforcer::default();
            let position = Some(PanTilt::new(0.0, tilt));
            let rate = guard.apply(PanTilt::new(3.0, rate), position, (&hard, soft), 0.5);
            assert_eq!(rate.pan, 3.0);
            (rate.tilt, guard.at_limit())
        };
        let none = SoftLimits::default();
        assert_eq!((apply(10.0, 20.0, &none), apply(-10.0, 20.0, &none)), ((0.0, true), (-10.0, false)));
        assert_eq!((apply(-10.0, -90.0, &none), apply(10.0, -90.0, &none)), ((0.0, true), (10.0, false)));
        assert_eq!((apply(10.0, 8.0, &soft), apply(10.0, 10.0, &soft)), ((4.0, false), (0.0, true)));
        assert_eq!((apply(-10.0, -28.0, &soft), apply(-10.0, -30.0, &soft)), ((-4.0, false), (0.0, true)));
        assert_eq!((apply(-10.0, 15.0, &soft), apply(10.0, -50.0, &soft)), ((-10.0, false), (10.0, false)));
    }
}
