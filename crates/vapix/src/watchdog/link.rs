// SPDX-License-Identifier: MPL-2.0

use std::io::{self, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

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

/// An application's connection to its watchdog, for all its cameras. Made anew where it is lost.
#[derive(Debug)]
pub struct Watchdog {
    address: WatchdogAddress,
    link: Mutex<Link>,
    leases: AtomicU64,
}

#[derive(Debug, Default)]
struct Link {
    stream: Option<UnixStream>,
    tried: Option<Instant>,
    failure: Option<Unavailable>,
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

    /// Says something if there is a connection; waits for nothing. Once it is said the watchdog has it, even if this process
    /// dies in the next moment. Whether there was one.
    ///
    /// # Errors
    /// [`Unavailable::Broken`] where there was one and it failed.
    pub(super) fn say(&self, message: &Message) -> Result<bool, Unavailable> {
        let line = line(message)?;
        let mut link = self.link();
        let Some(stream) = &mut link.stream else { return Ok(false) };
        // Neither waits, as the socket does not block, nor raises SIGPIPE, as the standard library asks for none. A watchdog
        // that has not read for so long that the socket is full will not read this either.
        let said = stream.write_all(&line);
        if said.is_err() {
            link.stream = None;
        }
        said.map(|()| true).map_err(|err| Unavailable::Broken(err.to_string()))
    }

    /// Connects if there is no connection, with `first` as the first that is said. May take as long as it takes to start a
    /// process. Whether that was said: over a connection that another lease has made in the meantime it is not, as whoever
    /// asked may have given up waiting.
    ///
    /// # Errors
    /// Why there is no connection; the same for a while.
    pub(super) fn connect(&self, first: &Message) -> Result<bool, Unavailable> {
        let line = line(first)?;
        let mut link = self.link();
        if link.stream.is_some() {
            return Ok(false);
        }
        if link.tried.is_some_and(|tried| tried.elapsed() < Self::PAUSE) {
            let again = || Unavailable::Broken("it ended as soon as it was started".to_owned());
            return Err(link.failure.clone().unwrap_or_else(again));
        }
        link.tried = Some(Instant::now());
        let stream = self.address.connect(&line);
        link.failure = stream.as_ref().err().cloned();
        link.stream = Some(stream?);
        Ok(true)
    }

    fn link(&self) -> MutexGuard<'_, Link> {
        self.link.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn line(message: &Message) -> Result<Vec<u8>, Unavailable> {
    message.to_line().map_err(|err| Unavailable::Broken(err.to_string()))
}

impl WatchdogAddress {
    /// Whether it is there, as far as can be told without starting or connecting anything.
    ///
    /// # Errors
    /// Why it is not.
    pub(super) fn check(&self) -> Result<(), Unavailable> {
        match self {
            Self::Program(program) => program
                .metadata()
                .map(drop)
                .map_err(|err| Unavailable::Program { program: program.clone(), reason: err.to_string() }),
            Self::Socket(_) => Ok(()),
        }
    }

    /// With this as the first that is said.
    fn connect(&self, line: &[u8]) -> Result<UnixStream, Unavailable> {
        match self {
            Self::Program(program) => start(program, line)
                .map_err(|err| Unavailable::Program { program: program.clone(), reason: err.to_string() }),
            Self::Socket(socket) => connect(socket, line)
                .map_err(|err| Unavailable::Socket { socket: socket.clone(), reason: err.to_string() }),
        }
    }
}

fn connect(socket: &Path, line: &[u8]) -> io::Result<UnixStream> {
    let mut stream = UnixStream::connect(socket)?;
    stream.set_nonblocking(true)?;
    stream.write_all(line)?;
    Ok(stream)
}

/// Nothing of ours runs between fork and exec, so this is safe in any host; what must be done then the program does itself.
fn start(program: &Path, line: &[u8]) -> io::Result<UnixStream> {
    let (mut ours, its) = UnixStream::pair()?;
    ours.set_nonblocking(true)?;
    // From its first instruction on it knows what to do, even if this process dies while it starts.
    ours.write_all(line)?;
    let mut child = Command::new(program)
        .stdin(OwnedFd::from(its))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    // The child goes into the background at once, by a fork: it is nobody's child, and no host that waits for all of its
    // own waits for it. A host that does, or ignores SIGCHLD, may have heard of its end before us: then there is no status.
    match child.wait() {
        Ok(status) if !status.success() => Err(io::Error::other(format!("it ended with {status}"))),
        _ => Ok(ours),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    fn release() -> Message {
        Message::Release { lease: 0 }
    }

    fn between(watchdog: &Watchdog) -> UnixStream {
        let (ours, its) = UnixStream::pair().unwrap();
        ours.set_nonblocking(true).unwrap();
        watchdog.link().stream = Some(ours);
        its
    }

    fn nowhere() -> Arc<Watchdog> {
        Watchdog::new(WatchdogAddress::Program("/nonexistent/watchdog".into()))
    }

    #[test]
    fn what_is_said_is_there_even_if_the_speaker_is_not() {
        let watchdog = nowhere();
        let mut its = between(&watchdog);
        assert!(watchdog.say(&release()).unwrap());
        drop(watchdog);
        let mut heard = Vec::new();
        its.read_to_end(&mut heard).unwrap();
        assert_eq!(heard, release().to_line().unwrap());
    }

    /// Were it to wait for a watchdog that hangs, it would hang with it.
    #[test]
    fn a_watchdog_that_does_not_read_keeps_nobody_waiting() {
        let watchdog = nowhere();
        let _its = between(&watchdog);
        let mut said = 0;
        let err = loop {
            match watchdog.say(&release()) {
                Ok(_) => said += 1,
                Err(err) => break err,
            }
        };
        assert!(said > 100 && matches!(err, Unavailable::Broken(_)), "{said} {err}");
        assert!(!watchdog.say(&release()).unwrap(), "there is no connection any more");
    }

    #[test]
    fn a_program_that_is_not_there_is_named_and_not_looked_for_again_at_once() {
        let watchdog = nowhere();
        for _ in 0..3 {
            let err = watchdog.connect(&release()).unwrap_err().to_string();
            assert!(err.contains("/nonexistent/watchdog") && err.contains("No such file"), "{err}");
        }
        let socket = Watchdog::new(WatchdogAddress::Socket("/nonexistent/socket".into()));
        assert!(socket.connect(&release()).unwrap_err().to_string().contains("/nonexistent/socket"));
    }

    /// Whoever asked may have given its lease back while another was starting the program.
    #[test]
    fn over_a_connection_that_is_there_connecting_says_nothing() {
        let watchdog = nowhere();
        let mut its = between(&watchdog);
        assert!(!watchdog.connect(&release()).unwrap());
        drop(watchdog);
        let mut heard = Vec::new();
        its.read_to_end(&mut heard).unwrap();
        assert!(heard.is_empty());
    }

    /// Were it told once it runs, it would know nothing where the application dies in the meantime. `start` waits for the end
    /// of the program, so nothing can be said to it afterwards.
    #[test]
    fn a_program_knows_from_its_start_what_to_do() {
        let (ended, end) = std::sync::mpsc::channel();
        std::thread::spawn(move || ended.send(start(Path::new("/bin/sh"), b"exit 7\n")));
        let err =
            end.recv_timeout(Duration::from_secs(60)).expect("it was told nothing").unwrap_err().to_string();
        assert!(err.contains("exit status: 7"), "{err}");
    }

    #[test]
    fn a_program_that_fails_is_no_watchdog() {
        let err = start(Path::new("/bin/false"), b"").unwrap_err().to_string();
        assert!(err.contains("exit status: 1"), "{err}");
    }
}
