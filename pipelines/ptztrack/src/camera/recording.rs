// SPDX-License-Identifier: MPL-2.0

//! What is recorded, and how long it is kept.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use gst::prelude::*;

use crate::config::{Codec, Recording};

/// The overlay, encoded.
pub const ENCODED: &str = "x264enc tune=zerolatency speed-preset=superfast key-int-max=30 ! h264parse ! \
    splitmuxsink name=recording muxer-factory=matroskamux";

/// Takes the camera's own stream.
pub fn branch(codec: Codec) -> String {
    let parser = match codec {
        Codec::Mjpeg => "jpegparse",
        Codec::Mpeg4 => "mpeg4videoparse",
        Codec::H264 => "h264parse",
    };
    format!("{parser} ! splitmuxsink name=recording muxer-factory=matroskamux")
}

/// Names the files by the time at which they begin, and deletes old ones whenever another begins.
pub fn configure(pipeline: &gst::Pipeline, recording: &Recording, camera: &str) {
    let Some(sink) = pipeline.by_name("recording") else { return };
    sink.set_property("max-size-time", u64::try_from(recording.segment.as_nanos()).unwrap_or(u64::MAX));
    let (recording, camera) = (recording.clone(), camera.to_owned());
    sink.connect("format-location", false, move |_| {
        // Where a folder cannot be written, the element says so.
        let _ = fs::create_dir_all(&recording.folder);
        delete_old(&recording, &camera);
        let now = glib::DateTime::now_utc().and_then(|now| now.format("%Y%m%dT%H%M%S%f"));
        // To the millisecond: a pipeline that is started anew must not write over what it recorded just before.
        let now = now.map(|now| now.chars().take(18).collect::<String>()).unwrap_or_default();
        Some(recording.folder.join(format!("{camera}-{now}.mkv")).to_value())
    });
}

/// One file of a recording.
#[derive(Debug)]
struct Kept {
    path: PathBuf,
    bytes: u64,
    age: Duration,
}

/// A file that cannot be deleted is tried again when the next begins.
fn delete_old(recording: &Recording, camera: &str) {
    for file in too_much(files(&recording.folder, camera), recording.keep, recording.keep_bytes) {
        let _ = fs::remove_file(file);
    }
}

/// The files of this camera.
fn files(folder: &Path, camera: &str) -> Vec<Kept> {
    let now = SystemTime::now();
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let kept = |entry: fs::DirEntry| {
        let name = entry.file_name().into_string().ok()?;
        let time = name.strip_prefix(camera)?.strip_prefix('-')?.strip_suffix(".mkv")?;
        // Not those of a camera called door-2.
        time.starts_with(|c: char| c.is_ascii_digit()).then_some(())?;
        (!time.contains('-')).then_some(())?;
        let meta = entry.metadata().ok()?;
        let age = now.duration_since(meta.modified().ok()?).unwrap_or_default();
        Some(Kept { path: entry.path(), bytes: meta.len(), age })
    };
    entries.filter_map(kept).collect()
}

/// What is older than is kept, and the oldest of what is more.
fn too_much(mut files: Vec<Kept>, keep: Option<Duration>, keep_bytes: Option<u64>) -> Vec<PathBuf> {
    files.sort_by_key(|file| file.age);
    let mut sum = 0;
    let mut goes = |file: &Kept| {
        sum += file.bytes;
        keep.is_some_and(|keep| file.age > keep) || keep_bytes.is_some_and(|most| sum > most)
    };
    files.into_iter().filter(|file| goes(file)).map(|file| file.path).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(path: &str, bytes: u64, age_s: u64) -> Kept {
        Kept { path: path.into(), bytes, age: Duration::from_secs(age_s) }
    }

    #[test]
    fn the_oldest_go_where_there_is_too_much() {
        let files = || vec![kept("new", 40, 1), kept("oldest", 30, 300), kept("old", 50, 200)];
        let names =
            |paths: Vec<PathBuf>| paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>();
        assert_eq!(names(too_much(files(), None, Some(100))), ["oldest"]);
        assert_eq!(names(too_much(files(), Some(Duration::from_secs(100)), None)), ["old", "oldest"]);
        assert!(too_much(files(), Some(Duration::from_secs(1000)), Some(1000)).is_empty());
    }

    #[test]
    fn only_files_of_this_camera_are_looked_at() {
        let folder = std::env::temp_dir().join(format!("ptztrack-files-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        for name in ["door-20260101T000000000.mkv", "door-2-20260101T000000000.mkv", "door.mkv", "notes.txt"]
        {
            fs::write(folder.join(name), "x").unwrap();
        }
        let found = files(&folder, "door");
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].path.ends_with("door-20260101T000000000.mkv"));
    }
}
