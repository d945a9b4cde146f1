// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::{Measurement, Time};

/// Whether a camera that was told to stop, and said yes, is seen to do so: some say yes and turn on.
#[derive(Debug, Default)]
pub struct StopConfirmation {
    /// When it last said yes, until it was seen at rest.
    since: Option<Time>,
    /// Pictures in a row that showed it to turn since.
    turning: u32,
    /// When the last of them was taken.
    turned_at: Time,
    /// How often it was told again.
    repeated: u32,
    /// How often of these no picture had told of it.
    unseen: u32,
    /// No more pictures are to come.
    leaving: bool,
}

/// What is to be done about a stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopFinding {
    /// Nothing: it is too early, or does not tell.
    Unknown,
    /// Nothing: the camera rests.
    Rests,
    /// The camera is to be told again.
    Repeat,
    /// The same, and somebody is to know that it was told often enough.
    RepeatInVain,
}

impl StopConfirmation {
    /// By then a stop shows in the picture, whatever the latency is.
    const SHOWN_AFTER: Duration = Duration::from_millis(1200);

    /// A stop that no picture tells of by then is repeated.
    const UNSEEN_AFTER: Duration = Duration::from_secs(3);

    /// Pictures that have to agree.
    const PICTURES: u32 = 5;

    /// After so many stops in vain somebody is to know; and after twice as many it may be somebody else who moves it.
    pub const IN_VAIN: u32 = 3;

    /// The camera accepted a stop.
    pub fn stopped(&mut self, now: Time) {
        if self.repeated < 2 * Self::IN_VAIN {
            (self.since, self.turning) = (Some(now), 0);
        }
    }

    /// It is being moved.
    pub fn moved(&mut self) {
        self.forget();
    }

    /// Of a camera that no picture is to come from, ever.
    pub fn without_pictures() -> Self {
        Self { leaving: true, ..Self::default() }
    }

    /// It is the end: what no picture has told by now none will.
    pub fn leave(&mut self) {
        self.leaving = true;
    }

    /// Whether it is the end.
    pub fn is_leaving(&self) -> bool {
        self.leaving
    }

    fn forget(&mut self) {
        *self = Self { leaving: self.leaving, ..Self::default() };
    }

    /// Whether a camera rests whose background moves so many fields of view a second.
    pub fn is_rest(fields_s: f64) -> bool {
        fields_s <= Measurement::NOISE_FIELDS_S
    }

    /// A picture shows the background to move so many fields of view a second, or does not tell.
    pub fn see(&mut self, fields_s: Option<f64>, taken_at: Time) -> StopFinding {
        let Some((since, fields_s)) = self.since.zip(fields_s) else { return StopFinding::Unknown };
        if taken_at < since + Self::SHOWN_AFTER {
            return StopFinding::Unknown;
        }
        if Self::is_rest(fields_s) {
            self.forget();
            return StopFinding::Rests;
        }
        (self.turning, self.turned_at) = (self.turning + 1, taken_at);
        if self.turning < Self::PICTURES {
            return StopFinding::Unknown;
        }
        (self.since, self.repeated) = (None, self.repeated + 1);
        let shown = self.repeated - self.unseen;
        if shown == Self::IN_VAIN { StopFinding::RepeatInVain } else { StopFinding::Repeat }
    }

    /// When the stop is to be repeated if no picture tells of it by then, and it was so no more often than that.
    pub fn unseen_at(&self, most: u32) -> Option<Time> {
        let after = if self.leaving { Duration::ZERO } else { Self::UNSEEN_AFTER };
        // Too few to tell are none.
        self.since.filter(|_| self.unseen < most).map(|since| since.max(self.turned_at) + after)
    }

    /// Whether it may yet have to be repeated.
    pub fn is_open(&self, most: u32, now: Time) -> bool {
        self.since.is_some() && self.unseen < most || self.open_until().is_some_and(|until| now < until)
    }

    /// When no picture will tell of it any more.
    pub fn open_until(&self) -> Option<Time> {
        self.since.map(|since| since.max(self.turned_at) + Self::UNSEEN_AFTER)
    }

