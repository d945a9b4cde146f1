// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::model::{CommandHistory, Delays, PanTilt};

/// Where the zoom is between the camera's answers: carried on by what it was told, at the speed it was found to have.
#[derive(Debug)]
pub struct ZoomEstimator {
    /// Speed steps, as the pan of a history.
    commanded: CommandHistory,
    told: Option<(Duration, f64)>,
    /// Zoom steps per second at speed step 100.
    full_step_s: f64,
}

impl Default for ZoomEstimator {
    fn default() -> Self {
        Self { commanded: CommandHistory::default(), told: None, full_step_s: Self::ASSUMED_STEP_S }
    }
}

impl ZoomEstimator {
    /// From end to end in four seconds, as domes with a long lens are.
    const ASSUMED_STEP_S: f64 = 2500.0;

    /// No lens is taken to be slower or faster, in zoom steps per second.
    const PLAUSIBLE_STEP_S: (f64, f64) = (100.0, 50_000.0);

    /// Less than so many steps tell nothing of the speed.
    const TELLING_STEPS: f64 = 20.0;

    /// From a time on the zoom moves at a speed step (-100 to 100).
    pub fn commanded(&mut self, at: Duration, speed: i8) {
        self.commanded.push(at, PanTilt::new(f64::from(speed), 0.0));
    }

    /// The camera told its zoom step at a time; a command acts late.
    pub fn told(&mut self, at: Duration, step: f64, delays: &Delays) {
        let delay = delays.command;
        if let Some((before, from)) = self.told {
            let expected = self.moved(before.saturating_sub(delay), at.saturating_sub(delay));
            let found = (step - from) / expected;
            if expected.abs() > Self::TELLING_STEPS && found > 0.0 {
                // Half way: the delay is not known exactly, and at its ends a lens stands still.
                let (slowest, fastest) = Self::PLAUSIBLE_STEP_S;
                self.full_step_s = (self.full_step_s * found.clamp(0.25, 4.0).sqrt()).clamp(slowest, fastest);
            }
        }
        self.told = Some((at, step));
    }

    /// The zoom step that has come of the commands sent until then, where the camera has ever told it.
    pub fn step(&self, sent_until: Duration, delays: &Delays) -> Option<f64> {
        let (at, step) = self.told?;
        Some(step + self.moved(at.saturating_sub(delays.command), sent_until))
    }

    /// The speed steps it was told, as the pan of a history.
    pub fn commands(&self) -> &CommandHistory {
        &self.commanded
    }

    /// Whether it was told to move at that time.
    pub fn moves(&self, at: Duration) -> bool {
        self.commanded.rate_at(at).pan != 0.0
    }

    /// Zoom steps per second at speed step 100, as far as is known.
    pub fn full_step_s(&self) -> f64 {
        self.full_step_s
    }

    fn moved(&self, from: Duration, to: Duration) -> f64 {
        self.commanded.rotation(from, to).pan / 100.0 * self.full_step_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn late(ms: u64) -> Delays {
        Delays { command: Duration::from_millis(ms), ..Delays::default() }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn between_answers_the_commands_tell() {
        let mut track = ZoomEstimator::default();
        assert_eq!(track.step(ms(0), &late(0)), None);
        track.told(ms(1000), 5000.0, &late(100));
        track.commanded(ms(1000), 50);
        assert!(track.moves(ms(1500)));
        // A command sent at 1000 acts from 1100 on.
        assert_eq!(track.step(ms(1400), &late(100)), Some(5500.0));
        track.commanded(ms(1400), 0);
        assert_eq!(track.step(ms(3000), &late(100)), Some(5500.0));
        // A picture may be older than the answer.
        track.told(ms(1300), 5250.0, &late(100));
        assert_eq!(track.step(ms(1100), &late(100)), Some(5125.0));
    }

    #[test]
    fn the_speed_is_learned_and_stays_plausible() {
        for real in [300.0, 2500.0, 12_000.0, 1e9] {
            let mut track = ZoomEstimator::default();
            let (mut step, mut at) = (1.0, ms(0));
            track.told(at, step, &late(50));
            for turn in 0..40 {
                let speed = if turn % 2 == 0 { 20 } else { -20 };
                track.commanded(at, speed);
                at += ms(500);
                step += f64::from(speed) / 100.0 * real * 0.5;
                track.commanded(at, 0);
                at += ms(200);
                track.told(at, step, &late(50));
            }
            let plausible = real.min(50_000.0);
            assert!((track.full_step_s() / plausible).ln().abs() < 0.05, "{} of {real}", track.full_step_s());
        }
    }
}
