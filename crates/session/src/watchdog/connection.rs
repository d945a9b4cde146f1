// SPDX-License-Identifier: MPL-2.0

//! One connection to a watchdog. What is said is in its socket at once, and what it answers is heard by a thread: whoever
//! moves a camera waits for neither.

use std::collections::HashMap;
use std::io::{self, BufRead, BufReader, Read};
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use socket2::{Domain, SockAddr, SockRef, Socket, Type};
use tokio::sync::watch;

use super::protocol::Answer;
use super::{LEASE, Unavailable, WatchdogAddress};

/// A program that says nothing for so long after its start is ended.
pub(super) const LONGEST_START: Duration = Duration::from_secs(10);

/// A line that is longer is none.
const MAX_LINE_BYTES: u64 = 1024;

/// What the watchdog has said.
#[derive(Debug, Default)]
pub struct Heard {
    /// When it last answered for each lease that it holds.
    held: HashMap<u64, Instant>,
    /// Why it is not there any more, where it says nothing of that.
    end: Option<Unavailable>,
    /// How far its start is, where it is a program that was started for this connection.
    start: Option<Start>,
}

/// How far the start of a program is.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// When it was started.
    pub at: Instant,
    /// No camera at rest is moved before it says something, or is given up.
    pub is_waited_for: bool,
    /// When it said its first word.
    first_word: Option<Instant>,
}

/// What is heard over one connection; it closes with it.
pub type HeardReceiver = watch::Receiver<Heard>;

/// Closed when it is dropped.
#[derive(Debug)]
pub struct Connection {
    stream: UnixStream,
    heard: HeardReceiver,
}

impl Connection {
    /// With this as the first that is said. Whether anybody hears it, and why not, is heard later; whether a program that starts is
    /// waited for, the caller knows.
    ///
    /// # Errors
    /// What the system says where there is nobody to connect to.
    pub fn begin(address: &WatchdogAddress, line: &[u8], is_waited_for: bool) -> io::Result<Self> {
        let (stream, its, start) = match address {
            WatchdogAddress::Program(_) => {
                let (ours, its) = UnixStream::pair()?;
                (ours, Some(its), Some(Start { at: Instant::now(), is_waited_for, first_word: None }))
            }
            WatchdogAddress::Socket(socket) => (connect(socket)?, None, None),
        };
        let (report, heard) = watch::channel(Heard { start, ..Heard::default() });
        let connection = Self { stream, heard };
        // From its first instruction on a program knows what to do, even if this process dies while it starts.
        connection.say(line)?;
        let stream = connection.stream.try_clone()?;
        let address = address.clone();
        thread::Builder::new().name("watchdog".to_owned()).spawn(move || {
            let end = match (&address, its) {
                (WatchdogAddress::Program(program), Some(its)) => run(program, its, &stream, &report),
                _ => hear(&stream, &report)
                    .and_then(|heard| if heard { Ok(()) } else { Err(not_understood()) }),
            };
            if let Err(err) = end {
                report.send_modify(|heard| heard.end = Some(address.unavailable(&err)));
            }
        })?;
        Ok(connection)
    }

    /// Once it is said the watchdog has it, even if this process dies in the next moment.
    ///
    /// # Errors
    /// Nobody is there any more, or has not read for so long that the socket is full.
    pub fn say(&self, line: &[u8]) -> io::Result<()> {
        let said =
            SockRef::from(&self.stream).send_with_flags(line, libc::MSG_DONTWAIT | libc::MSG_NOSIGNAL)?;
        // After half a line there is no other.
        if said == line.len() { Ok(()) } else { Err(io::ErrorKind::WriteZero.into()) }
    }

