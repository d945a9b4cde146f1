use std::time::Duration;

use ptztrack_contract::Vector;

use super::{FieldLearner, LatencyLearner, Maps, SpeedLearner};
use crate::servo::{CommandHistory, PanTilt, Sight, SpeedMap, View, Visibility};

/// How the camera turned between two pictures, as the background shows it, or the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// The earlier picture's time.
    pub from: Duration,
    /// The later picture's.
    pub to: Duration,
    /// Degrees per second.
    pub rate: PanTilt,
}

impl Turn {
    /// Pictures further apart than this show no turn.
    const LONGEST: Duration = Duration::from_millis(500);

    /// The turn that a picture, after the one before, shows by what moves in it like this against the camera.
    fn of(velocity: Vector, sight: &Sight, view: &View, before: Duration) -> Option<Self> {
        let lasted = sight.taken_at.checked_sub(before)?;
        let fits = !lasted.is_zero() && lasted <= Self::LONGEST;
        let rate = view.rate(sight.centroid, velocity) * -1.0;
        let sound = rate.pan.is_finite() && rate.tilt.is_finite();
        (fits && sound).then_some(Self { from: before, to: sight.taken_at, rate })
    }

    /// How long it took.
    pub fn seconds(&self) -> f64 {
        (self.to - self.from).as_secs_f64()
    }
}

/// The camera's speed map, field of view and latency, as they turn out to be.
#[derive(Debug)]
pub struct Calibration {
    latency: LatencyLearner,
    field: FieldLearner,
    speeds: SpeedLearner,
    /// The last picture's time.
    before: Option<Duration>,
}

impl Calibration {
    /// Knows nothing but what is assumed.
    pub fn new(latency: Duration) -> Self {
        Self {
            latency: LatencyLearner::new(latency),
            field: FieldLearner::default(),
            speeds: SpeedLearner::new(false),
            before: None,
        }
    }

    /// Something else is assumed of the latency: what was learned of it is void.
    pub fn assume_latency(&mut self, latency: Duration) {
        if latency != self.latency.assumed() {
            self.latency = LatencyLearner::new(latency);
        }
    }

    /// Something else is assumed of the field of view. The same commands do the same in the picture.
    pub fn assume_field(&mut self) {
        self.field = FieldLearner::default();
    }

    /// Another map is assumed. `told`: by the camera itself.
    pub fn assume_speeds(&mut self, told: bool) {
        self.speeds = SpeedLearner::new(told);
    }

    /// From sending a command to the timestamp of the first picture that shows it.
    pub fn latency(&self) -> Duration {
        self.latency.latency()
    }

    /// By how much that may be wrong.
    pub fn latency_uncertainty(&self) -> Duration {
        self.latency.uncertainty()
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
    /// was the one before anything was learned.
    pub fn see(
        &mut self,
        sight: &Sight,
        view: &View,
        history: &CommandHistory,
        [assumed, believed]: [&SpeedMap; 2],
    ) {
        let before = self.before.replace(sight.taken_at);
        if sight.visibility != Visibility::Seen {
            return;
        }
        // Where the background is not seen, the target tells at least when the camera begins to turn.
        let shown = sight.ego_velocity.unwrap_or(sight.velocity);
        let Some(turn) = before.and_then(|before| Turn::of(shown, sight, view, before)) else { return };
        let fov_deg = view.horizontal_fov_deg;
        self.latency.see(&turn, history, fov_deg);
        if sight.ego_velocity.is_none() {
            return;
        }
        let latency = self.latency();
        let wrong = self.speeds.see(&turn, latency, history, Maps { assumed, believed }, fov_deg);
        self.latency.doubt(wrong);
        let factor = self.field_factor();
        self.field.see(&turn, latency);
        self.speeds.rescale((self.field_factor() / factor).ln());
    }

    /// The camera said where it looks at a time.
    pub fn positioned(&mut self, at: Duration, position: PanTilt) {
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
    use crate::servo::SpeedCurve;
    use crate::servo::sight;
    use proptest::prelude::*;

    const VIEW: View = View { horizontal_fov_deg: 60.0, aspect: 4.0 / 3.0, tilt_deg: 0.0 };

    fn garbage() -> impl Strategy<Value = f64> {
        prop_oneof![-3.0..3.0f64, any::<f64>(), Just(f64::NAN), Just(f64::INFINITY), Just(0.0)]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Whatever is seen, told and commanded.
        #[test]
        fn no_evidence_leads_out_of_bounds(
            pictures in prop::collection::vec((garbage(), garbage(), -100i8..=100, any::<bool>(), 1u64..700), 1..200),
            linear: bool,
        ) {
            let curve = if linear { SpeedCurve::Linear } else { SpeedCurve::Cubic };
            let assumed = SpeedMap::new(450.0, curve);
            let mut calibration = Calibration::new(Duration::from_millis(200));
            let (mut history, mut map, mut now) = (CommandHistory::default(), assumed, Duration::ZERO);
            for (x, y, step, tells, wait) in pictures {
                now += Duration::from_millis(if wait < 500 { 40 } else { wait });
                history.push_steps(now, (step, -step), &map);
                if tells {
                    calibration.positioned(now, PanTilt::new(x * 90.0, y * 90.0));
                }
                let ego_velocity = Some(Vector { x, y }).filter(|_| wait % 7 > 0);
                let seen = Sight { ego_velocity, velocity: Vector { x: y, y: x }, ..sight(0.4, 0.6, now) };
                calibration.see(&seen, &VIEW, &history, [&assumed, &map]);
                map = calibration.correct(&assumed, 60.0);
                history.revise(&map);
                prop_assert!(calibration.latency() <= Duration::from_millis(1600), "{:?}", calibration.latency());
                prop_assert!((0.33..=3.01).contains(&calibration.field_factor()));
                for step in [1, 10, 50, 100] {
                    let (known, at_most) = (map.deg_s(step), 501.0 * assumed.deg_s(100));
                    prop_assert!(known >= assumed.deg_s(step) / 501.0 && known <= at_most, "{step}: {known}");
                }
            }
        }
    }
}
