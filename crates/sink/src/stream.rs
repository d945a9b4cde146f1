// SPDX-License-Identifier: MPL-2.0

//! What is kept of the stream from buffer to buffer.

use std::cmp::Ordering;
use std::mem;
use std::time::Duration;

use servo::Time;

use crate::picture::Picture;

/// What is kept of the stream from buffer to buffer.
#[derive(Debug, Default)]
pub struct Stream {
    /// As the caps have it.
    picture: Option<Picture>,
    /// It is another one since somebody was looked for in it.
    is_other: bool,
    /// Whether time is the stream's.
    pub lockstep: bool,
    /// How old pictures are.
    pub age: PictureAge,
    /// When the last picture came, unless the pipeline was paused since.
    last_came: Option<Time>,
    /// Running time at which the pipeline was last paused, in nanoseconds.
    paused_at: Option<i64>,
    /// When it last went on.
    resumed: Time,
    meta_wait: MetaWait,
    warned: Vec<Fault>,
}

/// What the user is warned of, once a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// A target meta cannot be read.
    UnreadableMeta,
    /// No buffer has had a target meta so far.
    NoMeta,
    /// The picture has another shape than the one the target was found in, or is to be cropped.
    OtherPicture,
    /// Pictures are older than `stale-timeout`.
    OldPictures,
    /// None came for longer than that.
    NoPicture,
}

/// Whether a target meta is waited for.
#[derive(Debug, Default)]
enum MetaWait {
    #[default]
    NoBuffer,
    /// The first buffer came then.
    Since(Time),
    Over,
}

impl Stream {
    /// Nothing came yet.
    pub fn new(lockstep: bool) -> Self {
        Self { lockstep, ..Self::default() }
    }

    /// From here on the picture is of this size and shape.
    pub fn shows(&mut self, picture: Picture) {
        let before = self.picture.replace(picture);
        self.is_other |= before.is_some_and(|before| before != picture);
    }

    /// As the caps have it.
    pub fn picture(&self) -> Option<Picture> {
        self.picture
    }

    /// Whether the picture is another one than when this was last asked.
    pub fn is_other_picture(&mut self) -> bool {
        mem::take(&mut self.is_other)
    }

    /// Buffers without a target meta for so long have no tracker upstream: those put one on each, target or not.
    const META_WAIT: Duration = Duration::from_secs(1);

    /// Whether this is to be told: it was not yet.
    pub fn is_news(&mut self, fault: Fault) -> bool {
        let known = self.warned.contains(&fault);
        if !known {
            self.warned.push(fault);
        }
        !known
    }

    /// A picture comes. Returns how long none did, where time is nobody else's.
    pub fn pause(&mut self, now: Time) -> Option<Duration> {
        let before = self.last_came.replace(now).filter(|_| !self.lockstep);
        before.map(|before| now - before)
    }

    /// The pipeline is paused at this running time, in nanoseconds.
    pub fn suspend(&mut self, running_time: Option<i64>) {
        self.paused_at = running_time.filter(|_| !self.lockstep);
    }

    /// The pipeline was paused, or was not running yet: that nothing came meanwhile is as it should be.
    pub fn resume(&mut self, now: Time) {
        (self.last_came, self.resumed) = (None, now);
    }

    /// What comes from here on is of elsewhere in the stream.
    pub fn seek(&mut self) {
        self.paused_at = None;
    }

    /// Whether the pipeline was paused after this running time, in nanoseconds, and has gone on since for no longer than that.
    pub fn was_paused_after(&self, running_time: i64, now: Time, within: Duration) -> bool {
        self.paused_at.is_some_and(|at| running_time <= at) && now <= self.resumed + within
    }

    /// A buffer came, with a target meta or without. Returns whether none has had one for long.
    pub fn lacks_meta(&mut self, has_meta: bool, now: Time) -> bool {
        self.meta_wait = match mem::take(&mut self.meta_wait) {
            _ if has_meta => MetaWait::Over,
            MetaWait::NoBuffer => MetaWait::Since(now),
            waits => waits,
        };
        matches!(self.meta_wait, MetaWait::Since(since) if now >= since + Self::META_WAIT)
    }
}

