// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use super::{Measurement, Mounting, ObservedRotation};
use crate::Time;
use crate::model::{CommandHistory, PanTilt};

/// Learns which way each axis turns the picture: cameras hang, and some makes have an axis the wrong way round, or each in
/// the other's place.
#[derive(Debug, Default)]
pub struct AxisEstimator {
    /// Whether pan tilts and tilt pans: as unlikely as an axis that is the wrong way round, and found by the same evidence.
    exchange: AxisSense,
    pan: AxisSense,
    tilt: AxisSense,
    /// Until it is known whether they are exchanged, moves are along one of them: whether that is pan, and since when.
    along: Option<(bool, Time)>,
    /// Pictures in which it rested although it was told to turn as fast as it may, since it last turned.
    rests: u32,
    /// How often that bound was doubled.
    raised: u32,
}

/// What was found out about an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisFinding {
    /// It turns the picture the other way.
    Inverted,
    /// Pan tilts, and tilt pans.
    Exchanged,
}

/// What is known of one axis.
#[derive(Debug, Clone, Copy, Default)]
struct AxisSense {
    inverted: bool,
    /// Pictures that showed it to turn as it was told.
    with: u32,
    /// Pictures that showed it to turn the other way.
    against: u32,
}

impl AxisSense {
    /// Pictures that decide, in a row.
    const DECISIVE: u32 = 4;

    fn is_known(self) -> bool {
        self.with >= Self::DECISIVE
    }

    /// Takes what was told and what was seen; returns whether the axis is now taken to turn the other way.
    fn see(&mut self, told: f64, seen: f64) -> bool {
        if self.is_known() {
            return false;
        }
        let agrees = told * seen > 0.0;
        // Whatever spoke for the other side was noise, or somebody else's hand.
        (self.with, self.against) = if agrees { (self.with + 1, 0) } else { (0, self.against + 1) };
        let other_way = self.against >= Self::DECISIVE;
        if other_way {
            *self = Self { inverted: !self.inverted, ..Self::default() };
        }
        other_way
    }
}

impl AxisEstimator {
    /// Until it is known which way an axis turns the picture, no more degrees per second: a camera that is not late has shown
    /// it soon ...
    const QUICK_DEG_S: f64 = 20.0;

    /// ... and once so many degrees were told that no picture may show yet ...
    const QUICK_DEG: f64 = 7.0;

    /// ... no more than this: one that is late, and turns the wrong way, does so slowly.
    const CAUTIOUS_DEG_S: f64 = 10.0;

    /// What was commanded so long before a picture shows in it, however late the camera is: only what was told the same way
    /// for all that time is compared.
    const LONGEST_DELAY: Duration = Duration::from_millis(900);

    /// A rate is that of the bound from this part of it on: what is told is told by levels.
    const NEARLY: f64 = 0.8;

    /// The bound is doubled no more often.
    const MOST_RAISED: u32 = 2;

    /// Moves are along the same axis for so long, that a picture may show what they do.
    const ALONG: Duration = Duration::from_millis(2500);

    /// No camera takes longer to begin to turn.
    const LATEST: Duration = Duration::from_millis(1600);

    /// A turn is along one axis where it is seen to be so many times faster than along the other ...
    const ALONG_ONE: f64 = 2.0;

    /// ... and is told to be.
    const TOLD_ALONG: f64 = 4.0;

    /// How the picture lies to the axes, of a camera that is mounted like this as far as was set.
    pub fn mounting(&self, set: Mounting) -> Mounting {
        Mounting {
            invert_pan: set.invert_pan != self.pan.inverted,
            invert_tilt: set.invert_tilt != self.tilt.inverted,
            ..set
        }
    }

    /// What is along the picture's sides along the camera's axes, or back: each in the other's place where they are exchanged.
    pub fn exchanged<T>(&self, (pan, tilt): (T, T)) -> (T, T) {
        if self.exchange.inverted { (tilt, pan) } else { (pan, tilt) }
    }

