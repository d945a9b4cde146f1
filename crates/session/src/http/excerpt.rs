// SPDX-License-Identifier: MPL-2.0

use crate::Error;

/// Longest part of a camera's text that is repeated in a message.
const EXCERPT_CHARS: usize = 160;

/// What is said of an answer that is not understood.
pub fn unexpected(body: &str) -> Error {
    Error::Unexpected(if body.trim().is_empty() {
        "empty".to_owned()
    } else {
        format!("`{}`", excerpt(body))
    })
}

/// The beginning of `text` on one line, harmless to print.
pub fn excerpt(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().take(EXCERPT_CHARS).collect();
    words.join(" ").chars().filter(|c| !c.is_control()).take(EXCERPT_CHARS).collect()
}
