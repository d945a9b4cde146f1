// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

/// How long to wait before the next start: longer while it comes to nothing, and never so long that a camera that is back
/// waits for it.
#[derive(Debug)]
pub struct Backoff {
    pause: Duration,
}

impl Default for Backoff {
    fn default() -> Self {
        Self { pause: Self::SHORTEST }
    }
}

impl Backoff {
    const SHORTEST: Duration = Duration::from_millis(100);
    const LONGEST: Duration = Duration::from_millis(400);

    /// A pipeline that ran for so long had a picture.
    const WELL: Duration = Duration::from_secs(5);

    /// The pause after a pipeline that ran for this long.
    pub fn after(&mut self, ran: Duration) -> Duration {
        if ran >= Self::WELL {
            self.pause = Self::SHORTEST;
        }
        let pause = self.pause;
        self.pause = (pause * 2).min(Self::LONGEST);
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
