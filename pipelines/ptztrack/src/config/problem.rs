// SPDX-License-Identifier: MPL-2.0

use std::fmt;
use std::ops::Range;

/// Mistakes in a file, each with its line.
#[derive(Debug, Default, PartialEq)]
pub struct Problems(Vec<Problem>);

#[derive(Debug, PartialEq)]
struct Problem {
    line: usize,
    text: String,
}

impl Problems {
    /// Notes what is wrong with this part of `source`, in bytes.
    pub fn add(&mut self, source: &str, at: Range<usize>, text: impl Into<String>) {
        let before = source.get(..at.start.min(source.len())).unwrap_or(source);
        self.0.push(Problem { line: before.matches('\n').count() + 1, text: text.into() });
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// In the order of the file, without what was said twice.
    pub fn sorted(mut self) -> Self {
        self.0.sort_by_key(|problem| problem.line);
        self.0.dedup();
        self
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, Problem { line, text }) in self.0.iter().enumerate() {
            write!(f, "{}line {line}: {text}", if n == 0 { "" } else { "\n" })?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}
