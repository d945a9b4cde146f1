// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::Vector;

use super::{Measurement, RateAverage, Visibility};
use crate::Time;
use crate::model::{CommandHistory, Delays, PanTilt, View, rise_deg};

/// How the target's motion is carried forward over the latency.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Prediction {
    /// With its mean over the last second (thesis 3.16): smooth, and late when the target turns.
    Average,
    /// With its rate as it was over the last moments, and as that was changing.
    #[default]
    Lead,
}

impl Prediction {
    fn window(self) -> Duration {
        match self {
            Self::Average => Duration::from_secs(1),
            // A walking person's sway lasts half a second or more, the noise of optical flow a frame.
            Self::Lead => Duration::from_millis(400),
        }
    }
}

/// How far off the middle the target is, degrees.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Offset {
    /// In the last picture.
    pub seen: PanTilt,
    /// When a command sent now acts.
    pub expected: PanTilt,
    /// The part of `expected` that dead reckoning since the target was first seen leaves, never more than that, and all of it where
    /// the background is seen; `None` where the target was first seen too long ago to tell.
    pub reckoned: Option<PanTilt>,
    /// How steeply below or above the camera the target is, from 0 at the horizon to 1: the squared sine of its elevation.
    pub steepness: f64,
    /// The target's own motion then, degrees per second.
    pub target: PanTilt,
}

/// Where the target is and will be, as angles from the camera's axis.
#[derive(Debug)]
pub struct TargetEstimator {
    prediction: Prediction,
    /// Of pan what is seen of it, as below the camera it changes fastest where least is seen.
    target_rate: RateAverage,
    id: u64,
    error: PanTilt,
    /// Where the target is, degrees above the horizon.
    elevation_deg: f64,
    taken_at: Time,
    /// When the target was first seen, and how far off the middle.
    first_seen: Option<(Time, PanTilt)>,
    /// Whether the last picture told how the background moved.
    background_seen: bool,
}

impl TargetEstimator {
    /// How long dead reckoning is worth anything: what is wrong about the camera's speeds and the target's adds up.
    const RECKONED: Duration = Duration::from_secs(2);

    /// Knows nothing yet.
    pub fn new(prediction: Prediction) -> Self {
        Self {
            prediction,
            target_rate: RateAverage::new(prediction.window()),
            id: 0,
            error: PanTilt::default(),
            elevation_deg: 0.0,
            taken_at: Time::ZERO,
            first_seen: None,
            background_seen: false,
        }
    }

    /// How it predicts.
    pub fn prediction(&self) -> Prediction {
        self.prediction
    }

    /// Takes a picture of the target, seen with `view`, after these commands.
    pub fn see(&mut self, measurement: &Measurement, view: &View, history: &CommandHistory, delays: &Delays) {
        if measurement.id != self.id {
            self.clear();
            self.id = measurement.id;
        }
        if measurement.visibility == Visibility::Predicted {
            return self.foresee(measurement, view);
        }
        self.place(measurement, view);
        self.background_seen = measurement.ego_velocity.is_some();
        // The target's own motion is what is left of its motion in the picture without the camera's:
        // seen in the background, or else known from the commands.
        let rate = match measurement.ego_velocity {
            Some(ego) => view.rate(
                measurement.centroid,
                Vector { x: measurement.velocity.x - ego.x, y: measurement.velocity.y - ego.y },
            ),
            None => {
                let (sent, uncertainty) = (delays.sent_by(measurement.taken_at), delays.uncertainty);
                let (from, to) = (sent - uncertainty, sent + uncertainty);
                let camera = history.rates_between(from, to).chain([history.reached_at(from)]);
                self.likeliest(view.rate(measurement.centroid, measurement.velocity), camera)
            }
        };
        if rate.is_finite() {
            let seen = self.seen_of_pan();
            self.target_rate.push(measurement.taken_at, PanTilt::new(rate.pan * seen, rate.tilt));
        }
    }

