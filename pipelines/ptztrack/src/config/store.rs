// SPDX-License-Identifier: MPL-2.0

use std::path::PathBuf;
use std::time::Duration;

use events::Retention;
use serde::{Deserialize, Serialize};

use super::table::{Read, Table};
use super::units;

/// What is kept of those who were followed, where, and for how long.
#[derive(Debug, Clone, PartialEq)]
pub struct Store {
    /// `None`: nothing.
    pub what: Option<Kept>,
    /// Else the folder of state.
    pub folder: Option<PathBuf>,
    pub retention: Retention,
}

/// What is kept of somebody.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Kept {
    pub pictures: bool,
    /// Nobody's face is known by them.
    pub pixelate: bool,
}

/// The values of `store`.
enum What {
    Off,
    Events,
    Pictures,
}

impl Read for What {
    const WHAT: &'static str = "\"off\", \"events\" or \"pictures\"";

    fn read(value: &toml::de::DeValue) -> Option<Self> {
        match value.as_str()? {
            "off" => Some(Self::Off),
            "events" => Some(Self::Events),
            "pictures" => Some(Self::Pictures),
            _ => None,
        }
    }
}

impl Default for Store {
    fn default() -> Self {
        Self {
            what: Some(Kept { pictures: true, pixelate: false }),
            folder: None,
            retention: Retention { age: Duration::from_secs(30 * 24 * 3600), bytes: 1_000_000_000 },
        }
    }
}

impl Store {
    pub(super) fn read(mut table: Table) -> Self {
        let default = Self::default();
        let what = table.get("store").unwrap_or(What::Pictures);
        let pixelate = table.get("pixelate-faces").unwrap_or(false);
        let kept = match what {
            What::Off => None,
            What::Events => Some(Kept { pictures: false, pixelate }),
            What::Pictures => Some(Kept { pictures: true, pixelate }),
        };
        let folder = table.get::<String>("folder").map(PathBuf::from);
        let age = table.get("keep").unwrap_or(default.retention.age);
        let bytes = table.get_with("keep-bytes", units::BYTES, |value| units::bytes(value.as_str()?));
        table.no_more();
        let bytes = bytes.unwrap_or(default.retention.bytes);
        Self { what: kept, folder, retention: Retention { age, bytes } }
    }
}
