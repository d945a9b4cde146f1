// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::time::Duration;

use super::{ObservedRotation, RecursiveLeastSquares};
use crate::Time;
use crate::model::{CommandHistory, Delays, PanTilt, SpeedMap};

/// Learns how fast the camera really is, as a factor on the map that was assumed: on its bare curve, as the kink
/// of a floor that another curve has not is no straight line between any two levels.
///
/// Found by [`RecursiveLeastSquares`] with forgetting on 12 regressors. Its logarithm is the sum of an offset (the camera is
/// faster as a whole), a slope over the logarithm of the level (another exponent: a linear camera taken for a cubic one), a
/// slope over the logarithm of the field of view (proportional speed that shrinks all speeds as the view narrows), and a
/// small correction at each of a few levels, straight in between (any other curve).
///
/// Less does not suffice where field of view, latency and curve are wrong at once (test
/// `everything_wrong_at_once_is_put_right_within_20_s`): with gain and exponent alone the target is lost, with a correction that
/// only grows (increments from level to level, none below zero) a latency of 200 ms is taken for 709 ms, or for 309 ms with three
/// increments instead of eight.
#[derive(Debug)]
pub(super) struct SpeedMapEstimator {
    regression: RecursiveLeastSquares<FEATURES>,
    /// The turns of the last moments.
    recent: VecDeque<ObservedRotation>,
    /// By how much, as a logarithm, what was known was corrected since that was asked.
    proved_wrong: f64,
    /// The latency by which the newest was measured.
    latency: Option<Duration>,
}

const OFFSET: usize = 0;
const SLOPE: usize = 1;
const ZOOM: usize = 2;
const FIRST_KNOT: usize = 3;
const KNOTS: usize = 9;
const FEATURES: usize = FIRST_KNOT + KNOTS;

/// The level around which the slope turns: slow, as most of following is.
const MIDDLE_LEVEL: f64 = 20.0;

/// The field of view at which the slope over it does nothing, degrees.
const MIDDLE_FOV_DEG: f64 = 55.0;

/// No speed is taken to be further than this factor from the assumed one: enough for a camera whose speeds are in
/// proportion where those of the same greatest speed were to grow by the cube, from a floor on: at level 5, by 400.
const LARGEST_FACTOR: f64 = 500.0;

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

/// Standard deviations by which a level may be faster than it seems: a slower one than was assumed is believed in so late.
const CAUTION: f64 = 0.75;

/// What the camera travels to and fro is counted over so long.
const TRAVEL: Duration = Duration::from_secs(1);

/// Logarithm of the factor from which on that tells: a delay and slow starts make up for less.
const GROSS: f64 = std::f64::consts::LN_2;

/// Variance of that logarithm: one picture's second is nearly the one before's.
const TRAVEL_VARIANCE: f64 = 6.0;

/// Rates that differ by more than this factor within the time that a picture may show teach nothing.
const STEADY: f64 = 2.0;

/// The camera needs some time to reach a speed; and the latency is not known to the millisecond.
const SETTLING: Duration = Duration::from_millis(240);
const EARLY: Duration = Duration::from_millis(80);

/// What the camera's speeds are taken for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Maps<'a> {
    /// Before anything was learned.
    pub assumed: &'a SpeedMap,
    /// By now, with what bounds them.
    pub believed: &'a SpeedMap,
}

#[derive(Clone, Copy)]
struct Axis {
    rate: fn(PanTilt) -> f64,
    level: fn((i8, i8)) -> i8,
}

impl Axis {
    const PAN: Self = Self { rate: |rate| rate.pan, level: |levels| levels.0 };
    const TILT: Self = Self { rate: |rate| rate.tilt, level: |levels| levels.1 };
}

/// What a turn about one axis is to be compared with.
#[derive(Clone, Copy)]
struct Seen<'a> {
    axis: Axis,
    latency: Duration,
    history: &'a CommandHistory,
    maps: Maps<'a>,
    fov_deg: f64,
}

