// SPDX-License-Identifier: MPL-2.0

use super::TableRow;

/// How a camera's speed grows with the part of its fastest that it is told.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SpeedCurve {
    /// In proportion to the part.
    Linear,
    /// By the cube of the part, as domes do that are to be fine where they are slow (0.24: 2.1, 0.4: 9, 0.58: 28, 0.8: 74, 1: 150 deg/s).
    #[default]
    Cubic,
}

/// Parts of a camera's fastest, and degrees per second: any growing curve, the same both ways. Known at a hundred levels, each a
/// hundredth of the fastest more than the one below: what is told by levels is not told anew for nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedMap {
    /// Degrees per second of the levels 0 to 100.
    curve: [f64; Self::LEVELS + 1],
    /// The same without the floor.
    bare: [f64; Self::LEVELS + 1],
    /// Degrees per second that every level does at least.
    floor_deg_s: f64,
    /// Degrees per second that no level exceeds (proportional speed), or infinity.
    cap_deg_s: f64,
}

impl SpeedMap {
    const LEVELS: usize = 100;

    /// Slowest motion of the domes whose tables are known.
    const FLOOR_DEG_S: f64 = 0.05;

    /// How far a wish may lie from the level in force before another is chosen, in levels. More than a
    /// half, so that a wish between two levels does not make the camera jump to and fro.
    const HYSTERESIS: f64 = 0.7;

    /// The curve that reaches so many degrees per second at the fastest.
    pub fn new(full_deg_s: f64, curve: SpeedCurve) -> Self {
        match curve {
            SpeedCurve::Linear => Self::of(0.0, |part| full_deg_s * part),
            SpeedCurve::Cubic => Self::of(Self::FLOOR_DEG_S, |part| full_deg_s * part.powi(3)),
        }
    }

    /// The curve through rows of parts and degrees per second, a power of the part in between (a
    /// straight line on paper with logarithmic axes, which a cubic curve is too). `None` of no row.
    pub fn through(rows: &[TableRow]) -> Option<Self> {
        let rows: Vec<_> = rows.iter().filter(|row| row.setting > 0.0 && row.value > 0.0).collect();
        let (first, last) = (rows.first()?, rows.last()?);
        Some(Self::of(0.0, |part| {
            let above = rows.partition_point(|row| row.setting < part);
            match (above.checked_sub(1).and_then(|below| rows.get(below)), rows.get(above)) {
                (Some(low), Some(high)) => {
                    let share = (part / low.setting).ln() / (high.setting / low.setting).ln();
                    low.value * (high.value / low.value).powf(share)
                }
                (None, _) => first.value,
                (_, None) => last.value,
            }
        }))
    }

    fn of(floor_deg_s: f64, deg_s: impl Fn(f64) -> f64) -> Self {
        let mut bare = [0.0f64; Self::LEVELS + 1];
        for level in 1..bare.len() {
            let speed = deg_s(level as f64 / Self::LEVELS as f64);
            // What is no number compares with nothing; and a larger part is never slower.
            bare[level] = if speed.is_finite() { speed.max(bare[level - 1]) } else { bare[level - 1] };
        }
        let mut curve = bare.map(|speed| speed.max(floor_deg_s));
        curve[0] = 0.0;
        Self { curve, bare, floor_deg_s, cap_deg_s: f64::INFINITY }
    }

    /// The same with each level's speed (by the level, 1 to 100) multiplied, as it is without the floor; it still grows,
    /// and the floor stays.
    pub fn times(&self, factor: impl Fn(i8) -> f64) -> Self {
        let times = Self::of(self.floor_deg_s, |part| {
            let level = Self::level_of(part);
            self.bare_deg_s(level.unsigned_abs()) * factor(level)
        });
        Self { cap_deg_s: self.cap_deg_s, ..times }
    }

    /// The level of a part of the fastest.
    pub fn level_of(part: f64) -> i8 {
        // Within -100..=100.
        (part.clamp(-1.0, 1.0) * Self::LEVELS as f64).round() as i8
    }

    /// The part of the fastest that a level is.
    pub fn part(level: i8) -> f64 {
        f64::from(level) / Self::LEVELS as f64
    }

    /// Degrees per second of a level, 0 to 100, if there were no floor.
    pub fn bare_deg_s(&self, level: u8) -> f64 {
        self.bare[usize::from(level).min(Self::LEVELS)]
    }

    /// The same, with nothing faster than this.
    pub fn capped(self, cap_deg_s: f64) -> Self {
        Self { cap_deg_s, ..self }
    }

    /// Whether nothing is faster than this.
    pub fn is_capped(&self, deg_s: f64) -> bool {
        deg_s.abs() >= self.cap_deg_s * (1.0 - 1e-6)
    }