    /// Takes a turn that the background shows; returns what is now taken to be otherwise.
    pub fn see(
        &mut self,
        turn: &ObservedRotation,
        history: &CommandHistory,
        fov_deg: f64,
    ) -> Option<AxisFinding> {
        let since = turn.from - Self::LONGEST_DELAY;
        let told: Vec<PanTilt> = history.rates_between(since, turn.to).collect();
        let noise = Measurement::NOISE_FIELDS_S * fov_deg;
        self.heed_rest(turn, history, noise);
        let along = (along_one(told.iter().copied()), along_one([turn.rate]));
        match along {
            (Some(told), Some(seen)) if turn.rate.largest() > noise => {
                if self.exchange.see(1.0, if told == seen { 1.0 } else { -1.0 }) {
                    (self.pan, self.tilt) = (AxisSense::default(), AxisSense::default());
                    return Some(AxisFinding::Exchanged);
                }
                if told != seen {
                    return None;
                }
            }
            _ if !self.exchange.is_known() => return None,
            _ => {}
        }
        let pan = one_way(told.iter().map(|rate| rate.pan));
        let tilt = one_way(told.iter().map(|rate| rate.tilt));
        let see = |axis: &mut AxisSense, told: Option<f64>, seen: f64| {
            told.is_some_and(|told| seen.abs() > noise && axis.see(told, seen))
        };
        let changed = see(&mut self.pan, pan, turn.rate.pan);
        (see(&mut self.tilt, tilt, turn.rate.tilt) || changed).then_some(AxisFinding::Inverted)
    }

    /// Some cameras rest where they are told to turn slowly. One that does so, told for longer than any delay to turn as fast as
    /// it may until its axes are known, may turn twice as fast.
    fn heed_rest(&mut self, turn: &ObservedRotation, history: &CommandHistory, noise: f64) {
        let least = Self::NEARLY * self.cautious_deg_s();
        let mut told = history.rates_between(turn.from - Self::LATEST, turn.to);
        let turns = turn.rate.largest() > noise;
        if turns {
            self.rests = 0;
        } else if told.all(|rate| rate.largest() >= least) {
            // Whoever is followed is seen for moments only by a camera that rests: these add up.
            self.rests += 1;
        }
        if self.rests >= AxisSense::DECISIVE && self.raised < Self::MOST_RAISED {
            (self.rests, self.raised) = (0, self.raised + 1);
        }
    }

    /// Whether it is known how pan turns the picture.
    pub fn is_pan_known(&self) -> bool {
        self.exchange.is_known() && self.pan.is_known()
    }

    /// Whether it is known of both which way they turn the picture.
    pub fn are_known(&self) -> bool {
        self.is_pan_known() && self.tilt.is_known()
    }

    /// Whether a camera that rests may be told to turn faster yet.
    pub fn seeks_speed(&self) -> bool {
        let is_known = self.exchange.is_known() || self.pan.is_known() || self.tilt.is_known();
        !is_known && self.raised < Self::MOST_RAISED
    }

    /// How fast an axis may be until it is known, degrees per second, however late the camera is.
    fn cautious_deg_s(&self) -> f64 {
        Self::CAUTIOUS_DEG_S * f64::from(1 << self.raised)
    }

    /// A rate bounded by what is known of the axes.
    pub fn cautious(&mut self, rate: PanTilt, history: &CommandHistory, now: Time) -> PanTilt {
        let told = history.rotation(now - Self::LATEST, now);
        let bounded = |axis: AxisSense, rate: f64, told: f64| {
            let quick = if told.abs() < Self::QUICK_DEG { Self::QUICK_DEG_S } else { 0.0 };
            let most = self.cautious_deg_s().max(quick);
            if axis.is_known() { rate } else { rate.clamp(-most, most) }
        };
        let rate =
            PanTilt::new(bounded(self.pan, rate.pan, told.pan), bounded(self.tilt, rate.tilt, told.tilt));
        if self.exchange.is_known() { rate } else { self.mostly_along_one(rate, now) }
    }

    /// Of two axes that may be exchanged one is much the faster: of two that move alike nobody can tell from the picture whether
    /// they are exchanged, or both the wrong way round.
    fn mostly_along_one(&mut self, PanTilt { pan, tilt }: PanTilt, now: Time) -> PanTilt {
        let since = self.along.filter(|(_, since)| now < *since + Self::ALONG);
        let (pans, _) = *self.along.insert(since.unwrap_or((pan.abs() >= tilt.abs(), now)));
        let aside = |rate: f64, along: f64| {
            let most = along.abs() / Self::TOLD_ALONG;
            rate.clamp(-most, most)
        };
        if pans { PanTilt::new(pan, aside(tilt, pan)) } else { PanTilt::new(aside(pan, tilt), tilt) }
    }
}

/// Whether turns are all along one axis: `Some(true)` along pan, `Some(false)` along tilt. What rests turns nothing.
fn along_one(turns: impl IntoIterator<Item = PanTilt>) -> Option<bool> {
    let (mut pan, mut tilt) = (true, true);
    for turn in turns.into_iter().filter(|turn| turn.largest() > 0.0) {
        let (x, y) = (turn.pan.abs(), turn.tilt.abs());
        pan &= x > AxisEstimator::ALONG_ONE * y;
        tilt &= y > AxisEstimator::ALONG_ONE * x;
    }
    (pan != tilt).then_some(pan)
}