/// A way commanded, and the features of its levels, each by its part of the way.
struct Way {
    degrees: f64,
    features: [f64; FEATURES],
}

impl SpeedMapEstimator {
    /// Knows nothing but the assumed map. `told`: that is the camera's own, and needs little correction.
    pub fn new(told: bool) -> Self {
        let mut deviations = [if told { 0.1 } else { 0.25 }; FEATURES];
        deviations[OFFSET] = if told { 0.1 } else { 1.5 };
        // Linear for cubic is off by two: with less, that would be taken for an oddity at each level met so far.
        deviations[SLOPE] = if told { 0.1 } else { 2.0 };
        deviations[ZOOM] = if told { 0.1 } else { 0.5 };
        Self {
            regression: RecursiveLeastSquares::new(deviations),
            recent: VecDeque::new(),
            proved_wrong: 0.0,
            latency: None,
        }
    }

    /// The map with what was learned.
    pub fn correct(&self, assumed: &SpeedMap, fov_deg: f64) -> SpeedMap {
        assumed.times(|level| {
            let features = features(level, fov_deg);
            let logarithm = self.regression.predict(&features);
            // Slower only as far as that is sure: a level that was never tried may fling the camera round.
            let cautious =
                (logarithm + CAUTION * self.regression.deviation(&features)).min(0.0).max(logarithm);
            // Of what is really assumed, which for slow ones may be more than the curve has. What is no number bounds
            // nothing.
            let raised = assumed.deg_s(level) / assumed.bare_deg_s(level.unsigned_abs());
            cautious.min((raised * LARGEST_FACTOR).ln()).max(-LARGEST_FACTOR.ln()).exp()
        })
    }

    /// Takes a turn that was seen. `assumed`: the map before anything was learned; `map`: as it is believed now;
    /// `fov_deg`: that the turn was measured with.
    pub fn see(
        &mut self,
        turn: &ObservedRotation,
        delays: &Delays,
        history: &CommandHistory,
        maps: Maps,
        fov_deg: f64,
    ) -> f64 {
        let latency = delays.sum();
        if self.latency.get_or_insert(latency).abs_diff(latency) > ANOTHER_LATENCY {
            self.latency = Some(latency);
            self.regression.forget(DOUBTED);
        }
        self.regression.forget(FORGOTTEN_PER_S * turn.seconds());
        self.remember(turn);
        for axis in [Axis::PAN, Axis::TILT] {
            let seen = Seen { axis, latency, history, maps, fov_deg };
            self.see_travel(&seen);
            self.see_rate(turn, &seen);
        }
        std::mem::take(&mut self.proved_wrong)
    }

    fn remember(&mut self, turn: &ObservedRotation) {
        if self.recent.back().is_some_and(|last| last.to != turn.from) {
            self.recent.clear();
        }
        self.recent.push_back(*turn);
        while self.recent.front().is_some_and(|first| first.to + TRAVEL <= turn.to) {
            self.recent.pop_front();
        }
    }

    /// Compares how fast the camera turned with how fast it should have, where it turned evenly.
    fn see_rate(&mut self, turn: &ObservedRotation, about: &Seen) {
        let Seen { axis, latency, history, maps, fov_deg } = *about;
        let (from, to) = (turn.from - latency, turn.to - latency);
        let rates = history.rates_between(from - SETTLING, to + EARLY).map(axis.rate);
        let (low, high) = extremes(rates);
        let ratio = if low > 0.0 { high / low } else { low / high };
        if low * high <= 0.0 || ratio > STEADY {
            return;
        }
        // What is bounded by proportional speed tells nothing of the map.
        let bounded = maps.believed.is_capped(low.abs().max(high.abs()));
        let Some(way) = self.way(about, from, to).filter(|_| !bounded) else { return };
        let (seen, commanded) = ((axis.rate)(turn.rate) * low.signum(), way.degrees / turn.seconds());
        let noise = NOISE_FIELDS_S * fov_deg;
        let mut features = way.features;
        if seen.abs() > 2.0 * noise {
            // A camera that moves to the other side obeys somebody or something else.
            if seen > 0.0 {
                let variance = VARIANCE + ratio.ln().powi(2) + (noise / seen).powi(2);
                self.learn(&features, (seen / commanded).ln(), variance);
            }
        } else if commanded > STRONG * noise {
            // Far slower than it is taken for, or only late. How much slower is not told: nothing of this level
            // in particular.
            features[FIRST_KNOT..].fill(0.0);
            self.learn(&features, (noise / commanded).ln(), STANDING_VARIANCE);
        }
    }

