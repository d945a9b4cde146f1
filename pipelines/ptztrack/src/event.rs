// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use axum::body::Bytes;
use serde::{Deserialize, Serialize};

/// How much somebody should care.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    Info,
    Warning,
    Error,
}

/// Something that happened: a line in the log.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Event {
    /// ISO 8601, UTC.
    pub time: String,
    pub level: Level,
    /// Which camera; none where it is the program's own affair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
    /// What, in a word that stays the same.
    pub event: String,
    /// In words, for a person.
    pub detail: String,
    /// Where the page has a picture of it, below its own address.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    /// The same picture.
    #[serde(skip)]
    pub jpeg: Option<Bytes>,
}

impl Event {
    /// Now.
    pub fn new(
        level: Level,
        camera: Option<&str>,
        event: impl Into<String>,
        detail: impl Into<String>,
    ) -> Self {
        let now = glib::DateTime::now_utc().and_then(|now| now.format("%Y-%m-%dT%H:%M:%SZ"));
        Self {
            time: now.map(String::from).unwrap_or_default(),
            level,
            camera: camera.map(str::to_owned),
            event: event.into(),
            detail: detail.into(),
            picture: None,
            jpeg: None,
        }
    }

    /// The same with the picture of an event that was kept.
    pub fn with_picture(self, id: i64, jpeg: &[u8]) -> Self {
        let (picture, jpeg) = (format!("events/{id}/picture"), Bytes::copy_from_slice(jpeg));
        Self { picture: Some(picture), jpeg: Some(jpeg), ..self }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let camera = self.camera.as_deref().unwrap_or("ptztrack");
        let level = match self.level {
            Level::Info => "",
            Level::Warning => "warning: ",
            Level::Error => "error: ",
        };
        write!(f, "{} {camera}: {level}{}", self.time, on_one_line(&self.detail))
    }
}

/// One line, and nothing that a terminal would obey, whatever the elements and cameras have to say.
pub fn on_one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_log_is_one_line_and_no_order_to_a_terminal() {
        let line = Event::new(Level::Warning, Some("door"), "warning", "a\r\nb\u{1b}[2Jc").to_string();
        assert!(line.ends_with("door: warning: a  b [2Jc") && !line.contains(char::is_control), "{line:?}");
    }
}
