// SPDX-License-Identifier: MPL-2.0

use std::time::{Duration, Instant};

/// For so long it stays as it is, or was not steady.
const STEADY: Duration = Duration::from_secs(60);
/// So many changes are told one after the other: it goes, and comes back.
const TOLD: u32 = 2;

/// Whether a broker is there, and what was told of that: one that comes and goes all the time fills no log.
#[derive(Debug, Default)]
pub struct Presence {
    /// How it is, and since when.
    now: Option<(bool, Instant)>,
    /// Changes since it was steady.
    changes: u32,
    told: Option<bool>,
}

impl Presence {
    /// It is there now, or not: whether that is to be told. What is not told at once is, once it has stayed so.
    pub fn is_to_be_told(&mut self, there: bool, now: Instant) -> bool {
        let (before, since) = *self.now.get_or_insert((there, now));
        let is_steady = now.saturating_duration_since(since) >= STEADY;
        if is_steady {
            self.changes = 0;
        }
        if before != there {
            self.now = Some((there, now));
            self.changes += 1;
        }
        let is_new = (self.changes <= TOLD || is_steady) && self.told != Some(there);
        if is_new {
            self.told = Some(there);
        }
        is_new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is told where it is there, or not, in each second of these.
    fn told(seconds: impl Iterator<Item = (u64, bool)>) -> Vec<(u64, bool)> {
        let (begin, mut presence) = (Instant::now(), Presence::default());
        let is_told = |(second, there): &(u64, bool)| {
            presence.is_to_be_told(*there, begin + Duration::from_secs(*second))
        };
        seconds.filter(is_told).collect()
    }

    #[test]
    fn that_it_goes_and_comes_back_is_told_at_once() {
        let seconds = (0..500).map(|second| (second, !(200..210).contains(&second)));
        assert_eq!(told(seconds), [(0, true), (200, false), (210, true)]);
    }

    #[test]
    fn one_that_comes_and_goes_is_told_of_once_and_how_it_is_in_the_end() {
        let flaps = |end: bool| {
            (0..2000).map(move |second| (second, if second < 1000 { second % 2 == 0 } else { end }))
        };
        let first = [(0, true), (1, false), (2, true)];
        assert_eq!(told(flaps(false)), [&first[..], &[(1059, false)]].concat());
        assert_eq!(told(flaps(true)), first);
    }
}
