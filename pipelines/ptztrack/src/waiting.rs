// SPDX-License-Identifier: MPL-2.0

//! Those who were followed wait here for a disk that is slow, or a file that somebody else has locked.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use events::Sighting;

/// They take this much memory at most, nearly all of it pictures; whoever comes after that is lost.
pub const MOST_BYTES: usize = 16 * 1024 * 1024;

/// Where they are put.
#[derive(Debug)]
pub struct Waiting {
    sender: Sender<Sighting>,
    count: Arc<Count>,
}

/// Where they are taken from, in the order in which they came.
#[derive(Debug)]
pub struct Sightings {
    receiver: Receiver<Sighting>,
    count: Arc<Count>,
}

/// How many there are.
#[derive(Debug, Default)]
pub struct Count {
    waiting: AtomicUsize,
    bytes: AtomicUsize,
    lost: AtomicUsize,
}

pub fn line() -> (Waiting, Sightings) {
    let (sender, receiver) = channel();
    let count = Arc::<Count>::default();
    (Waiting { sender, count: count.clone() }, Sightings { receiver, count })
}

impl Waiting {
    /// Waits for nothing; where there is no room, how many are lost by now.
    pub fn put(&self, sighting: Sighting) -> Result<(), usize> {
        let bytes = sighting.bytes();
        if self.count.bytes.load(Relaxed) + bytes > MOST_BYTES {
            return Err(self.count.lost.fetch_add(1, Relaxed) + 1);
        }
        self.count.bytes.fetch_add(bytes, Relaxed);
        self.count.waiting.fetch_add(1, Relaxed);
        // Where nobody takes them any more, the program ends.
        let _ = self.sender.send(sighting);
        Ok(())
    }
}

impl Sightings {
    /// The next one; it takes its room until [`Self::done`].
    pub fn next(&self, patience: Duration) -> Result<Sighting, RecvTimeoutError> {
        self.receiver.recv_timeout(patience)
    }

    /// The next one, where one waits.
    pub fn try_next(&self) -> Option<Sighting> {
        self.receiver.try_recv().ok()
    }

    /// It waits no more.
    pub fn done(&self, sighting: &Sighting) {
        self.count.bytes.fetch_sub(sighting.bytes(), Relaxed);
        self.count.waiting.fetch_sub(1, Relaxed);
    }

    pub fn count(&self) -> Arc<Count> {
        self.count.clone()
    }
}

impl Count {
    pub fn waiting(&self) -> usize {
        self.waiting.load(Relaxed)
    }

    /// How many were lost since this was asked last.
    pub fn take_lost(&self) -> usize {
        self.lost.swap(0, Relaxed)
    }
}
