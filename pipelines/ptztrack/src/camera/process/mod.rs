// SPDX-License-Identifier: MPL-2.0

//! A camera in a process of its own, which is started again where it dies or hangs: a decoder that crashes, a leak or a driver
//! that never returns costs that camera alone. What is said of it here is what that process tells; its own watchdog stops the
//! camera where it dies.
//!
//! ```text
//! this process: Known, Remote ─ socket pair, lines of JSON ─▶ child: the camera, as a thread has it elsewhere
//! ```

pub mod bytes;
pub mod child;
mod protocol;

use std::collections::BTreeSet;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use pipeline_supervisor::Backoff;
use protocol::{Order, Report, Start, Word};
use ptztrack_contract::lock::lock;
use serde::Serialize;
use socket2::SockRef;

use super::known::{Known, SEARCHING, Steering};
use super::running::Running;
use super::servo_stats::ServoStats;
use super::view::Shown;
use super::{Abilities, Turn};
use crate::config::CameraSettings;
use crate::event::{Event, Level};
use crate::log::Log;

/// It reports twice a second, in its last ones too. One that says nothing for so long hangs.
const LONGEST_SILENCE: Duration = Duration::from_secs(10);

/// Between its last word and its end.
const LONGEST_END: Duration = Duration::from_secs(5);

/// Between two looks whether it has ended.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// To start one costs half a second of a processor, so it is not tried as often as a pipeline; one that lasted for so long
/// was well.
const SHORTEST_PAUSE: Duration = Duration::from_millis(500);
const LONGEST_PAUSE: Duration = Duration::from_secs(30);
const WELL: Duration = Duration::from_secs(60);

/// More than any picture.
const MOST_BYTES: u64 = 64 * 1024 * 1024;

/// Runs processes for one camera, one after the other.
#[derive(Debug, Default)]
pub struct Processes {
    told_to_end: AtomicBool,
    /// To the one that runs.
    socket: Mutex<Option<UnixStream>>,
}

impl Processes {
    /// Runs them in this thread until told to end, or until the camera is given up.
    pub fn run(&self, settings: &CameraSettings, known: &Known, log: &Log) {
        let mut backoff = Backoff::new(SHORTEST_PAUSE, LONGEST_PAUSE, WELL);
        while !self.told_to_end.load(Ordering::SeqCst) {
            let begin = Instant::now();
            let Err(reason) = self.run_one(settings, known, log) else { return };
            sees_nothing(known, &reason);
            known.failures.fetch_add(1, Ordering::Relaxed);
            let detail = format!("{reason}; it is started again");
            log.tell(&Event::new(Level::Error, Some(&known.name), "process-ended", detail));
            self.pause(known, backoff.after(begin.elapsed()));
        }
    }

    /// Ends it; who runs in [`Self::run`] is to be woken.
    pub fn end(&self) {
        self.told_to_end.store(true, Ordering::SeqCst);
        if let Some(socket) = &*lock(&self.socket) {
            // One that is gone needs no end.
            let _ = socket.shutdown(Shutdown::Write);
        }
    }

    fn pause(&self, known: &Known, pause: Duration) {
        let until = Instant::now() + pause;
        while !self.told_to_end.load(Ordering::SeqCst) && Instant::now() < until {
            known.beat();
            thread::park_timeout(until.saturating_duration_since(Instant::now()));
        }
    }

    /// `Ok`: there is to be no other.
    fn run_one(&self, settings: &CameraSettings, known: &Known, log: &Log) -> Result<(), String> {
        let said = |err: io::Error| format!("its process cannot be started: {err}");
        let (ours, its) = UnixStream::pair().map_err(said)?;
        // This very program, whatever lies in its place by now.
        let mut child = Command::new("/proc/self/exe")
            .arg0("ptztrack")
            .args(["camera", &settings.name])
            .stdin(OwnedFd::from(its))
            .stdout(Stdio::null())
            .spawn()
            .map_err(said)?;
        let heard = self.talk(ours, settings, known, log);
        lock(&self.socket).take();
        lock(&known.running).take();
        // However long its end takes. One that was given up has said why.
        if !lock(&known.state).given_up {
            sees_nothing(known, "its process ends");
        }
        let status = self.see_end(known, heard.is_ok(), LONGEST_END, |kill| {
            if kill {
                // It may have ended by now.
                let _ = child.kill();
            }
            child.try_wait()
        });
        if self.told_to_end.load(Ordering::SeqCst) || lock(&known.state).given_up {
            return Ok(());
        }
        Err(heard.err().map_or_else(|| format!("its process ended: {status}"), |err| err.to_string()))
    }

