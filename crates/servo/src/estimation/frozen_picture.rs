// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use super::Measurement;
use crate::Time;
use crate::model::{CommandHistory, Delays};

/// Tells whether the picture stays the same though the camera was told to turn: the video is frozen, or the camera does not
/// turn. Steering by it would turn the camera on and on.
#[derive(Debug, Default)]
pub struct FrozenPictureDetector {
    frozen: bool,
    /// Pictures in a row that showed the background to move.
    moving: u32,
    /// When the last of enough of them was taken.
    moved_at: Time,
    /// When the camera was first sent to a position since the picture changed.
    sent_off: Option<Time>,
    /// When the camera last did not answer.
    out_of_touch: Option<Time>,
}

impl FrozenPictureDetector {
    /// By then a command shows in the picture, or after the delay that was learned.
    const SHOWN_AFTER: Duration = Duration::from_millis(1200);

    /// Pictures that have to agree on the background's motion: one may be made anew by the encoder.
    const PICTURES: u32 = 5;

    /// Delays are tried in steps of this.
    const STEP: Duration = Duration::from_millis(100);

    /// A turn by this part of the view within so long is seen. Some cameras do not turn at all where they are told to turn
    /// more slowly.
    const SEEN_FIELDS: f64 = 0.04;
    const WITHIN: Duration = Duration::from_millis(800);

    /// Whoever turns round, late as commands may be, rests for a shorter moment.
    const LONGER_THAN: Duration = Duration::from_millis(300);

    /// The camera was told then to go to a position.
    pub fn sent_off(&mut self, at: Time) {
        self.sent_off.get_or_insert(at);
    }

    /// The camera does not answer: whether it goes on as it was told last, nobody knows.
    pub fn out_of_touch(&mut self, at: Time) {
        self.out_of_touch = Some(at);
    }

    /// Takes a picture `fov_deg` wide, and the rates that the camera was told.
    pub fn see(&mut self, picture: &Measurement, fov_deg: f64, history: &CommandHistory, delays: &Delays) {
        self.heed_background(picture);
        let Some(mut unchanged_for) = picture.unchanged_for else { return };
        // Before a dull wall hardly a pixel tells of a turn; but nobody turns for so long and nothing tells of it.
        if unchanged_for < Self::SHOWN_AFTER {
            unchanged_for = unchanged_for.min(picture.taken_at - self.moved_at);
        }
        let shown_after = Self::SHOWN_AFTER.max(delays.sum() + delays.uncertainty);
        let (taken_at, unchanged_since) = (picture.taken_at, picture.taken_at - unchanged_for);
        self.sent_off = self.sent_off.filter(|sent| *sent >= unchanged_since);
        let since = unchanged_since.max(taken_at - Self::WITHIN);
        let in_touch = self.out_of_touch.is_none_or(|at| at < taken_at - Self::WITHIN - shown_after);
        let turned = |delay| {
            let turn = history.rotation(since - delay, taken_at - delay);
            turn.largest() >= Self::SEEN_FIELDS * fov_deg
        };
        let mut delays = (0..).map(|step| Self::STEP * step).take_while(|delay| *delay <= shown_after);
        let has_moved = self.sent_off.is_some_and(|sent| taken_at >= sent + shown_after)
            || unchanged_for > Self::LONGER_THAN && delays.all(turned);
        // Once frozen it stays so until something changes.
        self.frozen = !unchanged_for.is_zero() && (self.frozen || in_touch && has_moved);
    }

    fn heed_background(&mut self, picture: &Measurement) {
        let Some(fields_s) = picture.background_fields_s() else { return };
        self.moving = if fields_s > Measurement::NOISE_FIELDS_S { self.moving + 1 } else { 0 };
        if self.moving >= Self::PICTURES {
            self.moved_at = picture.taken_at;
        }
    }

