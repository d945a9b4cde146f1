use std::time::Duration;

use ptztrack_contract::CameraEvent;

/// Whether the camera moves, by a servo's word, which holds for [`CameraEvent::MOVING_HOLDS`] unless it is said again.
#[derive(Debug, Clone, Copy, Default)]
pub struct CameraMoves {
    holds: Duration,
}

impl CameraMoves {
    /// The servo says that the camera moves, or that it rests.
    pub fn hear(&mut self, moving: bool) {
        self.holds = if moving { CameraEvent::MOVING_HOLDS } else { Duration::ZERO };
    }

    /// So much time of the stream has passed.
    pub fn pass(&mut self, elapsed: Duration) {
        self.holds = self.holds.saturating_sub(elapsed);
    }

    /// Whether the camera moves, as far as is known.
    pub fn is_moving(self) -> bool {
        !self.holds.is_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Duration = Duration::from_millis(100);

    #[test]
    fn rests_until_it_hears_otherwise() {
        let mut camera = CameraMoves::default();
        assert!(!camera.is_moving());
        camera.hear(true);
        assert!(camera.is_moving());
        camera.hear(false);
        assert!(!camera.is_moving());
    }

    /// Whoever moved it may be gone.
    #[test]
    fn a_word_that_is_not_repeated_is_forgotten() {
        let mut camera = CameraMoves::default();
        camera.hear(true);
        camera.pass(CameraEvent::MOVING_HOLDS - TICK);
        assert!(camera.is_moving());
        camera.hear(true);
        camera.pass(TICK);
        assert!(camera.is_moving());
        camera.pass(CameraEvent::MOVING_HOLDS);
        assert!(!camera.is_moving());
    }
}
