// SPDX-License-Identifier: MPL-2.0

//! One axis of a track's box: its middle, rate and size, in a Kalman filter that takes each side as a measurement of its own.

/// Deviations from which a side is not the track's own: it is hidden, or it is somebody else's.
const GATE: f32 = 3.0;

/// Deviations from which what is seen has another size than the box: one of its sides is hidden, or is not its own.
const ANOTHER_SIZE: f32 = 1.5;
/// The deviation of that side then, in differences of the size: what hides somebody often does so for a second, what is seen beside
/// them is sooner their own.
const HIDDEN: f32 = 2.0;
const WIDER: f32 = 1.0;

/// A side of the box along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// Left, or the head.
    Low,
    /// Right, or the feet.
    High,
}

impl Side {
    /// Its place, in sizes of the box from the middle.
    fn offset(self) -> f32 {
        match self {
            Self::Low => -0.5,
            Self::High => 0.5,
        }
    }
}

/// Middle (pixels), rate (pixels per second, against the background) and size (pixels) along one axis, with covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    pub middle: f32,
    pub rate: f32,
    pub size: f32,
    covariance: [[f32; 3]; 3],
    /// How far both sides were seen from where they were expected in this picture, in deviations of their measurement; 0 where not both
    /// were, or in opposite directions.
    innovation: f32,
}

/// How much an axis changes by itself, as spectral densities per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ProcessNoise {
    /// Of the rate, pixels² per second³.
    pub acceleration: f32,
    /// Of the size, pixels² per second.
    pub size: f32,
}

impl Axis {
    /// As first seen; the deviations are of middle, rate and size.
    pub fn new(middle: f32, size: f32, deviations: [f32; 3]) -> Self {
        let mut covariance = [[0.0; 3]; 3];
        for (place, deviation) in deviations.into_iter().enumerate() {
            covariance[place][place] = deviation * deviation;
        }
        Self { middle, rate: 0.0, size, covariance, innovation: 0.0 }
    }

    /// The place of a side, pixels.
    pub fn side(&self, side: Side) -> f32 {
        self.middle + side.offset() * self.size
    }

    /// Variance of the middle, pixels².
    pub fn variance(&self) -> f32 {
        self.covariance[0][0]
    }

    /// The background carries it to `middle` and enlarges it by `scale`.
    pub fn carry(&mut self, middle: f32, scale: f32) {
        self.middle = middle;
        self.rate *= scale;
        self.size *= scale;
        self.covariance.iter_mut().flatten().for_each(|value| *value *= scale * scale);
    }

    /// Goes on for `dt_s`.
    pub fn predict(&mut self, dt_s: f32, noise: ProcessNoise) {
        self.middle += self.rate * dt_s;
        self.innovation = 0.0;
        let c = &mut self.covariance;
        c[0][0] += dt_s * (c[0][1] + c[1][0] + dt_s * c[1][1]);
        c[0][1] += dt_s * c[1][1];
        c[0][2] += dt_s * c[1][2];
        let q = noise.acceleration;
        c[0][0] += q * dt_s.powi(3) / 3.0;
        c[0][1] += q * dt_s * dt_s / 2.0;
        c[1][1] += q * dt_s;
        c[2][2] += noise.size * dt_s;
        (c[1][0], c[2][0], c[2][1]) = (c[0][1], c[0][2], c[1][2]);
    }

    /// Takes a side that was seen at `place` with that deviation, in pixels. One that is too far off is no measurement; the longer
    /// there was none, the farther off it may be.
    pub fn measure(&mut self, side: Side, place: f32, deviation: f32) {
        let half = side.offset();
        let c = &self.covariance;
        let gain: [f32; 3] = std::array::from_fn(|row| c[row][0] + half * c[row][2]);
        let variance = gain[0] + half * gain[2] + deviation * deviation;
        let innovation = place - self.side(side);
        if innovation * innovation <= GATE * GATE * variance {
            self.correct(gain, innovation, variance);
        }
    }

    /// Takes both sides, seen at `low` and `high`. Where they are farther apart or nearer than they can be, the one that is farther
    /// from where it was expected says little.
    pub fn measure_both(&mut self, low: f32, high: f32, deviation: f32) {
        let change = high - low - self.size;
        let likely = ANOTHER_SIZE * (self.covariance[2][2] + 2.0 * deviation * deviation).sqrt();
        let doubtful = if change.abs() <= likely {
            deviation
        } else if change < 0.0 {
            -HIDDEN * change
        } else {
            WIDER * change
        };
        let off = |(side, place): (Side, f32)| place - self.side(side);
        let (near, far) = ((Side::Low, low), (Side::High, high));
        let (near, far) = if off(near).abs() <= off(far).abs() { (near, far) } else { (far, near) };
        self.innovation = if off(near) * off(far) > 0.0 { off(near) / deviation } else { 0.0 };
        self.measure(near.0, near.1, deviation);
        self.measure(far.0, far.1, doubtful.max(deviation));
    }

    /// Takes the place of its middle.
    pub fn measure_middle(&mut self, place: f32, deviation: f32) {
        let gain: [f32; 3] = std::array::from_fn(|row| self.covariance[row][0]);
        self.correct(gain, place - self.middle, gain[0] + deviation * deviation);
    }

