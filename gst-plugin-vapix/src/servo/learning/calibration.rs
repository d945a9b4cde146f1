use std::time::Duration;

use ptztrack_contract::Vector;

use super::{FieldLearner, LatencyLearner, SpeedLearner};
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
    pub fn latency_doubt(&self) -> Duration {
        self.latency.doubt()
    }

    /// What the tangent of half the assumed field of view is to be multiplied by.
    pub fn field_factor(&self) -> f64 {
        self.field.factor()
    }

    /// The assumed map as it really is.
    pub fn correct(&self, assumed: &SpeedMap, fov_deg: f64) -> SpeedMap {
        self.speeds.correct(assumed, fov_deg)
    }

    /// Takes a picture, seen with `view`, and what was commanded, counted by `map`.
    pub fn see(&mut self, sight: &Sight, view: &View, history: &CommandHistory, map: &SpeedMap) {
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
        self.speeds.see(&turn, latency, history, map, fov_deg);
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
