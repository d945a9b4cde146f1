// SPDX-License-Identifier: MPL-2.0

//! What was learned, kept for after a restart in the folder that systemd calls `STATE_DIRECTORY`.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::{fs, io};

use handover::Map;

use crate::log::Log;

/// A file for each two cameras.
pub struct Maps {
    folder: Option<PathBuf>,
    log: Arc<Log>,
    warned: AtomicBool,
}

impl Maps {
    pub fn new(log: Arc<Log>) -> Self {
        let folder = std::env::var_os("STATE_DIRECTORY").map(PathBuf::from);
        Self { folder, log, warned: AtomicBool::new(false) }
    }

    fn path(&self, from: &str, to: &str) -> Option<PathBuf> {
        // Names of cameras have no dot.
        Some(self.folder.as_ref()?.join(format!("map.{from}.{to}.json")))
    }

    /// What was kept; nothing, where there is no such file. One that cannot be read is moved aside.
    pub fn load(&self, from: &str, to: &str) -> Map {
        let Some(path) = self.path(from, to) else { return Map::default() };
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(err) if err.kind() == ErrorKind::NotFound => return Map::default(),
            Err(err) => {
                self.warn(&format!("{} cannot be read: {err}", path.display()));
                return Map::default();
            }
        };
        Map::from_json(&text).unwrap_or_else(|err| {
            let aside = path.with_extension("json.aside");
            self.warn(&format!("{}: {err}; it is kept as {}", path.display(), aside.display()));
            // Where that fails, it is written over.
            let _ = fs::rename(&path, aside);
            Map::default()
        })
    }

    /// A file that is broken off halfway never takes the place of the last one.
    pub fn keep(&self, from: &str, to: &str, map: &Map) {
        let Some(path) = self.path(from, to) else { return };
        // Processes that share the cameras may share the folder.
        let new = path.with_extension(format!("{}.new", std::process::id()));
        let written: io::Result<()> = fs::write(&new, map.to_json()).and_then(|()| fs::rename(&new, &path));
        if let Err(err) = written
            && !self.warned.swap(true, Ordering::Relaxed)
        {
            self.warn(&format!(
                "{} cannot be written: {err}; it is learned anew after a restart",
                path.display()
            ));
        }
    }

    fn warn(&self, text: &str) {
        self.log.error("map-not-kept", text.to_owned());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use handover::{Direction, Pair, Place};

    #[test]
    fn a_map_is_there_after_a_restart_and_one_of_another_version_is_moved_aside() {
        let folder = std::env::temp_dir().join(format!("ptztrack-maps-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let maps = Maps {
            folder: Some(folder.clone()),
            log: Arc::new(Log::unwritten()),
            warned: AtomicBool::new(false),
        };
        let mut map = Map::default();
        map.learn(Pair {
            place: Place::in_picture(0.5, 0.5),
            direction: Direction::default(),
            height_deg: None,
            person: 1,
        });
        maps.keep("yard", "door", &map);
        assert_eq!((maps.load("yard", "door").len(), maps.load("door", "yard").len()), (1, 0));
        let file = folder.join("map.yard.door.json");
        fs::write(&file, "{\"version\":77}").unwrap();
        assert!(maps.load("yard", "door").is_empty());
        assert!(!file.exists() && folder.join("map.yard.door.json.aside").exists());
        fs::remove_dir_all(&folder).unwrap();
    }
}
