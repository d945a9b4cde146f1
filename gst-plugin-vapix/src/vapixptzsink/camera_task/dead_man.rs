// SPDX-License-Identifier: MPL-2.0

//! The lease that has the watchdog stop the camera where this process cannot any more.

use std::sync::Arc;
use std::time::Instant;

use vapix::watchdog::{Lease, StopOrder, Unavailable, Watchdog};

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
    /// What the watchdog was told last.
    order: Option<StopOrder>,
}

impl DeadMan {
    /// Nothing is held yet, nor started. Without a watchdog there is nothing to be held.
    pub fn new(watchdog: Option<Arc<Watchdog>>) -> Self {
        let state = if watchdog.is_some() { DeadManState::Ready } else { DeadManState::Off };
        Self { lease: watchdog.map(Lease::new), state, order: None }
    }

    /// What is to be said of it.
    pub fn state(&self) -> DeadManState {
        self.state
    }

    /// Looks whether there is something to be started, before it is needed; what is to be told once.
    pub fn check(&mut self) -> Option<Unavailable> {
        let checked = self.lease.as_ref()?.check();
        self.turned_out(checked, DeadManState::Ready)
    }

    /// Takes or renews the lease, before a move is sent or while it lasts; what is to be told once.
    pub async fn hold(&mut self, order: StopOrder) -> Option<Unavailable> {
        self.order = Some(order);
        self.renew().await
    }

    /// Whether it is time to renew it, or the watchdog knows something else.
    pub fn is_due(&self, in_doubt: bool) -> bool {
        self.order.as_ref().is_none_or(|order| order.in_doubt != in_doubt)
            || self.lease.as_ref().and_then(Lease::renew_at).is_none_or(|at| at <= Instant::now())
    }

    /// Resolves when it is to be renewed, where it is held.
    pub async fn due(&self) {
        match self.lease.as_ref().and_then(Lease::renew_at) {
            Some(at) => tokio::time::sleep_until(at.into()).await,
            None => std::future::pending().await,
        }
    }

    /// Says again what was said last.
    pub async fn renew(&mut self) -> Option<Unavailable> {
        let (lease, order) = (self.lease.as_mut()?, self.order.clone()?);
        let held = lease.hold(order).await;
        self.turned_out(held, DeadManState::Armed)
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

    fn turned_out(&mut self, result: Result<(), Unavailable>, well: DeadManState) -> Option<Unavailable> {
        let before = std::mem::replace(&mut self.state, well);
        let failure = result.err()?;
        self.state = DeadManState::Unavailable;
        (before != DeadManState::Unavailable).then_some(failure)
    }
}