    /// Waits for its end where it may come by itself within this time, and sees to it otherwise. One that cannot even be killed, as in
    /// a driver that never returns, is waited for: this thread is well meanwhile, and no other camera is the worse for it. Where
    /// this one is to end, it is not waited for any longer.
    fn see_end(
        &self,
        known: &Known,
        by_itself: bool,
        longest: Duration,
        mut try_end: impl FnMut(bool) -> io::Result<Option<ExitStatus>>,
    ) -> String {
        let begin = Instant::now();
        loop {
            known.beat();
            match try_end(!by_itself || begin.elapsed() >= longest) {
                Ok(Some(status)) => return status.to_string(),
                Err(err) => return err.to_string(),
                Ok(None) if self.told_to_end.load(Ordering::SeqCst) && begin.elapsed() >= 2 * longest => {
                    return "it cannot be ended".to_owned();
                }
                Ok(None) => thread::park_timeout(LOOK_AGAIN),
            }
        }
    }

    /// Until it says nothing any more.
    fn talk(
        &self,
        socket: UnixStream,
        settings: &CameraSettings,
        known: &Known,
        log: &Log,
    ) -> io::Result<()> {
        socket.set_read_timeout(Some(LONGEST_SILENCE))?;
        socket.set_write_timeout(Some(LONGEST_SILENCE))?;
        let worked = known.worked.load(Ordering::Relaxed);
        let told = *lock(&known.steering);
        (&socket).write_all(&line(&Start {
            settings: settings.clone(),
            control: known.control(),
            worked,
        })?)?;
        let remote = Arc::new(Remote::new(socket.try_clone()?));
        *lock(&self.socket) = Some(socket.try_clone()?);
        *lock(&known.running) = Some(remote.clone());
        // Whoever took the camera since was heard by nobody.
        known.steer_since(told);
        if self.told_to_end.load(Ordering::SeqCst) {
            self.end();
        }
        let mut words = BufReader::new(&socket);
        let mut word = Vec::new();
        loop {
            word.clear();
            let read = (&mut words).take(MOST_BYTES).read_until(b'\n', &mut word);
            if remote.is_deaf.load(Ordering::SeqCst) {
                return Err(hangs());
            }
            match read {
                // One that died may have been at a word.
                Ok(_) if !word.ends_with(b"\n") => return Ok(()),
                Ok(_) => {}
                Err(err) if err.kind() == ErrorKind::WouldBlock => return Err(hangs()),
                Err(err) if err.kind() == ErrorKind::ConnectionReset => return Ok(()),
                Err(err) => return Err(err),
            }
            match serde_json::from_slice(&word)? {
                Word::Event(event) => log.tell(&event),
                Word::Report(report) if report.stuck => return Err(hangs()),
                Word::Report(report) => remote.hear(*report, known),
                Word::Sight(age, sight) => {
                    let at = Instant::now().checked_sub(age).unwrap_or_else(Instant::now);
                    known.sight.send_replace(Arc::new((at, sight)));
                }
                Word::Packet(packet) => drop(known.packets.send(*packet)),
                Word::Sighting(sighting) => log.keep(*sighting),
                Word::Picture(jpeg, target) => drop(known.view.send_replace(Shown { jpeg, target })),
            }
        }
    }
}

/// Has a line heard that a camera's process may have said; whether it is a word.
pub fn hear(line: &[u8]) -> bool {
    let Ok(word) = serde_json::from_slice(line) else { return false };
    if let Word::Report(report) = word {
        report.tell(&Known::new("camera"), &AtomicU64::new(0));
    }
    true
}

fn hangs() -> io::Error {
    io::Error::other("its process hangs")
}

/// The camera has no process that would see anything, and why.
fn sees_nothing(known: &Known, why: &str) {
    let mut state = lock(&known.state);
    (state.picture, state.target, state.target_id) = (false, SEARCHING.to_owned(), None);
    state.trouble = Some(why.to_owned());
}

fn line(value: &impl Serialize) -> io::Result<Vec<u8>> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    Ok(line)
}

/// A camera's process, as others see it.
#[derive(Debug)]
struct Remote {
    socket: UnixStream,
    /// Orders so far.
    given: AtomicU64,
    /// One of them could not be said.
    is_deaf: AtomicBool,
    somebody_looks: AtomicBool,
    somebody_takes_packets: AtomicBool,
    last: Mutex<Option<Report>>,
}

impl Remote {
    fn new(socket: UnixStream) -> Self {
        Self {
            socket,
            given: AtomicU64::new(0),
            is_deaf: AtomicBool::new(false),
            somebody_looks: AtomicBool::new(false),
            somebody_takes_packets: AtomicBool::new(false),
            last: Mutex::default(),
        }
    }

