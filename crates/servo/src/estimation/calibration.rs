// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::Vector;

use super::{FieldOfViewEstimator, LatencyEstimator, Maps, Measurement, SpeedMapEstimator, Visibility};
use crate::Time;
use crate::model::{CommandHistory, Delays, PanTilt, SpeedMap, View};

/// How the camera turned between two pictures, as the background shows it, or the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedRotation {
    /// The earlier picture's time.
    pub from: Time,
    /// The later picture's.
    pub to: Time,
    /// Degrees per second.
    pub rate: PanTilt,
}

impl ObservedRotation {
    /// Pictures further apart than this show no turn.
    const LONGEST: Duration = Duration::from_millis(500);

    /// The turn that a picture, after the one before, shows by what moves in it like this against the camera.
    fn of(velocity: Vector, measurement: &Measurement, view: &View, before: Time) -> Option<Self> {
        let lasted = measurement.taken_at - before;
        let fits = !lasted.is_zero() && lasted <= Self::LONGEST;
        let rate = view.rate(measurement.centroid, velocity) * -1.0;
        (fits && rate.is_finite()).then_some(Self { from: before, to: measurement.taken_at, rate })
    }

    /// How long it took.
    pub fn seconds(&self) -> f64 {
        (self.to - self.from).as_secs_f64()
    }
}

/// The camera as it was learned, or is taken for where there was nothing to learn by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimates {
    /// How late commands and pictures are.
    pub delays: Delays,
    /// Horizontal field of view in degrees.
    pub fov_deg: f64,
    /// Degrees per second of the speeds that were told.
    pub map: SpeedMap,
}

/// The camera's speed map, field of view and latency, as they turn out to be.
#[derive(Debug)]
pub struct SelfCalibration {
    latency: LatencyEstimator,
    field: FieldOfViewEstimator,
    speeds: SpeedMapEstimator,
    /// The last picture's time.
    before: Option<Time>,
}

impl SelfCalibration {
    /// Knows nothing but what is assumed.
    pub fn new(latency: Duration) -> Self {
        Self {
            latency: LatencyEstimator::new(latency),
            field: FieldOfViewEstimator::default(),
            speeds: SpeedMapEstimator::new(false),
            before: None,
        }
    }

    /// Something else is assumed of the latency: what was learned of it is void.
    pub fn assume_latency(&mut self, latency: Duration) {
        if latency != self.latency.assumed() {
            self.latency = LatencyEstimator::new(latency);
        }
    }

    /// Something else is assumed of the field of view. The same commands do the same in the picture.
    pub fn assume_field(&mut self) {
        self.field = FieldOfViewEstimator::default();
    }

    /// Another map is assumed. `told`: by the camera itself.
    pub fn assume_speeds(&mut self, told: bool) {
        self.speeds = SpeedMapEstimator::new(told);
    }

    /// How late commands and pictures are.
    pub fn delays(&self) -> Delays {
        self.latency.delays()
    }

    /// What the tangent of half the assumed field of view is to be multiplied by.
    pub fn field_factor(&self) -> f64 {
        self.field.factor()
    }

    /// The assumed map as it really is.
    pub fn correct(&self, assumed: &SpeedMap, fov_deg: f64) -> SpeedMap {
        self.speeds.correct(assumed, fov_deg)
    }

    /// Takes a picture, seen with `view`, and what was commanded, counted by the map that is `believed` by now; `assumed`
    /// was the one before anything was learned. Returns the turn, where the background shows one.
    pub fn see(
        &mut self,
        measurement: &Measurement,
        view: &View,
        history: &CommandHistory,
        [assumed, believed]: [&SpeedMap; 2],
    ) -> Option<ObservedRotation> {
        let before = self.before.replace(measurement.taken_at);
        if measurement.visibility != Visibility::Seen {
            return None;
        }
        // Where the background is not seen, the target tells at least when the camera begins to turn.
        let shown = measurement.ego_velocity.unwrap_or(measurement.velocity);
        let turn = before.and_then(|before| ObservedRotation::of(shown, measurement, view, before))?;
        let fov_deg = view.horizontal_fov_deg;
        self.latency.see(&turn, history, fov_deg);
        measurement.ego_velocity?;
        let delays = self.delays();
        let wrong = self.speeds.see(&turn, &delays, history, Maps { assumed, believed }, fov_deg);
        self.latency.doubt(wrong);
        let factor = self.field_factor();
        self.field.see(&turn, &delays);
        self.speeds.rescale((self.field_factor() / factor).ln());
        Some(turn)
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        let factor = self.field_factor();
        assert!(factor.is_finite() && factor > 0.0, "a field of view of {factor} times the assumed one");
    }

    /// The camera said where it looks at a time.
    pub fn positioned(&mut self, at: Time, position: PanTilt) {
        self.field.positioned(at, position);
    }

    /// The camera has zoomed: what lies on both sides of that is not comparable.
    pub fn zoomed(&mut self) {
        self.field.interrupted();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::SpeedCurve;
    use proptest::prelude::*;

    const VIEW: View = View { horizontal_fov_deg: 60.0, aspect: 4.0 / 3.0, tilt_deg: 0.0 };

    fn garbage() -> impl Strategy<Value = f64> {
        prop_oneof![-3.0..3.0f64, any::<f64>(), Just(f64::NAN), Just(f64::INFINITY), Just(0.0)]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 1 } else { 48 }))]

        /// Whatever is seen, told and commanded.
        #[test]
        fn no_evidence_leads_out_of_bounds(
            pictures in prop::collection::vec((garbage(), garbage(), -100i8..=100, any::<bool>(), 1u64..700), 1..200),
            linear: bool,
        ) {
            let curve = if linear { SpeedCurve::Linear } else { SpeedCurve::Cubic };
            let assumed = SpeedMap::new(450.0, curve);
            let mut calibration = SelfCalibration::new(Duration::from_millis(200));
            let (mut history, mut map, mut now) = (CommandHistory::default(), assumed, Time::ZERO);
            for (x, y, step, tells, wait) in pictures {
                now += Duration::from_millis(if wait < 500 { 40 } else { wait });
                history.push_parts(now, (f64::from(step) / 100.0, f64::from(step) / -100.0), &map);
                if tells {
                    calibration.positioned(now, PanTilt::new(x * 90.0, y * 90.0));
                }
                let ego_velocity = Some(Vector { x, y }).filter(|_| wait % 7 > 0);
                let seen = Measurement { ego_velocity, velocity: Vector { x: y, y: x }, ..Measurement::at(0.4, 0.6, now) };
                calibration.see(&seen, &VIEW, &history, [&assumed, &map]);
                map = calibration.correct(&assumed, 60.0);
                history.revise(&map);
                prop_assert!(calibration.delays().sum() <= Duration::from_millis(1600), "{:?}", calibration.delays());
                prop_assert!((0.33..=3.01).contains(&calibration.field_factor()));
                for step in [1, 10, 50, 100] {
                    let (known, at_most) = (map.deg_s(step), 501.0 * assumed.deg_s(100));
                    prop_assert!(known >= assumed.deg_s(step) / 501.0 && known <= at_most, "{step}: {known}");
                }
            }
        }
    }
}
