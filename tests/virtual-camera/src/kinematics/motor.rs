// SPDX-License-Identifier: MPL-2.0

//! One axis: a position that changes no faster than its motor can.

/// What a motor is told to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Drive {
    /// Keep this rate, in units per second, until told otherwise.
    Rate(f64),
    /// Go to a position and stop there.
    Position {
        /// Where to.
        target: f64,
        /// Units per second on the way.
        speed: f64,
    },
}

/// One axis, in degrees or zoom steps.
#[derive(Debug, Clone)]
pub(crate) struct Motor {
    pub position: f64,
    pub rate: f64,
    pub drive: Drive,
    pub range: (f64, f64),
    /// Units per second squared.
    pub acceleration: f64,
}

impl Motor {
    pub fn at(position: f64, range: (f64, f64), acceleration: f64) -> Self {
        let position = position.clamp(range.0, range.1);
        Self { position, rate: 0.0, drive: Drive::Rate(0.0), range, acceleration }
    }

    pub fn go_to(&mut self, target: f64, speed: f64) {
        self.drive = Drive::Position { target: target.clamp(self.range.0, self.range.1), speed };
    }

    /// Whether nothing will change until it is told something else.
    pub fn is_idle(&self) -> bool {
        self.rate == 0.0 && self.drive == Drive::Rate(0.0)
    }

    /// Lets `dt` seconds pass.
    pub fn step(&mut self, dt: f64) {
        let target = match self.drive {
            Drive::Rate(rate) if rate < 0.0 => self.range.0,
            Drive::Rate(_) => self.range.1,
            Drive::Position { target, .. } => target,
        };
        let gap = target - self.position;
        let speed = match self.drive {
            Drive::Rate(rate) => rate.abs(),
            Drive::Position { speed, .. } => speed,
        };
        // The fastest from which it can still brake in time, one step ahead.
        let room = (gap.abs() - self.rate.abs() * dt).max(0.0);
        let wanted = speed.min((2.0 * self.acceleration * room).sqrt()).copysign(gap);
        let change = self.acceleration * dt;
        self.rate += (wanted - self.rate).clamp(-change, change);
        self.position += self.rate * dt;
        self.arrive(target, dt);
    }

    fn arrive(&mut self, target: f64, dt: f64) {
        let change = self.acceleration * dt;
        let near = (target - self.position).abs() <= 2.0 * change * dt && self.rate.abs() <= 2.0 * change;
        if near && matches!(self.drive, Drive::Position { .. }) {
            (self.position, self.rate, self.drive) = (target, 0.0, Drive::Rate(0.0));
        }
        let inside = self.position.clamp(self.range.0, self.range.1);
        if inside != self.position {
            (self.position, self.rate) = (inside, 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.002;

    fn run(motor: &mut Motor, seconds: f64) {
        for _ in 0..(seconds / DT).round() as u32 {
            motor.step(DT);
        }
    }

    #[test]
    fn a_rate_is_reached_by_the_acceleration_and_kept() {
        let mut motor = Motor::at(0.0, (-180.0, 180.0), 100.0);
        motor.drive = Drive::Rate(20.0);
        run(&mut motor, 0.1);
        assert!((motor.rate - 10.0).abs() < 1e-9, "{}", motor.rate);
        run(&mut motor, 0.9);
        assert!((motor.rate - 20.0).abs() < 1e-9);
        // One second at 20 less the ramp: 20 * 1 - 20²/(2*100).
        assert!((motor.position - 18.0).abs() < 0.05, "{}", motor.position);
        motor.drive = Drive::Rate(0.0);
        run(&mut motor, 0.21);
        assert!(motor.is_idle());
        assert!((motor.position - 20.0).abs() < 0.1, "{}", motor.position);
    }

    #[test]
    fn a_position_is_reached_exactly_without_overshoot() {
        for target in [90.0, -37.5, 0.01, 179.99] {
            let mut motor = Motor::at(0.0, (-180.0, 180.0), 400.0);
            motor.go_to(target, 450.0);
            for _ in 0..2000 {
                motor.step(DT);
                assert!(motor.position.abs() <= target.abs() + 0.01, "{} past {target}", motor.position);
                assert!(motor.rate.abs() <= 450.0 + 1e-9);
            }
            assert!(motor.is_idle(), "{motor:?}");
            assert_eq!(motor.position, target);
        }
    }

    #[test]
    fn a_limit_holds_and_the_other_way_is_free() {
        let mut motor = Motor::at(5.0, (-10.0, 10.0), 400.0);
        motor.drive = Drive::Rate(100.0);
        for _ in 0..1000 {
            motor.step(DT);
            assert!(motor.position <= 10.0);
        }
        assert!((motor.position - 10.0).abs() < 0.01, "{}", motor.position);
        assert!(motor.rate < 1.0);
        assert!(!motor.is_idle(), "a move into the limit is still in force");
        motor.drive = Drive::Rate(-10.0);
        run(&mut motor, 0.5);
        assert!(motor.position < 6.0);
    }

    #[test]
    fn a_target_out_of_range_is_clamped() {
        let mut motor = Motor::at(50.0, (-10.0, 10.0), 400.0);
        assert_eq!(motor.position, 10.0);
        motor.go_to(-500.0, 100.0);
        run(&mut motor, 2.0);
        assert_eq!((motor.position, motor.rate), (-10.0, 0.0));
    }
}