    fn place(&mut self, measurement: &Measurement, view: &View) {
        let error = view.error(measurement.centroid);
        if !error.is_finite() {
            // From a tracker of others, far beyond any picture.
            return;
        }
        self.error = error;
        self.elevation_deg = view.tilt_deg + self.error.tilt;
        self.taken_at = measurement.taken_at;
        self.first_seen.get_or_insert((self.taken_at, self.error));
    }

    /// How far the target moves through the picture when it goes round the camera by a degree, in degrees.
    fn seen_of_pan(&self) -> f64 {
        // At the nadir itself nobody can tell.
        const LEAST: f64 = 0.01;
        self.elevation_deg.to_radians().cos().max(LEAST)
    }

    /// The target's own rate where it is seen to turn like this against a camera that turns at one of these rates: of what
    /// is possible, what is nearest to how it went so far. Else a camera's start that shows later than it is
    /// thought to would be taken for a start of the target's.
    fn likeliest(&self, seen: PanTilt, camera: impl Iterator<Item = PanTilt>) -> PanTilt {
        let possible: Vec<PanTilt> = camera.map(|rate| seen + rate).collect();
        let bound = |nearer: fn(f64, f64) -> f64| {
            possible.iter().copied().reduce(|bound, rate| bound.each(rate, nearer)).unwrap_or(seen)
        };
        self.pace().each(bound(f64::min), f64::max).each(bound(f64::max), f64::min)
    }

    /// Takes a picture that hides the target: it goes on as it did, but whether faster and faster nobody knows.
    fn foresee(&mut self, measurement: &Measurement, view: &View) {
        self.target_rate.coast(measurement.taken_at, self.expected_rate(Duration::ZERO));
        // Who does not see the background cannot tell how the camera's turns move a hidden target in the
        // picture: there the last measurement and the commands since know better.
        if measurement.ego_velocity.is_some() {
            self.place(measurement, view);
        }
    }

    /// It went out of view: it goes on as it did, but whether faster and faster nobody knows.
    pub fn lose_sight(&mut self) {
        self.target_rate.coast(self.taken_at, self.expected_rate(Duration::ZERO));
    }

    /// Forgets the target.
    pub fn clear(&mut self) {
        self.target_rate.clear();
        self.first_seen = None;
    }

    /// The error left when a command sent `now` shows in the picture, if nothing new is commanded: the
    /// target has moved on since the picture was taken, and the camera has made, or will make, the turns
    /// it was already told and that the picture does not show yet (Smith predictor).
    pub fn error_at_effect(&self, now: Time, history: &CommandHistory, delays: &Delays) -> PanTilt {
        let shown = delays.sent_by(self.taken_at);
        let horizon = self.horizon(now, delays);
        let under_way = history.rotation(shown, now);
        // The rate grows evenly: on the way it is what it is half way. Reckoned for longer it is worth nothing.
        let walks_for = horizon.min(Self::RECKONED);
        let walked = self.walked(self.target_rate(walks_for / 2) * walks_for.as_secs_f64());
        self.round(under_way.pan) + walked - under_way
    }

    /// The error, the way round on which the camera is by so many degrees: half round from the target it would else turn
    /// back at each tremble.
    fn round(&self, under_way_deg: f64) -> PanTilt {
        // Less than 180, as a place beyond half round is measured to either side of it, by some degrees.
        const HALF_ROUND_DEG: f64 = 150.0;
        let turns_back = self.error.pan.abs() > HALF_ROUND_DEG && self.error.pan * under_way_deg < 0.0;
        let round_deg = if turns_back { 360f64.copysign(under_way_deg) } else { 0.0 };
        self.error + PanTilt::new(round_deg, 0.0)
    }

