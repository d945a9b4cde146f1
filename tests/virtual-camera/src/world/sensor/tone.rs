// SPDX-License-Identifier: MPL-2.0

//! The tone curve: from light to the numbers of video and back (Rec. ITU-R BT.709, section 1.2).

/// From here on bright places are compressed instead of cut off.
const KNEE: f64 = 0.85;

/// Light, 1 being white, of a signal from 0 to 1.
pub(super) fn light(signal: f64) -> f64 {
    if signal < 0.081 { signal / 4.5 } else { ((signal + 0.099) / 1.099).powf(1.0 / 0.45) }
}

/// The signal of so much light; what is brighter than white comes close to 1.
pub(super) fn signal(light: f64) -> f64 {
    let signal = if light < 0.018 { 4.5 * light } else { 1.099 * light.powf(0.45) - 0.099 };
    let over = (signal - KNEE).max(0.0) / (1.0 - KNEE);
    signal.min(KNEE) + (1.0 - KNEE) * (1.0 - (-over).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_that_of_the_standard_up_to_its_knee() {
        for (linear, coded) in [(0.0, 0.0), (0.01, 0.045), (0.018, 0.081), (0.18, 0.409), (0.5, 0.705)] {
            assert!((signal(linear) - coded).abs() < 1e-3, "{linear} {}", signal(linear));
            assert!((light(coded) - linear).abs() < 1e-3, "{coded} {}", light(coded));
        }
        assert!((0.93..1.0).contains(&signal(1.0)) && (0.99..=1.0).contains(&signal(3.0)));
    }
}
