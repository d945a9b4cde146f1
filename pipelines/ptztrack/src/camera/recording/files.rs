// SPDX-License-Identifier: MPL-2.0

//! What is recorded, and how long it is kept.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use events::Pointer;
use gst::prelude::*;

use super::segments::Segments;
use crate::config::Recording;

/// This share of a disk is left to others: one in so many.
const FREE_SHARE: u64 = 20;

/// Of the disk, no file is begun or written where less than this share is free: others delete theirs before it comes to that.
const LEAST_SHARE: u64 = 2 * FREE_SHARE;
pub const SHORT: &str = "less than a fortieth of the disk is free: make room";
pub const EARLY: &str = "the oldest recordings are deleted before their time, as less than a twentieth of the disk is free: make room, \
                         or set a lower `keep` or `keep-bytes`";

/// A file has at most one part in so many of the disk, as large as the room that is never written to: only where another begins is
/// anything deleted for `keep-bytes`, and the newest is never deleted to make room.
const LARGEST_SHARE: u64 = LEAST_SHARE;

/// A file has at most one part in so many of `keep-bytes`.
const KEPT_FILES: u64 = 4;

/// A part of a file of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Piece {
    pub file: PathBuf,
    pub from: gst::ClockTime,
    pub lasts: gst::ClockTime,
    /// Where it is among all pieces.
    pub at: gst::ClockTime,
}

/// From there on for so long, in all files that the recording went on in. The file that is named may be the one before: of whoever came
/// and went while the next one was not opened yet.
pub fn pieces(from: &Pointer, lasts_ms: i64) -> Vec<Piece> {
    let mut files = later(&from.file);
    files.insert(0, (0, from.file.clone()));
    let (begin_ms, end_ms) = (from.offset_ms, from.offset_ms.saturating_add(lasts_ms));
    let ends = files.iter().skip(1).map(|(at_ms, _)| *at_ms).chain([i64::MAX]);
    let seen = files.iter().zip(ends).filter(|((at_ms, _), ends_ms)| *at_ms < end_ms && *ends_ms > begin_ms);
    let piece = |((at_ms, file), _): (&(i64, PathBuf), _)| {
        let time = |ms: i64| gst::ClockTime::from_mseconds(ms.max(0).unsigned_abs());
        let first_ms = begin_ms.max(*at_ms);
        let [from, lasts, at] = [first_ms - at_ms, end_ms - first_ms, first_ms - begin_ms].map(time);
        Piece { file: file.clone(), from, lasts, at }
    };
    seen.map(piece).collect()
}

/// The files that this recording went on in, and how much later each began, in milliseconds; the earliest first.
fn later(file: &Path) -> Vec<(i64, PathBuf)> {
    let Some((camera, began_ms)) = name_of(file) else { return Vec::new() };
    let entries = fs::read_dir(file.parent().unwrap_or(Path::new("."))).into_iter().flatten().flatten();
    let mut later: Vec<_> = entries
        .filter_map(|entry| {
            let other = entry.path();
            let at_ms = name_of(&other).filter(|(of, _)| *of == camera)?.1 - began_ms;
            (other.as_path() > file).then_some((at_ms, other))
        })
        .collect();
    later.sort();
    later
}

/// Whose recording a file is of, and when it began, in milliseconds since 1970. Nothing but names as [`configure`] gives them: a clip
/// that somebody keeps beside the recordings, as `door-17.mkv`, is none of them.
fn name_of(file: &Path) -> Option<(&str, i64)> {
    let (camera, time) = file.file_name()?.to_str()?.strip_suffix(".mkv")?.rsplit_once('-')?;
    let is_ours = |(at, byte): (usize, u8)| if at == 8 { byte == b'T' } else { byte.is_ascii_digit() };
    (time.len() == TIME && time.bytes().enumerate().all(is_ours)).then_some(())?;
    let (seconds, thousandths) = time.split_at_checked(TIME - 3)?;
    let time = glib::DateTime::from_iso8601(&format!("{seconds}Z"), None).ok()?;
    Some((camera, time.to_unix() * 1000 + thousandths.parse::<i64>().ok()?))
}

/// So long is the time in a name, as `20260101T000000250`. To the millisecond: a pipeline that is started anew must not write over what
/// it recorded just before.
const TIME: usize = 18;

pub fn now_ms() -> i64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(now.as_millis()).unwrap_or(i64::MAX)
}

