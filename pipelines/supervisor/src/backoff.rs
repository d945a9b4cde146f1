// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

/// How long to wait before the next start: longer while it comes to nothing, and never so long that a camera that is back
/// waits for it.
#[derive(Debug)]
pub struct Backoff {
    pause: Duration,
    shortest: Duration,
    longest: Duration,
    well: Duration,
}

impl Default for Backoff {
    /// For pipelines: one that ran for 5 s had a picture.
    fn default() -> Self {
        Self::new(Duration::from_millis(100), Duration::from_millis(400), Duration::from_secs(5))
    }
}

impl Backoff {
    /// Pauses from the shortest to the longest; what ran for as long as `well` was no failure.
    pub fn new(shortest: Duration, longest: Duration, well: Duration) -> Self {
        Self { pause: shortest, shortest, longest, well }
    }

    /// The pause after what ran for this long.
    pub fn after(&mut self, ran: Duration) -> Duration {
        if ran >= self.well {
            self.pause = self.shortest;
        }
        let pause = self.pause;
        self.pause = (pause * 2).min(self.longest);
        pause
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_are_bounded_and_begin_anew() {
        let mut backoff = Backoff::default();
        let mut after = |ran: u64| backoff.after(Duration::from_secs(ran)).as_millis();
        assert_eq!([0, 0, 0, 0, 6, 0].map(&mut after), [100, 200, 400, 400, 100, 200]);
    }

    /// A source that hears nothing gives up after a second, and a pipeline is built and starts in much less than half of one.
    #[test]
    fn a_camera_that_is_back_is_asked_within_two_seconds() {
        let (silence, start) = (Duration::from_secs(1), Duration::from_millis(500));
        let mut backoff = Backoff::default();
        assert!((0..100).all(|_| backoff.after(silence) + silence + start <= Duration::from_secs(2)));
    }
}
