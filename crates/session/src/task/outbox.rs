// SPDX-License-Identifier: MPL-2.0

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Sender, channel};
use std::thread;

use super::{Event, IS_OURS};

/// Where the camera task leaves what is to be told, which is told in order and in another thread: the handlers that an
/// application has for messages run in the thread that posts, and no slow one may delay a stop, of this camera or another.
#[derive(Debug, Clone)]
pub struct Outbox(Sender<Event>);

impl Outbox {
    /// `tell` is called with each event, with one after the other, in a thread of its own, until nobody can leave any more. A shared pool
    /// would keep as many threads as ever told something at once.
    ///
    /// # Errors
    /// Where there is no thread to be had.
    pub fn new(tell: impl Fn(Event) + Send + 'static) -> io::Result<Self> {
        let (sender, events) = channel();
        thread::Builder::new().name("ptz-messages".to_owned()).spawn(move || {
            IS_OURS.set(true);
            for event in events {
                // A handler that panics fails this message only.
                let _ = catch_unwind(AssertUnwindSafe(|| tell(event)));
            }
        })?;
        Ok(Self(sender))
    }

    /// Never waits.
    pub fn leave(&self, event: Event) {
        // Nobody is left to be told where the thread is gone.
        let _ = self.0.send(event);
    }
}