    /// What is heard over it.
    pub fn heard(&self) -> HeardReceiver {
        self.heard.clone()
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        // The thread has the socket too. Where the watchdog is gone, so is the connection.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

impl Heard {
    fn add(&mut self, answer: Answer) {
        if let Some(start) = &mut self.start {
            start.first_word.get_or_insert_with(Instant::now);
        }
        match answer {
            Answer::Held { lease } => self.held.insert(lease, Instant::now()),
            Answer::Released { lease } => self.held.remove(&lease),
        };
    }

    /// Whether the watchdog said that it holds this lease, and not longer ago than one lasts.
    pub fn holds(&self, lease: u64) -> bool {
        self.held.get(&lease).is_some_and(|said| said.elapsed() <= LEASE)
    }

    /// Whether it has said so since then.
    pub fn held_since(&self, lease: u64, since: Instant) -> bool {
        self.held.get(&lease).is_some_and(|said| *said >= since)
    }

    /// Whether it is a program that was started, and has neither said anything yet nor ended.
    pub fn is_starting(receiver: &HeardReceiver) -> bool {
        receiver.borrow().silent_start().is_some() && Self::end(receiver).is_none()
    }

    /// Its start, where that is one that has said nothing.
    pub fn silent_start(&self) -> Option<Start> {
        self.start.filter(|start| start.first_word.is_none())
    }

    /// When one that was started said its first word: to what it was told before, it could not answer earlier.
    pub fn first_word(&self) -> Option<Instant> {
        self.start?.first_word
    }

    /// Why there is no connection, where there is none any more.
    pub fn end(receiver: &HeardReceiver) -> Option<Unavailable> {
        // First whether it is over: what is said after that is not missed.
        let is_over = receiver.has_changed().is_err();
        let said = receiver.borrow().end.clone();
        said.or_else(|| is_over.then(|| Unavailable::Broken("it ended".to_owned())))
    }
}

/// Where many wait to be connected, as those who would listen hang, it waits for none of them.
fn connect(path: &Path) -> io::Result<UnixStream> {
    let socket = Socket::new(Domain::UNIX, Type::STREAM, None)?;
    socket.set_nonblocking(true)?;
    socket.connect(&SockAddr::unix(path)?)?;
    socket.set_nonblocking(false)?;
    Ok(OwnedFd::from(socket).into())
}

/// Nothing of ours runs between fork and exec, so this is safe in any host; what must be done then the program does itself.
fn run(
    program: &Path,
    its: UnixStream,
    stream: &UnixStream,
    report: &watch::Sender<Heard>,
) -> io::Result<()> {
    let mut child = Command::new(program)
        .stdin(OwnedFd::from(its))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    stream.set_read_timeout(Some(LONGEST_START))?;
    let first = first_byte(stream);
    let status = reap(&mut child);
    if !first? {
        let how = match status {
            Some(status) if !status.success() => format!("it ended with {status}"),
            _ => "it ended as soon as it was started".to_owned(),
        };
        return Err(io::Error::other(how));
    }
    stream.set_read_timeout(None)?;
    hear(stream, report).map(drop)
}

/// Waits for something to be said; `false`: nothing will be.
fn first_byte(stream: &UnixStream) -> io::Result<bool> {
    let peeked = SockRef::from(stream).peek(&mut [std::mem::MaybeUninit::uninit()]);
    match peeked {
        Ok(bytes) => Ok(bytes > 0),
        Err(err) if err.kind() == io::ErrorKind::WouldBlock => Err(says_nothing()),
        Err(err) => Err(err),
    }
}

pub(super) fn says_nothing() -> io::Error {
    io::Error::other(format!("it says nothing for {} s", LONGEST_START.as_secs()))
}

/// A watchdog goes into the background before it says anything, by a fork: it is nobody's child, and no host that waits for
/// all of its own waits for it. What is still there is none. A host that waits for any child, or ignores SIGCHLD, may have
/// heard of its end before us: then there is no status.
fn reap(child: &mut Child) -> Option<ExitStatus> {
    if let Ok(None) = child.try_wait() {
        // It may have ended by now.
        let _ = child.kill();
    }
    child.wait().ok()
}

/// A watchdog ends a connection over which something comes that it does not know.
fn not_understood() -> io::Error {
    io::Error::other(
        "it does not answer; it may be of another version: restart it (ptztrack-watchdog.service)",
    )
}

/// Until the watchdog ends, or the connection; whether it has said anything.
fn hear(stream: &UnixStream, report: &watch::Sender<Heard>) -> io::Result<bool> {
    let mut lines = BufReader::new(stream);
    let (mut line, mut heard) = (Vec::new(), false);
    loop {
        line.clear();
        (&mut lines).take(MAX_LINE_BYTES).read_until(b'\n', &mut line)?;
        match Answer::of_line(&line) {
            Ok(answer) => {
                heard = true;
                report.send_modify(|heard| heard.add(answer));
            }
            Err(_) if line.is_empty() => return Ok(heard),
            // What a newer one has to say beyond that.
            Err(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONG: Duration = Duration::from_secs(60);

    /// Why the program is no watchdog.
    fn end_of(program: &str, line: &[u8]) -> String {
        end(program, &Connection::begin(&WatchdogAddress::Program(program.into()), line, true).unwrap())
    }

    /// Why there is no connection any more, to `whom`.
    fn end(whom: &str, connection: &Connection) -> String {
        let begin = Instant::now();
        loop {
            if let Some(end) = Heard::end(&connection.heard()) {
                return end.to_string();
            }
            assert!(begin.elapsed() < LONG, "{whom} never ends");
            thread::yield_now();
        }
    }

    #[test]
    fn a_program_that_is_not_there_or_fails_or_does_nothing_is_no_watchdog() {
        let said = end_of("/nonexistent/watchdog", b"");
        assert!(said.contains("/nonexistent/watchdog") && said.contains("No such file"), "{said}");
        let said = end_of("/bin/false", b"");
        assert!(said.contains("exit status: 1"), "{said}");
        let said = end_of("/bin/true", b"");
        assert!(said.contains("it ended as soon as it was started"), "{said}");
    }

    /// As one that was not started anew when the plugin was upgraded.
    #[test]
    fn one_that_ends_the_connection_without_an_answer_is_to_be_started_anew() {
        let socket = std::env::temp_dir().join(format!("ptztrack-old-watchdog-{}", std::process::id()));
        let listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let connection =
            Connection::begin(&WatchdogAddress::Socket(socket.clone()), b"words of a newer one\n", true)
                .unwrap();
        let (old, _) = listener.accept().unwrap();
        BufReader::new(old).read_until(b'\n', &mut Vec::new()).unwrap();
        let said = end("it", &connection);
        std::fs::remove_file(socket).unwrap();
        assert!(said.contains("another version") && said.contains("restart it"), "{said}");
    }

    /// Were it told once it runs, it would know nothing where the application dies in the meantime.
    #[test]
    fn a_program_knows_from_its_start_what_to_do() {
        let said = end_of("/bin/sh", b"exit 7\n");
        assert!(said.contains("exit status: 7"), "{said}");
    }

    /// Of those that are started again and again there is one at a time, and none in the end.
    #[test]
    fn a_program_that_is_not_in_the_background_once_it_answers_is_ended() {
        let script = b"echo '{\"held\":{\"lease\":3}}' >&0; exec sleep 1000\n";
        let connection =
            Connection::begin(&WatchdogAddress::Program("/bin/sh".into()), script, true).unwrap();
        let mut heard = connection.heard();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        // With it the socket closes.
        runtime.block_on(async {
            tokio::time::timeout(LONG, async { while heard.changed().await.is_ok() {} }).await.unwrap();
        });
        assert!(Heard::end(&heard).is_some());
    }

    #[test]
    fn what_is_said_is_there_even_if_the_speaker_is_not() {
        let (mut its, connection) = between();
        connection.say(b"one\n").unwrap();
        drop(connection);
        let mut heard = Vec::new();
        its.read_to_end(&mut heard).unwrap();
        assert_eq!(heard, b"one\n");
    }

    /// Were it to wait for a watchdog that hangs, it would hang with it.
    #[test]
    fn a_watchdog_that_does_not_read_keeps_nobody_waiting() {
        let (_its, connection) = between();
        let mut said = 0;
        while connection.say(b"a line of some length, as one that holds a lease\n").is_ok() {
            said += 1;
        }
        assert!(said > 100, "{said}");
    }

    fn between() -> (UnixStream, Connection) {
        let (stream, its) = UnixStream::pair().unwrap();
        (its, Connection { stream, heard: watch::channel(Heard::default()).1 })
    }
}
