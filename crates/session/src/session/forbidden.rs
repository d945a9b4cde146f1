// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::Error;

/// A camera refuses user and password that it accepted before, and nothing has succeeded since. To ask again could lock the
/// account, or keep it locked.
#[derive(Debug, Clone, PartialEq)]
pub struct Forbidden {
    /// What it said last.
    pub(super) error: Error,
    /// From then to the next try.
    pub(super) pause: Duration,
}

impl Forbidden {
    /// After the second refusal; twice as long after each one more.
    pub const PAUSE: Duration = Duration::from_secs(10);

    /// At most.
    pub const RARELY: Duration = Duration::from_secs(60);

    /// One more refusal. Returns when to try again: after the first one soon, as a server that restarts between challenge and
    /// answer refuses alike.
    pub fn again(refused: &mut Option<Self>, error: &Error, soon: Duration) -> Duration {
        let longer = |before: &Self| (2 * before.pause).clamp(Self::PAUSE, Self::RARELY);
        let pause = refused.as_ref().map_or(soon, longer);
        *refused = Some(Self { error: error.clone(), pause });
        pause
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_refusal_is_followed_by_a_long_pause_and_each_more_by_a_longer_one() {
        let error = Error::NotPermitted { user: "root".to_owned() };
        let mut refused = None;
        let soon = Duration::from_millis(500);
        let pauses = [0; 6].map(|_| Forbidden::again(&mut refused, &error, soon).as_millis());
        assert_eq!(pauses, [500, 10_000, 20_000, 40_000, 60_000, 60_000]);
    }
}
