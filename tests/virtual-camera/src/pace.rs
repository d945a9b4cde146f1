// SPDX-License-Identifier: MPL-2.0

//! When pictures are taken.

use std::time::Duration;

/// The clock of one stream: pictures at whole numbers of periods and a half since the camera's start, whenever the
/// client came. At the recording's own rate each of its pictures is thus taken once, far from where it changes.
#[derive(Debug)]
pub(crate) struct Pace {
    period: Duration,
    number: u64,
}

impl Pace {
    /// Begins with the first picture after `now`.
    pub fn new(frame_rate: f64, now: Duration) -> Self {
        let mut pace = Self { period: Duration::from_secs_f64(1.0 / frame_rate), number: 0 };
        pace.skip_before(now);
        pace
    }

    /// When the next picture is taken.
    pub fn next_exposure(&self) -> Duration {
        Duration::from_nanos(self.period.as_nanos() as u64 * self.number) + self.period / 2
    }

    /// Turns to the next picture; those whose successor is due by `now` too are skipped.
    pub fn advance(&mut self, now: Duration) {
        self.number += 1;
        self.skip_before(now.saturating_sub(self.period));
    }

    fn skip_before(&mut self, time: Duration) {
        if self.next_exposure() < time {
            let late = time - self.period / 2;
            self.number = late.as_nanos().div_ceil(self.period.as_nanos()) as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn every_picture_of_a_recording_is_taken_once() {
        let mut pace = Pace::new(10.0, ms(1234));
        let mut frames = Vec::new();
        for _ in 0..5 {
            frames.push((pace.next_exposure().as_secs_f64() * 10.0) as u64);
            pace.advance(pace.next_exposure());
        }
        assert_eq!(frames, [12, 13, 14, 15, 16]);
    }

    #[test]
    fn who_is_late_skips_but_never_goes_back() {
        let mut pace = Pace::new(10.0, ms(0));
        assert_eq!(pace.next_exposure(), ms(50));
        pace.advance(ms(60));
        assert_eq!(pace.next_exposure(), ms(150));
        pace.advance(ms(540));
        assert_eq!(pace.next_exposure(), ms(450));
        pace.advance(ms(10));
        assert_eq!(pace.next_exposure(), ms(550));
    }
}