/// Names the files by the time at which they begin, bounds them, and deletes old ones whenever another begins. When the picture of a
/// time in the stream came is in milliseconds since 1970.
pub fn configure(
    pipeline: &gst::Pipeline,
    recording: &Recording,
    camera: &str,
    segments: &Arc<Segments>,
    came_ms: impl Fn(gst::ClockTime) -> Option<i64> + Send + Sync + 'static,
) {
    let Some(sink) = pipeline.by_name("recording") else { return };
    sink.set_property("max-size-time", u64::try_from(recording.segment.as_nanos()).unwrap_or(u64::MAX));
    // Where the folder cannot be made, there is no disk to be asked about; the element says so.
    let _ = fs::create_dir_all(&recording.folder);
    if let Some(bytes) = largest_file(recording, Disk::of(&recording.folder).map(|disk| disk.bytes)) {
        sink.set_property("max-size-bytes", bytes);
    }
    let (recording, camera, segments) = (recording.clone(), camera.to_owned(), segments.clone());
    // Goes with the sink.
    let writer = Arc::new(());
    sink.connect("format-location-full", false, move |values| {
        // Where a folder cannot be written, the element says so.
        let _ = fs::create_dir_all(&recording.folder);
        delete_old(&recording, &camera);
        let first = values.get(2).and_then(|value| value.get::<gst::Sample>().ok());
        let came_ms = first.and_then(|first| came_ms(first.buffer()?.pts()?));
        let named = |at_ms| recording.folder.join(format!("{camera}-{}.mkv", name_at(at_ms)));
        let file = segments.begin(came_ms, now_ms(), named, &writer);
        Some(file.to_value())
    });
}

/// A time as it is in names.
fn name_at(at_ms: i64) -> String {
    let seconds = glib::DateTime::from_unix_utc(at_ms.div_euclid(1000));
    let seconds = seconds.and_then(|time| time.format("%Y%m%dT%H%M%S"));
    seconds.map(|seconds| format!("{seconds}{:03}", at_ms.rem_euclid(1000))).unwrap_or_default()
}

/// The bytes after which the next file begins, on a disk of so many. It may still be larger by pictures that need the one before.
fn largest_file(recording: &Recording, disk: Option<u64>) -> Option<u64> {
    let of_kept = recording.keep_bytes.map(|most| most / KEPT_FILES);
    let of_disk = disk.map(|bytes| bytes / LARGEST_SHARE);
    // To the element, 0 is without a bound.
    of_kept.into_iter().chain(of_disk).min().map(|bytes| bytes.max(1))
}

/// A disk as whoever records may fill it, in bytes: what is kept for root, or is beyond a quota, is no part of it. `df` reckons its
/// percentage in the same way.
#[derive(Debug, Clone, Copy)]
struct Disk {
    bytes: u64,
    free: u64,
}

impl Disk {
    /// Nothing where nobody can tell: not every network's disk does.
    fn of(folder: &Path) -> Option<Self> {
        let disk = rustix::fs::statvfs(folder).ok()?;
        let used = disk.f_blocks.saturating_sub(disk.f_bfree);
        let [bytes, free] = [used.saturating_add(disk.f_bavail), disk.f_bavail]
            .map(|blocks| blocks.saturating_mul(disk.f_frsize));
        (bytes > 0).then_some(Self { bytes, free })
    }

    /// So many bytes are missing where one part of so many is to be free.
    fn lacks(self, share: u64) -> u64 {
        (self.bytes / share).saturating_sub(self.free)
    }
}

/// What room there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// So many files were deleted for it.
    pub deleted: usize,
    /// There is so little still that nothing is to be written.
    pub is_short: bool,
}

/// Deletes the oldest files of this camera where the disk has less left than is to be, but for the newest and what is being written.
pub fn make_room(recording: &Recording, camera: &str, segments: &Segments) -> Room {
    let lacks = |share| Disk::of(&recording.folder).map_or(0, |disk| disk.lacks(share));
    let mut files = files(&recording.folder, camera);
    sort_newest_first(&mut files, now_ms());
    let deleted = delete(lacks(FREE_SHARE), files.into_iter().skip(1).rev(), segments);
    Room { deleted, is_short: lacks(LEAST_SHARE) > 0 }
}

/// Deletes files that nobody writes until so many bytes are free, as soon as the disk has freed them: it does so later, where a file is
/// still read, and some file systems always. Returns how many it were; one that cannot be deleted keeps none of the others.
fn delete(mut bytes: u64, files: impl Iterator<Item = Kept>, segments: &Segments) -> usize {
    let mut deleted = 0;
    for file in files.filter(|file| !segments.is_written(&file.path)) {
        if bytes == 0 {
            break;
        }
        if fs::remove_file(&file.path).is_ok() {
            bytes = bytes.saturating_sub(file.bytes);
            deleted += 1;
        }
    }
    deleted
}

