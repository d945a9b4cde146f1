// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::Time;
use crate::model::{Delays, Position};

/// Moves from position to position: the next begins when the camera is at rest and was looked through since.
#[derive(Debug)]
pub struct PointToPoint {
    phase: Phase,
    /// How long the last one took that came to rest by itself.
    lasted: Duration,
}

#[derive(Debug)]
enum Phase {
    AtRest {
        since: Time,
    },
    /// `seen`: where the camera was, and when.
    UnderWay {
        since: Time,
        seen: Option<(Position, Time)>,
    },
}

impl Default for PointToPoint {
    fn default() -> Self {
        Self { phase: Phase::AtRest { since: Time::ZERO }, lasted: Self::USUAL }
    }
}

impl PointToPoint {
    /// Positions this near to each other are the same.
    const SAME_DEG: f64 = 0.05;

    /// Parts of the zoom's travel this near to each other are the same.
    const SAME_ZOOM: f64 = 0.001;

    /// As long as a step of some degrees takes until it is seen to be over.
    const USUAL: Duration = Duration::from_millis(600);

    /// A slower turn between two polls is noise, once a move has lasted long.
    const NOISE_DEG: f64 = 0.5;

    /// A move that lasts longer shows; also the wait for a camera that does not tell its position.
    const LONGEST: Duration = Duration::from_secs(3);

    /// Whether the picture taken then, shows the camera at rest.
    pub fn shows_rest(&self, taken_at: Time, delays: &Delays) -> bool {
        matches!(self.phase, Phase::AtRest { since } if since == Time::ZERO || taken_at >= since + delays.sum())
    }

    /// Whether the picture taken then shows the camera where it last rested.
    pub fn shows_last_rest(&self, taken_at: Time, delays: &Delays) -> bool {
        match self.phase {
            Phase::AtRest { .. } => self.shows_rest(taken_at, delays),
            Phase::UnderWay { since, .. } => taken_at < since + delays.sum(),
        }
    }

    /// Whether a move is under way.
    pub fn under_way(&self) -> bool {
        matches!(self.phase, Phase::UnderWay { .. })
    }

    /// How long it will be from one step to the next, by the last one.
    pub fn interval(&self, delays: &Delays) -> Duration {
        self.lasted + delays.sum()
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        if let Phase::UnderWay { since, seen: Some((_, at)) } = &self.phase {
            assert!(at >= since, "seen under way at {at:?}, begun at {since:?}");
        }
    }

    /// A move that was sent then was accepted.
    pub fn begin(&mut self, sent: Time) {
        self.phase = Phase::UnderWay { since: sent, seen: None };
    }

    /// A stop was accepted.
    pub fn rest(&mut self, now: Time) {
        self.phase = Phase::AtRest { since: now };
    }

    /// The camera told its position, or would not; returns whether it has come to rest by this. A command acts within
    /// the `latency`.
    pub fn position(&mut self, position: Option<Position>, now: Time, delays: &Delays) -> bool {
        let Phase::UnderWay { since, seen } = &mut self.phase else { return false };
        let begun = *since;
        let lasted = now - begun;
        let long = lasted > Self::LONGEST;
        let tolerance_deg = if long { Self::NOISE_DEG } else { Self::SAME_DEG };
        let rests_since = match seen.zip(position) {
            Some(((before, at), position)) => same(&before, &position, tolerance_deg).then_some(at),
            None => long.then_some(now),
        };
        if let Some(since) = rests_since {
            self.lasted = since - begun;
            self.rest(since);
            return true;
        }
        // Before it begins it is at rest too.
        *seen = position.filter(|_| lasted >= delays.sum()).map(|position| (position, now));
        false
    }
}

fn same(before: &Position, now: &Position, tolerance_deg: f64) -> bool {
    let turned = before.pan_tilt().zip(now.pan_tilt()).map(|(before, now)| before.turn_to(now).largest());
    let zoomed = before.zoom.zip(now.zoom).map(|(before, now)| (now - before).abs());
    turned.is_some_and(|turned| turned < tolerance_deg)
        && zoomed.is_none_or(|zoomed| zoomed < PointToPoint::SAME_ZOOM)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(pan_deg: f64, zoom: f64) -> Option<Position> {
        Some(Position { pan_deg: Some(pan_deg), tilt_deg: Some(0.0), zoom: Some(zoom / 10_000.0) })
    }

    fn late(ms: u64) -> Delays {
        Delays::of_sum(Duration::from_millis(ms), Duration::ZERO)
    }

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    #[test]
    fn the_next_step_waits_for_rest_and_for_a_picture_of_it() {
        let mut steps = PointToPoint::default();
        assert!(steps.shows_rest(ms(0), &late(200)));
        steps.begin(ms(1000));
        assert!(!steps.shows_rest(ms(5000), &late(200)));
        assert!(!steps.position(at(1.0, 500.0), ms(1000), &late(200)));
        assert!(!steps.position(at(2.0, 900.0), ms(1150), &late(200)));
        assert!(!steps.position(at(2.0, 999.0), ms(1300), &late(200)));
        assert!(steps.position(at(2.01, 1000.0), ms(1450), &late(200)));
        // It rested at 1300, before that was known.
        assert!(!steps.shows_rest(ms(1450), &late(200)));
        assert!(steps.shows_rest(ms(1500), &late(200)));
        assert_eq!(steps.interval(&late(200)), ms(500));
    }

    #[test]
    fn before_it_begins_a_step_is_not_over() {
        let mut steps = PointToPoint::default();
        steps.begin(ms(1000));
        assert!(steps.shows_last_rest(ms(1499), &late(500)));
        assert!(!steps.shows_last_rest(ms(1500), &late(500)));
        for now in [1150, 1300, 1450, 1600] {
            assert!(!steps.position(at(1.0, 500.0), ms(now), &late(500)), "{now}");
        }
        assert!(steps.position(at(1.0, 500.0), ms(1750), &late(500)));
    }

    #[test]
    fn a_camera_that_does_not_tell_is_waited_for() {
        let mut steps = PointToPoint::default();
        steps.begin(ms(1000));
        assert!(!steps.position(None, ms(2000), &late(200)));
        assert!(steps.position(None, ms(4001), &late(200)));
        assert!(!steps.under_way());
    }
}
