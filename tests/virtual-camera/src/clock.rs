// SPDX-License-Identifier: MPL-2.0

//! The camera's time.

use std::{
    sync::{Mutex, OnceLock},
    time::{Duration, Instant},
};

use crate::{settings::Clock, sync::lock};

/// How late it is for the camera.
#[derive(Debug)]
pub(crate) struct Time {
    /// The real time at which the camera's began to run by itself; a stepped one does so at the end.
    running_since: OnceLock<Instant>,
    /// What was reached by steps.
    stepped_to: Mutex<Duration>,
}

impl Time {
    pub fn new(clock: Clock) -> Self {
        let time = Self { running_since: OnceLock::new(), stepped_to: Mutex::default() };
        if clock == Clock::Real {
            time.run();
        }
        time
    }

    /// Time since the start.
    pub fn now(&self) -> Duration {
        let running = self.running_since.get().map(Instant::elapsed).unwrap_or_default();
        *lock(&self.stepped_to) + running
    }

    /// Whether time goes on by itself.
    pub fn runs(&self) -> bool {
        self.running_since.get().is_some()
    }

    /// Steps on to `time`. Time never goes back, and what runs by itself is not pushed.
    pub fn advance_to(&self, time: Duration) {
        if !self.runs() {
            let mut now = lock(&self.stepped_to);
            *now = time.max(*now);
        }
    }

    /// Lets time go on by itself from now on, for whoever still waits for a moment that nobody steps to any more.
    pub fn run(&self) {
        self.running_since.get_or_init(Instant::now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(40);

    #[test]
    fn stepped_time_stands_until_it_is_told() {
        let time = Time::new(Clock::Stepped);
        assert_eq!((time.now(), time.runs()), (Duration::ZERO, false));
        time.advance_to(3 * STEP);
        assert_eq!(time.now(), 3 * STEP);
        time.advance_to(STEP);
        assert_eq!(time.now(), 3 * STEP, "it never goes back");
        time.run();
        assert!(time.runs() && time.now() >= 3 * STEP);
    }

    #[test]
    fn real_time_is_not_pushed() {
        let time = Time::new(Clock::Real);
        time.advance_to(Duration::from_secs(1_000_000));
        assert!(time.runs() && time.now() < Duration::from_secs(500_000));
    }
}
