// SPDX-License-Identifier: MPL-2.0

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader};
use tokio::net::UnixStream;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::Instant;

use super::LEASE;
use super::guard::{Held, guard};
use super::protocol::{Answer, MAX_LINE_BYTES, Message};
use crate::Client;

/// More cameras than one application has.
const MAX_LEASES: usize = 4096;

/// How many cameras the process sees to at this time.
#[derive(Debug)]
pub struct Armed {
    cameras: AtomicUsize,
    changed: fn(bool),
}

impl Armed {
    /// `changed` is called with whether there is any camera, when that changes.
    pub const fn new(changed: fn(bool)) -> Self {
        Self { cameras: AtomicUsize::new(0), changed }
    }

    pub(super) fn begin(&self) -> ArmedCamera<'_> {
        if self.cameras.fetch_add(1, Ordering::SeqCst) == 0 {
            (self.changed)(true);
        }
        ArmedCamera(self)
    }
}

/// One of them, until it is dropped.
pub(super) struct ArmedCamera<'a>(&'a Armed);

impl Drop for ArmedCamera<'_> {
    fn drop(&mut self) {
        if self.0.cameras.fetch_sub(1, Ordering::SeqCst) == 1 {
            (self.0.changed)(false);
        }
    }
}

/// Sees to the cameras of one application until it is gone and they rest.
pub async fn serve<C: Client>(application: UnixStream, armed: &'static Armed) {
    let mut guards = JoinSet::new();
    let mut leases: HashMap<u64, watch::Sender<Option<Held>>> = HashMap::new();
    let (application, answers) = application.into_split();
    let mut lines = BufReader::new(application);
    let mut line = Vec::new();
    loop {
        line.clear();
        // An end, a fault of the socket or a line without end: there is no application to be heard any more.
        match (&mut lines).take(MAX_LINE_BYTES as u64).read_until(b'\n', &mut line).await {
            Ok(_) if line.ends_with(b"\n") => {}
            _ => break,
        }
        let (lease, held) = match Message::of_line(&line) {
            Ok(Message::Hold { lease, stop }) => {
                (lease, Some(Held { stop: *stop, until: Instant::now() + LEASE }))
            }
            Ok(Message::Release { lease }) => (lease, None),
            _ => break,
        };
        let answer = match held {
            None => {
                // Its guard sees that before it sees that nobody speaks any more.
                if let Some(sender) = leases.remove(&lease) {
                    sender.send_replace(None);
                }
                Answer::Released { lease }
            }
            Some(_) if leases.len() >= MAX_LEASES && !leases.contains_key(&lease) => break,
            Some(_) => {
                let sender = leases.entry(lease).or_insert_with(|| {
                    let (sender, receiver) = watch::channel(None);
                    guards.spawn(guard::<C>(receiver, armed));
                    sender
                });
                sender.send_replace(held);
                Answer::Held { lease }
            }
        };
        // Who does not read it knows nothing of answers, or hangs: neither is waited for.
        if let Ok(line) = answer.to_line() {
            let _ = answers.try_write(&line);
        }
        // Those that have ended.
        while guards.try_join_next().is_some() {}
    }
    drop(leases);
    while guards.join_next().await.is_some() {}
}
