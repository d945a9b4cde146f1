use std::time::Duration;

use super::{Regression, Turn};
use crate::servo::{CommandHistory, SpeedMap};

/// Learns how fast the speed steps really are, as a factor on the map that was assumed.
///
/// Its logarithm is the sum of an offset (the camera is faster as a whole), a slope over the logarithm of
/// the step (another exponent: a linear camera taken for a cubic one), a slope over the logarithm of the
/// field of view (proportional speed that shrinks all speeds as the view narrows), and a small
/// correction at each of a few steps, straight in between (any other curve).
#[derive(Debug)]
pub(super) struct SpeedLearner {
    regression: Regression<FEATURES>,
    /// The latency by which the newest was measured.
    latency: Option<Duration>,
}

const OFFSET: usize = 0;
const SLOPE: usize = 1;
const ZOOM: usize = 2;
const FIRST_KNOT: usize = 3;
const KNOTS: usize = 9;
const FEATURES: usize = FIRST_KNOT + KNOTS;

/// The step around which the slope turns: slow, as most of following is.
const MIDDLE_STEP: f64 = 20.0;

/// The field of view at which the slope over it does nothing, degrees.
const MIDDLE_FOV_DEG: f64 = 55.0;

/// No speed is taken to be further than this factor from the assumed one.
const LARGEST_FACTOR: f64 = 50.0;

/// Part of the prior's variance that is forgotten in a second.
const FORGOTTEN_PER_S: f64 = 2e-4;

/// Variance of one logarithm measured. Larger than the picture's noise, as one picture is much like the next.
const VARIANCE: f64 = 0.04;

/// What a resting background seems to move in a second, in fields of view.
const NOISE_FIELDS_S: f64 = 0.01;

/// A camera that was told to turn so many times as fast and seems to stand is slower than it is taken for ...
const STRONG: f64 = 8.0;

/// ... if it stands for about a second: before that it may be late.
const STANDING_VARIANCE: f64 = 20.0;

/// What was measured by a latency that proves so far off ...
const ANOTHER_LATENCY: Duration = Duration::from_millis(50);

/// ... is forgotten by this part of the prior's variance.
const DOUBTED: f64 = 0.2;

/// Rates that differ by more than this factor within the time that a picture may show teach nothing.
const STEADY: f64 = 2.0;

/// The camera needs some time to reach a speed; and the latency is not known to the millisecond.
const SETTLING: Duration = Duration::from_millis(240);
const EARLY: Duration = Duration::from_millis(80);

impl SpeedLearner {
    /// Knows nothing but the assumed map. `told`: that is the camera's own, and needs little correction.
    pub fn new(told: bool) -> Self {
        let mut deviations = [if told { 0.1 } else { 0.25 }; FEATURES];
        deviations[OFFSET] = if told { 0.1 } else { 1.5 };
        // Linear for cubic is off by two: with less, that would be taken for an oddity at each step met so far.
        deviations[SLOPE] = if told { 0.1 } else { 2.0 };
        deviations[ZOOM] = if told { 0.1 } else { 0.5 };
        Self { regression: Regression::new(deviations), latency: None }
    }

    /// The map with what was learned.
    pub fn correct(&self, assumed: &SpeedMap, fov_deg: f64) -> SpeedMap {
        assumed.times(|step| {
            let logarithm = self.regression.predict(&features(step, fov_deg));
            logarithm.clamp(-LARGEST_FACTOR.ln(), LARGEST_FACTOR.ln()).exp()
        })
    }

    /// Takes a turn that was seen. `map`: as it is believed now; `fov_deg`: that the turn was measured with.
    pub fn see(
        &mut self,
        turn: &Turn,
        latency: Duration,
        history: &CommandHistory,
        map: &SpeedMap,
        fov_deg: f64,
    ) {
        let (from, to) = (turn.from.saturating_sub(latency), turn.to.saturating_sub(latency));
        let commanded = history.rotation(from, to) / turn.seconds();
        if self.latency.get_or_insert(latency).abs_diff(latency) > ANOTHER_LATENCY {
            self.latency = Some(latency);
            self.regression.forget(DOUBTED);
        }
        let window = || history.rates_between(from.saturating_sub(SETTLING), to + EARLY);
        self.regression.forget(FORGOTTEN_PER_S * turn.seconds());
        for (seen, commanded, rates) in [
            (turn.rate.pan, commanded.pan, extremes(window().map(|rate| rate.pan))),
            (turn.rate.tilt, commanded.tilt, extremes(window().map(|rate| rate.tilt))),
        ] {
            self.see_axis(seen, commanded, rates, map, fov_deg);
        }
    }

    fn see_axis(&mut self, seen: f64, commanded: f64, (low, high): (f64, f64), map: &SpeedMap, fov_deg: f64) {
        let spread = high / low;
        let noise = NOISE_FIELDS_S * fov_deg;
        let ratio = if low > 0.0 { spread } else { 1.0 / spread };
        // What is bounded by proportional speed tells nothing of the map.
        if low * high <= 0.0 || ratio > STEADY || map.is_capped(commanded) {
            return;
        }
        let stands = seen.abs() <= 2.0 * noise;
        let (seen, doubt) = match stands {
            // Far slower than it is taken for, or only late.
            true if commanded.abs() > STRONG * noise => (noise.copysign(commanded), STANDING_VARIANCE),
            true => return,
            false => (seen, (noise / seen).powi(2)),
        };
        // A camera that moves to the other side obeys somebody or something else.
        if seen * commanded <= 0.0 {
            return;
        }
        let variance = VARIANCE + ratio.ln().powi(2) + doubt;
        let mut features = features(map.ideal_step(commanded), fov_deg);
        if stands {
            // How much slower is not told: nothing of this step in particular, nor of the curve.
            features[OFFSET + 1..].fill(0.0);
        }
        let known = self.regression.predict(&features);
        self.regression.update(&features, known + (seen / commanded).ln(), variance);
    }

    /// Degrees have become another measure, by a factor of this logarithm.
    pub fn rescale(&mut self, logarithm: f64) {
        self.regression.shift(OFFSET, logarithm);
    }
}

fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

fn features(step: f64, fov_deg: f64) -> [f64; FEATURES] {
    let logarithm = step.max(1.0).ln();
    let mut features = [0.0; FEATURES];
    features[OFFSET] = 1.0;
    features[SLOPE] = logarithm - MIDDLE_STEP.ln();
    features[ZOOM] = (fov_deg / MIDDLE_FOV_DEG).ln();
    // Knots in equal ratios from step 1 to 100.
    let place = logarithm / 100f64.ln() * (KNOTS - 1) as f64;
    for (knot, feature) in features[FIRST_KNOT..].iter_mut().enumerate() {
        *feature = (1.0 - (place - knot as f64).abs()).max(0.0);
    }
    features
}
