// SPDX-License-Identifier: MPL-2.0

use std::io;
use std::sync::Arc;

use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};
use tokio::task::spawn_blocking;

use super::{Event, runtime};

/// Where the camera task leaves what is to be told, which is told in order and in another thread: the handlers that an
/// application has for messages run in the thread that posts, and no slow one may delay a stop, of this camera or another.
#[derive(Debug, Clone)]
pub struct Outbox(UnboundedSender<Event>);

impl Outbox {
    /// `tell` is called with each event, with one after the other.
    ///
    /// # Errors
    /// Where there is no thread to be had.
    pub fn new(tell: impl Fn(Event) + Send + Sync + 'static) -> io::Result<Self> {
        let (sender, mut events) = unbounded_channel();
        let tell = Arc::new(tell);
        runtime()?.spawn(async move {
            while let Some(event) = events.recv().await {
                let tell = tell.clone();
                // A handler that panics fails this message only.
                let _ = spawn_blocking(move || tell(event)).await;
            }
        });
        Ok(Self(sender))
    }

    /// Never waits.
    pub fn leave(&self, event: Event) {
        // Nobody is left to be told where the runtime is gone.
        let _ = self.0.send(event);
    }
}