    /// By what the target's direction changes as it goes so far, on a great circle: where it passes below, at its rate
    /// it would go round the camera again and again.
    fn walked(&self, way_deg: PanTilt) -> PanTilt {
        // Whoever walks straight on never goes further round than this, however long.
        const FARTHEST_DEG: f64 = 80.0;
        let across = (way_deg.pan * self.seen_of_pan()).clamp(-FARTHEST_DEG, FARTHEST_DEG).to_radians();
        // Nor higher than this above the camera, or further beyond the point below it.
        let (lowest, highest) =
            ((-90.0 - FARTHEST_DEG).min(self.elevation_deg), FARTHEST_DEG.max(self.elevation_deg));
        let elevation = (self.elevation_deg + way_deg.tilt).clamp(lowest, highest).to_radians();
        let pan = across.sin().atan2(across.cos() * elevation.cos());
        let height = (across.cos() * elevation.sin()).asin();
        PanTilt::new(pan.to_degrees(), height.to_degrees() - self.elevation_deg)
    }

    /// Where the target is off the middle, and how it goes on.
    pub fn offset(&self, now: Time, history: &CommandHistory, delays: &Delays) -> Offset {
        let expected = self.error_at_effect(now, history, delays);
        let target = self.target_rate(self.horizon(now, delays));
        // Half round the camera, what goes up goes down in the picture.
        let target = PanTilt::new(target.pan, target.tilt * expected.pan.to_radians().cos());
        Offset {
            seen: self.in_picture(self.error),
            expected: self.in_picture(expected),
            reckoned: self.reckoned(expected, now, history, delays),
            steepness: self.steepness(),
            target,
        }
    }

    /// The first error, plus the target's mean motion since, less all turns commanded since; where that and the expected error
    /// disagree, the smaller, and zero if the signs differ. A camera that is later or slower than assumed is so not commanded
    /// twice; one that is faster shows in the expected error.
    ///
    /// Where the background is seen, pictures show how far the camera really turned, and its speeds are learned: a reckoning by
    /// the speeds it began with would end the seek early. The more steeply below the camera somebody is, the less a picture tells
    /// of pan, and the reckoning counts again.
    fn reckoned(
        &self,
        expected: PanTilt,
        now: Time,
        history: &CommandHistory,
        delays: &Delays,
    ) -> Option<PanTilt> {
        let (first_at, first) = self.first_seen?;
        let since = now - first_at;
        if since > Self::RECKONED {
            return None;
        }
        let expected = self.in_picture(expected);
        let walked = self.walked(self.pace() * (since + delays.sum()).as_secs_f64());
        let left = self.in_picture(first + walked - history.rotation(delays.sent_by(first_at), now));
        let common = |one: f64, other: f64| {
            if one * other > 0.0 { one.abs().min(other.abs()).copysign(one) } else { 0.0 }
        };
        let reckoned = expected.each(left, common);
        let trust = if self.background_seen { 1.0 - self.steepness() } else { 0.0 };
        Some(reckoned + (expected - reckoned) * trust)
    }

    /// The same error with what tilt alone is to do about it: while pan is under way, to look already as high as the target
    /// is would lose who passed below out of the picture.
    fn in_picture(&self, error: PanTilt) -> PanTilt {
        PanTilt::new(error.pan, rise_deg(self.elevation_deg - error.tilt, error))
    }

    /// From the picture until a command sent `now` shows.
    fn horizon(&self, now: Time, delays: &Delays) -> Duration {
        now - self.taken_at + delays.sum()
    }

    /// The target's own angular rate so long after the picture.
    fn target_rate(&self, lead: Duration) -> PanTilt {
        self.as_pan(self.expected_rate(lead))
    }

    fn as_pan(&self, seen: PanTilt) -> PanTilt {
        PanTilt::new(seen.pan / self.seen_of_pan(), seen.tilt)
    }

    fn expected_rate(&self, lead: Duration) -> PanTilt {
        match self.prediction {
            Prediction::Average => self.target_rate.mean(),
            Prediction::Lead => self.leading_rate(lead),
        }
    }

