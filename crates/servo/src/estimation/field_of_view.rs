// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::time::Duration;

use super::ObservedRotation;
use crate::Time;
use crate::model::{Delays, PanTilt};

/// Learns how wide the picture is: how far the camera turned, by its own word, against how far it seemed to.
#[derive(Debug, Default)]
pub(super) struct FieldOfViewEstimator {
    /// The turn seen up to a time, in degrees of the assumed field of view.
    seen: VecDeque<(Time, PanTilt)>,
    positions: VecDeque<(Time, PanTilt)>,
    /// Logarithms of the factor, with their weights.
    found: VecDeque<(f64, f64)>,
    logarithm: f64,
}

impl FieldOfViewEstimator {
    /// What was seen is kept for so long ...
    const SPAN: Duration = Duration::from_secs(6);

    /// ... and so many findings.
    const FINDINGS: usize = 25;

    /// Deviation of what was assumed, as a part of it.
    const PRIOR: f64 = 0.2;

    /// Positions are told in steps, and pictures measured in pixels: degrees.
    const NOISE_DEG: f64 = 0.15;

    /// A finding less sure than this teaches nothing.
    const VAGUE: f64 = 0.35;

    /// No field of view is taken to be further than this factor (of its tangent) from the assumed one.
    const LARGEST_FACTOR: f64 = 3.0;

    /// What the tangent of half the assumed field of view is to be multiplied by.
    pub fn factor(&self) -> f64 {
        self.logarithm.exp()
    }

    /// Takes a turn that was seen with the field of view as it is known now.
    pub fn see(&mut self, turn: &ObservedRotation, delays: &Delays) {
        let before = match self.seen.back() {
            Some((at, sum)) if *at == turn.from => *sum,
            _ => {
                self.seen.clear();
                self.seen.push_back((turn.from, PanTilt::default()));
                PanTilt::default()
            }
        };
        self.seen.push_back((turn.to, before + turn.rate * (turn.seconds() / self.factor())));
        while self.seen.front().is_some_and(|(at, _)| *at + Self::SPAN < turn.to) {
            self.seen.pop_front();
        }
        self.compare(delays);
    }

    /// The camera said where it looks at a time.
    pub fn positioned(&mut self, at: Time, position: PanTilt) {
        self.positions.push_back((at, position));
        if self.positions.len() > 4 {
            self.positions.pop_front();
        }
    }

    /// Positions from here on have nothing to do with those before: the zoom was changed.
    pub fn interrupted(&mut self) {
        self.positions.clear();
    }

    /// Compares two positions once the pictures that show both have come.
    fn compare(&mut self, delays: &Delays) {
        let [first, second] = [self.positions.front(), self.positions.get(1)];
        let (Some((start, from)), Some((end, to))) = (first.copied(), second.copied()) else { return };
        if self.seen.back().is_none_or(|(at, _)| *at < end + delays.sum()) {
            return;
        }
        self.positions.pop_front();
        if let Some((seen, doubt)) = self.turned(start, end, delays) {
            self.find(from.turn_to(to), seen, doubt);
        }
    }

    /// The turn seen between the pictures that show two moments, and by how many degrees it may be wrong:
    /// how much of the latency is the picture's, not the command's, nobody knows.
    fn turned(&self, start: Time, end: Time, delays: &Delays) -> Option<(PanTilt, f64)> {
        let turned = |late: Duration| Some(self.seen_until(end + late)? - self.seen_until(start + late)?);
        let doubt = (turned(delays.sum())? - turned(Duration::ZERO)?) / 4.0;
        Some((turned(delays.video)?, doubt.largest()))
    }

    fn seen_until(&self, time: Time) -> Option<PanTilt> {
        let above = self.seen.partition_point(|(at, _)| *at < time);
        let (high_at, high) = self.seen.get(above)?;
        let (low_at, low) = match above.checked_sub(1) {
            Some(below) => self.seen.get(below)?,
            None if *high_at == time => return Some(*high),
            None => return None,
        };
        let share = (time - *low_at).as_secs_f64() / (*high_at - *low_at).as_secs_f64();
        Some(*low + (*high - *low) * share)
    }

    fn find(&mut self, moved: PanTilt, seen: PanTilt, doubt_deg: f64) {
        let (square, along) = (moved.dot(moved), moved.dot(seen));
        let vagueness = (Self::NOISE_DEG + doubt_deg) / square.sqrt() + 0.02;
        let factor = square / along;
        // What is no number compares with nothing.
        if !(factor > 0.0 && factor.is_finite() && vagueness <= Self::VAGUE) {
            return;
        }
        self.found.push_back((factor.ln(), vagueness.powi(-2)));
        if self.found.len() > Self::FINDINGS {
            self.found.pop_front();
        }
        let limit = Self::LARGEST_FACTOR.ln();
        self.logarithm = self.median().clamp(-limit, limit);
    }

    /// The middle of all findings by their weight, the assumption among them.
    fn median(&self) -> f64 {
        let assumed = (0.0, Self::PRIOR.powi(-2));
        let mut all: Vec<_> = self.found.iter().copied().chain([assumed]).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = all.iter().map(|(_, weight)| weight).sum::<f64>() / 2.0;
        let mut sum = 0.0;
        let middle = all.iter().find(|(_, weight)| {
            sum += weight;
            sum >= half
        });
        middle.map_or(0.0, |(logarithm, _)| *logarithm)
    }
}
