//! The servo's clock.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::time::sleep;

/// A clock that runs, or that is held by a stream whose time is not the world's. It never goes back.
#[derive(Debug)]
pub struct Clock {
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    reading: Duration,
    /// Since when it has been running from that reading; `None` while it is held.
    running_since: Option<Instant>,
}

impl Clock {
    /// Runs from zero.
    pub fn running() -> Self {
        Self { state: Mutex::new(State { reading: Duration::ZERO, running_since: Some(Instant::now()) }) }
    }

    /// Stands at zero.
    pub fn held() -> Self {
        Self { state: Mutex::new(State { reading: Duration::ZERO, running_since: None }) }
    }

    /// What it shows.
    pub fn now(&self) -> Duration {
        self.with(|state| state.now())
    }

    /// Lets it stand at a time; at its own where that is later.
    pub fn hold_at(&self, time: Duration) {
        self.with(|state| *state = State { reading: state.now().max(time), running_since: None });
    }

    /// Lets it run on from where it stands.
    pub fn run(&self) {
        self.with(|state| *state = State { reading: state.now(), running_since: Some(Instant::now()) });
    }

    /// Sleeps until a time; for ever where there is none, or nobody knows when it comes. Whoever changes
    /// the clock has to wake the sleeper.
    pub async fn sleep_until(&self, time: Option<Duration>) {
        let left = self.with(|state| {
            state.running_since?;
            Some(time?.saturating_sub(state.now()))
        });
        match left {
            Some(left) => sleep(left).await,
            None => std::future::pending().await,
        }
    }

    fn with<T>(&self, action: impl FnOnce(&mut State) -> T) -> T {
        action(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl State {
    fn now(&self) -> Duration {
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
        assert_eq!(clock.now(), Duration::ZERO);
        clock.hold_at(SECOND);
        assert_eq!(clock.now(), SECOND);
        clock.hold_at(SECOND / 2);
        assert_eq!(clock.now(), SECOND);
    }

    #[test]
    fn let_go_it_runs_on_from_there() {
        let clock = Clock::held();
        clock.hold_at(SECOND);
        clock.run();
        let earlier = clock.now();
        assert!(earlier >= SECOND);
        while clock.now() == earlier {
            std::hint::spin_loop();
        }
    }
}