/// The first of rates that all have one sign, but for rests: what turns meanwhile does so by one of them.
fn one_way(rates: impl Iterator<Item = f64>) -> Option<f64> {
    let mut rates = rates.filter(|rate| *rate != 0.0);
    let first = rates.next()?;
    rates.all(|rate| rate * first > 0.0).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUICK: f64 = AxisEstimator::QUICK_DEG_S;
    const CAUTIOUS: f64 = AxisEstimator::CAUTIOUS_DEG_S;
    const DECISIVE: u32 = AxisSense::DECISIVE;

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    /// Twelve pictures a second of a camera told to pan at `told`, which the background shows to do `seen`.
    fn watch(axes: &mut AxisEstimator, told: PanTilt, seen: PanTilt, pictures: u32) -> Option<AxisFinding> {
        let mut history = CommandHistory::default();
        history.push(ms(0), told);
        let mut found = None;
        for picture in 0..u64::from(pictures) {
            let from = ms(2000 + 80 * picture);
            let turn = ObservedRotation { from, to: from + ms(80), rate: seen };
            found = axes.see(&turn, &history, 55.0).or(found);
        }
        found
    }

    /// What is left of a rate that is the first to be told.
    fn first(axes: &mut AxisEstimator, pan: f64, tilt: f64) -> PanTilt {
        axes.cautious(PanTilt::new(pan, tilt), &CommandHistory::default(), ms(0))
    }

    /// What is left of any rate of pan once the camera has long been told to turn.
    fn at_last(axes: &mut AxisEstimator) -> f64 {
        let mut history = CommandHistory::default();
        history.push(ms(0), PanTilt::new(CAUTIOUS, 0.0));
        axes.cautious(PanTilt::new(90.0, 0.0), &history, ms(3000)).pan
    }

    /// Of a camera whose axes are known not to be exchanged.
    fn straight() -> AxisEstimator {
        let mut axes = AxisEstimator::default();
        axes.exchange.with = DECISIVE;
        axes
    }

    #[test]
    fn exchanged_axes_are_found_and_then_told_in_each_others_place() {
        let mut axes = AxisEstimator::default();
        let slanted = PanTilt::new(5.0, 4.0);
        assert_eq!(watch(&mut axes, slanted, slanted, 100), None, "nothing can be told by that");
        assert_eq!(first(&mut axes, 40.0, 0.0), PanTilt::new(QUICK, 0.0));
        let (told, seen) = (PanTilt::new(5.0, 0.5), PanTilt::new(0.3, -4.0));
        assert_eq!(watch(&mut axes, told, seen, DECISIVE - 1), None);
        assert_eq!(watch(&mut axes, told, seen, 1), Some(AxisFinding::Exchanged));
        assert_eq!(axes.exchanged((1, 2)), (2, 1));
        let seen = PanTilt::new(4.0, 0.3);
        assert_eq!(watch(&mut axes, told, seen, 100), None);
        assert_eq!(first(&mut axes, 40.0, 0.0), PanTilt::new(40.0, 0.0));
    }

    #[test]
    fn an_axis_that_turns_as_it_is_told_is_known_so() {
        let mut axes = AxisEstimator::default();
        assert_eq!(first(&mut axes, 40.0, -40.0), PanTilt::new(QUICK, -QUICK / 4.0), "mostly along one");
        assert_eq!(watch(&mut axes, PanTilt::new(5.0, 0.0), PanTilt::new(4.0, 1.0), 12), None);
        assert_eq!(first(&mut axes, 40.0, -40.0), PanTilt::new(40.0, -QUICK), "tilt was never told to turn");
        assert_eq!(axes.mounting(Mounting::default()), Mounting::default());
    }

    /// However late it is, it has not been told to turn far by the time it shows which way that is.
    #[test]
    fn the_first_degrees_are_quick_and_no_more() {
        let (mut axes, mut history) = (AxisEstimator::default(), CommandHistory::default());
        let mut allowed = Vec::new();
        for tenth in 0..30 {
            let now = ms(1000 + 100 * tenth);
            let rate = axes.cautious(PanTilt::new(90.0, 0.0), &history, now);
            history.push(now, rate);
            allowed.push(rate.pan);
        }
        assert_eq!(allowed[..4], [QUICK; 4]);
        assert!(allowed[4..].iter().all(|rate| *rate == CAUTIOUS), "{allowed:?}");
        history.push(ms(4000), PanTilt::default());
        assert_eq!(
            axes.cautious(PanTilt::new(90.0, 0.0), &history, ms(6000)).pan,
            QUICK,
            "a picture may show all"
        );
    }

    #[test]
    fn one_that_turns_the_other_way_is_found_and_then_known() {
        let mut axes = straight();
        assert_eq!(watch(&mut axes, PanTilt::new(5.0, 5.0), PanTilt::new(-4.0, 4.0), DECISIVE - 1), None);
        let found = watch(&mut axes, PanTilt::new(5.0, 5.0), PanTilt::new(-4.0, 4.0), 1);
        assert_eq!(found, Some(AxisFinding::Inverted));
        let mirrored = Mounting { invert_pan: true, ..Mounting::default() };
        assert_eq!(axes.mounting(Mounting::default()), mirrored);
        assert_eq!(axes.mounting(mirrored), Mounting::default(), "as it was set");
        assert_eq!(watch(&mut axes, PanTilt::new(5.0, 5.0), PanTilt::new(4.0, 4.0), 100), None);
        assert_eq!(first(&mut axes, 40.0, 40.0), PanTilt::new(40.0, 40.0));
    }

    /// As many pictures as decide, from the first that shows the camera's first move on.
    #[test]
    fn the_first_move_tells_at_once() {
        for (seen_deg_s, finding) in [(4.0, None), (-4.0, Some(AxisFinding::Inverted))] {
            let (mut axes, mut history) = (AxisEstimator::default(), CommandHistory::default());
            history.push(ms(1000), PanTilt::new(CAUTIOUS, 0.0));
            let mut see = |picture: u64, rate: f64| {
                let from = ms::<Time>(1000) + ms::<Duration>(80 * picture);
                let turn = ObservedRotation { from, to: from + ms(80), rate: PanTilt::new(rate, 0.0) };
                axes.see(&turn, &history, 55.0)
            };
            assert!((0..2).all(|late| see(late, 0.0).is_none()));
            let last = 1 + u64::from(DECISIVE);
            assert!((2..last).all(|picture| see(picture, seen_deg_s).is_none()));
            assert_eq!(see(last, seen_deg_s), finding);
            assert_eq!(first(&mut axes, 40.0, 0.0).pan == 40.0, finding.is_none());
        }
    }

    #[test]
    fn a_camera_that_does_not_turn_slowly_is_told_to_turn_faster() {
        let mut axes = AxisEstimator::default();
        watch(&mut axes, PanTilt::new(3.0, 0.0), PanTilt::default(), 50);
        assert_eq!(at_last(&mut axes), CAUTIOUS, "so slow it was of itself");
        for most in [2.0, 4.0, 4.0].map(|times| times * CAUTIOUS) {
            let told = PanTilt::new(at_last(&mut axes), 0.0);
            assert_eq!(watch(&mut axes, told, PanTilt::default(), 2 * DECISIVE - 1), None);
            assert_eq!(at_last(&mut axes), most);
        }
    }

    #[test]
    fn rests_add_up_until_it_turns() {
        let mut axes = AxisEstimator::default();
        let (fast, slow) = (PanTilt::new(CAUTIOUS, 0.0), PanTilt::new(0.0, 2.0));
        watch(&mut axes, fast, PanTilt::default(), DECISIVE - 1);
        watch(&mut axes, slow, PanTilt::new(0.0, 2.0), 1);
        watch(&mut axes, fast, PanTilt::default(), DECISIVE - 1);
        assert_eq!(at_last(&mut axes), CAUTIOUS, "it turned in between");
        watch(&mut axes, slow, PanTilt::default(), 50);
        watch(&mut axes, fast, PanTilt::default(), 1);
        assert_eq!(at_last(&mut axes), 2.0 * CAUTIOUS);
    }

    #[test]
    fn noise_and_moves_to_and_fro_tell_nothing() {
        let mut axes = straight();
        assert_eq!(watch(&mut axes, PanTilt::new(5.0, 0.0), PanTilt::new(-1.0, 0.0), 100), None);
        let mut history = CommandHistory::default();
        for picture in 0..100 {
            let from = ms(500 * picture);
            history.push(from, PanTilt::new(if picture % 2 == 0 { 9.0 } else { -9.0 }, 0.0));
            let turn = ObservedRotation { from, to: from + ms(80), rate: PanTilt::new(9.0, 0.0) };
            assert_eq!(axes.see(&turn, &history, 55.0), None);
        }
    }
}
