// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use super::ZoomEstimator;
use crate::Time;
use crate::model::{Delays, Range};

/// Follows the magnification of a lens of which the camera tells nothing, by how the background grows in the picture.
///
/// The zoom's travel is the logarithm of the magnification then: counted from where the zoom was met, and from its widest once that
/// was seen. That the lens is at an end is seen too: it rests though it is told to move at its fastest.
#[derive(Debug)]
pub struct MagnificationEstimator {
    travel: f64,
    /// The last picture's time.
    before: Option<Time>,
    /// The last picture's that showed the background.
    seen_at: Option<Time>,
    /// Since when it is told to move one way, and how far it was then.
    span: Option<(Time, f64)>,
    rest: Option<Rest>,
    ends: Range,
    sense: Sense,
}

/// Which way the lens goes.
#[derive(Debug, Clone, Copy, Default)]
struct Sense {
    /// Comparisons in a row that showed it to go as it was told, or the other way.
    with: u32,
    against: u32,
}

/// What a picture shows of the lens that is not as it was taken to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LensFinding {
    /// It is as wide as it goes: this travel is none from now on.
    Widest(f64),
    /// It goes in where it is told to go out, and the other way round.
    Reversed,
}

/// The lens rests though it is told to move.
#[derive(Debug, Clone, Copy)]
struct Rest {
    since: Time,
    /// Which way.
    inwards: bool,
    /// How many times as fast as would do by what is known it is told to move.
    boost: f64,
}

impl Default for MagnificationEstimator {
    fn default() -> Self {
        let sense = Sense::default();
        Self { travel: 0.0, before: None, seen_at: None, span: None, rest: None, ends: Self::UNKNOWN, sense }
    }
}

impl MagnificationEstimator {
    const UNKNOWN: Range = Range { min: f64::NEG_INFINITY, max: f64::INFINITY };

    /// Pictures further apart than this show no zoom, and what was seen so long ago says nothing of now.
    const LONGEST: Duration = Duration::from_millis(500);

    /// No camera takes longer to begin to zoom, or to end that: what pictures show that are later is noise.
    const LATEST: Duration = Duration::from_millis(1600);

    /// What was told is compared to what was seen over this time, ...
    const WINDOW: Duration = Duration::from_millis(300);

    /// ... where it was told all this time, as the delays are not known exactly, and where it is more than noise.
    const SETTLING: Duration = Duration::from_millis(240);
    const EARLY: Duration = Duration::from_millis(80);
    const TELLING: f64 = 0.03;

    /// Speeds that differ more than that within this time tell nothing.
    const STEADY: f64 = 4.0;

    /// A lens that moves by less than this meanwhile rests.
    const RESTS: f64 = 0.01;

    /// One that rests for so long is at its end, or has to be told to move faster.
    const RESTS_FOR: Duration = Duration::from_millis(1200);

    /// The fastest that can be told, with what rounding takes.
    const FASTEST: f64 = 0.99;

    /// Ends are as far as they were but for this: what pictures show adds up to no more than nearly the truth.
    const NEAR: f64 = 0.15;

    /// No lens magnifies more, nor what was met less: e^4.6 is 100.
    const MOST: f64 = 4.6;

    /// So many comparisons in a row tell which way a lens goes.
    const DECISIVE: u32 = 2;

    /// A lens that goes no farther does not zoom.
    const SHORTEST: f64 = 0.05;

    /// Takes a picture, in which the background grows at this rate, where that is seen: the logarithm of its magnification per
    /// second.
    pub fn see(
        &mut self,
        growth: Option<f64>,
        taken_at: Time,
        track: &mut ZoomEstimator,
        delays: &Delays,
    ) -> Option<LensFinding> {
        let lasted = self.before.replace(taken_at).map_or(Duration::ZERO, |before| taken_at - before);
        let growth = growth.filter(|_| !lasted.is_zero() && lasted <= Self::LONGEST);
        match growth.map(|growth| growth * lasted.as_secs_f64()) {
            Some(grown) if grown.abs() < 1.0 => {
                self.seen_at = Some(taken_at);
                if track.speeds_between(taken_at - Self::LATEST, taken_at).any(|speed| speed != 0.0) {
                    self.travel = (self.travel + grown).clamp(-Self::MOST, Self::MOST);
                }
            }
            _ => {
                // By what it was told.
                self.travel = track.travel(delays.sent_by(taken_at), delays).unwrap_or(self.travel);
                self.travel = self.travel.clamp(-Self::MOST, Self::MOST);
                self.span = None;
            }
        }
        let Range { min, max } = self.ends;
        self.ends = Range { min: min.min(self.travel), max: max.max(self.travel) };
        track.place(taken_at - delays.video, self.travel);
        self.compare(taken_at, track, delays)
    }