    /// Whether it is to be repeated for that now; asked once for each time.
    pub fn repeats_unseen(&mut self, most: u32, now: Time) -> bool {
        let is_due = self.unseen_at(most).is_some_and(|at| at <= now);
        if is_due {
            (self.since, self.repeated, self.unseen) = (None, self.repeated + 1, self.unseen + 1);
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    /// What comes of pictures from then on that all show this.
    fn pictures(confirmation: &mut StopConfirmation, from: u64, fields_s: f64) -> Vec<StopFinding> {
        (0..6).map(|picture| confirmation.see(Some(fields_s), ms(from + 40 * picture))).collect()
    }

    #[test]
    fn a_camera_seen_at_rest_is_told_once() {
        let mut confirmation = StopConfirmation::default();
        confirmation.stopped(ms(1000));
        assert!(
            !pictures(&mut confirmation, 1100, 0.5).contains(&StopFinding::Repeat),
            "it is still old news"
        );
        pictures(&mut confirmation, 2300, 0.01);
        assert!(
            !pictures(&mut confirmation, 3000, 0.5).contains(&StopFinding::Repeat),
            "somebody else moves it"
        );
        assert_eq!(confirmation.unseen_at(1), None);
    }

    #[test]
    fn one_that_turns_on_is_told_again_but_not_for_ever() {
        let mut confirmation = StopConfirmation::default();
        let mut told = Vec::new();
        for round in 0..20 {
            let at = 10_000 * round;
            confirmation.stopped(ms(at));
            told.extend(
                pictures(&mut confirmation, at + 1300, 0.3)
                    .into_iter()
                    .filter(|it| *it != StopFinding::Unknown),
            );
        }
        assert_eq!(told.len(), 6);
        assert_eq!(told.iter().position(|it| *it == StopFinding::RepeatInVain), Some(2));
        confirmation.moved();
        confirmation.stopped(ms(1_000_000));
        assert!(pictures(&mut confirmation, 1_001_300, 0.3).contains(&StopFinding::Repeat));
    }

    #[test]
    fn what_pictures_have_shown_does_not_count_where_none_tell_any_more() {
        let mut confirmation = StopConfirmation::default();
        for at in [0, 10_000] {
            confirmation.stopped(ms(at));
            assert!(pictures(&mut confirmation, at + 1300, 0.3).contains(&StopFinding::Repeat));
        }
        confirmation.stopped(ms(20_000));
        assert!(confirmation.repeats_unseen(1, ms(23_000)));
    }

    #[test]
    fn somebody_knows_of_three_that_pictures_have_shown_to_be_in_vain_whatever_none_told_of_in_between() {
        let mut confirmation = StopConfirmation::default();
        let mut told = Vec::new();
        for (at, is_seen) in [(0, true), (10_000, true), (20_000, false), (30_000, true)] {
            confirmation.stopped(ms(at));
            if is_seen {
                told.extend(pictures(&mut confirmation, at + 1300, 0.3));
            } else {
                assert!(confirmation.repeats_unseen(1, ms(at + 3000)));
            }
        }
        assert!(told.contains(&StopFinding::RepeatInVain));
    }

    #[test]
    fn a_stop_that_no_picture_tells_of_is_repeated_once() {
        let mut confirmation = StopConfirmation::default();
        confirmation.stopped(ms(1000));
        assert_eq!(confirmation.see(None, ms(3000)), StopFinding::Unknown);
        assert!(!confirmation.repeats_unseen(1, ms(3999)) && confirmation.is_open(1, ms(4000)));
        assert!(confirmation.repeats_unseen(1, ms(4000)));
        confirmation.stopped(ms(4000));
        assert_eq!(confirmation.unseen_at(1), None);
        assert!(
            confirmation.is_open(1, ms(6999)) && !confirmation.is_open(1, ms(7000)),
            "a picture may yet show that it turns"
        );
    }

    #[test]
    fn one_that_some_pictures_show_to_turn_is_open_for_the_next_but_not_for_ever() {
        let mut confirmation = StopConfirmation::default();
        confirmation.stopped(ms(1000));
        for picture in 3..6 {
            assert_eq!(confirmation.see(Some(0.5), ms(1000 * picture)), StopFinding::Unknown);
            assert!(!confirmation.repeats_unseen(1, ms(1000 * picture + 2500)));
        }
        assert!(
            confirmation.is_open(1, ms(8000)) && confirmation.repeats_unseen(1, ms(8000)),
            "no picture comes any more"
        );
        confirmation.stopped(ms(8000));
        assert!(confirmation.is_open(1, ms(10_000)) && !confirmation.is_open(1, ms(11_000)));
    }

    #[test]
    fn at_the_end_it_is_repeated_at_once() {
        let mut confirmation = StopConfirmation::default();
        confirmation.leave();
        confirmation.moved();
        for mut confirmation in [confirmation, StopConfirmation::without_pictures()] {
            confirmation.stopped(ms(1000));
            assert!(confirmation.repeats_unseen(1, ms(1000)));
            confirmation.stopped(ms(1100));
            assert!(!confirmation.repeats_unseen(1, ms(9000)));
        }
    }
}
