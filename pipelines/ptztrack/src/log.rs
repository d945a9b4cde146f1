// SPDX-License-Identifier: MPL-2.0

use std::io::{IsTerminal, Write, stderr};
use std::sync::Mutex;

use events::Sighting;
use ptztrack_contract::lock::lock;
use tokio::sync::broadcast;

use crate::event::{Event, Level, on_one_line};
use crate::waiting::{self, MOST_BYTES, Sightings, Waiting};

/// How a line looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// One readable line each
    Text,
    /// One object of JSON each
    Json,
}

/// Where everything that happens is told.
#[derive(Debug)]
pub struct Log {
    /// None where it is written by somebody else.
    format: Option<Format>,
    /// What stands below the log in a terminal.
    status: Mutex<Vec<String>>,
    /// For whoever tells it elsewhere too.
    events: broadcast::Sender<Event>,
    /// For whoever keeps who was followed.
    sightings: Mutex<Option<Waiting>>,
}

impl Default for Log {
    fn default() -> Self {
        Self::unwritten()
    }
}

/// So many events wait for somebody who is slow; those before are lost to them.
const WAITING: usize = 256;

impl Log {
    pub fn new(format: Format) -> Self {
        Self { format: Some(format), ..Self::unwritten() }
    }

    /// One for those alone who subscribe.
    pub fn unwritten() -> Self {
        Self {
            format: None,
            status: Mutex::default(),
            events: broadcast::Sender::new(WAITING),
            sightings: Mutex::default(),
        }
    }

    /// Whether there is somebody to show a status to.
    pub fn has_terminal(&self) -> bool {
        self.format == Some(Format::Text) && stderr().is_terminal()
    }

    /// Tells it.
    pub fn tell(&self, event: &Event) {
        let line = self.format.map(|format| match format {
            Format::Text => event.to_string(),
            Format::Json => serde_json::to_string(event).unwrap_or_default(),
        });
        if let Some(line) = line {
            let status = lock(&self.status);
            write(&format!("{}{line}\n{}", above(&status), below(&status)));
        }
        // Where nobody listens, that is no fault.
        let _ = self.events.send(event.clone());
    }

    /// Everything that is told from now on.
    pub fn subscribe(&self) -> broadcast::Receiver<Event> {
        self.events.subscribe()
    }

    /// Has somebody who was followed kept, where anybody keeps that. Waits for nothing; the first who is lost is said.
    pub fn keep(&self, sighting: Sighting) {
        let put = lock(&self.sightings).as_ref().map(|waiting| waiting.put(sighting));
        if put == Some(Err(1)) {
            let detail = format!(
                "{} MiB of events wait for the disk, and there is no room for more: new ones are lost until it writes again. Check the \
                 disk",
                MOST_BYTES >> 20
            );
            self.tell(&Event::new(Level::Warning, None, "events-lost", detail));
        }
    }

    /// All who are followed from now on, until [`Self::keep_no_more`].
    pub fn sightings(&self) -> Sightings {
        let (waiting, sightings) = waiting::line();
        *lock(&self.sightings) = Some(waiting);
        sightings
    }

    pub fn keep_no_more(&self) {
        lock(&self.sightings).take();
    }

    pub fn info(&self, event: &str, detail: impl Into<String>) {
        self.tell(&Event::new(Level::Info, None, event, detail));
    }

    pub fn error(&self, event: &str, detail: impl Into<String>) {
        self.tell(&Event::new(Level::Error, None, event, detail));
    }

    /// Shows these lines below the log, instead of those before.
    pub fn show_status(&self, lines: Vec<String>) {
        let lines: Vec<String> = lines.into_iter().map(|line| on_one_line(&line)).collect();
        let mut status = lock(&self.status);
        let text = format!("{}{}", above(&status), below(&lines));
        *status = lines;
        write(&text);
    }
}

/// To the first line of the status, which is wiped.
fn above(status: &[String]) -> String {
    if status.is_empty() { String::new() } else { format!("\x1b[{}F\x1b[J", status.len()) }
}

fn below(status: &[String]) -> String {
    status.iter().map(|line| format!("{line}\n")).collect()
}

/// Nobody can be told that standard error cannot be written.
fn write(text: &str) {
    let _ = stderr().lock().write_all(text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_status_is_one_line_and_no_order_to_a_terminal() {
        let log = Log::default();
        log.show_status(vec!["door: a\r\nb\u{1b}[2Jc".to_owned()]);
        assert_eq!(*lock(&log.status), ["door: a  b [2Jc"]);
    }
}
