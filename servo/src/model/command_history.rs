// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::iter;
use std::time::Duration;

use super::{PanTilt, SpeedMap};

/// The rates the camera was told, so that the rotation not yet visible in the picture is known.
#[derive(Debug, Default)]
pub struct CommandHistory(VecDeque<Entry>);

#[derive(Debug)]
struct Entry {
    since: Duration,
    rate: PanTilt,
    /// Where the rate comes from, and may be revised.
    steps: Option<(i8, i8)>,
}

impl CommandHistory {
    /// Longer than any latency that is allowed for, and than a slow camera goes without telling its position.
    pub const SPAN: Duration = Duration::from_secs(20);

    /// From `at` on the camera turns with `rate`.
    pub fn push(&mut self, at: Duration, rate: PanTilt) {
        self.add(Entry { since: at, rate, steps: None });
    }

    /// From `at` on the camera turns with these speed steps for pan and tilt.
    pub fn push_steps(&mut self, at: Duration, steps: (i8, i8), map: &SpeedMap) {
        self.add(Entry { since: at, rate: rate_of(steps, map), steps: Some(steps) });
    }

    /// Counts what was commanded in steps by another map.
    pub fn revise(&mut self, map: &SpeedMap) {
        for entry in &mut self.0 {
            entry.rate = entry.steps.map_or(entry.rate, |steps| rate_of(steps, map));
        }
    }

    fn add(&mut self, entry: Entry) {
        let at = entry.since;
        self.0.push_back(entry);
        // The entry before the span is still in force at its beginning.
        while self.0.get(1).is_some_and(|second| second.since + Self::SPAN < at) {
            self.0.pop_front();
        }
    }

    /// The rate in force at a time; zero before the first.
    pub fn rate_at(&self, at: Duration) -> PanTilt {
        self.0.iter().rev().find(|entry| entry.since <= at).map_or(PanTilt::default(), |entry| entry.rate)
    }

    /// The rates in force at some moment between two times, in order.
    pub fn rates_between(&self, from: Duration, to: Duration) -> impl Iterator<Item = PanTilt> {
        let first = self.rate_at(from);
        let within = move |entry: &&Entry| entry.since > from && entry.since <= to;
        iter::once(first).chain(self.0.iter().filter(within).map(|entry| entry.rate))
    }

    /// The speed steps in force between two times, last first, with how long each was, in seconds; what was
    /// not commanded in steps is left out.
    pub fn steps_between(&self, from: Duration, to: Duration) -> impl Iterator<Item = ((i8, i8), f64)> {
        let ends = iter::once(to).chain(self.0.iter().rev().map(move |entry| entry.since.min(to)));
        self.0.iter().rev().zip(ends).filter_map(move |(entry, end)| {
            let lasted = end.saturating_sub(entry.since.max(from)).as_secs_f64();
            entry.steps.filter(|_| lasted > 0.0).map(|steps| (steps, lasted))
        })
    }

    /// The rotation commanded between two times, degrees; from a later to an earlier it is the way back.
    pub fn rotation(&self, from: Duration, to: Duration) -> PanTilt {
        if to < from {
            return PanTilt::default() - self.rotation(to, from);
        }
        let mut rotation = PanTilt::default();
        let mut end = to;
        for entry in self.0.iter().rev() {
            let since = entry.since.max(from);
            rotation = rotation + entry.rate * end.saturating_sub(since).as_secs_f64();
            end = end.min(since);
            if entry.since <= from {
                break;
            }
        }
        rotation
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

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
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
    fn steps_are_counted_anew_by_another_map() {
        let mut history = CommandHistory::default();
        history.push_steps(ms(0), (10, -20), &SpeedMap::new(100.0, SpeedCurve::Linear));
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
        ) {
            let (mut history, mut at) = (CommandHistory::default(), 0);
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
