// SPDX-License-Identifier: MPL-2.0

use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::connection::{Connection, Heard, HeardReceiver, LONGEST_START};
use super::protocol::Message;

/// Where an application has its watchdog.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum WatchdogAddress {
    /// This program is started for it.
    Program(PathBuf),
    /// One runs already and listens on this socket.
    Socket(PathBuf),
}

/// Why there is no watchdog.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Unavailable {
    /// The program does not start.
    #[error("`{}` cannot be started: {reason}", program.display())]
    Program {
        /// As was asked for.
        program: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// It was started, and may yet come.
    #[error(
        "`{}` has said nothing for {} s; a camera that rests is not moved before it does, for {} s at most",
        program.display(), waited.as_secs(), LONGEST_START.as_secs()
    )]
    Starting {
        /// As was asked for.
        program: PathBuf,
        /// For so long.
        waited: Duration,
    },
    /// Nobody listens.
    #[error("no watchdog at socket `{}`: {reason}", socket.display())]
    Socket {
        /// As was asked for.
        socket: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// It was there, and is gone or does not listen any more.
    #[error("the watchdog process ended or does not listen: {0}")]
    Broken(String),
}

/// An application's connection to its watchdog, for all its cameras. Made anew where it is lost. Nothing here ever waits.
#[derive(Debug)]
pub struct Watchdog {
    address: WatchdogAddress,
    /// Held for no longer than it takes to leave a line in a socket.
    link: Mutex<Link>,
    leases: AtomicU64,
}

#[derive(Debug, Default)]
struct Link {
    connection: Option<Connection>,
    tried: Option<Instant>,
    failure: Option<Unavailable>,
    /// The program that was started last never said anything: the next one is not waited for.
    was_in_vain: bool,
}

impl Watchdog {
    /// A watchdog that dies again and again is not started more often than this.
    const PAUSE: Duration = Duration::from_secs(1);

    /// Nothing is started or connected yet.
    pub fn new(address: WatchdogAddress) -> Arc<Self> {
        Arc::new(Self { address, link: Mutex::default(), leases: AtomicU64::new(0) })
    }

    /// Where it is.
    pub fn address(&self) -> &WatchdogAddress {
        &self.address
    }

    /// A number that no other lease of this application has.
    pub(super) fn next_lease(&self) -> u64 {
        self.leases.fetch_add(1, Ordering::Relaxed)
    }

    /// Says something, over a connection that is begun where there is none; what is heard over it.
    ///
    /// # Errors
    /// Why there is no connection; the same for a while.
    pub(super) fn say(&self, message: &Message) -> Result<HeardReceiver, Unavailable> {
        let line = message.to_line().map_err(|err| Unavailable::Broken(err.to_string()))?;
        let mut link = self.link();
        if let Some(connection) = &link.connection {
            match connection.say(&line) {
                Ok(()) => return Ok(connection.heard()),
                // What it could not be told is said again once it runs.
                Err(err) if is_only_starting(connection, &err) => return Ok(connection.heard()),
                Err(err) => link.lose(&err),
            }
        }
        if link.tried.is_some_and(|tried| tried.elapsed() < Self::PAUSE)
            && let Some(failure) = &link.failure
        {
            return Err(failure.clone());
        }
        link.tried = Some(Instant::now());
        match Connection::begin(&self.address, &line, !link.was_in_vain) {
            Ok(connection) => Ok(link.connection.insert(connection).heard()),
            Err(err) => Err(link.failure.insert(self.address.unavailable(&err)).clone()),
        }
    }

    /// Says something if there is somebody to hear it.
    pub(super) fn say_if_there(&self, message: &Message) {
        let mut link = self.link();
        let said = message.to_line().ok().zip(link.connection.as_ref());
        if let Some((line, connection)) = said
            && let Err(err) = connection.say(&line)
            && !is_only_starting(connection, &err)
        {
            link.lose(&err);
        }
    }

    fn link(&self) -> MutexGuard<'_, Link> {
        self.link.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Link {
    /// Nothing can be said over the connection, for this reason.
    fn lose(&mut self, err: &io::Error) {
        // Asked before it is closed, which ends it as well.
        let Some(connection) = &self.connection else { return };
        let heard = connection.heard();
        self.failure = Some(Heard::end(&heard).unwrap_or_else(|| Unavailable::Broken(err.to_string())));
        self.was_in_vain = heard.borrow().silent_start().is_some();
        self.connection = None;
    }
}

/// A program that starts reads nothing yet, and its socket may be full: it is not lost.
fn is_only_starting(connection: &Connection, err: &io::Error) -> bool {
    err.kind() == io::ErrorKind::WouldBlock && Heard::is_starting(&connection.heard())
}

impl WatchdogAddress {
    /// Whether it is there, as far as can be told without starting or connecting anything.
    ///
    /// # Errors
    /// Why it is not.
    pub(super) fn check(&self) -> Result<(), Unavailable> {
        match self {
            Self::Program(program) => program.metadata().map(drop).map_err(|err| self.unavailable(&err)),
            Self::Socket(_) => Ok(()),
        }
    }

    /// A program that was started has said nothing for so long.
    pub(super) fn starting(&self, waited: Duration) -> Unavailable {
        let (Self::Program(program) | Self::Socket(program)) = self;
        Unavailable::Starting { program: program.clone(), waited }
    }

    /// It is not to be had, for this reason.
    pub(super) fn unavailable(&self, err: &io::Error) -> Unavailable {
        let reason = err.to_string();
        match self {
            Self::Program(program) => Unavailable::Program { program: program.clone(), reason },
            Self::Socket(socket) => Unavailable::Socket { socket: socket.clone(), reason },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_that_is_not_there_is_named_and_not_looked_for_again_at_once() {
        let watchdog = Watchdog::new(WatchdogAddress::Socket("/nonexistent/socket".into()));
        let release = Message::Release { lease: 0 };
        for _ in 0..3 {
            let err = watchdog.say(&release).unwrap_err().to_string();
            assert!(err.contains("/nonexistent/socket") && err.contains("No such file"), "{err}");
        }
    }
}
