// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::MotionChange;

/// When motion starts and ends: somebody who hesitates for a moment has not left.
#[derive(Debug, Default)]
pub struct Presence {
    /// How long nothing has moved; `None` while there is no motion to end.
    still_for: Option<Duration>,
}

impl Presence {
    /// What the next picture, `elapsed` after the one before, changes. Motion ends when nothing has moved
    /// for `end_delay`.
    pub fn update(&mut self, moves: bool, elapsed: Duration, end_delay: Duration) -> Option<MotionChange> {
        let before = self.still_for;
        if moves {
            self.still_for = Some(Duration::ZERO);
            return before.is_none().then_some(MotionChange::Start);
        }
        let still_for = before? + elapsed;
        self.still_for = (still_for < end_delay).then_some(still_for);
        self.still_for.is_none().then_some(MotionChange::End)
    }

    /// Ends whatever motion there is, for the stream is over.
    pub fn finish(&mut self) -> Option<MotionChange> {
        self.still_for.take().map(|_| MotionChange::End)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(100);

    fn changes(moves: &[bool], end_delay: Duration) -> Vec<Option<MotionChange>> {
        let mut presence = Presence::default();
        moves.iter().map(|moves| presence.update(*moves, STEP, end_delay)).collect()
    }

    #[test]
    fn stillness_changes_nothing() {
        assert_eq!(changes(&[false; 5], Duration::ZERO), [None; 5]);
        assert_eq!(Presence::default().finish(), None);
    }

    #[test]
    fn motion_ends_after_the_delay() {
        let (start, end) = (Some(MotionChange::Start), Some(MotionChange::End));
        let moves = [true, true, false, false, true, false, false, false, false];
        let expected = [start, None, None, None, None, None, None, end, None];
        assert_eq!(changes(&moves, 3 * STEP), expected);
        assert_eq!(changes(&[true, false, true], Duration::ZERO), [start, end, start]);
    }

    #[test]
    fn the_end_of_the_stream_ends_motion_once() {
        let mut presence = Presence::default();
        presence.update(true, STEP, STEP);
        assert_eq!(presence.finish(), Some(MotionChange::End));
        assert_eq!(presence.finish(), None);
    }
}
