// SPDX-License-Identifier: MPL-2.0

//! Who has which camera, kept for after a restart, a crash or an upgrade: in `control.json` of the folder that systemd calls
//! `STATE_DIRECTORY`, or, as processes that share the cameras may share the folder, in `control.0-of-2.json` of share `0/2`. Without
//! such a folder it is kept for as long as the program runs.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::{fs, io};

use ptztrack_contract::lock::lock;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::camera::Control;
use crate::log::Log;
use crate::shard::Shard;

const KIND: &str = "control";

const NO_FOLDER: &str = "STATE_DIRECTORY names no folder to keep it in";

/// By the names of the cameras; who is not in it has nothing to be kept.
pub type Kept = BTreeMap<String, Control>;

/// So many cameras are remembered that are gone from the configuration.
const MOST_GONE: usize = 1024;

#[derive(Debug)]
pub struct ControlFile {
    path: Option<PathBuf>,
    log: Arc<Log>,
    /// Who had which camera last, those that are gone from the configuration, too; `None` until it was read.
    had: Mutex<Option<Kept>>,
    /// Held while it is written, which a disk may delay for ever.
    last: Mutex<Last<Kept>>,
}

/// What was done last with a file.
#[derive(Debug, Default)]
pub struct Last<T> {
    /// As it was written.
    kept: Option<T>,
    /// It could not be written.
    failed: bool,
}

impl<T: Serialize + PartialEq> Last<T> {
    /// Writes what is to be kept, if it is not what is kept already.
    ///
    /// # Errors
    /// Why it cannot be written: said once, and tried again every time.
    pub fn write(&mut self, path: &Path, what: T) -> io::Result<()> {
        if self.kept.as_ref() == Some(&what) {
            return Ok(());
        }
        let written = write(path, &what);
        let has_failed = std::mem::replace(&mut self.failed, written.is_err());
        if written.is_ok() {
            self.kept = Some(what);
        }
        if has_failed { Ok(()) } else { written }
    }
}

impl ControlFile {
    /// Of a process that has this share of the cameras, or all of them; in this folder, if any.
    pub fn at(folder: Option<&Path>, shard: Option<Shard>, log: Arc<Log>) -> Self {
        let path = folder.map(|folder| path(folder, KIND, shard));
        Self { path, log, had: Mutex::default(), last: Mutex::default() }
    }

    /// Who had which camera last: at first by what was kept. Nobody, where there is no such file or something else is in it.
    pub fn load(&self) -> Kept {
        let mut had = lock(&self.had);
        if let Some(had) = &*had {
            return had.clone();
        }
        let Some(path) = &self.path else { return Kept::new() };
        match self.read(path) {
            // A share that has kept nothing yet begins with what was kept for all, unless there were other shares since: that is
            // old then. The cameras of other shares are theirs to remember.
            Err(err) if err.kind() == io::ErrorKind::NotFound && !has_others(path) => {
                *had = Some(Kept::new());
                let of_all = path.with_file_name(format!("{KIND}.json"));
                self.read(&of_all).unwrap_or_default()
            }
            kept => had.insert(kept.unwrap_or_default()).clone(),
        }
    }

    fn read(&self, path: &Path) -> io::Result<Kept> {
        read(path, "who had which camera", "control-not-read", &self.log)
    }

    /// Remembers who has these cameras, which may be gone from now on.
    pub fn remember(&self, control: Kept) {
        self.load();
        lock(&self.had).get_or_insert_default().extend(control);
    }

    /// Keeps who has all the cameras that are there, if it is not what is kept already; nothing, where nobody says that any more.
    /// A file that is broken off halfway never takes the place of the last one.
    ///
    /// # Errors
    /// Why it cannot be written: said once, and tried again every time. That there is no folder, once a camera is handed over.
    pub fn keep(&self, control: impl FnOnce() -> Option<Kept>) -> io::Result<()> {
        let mut last = lock(&self.last);
        // What is asked for later is written later.
        let Some(control) = control() else { return Ok(()) };
        // It is read before it is written over.
        self.load();
        let mut had = lock(&self.had);
        let control = with(had.take().unwrap_or_default(), control);
        *had = Some(control.clone());
        drop(had);
        let Some(path) = &self.path else {
            let is_handed_over = control.values().any(|control| *control == Control::HandedOver);
            // As after a failure, it is said once.
            let is_new = is_handed_over && !std::mem::replace(&mut last.failed, true);
            return if is_new { Err(io::Error::other(NO_FOLDER)) } else { Ok(()) };
        };
        last.write(path, control)
    }
}

