// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::CameraEvent;

use super::camera_moves::CameraMoves;

/// Whether the picture is worth looking at: not while the tracker follows somebody, nor while the camera
/// moves and the picture with it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Duty {
    asleep: bool,
    camera: CameraMoves,
    /// How much longer the pictures may still show the camera moving.
    settling: Duration,
}

impl Duty {
    /// The tracker follows somebody, or no longer does.
    pub fn sleep(&mut self, asleep: bool) {
        self.asleep = asleep;
    }

    /// The camera moves, or no longer does. It rests before its pictures do: they are older than the
    /// news, by `settle_time` at most.
    pub fn camera(&mut self, camera: &CameraEvent, settle_time: Duration) {
        if self.camera.is_moving() && !camera.moving {
            self.settling = settle_time;
        }
        self.camera.hear(camera);
    }

    /// Whether to look at the next picture, which comes `elapsed` after the one before.
    pub fn looks(&mut self, elapsed: Duration) -> bool {
        self.camera.pass(elapsed);
        let (settled, rests) = (self.settling.is_zero(), !self.camera.is_moving());
        if rests {
            self.settling = self.settling.saturating_sub(elapsed);
        }
        settled && rests && !self.asleep
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(100);

    fn word(moving: bool) -> CameraEvent {
        CameraEvent { moving, ..CameraEvent::default() }
    }

    #[test]
    fn looks_unless_told_otherwise() {
        assert!(Duty::default().looks(STEP));
    }

    #[test]
    fn sleeps_until_woken() {
        let mut duty = Duty::default();
        duty.sleep(true);
        assert!(!duty.looks(STEP));
        duty.sleep(false);
        assert!(duty.looks(STEP));
    }

    #[test]
    fn looks_again_when_the_pictures_have_settled() {
        let mut duty = Duty::default();
        duty.camera(&word(true), 3 * STEP);
        assert!(!duty.looks(STEP));
        duty.camera(&word(false), 3 * STEP);
        let looks: Vec<bool> = (0..5).map(|_| duty.looks(STEP)).collect();
        assert_eq!(looks, [false, false, false, true, true]);
    }

    #[test]
    fn moving_again_while_settling_settles_again() {
        let mut duty = Duty::default();
        duty.camera(&word(true), 2 * STEP);
        duty.camera(&word(false), 2 * STEP);
        assert!(!duty.looks(STEP));
        duty.camera(&word(true), 2 * STEP);
        assert!(!duty.looks(STEP));
        duty.camera(&word(false), 2 * STEP);
        let looks: Vec<bool> = (0..3).map(|_| duty.looks(STEP)).collect();
        assert_eq!(looks, [false, false, true]);
    }

    /// Whoever said so may be gone.
    #[test]
    fn a_camera_moves_for_two_seconds_unless_that_is_said_again() {
        let mut duty = Duty::default();
        let mut looks_within = |said: &[u32]| {
            (0..25).position(|frame| {
                if said.contains(&frame) {
                    duty.camera(&word(true), Duration::ZERO);
                }
                duty.looks(STEP)
            })
        };
        assert_eq!(looks_within(&[0]), Some(19));
        assert_eq!(looks_within(&[0, 10]), None);
    }

    #[test]
    fn news_of_a_camera_at_rest_change_nothing() {
        let mut duty = Duty::default();
        duty.camera(&word(false), 10 * STEP);
        assert!(duty.looks(STEP));
    }
}
