// SPDX-License-Identifier: MPL-2.0

use super::TableRow;

/// How a camera's speed grows with the speed step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SpeedCurve {
    /// In proportion to the step.
    Linear,
    /// By the cube of the step, as in Axis' example table (24: 2.1, 40: 9, 58: 28, 80: 74, 100: 150 deg/s).
    #[default]
    Cubic,
}

/// Speed steps (-100 to 100) and degrees per second: any growing curve, the same both ways.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedMap {
    /// Degrees per second of the steps 0 to 100.
    curve: [f64; Self::STEPS + 1],
    /// The same without the floor.
    bare: [f64; Self::STEPS + 1],
    /// Degrees per second that every step does at least.
    floor_deg_s: f64,
    /// Degrees per second that no step exceeds (proportional speed), or infinity.
    cap_deg_s: f64,
}

impl SpeedMap {
    const STEPS: usize = 100;

    /// Slowest motion of the domes whose tables are known.
    const FLOOR_DEG_S: f64 = 0.05;

    /// How far a wish may lie from the step in force before another is chosen, in steps. More than a
    /// half, so that a wish between two steps does not make the camera jump to and fro.
    const HYSTERESIS_STEPS: f64 = 0.7;

    /// The curve that reaches so many degrees per second at step 100.
    pub fn new(full_deg_s: f64, curve: SpeedCurve) -> Self {
        let share = |step: f64| step / Self::STEPS as f64;
        match curve {
            SpeedCurve::Linear => Self::of(0.0, |step| full_deg_s * share(step)),
            SpeedCurve::Cubic => Self::of(Self::FLOOR_DEG_S, |step| full_deg_s * share(step).powi(3)),
        }
    }

    /// The curve through rows of steps and degrees per second, a power of the step in between (a
    /// straight line on paper with logarithmic axes, which a cubic curve is too). `None` of no row.
    pub fn through(rows: &[TableRow]) -> Option<Self> {
        let rows: Vec<_> = rows.iter().filter(|row| row.step > 0.0 && row.value > 0.0).collect();
        let (first, last) = (rows.first()?, rows.last()?);
        Some(Self::of(0.0, |step| {
            let above = rows.partition_point(|row| row.step < step);
            match (above.checked_sub(1).and_then(|below| rows.get(below)), rows.get(above)) {
                (Some(low), Some(high)) => {
                    let share = (step / low.step).ln() / (high.step / low.step).ln();
                    low.value * (high.value / low.value).powf(share)
                }
                (None, _) => first.value,
                (_, None) => last.value,
            }
        }))
    }

    fn of(floor_deg_s: f64, deg_s: impl Fn(f64) -> f64) -> Self {
        let mut bare = [0.0f64; Self::STEPS + 1];
        for step in 1..bare.len() {
            let speed = deg_s(step as f64);
            // What is no number compares with nothing; and a larger step is never slower.
            bare[step] = if speed.is_finite() { speed.max(bare[step - 1]) } else { bare[step - 1] };
        }
        let mut curve = bare.map(|speed| speed.max(floor_deg_s));
        curve[0] = 0.0;
        Self { curve, bare, floor_deg_s, cap_deg_s: f64::INFINITY }
    }

    /// The same with each step's speed (by the step, 1 to 100) multiplied, as it is without the floor; it still grows,
    /// and the floor stays.
    pub fn times(&self, factor: impl Fn(f64) -> f64) -> Self {
        let times = Self::of(self.floor_deg_s, |step| self.bare[step as usize] * factor(step));
        Self { cap_deg_s: self.cap_deg_s, ..times }
    }

    /// Degrees per second of a step, 0 to 100, if there were no floor.
    pub fn bare_deg_s(&self, step: u8) -> f64 {
        self.bare[usize::from(step).min(Self::STEPS)]
    }

    /// The same, with no step faster than this.
    pub fn capped(self, cap_deg_s: f64) -> Self {
        Self { cap_deg_s, ..self }
    }

    /// Whether no step is faster than this.
    pub fn is_capped(&self, deg_s: f64) -> bool {
        deg_s.abs() >= self.cap_deg_s * (1.0 - 1e-6)
    }

    /// Degrees per second of a step.
    pub fn deg_s(&self, step: i8) -> f64 {
        let speed = self.curve[usize::from(step.unsigned_abs()).min(Self::STEPS)];
        if step == 0 { 0.0 } else { speed.min(self.cap_deg_s).copysign(f64::from(step)) }
    }

    /// The step, 0 to 100 with a fraction, that would do a speed of either sign exactly.
    pub fn ideal_step(&self, deg_s: f64) -> f64 {
        let speed = deg_s.abs().min(self.cap_deg_s);
        let above = self.curve.partition_point(|known| *known < speed);
        let (Some(below), Some(high)) = (above.checked_sub(1), self.curve.get(above)) else {
            return above.min(Self::STEPS) as f64;
        };
        let low = self.curve[below];
        below as f64 + (speed - low) / (high - low)
    }

