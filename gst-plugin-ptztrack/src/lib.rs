// SPDX-License-Identifier: MPL-2.0

//! GStreamer elements that find a moving person and follow their features on a plain CPU.
//!
//! * [`bgavgdetect`]: finds what moves (thesis 3.2 to 3.4),
//! * [`lkfeaturetrack`]: follows the features of one target (thesis 3.5),
//! * [`ptzoverlay`]: draws what both saw.
//!
//! The algorithms live in [`vision`], without a GStreamer type in sight.

mod allocation;
#[cfg(feature = "analytics")]
mod analytics;
pub mod bgavgdetect;
mod duration;
mod frame;
pub mod lkfeaturetrack;
use ptztrack_contract::lock;
pub mod luma_source;
mod pad_templates;
pub mod ptzoverlay;
mod region_of_interest;
mod unseen;
pub mod vision;

/// What GStreamer asks of a plugin; private, as nobody calls it from Rust.
mod plugin {
    fn plugin_init(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
        crate::bgavgdetect::register(plugin)?;
        crate::lkfeaturetrack::register(plugin)?;
        crate::ptzoverlay::register(plugin)
    }

    gst::plugin_define!(
        ptztrack,
        env!("CARGO_PKG_DESCRIPTION"),
        plugin_init,
        concat!(env!("CARGO_PKG_VERSION"), "-", env!("COMMIT_ID")),
        "MPL-2.0",
        env!("CARGO_PKG_NAME"),
        env!("CARGO_PKG_NAME"),
        env!("CARGO_PKG_REPOSITORY"),
        env!("BUILD_REL_DATE")
    );
}

/// Registers the elements with an application that links this crate instead of loading the plugin.
pub fn plugin_register_static() -> Result<(), glib::BoolError> {
    plugin::plugin_register_static()
}