/// How old a picture is when it arrives, against the youngest so far: what all of them are late by is part of the latency,
/// or of timestamps that are wrong. What is queued up during a stall is known to be old.
#[derive(Debug, Default)]
pub struct PictureAge {
    /// The least that a picture's timestamp was behind the clock so far, in nanoseconds.
    least: i64,
    /// `None` before the first.
    last: Option<Arrival>,
}

/// A picture that came.
#[derive(Debug)]
struct Arrival {
    captured: i64,
    /// Running time of its buffer, where it has one.
    shown: Option<i64>,
    /// The one before it had the same timestamp.
    repeats: bool,
    /// By so much its timestamp was behind the clock.
    behind: i64,
    at: Time,
}

impl PictureAge {
    /// By so much the clock of a source may be slow: more than any quartz is, and little enough that a stall of a second
    /// shows for an hour.
    const DRIFT: f64 = 2e-4;

    /// How old the picture is that was captured at one running time, is to be shown at another, and arrives at a third, all in
    /// nanoseconds, and at a time of a clock that nobody sets.
    pub fn of(&mut self, captured: i64, shown: Option<i64>, now: i64, arrived: Time) -> Duration {
        let behind = now.saturating_sub(captured);
        self.least = match &self.last {
            Some(last) => {
                let elapsed = (arrived - last.at).as_nanos() as i64;
                // By an element that shows a picture again where none comes.
                let is_shown_again = shown > last.shown;
                // Nothing grows older by more than the time that has passed, and no picture is taken before the one before it,
                // though it may come twice: the rest is a clock that was set.
                let older = match captured.cmp(&last.captured) {
                    Ordering::Greater => elapsed,
                    Ordering::Equal if is_shown_again || !last.repeats => elapsed,
                    Ordering::Equal | Ordering::Less => 0,
                };
                let set = behind.saturating_sub(last.behind).saturating_sub(older).max(0);
                // Saturates.
                let drift = (elapsed as f64 * Self::DRIFT) as i64;
                behind.min(self.least.saturating_add(drift).saturating_add(set))
            }
            None => behind,
        };
        let repeats = self.last.as_ref().is_some_and(|last| last.captured == captured);
        self.last = Some(Arrival { captured, shown, repeats, behind, at: arrived });
        Duration::from_nanos(u64::try_from(behind.saturating_sub(self.least)).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// In milliseconds; the clock that nobody sets is the first of them.
    fn age(pictures: &mut PictureAge, [arrived, now, captured]: [i64; 3]) -> i64 {
        const MS: i64 = 1_000_000;
        let arrived = Time::from_millis(arrived as u64);
        pictures.of(captured * MS, Some(captured * MS), now * MS, arrived).as_millis() as i64
    }

    #[test]
    fn a_picture_is_as_old_as_it_is_later_than_others() {
        let mut pictures = PictureAge::default();
        for (at, captured, later) in [(1060, 1000, 0), (1140, 1000, 80), (1140, 1120, 0), (1220, 1120, 80)] {
            let late = age(&mut pictures, [at, at, captured]);
            assert!((later - 1..=later).contains(&late), "{at}: {late}");
        }
    }

    #[test]
    fn after_a_stall_pictures_are_old_whatever_their_clock_shows() {
        for offset in [-3_600_000, -500, 0, 3_600_000] {
            let mut pictures = PictureAge::default();
            for at in (1000..10_000).step_by(40) {
                assert_eq!(age(&mut pictures, [at, at, at - 50 + offset]), 0, "{offset}");
            }
            for (at, captured) in [(13_000, 9990), (13_001, 10_030), (13_040, 10_070)] {
                let late = age(&mut pictures, [at, at, captured + offset]);
                assert!((2900..=3000).contains(&late), "{offset}: {late}");
            }
        }
    }

    #[test]
    fn a_clock_that_is_set_makes_no_picture_old() {
        const HOUR: i64 = 3_600_000;
        let mut pictures = PictureAge::default();
        let mut at = 0;
        for (clock, source) in [(0, 0), (HOUR, 0), (0, 0), (0, HOUR), (0, 0), (HOUR, HOUR)] {
            for _ in 0..50 {
                at += 40;
                let late = age(&mut pictures, [at, at + clock, at - 50 + source]);
                assert!(late < 50, "{clock}, {source}: {late}");
            }
        }
    }

    #[test]
    fn timestamps_that_do_not_go_on_make_no_picture_old() {
        let stamps: [fn(i64) -> i64; 3] =
            [|_| 0, |picture| 3_600_000 - 66 * picture, |picture| 66 * picture + picture * 7919 % 5000];
        for (n, stamp) in stamps.into_iter().enumerate() {
            let mut pictures = PictureAge::default();
            for picture in 0..500 {
                let at = 66 * picture;
                let late = age(&mut pictures, [at, at, stamp(picture)]);
                // One picture may be the last one again.
                assert!(late <= 66, "{n}, {picture}: {late}");
            }
        }
    }

    /// The buffer is another one, of a later time.
    #[test]
    fn a_picture_that_is_shown_again_and_again_grows_old() {
        const MS: i64 = 1_000_000;
        let mut pictures = PictureAge::default();
        for at in (0..=2000).step_by(40) {
            let captured = at.min(1000);
            let late = pictures.of(captured * MS, Some(at * MS), at * MS, Time::from_millis(at as u64));
            // A clock may be slow by a little.
            assert!((late.as_millis() as i64 - (at - captured)).abs() <= 1, "{at}: {late:?}");
        }
    }

    #[test]
    fn a_picture_of_before_a_pause_is_known_for_a_while() {
        let ms = Time::from_millis;
        let within = Duration::from_secs(1);
        let mut stream = Stream::default();
        assert!(!stream.was_paused_after(0, ms(0), within), "it was never paused");
        stream.suspend(Some(5000));
        stream.resume(ms(60_000));
        let known = [(5000, 60_500), (5001, 60_500), (5000, 61_001)];
        assert_eq!(
            known.map(|(taken, now)| stream.was_paused_after(taken, ms(now), within)),
            [true, false, false]
        );
        stream.seek();
        assert!(!stream.was_paused_after(5000, ms(60_500), within), "its timestamps are others'");
    }

    #[test]
    fn a_slow_clock_makes_no_picture_old() {
        let mut pictures = PictureAge::default();
        // 100 millionths, for a day.
        for second in (0..86_400).step_by(10) {
            let (now, captured) = (second * 1000, second * 1000 - second / 10);
            assert!(age(&mut pictures, [now, now, captured]) < 10, "after {second} s");
        }
    }

    #[test]
    fn a_pause_is_told_unless_the_pipeline_was_paused_or_goes_by_the_streams_time() {
        let ms = Time::from_millis;
        let mut stream = Stream::default();
        assert_eq!(
            [40, 80, 2080].map(|at| stream.pause(ms(at))),
            [None, Some(40), Some(2000)].map(|pause: Option<u64>| pause.map(Duration::from_millis))
        );
        stream.resume(ms(8900));
        assert_eq!(stream.pause(ms(9000)), None);
        let mut stream = Stream::new(true);
        assert_eq!([40, 2080].map(|at| stream.pause(ms(at))), [None; 2]);
    }

    #[test]
    fn meta_is_missed_once_a_second_has_passed_without_any() {
        let ms = Time::from_millis;
        let mut stream = Stream::default();
        assert!(![1000, 1500, 1999].map(|at| stream.lacks_meta(false, ms(at))).contains(&true));
        assert!(stream.lacks_meta(false, ms(2000)));
        assert!(stream.is_news(Fault::NoMeta) && !stream.is_news(Fault::NoMeta));
        assert!(!stream.lacks_meta(true, ms(2100)) && !stream.lacks_meta(false, ms(9000)));
    }

    proptest! {
        #[test]
        fn any_timestamps_give_an_age(pictures in prop::collection::vec(any::<(i64, i64, u32)>(), 1..20)) {
            let mut age = PictureAge::default();
            for (captured, now, arrived) in pictures {
                age.of(captured, Some(captured), now, Time::from_millis(arrived.into()));
            }
        }
    }
}
