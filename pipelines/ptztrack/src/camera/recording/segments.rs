// SPDX-License-Identifier: MPL-2.0

//! In which file of a recording a time is.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Weak};

use events::Pointer;
use ptztrack_contract::lock::lock;

/// The files of a recording that began last, in the order of their pictures. They are not looked for: the disk may hang.
#[derive(Debug, Default)]
pub struct Segments(Mutex<VecDeque<Segment>>);

#[derive(Debug)]
struct Segment {
    /// When it began, in milliseconds since 1970.
    at_ms: i64,
    file: PathBuf,
    /// Whoever writes it, while they do.
    writer: Weak<()>,
}

impl Segments {
    /// More are not remembered.
    const MOST: usize = 64;

    /// The file of that name begins; whoever writes it writes none of those before any more. It begins when its first picture came:
    /// `splitmuxsink` opens it only where it has all pictures up to the next that needs no other, and of a camera that sends one a minute
    /// that is a minute later.
    pub fn begin(
        &self,
        came_ms: Option<i64>,
        now_ms: i64,
        named: impl FnOnce(i64) -> PathBuf,
        writer: &Arc<()>,
    ) -> PathBuf {
        let writer = Arc::downgrade(writer);
        let mut segments = lock(&self.0);
        // A pipeline that ends beside the next one may open its last file late.
        let before = segments.iter().position(|segment| segment.writer.ptr_eq(&writer));
        let earliest =
            before.and_then(|before| segments.get(before)).map_or(i64::MIN, |before| before.at_ms + 1);
        // Where the clock was set back, the one before is yet to come.
        let mut at_ms = came_ms.unwrap_or(now_ms).clamp(earliest.min(now_ms), now_ms);
        // None is written over.
        while segments.iter().any(|segment| segment.at_ms == at_ms) {
            at_ms += 1;
        }
        if let Some(before) = before.and_then(|before| segments.get_mut(before)) {
            before.writer = Weak::new();
        }
        let file = named(at_ms);
        let place = before.map_or(segments.len(), |before| before + 1);
        segments.insert(place, Segment { at_ms, file: file.clone(), writer });
        let surplus = segments.len().saturating_sub(Self::MOST);
        segments.drain(..surplus);
        file
    }

    /// Where a time is; it may be in the next file, which is not opened yet.
    pub fn at(&self, at_ms: i64) -> Option<Pointer> {
        let segments = lock(&self.0);
        let segment = segments.iter().rfind(|segment| segment.at_ms <= at_ms)?;
        Some(Pointer { file: segment.file.clone(), offset_ms: at_ms - segment.at_ms })
    }

    /// Whether somebody still writes a file; its name need not be the newest, where the clock was set back.
    pub fn is_written(&self, file: &Path) -> bool {
        lock(&self.0).iter().any(|segment| segment.file == file && segment.writer.strong_count() > 0)
    }
}

/// When the last pictures came that need no other, in milliseconds since 1970, by their times in the stream.
#[derive(Debug, Default)]
pub struct Arrivals(Mutex<VecDeque<(gst::ClockTime, i64)>>);

impl Arrivals {
    /// As many as may wait for a disk for half a minute, where each needs no other.
    const MOST: usize = 1024;

    /// One came.
    pub fn note(&self, pts: gst::ClockTime, now_ms: i64) {
        let mut arrivals = lock(&self.0);
        if arrivals.len() == Self::MOST {
            arrivals.pop_front();
        }
        arrivals.push_back((pts, now_ms));
    }

    /// When that one came.
    pub fn came_ms(&self, pts: gst::ClockTime) -> Option<i64> {
        lock(&self.0).iter().rfind(|(of, _)| *of == pts).map(|(_, came_ms)| *came_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(at_ms: i64) -> PathBuf {
        format!("{at_ms}.mkv").into()
    }

    fn pointer(began_ms: i64, offset_ms: i64) -> Option<Pointer> {
        Some(Pointer { file: named(began_ms), offset_ms })
    }

    #[test]
    fn a_time_is_in_the_file_that_began_last() {
        let segments = Segments::default();
        assert_eq!(segments.at(5000), None);
        let writer = Arc::new(());
        [1000, 3000].into_iter().for_each(|at_ms| drop(segments.begin(Some(at_ms), 5000, named, &writer)));
        assert_eq!(segments.at(999), None);
        assert_eq!(segments.at(2999), pointer(1000, 1999));
        assert_eq!(segments.at(3000), pointer(3000, 0));
        (4..100).for_each(|second| drop(segments.begin(None, 1000 * second, named, &writer)));
        assert_eq!((segments.at(3500), segments.at(99_500)), (None, pointer(99_000, 500)));
    }

    #[test]
    fn a_file_begins_with_its_first_picture_and_after_the_one_before() {
        let begin = |before: Option<i64>, came_ms| {
            let (segments, writer) = (Segments::default(), Arc::new(()));
            before.map(|before| segments.begin(None, before, named, &writer));
            segments.begin(came_ms, 61_000, named, &writer)
        };
        assert_eq!(begin(None, Some(1000)), named(1000));
        assert_eq!(begin(Some(500), None), named(61_000));
        assert_eq!(begin(Some(2000), Some(1000)), named(2001));
        assert_eq!(begin(Some(2000), Some(62_000)), named(61_000), "never later than it is opened");
        assert_eq!(begin(Some(90_000), Some(1000)), named(61_000), "the clock was set back");
    }

    #[test]
    fn a_pipeline_that_ends_beside_the_next_takes_no_time_of_it() {
        let segments = Segments::default();
        let [old, new] = [(), ()].map(Arc::new);
        segments.begin(Some(1000), 2000, named, &old);
        segments.begin(Some(11_000), 12_000, named, &new);
        assert_eq!(segments.begin(Some(9000), 13_000, named, &old), named(9000));
        assert_eq!(segments.at(12_500), pointer(11_000, 1500));
        assert_eq!(segments.at(9500), pointer(9000, 500));
        // At the same time as another.
        assert_eq!(segments.begin(Some(11_000), 13_000, named, &old), named(11_001));
        let written = [1000, 9000, 11_000, 11_001].map(|at_ms| segments.is_written(&named(at_ms)));
        assert_eq!(written, [false, false, true, true]);
        // As when it is begun anew.
        drop(new);
        assert!(!segments.is_written(&named(11_000)));
    }

    #[test]
    fn it_is_known_when_a_picture_came() {
        let arrivals = Arrivals::default();
        let second = gst::ClockTime::from_seconds;
        arrivals.note(second(1), 500);
        // Of a camera whose times begin anew.
        arrivals.note(second(1), 900);
        assert_eq!((arrivals.came_ms(second(1)), arrivals.came_ms(second(2))), (Some(900), None));
        (2..2000).for_each(|number| arrivals.note(second(number), 0));
        assert_eq!(arrivals.came_ms(second(1)), None);
    }
}
