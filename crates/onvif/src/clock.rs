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
        Self::ahead_by(0)
    }

    /// It shows so many seconds more than this machine's does.
    pub fn ahead_by(seconds: i64) -> Self {
        Self::showing(ours_s().saturating_add(seconds))
    }

    /// By how many seconds it is ahead of this machine's.
    pub fn ahead_s(&self) -> i64 {
        self.now_s().saturating_sub(ours_s())
    }

    /// What it shows now, such as `2026-11-24T20:00:00Z`.
    pub fn now(&self) -> String {
        let time = DateTime::from_timestamp(self.now_s(), 0).unwrap_or_default();
        time.format("%Y-%m-%dT%H:%M:%SZ").to_string()
    }

    fn now_s(&self) -> i64 {
        let passed = i64::try_from(self.at.elapsed().as_secs()).unwrap_or(0);
        self.unix_s.saturating_add(passed)
    }
}

/// Seconds since 1970 by this machine's clock.
fn ours_s() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_secs()).unwrap_or(0)
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

    #[test]
    fn another_process_knows_it_by_how_far_it_is_ahead() {
        for ahead_s in [-3600, 0, 3600] {
            // A second may begin in between.
            assert!((CameraClock::ahead_by(ahead_s).ahead_s() - ahead_s).abs() <= 1);
        }
    }
}