/// What is to be kept. Whoever was given a camera that is gone from the configuration has it when it comes back; an operator has let
/// go of it by then.
fn with(had: Kept, control: Kept) -> Kept {
    let is_gone =
        |(name, had): &(String, Control)| *had == Control::HandedOver && !control.contains_key(name);
    let mut kept: Kept = had.into_iter().filter(is_gone).take(MOST_GONE).collect();
    kept.extend(control.into_iter().filter(|(_, control)| *control != Control::Ours));
    kept
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

/// The folder that systemd has for what outlives the program.
pub fn state_folder() -> Option<PathBuf> {
    std::env::var_os("STATE_DIRECTORY").map(PathBuf::from)
}

/// Where a process that has this share of the cameras, or all of them, keeps what is of this kind.
pub fn path(folder: &Path, kind: &str, shard: Option<Shard>) -> PathBuf {
    let of = |shard: Shard| format!("{kind}.{}-of-{}.json", shard.number(), shard.of());
    folder.join(shard.map_or_else(|| format!("{kind}.json"), of))
}

/// What was kept. A file that makes no sense or cannot be read is moved aside, so that it is not written over, and said in an event.
///
/// # Errors
/// Where there is no such file, or why it cannot be read.
pub fn read<T: DeserializeOwned>(path: &Path, what: &str, event: &str, log: &Log) -> io::Result<T> {
    let read = fs::read(path).and_then(|text| Ok(serde_json::from_slice(&text)?));
    if let Err(err) = &read
        && err.kind() != io::ErrorKind::NotFound
    {
        let aside = path.with_extension("json.aside");
        // Where that fails, it is written over.
        let _ = fs::rename(path, &aside);
        let detail =
            format!("{what} is not known: {}: {err}; it is kept as {}", path.display(), aside.display());
        log.error(event, detail);
    }
    read
}

/// The new file is named after the share, too. It is on the disk before it has the last one's name: that could stand for an empty
/// file after a power cut.
///
/// # Errors
/// Why it cannot be written; the last one is still there.
fn write(path: &Path, what: &impl Serialize) -> io::Result<()> {
    let new = path.with_extension("new");
    let mut file = File::create(&new)?;
    file.write_all(&serde_json::to_vec(what)?)?;
    file.sync_all()?;
    fs::rename(new, path)?;
    if let Some(folder) = path.parent() {
        // Not every file system does that for a folder; the file is there.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const OF_ALL: &str = "control.json";

    fn scratch(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("ptztrack-control-{name}-{}", std::process::id()))
    }

    fn file(folder: &Path) -> ControlFile {
        ControlFile::at(Some(folder), None, Arc::new(Log::unwritten()))
    }

    fn kept(control: &[(&str, Control)]) -> Kept {
        control.iter().map(|&(name, control)| (name.to_owned(), control)).collect()
    }

    #[test]
    fn what_is_kept_is_there_after_a_restart() {
        let folder = scratch("restart");
        fs::create_dir_all(&folder).unwrap();
        assert!(file(&folder).load().is_empty());
        let control = [("door", Control::HandedOver), ("hall", Control::Operator), ("yard", Control::Ours)];
        file(&folder).keep(|| Some(kept(&control))).unwrap();
        assert_eq!(file(&folder).load(), kept(&control[..2]));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_that_is_broken_is_told_of_and_moved_aside_before_another_takes_its_place() {
        let folder = scratch("broken");
        fs::create_dir_all(&folder).unwrap();
        for broken in ["{", ""] {
            fs::write(folder.join(OF_ALL), broken).unwrap();
            let file = file(&folder);
            let mut told = file.log.subscribe();
            file.keep(|| Some(Kept::new())).unwrap();
            assert_eq!(told.try_recv().unwrap().event, "control-not-read");
            assert_eq!(fs::read_to_string(folder.join("control.json.aside")).unwrap(), broken);
            assert_eq!(fs::read_to_string(folder.join(OF_ALL)).unwrap(), "{}");
        }
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn whoever_was_given_a_camera_that_is_gone_from_the_configuration_has_it_when_it_comes_back() {
        let folder = scratch("gone");
        fs::create_dir_all(&folder).unwrap();
        let control = kept(&[("door", Control::HandedOver), ("hall", Control::Operator)]);
        file(&folder).keep(|| Some(control.clone())).unwrap();
        let after = file(&folder);
        after.keep(|| Some(kept(&[("yard", Control::HandedOver)]))).unwrap();
        let both = kept(&[("door", Control::HandedOver), ("yard", Control::HandedOver)]);
        assert_eq!((after.load(), file(&folder).load()), (both.clone(), both), "no operator stays for ever");
        after.keep(|| Some(kept(&[("door", Control::Ours)]))).unwrap();
        assert_eq!(file(&folder).load(), kept(&[("yard", Control::HandedOver)]), "it was taken back");
        fs::remove_dir_all(&folder).unwrap();

        let without = ControlFile::at(None, None, Arc::new(Log::unwritten()));
        without.remember(control);
        assert_eq!(without.keep(|| Some(Kept::new())).unwrap_err().to_string(), NO_FOLDER);
        assert_eq!(without.load(), kept(&[("door", Control::HandedOver)]), "while the program runs");
    }

    #[test]
    fn no_more_cameras_that_are_gone_are_remembered_than_a_configuration_may_have() {
        let file = ControlFile::at(None, None, Arc::new(Log::unwritten()));
        file.remember((0..2 * MOST_GONE).map(|n| (n.to_string(), Control::HandedOver)).collect());
        assert!(file.keep(|| Some(Kept::new())).is_err(), "there is no folder");
        assert_eq!(file.load().len(), MOST_GONE);
    }

    #[test]
    fn processes_that_share_cameras_and_folder_keep_their_own_each() {
        let folder = scratch("shards");
        fs::create_dir_all(&folder).unwrap();
        let of = |shard: Option<&str>| {
            let shard = shard.map(|shard| shard.parse().unwrap());
            ControlFile::at(Some(&folder), shard, Arc::new(Log::unwritten()))
        };
        let kept = |camera: &str| kept(&[(camera, Control::HandedOver)]);
        let files = [(None, "hall"), (Some("0/2"), "door"), (Some("1/2"), "yard")];
        of(None).keep(|| Some(kept("hall"))).unwrap();
        assert_eq!(of(Some("0/2")).load(), kept("hall"), "what was kept before there were shares");
        for (shard, camera) in files {
            of(shard).keep(|| Some(kept(camera))).unwrap();
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
        let file = ControlFile::at(None, None, Arc::default());
        let keep = |control| file.keep(|| Some(kept(&[("door", control)]))).map_err(|err| err.to_string());
        let kept = [Control::Ours, Control::Operator, Control::HandedOver, Control::HandedOver].map(keep);
        assert_eq!(kept, [Ok(()), Ok(()), Err(NO_FOLDER.to_owned()), Ok(())]);
    }

    /// As on a disk that is full for a while.
    #[test]
    fn what_could_not_be_kept_is_kept_once_it_can() {
        let folder = scratch("later");
        let control = || Some(kept(&[("door", Control::HandedOver)]));
        let before = file(&folder);
        assert!(before.keep(control).is_err());
        assert!(before.keep(control).is_ok(), "said once");
        fs::create_dir_all(&folder).unwrap();
        before.keep(control).unwrap();
        assert_eq!(Some(file(&folder).load()), control());
        fs::remove_dir_all(&folder).unwrap();
    }
}