/// Whether something was written not long ago.
pub fn newest_grew(recording: &Recording, camera: &str, within: Duration) -> bool {
    files(&recording.folder, camera).iter().any(|file| file.bytes > 0 && file.age < within)
}

/// One file of a recording.
#[derive(Debug)]
struct Kept {
    path: PathBuf,
    /// By its name, in milliseconds since 1970.
    began_ms: i64,
    bytes: u64,
    /// Since it was last written to, by the clock.
    age: Duration,
    /// How long it was written to; a clock that jumps meanwhile makes it no longer than a file may be.
    lasts: Duration,
}

/// A file that cannot be deleted is tried again when the next begins.
fn delete_old(recording: &Recording, camera: &str) {
    for file in too_much(files(&recording.folder, camera), recording, now_ms()) {
        let _ = fs::remove_file(file);
    }
}

/// The files of this camera.
fn files(folder: &Path, camera: &str) -> Vec<Kept> {
    let now = SystemTime::now();
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    // Looked at first: nearly all files are those of other cameras, and a date takes longer to read.
    let begins = format!("{camera}-");
    let kept = |entry: fs::DirEntry| {
        entry.file_name().as_encoded_bytes().starts_with(begins.as_bytes()).then_some(())?;
        let path = entry.path();
        let (of, began_ms) = name_of(&path)?;
        (of == camera).then_some(())?;
        let meta = entry.metadata().ok()?;
        let modified = meta.modified().ok()?;
        let age = now.duration_since(modified).unwrap_or_default();
        // A disk that does not tell when it was created, or from which it was restored since, leaves its name.
        let named = SystemTime::UNIX_EPOCH + Duration::from_millis(began_ms.max(0).unsigned_abs());
        let mut begins = meta.created().into_iter().chain([named]);
        let lasts = begins.find_map(|begin| modified.duration_since(begin).ok());
        Some(Kept { path, began_ms, bytes: meta.len(), age, lasts: lasts.unwrap_or(Duration::MAX) })
    };
    entries.filter_map(kept).collect()
}

/// By their names. Those that have yet to begin are from before the clock was set back, and so the oldest: as the newest, they would
/// leave no room for whatever is recorded until then.
fn sort_newest_first(files: &mut [Kept], now_ms: i64) {
    files.sort_by(|a, b| (b.began_ms <= now_ms, &b.path).cmp(&(a.began_ms <= now_ms, &a.path)));
}

