// SPDX-License-Identifier: MPL-2.0

use std::ops::{Add, AddAssign, Sub};
use std::time::Duration;

/// A moment: so long after a fixed one, by the clock of whoever steers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(Duration);

impl Time {
    /// The fixed moment.
    pub const ZERO: Self = Self(Duration::ZERO);

    /// So many milliseconds after the fixed moment.
    pub const fn from_millis(milliseconds: u64) -> Self {
        Self(Duration::from_millis(milliseconds))
    }

    /// How long after the fixed moment.
    pub const fn since_zero(self) -> Duration {
        self.0
    }

    /// Half way between two moments.
    pub fn middle(self, other: Self) -> Self {
        Self((self.0 + other.0) / 2)
    }
}

/// So long after the fixed moment.
impl From<Duration> for Time {
    fn from(since_zero: Duration) -> Self {
        Self(since_zero)
    }
}

impl Add<Duration> for Time {
    type Output = Self;

    fn add(self, later: Duration) -> Self {
        Self(self.0 + later)
    }
}

impl AddAssign<Duration> for Time {
    fn add_assign(&mut self, later: Duration) {
        self.0 += later;
    }
}

/// Not before the fixed moment.
impl Sub<Duration> for Time {
    type Output = Self;

    fn sub(self, earlier: Duration) -> Self {
        Self(self.0.saturating_sub(earlier))
    }
}

/// For how long it is later; zero where it is not.
impl Sub for Time {
    type Output = Duration;

    fn sub(self, earlier: Self) -> Duration {
        self.0.saturating_sub(earlier.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_be_negative_is_zero() {
        let (second, minute) = (Duration::from_secs(1), Duration::from_secs(60));
        let time = Time::from(second);
        assert_eq!((time - minute, time - Time::from(minute)), (Time::ZERO, Duration::ZERO));
        assert_eq!((time + minute - time, time + minute - minute), (minute, time));
        assert_eq!(Time::ZERO.middle(Time::from(second)).since_zero(), second / 2);
    }
}
