// SPDX-License-Identifier: MPL-2.0

//! VAPIX counts in steps: speeds from -100 to 100, the zoom from 1 to 9999, or to 19999 with digital zoom (Axis, "VAPIX
//! Pan/tilt/zoom API").

use session::ZoomStep;

const FASTEST_STEP: f64 = 100.0;

/// The step of a part of the fastest, -1 to 1.
pub(crate) fn speed_step(part: f64) -> i8 {
    // Within -100..=100.
    (part.clamp(-1.0, 1.0) * FASTEST_STEP).round() as i8
}

/// The part of the fastest that a step is.
pub(crate) fn part_of_fastest(step: f64) -> f64 {
    step / FASTEST_STEP
}

/// The part of the optical zoom's travel that a step is.
pub(crate) fn travel(step: f64) -> f64 {
    ZoomStep(step).travel()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_come_back() {
        assert!((-100..=100).all(|step: i8| speed_step(part_of_fastest(step.into())) == step));
        assert_eq!(speed_step(3.0), 100);
    }
}
