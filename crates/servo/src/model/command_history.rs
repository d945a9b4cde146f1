// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::iter;
use std::time::Duration;

use super::{PanTilt, SpeedMap};
use crate::Time;

/// The rates the camera was told, so that the rotation not yet visible in the picture is known.
#[derive(Debug)]
pub struct CommandHistory {
    entries: VecDeque<Entry>,
    /// Degrees per second squared by which the motors get from one rate to the next.
    acceleration_deg_s2: f64,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    since: Time,
    /// What the motors have reached by then ...
    start: PanTilt,
    /// ... and what they are told.
    rate: PanTilt,
    /// Levels of the speed map, from which the rate comes: it may be revised.
    levels: Option<(i8, i8)>,
}

impl CommandHistory {
    /// Longer than any latency that is allowed for, and than a slow camera goes without telling its position.
    pub const SPAN: Duration = Duration::from_secs(20);

    /// Of motors that accelerate by so much.
    pub fn accelerating(acceleration_deg_s2: f64) -> Self {
        Self { entries: VecDeque::new(), acceleration_deg_s2 }
    }

    /// From `at` on the camera turns with `rate`.
    pub fn push(&mut self, at: Time, rate: PanTilt) {
        self.add(at, rate, None);
    }

    /// From `at` on the camera turns with these parts of its fastest, for pan and tilt.
    pub fn push_parts(&mut self, at: Time, (pan, tilt): (f64, f64), map: &SpeedMap) {
        let levels = (SpeedMap::level_of(pan), SpeedMap::level_of(tilt));
        self.add(at, rate_of(levels, map), Some(levels));
    }

    /// Counts what was commanded in parts of the fastest by another map.
    pub fn revise(&mut self, map: &SpeedMap) {
        let mut before: Option<Entry> = None;
        for entry in &mut self.entries {
            entry.rate = entry.levels.map_or(entry.rate, |levels| rate_of(levels, map));
            if let Some(before) = before {
                entry.start = before.reached(entry.since, self.acceleration_deg_s2);
            }
            before = Some(*entry);
        }
    }

    /// Pan turned out to tilt, and tilt to pan, all along.
    pub fn exchange(&mut self) {
        let exchanged = |PanTilt { pan, tilt }: PanTilt| PanTilt::new(tilt, pan);
        for entry in &mut self.entries {
            (entry.start, entry.rate) = (exchanged(entry.start), exchanged(entry.rate));
            entry.levels = entry.levels.map(|(pan, tilt)| (tilt, pan));
        }
    }

    /// What was told to go one way went the other all along.
    pub fn reverse(&mut self) {
        for entry in &mut self.entries {
            (entry.start, entry.rate) = (entry.start * -1.0, entry.rate * -1.0);
            entry.levels = entry.levels.map(|(pan, tilt)| (-pan, -tilt));
        }
    }

    fn add(&mut self, at: Time, rate: PanTilt, levels: Option<(i8, i8)>) {
        let before = self.entries.back();
        let start = before.map_or(PanTilt::default(), |entry| entry.reached(at, self.acceleration_deg_s2));
        self.entries.push_back(Entry { since: at, start, rate, levels });
        // The entry before the span is still in force at its beginning.
        while self.entries.get(1).is_some_and(|second| second.since + Self::SPAN < at) {
            self.entries.pop_front();
        }
    }

    /// The rate that is commanded at a time; zero before the first.
    pub fn rate_at(&self, at: Time) -> PanTilt {
        self.entry_at(at).map_or(PanTilt::default(), |entry| entry.rate)
    }

    fn entry_at(&self, at: Time) -> Option<&Entry> {
        self.entries.iter().rev().find(|entry| entry.since <= at)
    }

    /// The rate that the motors have reached at a time.
    pub fn reached_at(&self, at: Time) -> PanTilt {
        self.entry_at(at).map_or(PanTilt::default(), |entry| entry.reached(at, self.acceleration_deg_s2))
    }

    /// The rates in force at some moment between two times, in order.
    pub fn rates_between(&self, from: Time, to: Time) -> impl Iterator<Item = PanTilt> {
        let first = self.rate_at(from);
        let within = move |entry: &&Entry| entry.since > from && entry.since <= to;
        iter::once(first).chain(self.entries.iter().filter(within).map(|entry| entry.rate))
    }

    /// The levels of the speed map in force between two times, last first, with how long each was, in seconds; what was
    /// not commanded in parts of the fastest is left out.
    pub fn levels_between(&self, from: Time, to: Time) -> impl Iterator<Item = ((i8, i8), f64)> {
        let ends = iter::once(to).chain(self.entries.iter().rev().map(move |entry| entry.since.min(to)));
        self.entries.iter().rev().zip(ends).filter_map(move |(entry, end)| {
            let lasted = (end - entry.since.max(from)).as_secs_f64();
            entry.levels.filter(|_| lasted > 0.0).map(|levels| (levels, lasted))
        })
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        assert!(self.entries.iter().is_sorted_by_key(|entry| entry.since), "commands out of order");
        assert!(
            self.entries.iter().all(|entry| entry.start.is_finite() && entry.rate.is_finite()),
            "a rate that is no number"
        );
    }

    /// The rotation by what was commanded between two times, degrees; from a later to an earlier it is the way back.
    pub fn rotation(&self, from: Time, to: Time) -> PanTilt {
        if to < from {
            return PanTilt::default() - self.rotation(to, from);
        }
        let mut rotation = PanTilt::default();
        let mut end = to;
        for entry in self.entries.iter().rev() {
            let since = entry.since.max(from);
            let turned = |time| entry.turned(time, self.acceleration_deg_s2);
            rotation = rotation + turned(end.max(since)) - turned(since);
            end = end.min(since);
            if entry.since <= from {
                break;
            }
        }
        rotation
    }
}

