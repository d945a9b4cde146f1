use std::time::Duration;

use super::PanTilt;
use crate::vapix::Position;

/// Moves from position to position: the next begins when the camera is at rest and was looked through since.
#[derive(Debug)]
pub struct Steps(Phase);

#[derive(Debug)]
enum Phase {
    AtRest { since: Duration },
    UnderWay { since: Duration, seen: Option<Position> },
}

impl Default for Steps {
    fn default() -> Self {
        Self(Phase::AtRest { since: Duration::ZERO })
    }
}

impl Steps {
    /// Positions this near to each other are the same.
    const SAME_DEG: f64 = 0.05;

    /// Zoom steps this near to each other are the same.
    const SAME_ZOOM: f64 = 10.0;

    /// How often the position is asked for while under way.
    pub const POLL: Duration = Duration::from_millis(150);

    /// A slower turn between two polls is noise, once a move has lasted long.
    const NOISE_DEG: f64 = 0.5;

    /// A move that lasts longer shows; also the wait for a camera that does not tell its position.
    const LONGEST: Duration = Duration::from_secs(3);

    /// Whether the picture taken then, with everything `latency` late, shows the camera at rest.
    pub fn shows_rest(&self, taken_at: Duration, latency: Duration) -> bool {
        matches!(self.0, Phase::AtRest { since } if since.is_zero() || taken_at >= since + latency)
    }

    /// Whether a move is under way.
    pub fn under_way(&self) -> bool {
        matches!(self.0, Phase::UnderWay { .. })
    }

    /// A move was accepted.
    pub fn begin(&mut self, now: Duration) {
        self.0 = Phase::UnderWay { since: now, seen: None };
    }

    /// A stop was accepted.
    pub fn rest(&mut self, now: Duration) {
        self.0 = Phase::AtRest { since: now };
    }

    /// The camera told its position, or would not; returns whether it has come to rest by this.
    pub fn position(&mut self, position: Option<Position>, now: Duration) -> bool {
        let Phase::UnderWay { since, seen } = &mut self.0 else { return false };
        let long = now.saturating_sub(*since) > Self::LONGEST;
        let tolerance_deg = if long { Self::NOISE_DEG } else { Self::SAME_DEG };
        let rests = match seen.zip(position) {
            Some((before, now)) => same(&before, &now, tolerance_deg),
            None => long,
        };
        if rests {
            self.rest(now);
            return true;
        }
        *seen = position;
        false
    }
}

fn same(before: &Position, now: &Position, tolerance_deg: f64) -> bool {
    let angles = |position: &Position| Some(PanTilt::new(position.pan_deg?, position.tilt_deg?));
    let turned = angles(before).zip(angles(now)).map(|(before, now)| (now - before).largest());
    let zoomed = before.zoom_steps.zip(now.zoom_steps).map(|(before, now)| (now - before).abs());
    turned.is_some_and(|turned| turned < tolerance_deg)
        && zoomed.is_none_or(|zoomed| zoomed < Steps::SAME_ZOOM)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(pan_deg: f64, zoom: f64) -> Option<Position> {
        Some(Position { pan_deg: Some(pan_deg), tilt_deg: Some(0.0), zoom_steps: Some(zoom) })
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_next_step_waits_for_rest_and_for_a_picture_of_it() {
        let mut steps = Steps::default();
        assert!(steps.shows_rest(ms(0), ms(200)));
        steps.begin(ms(1000));
        assert!(!steps.shows_rest(ms(5000), ms(200)));
        assert!(!steps.position(at(1.0, 500.0), ms(1000)));
        assert!(!steps.position(at(2.0, 900.0), ms(1150)));
        assert!(!steps.position(at(2.0, 999.0), ms(1300)));
        assert!(steps.position(at(2.01, 1000.0), ms(1450)));
        assert!(!steps.shows_rest(ms(1600), ms(200)));
        assert!(steps.shows_rest(ms(1650), ms(200)));
    }

    #[test]
    fn a_camera_that_does_not_tell_is_waited_for() {
        let mut steps = Steps::default();
        steps.begin(ms(1000));
        assert!(!steps.position(None, ms(2000)));
        assert!(steps.position(None, ms(4001)));
        assert!(!steps.under_way());
    }
}
