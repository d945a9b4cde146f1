// SPDX-License-Identifier: MPL-2.0

//! Who has which camera, kept for after a restart, a crash or an upgrade: in `control.json` of the folder that systemd calls
//! `STATE_DIRECTORY`. Without such a folder it is kept for as long as the program runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::{fs, io};

use ptztrack_contract::lock::lock;

use crate::camera::Control;

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
    pub fn new() -> Self {
        let folder = std::env::var_os("STATE_DIRECTORY");
        Self { path: folder.map(|folder| PathBuf::from(folder).join("control.json")), last: Mutex::default() }
    }

    /// What was kept. Nothing, where there is no such file or something else is in it.
    pub fn load(&self) -> Kept {
        let text = self.path.as_ref().and_then(|path| fs::read(path).ok());
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// Keeps this, if it is not what is kept already. A file that is broken off halfway never takes the place of the last one.
    ///
    /// # Errors
    /// Why it cannot be written: said once, and tried again every time.
    pub fn keep(&self, mut control: Kept) -> io::Result<()> {
        control.retain(|_, control| *control != Control::Ours);
        let mut last = lock(&self.last);
        let Some(path) = self.path.as_ref().filter(|_| last.kept.as_ref() != Some(&control)) else {
            return Ok(());
        };
        let written = write(path, &control);
        let has_failed = std::mem::replace(&mut last.failed, written.is_err());
        if written.is_ok() {
            last.kept = Some(control);
        }
        if has_failed { Ok(()) } else { written }
    }
}

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