    /// Compares how far the lens went with how far it should have gone.
    fn compare(&mut self, taken_at: Time, track: &mut ZoomEstimator, delays: &Delays) -> Option<LensFinding> {
        let sent = delays.sent_by(taken_at);
        let Some(told) = steady(track.speeds_between(sent - Self::SETTLING, sent + Self::EARLY)) else {
            (self.span, self.rest) = (None, None);
            return None;
        };
        let (since, from) = *self.span.get_or_insert((taken_at, self.travel));
        let expected = track.moved(delays.sent_by(since), sent);
        if taken_at < since + Self::WINDOW || expected.abs() < Self::TELLING {
            return None;
        }
        self.span = Some((taken_at, self.travel));
        let moved = (self.travel - from) * expected.signum();
        // However late it is, it was told nothing else.
        let told_so_only = {
            let mut lately = track.speeds_between(taken_at - Self::LATEST, sent + Self::EARLY);
            lately.all(|speed| speed * told >= 0.0)
        };
        if told_so_only && self.sense.is_against(moved) {
            return Some(self.reverse());
        }
        if moved >= Self::RESTS {
            self.rest = None;
            track.found_faster((moved / expected.abs()).clamp(0.25, 4.0));
            return None;
        }
        let widest = self.rests(told, (since, taken_at))?;
        track.place(taken_at - delays.video, self.travel);
        Some(LensFinding::Widest(widest))
    }

    fn reverse(&mut self) -> LensFinding {
        // An end was where it could not go the way that it was told.
        (self.span, self.rest, self.ends) = (None, None, Self::UNKNOWN);
        LensFinding::Reversed
    }

    /// It was seen to rest for a while. Where it has done so for long enough to be as wide as it goes, returns the travel that is
    /// none from now on.
    fn rests(&mut self, told: f64, (since, until): (Time, Time)) -> Option<f64> {
        let inwards = told > 0.0;
        let rest = *self.rest.get_or_insert(Rest { since, inwards, boost: 1.0 });
        if until < rest.since + Self::RESTS_FOR {
            return None;
        }
        if told.abs() < Self::FASTEST && !self.is_near_end(told) {
            // Some lenses rest where they are told to move slowly.
            self.rest = Some(Rest { since: until, inwards, boost: 2.0 * rest.boost });
            return None;
        }
        (self.span, self.rest) = (None, None);
        if inwards {
            self.ends.max = self.travel;
            return None;
        }
        self.ends = Range { min: 0.0, ..Self::UNKNOWN };
        Some(std::mem::take(&mut self.travel))
    }

    /// How many times as fast as would do by what is known it is to be told to move at this speed, as it rests by that.
    pub fn boost(&self, speed: f64) -> f64 {
        self.rest.filter(|rest| rest.inwards == (speed > 0.0)).map_or(1.0, |rest| rest.boost)
    }

    /// Whether it rests though it is told to move: what it was told says nothing of where it is.
    pub fn is_at_rest(&self) -> bool {
        self.rest.is_some()
    }

    fn is_near_end(&self, told: f64) -> bool {
        let end = if told < 0.0 { self.ends.min } else { self.ends.max };
        (self.travel - end).abs() < Self::NEAR && self.knows_widest()
    }

    fn knows_widest(&self) -> bool {
        self.ends.min.is_finite()
    }

    /// How far the lens goes, as far as that was seen.
    pub fn ends(&self) -> Range {
        self.ends
    }

    /// Whether it was seen to go nowhere.
    pub fn is_fixed(&self) -> bool {
        self.ends.max - self.ends.min < Self::SHORTEST
    }

