// SPDX-License-Identifier: MPL-2.0

//! The pads that all elements of this plugin have.

/// One pad in and one out, always there, both of these caps.
pub(crate) fn in_and_out(caps: &gst::Caps) -> Vec<gst::PadTemplate> {
    [("sink", gst::PadDirection::Sink), ("src", gst::PadDirection::Src)]
        .into_iter()
        .filter_map(|(name, direction)| {
            gst::PadTemplate::new(name, direction, gst::PadPresence::Always, caps).ok()
        })
        .collect()
}
