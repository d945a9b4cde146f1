// SPDX-License-Identifier: MPL-2.0

//! The camera's time, by which it judges tokens.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

use chrono::DateTime;

/// What the camera's clock showed at some moment.
#[derive(Debug, Clone, Copy)]
pub struct CameraClock {
    unix_s: i64,
    at: Instant,
}

impl CameraClock {
    /// It showed this just now, seconds since 1970.
    pub fn showing(unix_s: i64) -> Self {
        Self { unix_s, at: Instant::now() }
    }

    /// Of a camera that does not tell: it is taken to be right.
    pub fn assumed() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self::showing(i64::try_from(since.as_secs()).unwrap_or(0))
    }

    /// What it shows now, such as `2026-11-24T20:00:00Z`.
    pub fn now(&self) -> String {
        let passed = i64::try_from(self.at.elapsed().as_secs()).unwrap_or(0);
        let time = DateTime::from_timestamp(self.unix_s.saturating_add(passed), 0).unwrap_or_default();
        time.format("%Y-%m-%dT%H:%M:%SZ").to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_on_from_what_it_showed() {
        let clock =
            CameraClock { unix_s: 1_284_623_445 - 3, at: Instant::now() - std::time::Duration::from_secs(3) };
        assert_eq!(clock.now(), "2010-09-16T07:50:45Z");
    }
}
