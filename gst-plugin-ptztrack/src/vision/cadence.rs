// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::time::Duration;

/// How far apart pictures were taken whose timestamps may be those of their arrival, as with MJPEG over HTTP.
///
/// A network holds pictures back and then lets several go at once. A millisecond apart, somebody who walks would seem to
/// run at a hundred metres a second. So pictures that come bunched are spaced as a playout buffer would space them: not
/// closer than they usually are, until the stream has caught up. All others are as far apart as their timestamps say.
#[derive(Debug, Default)]
pub struct Cadence {
    /// The last intervals between timestamps, oldest first.
    intervals: VecDeque<Duration>,
    /// How far the last of the spaced pictures is ahead of its timestamp.
    ahead: Duration,
    /// The same of the one furthest ahead lately, which was held back least.
    furthest: Duration,
    /// Pictures whose timestamps tell nothing, from the next one on.
    disordered: usize,
}

impl Cadence {
    /// A mean over so many, a second or two, is what the camera keeps, however the network bunches them.
    const INTERVALS: usize = 31;

    /// From so many on there is a usual interval.
    const FEW: usize = 5;

    /// A pause that is longer says nothing of how far apart pictures usually are.
    const PAUSE: Duration = Duration::from_secs(1);

    /// No camera takes pictures so many times closer than usual; half the interval is a true one where a busy machine
    /// drops every other picture.
    const BUNCHED: u32 = 3;

    /// Part of the usual interval that spaced pictures keep, a little less than all of it: so they come back to their
    /// timestamps, however often the network holds them back.
    const KEPT: f64 = 0.95;

    /// What is further ahead is no network's delay, but a camera that takes pictures faster from now on.
    const LONGEST_AHEAD: Duration = Duration::from_secs(1);

    /// How long after the picture before one was taken whose timestamp is so much later. Of one that is earlier (`None`), and while such
    /// are among the last, timestamps tell nothing: then it is what was usual before; `None` where nothing was.
    pub fn elapsed(&mut self, interval: Option<Duration>) -> Option<Duration> {
        match interval {
            None => {
                (self.disordered, self.ahead, self.furthest) =
                    (Self::INTERVALS, Duration::ZERO, Duration::ZERO)
            }
            Some(interval) if self.disordered == 0 => return Some(self.spaced(interval)),
            Some(_) => self.disordered -= 1,
        }
        Some(self.usual()).filter(|usual| !usual.is_zero())
    }

    /// Whether timestamps tell nothing.
    pub fn is_disordered(&self) -> bool {
        self.disordered > 0
    }

    fn spaced(&mut self, interval: Duration) -> Duration {
        let usual = self.usual();
        self.remember(interval);
        let elapsed = if self.ahead.is_zero() && interval >= usual / Self::BUNCHED {
            interval
        } else {
            interval.saturating_sub(self.ahead).max(usual.mul_f64(Self::KEPT))
        };
        self.ahead = (self.ahead + elapsed).saturating_sub(interval).min(Self::LONGEST_AHEAD);
        // Fades as fast as spaced pictures fall back to timestamps that are late no more.
        let faded = self.furthest.saturating_sub(interval.mul_f64(1.0 - Self::KEPT));
        self.furthest = faded.max(self.ahead);
        elapsed
    }

    /// How much longer the last picture was held back than those that were least.
    pub fn held_back(&self) -> Duration {
        self.furthest - self.ahead
    }

    fn usual(&self) -> Duration {
        let count = self.intervals.len();
        if count < Self::FEW {
            Duration::ZERO
        } else {
            self.intervals.iter().sum::<Duration>() / count as u32
        }
    }

