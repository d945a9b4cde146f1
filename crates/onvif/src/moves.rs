// SPDX-License-Identifier: MPL-2.0

use serde::{Deserialize, Serialize};

/// By which words a camera is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum StopWords {
    /// `Stop`.
    Stop,
    /// A `ContinuousMove` of no velocity, for cameras that lack `Stop` (Home Assistant pull request 163173), or break by it
    /// (iris pull request 177).
    Still,
}

/// What a camera turned out to understand: learned from what it refuses, as what it tells of itself is no witness.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Moves {
    stop_words: StopWords,
    /// The last that was sent was a stop: where it has to be sent again, that one did not do.
    stopped: bool,
    /// An answer to a move with zoom that was none, in a row.
    broken_zooms: u32,
    /// The zoom is left alone.
    leaves_zoom: bool,
    /// Moves with a timeout, in a row, at which the camera closed the connection.
    broken_timeouts: u32,
    /// Those that it refused, and took without one.
    #[serde(default)]
    refused_timeouts: u32,
}

impl Default for Moves {
    fn default() -> Self {
        Self {
            stop_words: StopWords::Stop,
            stopped: false,
            broken_zooms: 0,
            leaves_zoom: false,
            broken_timeouts: 0,
            refused_timeouts: 0,
        }
    }
}

impl Moves {
    /// After so many moves with zoom whose answers were none, the zoom is left alone (onvifsim: TL-IPC652P-A4).
    const BROKEN_ZOOMS: u32 = 2;

    /// After so many moves with a timeout at which the camera closed the connection, or that it refused, it is moved without one.
    const BROKEN_TIMEOUTS: u32 = 2;

    /// How to stop the camera this time: a stop after a stop is told in the other words.
    pub fn next_stop(&mut self) -> StopWords {
        if self.stopped {
            self.stop_refused();
        }
        self.stopped = true;
        self.stop_words
    }

    /// The words that a stop is told in.
    pub fn stop_words(&self) -> StopWords {
        self.stop_words
    }

    /// The camera does not take these words for a stop.
    pub fn stop_refused(&mut self) {
        self.stop_words = match self.stop_words {
            StopWords::Stop => StopWords::Still,
            StopWords::Still => StopWords::Stop,
        };
    }

    /// A move is being sent.
    pub fn moving(&mut self) {
        self.stopped = false;
    }

    /// The camera closed the connection at a move with a timeout; returns whether it may be for that.
    pub fn breaks_at_timeout(&mut self) -> bool {
        self.broken_timeouts += 1;
        self.broken_timeouts > Self::BROKEN_TIMEOUTS
    }

    /// The camera refused a move with a timeout and took it without; returns whether it is for that, and not for being busy.
    pub fn refuses_timeout(&mut self) -> bool {
        self.refused_timeouts += 1;
        self.refused_timeouts > Self::BROKEN_TIMEOUTS
    }

    /// What became of a move with a timeout otherwise.
    pub fn took_timeout(&mut self, taken: bool) {
        if taken {
            (self.broken_timeouts, self.refused_timeouts) = (0, 0);
        }
    }

    /// Whether a move may have to do with the zoom.
    pub fn zooms(&self) -> bool {
        !self.leaves_zoom
    }

    /// What became of a move with zoom; returns whether the zoom is to be left alone for that.
    pub fn zoomed(&mut self, broken: bool) -> bool {
        self.broken_zooms = if broken { self.broken_zooms + 1 } else { 0 };
        self.broken_zooms >= Self::BROKEN_ZOOMS
    }

    /// From now on no move has to do with the zoom.
    pub fn leave_zoom(&mut self) {
        self.leaves_zoom = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_that_has_to_be_repeated_is_told_otherwise() {
        let mut moves = Moves::default();
        moves.moving();
        assert_eq!(
            [moves.next_stop(), moves.next_stop(), moves.next_stop()],
            [StopWords::Stop, StopWords::Still, StopWords::Stop]
        );
        moves.stop_refused();
        moves.moving();
        assert_eq!(moves.next_stop(), StopWords::Still, "what worked last is tried first");
    }

    #[test]
    fn a_zoom_that_breaks_the_answer_is_left_alone() {
        let mut moves = Moves::default();
        assert_eq!([true, false, true, true].map(|broken| moves.zoomed(broken)), [false, false, false, true]);
        assert!(moves.zooms());
        moves.leave_zoom();
        assert!(!moves.zooms());
    }
}
