// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// What a sink says of itself in its property `stats`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ServoStats {
    /// Of the camera.
    pub state: Option<String>,
    /// Counters, and times in nanoseconds, by their names.
    pub numbers: BTreeMap<String, u64>,
}

impl From<&gst::StructureRef> for ServoStats {
    fn from(stats: &gst::StructureRef) -> Self {
        let number =
            |(name, value): (&glib::GStr, &glib::SendValue)| Some((name.to_string(), value.get().ok()?));
        Self { state: stats.get("state").ok(), numbers: stats.iter().filter_map(number).collect() }
    }
}
