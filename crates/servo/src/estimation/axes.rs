// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use super::{Mounting, ObservedRotation};
use crate::model::{CommandHistory, PanTilt};

/// Learns which way each axis turns the picture: cameras hang, and some makes have an axis the wrong way round.
#[derive(Debug, Default)]
pub struct AxisEstimator {
    pan: AxisSense,
    tilt: AxisSense,
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
    /// Pictures that decide: about a third of a second.
    const DECISIVE: u32 = 6;

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
    /// Until it is known which way an axis turns the picture, no more degrees per second: who runs away does so slowly.
    pub const CAUTIOUS_DEG_S: f64 = 6.0;

    /// What was commanded so long before a picture shows in it, however late the camera is: only what was told the same way
    /// for all that time is compared.
    const LONGEST_DELAY: Duration = Duration::from_millis(900);

    /// What a background at rest seems to turn by in a second, in fields of view.
    const NOISE_FIELDS_S: f64 = 0.02;

    /// How the picture lies to the axes, of a camera that is mounted like this as far as was set.
    pub fn mounting(&self, set: Mounting) -> Mounting {
        Mounting {
            invert_pan: set.invert_pan != self.pan.inverted,
            invert_tilt: set.invert_tilt != self.tilt.inverted,
            ..set
        }
    }

    /// Takes a turn that the background shows; returns whether an axis is now taken to turn the other way.
    pub fn see(&mut self, turn: &ObservedRotation, history: &CommandHistory, fov_deg: f64) -> bool {
        let since = turn.from.saturating_sub(Self::LONGEST_DELAY);
        let told: Vec<PanTilt> = history.rates_between(since, turn.to).collect();
        let noise = Self::NOISE_FIELDS_S * fov_deg;
        let pan = one_way(told.iter().map(|rate| rate.pan));
        let tilt = one_way(told.iter().map(|rate| rate.tilt));
        let see = |axis: &mut AxisSense, told: Option<f64>, seen: f64| {
            told.is_some_and(|told| seen.abs() > noise && axis.see(told, seen))
        };
        let changed = see(&mut self.pan, pan, turn.rate.pan);
        see(&mut self.tilt, tilt, turn.rate.tilt) || changed
    }

    /// A rate bounded by what is known of the axes.
    pub fn cautious(&self, rate: PanTilt) -> PanTilt {
        let bounded = |axis: AxisSense, rate: f64| {
            if axis.is_known() { rate } else { rate.clamp(-Self::CAUTIOUS_DEG_S, Self::CAUTIOUS_DEG_S) }
        };
        PanTilt::new(bounded(self.pan, rate.pan), bounded(self.tilt, rate.tilt))
    }
}

/// The first of rates that all have one sign.
fn one_way(mut rates: impl Iterator<Item = f64>) -> Option<f64> {
    let first = rates.next()?;
    (first != 0.0 && rates.all(|rate| rate * first > 0.0)).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// Twelve pictures a second of a camera told to pan at `told`, which the background shows to do `seen`.
    fn watch(axes: &mut AxisEstimator, told: PanTilt, seen: PanTilt, pictures: u64) -> bool {
        let mut history = CommandHistory::default();
        history.push(ms(0), told);
        let mut changed = false;
        for picture in 0..pictures {
            let from = ms(2000 + 80 * picture);
            let turn = ObservedRotation { from, to: from + ms(80), rate: seen };
            changed |= axes.see(&turn, &history, 55.0);
        }
        changed
    }

    #[test]
    fn an_axis_that_turns_as_it_is_told_is_known_so() {
        let mut axes = AxisEstimator::default();
        let fast = PanTilt::new(40.0, -40.0);
        assert_eq!(axes.cautious(fast), PanTilt::new(6.0, -6.0));
        assert!(!watch(&mut axes, PanTilt::new(5.0, 0.0), PanTilt::new(4.0, 3.0), 6));
        assert_eq!(axes.cautious(fast), PanTilt::new(40.0, -6.0), "tilt was never told to turn");
        assert_eq!(axes.mounting(Mounting::default()), Mounting::default());
    }

    #[test]
    fn one_that_turns_the_other_way_is_found_and_then_known() {
        let mut axes = AxisEstimator::default();
        assert!(!watch(&mut axes, PanTilt::new(5.0, 5.0), PanTilt::new(-4.0, 4.0), 5));
        assert!(watch(&mut axes, PanTilt::new(5.0, 5.0), PanTilt::new(-4.0, 4.0), 1));
        let mirrored = Mounting { invert_pan: true, ..Mounting::default() };
        assert_eq!(axes.mounting(Mounting::default()), mirrored);
        assert_eq!(axes.mounting(mirrored), Mounting::default(), "as it was set");
        assert!(!watch(&mut axes, PanTilt::new(5.0, 5.0), PanTilt::new(4.0, 4.0), 100));
        assert_eq!(axes.cautious(PanTilt::new(40.0, 40.0)), PanTilt::new(40.0, 40.0));
    }

    #[test]
    fn noise_and_moves_to_and_fro_tell_nothing() {
        let mut axes = AxisEstimator::default();
        assert!(!watch(&mut axes, PanTilt::new(5.0, 0.0), PanTilt::new(-1.0, 0.0), 100));
        let mut history = CommandHistory::default();
        for picture in 0..100 {
            let from = ms(500 * picture);
            history.push(from, PanTilt::new(if picture % 2 == 0 { 9.0 } else { -9.0 }, 0.0));
            let turn = ObservedRotation { from, to: from + ms(80), rate: PanTilt::new(9.0, 0.0) };
            assert!(!axes.see(&turn, &history, 55.0));
        }
    }
}
