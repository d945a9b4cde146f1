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
    /// What the watchdog was told last ...
    order: Option<StopOrder>,
    /// ... which does not hold any more.
    is_outdated: bool,
}

impl DeadMan {
    /// Nothing is held yet, nor started. Without a watchdog there is nothing to be held.
    pub fn new(watchdog: Option<Arc<Watchdog>>) -> Self {
        let state = if watchdog.is_some() { DeadManState::Ready } else { DeadManState::Off };
        Self { lease: watchdog.map(Lease::new), state, order: None, is_outdated: false }
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
            lease.hold(order.clone());
        }
        match lease.standing()? {
            Standing::Held => self.state = DeadManState::Armed,
            Standing::Awaited => {}
            Standing::Failed(failure) => return self.failed(failure),
        }
        None
    }

    /// Whether a camera at rest is not to be moved yet: it is not known whether there is a watchdog to stop it.
    pub fn is_awaited(&self) -> bool {
        let awaited = || matches!(self.lease.as_ref().and_then(Lease::standing), Some(Standing::Awaited));
        self.state != DeadManState::Unavailable && awaited()
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

    fn failed(&mut self, failure: Unavailable) -> Option<Unavailable> {
        let before = std::mem::replace(&mut self.state, DeadManState::Unavailable);
        (before != DeadManState::Unavailable).then_some(failure)
    }
}
