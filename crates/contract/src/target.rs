// SPDX-License-Identifier: MPL-2.0

use crate::named::named_enum;

/// `roi-type` of the standard region-of-interest meta that marks the target.
pub const TARGET_ROI: &str = "target";

named_enum! {
    /// What the tracker is doing.
    TargetState {
        /// No target; detections are awaited.
        Searching = "searching",
        /// The target is seen and followed.
        Tracking = "tracking",
        /// The target is hidden; its place is predicted and it is looked for there.
        Occluded = "occluded",
        /// The target was given up in this frame; searching follows.
        Lost = "lost",
    }
}
