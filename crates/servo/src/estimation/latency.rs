// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::time::Duration;

use super::ObservedRotation;
use crate::model::{CommandHistory, Delays, PanTilt};

/// Learns how long a command takes to show in the picture: the delay at which the changes of the commanded
/// rate agree best with the changes of the rate seen. Only changes tell, so nothing is lost while the
/// camera turns evenly, and a wrong speed map does no harm.
#[derive(Debug)]
pub(super) struct LatencyEstimator {
    assumed: Duration,
    learned: Duration,
    uncertainty: Duration,
    recent: VecDeque<ObservedRotation>,
    /// Per candidate delay: squares of the commanded change, and its products with the change seen.
    commanded: [f64; CANDIDATES],
    product: [f64; CANDIDATES],
    /// Squares of the change seen.
    seen: f64,
}

/// Delays from zero on, in steps of ...
const CANDIDATES: usize = 61;

/// ... this.
const STEP: Duration = Duration::from_millis(25);

/// A change is that over this time: longer than noise lasts, shorter than the target's mood.
const CHANGE: Duration = Duration::from_millis(200);

/// Squares of changes, in fields of view per second, that make up one good look at the latency ...
const ENOUGH: f64 = 0.1;

/// ... and beyond which older ones fade.
const PLENTY: f64 = 1.5;

/// Seconds after which they count for a third, in any case: a long swing by a wrong latency is no calm walk.
const MEMORY_S: f64 = 12.0;

/// Agreement (0 to 1) below which what is seen has nothing to do with the commands.
const AGREEMENT: f64 = 0.4;

/// Agreement that a second away from what was assumed costs.
const RELUCTANCE: f64 = 0.1;

/// What is only assumed may be wrong by this; what was seen often enough, by a step.
const UNCERTAINTY: Duration = Duration::from_millis(150);

/// Part of the way to the best candidate that is gone in a second.
const PACE_PER_S: f64 = 3.0;

impl LatencyEstimator {
    /// Knows what is assumed.
    pub fn new(assumed: Duration) -> Self {
        Self {
            assumed,
            learned: assumed,
            uncertainty: UNCERTAINTY,
            recent: VecDeque::new(),
            commanded: [0.0; CANDIDATES],
            product: [0.0; CANDIDATES],
            seen: 0.0,
        }
    }

    /// What was assumed at first.
    pub fn assumed(&self) -> Duration {
        self.assumed
    }

    /// What is known by now.
    pub fn delays(&self) -> Delays {
        Delays::of_sum(self.learned, self.uncertainty)
    }

    /// Takes a turn that was seen; the picture is `fov_deg` wide.
    pub fn see(&mut self, turn: &ObservedRotation, history: &CommandHistory, fov_deg: f64) {
        if self.recent.back().is_some_and(|last| last.to != turn.from) {
            self.recent.clear();
        }
        self.recent.push_back(*turn);
        while self.recent.get(1).is_some_and(|next| next.to + CHANGE <= turn.to) {
            self.recent.pop_front();
        }
        let Some(earlier) = self.recent.front().filter(|earlier| earlier.to + CHANGE <= turn.to) else {
            return;
        };
        let unit = 1.0 / fov_deg;
        let change = (turn.rate - earlier.rate) * unit;
        self.seen += change.dot(change);
        for (index, (square, product)) in self.commanded.iter_mut().zip(&mut self.product).enumerate() {
            let delay = STEP * index as u32;
            let commanded = (rate(turn, delay, history) - rate(earlier, delay, history)) * unit;
            *square += commanded.dot(commanded);
            *product += commanded.dot(change);
        }
        self.keep((PLENTY / self.seen).min((-turn.seconds() / MEMORY_S).exp()));
        self.approach(turn.seconds());
    }

    /// The speeds that were compared proved wrong by so much (a logarithm): what that taught counts for less. Wild
    /// swings, while nothing was known yet, would else outweigh a calm walk for long.
    pub fn doubt(&mut self, wrong: f64) {
        self.keep((-wrong.abs()).exp());
    }

    fn keep(&mut self, part: f64) {
        self.seen *= part;
        for sum in self.commanded.iter_mut().chain(&mut self.product) {
            *sum *= part;
        }
    }

    /// Goes some way towards the best delay, if there is one.
    fn approach(&mut self, seconds: f64) {
        let Some(best) = self.best().filter(|_| self.seen > ENOUGH) else { return };
        let learned = self.learned.as_secs_f64();
        let part = (PACE_PER_S * seconds).min(1.0);
        self.learned = Duration::from_secs_f64((learned + (best - learned) * part).max(0.0));
        self.uncertainty = STEP + self.uncertainty.saturating_sub(STEP).mul_f64(1.0 - part);
    }

    /// The delay of the best agreement in seconds, between the candidates by a parabola.
    fn best(&self) -> Option<f64> {
        let score = |index: usize| {
            let away = (STEP * index as u32).as_secs_f64() - self.assumed.as_secs_f64();
            self.agreement(index) - RELUCTANCE * away * away
        };
        let best = (0..CANDIDATES).max_by(|a, b| score(*a).total_cmp(&score(*b)))?;
        if self.agreement(best) < AGREEMENT {
            return None;
        }
        let place = match (best.checked_sub(1), best + 1 < CANDIDATES) {
            (Some(before), true) => {
                let (low, top, high) = (score(before), score(best), score(best + 1));
                let bend = low - 2.0 * top + high;
                best as f64 + if bend < 0.0 { 0.5 * (low - high) / bend } else { 0.0 }
            }
            _ => best as f64,
        };
        Some(place * STEP.as_secs_f64())
    }

    /// Part of the change seen, 0 to 1, that the commands explain at a delay.
    fn agreement(&self, index: usize) -> f64 {
        let product = self.product[index].max(0.0);
        if product > 0.0 { product * product / (self.commanded[index] * self.seen) } else { 0.0 }
    }
}

/// The rate commanded for a turn, if it shows after this delay.
fn rate(turn: &ObservedRotation, delay: Duration, history: &CommandHistory) -> PanTilt {
    history.rotation(turn.from - delay, turn.to - delay) / turn.seconds()
}
