use std::time::Duration;

/// Whether the picture is worth looking at: not while the tracker follows somebody, nor while the camera
/// moves and the picture with it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Duty {
    asleep: bool,
    moving: bool,
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
    pub fn camera(&mut self, moving: bool, settle_time: Duration) {
        if self.moving && !moving {
            self.settling = settle_time;
        }
        self.moving = moving;
    }

    /// Whether to look at the next picture, which comes `elapsed` after the one before.
    pub fn looks(&mut self, elapsed: Duration) -> bool {
        let settled = self.settling.is_zero();
        if !self.moving {
            self.settling = self.settling.saturating_sub(elapsed);
        }
        settled && !self.moving && !self.asleep
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(100);

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
        duty.camera(true, 3 * STEP);
        assert!(!duty.looks(STEP));
        duty.camera(false, 3 * STEP);
        let looks: Vec<bool> = (0..5).map(|_| duty.looks(STEP)).collect();
        assert_eq!(looks, [false, false, false, true, true]);
    }

    #[test]
    fn moving_again_while_settling_settles_again() {
        let mut duty = Duty::default();
        duty.camera(true, 2 * STEP);
        duty.camera(false, 2 * STEP);
        assert!(!duty.looks(STEP));
        duty.camera(true, 2 * STEP);
        assert!(!duty.looks(STEP));
        duty.camera(false, 2 * STEP);
        let looks: Vec<bool> = (0..3).map(|_| duty.looks(STEP)).collect();
        assert_eq!(looks, [false, false, true]);
    }

    #[test]
    fn news_of_a_camera_at_rest_change_nothing() {
        let mut duty = Duty::default();
        duty.camera(false, 10 * STEP);
        assert!(duty.looks(STEP));
    }
}
