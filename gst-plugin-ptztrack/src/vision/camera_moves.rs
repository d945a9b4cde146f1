// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::{CameraEvent, Homography};

/// Whether and how fast the camera moves, by a servo's word, which holds for [`CameraEvent::MOVING_HOLDS`] unless it is said
/// again.
#[derive(Debug, Clone, Copy, Default)]
pub struct CameraMoves {
    holds: Duration,
    /// How fast the picture goes to the right and down, frame widths and heights per second, where that is known.
    picture_rate: Option<(f64, f64)>,
}

impl CameraMoves {
    /// The servo says that the camera moves, or that it rests.
    pub fn hear(&mut self, camera: &CameraEvent) {
        self.holds = if camera.moving { CameraEvent::MOVING_HOLDS } else { Duration::ZERO };
        self.picture_rate = camera.picture_rate();
    }

    /// So much time of the stream has passed.
    pub fn pass(&mut self, elapsed: Duration) {
        self.holds = self.holds.saturating_sub(elapsed);
    }

    /// Whether the camera moves, as far as is known.
    pub fn is_moving(self) -> bool {
        !self.holds.is_zero()
    }

    /// Where the picture may have gone within `elapsed`, as the camera was told to move: the picture is older than that word,
    /// so that it is but a guess.
    pub fn expected_motion(self, elapsed: Duration) -> Option<Homography> {
        let (right, down) = self.picture_rate.filter(|_| self.is_moving())?;
        let elapsed_s = elapsed.as_secs_f64();
        Some(Homography::translation(right * elapsed_s, down * elapsed_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Duration = Duration::from_millis(100);
    const MOVES: CameraEvent = CameraEvent {
        moving: true,
        pan_deg: None,
        tilt_deg: None,
        pan_rate_deg_s: 30.0,
        tilt_rate_deg_s: 10.0,
        horizontal_fov_deg: Some(60.0),
        vertical_fov_deg: Some(40.0),
    };

    #[test]
    fn rests_until_it_hears_otherwise() {
        let mut camera = CameraMoves::default();
        assert!(!camera.is_moving());
        camera.hear(&MOVES);
        assert!(camera.is_moving());
        camera.hear(&CameraEvent { moving: false, ..MOVES });
        assert!(!camera.is_moving());
    }

    /// Whoever moved it may be gone.
    #[test]
    fn a_word_that_is_not_repeated_is_forgotten() {
        let mut camera = CameraMoves::default();
        camera.hear(&MOVES);
        camera.pass(CameraEvent::MOVING_HOLDS - TICK);
        assert!(camera.is_moving());
        camera.hear(&MOVES);
        camera.pass(TICK);
        assert!(camera.is_moving());
        camera.pass(CameraEvent::MOVING_HOLDS);
        assert!(!camera.is_moving());
    }

    #[test]
    fn the_picture_is_expected_to_go_on_as_the_camera_was_told() {
        let mut camera = CameraMoves::default();
        assert_eq!(camera.expected_motion(TICK), None);
        camera.hear(&MOVES);
        assert_eq!(camera.expected_motion(TICK), Some(Homography::translation(-0.05, 0.025)));
        camera.hear(&CameraEvent { horizontal_fov_deg: None, ..MOVES });
        assert_eq!(camera.expected_motion(TICK), None, "how much of the picture a degree is, is not known");
        camera.hear(&MOVES);
        camera.pass(CameraEvent::MOVING_HOLDS);
        assert_eq!(camera.expected_motion(TICK), None, "long ago");
    }
}
