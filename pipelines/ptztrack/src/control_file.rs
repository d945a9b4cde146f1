// SPDX-License-Identifier: MPL-2.0

//! Who has which camera, kept for after a restart, a crash or an upgrade: in `control.json` of the folder that systemd calls
//! `STATE_DIRECTORY`, or, as processes that share the cameras may share the folder, in `control.0-of-2.json` of share `0/2`. Without
//! such a folder it is kept for as long as the program runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::{fs, io};

use ptztrack_contract::lock::lock;

use crate::camera::Control;
use crate::shard::Shard;

/// Of a process that has all cameras.
const OF_ALL: &str = "control.json";

const NO_FOLDER: &str = "STATE_DIRECTORY names no folder to keep it in";

/// By the names of the cameras; who is not in it has nothing to be kept.
type Kept = BTreeMap<String, Control>;

#[derive(Debug)]
pub struct ControlFile {
    path: Option<PathBuf>,
    last: Mutex<Last>,
}

/// What was done last.
#[derive(Debug, Default)]
struct Last {
    /// As it was written.
    kept: Option<Kept>,
    /// It could not be written.
    failed: bool,
}

impl ControlFile {
    /// Of a process that has this share of the cameras, or all of them.
    pub fn new(shard: Option<Shard>) -> Self {
        Self::at(std::env::var_os("STATE_DIRECTORY").map(PathBuf::from), shard)
    }

    fn at(folder: Option<PathBuf>, shard: Option<Shard>) -> Self {
        let of = |shard: Shard| format!("control.{}-of-{}.json", shard.number(), shard.of());
        let name = shard.map_or_else(|| OF_ALL.to_owned(), of);
        Self { path: folder.map(|folder| folder.join(name)), last: Mutex::default() }
    }

    /// What was kept. Nothing, where there is no such file or something else is in it.
    pub fn load(&self) -> Kept {
        let text = self.path.as_ref().and_then(|path| read(path).ok());
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// Keeps this, if it is not what is kept already. A file that is broken off halfway never takes the place of the last one.
    ///
    /// # Errors
    /// Why it cannot be written: said once, and tried again every time. That there is no folder, once a camera is handed over.
    pub fn keep(&self, mut control: Kept) -> io::Result<()> {
        control.retain(|_, control| *control != Control::Ours);
        let mut last = lock(&self.last);
        let Some(path) = &self.path else {
            let is_handed_over = control.values().any(|control| *control == Control::HandedOver);
            // As after a failure, it is said once.
            let is_new = is_handed_over && !std::mem::replace(&mut last.failed, true);
            return if is_new { Err(io::Error::other(NO_FOLDER)) } else { Ok(()) };
        };
        if last.kept.as_ref() == Some(&control) {
            return Ok(());
        }
        let written = write(path, &control);
        let has_failed = std::mem::replace(&mut last.failed, written.is_err());
        if written.is_ok() {
            last.kept = Some(control);
        }
        if has_failed { Ok(()) } else { written }
    }
}

/// A share that has kept nothing yet begins with what was kept for all, unless there were other shares since: that is old then.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    match fs::read(path) {
        Err(err) if err.kind() == io::ErrorKind::NotFound && !has_others(path) => {
            fs::read(path.with_file_name(OF_ALL))
        }
        found => found,
    }
}

/// Whether shares of another number have kept something there.
fn has_others(path: &Path) -> bool {
    let number = |path: &Path| Some(path.file_name()?.to_str()?.split_once("-of-")?.1.to_owned());
    let files = path.parent().and_then(|folder| fs::read_dir(folder).ok());
    let mut names = files.into_iter().flatten().flatten().map(|entry| entry.path());
    names.any(|other| {
        let is_share = other.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"control."));
        is_share && number(&other).is_some_and(|of| of.ends_with(".json") && Some(of) != number(path))
    })
}

/// The new file is named after the share, too.
fn write(path: &Path, control: &Kept) -> io::Result<()> {
    let new = path.with_extension("new");
    fs::write(&new, serde_json::to_vec(control)?)?;
    fs::rename(new, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_there_after_a_restart_and_nonsense_is_nothing() {
        let folder = std::env::temp_dir().join(format!("ptztrack-control-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let file = || ControlFile { path: Some(folder.join("control.json")), last: Mutex::default() };
        assert!(file().load().is_empty());
        let control = [("door", Control::HandedOver), ("hall", Control::Operator), ("yard", Control::Ours)];
        file().keep(control.map(|(name, control)| (name.to_owned(), control)).into()).unwrap();
        let kept = file().load();
        assert_eq!((kept.len(), kept["door"], kept["hall"]), (2, Control::HandedOver, Control::Operator));
        fs::write(folder.join("control.json"), "{").unwrap();
        assert!(file().load().is_empty());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn processes_that_share_cameras_and_folder_keep_their_own_each() {
        let folder = std::env::temp_dir().join(format!("ptztrack-control-shards-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let of =
            |shard: Option<&str>| ControlFile::at(Some(folder.clone()), shard.map(|s| s.parse().unwrap()));
        let kept = |camera: &str| Kept::from([(camera.to_owned(), Control::HandedOver)]);
        let files = [(None, "hall"), (Some("0/2"), "door"), (Some("1/2"), "yard")];
        of(None).keep(kept("hall")).unwrap();
        assert_eq!(of(Some("0/2")).load(), kept("hall"), "what was kept before there were shares");
        for (shard, camera) in files {
            of(shard).keep(kept(camera)).unwrap();
        }
        for (shard, camera) in files {
            assert_eq!(of(shard).load(), kept(camera), "{shard:?}");
        }
        assert!(of(Some("0/3")).load().is_empty(), "what was kept for all is older than two shares");
        let names = ["control.json", "control.0-of-2.json", "control.1-of-2.json"];
        assert!(names.iter().all(|name| folder.join(name).exists()));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn that_there_is_no_folder_is_said_once_when_a_camera_is_handed_over() {
        let file = ControlFile::at(None, None);
        let keep =
            |control| file.keep(Kept::from([("door".to_owned(), control)])).map_err(|err| err.to_string());
        let kept = [Control::Ours, Control::Operator, Control::HandedOver, Control::HandedOver].map(keep);
        assert_eq!(kept, [Ok(()), Ok(()), Err(NO_FOLDER.to_owned()), Ok(())]);
    }

    /// As on a disk that is full for a while.
    #[test]
    fn what_could_not_be_kept_is_kept_once_it_can() {
        let folder = std::env::temp_dir().join(format!("ptztrack-control-later-{}", std::process::id()));
        let file = ControlFile { path: Some(folder.join("control.json")), last: Mutex::default() };
        let control = || Kept::from([("door".to_owned(), Control::HandedOver)]);
        assert!(file.keep(control()).is_err());
        assert!(file.keep(control()).is_ok(), "said once");
        fs::create_dir_all(&folder).unwrap();
        file.keep(control()).unwrap();
        assert_eq!(file.load(), control());
        fs::remove_dir_all(&folder).unwrap();
    }
}
