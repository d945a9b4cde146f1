// SPDX-License-Identifier: MPL-2.0

use std::io::{IsTerminal, Write, stderr};
use std::sync::Mutex;

use ptztrack_contract::lock::lock;
use tokio::sync::broadcast;

use crate::event::{Event, Level};

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
}

/// So many events wait for somebody who is slow; those before are lost to them.
const WAITING: usize = 256;

impl Log {
    pub fn new(format: Format) -> Self {
        Self { format: Some(format), status: Mutex::default(), events: broadcast::Sender::new(WAITING) }
    }

    /// One for those alone who subscribe.
    pub fn unwritten() -> Self {
        Self { format: None, status: Mutex::default(), events: broadcast::Sender::new(WAITING) }
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

    pub fn info(&self, event: &str, detail: impl Into<String>) {
        self.tell(&Event::new(Level::Info, None, event, detail));
    }

    pub fn error(&self, event: &str, detail: impl Into<String>) {
        self.tell(&Event::new(Level::Error, None, event, detail));
    }

    /// Shows these lines below the log, instead of those before.
    pub fn show_status(&self, lines: Vec<String>) {
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
