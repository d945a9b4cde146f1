/// How a camera's speed grows with the speed step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SpeedCurve {
    /// In proportion to the step.
    Linear,
    /// By the cube of the step, as in Axis' example table (24: 2.1, 40: 9, 58: 28, 80: 74, 100: 150 deg/s).
    #[default]
    Cubic,
}

/// VAPIX speed steps (-100 to 100) and degrees per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedMap {
    /// Degrees per second at step 100.
    pub full_deg_s: f64,
    /// How it grows up to there.
    pub curve: SpeedCurve,
    /// Degrees per second that no step exceeds (proportional speed), or infinity.
    pub cap_deg_s: f64,
}

impl SpeedMap {
    /// Slowest motion of the domes whose tables are known.
    const FLOOR_DEG_S: f64 = 0.05;

    /// How far a wish may lie from the step in force before another is chosen, in steps. More than a
    /// half, so that a wish between two steps does not make the camera jump to and fro.
    const HYSTERESIS_STEPS: f64 = 0.7;

    /// Degrees per second of a step.
    pub fn deg_s(&self, step: i8) -> f64 {
        let share = f64::from(step.unsigned_abs().min(100)) / 100.0;
        let speed = match self.curve {
            _ if step == 0 => return 0.0,
            SpeedCurve::Linear => self.full_deg_s * share,
            SpeedCurve::Cubic => (self.full_deg_s * share.powi(3)).max(Self::FLOOR_DEG_S),
        };
        speed.min(self.cap_deg_s).copysign(f64::from(step))
    }

    /// The step for a speed, given the step in force.
    pub fn step(&self, deg_s: f64, in_force: i8) -> i8 {
        let speed = deg_s.abs().min(self.cap_deg_s);
        // What is no number compares with nothing, and shall move nothing.
        if deg_s.is_nan() || speed < self.deg_s(1) / 2.0 {
            return 0;
        }
        let share = (speed / self.full_deg_s).min(1.0);
        let ideal = match self.curve {
            SpeedCurve::Linear => share * 100.0,
            SpeedCurve::Cubic if speed <= Self::FLOOR_DEG_S => 1.0,
            SpeedCurve::Cubic => share.cbrt() * 100.0,
        }
        .copysign(deg_s);
        if in_force != 0 && (ideal - f64::from(in_force)).abs() <= Self::HYSTERESIS_STEPS {
            return in_force;
        }
        // Within -100..=100 by `share`.
        (ideal.abs().round().max(1.0) as i8) * if deg_s < 0.0 { -1 } else { 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AXIS_EXAMPLE: SpeedMap =
        SpeedMap { full_deg_s: 150.0, curve: SpeedCurve::Cubic, cap_deg_s: f64::INFINITY };

    #[test]
    fn the_cubic_map_is_axis_example() {
        for (step, speed) in [(1, 0.05), (24, 2.1), (40, 9.0), (58, 28.0), (80, 74.0), (100, 150.0)] {
            let found = AXIS_EXAMPLE.deg_s(step);
            assert!((found - speed).abs() <= 0.05 * speed + 0.2, "{step}: {found} instead of {speed}");
        }
        assert_eq!(AXIS_EXAMPLE.deg_s(0), 0.0);
        assert_eq!(AXIS_EXAMPLE.step(0.0, 5), 0);
        assert_eq!(AXIS_EXAMPLE.step(f64::NAN, 5), 0);
    }

    #[test]
    fn proportional_speed_caps() {
        let map = SpeedMap { cap_deg_s: 6.4, ..AXIS_EXAMPLE };
        assert_eq!(map.deg_s(-100), -6.4);
        assert_eq!(map.step(100.0, 0), map.step(6.4, 0));
    }

    #[test]
    fn a_wish_between_two_steps_keeps_the_one_in_force() {
        let linear = SpeedMap { full_deg_s: 100.0, curve: SpeedCurve::Linear, cap_deg_s: f64::INFINITY };
        assert_eq!(linear.step(10.6, 10), 10);
        assert_eq!(linear.step(10.4, 11), 11);
        assert_eq!(linear.step(10.8, 10), 11);
        assert_eq!(linear.step(-10.6, 10), -11);
    }

    proptest! {
        #[test]
        fn steps_come_back(step in -100i8..=100, cubic: bool, full in 10.0..500.0f64) {
            let curve = if cubic { SpeedCurve::Cubic } else { SpeedCurve::Linear };
            let map = SpeedMap { full_deg_s: full, curve, cap_deg_s: f64::INFINITY };
            let speed = map.deg_s(step);
            prop_assert!((map.deg_s(map.step(speed, 0)) - speed).abs() < 1e-6);
        }

        #[test]
        fn steps_stay_in_range(speed in any::<f64>(), in_force in -100i8..=100) {
            prop_assert!((-100..=100).contains(&AXIS_EXAMPLE.step(speed, in_force)));
        }
    }
}
