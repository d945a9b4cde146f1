// SPDX-License-Identifier: MPL-2.0

//! VAPIX counts in steps: speeds from -100 to 100, the zoom from 1 to 9999, or to 19999 with digital zoom (Axis, "VAPIX
//! Pan/tilt/zoom API").

const FASTEST_STEP: f64 = 100.0;
const FIRST_ZOOM_STEP: f64 = 1.0;
/// The end of the optical zoom.
const LAST_ZOOM_STEP: f64 = 9999.0;

/// The step of a part of the fastest, -1 to 1.
pub(crate) fn speed_step(part: f64) -> i8 {
    // Within -100..=100.
    (part.clamp(-1.0, 1.0) * FASTEST_STEP).round() as i8
}

/// The part of the fastest that a step is.
pub(crate) fn part_of_fastest(step: f64) -> f64 {
    step / FASTEST_STEP
}

/// The step of a part of the optical zoom's travel, 0 to 1.
pub(crate) fn zoom_step(travel: f64) -> u16 {
    // Within 1..=9999.
    (FIRST_ZOOM_STEP + travel.clamp(0.0, 1.0) * (LAST_ZOOM_STEP - FIRST_ZOOM_STEP)).round() as u16
}

/// The part of the optical zoom's travel that a step is.
pub(crate) fn travel(step: f64) -> f64 {
    (step - FIRST_ZOOM_STEP) / (LAST_ZOOM_STEP - FIRST_ZOOM_STEP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_come_back() {
        assert!((-100..=100).all(|step: i8| speed_step(part_of_fastest(step.into())) == step));
        assert!((1..=9999).all(|step: u16| zoom_step(travel(step.into())) == step));
        assert_eq!((speed_step(3.0), zoom_step(-1.0), zoom_step(2.0)), (100, 1, 9999));
    }
}
