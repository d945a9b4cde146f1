// SPDX-License-Identifier: MPL-2.0

//! What an application tells its watchdog, and what that answers. It says all there is to say each time: a watchdog that was started anew, or took
//! over, needs to know nothing of before.

use serde::ser::Error as _;
use serde::{Deserialize, Serialize};

use crate::Stop;
use crate::http::Identity;

/// A line that is longer is none, and ends the connection: real ones have less than a kilobyte.
pub(super) const MAX_LINE_BYTES: usize = 64 * 1024;

/// One line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Message {
    /// A camera may move from now on, or still does: the lease begins, or is renewed.
    Hold {
        /// Of all leases of this application.
        lease: u64,
        /// What is to be done when it ends.
        stop: Box<StopOrder>,
    },
    /// The camera rests, or is no longer ours to stop.
    Release {
        /// Which lease.
        lease: u64,
    },
}

/// What the watchdog says to each [`Message`], once it has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    /// The camera will be stopped when this lease ends.
    Held {
        /// Which lease.
        lease: u64,
    },
    /// The camera will be left alone.
    Released {
        /// Which lease.
        lease: u64,
    },
}

/// How a camera is stopped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StopOrder {
    /// By whom the camera is to think that it is stopped.
    pub identity: Identity,
    /// The words that end its move.
    pub words: Stop,
    /// A move is under way that the camera has not answered: it may act on it after a stop.
    pub in_doubt: bool,
}

impl Message {
    /// With the end of the line. What the camera has told is left out where there is too much of it: the watchdog asks it
    /// anew, and ends the leases of all cameras for a line that is too long.
    ///
    /// # Errors
    /// Where a value has no JSON form, which none of these lacks but a path that is not UTF-8; or where the line is too long
    /// even so.
    pub fn to_line(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut line = to_line(self)?;
        if line.len() > MAX_LINE_BYTES {
            line = to_line(&self.clone().without_findings())?;
        }
        if line.len() > MAX_LINE_BYTES {
            return Err(serde_json::Error::custom("what is to be said of this camera is too long"));
        }
        Ok(line)
    }

    fn without_findings(mut self) -> Self {
        if let Self::Hold { stop, .. } = &mut self {
            stop.identity.findings = serde_json::Value::Null;
        }
        self
    }

    /// Reads a line.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn of_line(line: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(line)
    }
}

impl Answer {
    /// With the end of the line.
    ///
    /// # Errors
    /// Never: a number has a JSON form.
    pub fn to_line(self) -> Result<Vec<u8>, serde_json::Error> {
        to_line(&self)
    }

    /// Reads a line.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn of_line(line: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(line)
    }
}

fn to_line(value: &impl Serialize) -> Result<Vec<u8>, serde_json::Error> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    Ok(line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{client_settings, credentials};
    use crate::http::{ClientSettings, Trust};
    use std::time::Duration;

    fn hold(channel: &str) -> Message {
        let settings = ClientSettings {
            channel: channel.to_owned(),
            credentials: credentials("geheim"),
            timeout: Duration::from_millis(1500),
            trust: Trust::Anyone,
            ..client_settings("https://camera:8443")
        };
        let identity = settings.into();
        let stop = StopOrder { identity, words: Stop::AllAxes, in_doubt: true };
        Message::Hold { lease: 7, stop: Box::new(stop) }
    }

    #[test]
    fn a_line_says_all_and_its_debug_form_keeps_the_password() {
        let message = hold("2");
        let line = message.to_line().unwrap();
        assert_eq!(line.iter().filter(|byte| **byte == b'\n').count(), 1);
        assert_eq!(Message::of_line(&line).unwrap(), message);
        assert!(!format!("{message:?}").contains("geheim"));
        assert!(Message::of_line(b"{}").is_err());
        let answer = Answer::Held { lease: 7 };
        assert_eq!(Answer::of_line(&answer.to_line().unwrap()).unwrap(), answer);
    }

    /// Else one camera would end the watchdog of all.
    #[test]
    fn no_line_is_longer_than_is_read() {
        let mut message = hold("2");
        let Message::Hold { stop, .. } = &mut message else { panic!() };
        stop.identity.findings = serde_json::json!({ "profile": { "name": "\"".repeat(40_000) } });
        let line = message.to_line().unwrap();
        assert!(line.len() <= MAX_LINE_BYTES);
        assert_eq!(Message::of_line(&line).unwrap(), hold("2"), "all but what it told");
        assert!(hold(&"2".repeat(MAX_LINE_BYTES)).to_line().is_err());
    }
}