/// What is more than is kept: the oldest, by their names. How long they last is counted, not how old they are by a clock, which
/// may jump.
fn too_much(mut files: Vec<Kept>, recording: &Recording, now_ms: i64) -> Vec<PathBuf> {
    sort_newest_first(&mut files, now_ms);
    let (mut bytes, mut newer) = (0, Duration::ZERO);
    let mut goes = |file: &Kept| {
        bytes += file.bytes;
        let recorded = newer;
        newer += file.lasts.min(recording.segment);
        recording.keep.is_some_and(|keep| recorded >= keep)
            || recording.keep_bytes.is_some_and(|most| bytes > most)
    };
    files.into_iter().filter(|file| goes(file)).map(|file| file.path).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use ptztrack_contract::lock::lock;

    use super::*;

    fn kept(path: &str, bytes: u64) -> Kept {
        Kept {
            path: path.into(),
            began_ms: 0,
            bytes,
            age: Duration::from_secs(1_000_000),
            lasts: Duration::from_secs(1_000_000),
        }
    }

    fn recording(keep_s: Option<u64>, keep_bytes: Option<u64>) -> Recording {
        Recording {
            folder: "/r".into(),
            segment: Duration::from_secs(600),
            keep: keep_s.map(Duration::from_secs),
            keep_bytes,
            overlay: false,
        }
    }

    #[test]
    fn the_oldest_go_where_there_is_too_much_whatever_the_clock_says() {
        let files = || vec![kept("door-3", 40), kept("door-1", 30), kept("door-2", 50)];
        let names = |keep, bytes| {
            let gone = too_much(files(), &recording(keep, bytes), 0);
            gone.iter().map(|path| path.display().to_string()).collect::<Vec<_>>()
        };
        assert_eq!(names(None, Some(100)), ["door-1"]);
        assert_eq!(names(Some(1200), None), ["door-1"]);
        assert_eq!(names(Some(600), None), ["door-2", "door-1"]);
        assert!(names(Some(3600), Some(1000)).is_empty());
    }

    #[test]
    fn those_from_before_the_clock_was_set_back_go_first() {
        let of = |name: &str| {
            let path = PathBuf::from(format!("door-{name}.mkv"));
            let (_, began_ms) = name_of(&path).unwrap();
            Kept { began_ms, ..kept(path.to_str().unwrap(), 1) }
        };
        let [ahead, further, present] = ["20360101T000000000", "20360101T001000000", "20260101T001000000"];
        let now_ms = of(present).began_ms;
        let gone = |keep_s| {
            let files = [further, present, ahead].map(of).into();
            too_much(files, &recording(Some(keep_s), None), now_ms)
        };
        assert_eq!(gone(600), [of(further).path, of(ahead).path]);
        assert_eq!(gone(1200), [of(ahead).path]);
    }

    #[test]
    fn as_much_is_deleted_as_is_needed_but_never_what_is_written() {
        let folder = std::env::temp_dir().join(format!("ptztrack-short-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let paths = ["a", "b", "c", "d"].map(|name| folder.join(name));
        paths.iter().for_each(|path| fs::write(path, "x").unwrap());
        let files = || paths.iter().map(|path| kept(path.to_str().unwrap(), 40));
        let there = || paths.iter().map(|path| path.exists()).collect::<Vec<_>>();
        let (segments, writer) = (Segments::default(), Arc::new(()));
        segments.begin(None, 0, |_| paths[2].clone(), &writer);
        segments.begin(None, 1, |_| paths[3].clone(), &writer);
        assert_eq!((delete(0, files(), &segments), there()), (0, vec![true, true, true, true]));
        assert_eq!((delete(40, files(), &segments), there()), (1, vec![false, true, true, true]));
        // One that is gone already frees nothing.
        assert_eq!((delete(41, files(), &segments), there()), (2, vec![false, false, false, true]));
        assert_eq!((delete(u64::MAX, files(), &segments), there()[3]), (0, true), "what is written stays");
        // As when it is begun anew.
        drop(writer);
        assert_eq!((delete(1, files(), &segments), there()[3]), (1, false));
        fs::remove_dir_all(&folder).unwrap();
    }

    /// Its bytes are there since now, and it was last written to in 2026.
    #[test]
    fn one_that_was_restored_lasts_for_as_long_as_it_was_written() {
        let folder = std::env::temp_dir().join(format!("ptztrack-restored-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("door-20260101T000000000.mkv");
        fs::write(&path, "x").unwrap();
        let began_ms = name_of(&path).unwrap().1.unsigned_abs();
        let ended = SystemTime::UNIX_EPOCH + Duration::from_millis(began_ms) + Duration::from_secs(500);
        fs::File::options().append(true).open(&path).unwrap().set_modified(ended).unwrap();
        assert_eq!(files(&folder, "door")[0].lasts, Duration::from_secs(500));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_is_a_small_part_of_the_disk_and_of_what_is_kept() {
        let largest = |keep_bytes, disk| largest_file(&recording(None, keep_bytes), disk);
        assert_eq!(largest(None, Some(40_000)), Some(1000));
        assert_eq!(largest(Some(8000), Some(40_000)), Some(1000));
        assert_eq!(largest(Some(2000), Some(40_000)), Some(500));
        assert_eq!(largest(Some(2000), None), Some(500));
        assert_eq!(largest(None, None), None);
        assert_eq!(largest(Some(3), Some(40_000)), Some(1), "0 would be without a bound");
    }

    #[test]
    fn a_disk_is_what_may_be_filled_of_it() {
        let disk = Disk::of(&std::env::temp_dir()).unwrap();
        assert!(0 < disk.free && disk.free <= disk.bytes, "{disk:?}");
        assert!(Disk::of(Path::new("/not/there")).is_none());
        let lacks = |free| Disk { bytes: 40_000, free }.lacks(LEAST_SHARE);
        assert_eq!([lacks(900), lacks(1000), lacks(2000)], [100, 0, 0]);
    }

    /// A second's pictures that are opened a second later.
    #[test]
    fn files_are_named_by_when_their_first_picture_was_taken() {
        gst::init().unwrap();
        let folder = std::env::temp_dir().join(format!("ptztrack-named-{}", std::process::id()));
        let recording = Recording {
            folder: folder.clone(),
            segment: Duration::from_secs(2),
            ..recording(Some(3600), None)
        };
        let text = "videotestsrc num-buffers=60 ! video/x-raw,width=64,height=48,framerate=10/1 \
                    ! x264enc tune=zerolatency key-int-max=10 ! h264parse ! splitmuxsink name=recording muxer-factory=matroskamux";
        let pipeline = gst::parse::launch(text).unwrap().downcast::<gst::Pipeline>().unwrap();
        const BEGIN_MS: i64 = 1_767_225_600_000;
        let first = Mutex::new(None);
        let came_ms = move |pts: gst::ClockTime| {
            let pts = i64::try_from(pts.mseconds()).ok()?;
            // Encoders count from a time of their own.
            Some(BEGIN_MS + pts - *lock(&first).get_or_insert(pts))
        };
        configure(&pipeline, &recording, "door", &Arc::default(), came_ms);
        pipeline.set_state(gst::State::Playing).unwrap();
        let kinds = [gst::MessageType::Eos, gst::MessageType::Error];
        let end =
            pipeline.bus().unwrap().timed_pop_filtered(gst::ClockTime::from_seconds(60), &kinds).unwrap();
        pipeline.set_state(gst::State::Null).unwrap();
        let mut began: Vec<_> =
            files(&folder, "door").into_iter().map(|file| file.began_ms - BEGIN_MS).collect();
        began.sort_unstable();
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(end.type_(), gst::MessageType::Eos);
        assert_eq!(began, [0, 2000, 4000]);
    }

    /// Noise, as it is large; all of it within a segment.
    #[test]
    fn a_stream_that_is_too_large_for_a_file_goes_on_in_others() {
        gst::init().unwrap();
        let folder = std::env::temp_dir().join(format!("ptztrack-large-{}", std::process::id()));
        let recording = Recording { folder: folder.clone(), ..recording(None, Some(KEPT_FILES * 1_000_000)) };
        let text = "videotestsrc num-buffers=50 pattern=snow ! video/x-raw,width=320,height=240 ! jpegenc \
                    ! splitmuxsink name=recording muxer-factory=matroskamux";
        let pipeline = gst::parse::launch(text).unwrap().downcast::<gst::Pipeline>().unwrap();
        configure(&pipeline, &recording, "door", &Arc::default(), |_| None);
        pipeline.set_state(gst::State::Playing).unwrap();
        let kinds = [gst::MessageType::Eos, gst::MessageType::Error];
        let end =
            pipeline.bus().unwrap().timed_pop_filtered(gst::ClockTime::from_seconds(60), &kinds).unwrap();
        pipeline.set_state(gst::State::Null).unwrap();
        let found = files(&folder, "door");
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(end.type_(), gst::MessageType::Eos);
        assert!(found.len() > 1, "{found:?}");
        assert!(found.iter().all(|file| file.bytes < 1_100_000), "{found:?}");
    }

    #[test]
    fn only_files_of_this_camera_are_looked_at() {
        let folder = std::env::temp_dir().join(format!("ptztrack-files-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let recordings = ["door-20260101T000000000.mkv", "door-2-20260101T000000000.mkv"];
        // Clips that somebody keeps there, among others.
        let others =
            ["door-17.mkv", "door-21.mkv", "door-20260101T000000000-17.mkv", "door.mkv", "notes.txt"];
        for name in recordings.iter().chain(&others) {
            fs::write(folder.join(name), "x").unwrap();
        }
        let found = files(&folder, "door");
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].path.ends_with("door-20260101T000000000.mkv"));
    }

    #[test]
    fn a_clip_goes_on_in_the_files_that_began_before_its_end() {
        let folder = std::env::temp_dir().join(format!("ptztrack-pieces-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let file = |name: &str| folder.join(format!("{name}.mkv"));
        let [first, second] = ["door-20260101T000000000", "door-20260101T001000250"].map(file);
        let others = ["door-20260101T002000000", "door-20251231T235000000", "yard-20260101T001000000"];
        for file in others.map(file).iter().chain([&first, &second]) {
            fs::write(file, "").unwrap();
        }
        let of = |offset_ms, lasts_ms| {
            let pieces = pieces(&Pointer { file: first.clone(), offset_ms }, lasts_ms);
            let time = |time: gst::ClockTime| time.mseconds();
            let parts = pieces.into_iter().map(|p| (p.file, time(p.from), time(p.lasts), time(p.at)));
            parts.collect::<Vec<_>>()
        };
        let found = [of(1000, 5000), of(590_250, 30_000), of(610_250, 5000)];
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found[0], [(first.clone(), 1000, 5000, 0)]);
        assert_eq!(found[1], [(first.clone(), 590_250, 30_000, 0), (second.clone(), 0, 20_000, 10_000)]);
        // Which was opened after they had gone.
        assert_eq!(found[2], [(second, 10_000, 5000, 0)]);
    }
}
