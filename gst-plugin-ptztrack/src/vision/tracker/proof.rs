use opencv::core::{Point2f, Rect2f};

use super::geometry::length;

/// Seconds of sight of the background within which a target must have moved against it.
const TIME_S: f32 = 1.5;
/// How far, as a share of the target's width, and at least, in pixels: more than points wander on a wall.
const DISTANCE_SHARE: f32 = 0.15;
const MIN_DISTANCE: f32 = 3.0;

/// Whether a target has shown that it moves by itself.
///
/// A motion detector reports what moved. What then stays with the background was a leaf, a shadow, or the street
/// beside somebody who has walked out of the box: held on to, it would be followed for ever.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionProof {
    moved: Point2f,
    watched_s: f32,
    given: bool,
}

impl MotionProof {
    /// `owed`: it must show it. Not where an operator chose: that may be somebody who stands.
    pub fn new(owed: bool) -> Self {
        Self { moved: Point2f::default(), watched_s: 0.0, given: !owed }
    }

    /// Takes a motion of the target against the background, in pixels over `dt_s` seconds.
    pub fn watch(&mut self, own: Point2f, dt_s: f32, bounds: Rect2f) {
        self.moved += own;
        self.watched_s += dt_s;
        self.given |= length(self.moved) > (DISTANCE_SHARE * bounds.width).max(MIN_DISTANCE);
    }

    /// The target had its time and did not move.
    pub fn failed(&self) -> bool {
        !self.given && self.watched_s > TIME_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERSON: Rect2f = Rect2f { x: 0.0, y: 0.0, width: 40.0, height: 100.0 };

    fn after(frames: usize, own: impl Fn(usize) -> f32) -> MotionProof {
        let mut proof = MotionProof::new(true);
        for frame in 0..frames {
            proof.watch(Point2f::new(own(frame), 0.0), 0.1, PERSON);
        }
        proof
    }

    #[test]
    fn what_only_trembles_fails_once_its_time_is_over() {
        let tremble = |frame| if frame % 2 == 0 { 2.0 } else { -2.0 };
        assert!(!after(14, tremble).failed());
        assert!(after(16, tremble).failed());
    }

    #[test]
    fn who_owes_nothing_may_stand() {
        let mut proof = MotionProof::new(false);
        proof.watch(Point2f::default(), 60.0, PERSON);
        assert!(!proof.failed());
    }

    #[test]
    fn a_slow_walker_passes_and_may_stand_afterwards() {
        assert!(!after(100, |frame| if frame < 10 { 0.7 } else { 0.0 }).failed());
    }
}