    /// Whether pictures show by now what the lens does.
    pub fn is_seen(&self, now: Time) -> bool {
        self.seen_at.is_some_and(|at| now < at + Self::LONGEST)
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        assert!(self.travel.is_finite(), "a magnification of e^{}", self.travel);
        assert!((self.ends.min..=self.ends.max).contains(&self.travel), "beyond an end: {self:?}");
    }
}

impl Sense {
    /// Takes how far the lens went the way that it was told; returns whether this decides that it goes the other way.
    fn is_against(&mut self, moved: f64) -> bool {
        if moved.abs() < MagnificationEstimator::RESTS || self.with >= MagnificationEstimator::DECISIVE {
            return false;
        }
        *self = match moved > 0.0 {
            true => Self { with: self.with + 1, against: 0 },
            false => Self { with: 0, against: self.against + 1 },
        };
        let decides = self.against >= MagnificationEstimator::DECISIVE;
        if decides {
            *self = Self::default();
        }
        decides
    }
}

/// The slowest of speeds that have one sign and do not differ much; `None` of others.
fn steady(speeds: impl Iterator<Item = f64>) -> Option<f64> {
    let (least, most) = speeds
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), speed| (least.min(speed), most.max(speed)));
    let (slow, fast) = if least > 0.0 { (least, most) } else { (most, least) };
    (slow * fast > 0.0 && fast / slow <= MagnificationEstimator::STEADY).then_some(slow)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PICTURE: Duration = Duration::from_millis(40);
    const LATE: Duration = Duration::from_millis(200);

    /// A lens that the camera says nothing of, told to zoom, and the pictures of it.
    struct Watched {
        seen: MagnificationEstimator,
        track: ZoomEstimator,
        now: Time,
        /// The logarithm of what it magnifies, between its ends.
        lens: f64,
        longest: f64,
        per_s: f64,
        /// It rests where it is told to be slower than this.
        slowest: f64,
        /// -1 where it goes the other way than it is told, as far as nobody has found that out.
        sense: f64,
    }

    impl Watched {
        fn new(per_s: f64) -> Self {
            let (seen, track) = (MagnificationEstimator::default(), ZoomEstimator::of_magnification());
            let now = Time::from_millis(5000);
            Self { seen, track, now, lens: 0.0, longest: 3.0, per_s, slowest: 0.0, sense: 1.0 }
        }

        fn delays() -> Delays {
            Delays::of_sum(LATE, Duration::ZERO)
        }

        /// Is told to zoom at a speed for some seconds; returns how often it was found to be as wide as it goes.
        fn zoom(&mut self, speed: f64, seconds: f64) -> usize {
            let mut found = 0;
            self.track.commanded(self.now, speed);
            for _ in 0..(seconds / PICTURE.as_secs_f64()) as u32 {
                self.now += PICTURE;
                let told = self.track.speeds_between(self.now - LATE, self.now - LATE).last().unwrap_or(0.0);
                let boosted = (told * self.seen.boost(told)).clamp(-1.0, 1.0);
                let moves = if boosted.abs() < self.slowest { 0.0 } else { self.sense * boosted };
                let before = self.lens;
                self.lens = (before + moves * self.per_s * PICTURE.as_secs_f64()).clamp(0.0, self.longest);
                let growth = (self.lens - before) / PICTURE.as_secs_f64();
                match self.seen.see(Some(growth), self.now, &mut self.track, &Self::delays()) {
                    Some(LensFinding::Widest(_)) => found += 1,
                    Some(LensFinding::Reversed) => {
                        self.sense = -self.sense;
                        self.track.reverse();
                        // What it is told by whoever knows.
                        self.track.commanded(self.now, speed);
                    }
                    None => {}
                }
                self.seen.check_invariants();
            }
            found
        }

        fn travel(&self) -> f64 {
            self.track.last().unwrap()
        }
    }

    #[test]
    fn how_fast_it_magnifies_is_seen_within_a_second() {
        for per_s in [0.5, 1.5, 4.8] {
            let mut watched = Watched::new(per_s);
            watched.zoom(0.2, 1.5);
            let found = watched.track.fastest_per_s();
            assert!((found / per_s).ln().abs() < 0.1, "{found} of {per_s}");
            watched.zoom(0.0, 1.0);
            assert!(
                (watched.travel() - watched.lens).abs() < 1e-6,
                "{} of {}",
                watched.travel(),
                watched.lens
            );
        }
    }

    #[test]
    fn a_lens_that_rests_when_told_to_be_slow_is_told_to_be_faster() {
        let mut watched = Watched { slowest: 0.3, ..Watched::new(1.0) };
        watched.zoom(0.05, 8.0);
        assert!(watched.lens > 0.1, "{}", watched.lens);
        assert_eq!(watched.seen.ends(), MagnificationEstimator::UNKNOWN);
    }

    #[test]
    fn where_it_rests_at_its_fastest_it_is_at_an_end() {
        let mut watched = Watched::new(1.5);
        watched.zoom(1.0, 6.0);
        assert!((watched.seen.ends().max - 3.0).abs() < 0.01, "{:?}", watched.seen.ends());
        assert!(watched.zoom(-1.0, 4.0) == 1, "{:?}", watched.seen);
        assert!((watched.travel(), watched.seen.ends().min) == (0.0, 0.0) && !watched.seen.is_fixed());
        // Known, it is believed at any speed.
        watched.zoom(0.3, 2.0);
        assert!(watched.zoom(-0.3, 4.0) == 1, "{:?}", watched.seen);
        let mut fixed = Watched { longest: 0.0, ..Watched::new(1.5) };
        fixed.zoom(-1.0, 3.0);
        assert!(!fixed.seen.is_fixed());
        fixed.zoom(1.0, 3.0);
        assert!(fixed.seen.is_fixed());
    }

    #[test]
    fn a_lens_that_goes_the_other_way_is_found_out_soon_and_one_that_does_not_never() {
        for (speed, sense) in [(0.2, -1.0), (-0.2, -1.0), (0.2, 1.0), (-0.2, 1.0)] {
            let mut watched = Watched { lens: 1.5, sense, ..Watched::new(1.0) };
            watched.zoom(speed, 1.5);
            let farthest = watched.lens;
            assert!((farthest - 1.5).abs() < 0.3, "{speed}, {sense}: {farthest}");
            watched.zoom(speed, 3.0);
            assert_eq!(watched.sense, 1.0, "{speed}, {sense}");
            assert!((watched.lens - farthest) * speed > 0.04, "{speed}, {sense}: {}", watched.lens);
            // It is told otherwise, and shows that late.
            watched.zoom(-speed, 2.0);
            assert_eq!(watched.sense, 1.0, "{speed}, {sense}");
        }
    }

    #[test]
    fn what_nobody_told_it_is_noise() {
        let mut watched = Watched::new(1.0);
        watched.zoom(0.0, 1.0);
        for picture in 0..1000 {
            watched.now += PICTURE;
            let growth = if picture % 2 == 0 { 0.05 } else { -0.01 };
            watched.seen.see(Some(growth), watched.now, &mut watched.track, &Watched::delays());
        }
        assert_eq!(watched.travel(), 0.0);
    }

    #[test]
    fn where_no_picture_tells_what_it_was_told_does() {
        let mut watched = Watched::new(1.0);
        watched.zoom(0.2, 2.0);
        for _ in 0..25 {
            watched.now += PICTURE;
            watched.seen.see(None, watched.now, &mut watched.track, &Watched::delays());
        }
        assert!(
            (watched.travel() - watched.lens - 0.2).abs() < 0.05,
            "{} after {}",
            watched.travel(),
            watched.lens
        );
        assert!(!watched.seen.is_seen(watched.now));
    }

    proptest! {
        #[test]
        fn no_evidence_leads_out_of_bounds(
            pictures in prop::collection::vec((prop::option::of(any::<f64>()), -1.0..1.0f64, 1u64..700), 1..200),
        ) {
            let mut watched = Watched::new(1.0);
            for (growth, speed, wait) in pictures {
                watched.now += Duration::from_millis(wait);
                watched.track.commanded(watched.now, speed);
                watched.seen.see(growth, watched.now, &mut watched.track, &Watched::delays());
                watched.seen.check_invariants();
                prop_assert!(watched.travel().abs() <= 2.0 * MagnificationEstimator::MOST);
                prop_assert!((0.01..=5.0).contains(&watched.track.fastest_per_s()));
            }
        }
    }
}
