// SPDX-License-Identifier: MPL-2.0

//! The lease that has the watchdog stop the camera where this process cannot any more.

use std::sync::Arc;
use std::time::Instant;

use crate::watchdog::{Lease, Standing, StopOrder, Unavailable, Watchdog};

/// What `stats` says of it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum DeadManState {
    /// Not wanted.
    #[default]
    Off,
    /// The camera rests.
    Ready,
    /// The camera may move, and is stopped if this process dies or hangs.
    Armed,
    /// There is no watchdog.
    Unavailable,
}

impl DeadManState {
    /// As it is in `stats`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Ready => "ready",
            Self::Armed => "armed",
            Self::Unavailable => "unavailable",
        }
    }
}

/// Held while the camera may move on our behalf. Time is the world's here: another process counts it.
#[derive(Debug)]
pub struct DeadMan {
    lease: Option<Lease>,
    state: DeadManState,
    /// There is none, and that was told: a camera at rest does not wait for whether the next one answers.
    gave_up: bool,
    /// What the watchdog was told last ...
    order: Option<StopOrder>,
    /// ... which does not hold any more.
    is_outdated: bool,
}

impl DeadMan {
    /// Nothing is held yet, nor started. Without a watchdog there is nothing to be held.
    pub fn new(watchdog: Option<Arc<Watchdog>>) -> Self {
        let state = if watchdog.is_some() { DeadManState::Ready } else { DeadManState::Off };
        Self { lease: watchdog.map(Lease::new), state, gave_up: false, order: None, is_outdated: false }
    }

    /// What is to be said of it.
    pub fn state(&self) -> DeadManState {
        self.state
    }

    /// Looks whether there is something to be started, before it is needed; what is to be told once.
    pub fn check(&mut self) -> Option<Unavailable> {
        let checked = self.lease.as_ref()?.check();
        self.failed(checked.err()?)
    }

    /// Asks for the lease, or renews it, before a move is sent or while it lasts.
    pub fn hold(&mut self, order: StopOrder) {
        if let Some(lease) = &mut self.lease {
            lease.hold(order.clone());
            (self.order, self.is_outdated) = (Some(order), false);
        }
    }

    /// Renews it where it is time to, and sees how it stands; what is to be told once.
    pub fn keep(&mut self) -> Option<Unavailable> {
        let lease = self.lease.as_mut()?;
        if lease.renew_at().is_some_and(|at| at <= Instant::now())
            && let Some(order) = &self.order
        {
            lease.renew(order.clone());
        }
        match lease.standing()? {
            Standing::Held => (self.state, self.gave_up) = (DeadManState::Armed, false),
            Standing::Awaited => {}
            Standing::Starting(why) if !self.gave_up => return self.waits(why),
            Standing::Starting(_) => {}
            Standing::Failed(failure) => return self.failed(failure),
        }
        None
    }

    /// Whether a camera at rest is not to be moved yet: it is not known whether there is a watchdog to stop it.
    pub fn is_awaited(&self) -> bool {
        let standing = || self.lease.as_ref().and_then(Lease::standing);
        !self.gave_up && matches!(standing(), Some(Standing::Awaited | Standing::Starting(_)))
    }

    /// Whether the watchdog knows something else of what is in doubt, or nothing.
    pub fn is_outdated(&self, in_doubt: bool) -> bool {
        self.is_outdated || self.order.as_ref().is_none_or(|order| order.in_doubt != in_doubt)
    }

    /// The watchdog is to be told anew; until then what it was told is renewed.
    pub fn outdate(&mut self) {
        self.is_outdated = true;
    }

    /// Resolves when it is to be renewed, or how it stands may have changed.
    pub async fn due(&self) {
        let Some((lease, at)) = self.lease.as_ref().and_then(|lease| lease.renew_at().map(|at| (lease, at)))
        else {
            return std::future::pending().await;
        };
        tokio::select! {
            () = tokio::time::sleep_until(at.into()) => {}
            () = lease.settled(), if self.is_awaited() => {}
        }
    }

    /// The camera rests, or is not ours to stop.
    pub fn release(&mut self) {
        self.order = None;
        if let Some(lease) = &mut self.lease {
            lease.release();
        }
        if self.state == DeadManState::Armed {
            self.state = DeadManState::Ready;
        }
    }

    /// The watchdog only starts: a camera that moves is not stopped for that, and one that rests waits.
    fn waits(&mut self, why: Unavailable) -> Option<Unavailable> {
        let before = std::mem::replace(&mut self.state, DeadManState::Unavailable);
        (before != DeadManState::Unavailable).then_some(why)
    }

