// SPDX-License-Identifier: MPL-2.0

use std::path::absolute;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::task::spawn_blocking;
use tokio::time::timeout;

use super::protocol::{Message, StopOrder};
use super::{RENEWAL, Unavailable, Watchdog};
use crate::wire::Trust;

/// The promise to stop one camera in time, which the watchdog keeps where the holder cannot.
///
/// Not given back when it is dropped: who drops it without a [`Lease::release`] has failed, and the lease runs out.
#[derive(Debug)]
pub struct Lease {
    watchdog: Arc<Watchdog>,
    number: u64,
    /// When it was last renewed, where it is held.
    renewed: Option<Instant>,
}

impl Lease {
    /// Longest wait for a watchdog to start, or to be connected to.
    const LONGEST_START: Duration = Duration::from_secs(2);

    /// Not held yet; nothing is started.
    pub fn new(watchdog: Arc<Watchdog>) -> Self {
        Self { number: watchdog.next_lease(), watchdog, renewed: None }
    }

    /// Whether there is a watchdog to be started, as far as can be told without doing it.
    ///
    /// # Errors
    /// Why there is none.
    pub fn check(&self) -> Result<(), Unavailable> {
        self.watchdog.address().check()
    }

    /// When it is to be renewed, where it is held.
    pub fn renew_at(&self) -> Option<Instant> {
        self.renewed.map(|renewed| renewed + RENEWAL)
    }

    /// Takes or renews it; to be awaited before a move is sent, which the order ends. Starts the watchdog where there is
    /// none. To be tried again where it fails.
    ///
    /// # Errors
    /// Why there is no watchdog.
    pub async fn hold(&mut self, mut order: StopOrder) -> Result<(), Unavailable> {
        // The watchdog stands in another folder.
        if let Trust::Authority(path) = &mut order.identity.settings.trust {
            *path = absolute(&*path).unwrap_or_else(|_| path.clone());
        }
        self.renewed = Some(Instant::now());
        let message = Message::Hold { lease: self.number, stop: Box::new(order) };
        if matches!(self.watchdog.say(&message), Ok(true)) {
            return Ok(());
        }
        let (watchdog, first) = (self.watchdog.clone(), message.clone());
        let connecting = spawn_blocking(move || watchdog.connect(&first));
        let said = match timeout(Self::LONGEST_START, connecting).await {
            Ok(Ok(connected)) => connected?,
            Ok(Err(err)) => return Err(Unavailable::Broken(err.to_string())),
            Err(_) => return Err(Unavailable::Broken("it does not start".to_owned())),
        };
        if said || self.watchdog.say(&message)? {
            return Ok(());
        }
        Err(Unavailable::Broken("it ended as soon as it was started".to_owned()))
    }

    /// Gives it back, where it is held: the camera rests, or is somebody else's.
    pub fn release(&mut self) {
        if self.renewed.take().is_some() {
            // A watchdog that is gone does nothing to the camera.
            let _ = self.watchdog.say(&Message::Release { lease: self.number });
        }
    }
}