impl Default for CommandHistory {
    /// Of motors that reach each rate at once.
    fn default() -> Self {
        Self::accelerating(f64::INFINITY)
    }
}

impl Entry {
    /// The rate by a time in force.
    fn reached(&self, at: Time, acceleration_deg_s2: f64) -> PanTilt {
        let seconds = (at - self.since).as_secs_f64();
        self.start.each(self.rate, |start, rate| {
            let change = rate - start;
            let reached = seconds * acceleration_deg_s2;
            if reached < change.abs() { start + reached.copysign(change) } else { rate }
        })
    }

    /// The rotation from its beginning until then, degrees.
    fn turned(&self, until: Time, acceleration_deg_s2: f64) -> PanTilt {
        let seconds = (until - self.since).as_secs_f64();
        self.start.each(self.rate, |start, rate| {
            let ramp_s = (rate - start).abs() / acceleration_deg_s2;
            // As if it had had its rate from so much later on.
            let lost_s =
                if seconds < ramp_s { seconds - seconds * seconds / (2.0 * ramp_s) } else { ramp_s / 2.0 };
            rate * seconds - (rate - start) * lost_s
        })
    }
}

fn rate_of((pan, tilt): (i8, i8), map: &SpeedMap) -> PanTilt {
    PanTilt::new(map.deg_s(pan), map.deg_s(tilt))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::SpeedCurve;
    use proptest::prelude::*;

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    #[test]
    fn rotation_is_the_integral_of_what_was_commanded() {
        let mut history = CommandHistory::default();
        assert_eq!(history.rotation(ms(0), ms(100)), PanTilt::default());
        history.push(ms(100), PanTilt::new(10.0, 0.0));
        history.push(ms(300), PanTilt::new(-20.0, 5.0));
        let rotation = history.rotation(ms(0), ms(400));
        assert_eq!(history.rotation(ms(400), ms(0)), rotation * -1.0);
        assert!(
            (rotation.pan - (2.0 - 2.0)).abs() < 1e-9 && (rotation.tilt - 0.5).abs() < 1e-9,
            "{rotation:?}"
        );
        assert!((history.rotation(ms(200), ms(250)).pan - 0.5).abs() < 1e-9);
        assert_eq!(history.rate_at(ms(50)).pan, 0.0);
        assert_eq!(history.rate_at(ms(299)).pan, 10.0);
        assert_eq!(history.rate_at(ms(900)).pan, -20.0);
    }

    #[test]
    fn motors_take_time_from_one_rate_to_the_next() {
        let mut history = CommandHistory::accelerating(100.0);
        history.push_parts(ms(0), (0.2, 0.0), &SpeedMap::new(50.0, SpeedCurve::Linear));
        history.push(ms(1000), PanTilt::new(-10.0, 0.0));
        let pan = |history: &CommandHistory, from, to| history.rotation(ms(from), ms(to)).pan;
        for (from, to, way) in [(0, 50, 0.125), (50, 100, 0.375), (100, 200, 1.0), (1000, 1200, 0.0)] {
            assert!(
                (pan(&history, from, to) - way).abs() < 1e-9,
                "{from} to {to}: {}",
                pan(&history, from, to)
            );
        }
        assert_eq!((history.rate_at(ms(50)).pan, history.rate_at(ms(1000)).pan), (10.0, -10.0));
        // Faster than was thought: it takes longer to turn back.
        history.revise(&SpeedMap::new(100.0, SpeedCurve::Linear));
        assert!((pan(&history, 1000, 1300) - 1.5).abs() < 1e-9, "{}", pan(&history, 1000, 1300));
    }

    #[test]
    fn parts_are_counted_anew_by_another_map() {
        let mut history = CommandHistory::default();
        history.push_parts(ms(0), (0.1, -0.2), &SpeedMap::new(100.0, SpeedCurve::Linear));
        history.push(ms(1000), PanTilt::new(3.0, 0.0));
        assert_eq!(history.rate_at(ms(5)), PanTilt::new(10.0, -20.0));
        history.revise(&SpeedMap::new(50.0, SpeedCurve::Linear));
        assert_eq!(history.rotation(ms(0), ms(1000)), PanTilt::new(5.0, -10.0));
        assert_eq!(history.rate_at(ms(1000)).pan, 3.0);
    }

    #[test]
    fn rates_between_are_those_in_force() {
        let mut history = CommandHistory::default();
        for (at, rate) in [(100, 1.0), (200, 2.0), (300, 3.0)] {
            history.push(ms(at), PanTilt::new(rate, 0.0));
        }
        let rates =
            |from, to| history.rates_between(ms(from), ms(to)).map(|rate| rate.pan).collect::<Vec<_>>();
        assert_eq!(rates(0, 50), [0.0]);
        assert_eq!(rates(150, 200), [1.0, 2.0]);
        assert_eq!(rates(210, 900), [2.0, 3.0]);
    }

    proptest! {
        #[test]
        fn rotations_add_up(
            rates in prop::collection::vec((1u64..400, -50.0..50.0f64), 0..20),
            cut in 0u64..4000,
            acceleration in prop_oneof![Just(f64::INFINITY), 1.0..1000.0f64],
        ) {
            let (mut history, mut at) = (CommandHistory::accelerating(acceleration), 0);
            for (wait, rate) in rates {
                at += wait;
                history.push(ms(at), PanTilt::new(rate, 0.0));
            }
            let whole = history.rotation(ms(0), ms(4000)).pan;
            let parts = history.rotation(ms(0), ms(cut)).pan + history.rotation(ms(cut), ms(4000)).pan;
            prop_assert!((whole - parts).abs() < 1e-6);
        }
    }
}