    fn failed(&mut self, failure: Unavailable) -> Option<Unavailable> {
        self.state = DeadManState::Unavailable;
        (!std::mem::replace(&mut self.gave_up, true)).then_some(failure)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::Stop;
    use crate::fixtures::client_settings;
    use crate::http::ClientSettings;
    use crate::watchdog::WatchdogAddress;

    /// Only a failure takes this long.
    const PATIENCE: Duration = Duration::from_secs(60);

    /// A shell in a watchdog's place takes it for a command that does not exist, runs what is in it, and never says anything.
    fn order(channel: &str) -> StopOrder {
        let settings =
            ClientSettings { channel: channel.to_owned(), ..client_settings("http://camera.test") };
        StopOrder { identity: settings.into(), words: Stop::AllAxes, in_doubt: true }
    }

    fn dead_man() -> DeadMan {
        DeadMan::new(Some(Watchdog::new(WatchdogAddress::Program("/bin/sh".into()))))
    }

    fn standing(dead_man: &DeadMan) -> Standing {
        dead_man.lease.as_ref().and_then(Lease::standing).unwrap()
    }

    /// What is told next.
    fn told(dead_man: &mut DeadMan) -> String {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let told = async {
            loop {
                if let Some(told) = dead_man.keep() {
                    return told.to_string();
                }
                dead_man.due().await;
            }
        };
        runtime.block_on(async { tokio::time::timeout(PATIENCE, told).await }).unwrap()
    }

    /// Were it moved before, nobody would stop it if this process died, until the program runs.
    #[test]
    fn a_camera_at_rest_waits_for_a_program_that_is_slow_to_start_until_that_is_given_up() {
        let mut dead_man = dead_man();
        dead_man.hold(order("1"));
        let slow = told(&mut dead_man);
        assert!(slow.contains("`/bin/sh` has said nothing for 2 s"), "{slow}");
        assert!(dead_man.is_awaited() && dead_man.state() == DeadManState::Unavailable);
        let end = told(&mut dead_man);
        assert!(end.contains("it says nothing for 10 s") && !dead_man.is_awaited(), "{end}");
    }

    /// Else whoever is followed would be lost at each try.
    #[test]
    fn one_that_was_given_up_is_not_waited_for_while_it_is_tried_again() {
        let mut dead_man = dead_man();
        dead_man.hold(order("$(kill -KILL $$)"));
        let end = told(&mut dead_man);
        assert!(end.contains("signal: 9") && !dead_man.is_awaited(), "{end}");
        let begin = Instant::now();
        while matches!(standing(&dead_man), Standing::Failed(_)) {
            assert!(begin.elapsed() < PATIENCE, "it is not tried again");
            assert!(!dead_man.is_awaited());
            dead_man.hold(order("1"));
        }
        while matches!(standing(&dead_man), Standing::Awaited) {
            assert!(dead_man.keep().is_none() && !dead_man.is_awaited());
            std::thread::yield_now();
        }
        assert!(matches!(standing(&dead_man), Standing::Failed(_)), "no longer than a connection");
        assert!(dead_man.keep().is_none() && !dead_man.is_awaited(), "told once");
    }

    /// Whoever was told that the camera turns on where this process dies is not to lose whom it follows as well.
    #[test]
    fn nor_is_one_that_comes_after_one_that_died() {
        let mut dead_man = dead_man();
        dead_man.gave_up = true;
        dead_man.hold(order("$(exec sleep 60)"));
        let begin = Instant::now();
        while matches!(standing(&dead_man), Standing::Awaited) {
            assert!(!dead_man.is_awaited() && begin.elapsed() < PATIENCE);
            std::thread::yield_now();
        }
        assert!(matches!(standing(&dead_man), Standing::Starting(_)));
        assert!(dead_man.keep().is_none() && !dead_man.is_awaited());
    }

    /// As one who is out of view when the first one is given up.
    #[test]
    fn nor_by_who_did_not_hear_of_that() {
        let watchdog = Watchdog::new(WatchdogAddress::Program("/bin/sh".into()));
        let [mut first, mut other] = [(); 2].map(|()| DeadMan::new(Some(watchdog.clone())));
        first.hold(order("$(kill -KILL $$)"));
        let begin = Instant::now();
        while !matches!(standing(&first), Standing::Failed(_)) {
            assert!(begin.elapsed() < PATIENCE, "it never ends");
            std::thread::yield_now();
        }
        first.release();
        while !matches!(other.lease.as_ref().and_then(Lease::standing), Some(Standing::Awaited)) {
            assert!(begin.elapsed() < PATIENCE, "it is not tried again");
            other.release();
            other.hold(order("1"));
        }
        let end = told(&mut other);
        assert!(end.contains("no answer for 2 s") && !other.is_awaited(), "{end}");
    }

    /// The socket of one that reads nothing is full at some time. Were it ended for that, it would be started anew for ever.
    #[test]
    fn a_program_that_starts_is_not_ended_for_what_it_does_not_read_yet() {
        let mut dead_man = dead_man();
        for _ in 0..1000 {
            dead_man.hold(order("$(exec sleep 60)"));
            assert!(matches!(standing(&dead_man), Standing::Awaited));
        }
        // Nor for a release, by whoever shares it.
        dead_man.release();
        dead_man.hold(order("$(exec sleep 60)"));
        assert!(matches!(standing(&dead_man), Standing::Awaited));
        let heard = told(&mut dead_man);
        assert!(heard.contains("has said nothing for 2 s"), "{heard}");
    }
}
