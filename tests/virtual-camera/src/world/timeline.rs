// SPDX-License-Identifier: MPL-2.0

//! Which picture of a recording shows the world when.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

/// Pictures and their times. Asked at any moment, also while the recording is busy decoding.
#[derive(Debug)]
pub(crate) struct Timeline {
    frame_rate: f64,
    start: u64,
    /// The one after the last; a recording may turn out shorter than its header says.
    end: AtomicU64,
    looped: bool,
}

impl Timeline {
    /// Pictures `start` to `end` (not included) at `frame_rate` a second; then the same again, or the last for ever.
    pub fn new(frame_rate: f64, start: u64, end: u64, looped: bool) -> Self {
        Self { frame_rate, start, end: AtomicU64::new(end), looped }
    }

    /// Pictures per second.
    pub fn frame_rate(&self) -> f64 {
        self.frame_rate
    }

    /// Number of the first picture.
    pub fn start(&self) -> u64 {
        self.start
    }

    /// Lets it end before picture `end`, which is after the start.
    pub fn end_at(&self, end: u64) {
        self.end.store(end, Ordering::Relaxed);
    }

    /// Number of the picture at a time since the camera's start.
    pub fn frame_at(&self, time: Duration) -> u64 {
        let end = self.end.load(Ordering::Relaxed);
        let played = (time.as_secs_f64() * self.frame_rate) as u64;
        if self.looped {
            self.start + played % (end - self.start)
        } else {
            (self.start + played).min(end - 1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_or_holds() {
        let at = |timeline: &Timeline, seconds| timeline.frame_at(Duration::from_secs_f64(seconds));
        let looped = Timeline::new(10.0, 5, 25, true);
        assert_eq!([0.0, 0.05, 1.95, 2.0, 4.1].map(|time| at(&looped, time)), [5, 5, 24, 5, 6]);
        let once = Timeline::new(10.0, 5, 25, false);
        assert_eq!([0.0, 1.95, 2.0, 99.0].map(|time| at(&once, time)), [5, 24, 24, 24]);
        once.end_at(20);
        assert_eq!(at(&once, 99.0), 19);
    }
}