    fn remember(&mut self, interval: Duration) {
        if interval > Self::PAUSE {
            return self.intervals.clear();
        }
        if self.intervals.len() == Self::INTERVALS {
            self.intervals.pop_front();
        }
        self.intervals.push_back(interval);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn elapsed(intervals_ms: impl IntoIterator<Item = u64>) -> Vec<u64> {
        let mut cadence = Cadence::default();
        let elapsed =
            |interval| cadence.elapsed(Some(Duration::from_millis(interval))).unwrap().as_millis() as u64;
        intervals_ms.into_iter().map(elapsed).collect()
    }

    fn usual() -> impl Iterator<Item = u64> {
        std::iter::repeat_n(40, 40)
    }

    #[test]
    fn timestamps_are_believed_unless_pictures_come_bunched() {
        // A busy machine drops every other picture; the clock of a source trembles; a camera is asked for fewer.
        let drops = (0..99).map(|picture| 40 * (1 + picture % 2));
        let tremble = (0..99).map(|picture| 20 + picture * 7 % 41);
        let fewer = [200; 40];
        let stalls = [600, 40, 40, 3000, 40, 40];
        let intervals: Vec<u64> =
            usual().chain(drops).chain(tremble).chain(stalls).chain(usual()).chain(fewer).collect();
        assert_eq!(elapsed(intervals.clone()), intervals);
    }

    #[test]
    fn pictures_that_were_held_back_are_spaced_as_usual() {
        let bunch = [160, 1, 1, 1, 37];
        let spaced = elapsed(usual().chain(bunch).chain(usual()).chain(usual()));
        assert_eq!(spaced[40], 160);
        assert!(spaced[41..60].iter().all(|spaced| (36..=42).contains(spaced)), "{spaced:?}");
        assert_eq!(spaced.last(), Some(&40), "they have caught up");
    }

    #[test]
    fn a_network_that_only_ever_lets_bunches_go_is_seen_through() {
        let spaced = elapsed([198, 1, 1].into_iter().cycle().take(300));
        assert!(spaced[100..].iter().all(|spaced| (60..=80).contains(spaced)), "{spaced:?}");
    }

    #[test]
    fn who_was_held_back_is_known_from_the_bunch_before() {
        let mut cadence = Cadence::default();
        let bunch = [160, 1, 1, 1, 37];
        let held_back = |interval| {
            cadence.elapsed(Some(Duration::from_millis(interval)));
            cadence.held_back().as_millis() as u64
        };
        let held_back: Vec<u64> = usual().chain(bunch).chain(bunch).map(held_back).collect();
        assert!(held_back[..45].iter().all(|late| *late < 5), "{held_back:?}");
        // By three pictures, two, one.
        for (late, really) in held_back[45..].iter().zip([120, 80, 40, 0, 0]) {
            assert!(late.abs_diff(really) <= 12, "{held_back:?}");
        }
    }

    #[test]
    fn timestamps_tell_nothing_until_all_of_the_last_were_in_order() {
        let mut cadence = Cadence::default();
        let mut told = |interval: Option<u64>| {
            let elapsed = cadence.elapsed(interval.map(Duration::from_millis));
            elapsed.map(|elapsed| elapsed.as_millis())
        };
        assert_eq!([told(Some(40)), told(None), told(Some(900))], [Some(40), None, None]);
        assert!((0..Cadence::INTERVALS).all(|_| told(Some(100)).is_none_or(|told| told == 100)));
        assert_eq!([told(Some(100)); 5], [Some(100); 5]);
        assert_eq!((0..9).map(|_| told(Some(100))).last(), Some(Some(100)));
        assert_eq!(told(None), Some(95), "as usual: once it was 40");
        assert!((1..Cadence::INTERVALS).all(|_| told(Some(2900)) == Some(95)) && told(None) == Some(95));
        assert!((0..Cadence::INTERVALS).all(|_| told(Some(40)) == Some(95)));
        assert_eq!(told(Some(40)), Some(40));
    }

    #[test]
    fn timestamps_that_do_not_go_on_are_left_alone() {
        assert_eq!(elapsed([0; 50]), [0; 50]);
    }

    proptest! {
        #[test]
        fn pictures_are_never_spaced_by_more_than_a_network_makes_up_for(
            intervals in prop::collection::vec(0u64..3000, 1..200),
        ) {
            let (told, spaced) = (intervals.iter().sum::<u64>(), elapsed(intervals).iter().sum::<u64>());
            prop_assert!(spaced + 200 >= told, "{spaced} of {told}");
        }
    }
}