    /// The step for a speed, given the step in force.
    pub fn step(&self, deg_s: f64, in_force: i8) -> i8 {
        // What is no number compares with nothing, and shall move nothing.
        if deg_s.is_nan() || deg_s.abs() < self.deg_s(1) / 2.0 {
            return 0;
        }
        let ideal = self.ideal_step(deg_s).copysign(deg_s);
        if in_force != 0 && (ideal - f64::from(in_force)).abs() <= Self::HYSTERESIS_STEPS {
            return in_force;
        }
        // Within -100..=100 as the ideal step is.
        (ideal.abs().round().max(1.0) as i8) * if deg_s < 0.0 { -1 } else { 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn axis_example() -> SpeedMap {
        SpeedMap::new(150.0, SpeedCurve::Cubic)
    }

    fn rows(pairs: &[(f64, f64)]) -> Vec<TableRow> {
        pairs.iter().map(|&(step, value)| TableRow { step, value }).collect()
    }

    #[test]
    fn the_cubic_map_is_axis_example() {
        for (step, speed) in [(1, 0.05), (24, 2.1), (40, 9.0), (58, 28.0), (80, 74.0), (100, 150.0)] {
            let found = axis_example().deg_s(step);
            assert!((found - speed).abs() <= 0.05 * speed + 0.2, "{step}: {found} instead of {speed}");
        }
        assert_eq!(axis_example().deg_s(0), 0.0);
        assert_eq!(axis_example().step(0.0, 5), 0);
        assert_eq!(axis_example().step(f64::NAN, 5), 0);
        assert_eq!(axis_example().step(f64::INFINITY, 5), 100);
    }

    #[test]
    fn a_told_table_is_met_at_its_rows_and_a_power_in_between() {
        let map = SpeedMap::through(&rows(&[(1.0, 0.05), (40.0, 9.0), (100.0, 150.0)])).unwrap();
        for (step, speed) in [(1, 0.05), (40, 9.0), (-100, -150.0)] {
            assert!((map.deg_s(step) - speed).abs() < 1e-9, "{step}: {}", map.deg_s(step));
        }
        let cubic = SpeedMap::through(&rows(&[(10.0, 0.15), (100.0, 150.0)])).unwrap();
        assert!((cubic.deg_s(50) - 18.75).abs() < 1e-9, "{}", cubic.deg_s(50));
        assert_eq!(cubic.deg_s(5), 0.15);
        assert_eq!(SpeedMap::through(&[]), None);
        assert_eq!(SpeedMap::through(&rows(&[(0.0, 0.0)])), None);
    }

    #[test]
    fn proportional_speed_caps() {
        let map = axis_example().capped(6.4);
        assert_eq!(map.deg_s(-100), -6.4);
        assert_eq!(map.step(100.0, 0), map.step(6.4, 0));
    }

    #[test]
    fn a_wish_between_two_steps_keeps_the_one_in_force() {
        let linear = SpeedMap::new(100.0, SpeedCurve::Linear);
        assert_eq!(linear.step(10.6, 10), 10);
        assert_eq!(linear.step(10.4, 11), 11);
        assert_eq!(linear.step(10.8, 10), 11);
        assert_eq!(linear.step(-10.6, 10), -11);
    }

    #[test]
    fn a_floor_is_no_part_of_the_curve() {
        let linear = SpeedMap::new(450.0, SpeedCurve::Cubic).times(|step| (100.0 / step).powi(2));
        assert!((1..=100).all(|step| (linear.deg_s(step) - 4.5 * f64::from(step)).abs() < 1e-9));
        let slow = SpeedMap::new(450.0, SpeedCurve::Cubic).times(|_| 1e-3);
        assert_eq!(slow.deg_s(1), SpeedMap::FLOOR_DEG_S);
        assert!((slow.deg_s(100) - 0.45).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn steps_come_back(step in -100i8..=100, cubic: bool, full in 10.0..500.0f64, tilt in -2.0..1.0f64) {
            let curve = if cubic { SpeedCurve::Cubic } else { SpeedCurve::Linear };
            let map = SpeedMap::new(full, curve).times(|step| (step / 50.0).powf(tilt));
            let speed = map.deg_s(step);
            prop_assert!((map.deg_s(map.step(speed, 0)) - speed).abs() < 1e-6);
        }

        #[test]
        fn steps_stay_in_range(speed in any::<f64>(), in_force in -100i8..=100) {
            prop_assert!((-100..=100).contains(&axis_example().step(speed, in_force)));
        }

        #[test]
        fn a_larger_step_is_never_slower(factors in prop::collection::vec(prop_oneof![0.01..10.0f64, Just(f64::NAN)], 101)) {
            let map = axis_example().times(|step| factors[step as usize]);
            prop_assert!((1..=100).all(|step| map.deg_s(step - 1) <= map.deg_s(step)));
        }
    }
}
