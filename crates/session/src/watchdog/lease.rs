// SPDX-License-Identifier: MPL-2.0

use std::future::pending;
use std::path::absolute;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::time::timeout_at;

use super::connection::{Heard, HeardReceiver};
use super::protocol::{Message, StopOrder};
use super::{RENEWAL, Unavailable, Watchdog};
use crate::http::Trust;

/// The promise to stop one camera in time, which the watchdog keeps where the holder cannot.
///
/// Not given back when it is dropped: who drops it without a [`Lease::release`] has failed, and the lease runs out.
#[derive(Debug)]
pub struct Lease {
    watchdog: Arc<Watchdog>,
    number: u64,
    /// Where it was asked for.
    asked: Option<Asked>,
}

#[derive(Debug)]
struct Asked {
    /// Last.
    at: Instant,
    /// First, of those times to which there is no answer yet.
    since: Instant,
    heard: Result<HeardReceiver, Unavailable>,
}

/// How it stands with a lease that was asked for.
#[derive(Debug, Clone)]
pub enum Standing {
    /// The watchdog has said so: it will stop the camera.
    Held,
    /// The watchdog has said nothing yet.
    Awaited,
    /// There is no watchdog, or none that answers.
    Failed(Unavailable),
}

impl Lease {
    /// Longest wait for a watchdog to say that it holds a lease.
    const LONGEST_WAIT: Duration = Duration::from_secs(2);

    /// Not held yet; nothing is started.
    pub fn new(watchdog: Arc<Watchdog>) -> Self {
        Self { number: watchdog.next_lease(), watchdog, asked: None }
    }

    /// Whether there is a watchdog to be started, as far as can be told without doing it.
    ///
    /// # Errors
    /// Why there is none.
    pub fn check(&self) -> Result<(), Unavailable> {
        self.watchdog.address().check()
    }

    /// When it is to be renewed, where it was asked for.
    pub fn renew_at(&self) -> Option<Instant> {
        self.asked.as_ref().map(|asked| asked.at + RENEWAL)
    }

    /// Asks for it, or renews it; waits for nothing. Has the watchdog started where there is none, or again where that
    /// failed. A move that the order ends is to be sent when it is [held](Standing::Held).
    pub fn hold(&mut self, mut order: StopOrder) {
        // The watchdog stands in another folder.
        if let Trust::Authority(path) = &mut order.identity.settings.trust {
            *path = absolute(&*path).unwrap_or_else(|_| path.clone());
        }
        let at = Instant::now();
        let unanswered = self.asked.as_ref().filter(|asked| !asked.is_answered(self.number));
        let since = unanswered.map_or(at, |asked| asked.since);
        let heard = self.watchdog.say(&Message::Hold { lease: self.number, stop: Box::new(order) });
        self.asked = Some(Asked { at, since, heard });
    }

    /// How it stands with it, where it was asked for.
    pub fn standing(&self) -> Option<Standing> {
        let asked = self.asked.as_ref()?;
        let failure = match &asked.heard {
            Ok(_) if asked.is_held(self.number) => return Some(Standing::Held),
            Ok(heard) => Heard::end(heard).or_else(|| asked.is_overdue().then(no_answer)),
            Err(failure) => Some(failure.clone()),
        };
        Some(failure.map_or(Standing::Awaited, Standing::Failed))
    }

    /// Resolves when it is held, or will not be; never where it was not asked for.
    pub async fn settled(&self) {
        let Some(asked) = &self.asked else { return pending().await };
        if let Ok(heard) = &asked.heard {
            let held = |heard: &Heard| heard.holds(self.number);
            // Whether it is, `standing` tells.
            let _ = timeout_at(asked.longest().into(), heard.clone().wait_for(held)).await;
        }
    }

    /// Gives it back, where it was asked for: the camera rests, or is somebody else's.
    pub fn release(&mut self) {
        if self.asked.take().is_some() {
            // A watchdog that is gone does nothing to the camera.
            self.watchdog.say_if_there(&Message::Release { lease: self.number });
        }
    }
}

impl Asked {
    fn is_answered(&self, lease: u64) -> bool {
        self.heard.as_ref().is_ok_and(|heard| heard.borrow().held_since(lease, self.since))
    }

    fn is_held(&self, lease: u64) -> bool {
        self.heard.as_ref().is_ok_and(|heard| heard.borrow().holds(lease))
    }

    fn longest(&self) -> Instant {
        self.since + Lease::LONGEST_WAIT
    }

    fn is_overdue(&self) -> bool {
        self.longest() <= Instant::now()
    }
}

fn no_answer() -> Unavailable {
    Unavailable::Broken(format!("no answer for {} s", Lease::LONGEST_WAIT.as_secs()))
}
