// SPDX-License-Identifier: MPL-2.0

//! What time it is for whoever deletes by age: a clock that is wrong for a while is to cost nothing.

use std::time::{Duration, Instant, SystemTime};

/// A clock that has jumped ahead is believed once we have run for so long with it, in all: whoever sets clocks, or notices a wrong
/// one, has done so by then, and what is too old is not kept much longer than it should be.
const BELIEVED_AFTER: Duration = Duration::from_secs(6 * 3600);

/// To be ahead by less is no jump: two clocks never run alike.
const ALIKE: Duration = Duration::from_secs(60);

/// The time, as far as it is believed.
#[derive(Debug)]
pub(crate) struct Clock {
    /// What time it was ...
    time: SystemTime,
    /// ... then, by a clock that never jumps.
    at: Instant,
    /// For how long we have run with a clock that is ahead of that ...
    ahead: Option<Duration>,
    /// ... until then.
    read_at: Instant,
}

impl Clock {
    /// It was this late before, whenever that was; for so long others ran with a clock that was ahead of that.
    pub(crate) fn new(time: SystemTime, at: Instant, ahead: Option<Duration>) -> Self {
        Self { time, at, ahead, read_at: at }
    }

    /// For how long we have run with a clock that is ahead.
    pub(crate) fn ahead(&self) -> Option<Duration> {
        self.ahead
    }

    /// What time it is where the system's clock says `now`: not later than that. One that was set back is believed at once, as
    /// nothing is deleted any sooner by it.
    pub(crate) fn read(&mut self, now: SystemTime, at: Instant) -> SystemTime {
        let expected = self.time + at.saturating_duration_since(self.at);
        if now > expected + ALIKE {
            let passed = at.saturating_duration_since(self.read_at);
            let ahead = self.ahead.map_or(Duration::ZERO, |ahead| ahead + passed);
            (self.ahead, self.read_at) = (Some(ahead), at);
            if ahead < BELIEVED_AFTER {
                return expected;
            }
        }
        *self = Self::new(now, at, None);
        now
    }
}

/// As the file has times, and lengths of time.
pub(crate) fn milliseconds(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Duration = Duration::from_secs(3600);

    /// What a clock that was right at first is believed to say after this many hours, where it is ahead by so many by then.
    fn read(hours: &[(u32, u32)]) -> Vec<u32> {
        let (begin, start) = (SystemTime::UNIX_EPOCH + 1000 * HOUR, Instant::now());
        let mut clock = Clock::new(begin, start, None);
        let read = |&(after, ahead): &(u32, u32)| {
            let believed = clock.read(begin + (after + ahead) * HOUR, start + after * HOUR);
            u32::try_from(believed.duration_since(begin).unwrap().as_secs() / 3600).unwrap()
        };
        hours.iter().map(read).collect()
    }

    #[test]
    fn a_clock_that_is_right_is_believed() {
        assert_eq!(read(&[(1, 0), (100, 0)]), [1, 100]);
    }

    #[test]
    fn one_that_is_ahead_for_a_few_hours_is_not_believed() {
        assert_eq!(read(&[(1, 800), (6, 800), (7, 0), (8, 800), (13, 800), (14, 0)]), [1, 6, 7, 8, 13, 14]);
    }

    /// As where the machine was off for long.
    #[test]
    fn one_that_stays_ahead_is_believed_in_the_end() {
        assert_eq!(read(&[(0, 800), (5, 800), (6, 800), (7, 800)]), [0, 5, 806, 807]);
    }

    #[test]
    fn what_is_run_in_pieces_counts_together() {
        let (begin, start) = (SystemTime::UNIX_EPOCH + 1000 * HOUR, Instant::now());
        let now = begin + 800 * HOUR;
        let (mut time, mut ahead) = (begin, None);
        for believed in [false, true, true] {
            let mut clock = Clock::new(time, start, ahead);
            clock.read(now, start);
            time = clock.read(now, start + 4 * HOUR);
            ahead = clock.ahead();
            assert_eq!(time == now, believed);
        }
    }

    #[test]
    fn one_that_is_set_back_is_believed_at_once() {
        assert_eq!(read(&[(0, 800), (6, 800), (7, 0), (8, 0)]), [0, 806, 7, 8]);
    }
}
