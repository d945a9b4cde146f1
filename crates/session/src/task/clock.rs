// SPDX-License-Identifier: MPL-2.0

//! The servo's clock.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use ptztrack_contract::lock::lock;
use servo::Time;
use tokio::time::sleep;

/// A clock that runs, or that is held by a stream whose time is not the world's. It never goes back.
#[derive(Debug)]
pub struct Clock {
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    reading: Time,
    /// The stream's own time, where it was last held.
    stream: Duration,
    /// Since when it has been running from that reading; `None` while it is held.
    running_since: Option<Instant>,
}

impl Clock {
    /// Runs from zero.
    pub fn running() -> Self {
        Self::at_zero(Some(Instant::now()))
    }

    /// Stands at zero.
    pub fn held() -> Self {
        Self::at_zero(None)
    }

    fn at_zero(running_since: Option<Instant>) -> Self {
        Self { state: Mutex::new(State { reading: Time::ZERO, stream: Duration::ZERO, running_since }) }
    }

    /// What it shows.
    pub fn now(&self) -> Time {
        self.with(|state| state.now())
    }

    /// Lets it stand at the stream's time. Where that goes back, as after a seek, nothing has elapsed: it goes
    /// on from there, and does not wait until the stream is where it was.
    pub fn hold_at(&self, time: Duration) {
        self.with(|state| {
            let elapsed = time.saturating_sub(state.stream);
            *state = State { reading: state.now() + elapsed, stream: time, running_since: None };
        });
    }

    /// Lets it run on from where it stands.
    pub fn run(&self) {
        self.with(|state| {
            *state = State { reading: state.now(), running_since: Some(Instant::now()), ..*state };
        });
    }

    /// Sleeps until a time; for ever where there is none, or nobody knows when it comes. Whoever changes
    /// the clock has to wake the sleeper.
    pub async fn sleep_until(&self, time: Option<Time>) {
        let left = self.with(|state| {
            state.running_since?;
            Some(time? - state.now())
        });
        match left {
            Some(left) => sleep(left).await,
            None => std::future::pending().await,
        }
    }

    fn with<T>(&self, action: impl FnOnce(&mut State) -> T) -> T {
        action(&mut lock(&self.state))
    }
}

impl State {
    fn now(&self) -> Time {
        self.reading + self.running_since.map_or(Duration::ZERO, |since| since.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn held_it_stands_and_never_goes_back() {
        let clock = Clock::held();
        assert_eq!(clock.now(), Time::ZERO);
        clock.hold_at(SECOND);
        assert_eq!(clock.now(), Time::from(SECOND));
        clock.hold_at(SECOND / 2);
        assert_eq!(clock.now(), Time::from(SECOND));
    }

    #[test]
    fn a_stream_that_goes_back_is_followed_from_there() {
        let clock = Clock::held();
        for (stream, shown) in [(3600, 3600), (0, 3600), (2, 3602), (1, 3602), (3600, 7201)] {
            clock.hold_at(stream * SECOND);
            assert_eq!(clock.now(), Time::from(shown * SECOND));
        }
    }

    #[test]
    fn let_go_it_runs_on_from_there() {
        let clock = Clock::held();
        clock.hold_at(SECOND);
        clock.run();
        let earlier = clock.now();
        assert!(earlier >= Time::from(SECOND));
        while clock.now() == earlier {
            std::hint::spin_loop();
        }
    }
}