    /// Waits for nothing: one that leaves no room for another order hangs.
    fn order(&self, order: &Order) {
        let Ok(line) = line(order) else { return };
        self.given.fetch_add(1, Ordering::SeqCst);
        let flags = libc::MSG_DONTWAIT | libc::MSG_NOSIGNAL;
        match SockRef::from(&self.socket).send_with_flags(&line, flags) {
            Ok(sent) if sent == line.len() => {}
            // It has ended or is told to: what it says of the camera from now on is older than this order.
            Err(err) if [ErrorKind::BrokenPipe, ErrorKind::ConnectionReset].contains(&err.kind()) => {}
            // It heard half of this order or nothing, so that no report of it would count any more.
            _ => {
                self.is_deaf.store(true, Ordering::SeqCst);
                // Whoever hears what it says is woken by that.
                let _ = self.socket.shutdown(Shutdown::Both);
            }
        }
    }

    fn hear(&self, report: Report, known: &Known) {
        report.tell(known, &self.given);
        *lock(&self.last) = Some(report);
        self.look(known.looking.load(Ordering::Relaxed) > 0);
        let taken = known.packets.receiver_count() > 0;
        if self.somebody_takes_packets.swap(taken, Ordering::SeqCst) != taken {
            self.order(&Order::Stream(taken));
        }
    }
}

impl Running for Remote {
    fn look(&self, somebody: bool) {
        if self.somebody_looks.swap(somebody, Ordering::SeqCst) != somebody {
            self.order(&Order::Look(somebody));
        }
    }

    fn select(&self, x: f64, y: f64) {
        self.order(&Order::Select { x, y });
    }

    fn select_track(&self, id: u64) {
        self.order(&Order::SelectTrack(id));
    }

    fn ignore(&self, ids: &BTreeSet<u64>) {
        self.order(&Order::Ignore(ids.clone()));
    }

    fn release(&self) {
        self.order(&Order::Release);
    }

    fn steer(&self, steering: Steering) {
        self.order(&Order::Steer(steering.into()));
    }

    fn turn(&self, known: &Known, turn: Turn) -> bool {
        let mut steering = lock(&known.steering);
        if *steering == Steering::HandedOver {
            return false;
        }
        // Where it turns to is told by its next report; until then nobody calls it away.
        *steering = Steering::Operator(Instant::now());
        self.order(&Order::Turn(turn));
        true
    }

    fn abilities(&self, _: &Known) -> Abilities {
        lock(&self.last).as_ref().map(|report| report.abilities).unwrap_or_default()
    }

    fn servo_stats(&self) -> Option<ServoStats> {
        lock(&self.last).as_ref()?.servo.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    /// It would never be believed again what it says of who has the camera.
    #[test]
    fn a_process_that_says_on_and_reads_no_more_orders_hangs() {
        gst::init().unwrap();
        let settings = Config::parse("[camera.door]\naddress = \"http://127.0.0.1:1\"\n").unwrap().cameras;
        let known = Known::new("door");
        let (ours, mut its) = UnixStream::pair().unwrap();
        let report = Word::Report(Box::new(Report::of(&Known::new("door"), 0)));
        let report = line(&report).unwrap();
        thread::scope(|scope| {
            let talk =
                scope.spawn(|| Processes::default().talk(ours, &settings[0], &known, &Log::unwritten()));
            scope.spawn(move || while its.write_all(&report).is_ok() {});
            while !talk.is_finished() {
                known.select(0.5, 0.5);
            }
            assert_eq!(talk.join().unwrap().unwrap_err().to_string(), hangs().to_string());
        });
    }

    /// Whoever takes the camera then has it after a restart.
    #[test]
    fn what_a_process_says_that_was_told_to_end_is_older_than_the_last_order() {
        gst::init().unwrap();
        let (ours, its) = UnixStream::pair().unwrap();
        let remote = Arc::new(Remote::new(ours));
        let known = Known::new("door");
        *lock(&known.running) = Some(remote.clone());
        remote.socket.shutdown(Shutdown::Write).unwrap();
        known.steer(Steering::HandedOver);
        remote.hear(Report::of(&Known::new("door"), 0), &known);
        assert!(known.is_handed_over() && !remote.is_deaf.load(Ordering::SeqCst));
        drop(its);
    }

    #[test]
    fn one_that_cannot_be_killed_is_waited_for_until_the_camera_is_to_end() {
        let (processes, known) = (Processes::default(), Known::new("door"));
        let mut tries = Vec::new();
        let status = processes.see_end(&known, true, Duration::ZERO, |kill| {
            tries.push(kill);
            if tries.len() == 3 {
                processes.end();
            }
            Ok(None)
        });
        assert_eq!((status.as_str(), tries), ("it cannot be ended", vec![true; 3]));
    }

    #[test]
    fn one_that_ends_by_itself_is_not_killed() {
        let (processes, known) = (Processes::default(), Known::new("door"));
        let mut tries = Vec::new();
        let status = processes.see_end(&known, true, Duration::MAX / 2, |kill| {
            tries.push(kill);
            Ok((tries.len() == 2).then(ExitStatus::default))
        });
        assert_eq!((status, tries), (ExitStatus::default().to_string(), vec![false; 2]));
    }
}
