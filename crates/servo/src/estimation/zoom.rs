// SPDX-License-Identifier: MPL-2.0

use crate::Time;
use crate::model::{CommandHistory, Delays, PanTilt};

/// Where the zoom is between the camera's answers: carried on by what it was told, at the speed it was found to have.
#[derive(Debug)]
pub struct ZoomEstimator {
    /// Parts of its fastest, as the pan of a history.
    commanded: CommandHistory,
    told: Option<(Time, f64)>,
    /// Parts of its travel per second, at its fastest.
    fastest_per_s: f64,
}

impl Default for ZoomEstimator {
    fn default() -> Self {
        Self { commanded: CommandHistory::default(), told: None, fastest_per_s: Self::ASSUMED_PER_S }
    }
}

impl ZoomEstimator {
    /// From end to end in four seconds, as domes with a long lens are.
    const ASSUMED_PER_S: f64 = 0.25005;

    /// Quick, as lenses are that magnify a view many times from where it is widest: one that is slower is soon known for it.
    const ASSUMED_UNSEEN_PER_S: f64 = 4.0;

    /// No lens is taken to be slower or faster.
    const PLAUSIBLE_PER_S: (f64, f64) = (0.01, 5.0);

    /// Less of the travel tells nothing of the speed.
    const TELLING: f64 = 0.002;

    /// Of a lens whose travel is the logarithm of its magnification.
    pub fn of_magnification() -> Self {
        Self { fastest_per_s: Self::ASSUMED_UNSEEN_PER_S, ..Self::default() }
    }

    /// From a time on the zoom moves at a part of its fastest (-1 to 1).
    pub fn commanded(&mut self, at: Time, speed: f64) {
        self.commanded.push(at, PanTilt::new(speed, 0.0));
    }

    /// The camera told its zoom at a time; a command acts late.
    pub fn told(&mut self, at: Time, travel: f64, delays: &Delays) {
        let delay = delays.command;
        if let Some((before, from)) = self.told {
            let expected = self.moved(before - delay, at - delay);
            let found = (travel - from) / expected;
            if expected.abs() > Self::TELLING && found > 0.0 {
                // Half way: the delay is not known exactly, and at its ends a lens stands still.
                self.found_faster(found.clamp(0.25, 4.0).sqrt());
            }
        }
        self.place(at, travel);
    }

    /// It was there at a time.
    pub fn place(&mut self, at: Time, travel: f64) {
        self.told = Some((at, travel));
    }

    /// It was found to be so many times as fast as it was taken for.
    pub fn found_faster(&mut self, factor: f64) {
        self.assume(self.fastest_per_s * factor);
    }

    /// It was found to go the other way than it was told.
    pub fn reverse(&mut self) {
        self.commanded.reverse();
    }

    /// It is taken to be so fast.
    pub fn assume(&mut self, fastest_per_s: f64) {
        let (slowest, fastest) = Self::PLAUSIBLE_PER_S;
        self.fastest_per_s = fastest_per_s.clamp(slowest, fastest);
    }

    /// The part of the travel that has come of the commands sent until then, where the camera has ever told it.
    pub fn travel(&self, sent_until: Time, delays: &Delays) -> Option<f64> {
        let (at, travel) = self.told?;
        Some(travel + self.moved(at - delays.command, sent_until))
    }

    /// The part of its travel where it last was known to be.
    pub fn last(&self) -> Option<f64> {
        self.told.map(|(_, travel)| travel)
    }

    /// The speeds it was told, as the pan of a history.
    pub fn commands(&self) -> &CommandHistory {
        &self.commanded
    }

    /// Whether it was told to move at that time.
    pub fn moves(&self, at: Time) -> bool {
        self.commanded.rate_at(at).pan != 0.0
    }

    /// Parts of its travel per second at its fastest, as far as is known.
    pub fn fastest_per_s(&self) -> f64 {
        self.fastest_per_s
    }

    /// The speeds that it was told between two times, in order.
    pub fn speeds_between(&self, from: Time, to: Time) -> impl Iterator<Item = f64> {
        self.commanded.rates_between(from, to).map(|rate| rate.pan)
    }

    /// The part of the travel that comes of what was told between two times.
    pub fn moved(&self, from: Time, to: Time) -> f64 {
        self.commanded.rotation(from, to).pan * self.fastest_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn late(ms: u64) -> Delays {
        Delays { command: Duration::from_millis(ms), ..Delays::default() }
    }

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    #[track_caller]
    fn near(found: Option<f64>, expected: f64) {
        assert!(
            found.is_some_and(|found| (found - expected).abs() < 1e-4),
            "{found:?} instead of {expected}"
        );
    }

    #[test]
    fn between_answers_the_commands_tell() {
        let mut track = ZoomEstimator::default();
        assert_eq!(track.travel(ms(0), &late(0)), None);
        track.told(ms(1000), 0.5, &late(100));
        track.commanded(ms(1000), 0.5);
        assert!(track.moves(ms(1500)));
        // A command sent at 1000 acts from 1100 on.
        near(track.travel(ms(1400), &late(100)), 0.55);
        track.commanded(ms(1400), 0.0);
        near(track.travel(ms(3000), &late(100)), 0.55);
        // A picture may be older than the answer.
        track.told(ms(1300), 0.525, &late(100));
        near(track.travel(ms(1100), &late(100)), 0.5125);
    }

    #[test]
    fn the_speed_is_learned_and_stays_plausible() {
        for real in [0.03, 0.25, 1.2, 1e5] {
            let mut track = ZoomEstimator::default();
            let (mut travel, mut at) = (0.0, ms(0));
            track.told(at, travel, &late(50));
            for turn in 0..40 {
                let speed = if turn % 2 == 0 { 0.2 } else { -0.2 };
                track.commanded(at, speed);
                at += ms(500);
                travel += speed * real * 0.5;
                track.commanded(at, 0.0);
                at += ms(200);
                track.told(at, travel, &late(50));
            }
            let plausible = real.min(5.0);
            let found = track.fastest_per_s();
            assert!((found / plausible).ln().abs() < 0.05, "{found} of {real}");
        }
    }
}