    /// Takes a rate, pixels per second, that was measured in the picture in which the sides were. One that holds the box back where
    /// its sides were seen ahead of it says the less the farther they were: it is of something else, as the wall behind.
    pub fn measure_rate(&mut self, rate: f32, deviation: f32) {
        let holds_back = (rate - self.rate) * self.innovation < 0.0;
        let doubt = if holds_back { 1.0 + self.innovation * self.innovation } else { 1.0 };
        let deviation = doubt * deviation;
        let gain: [f32; 3] = std::array::from_fn(|row| self.covariance[row][1]);
        self.correct(gain, rate - self.rate, gain[1] + deviation * deviation);
    }

    fn correct(&mut self, gain: [f32; 3], innovation: f32, variance: f32) {
        if !(innovation.is_finite() && variance > f32::EPSILON) {
            return;
        }
        self.middle += gain[0] / variance * innovation;
        self.rate += gain[1] / variance * innovation;
        self.size = (self.size + gain[2] / variance * innovation).max(1.0);
        for (row, a) in gain.iter().enumerate() {
            for (column, b) in gain.iter().enumerate() {
                self.covariance[row][column] -= a * b / variance;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NOISE: ProcessNoise = ProcessNoise { acceleration: 400.0, size: 40.0 };
    const DT: f32 = 0.04;

    fn axis() -> Axis {
        Axis::new(100.0, 40.0, [4.0, 40.0, 8.0])
    }

    #[test]
    fn who_walks_has_their_speed_and_size() {
        let mut axis = axis();
        for n in 1..50 {
            axis.predict(DT, NOISE);
            let middle = 100.0 + 60.0 * DT * n as f32;
            axis.measure(Side::Low, middle - 15.0, 2.0);
            axis.measure(Side::High, middle + 15.0, 2.0);
        }
        assert!((axis.rate - 60.0).abs() < 6.0 && (axis.size - 30.0).abs() < 2.0, "{axis:?}");
    }

    #[test]
    fn a_hidden_side_costs_nothing() {
        let mut axis = axis();
        for n in 1..50 {
            axis.predict(DT, NOISE);
            axis.measure(Side::Low, 80.0 + 60.0 * DT * n as f32, 2.0);
        }
        assert!((axis.side(Side::Low) - 80.0 - 60.0 * DT * 49.0).abs() < 2.0, "{axis:?}");
        assert!((axis.size - 40.0).abs() < 6.0, "{axis:?}");
    }

    /// Somebody walks behind a pillar, whose edge their right side seems to stay at.
    #[test]
    fn a_side_that_a_pillar_hides_holds_nobody_back() {
        let mut axis = axis();
        let at = |n: usize| 80.0 + 60.0 * DT * n as f32;
        for n in 1..=50 {
            axis.predict(DT, NOISE);
            axis.measure_both(at(n), (at(n) + 40.0).min(at(30) + 40.0), 3.0);
        }
        assert!((axis.side(Side::Low) - at(50)).abs() < 4.0 && axis.rate > 45.0, "{axis:?}");
    }

    #[test]
    fn what_stays_smaller_or_larger_is_so() {
        for high in [105.0, 160.0] {
            let mut axis = axis();
            for _ in 0..300 {
                axis.predict(DT, NOISE);
                axis.measure_both(80.0, high, 3.0);
            }
            assert!((axis.size - (high - 80.0)).abs() < 5.0, "{axis:?}");
        }
    }

    /// Somebody walks before a wall that the points were taken on, which never moves.
    #[test]
    fn points_on_the_wall_hold_nobody_back() {
        let mut axis = axis();
        let at = |n: usize| 80.0 + 60.0 * DT * n as f32;
        for n in 1..=75 {
            axis.predict(DT, NOISE);
            axis.measure_both(at(n), at(n) + 40.0, 3.0);
            axis.measure_rate(0.0, 5.0);
        }
        assert!((axis.side(Side::Low) - at(75)).abs() < 6.0 && axis.rate > 20.0, "{axis:?}");
    }

    #[test]
    fn a_side_far_off_is_not_believed_at_once_but_in_the_end() {
        let mut settled = axis();
        for _ in 0..25 {
            settled.predict(DT, NOISE);
            settled.measure(Side::Low, 80.0, 2.0);
            settled.measure(Side::High, 120.0, 2.0);
        }
        settled.predict(DT, NOISE);
        settled.measure(Side::High, 220.0, 2.0);
        assert!((settled.side(Side::High) - 120.0).abs() < 2.0, "{settled:?}");
        for _ in 0..400 {
            settled.predict(DT, NOISE);
            settled.measure(Side::Low, 80.0, 2.0);
            settled.measure(Side::High, 160.0, 2.0);
        }
        assert!((settled.side(Side::High) - 160.0).abs() < 2.0, "{settled:?}");
    }

    proptest! {
        #[test]
        fn doubt_grows_unseen_and_never_turns_negative(
            sides in prop::collection::vec((any::<bool>(), -500.0_f32..500.0, 0.5_f32..20.0), 0..40),
        ) {
            let mut axis = axis();
            for (low, place, deviation) in sides {
                let before = axis.variance();
                axis.predict(DT, NOISE);
                prop_assert!(axis.variance() >= before);
                axis.measure(if low { Side::Low } else { Side::High }, place, deviation);
                prop_assert!(axis.variance() >= -1e-2 && axis.middle.is_finite() && axis.size >= 1.0);
            }
        }
    }
}
