// SPDX-License-Identifier: MPL-2.0

use std::future::pending;
use std::path::absolute;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::time::timeout_at;

use super::connection::{Heard, HeardReceiver, LONGEST_START, Start, says_nothing};
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
    /// The same for longer than it takes to answer, of a program that was started and has not said its first word: it is waited for.
    Starting(Unavailable),
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

    /// Asks for it again, as is to be done at [`Self::renew_at`]. A program that starts has been told, and reads nothing yet: its socket
    /// would only fill.
    pub fn renew(&mut self, order: StopOrder) {
        match &mut self.asked {
            Some(Asked { at, heard: Ok(heard), .. }) if Heard::is_starting(heard) => *at = Instant::now(),
            _ => self.hold(order),
        }
    }

    /// How it stands with it, where it was asked for.
    pub fn standing(&self) -> Option<Standing> {
        let asked = self.asked.as_ref()?;
        let heard = match &asked.heard {
            Ok(_) if asked.is_held(self.number) => return Some(Standing::Held),
            Ok(heard) => heard,
            Err(failure) => return Some(Standing::Failed(failure.clone())),
        };
        if let Some(end) = Heard::end(heard) {
            return Some(Standing::Failed(end));
        }
        let now = Instant::now();
        Some(match waited_for(heard) {
            None if asked.answer_due_at(heard) <= now => Standing::Failed(no_answer()),
            Some(start) if start.at + LONGEST_START <= now => {
                Standing::Failed(self.watchdog.address().unavailable(&says_nothing()))
            }
            Some(start) if start.at + Self::LONGEST_WAIT <= now => {
                Standing::Starting(self.watchdog.address().starting(Self::LONGEST_WAIT))
            }
            _ => Standing::Awaited,
        })
    }

    /// Resolves when it may stand otherwise with it; never where it was not asked for.
    pub async fn settled(&self) {
        let Some(asked) = &self.asked else { return pending().await };
        if let Ok(heard) = &asked.heard {
            let held = |heard: &Heard| heard.holds(self.number);
            // Whether it is, `standing` tells.
            let _ = timeout_at(asked.changes_at(heard).into(), heard.clone().wait_for(held)).await;
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

    /// When silence of whoever listens is a failure.
    fn answer_due_at(&self, heard: &HeardReceiver) -> Instant {
        let listens_since = heard.borrow().first_word().map_or(self.since, |first| first.max(self.since));
        listens_since + Lease::LONGEST_WAIT
    }

    /// When silence means something else than now.
    fn changes_at(&self, heard: &HeardReceiver) -> Instant {
        match waited_for(heard) {
            None => self.answer_due_at(heard),
            Some(start) if Instant::now() < start.at + Lease::LONGEST_WAIT => start.at + Lease::LONGEST_WAIT,
            Some(start) => start.at + LONGEST_START,
        }
    }
}

/// A program that only starts, and is waited for.
fn waited_for(heard: &HeardReceiver) -> Option<Start> {
    heard.borrow().silent_start().filter(|start| start.is_waited_for)
}

fn no_answer() -> Unavailable {
    Unavailable::Broken(format!("no answer for {} s", Lease::LONGEST_WAIT.as_secs()))
}