    /// Pan by its trend; tilt by its mean, and by its trend only as far as the target is steeply below. Seen from the side, a
    /// walker's steps move the silhouette's middle up and down faster than the walker comes nearer, and do not last.
    fn leading_rate(&self, lead: Duration) -> PanTilt {
        let ahead = self.target_rate.ahead(lead);
        let mean = self.target_rate.certain_mean().tilt;
        PanTilt::new(ahead.pan, mean + self.steepness() * (ahead.tilt - mean))
    }

    fn steepness(&self) -> f64 {
        1.0 - self.seen_of_pan().powi(2)
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        assert!(self.error.is_finite() && self.elevation_deg.is_finite(), "a target at {:?}", self.error);
        assert!(self.pace().is_finite(), "a target that moves by {:?} degrees per second", self.pace());
        assert!(
            self.first_seen.is_none_or(|(_, error)| error.is_finite()),
            "a target first seen at {:?}",
            self.first_seen
        );
    }

    /// The target's own angular rate over the last moments.
    pub fn pace(&self) -> PanTilt {
        self.as_pan(self.target_rate.mean())
    }

    /// Off the middle, as the last picture has it.
    pub fn error(&self) -> PanTilt {
        self.error
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ptztrack_contract::Point;

    const VIEW: View = View { horizontal_fov_deg: 60.0, aspect: 4.0 / 3.0, tilt_deg: 0.0 };
    const LATENCY: Duration = Duration::from_millis(200);

    fn delays() -> Delays {
        Delays::of_sum(LATENCY, Duration::ZERO)
    }

    fn seconds<T: From<Duration>>(seconds: f64) -> T {
        Duration::from_secs_f64(seconds).into()
    }

    /// The contract lets any finite number through.
    #[test]
    fn a_place_or_a_velocity_beyond_all_measure_is_no_measurement() {
        let history = CommandHistory::default();
        let mut estimator = TargetEstimator::new(Prediction::Lead);
        estimator.see(&Measurement::at(0.6, 0.5, seconds(1.0)), &VIEW, &history, &delays());
        let before = estimator.error();
        let far = Measurement {
            centroid: Point { x: 0.5, y: 1e308 },
            velocity: Vector { x: 0.0, y: f64::MAX },
            ego_velocity: Some(Vector { x: 0.0, y: f64::MIN }),
            ..Measurement::at(0.5, 0.5, seconds(1.04))
        };
        estimator.see(&far, &VIEW, &history, &delays());
        estimator.check_invariants();
        assert_eq!(estimator.error(), before);
    }

    #[test]
    fn a_moving_target_is_led() {
        let history = CommandHistory::default();
        let mut estimator = TargetEstimator::new(Prediction::Lead);
        for time in [0.92, 0.96, 1.0] {
            let walking = Measurement {
                velocity: Vector { x: 0.1, y: 0.0 },
                ..Measurement::at(0.5, 0.5, seconds(time))
            };
            estimator.see(&walking, &VIEW, &history, &delays());
        }
        let rate = estimator.target_rate(Duration::ZERO).pan;
        assert!((rate - 6.616).abs() < 0.01, "{rate}");
        let error = estimator.error_at_effect(seconds(1.1), &history, &delays()).pan;
        assert!((error - rate * 0.3).abs() < 1e-9, "{error}");
    }

    #[test]
    fn a_turn_under_way_is_not_commanded_again() {
        let mut history = CommandHistory::default();
        history.push(seconds(0.9), PanTilt::new(10.0, 0.0));
        let mut estimator = TargetEstimator::new(Prediction::Lead);
        // The background moves to the left at the camera's own rate: the target stands still.
        let still = Measurement {
            velocity: Vector { x: -0.15, y: 0.0 },
            ego_velocity: Some(Vector { x: -0.15, y: 0.0 }),
            ..Measurement::at(0.6, 0.5, seconds(1.0))
        };
        estimator.see(&still, &VIEW, &history, &delays());
        assert_eq!(estimator.target_rate(Duration::ZERO), PanTilt::default());
        let offset = VIEW.error(still.centroid).pan;
        let error = estimator.error_at_effect(seconds(1.1), &history, &delays()).pan;
        assert!((error - (offset - 2.0)).abs() < 1e-9, "{error} of {offset}");
    }

    #[test]
    fn without_background_the_commands_tell_the_cameras_motion() {
        let mut history = CommandHistory::default();
        history.push(seconds(0.5), PanTilt::new(6.0, 0.0));
        let mut estimator = TargetEstimator::new(Prediction::Average);
        for time in [0.92, 0.96, 1.0] {
            estimator.see(&Measurement::at(0.5, 0.5, seconds(time)), &VIEW, &history, &delays());
        }
        assert_eq!(estimator.target_rate(Duration::ZERO).pan, 6.0);
    }

    #[test]
    fn another_target_has_another_motion() {
        let history = CommandHistory::default();
        let mut estimator = TargetEstimator::new(Prediction::Average);
        for time in [0.92, 0.96, 1.0] {
            let walking = Measurement {
                velocity: Vector { x: 0.1, y: 0.0 },
                ..Measurement::at(0.5, 0.5, seconds(time))
            };
            estimator.see(&walking, &VIEW, &history, &delays());
        }
        estimator.see(
            &Measurement { id: 2, ..Measurement::at(0.5, 0.5, seconds(1.1)) },
            &VIEW,
            &history,
            &delays(),
        );
        assert_eq!(estimator.target_rate(Duration::ZERO), PanTilt::default());
    }

    #[test]
    fn the_average_is_the_plain_mean() {
        let history = CommandHistory::default();
        let mut estimator = TargetEstimator::new(Prediction::Average);
        for (time, x) in [(0.2, 0.1), (0.4, -0.05), (0.6, 0.2)] {
            let trembling =
                Measurement { velocity: Vector { x, y: 0.0 }, ..Measurement::at(0.5, 0.5, seconds(time)) };
            estimator.see(&trembling, &VIEW, &history, &delays());
        }
        let rate = estimator.target_rate(seconds(0.4)).pan;
        assert!((rate - 6.616 * 0.25 / 0.3).abs() < 0.01, "{rate}");
    }

    /// By so many hundredths of a degree the middle of a walker's silhouette rises from picture to picture, during one step.
    const STEP: [i32; 14] = [5, -9, -36, -13, 11, 5, 4, 1, -1, 15, 14, 22, 21, -39];

    /// Somebody walks by, and slowly nearer.
    #[test]
    fn tilt_goes_by_the_mean_of_a_walk_and_not_by_its_steps() {
        const NEARER_DEG_S: f64 = -1.0;
        const PICTURE_S: f64 = 0.04;
        let history = CommandHistory::default();
        let mut estimator = TargetEstimator::new(Prediction::Lead);
        let degrees = VIEW.rate(Point { x: 0.5, y: 0.5 }, Vector { x: 1.0, y: 1.0 });
        let mut rates = Vec::new();
        for (picture, rise) in STEP.iter().cycle().take(5 * STEP.len()).enumerate() {
            let up_deg_s = NEARER_DEG_S + f64::from(*rise) / 100.0 / PICTURE_S;
            let walking = Measurement {
                velocity: Vector { x: 12.0 / degrees.pan, y: up_deg_s / degrees.tilt },
                ego_velocity: Some(Vector::default()),
                ..Measurement::at(0.5, 0.5, seconds(PICTURE_S * picture as f64))
            };
            estimator.see(&walking, &VIEW, &history, &delays());
            rates.push(estimator.target_rate(LATENCY).tilt);
        }
        let step = &rates[rates.len() - STEP.len()..];
        let off = step.iter().map(|rate| (rate - NEARER_DEG_S).abs()).sum::<f64>() / STEP.len() as f64;
        assert!(off < 1.0, "{off} degrees per second: {step:?}");
    }

    /// Somebody who goes faster and faster, and is hidden at 0.4 s; and the mean rate and the last of what was seen.
    fn hidden(ego_velocity: Option<Vector>) -> (TargetEstimator, f64, f64) {
        let history = CommandHistory::default();
        let mut estimator = TargetEstimator::new(Prediction::Lead);
        let at = |frame: u32| -> Time { seconds(0.04 * f64::from(frame)) };
        for frame in 1..=10 {
            let velocity = Vector { x: 0.02 * f64::from(frame), y: 0.0 };
            let seen = Measurement { velocity, ego_velocity, ..Measurement::at(0.6, 0.5, at(frame)) };
            estimator.see(&seen, &VIEW, &history, &delays());
        }
        let (mean, last) = (estimator.pace().pan, estimator.target_rate(Duration::ZERO).pan);
        assert!(estimator.target_rate(LATENCY).pan > last);
        for frame in 11..=25 {
            let echo = Measurement {
                visibility: Visibility::Predicted,
                velocity: Vector { x: 0.4, y: 0.0 },
                ego_velocity,
                ..Measurement::at(0.7, 0.5, at(frame))
            };
            estimator.see(&echo, &VIEW, &history, &delays());
        }
        (estimator, mean, last)
    }

    #[test]
    fn who_is_hidden_goes_on_at_a_plain_rate() {
        for ego in [None, Some(Vector::default())] {
            let (estimator, mean, last) = hidden(ego);
            let rate = estimator.target_rate(LATENCY).pan;
            assert!((mean..last).contains(&rate), "{rate} after {mean} to {last}");
            assert_eq!(estimator.target_rate(Duration::from_secs(1)).pan, rate);
        }
    }

    #[test]
    fn a_prediction_is_believed_of_who_sees_the_background() {
        let error = |x| VIEW.error(Point { x, y: 0.5 });
        assert_eq!(hidden(None).0.error(), error(0.6));
        assert_eq!(hidden(Some(Vector::default())).0.error(), error(0.7));
    }

    /// A camera that was told to turn at 50 degrees a second, and turns later or sooner than it is thought to.
    fn pace_seen(late_ms: i64, uncertainty_ms: u64, own_deg_s: f64) -> f64 {
        let mut history = CommandHistory::default();
        history.push(seconds(1.0), PanTilt::new(50.0, 0.0));
        let begins = 1.2 + late_ms as f64 / 1000.0;
        let mut estimator = TargetEstimator::new(Prediction::Lead);
        for picture in 0..=32 {
            let time = 0.8 + f64::from(picture) * 0.02;
            let seen_deg_s = own_deg_s - if time >= begins { 50.0 } else { 0.0 };
            let per_deg = VIEW.rate(Point { x: 0.5, y: 0.5 }, Vector { x: 1.0, y: 0.0 }).pan;
            let velocity = Vector { x: seen_deg_s / per_deg, y: 0.0 };
            let seen = Measurement { velocity, ..Measurement::at(0.5, 0.5, seconds(time)) };
            estimator.see(
                &seen,
                &VIEW,
                &history,
                &Delays { uncertainty: Duration::from_millis(uncertainty_ms), ..delays() },
            );
        }
        estimator.pace().pan
    }

    #[test]
    fn a_camera_that_turns_at_another_time_than_thought_is_no_start_of_the_targets() {
        for late_ms in [-140, -60, 0, 60, 140] {
            for own_deg_s in [-8.0, 0.0, 12.0] {
                let pace = pace_seen(late_ms, 150, own_deg_s);
                assert!((pace - own_deg_s).abs() < 1e-3, "{late_ms} ms, {own_deg_s}: {pace}");
            }
        }
        assert!(pace_seen(100, 0, 0.0) > 5.0, "where the latency is certain it is taken for one");
    }
}
