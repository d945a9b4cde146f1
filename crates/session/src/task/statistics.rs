// SPDX-License-Identifier: MPL-2.0

use std::time::{Duration, Instant};

use servo::Estimates;

use super::DeadManState;
use crate::session::Forbidden;
use crate::{Status, Stop};

/// What was exchanged with the camera, and what it is known to do.
#[derive(Debug, Clone, Default)]
pub struct Statistics {
    /// The camera as it is known.
    pub status: Status,
    /// What the camera is taken for by now.
    pub estimates: Option<Estimates>,
    /// What ends the last move.
    pub stop: Option<Stop>,
    /// The camera does not rest for good: it moves, or something unanswered may set it going.
    pub may_yet_move: bool,
    /// Commands that the camera accepted.
    pub sent: u64,
    /// Commands that it did not.
    pub failed: u64,
    /// Pictures of the target that were overtaken by newer ones before they could be steered by.
    pub coalesced: u64,
    /// How long the camera took to accept the last command.
    pub round_trip: Duration,
    /// The same, over about the last eight.
    pub round_trip_average: Duration,
    /// What went wrong last, in words.
    pub last_error: Option<String>,
    /// Nothing more may be sent until a setting changes.
    pub halted: bool,
    /// How whoever moved the camera is refused, and until when he is to wait: whoever speaks next as the same user waits, too.
    pub forbidden: Option<(Forbidden, Instant)>,
    /// How it stands with the watchdog.
    pub dead_man: DeadManState,
}

impl Statistics {
    /// A command was accepted after this time.
    pub fn succeeded(&mut self, round_trip: Duration) {
        self.sent += 1;
        self.round_trip = round_trip;
        // Over about the last eight.
        let average = if self.sent == 1 { round_trip } else { self.round_trip_average };
        self.round_trip_average = (average * 7 + round_trip) / 8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_average_follows_the_round_trips() {
        let mut statistics = Statistics::default();
        statistics.succeeded(Duration::from_millis(80));
        assert_eq!(statistics.round_trip_average, Duration::from_millis(80));
        statistics.succeeded(Duration::from_millis(160));
        assert_eq!(statistics.round_trip_average, Duration::from_millis(90));
    }
}
