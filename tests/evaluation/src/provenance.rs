// SPDX-License-Identifier: MPL-2.0

//! What a result was made with: results of another servo or another laboratory do not belong into the same table.

use serde::{Deserialize, Serialize};

use crate::record::TrackerName;

/// Each part by a hash of its sources or by its version: two that are equal are the same.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Provenance {
    /// What follows the person.
    pub tracker: String,
    /// What moves the camera.
    pub servo: String,
    /// What shows the pictures and writes down what happens.
    pub laboratory: String,
}

impl Provenance {
    /// Of a tracker as built and installed here.
    pub fn of(tracker: TrackerName) -> Self {
        let opencv = opencv::core::get_version_string().unwrap_or_default();
        let libraries = format!("{}, OpenCV {opencv}", gst::version_string());
        let tracker = match tracker {
            TrackerName::Ptztrack | TrackerName::Thesis => env!("TRACKER_SOURCES").to_owned(),
            // Their code is in the libraries, or in the laboratory.
            _ => libraries.clone(),
        };
        Self {
            tracker,
            servo: env!("SERVO_SOURCES").to_owned(),
            laboratory: format!("{}, {libraries}", env!("LABORATORY_SOURCES")),
        }
    }

    /// Whether results of both may stand in one table.
    pub fn is_comparable(&self, other: &Self) -> bool {
        (&self.servo, &self.laboratory) == (&other.servo, &other.laboratory)
    }
}