    /// Whether the last picture was.
    pub fn is_frozen(&self) -> bool {
        self.frozen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::PanTilt;
    use ptztrack_contract::Vector;

    const FOV_DEG: f64 = 55.0;

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    /// Pictures 40 ms apart; the camera is told `rate` from one second on, the picture stays the same from `frozen_from` on.
    /// When that is noticed, after the command, within five seconds.
    fn noticed(rate_deg_s: f64, frozen_from: u64, delays: &Delays) -> Option<u64> {
        let (mut detector, mut history) = (FrozenPictureDetector::default(), CommandHistory::default());
        history.push(ms(1000), PanTilt::new(rate_deg_s, 0.0));
        let frozen = |at: &u64| {
            let unchanged_for = Some(ms::<Duration>(at.saturating_sub(frozen_from)));
            let picture = Measurement { unchanged_for, ..Measurement::at(0.9, 0.5, ms(*at)) };
            detector.see(&picture, FOV_DEG, &history, delays);
            detector.is_frozen()
        };
        (0..150).map(|picture| 40 * picture).find(frozen).map(|at| at - 1000)
    }

    fn delays(latency: u64) -> Delays {
        Delays::of_sum(ms(latency), ms(50))
    }

    #[test]
    fn a_picture_that_stays_the_same_while_the_camera_turns_is_noticed_within_two_seconds() {
        assert_eq!(noticed(20.0, 0, &delays(200)), Some(1320));
        assert_eq!(noticed(3.0, 0, &delays(200)), Some(1960));
        assert_eq!(noticed(-20.0, 3000, &delays(200)), Some(2320), "while it turned already");
    }

    #[test]
    fn a_late_camera_a_slow_turn_and_a_picture_that_changes_are_no_frozen_picture() {
        assert_eq!(noticed(20.0, 0, &delays(1500)), Some(1640));
        assert_eq!(noticed(2.0, 0, &delays(200)), None, "some cameras do not turn so slowly");
        assert_eq!(noticed(0.0, 0, &delays(200)), None);
        assert_eq!(noticed(20.0, 6000, &delays(200)), None);
    }

    /// As by somebody who fills much of the view, before a wall without marks.
    #[test]
    fn a_picture_of_which_hardly_anything_changes_is_not_frozen_while_its_background_is_seen_to_move() {
        // A pixel in a hundred changes every so many pictures.
        let frozen = |changes: u64, fields_s: fn(u64) -> f64| {
            let (mut detector, mut history) = (FrozenPictureDetector::default(), CommandHistory::default());
            history.push(ms(0), PanTilt::new(10.0, 0.0));
            (1..200).any(|picture| {
                let unchanged_for = Some(ms::<Duration>(40 * (picture % changes)));
                let ego_velocity = Some(Vector { x: fields_s(picture), y: 0.0 });
                let at = Measurement::at(0.9, 0.5, ms(40 * picture));
                let measurement = Measurement { unchanged_for, ego_velocity, ..at };
                detector.see(&measurement, FOV_DEG, &history, &delays(200));
                detector.is_frozen()
            })
        };
        assert!(!frozen(25, |_| -10.0 / FOV_DEG));
        assert!(frozen(25, |_| 0.002), "that is noise");
        assert!(frozen(25, |picture| if picture % 25 < 4 { 0.1 } else { 0.0 }), "an encoder's");
        assert!(frozen(1000, |_| -10.0 / FOV_DEG), "nothing has changed for too long");
    }

    /// It may be at the end of its range by now, or have stopped by itself.
    #[test]
    fn what_a_camera_does_that_does_not_answer_tells_nothing() {
        let (mut detector, mut history) = (FrozenPictureDetector::default(), CommandHistory::default());
        history.push(ms(0), PanTilt::new(20.0, 0.0));
        let mut noticed = |at: u64, answers: bool| {
            if !answers {
                detector.out_of_touch(ms(at));
            }
            let unchanged_for = Some(ms::<Duration>(at - 1000));
            let picture = Measurement { unchanged_for, ..Measurement::at(0.9, 0.5, ms(at)) };
            detector.see(&picture, FOV_DEG, &history, &delays(200));
            detector.is_frozen()
        };
        let pictures = |from: u64, to: u64| (from / 40..to / 40).map(|picture| 40 * picture);
        assert!(!pictures(1000, 5000).any(|at| noticed(at, false)));
        assert!(!pictures(5000, 6900).any(|at| noticed(at, true)), "nor what it did a moment before");
        assert!(pictures(6900, 7100).any(|at| noticed(at, true)));
    }

    #[test]
    fn it_stays_noticed_until_something_changes() {
        let (mut detector, mut history) = (FrozenPictureDetector::default(), CommandHistory::default());
        history.push(ms(0), PanTilt::new(20.0, 0.0));
        let mut see = |history: &CommandHistory, at: u64, unchanged_for: u64| {
            let unchanged_for = Some(ms(unchanged_for));
            let picture = Measurement { unchanged_for, ..Measurement::at(0.9, 0.5, ms(at)) };
            detector.see(&picture, FOV_DEG, history, &delays(200));
            detector.is_frozen()
        };
        assert!(see(&history, 2000, 2000));
        history.push(ms(2000), PanTilt::default());
        assert!(see(&history, 9000, 9000));
        assert!(!see(&history, 9040, 0));
        assert!(!see(&history, 12_000, 2960));
    }

    #[test]
    fn a_move_to_a_position_has_to_show_too() {
        let see = |at: u64, unchanged_for: u64| {
            let mut detector = FrozenPictureDetector::default();
            detector.sent_off(ms(1000));
            let unchanged_for = Some(ms(unchanged_for));
            let picture = Measurement { unchanged_for, ..Measurement::at(0.9, 0.5, ms(at)) };
            detector.see(&picture, FOV_DEG, &CommandHistory::default(), &delays(200));
            detector.is_frozen()
        };
        assert!(see(2200, 1200));
        assert!(!see(2100, 1200), "it may yet");
        assert!(!see(3000, 1900), "it did");
    }
}