    /// Compares how far the camera went to and fro in the last moments with how far it should have. That tells
    /// nothing exact, but when all is so wrong that the camera swings, and never turns evenly, nothing else does.
    fn see_travel(&mut self, about: &Seen) {
        let (Some(first), Some(last)) = (self.recent.front(), self.recent.back()) else { return };
        if first.from + TRAVEL > last.to {
            return;
        }
        let (from, to) = (first.from - about.latency, last.to - about.latency);
        let seen: f64 =
            self.recent.iter().map(|turn| (about.axis.rate)(turn.rate).abs() * turn.seconds()).sum();
        let least = STRONG * NOISE_FIELDS_S * about.fov_deg * TRAVEL.as_secs_f64();
        let Some(way) = self.way(about, from, to).filter(|_| seen > least) else { return };
        let factor = (seen / way.degrees).ln();
        if factor.abs() > GROSS {
            self.learn(&way.features, factor, TRAVEL_VARIANCE);
        }
    }

    /// The way commanded between two times, to and fro; `None` of none.
    fn way(&self, about: &Seen, from: Time, to: Time) -> Option<Way> {
        let mut way = Way { degrees: 0.0, features: [0.0; FEATURES] };
        for (levels, seconds) in about.history.levels_between(from, to) {
            let level = (about.axis.level)(levels);
            let features = features(level, about.fov_deg);
            let degrees = about.maps.assumed.bare_deg_s(level.unsigned_abs())
                * self.regression.predict(&features).exp()
                * seconds;
            way.degrees += degrees;
            for (sum, feature) in way.features.iter_mut().zip(features) {
                *sum += degrees * feature;
            }
        }
        way.features = way.features.map(|sum| sum / way.degrees);
        (way.degrees > 0.0 && way.degrees.is_finite()).then_some(way)
    }

    /// Takes it that the camera is so much faster (a logarithm) than is known by now.
    fn learn(&mut self, features: &[f64; FEATURES], faster: f64, variance: f64) {
        let known = self.regression.predict(features);
        self.regression.update(features, known + faster, variance);
        self.proved_wrong += (self.regression.predict(features) - known).abs();
    }

    /// Degrees have become another measure, by a factor of this logarithm.
    pub fn rescale(&mut self, logarithm: f64) {
        self.regression.shift(OFFSET, logarithm);
    }
}

fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

fn features(level: i8, fov_deg: f64) -> [f64; FEATURES] {
    let logarithm = f64::from(level.unsigned_abs()).max(1.0).ln();
    let mut features = [0.0; FEATURES];
    features[OFFSET] = 1.0;
    features[SLOPE] = logarithm - MIDDLE_LEVEL.ln();
    features[ZOOM] = (fov_deg / MIDDLE_FOV_DEG).ln();
    // Knots in equal ratios from level 1 to 100.
    let place = logarithm / 100f64.ln() * (KNOTS - 1) as f64;
    for (knot, feature) in features[FIRST_KNOT..].iter_mut().enumerate() {
        *feature = (1.0 - (place - knot as f64).abs()).max(0.0);
    }
    features
}