    /// Degrees per second of a level.
    pub fn deg_s(&self, level: i8) -> f64 {
        let speed = self.curve[usize::from(level.unsigned_abs()).min(Self::LEVELS)];
        if level == 0 { 0.0 } else { speed.min(self.cap_deg_s).copysign(f64::from(level)) }
    }

    /// The level, 0 to 100 with a fraction, that would do a speed of either sign exactly.
    fn ideal_level(&self, deg_s: f64) -> f64 {
        let speed = deg_s.abs().min(self.cap_deg_s);
        let above = self.curve.partition_point(|known| *known < speed);
        let (Some(below), Some(high)) = (above.checked_sub(1), self.curve.get(above)) else {
            return above.min(Self::LEVELS) as f64;
        };
        let low = self.curve[below];
        below as f64 + (speed - low) / (high - low)
    }

    /// The level for a speed, given the level in force.
    pub fn level(&self, deg_s: f64, in_force: i8) -> i8 {
        // What is no number compares with nothing, and shall move nothing.
        if deg_s.is_nan() || deg_s.abs() < self.deg_s(1) / 2.0 {
            return 0;
        }
        let ideal = self.ideal_level(deg_s).copysign(deg_s);
        if in_force != 0 && (ideal - f64::from(in_force)).abs() <= Self::HYSTERESIS {
            return in_force;
        }
        // Within -100..=100 as the ideal level is.
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
        pairs.iter().map(|&(level, value)| TableRow { setting: level / 100.0, value }).collect()
    }

    #[test]
    fn the_cubic_map_is_axis_example() {
        for (level, speed) in [(1, 0.05), (24, 2.1), (40, 9.0), (58, 28.0), (80, 74.0), (100, 150.0)] {
            let found = axis_example().deg_s(level);
            assert!((found - speed).abs() <= 0.05 * speed + 0.2, "{level}: {found} instead of {speed}");
        }
        assert_eq!(axis_example().deg_s(0), 0.0);
        assert_eq!(axis_example().level(0.0, 5), 0);
        assert_eq!(axis_example().level(f64::NAN, 5), 0);
        assert_eq!(axis_example().level(f64::INFINITY, 5), 100);
    }

    #[test]
    fn a_told_table_is_met_at_its_rows_and_a_power_in_between() {
        let map = SpeedMap::through(&rows(&[(1.0, 0.05), (40.0, 9.0), (100.0, 150.0)])).unwrap();
        for (level, speed) in [(1, 0.05), (40, 9.0), (-100, -150.0)] {
            assert!((map.deg_s(level) - speed).abs() < 1e-9, "{level}: {}", map.deg_s(level));
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
        assert_eq!(map.level(100.0, 0), map.level(6.4, 0));
    }

    #[test]
    fn a_wish_between_two_levels_keeps_the_one_in_force() {
        let linear = SpeedMap::new(100.0, SpeedCurve::Linear);
        assert_eq!(linear.level(10.6, 10), 10);
        assert_eq!(linear.level(10.4, 11), 11);
        assert_eq!(linear.level(10.8, 10), 11);
        assert_eq!(linear.level(-10.6, 10), -11);
    }

    #[test]
    fn a_floor_is_no_part_of_the_curve() {
        let linear =
            SpeedMap::new(450.0, SpeedCurve::Cubic).times(|level| (100.0 / f64::from(level)).powi(2));
        assert!((1..=100).all(|level| (linear.deg_s(level) - 4.5 * f64::from(level)).abs() < 1e-9));
        let slow = SpeedMap::new(450.0, SpeedCurve::Cubic).times(|_| 1e-3);
        assert_eq!(slow.deg_s(1), SpeedMap::FLOOR_DEG_S);
        assert!((slow.deg_s(100) - 0.45).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn levels_come_back(level in -100i8..=100, cubic: bool, full in 10.0..500.0f64, tilt in -2.0..1.0f64) {
            let curve = if cubic { SpeedCurve::Cubic } else { SpeedCurve::Linear };
            let map = SpeedMap::new(full, curve).times(|level| (f64::from(level) / 50.0).powf(tilt));
            let speed = map.deg_s(level);
            prop_assert!((map.deg_s(map.level(speed, 0)) - speed).abs() < 1e-6);
        }

        #[test]
        fn levels_stay_in_range(speed in any::<f64>(), in_force in -100i8..=100) {
            prop_assert!((-100..=100).contains(&axis_example().level(speed, in_force)));
        }

        #[test]
        fn a_larger_part_is_never_slower(factors in prop::collection::vec(prop_oneof![0.01..10.0f64, Just(f64::NAN)], 101)) {
            let map = axis_example().times(|level| factors[level as usize]);
            prop_assert!((1..=100).all(|level| map.deg_s(level - 1) <= map.deg_s(level)));
        }
    }
}
