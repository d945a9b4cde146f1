// SPDX-License-Identifier: MPL-2.0

//! Numbers as people write them.

use std::time::Duration;

/// What [`duration`] takes, in words.
pub const DURATION: &str = "a duration such as \"2s\", \"500ms\", \"10min\", \"12h\" or \"7d\"";

/// What [`bytes`] takes, in words.
pub const BYTES: &str = "a size such as \"500MB\", \"20GB\" or \"2TB\"";

const DURATIONS: [(&str, f64); 6] =
    [("ms", 0.001), ("s", 1.0), ("min", 60.0), ("m", 60.0), ("h", 3600.0), ("d", 86_400.0)];
const SIZES: [(&str, f64); 5] = [("B", 1.0), ("kB", 1e3), ("MB", 1e6), ("GB", 1e9), ("TB", 1e12)];

/// A number and its unit.
pub fn duration(text: &str) -> Option<Duration> {
    Duration::try_from_secs_f64(number(text, &DURATIONS)?).ok()
}

/// Bytes, from a number and its unit.
pub fn bytes(text: &str) -> Option<u64> {
    // Beyond 2⁵³ no folder grows.
    number(text, &SIZES).filter(|bytes| *bytes < 9e15).map(|bytes| bytes as u64)
}

fn number(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let (number, unit) = (text[..end].parse::<f64>().ok()?, text[end..].trim());
    units.iter().find(|(name, _)| *name == unit).map(|(_, factor)| number * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_a_number_and_a_unit() {
        assert_eq!(duration("2s"), Some(Duration::from_secs(2)));
        assert_eq!(duration("500ms"), Some(Duration::from_millis(500)));
        assert_eq!(duration("1.5 h"), Some(Duration::from_secs(5400)));
        for wrong in ["", "2", "s", "-2s", "2 weeks", "1e400s", "."] {
            assert_eq!(duration(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn sizes_are_a_number_and_a_unit() {
        assert_eq!(bytes("20GB"), Some(20_000_000_000));
        assert_eq!(bytes("20"), None);
        assert_eq!(bytes("20 gigs"), None);
    }
}
