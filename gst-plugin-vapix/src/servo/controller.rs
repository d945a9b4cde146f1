use super::PanTilt;

/// Proportional control with feed-forward and a dead zone, each axis for itself.
#[derive(Debug, Default)]
pub struct Controller {
    pan: Axis,
    tilt: Axis,
}

impl Controller {
    /// The rate that brings the error to zero within about 1/gain while the target moves on.
    ///
    /// `gain` in 1/s; `dead_zone_deg` is the error an axis at rest tolerates; neither axis exceeds `max_deg_s`.
    pub fn rate(
        &mut self,
        error: PanTilt,
        target: PanTilt,
        gain: f64,
        dead_zone_deg: f64,
        max_deg_s: f64,
    ) -> PanTilt {
        let rate = PanTilt {
            pan: self.pan.rate(error.pan, target.pan, gain, dead_zone_deg),
            tilt: self.tilt.rate(error.tilt, target.tilt, gain, dead_zone_deg),
        };
        PanTilt::new(rate.pan.clamp(-max_deg_s, max_deg_s), rate.tilt.clamp(-max_deg_s, max_deg_s))
    }

    /// Both axes at rest.
    pub fn rest(&mut self) {
        *self = Self::default();
    }
}

#[derive(Debug, Default)]
struct Axis {
    moving: bool,
}

impl Axis {
    fn rate(&mut self, error_deg: f64, target_deg_s: f64, gain: f64, dead_zone_deg: f64) -> f64 {
        if self.moving {
            // Rests again well inside the zone, and only for a target that would not leave it within a second.
            self.moving = error_deg.abs() > dead_zone_deg / 2.0 || target_deg_s.abs() > dead_zone_deg / 2.0;
        } else {
            self.moving = error_deg.abs() > dead_zone_deg;
        }
        if self.moving { gain * error_deg + target_deg_s } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn still() -> PanTilt {
        PanTilt::default()
    }

    #[test]
    fn a_centred_target_moves_nothing_and_an_axis_moves_alone() {
        let mut controller = Controller::default();
        assert_eq!(controller.rate(PanTilt::new(0.9, -0.9), still(), 2.0, 1.0, 100.0), still());
        assert_eq!(controller.rate(PanTilt::new(3.0, 0.9), still(), 2.0, 1.0, 100.0), PanTilt::new(6.0, 0.0));
    }

    #[test]
    fn the_dead_zone_has_hysteresis() {
        let mut controller = Controller::default();
        let mut pan = |error| controller.rate(PanTilt::new(error, 0.0), still(), 1.0, 1.0, 100.0).pan;
        assert_eq!(pan(0.9), 0.0);
        assert_eq!(pan(1.1), 1.1);
        assert_eq!(pan(0.6), 0.6);
        assert_eq!(pan(0.4), 0.0);
        assert_eq!(pan(0.9), 0.0);
    }

    #[test]
    fn a_walking_target_is_followed_through_the_middle() {
        let mut controller = Controller::default();
        let walking = PanTilt::new(5.0, 0.0);
        assert!(controller.rate(PanTilt::new(2.0, 0.0), walking, 1.0, 1.0, 100.0).pan > 0.0);
        assert_eq!(controller.rate(still(), walking, 1.0, 1.0, 100.0).pan, 5.0);
    }

    proptest! {
        #[test]
        fn no_axis_exceeds_the_maximum(pan in -180.0..180.0f64, tilt in -90.0..90.0f64, max in 0.1..200.0f64) {
            let rate = Controller::default().rate(PanTilt::new(pan, tilt), still(), 10.0, 0.5, max);
            prop_assert!(rate.largest() <= max);
        }
    }
}
