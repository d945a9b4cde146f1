// SPDX-License-Identifier: MPL-2.0

use std::time::{Duration, Instant};

/// When a camera that refuses user and password is tried again, though they have worked: one that is starting may refuse everybody, and
/// one that was attacked may have locked the account for a while. Whether they have worked outlives the program, and what is kept says
/// nothing of the password: one that was changed in the meantime, for a wrong one, is tried as often. That is seven times in the first
/// ten and a half minutes, and then every ten minutes: cameras that lock an account after five or ten such tries do so for minutes,
/// to others as well who use it; which an account of its own for this program avoids. To give up a camera after a power cut, until
/// somebody comes, costs more.
#[derive(Debug, Default)]
pub struct Refusals {
    pause: Option<Duration>,
    until: Option<Instant>,
    /// Pictures there were at the last refusal.
    pictures: u64,
}

impl Refusals {
    const SHORTEST: Duration = Duration::from_secs(10);
    const LONGEST: Duration = Duration::from_secs(600);

    /// It has refused, after so many pictures.
    pub fn wait(&mut self, pictures: u64) {
        let worked_since = pictures > self.pictures;
        let pause = match self.pause {
            Some(pause) if !worked_since => (pause * 2).min(Self::LONGEST),
            _ => Self::SHORTEST,
        };
        (self.pause, self.until, self.pictures) = (Some(pause), Some(Instant::now() + pause), pictures);
    }

    /// Whether it is not time yet.
    pub fn are_waited_for(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() < until)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_account_that_worked_is_tried_again_at_growing_pauses() {
        let mut refusals = Refusals::default();
        let mut pause = |pictures| {
            refusals.wait(pictures);
            assert!(refusals.are_waited_for());
            refusals.pause.unwrap().as_secs()
        };
        assert_eq!([7, 7, 7, 9, 9].map(&mut pause), [10, 20, 40, 10, 20]);
        assert_eq!((0..9).map(|_| pause(9)).last(), Some(600));
    }
}
