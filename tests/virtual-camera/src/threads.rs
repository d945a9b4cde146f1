// SPDX-License-Identifier: MPL-2.0

//! The threads that draw, one for each client.

use std::{sync::Mutex, thread::JoinHandle};

use crate::sync::lock;

/// Running threads, to be waited for at the end.
#[derive(Debug, Default)]
pub(crate) struct Threads(Mutex<Vec<JoinHandle<()>>>);

impl Threads {
    pub fn spawn(&self, name: &str, work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
        let thread = std::thread::Builder::new().name(name.into()).spawn(work)?;
        let mut threads = lock(&self.0);
        threads.retain(|thread| !thread.is_finished());
        threads.push(thread);
        Ok(())
    }

    /// Waits for all of them; their clients must be gone or the camera stopping.
    pub fn join(&self) {
        let threads = std::mem::take(&mut *lock(&self.0));
        for thread in threads {
            // It ended with a panic at worst, which has been printed.
            let _ = thread.join();
        }
    }
}
