// SPDX-License-Identifier: MPL-2.0

//! GStreamer sink that steers an Axis pan-tilt-zoom camera after the tracked target.
//!
//! [`vapixptzsink`] is the element (thesis 3.6). What it computes is in the crate `ptztrack-servo`, what it says to the
//! camera in [`session`] and [`vapix`]; [`sink`] is what it has in common with sinks of other protocols.

pub mod vapixptzsink;

/// What GStreamer asks of a plugin; private, as nobody calls it from Rust.
mod plugin {
    fn plugin_init(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
        crate::vapixptzsink::register(plugin)
    }

    gst::plugin_define!(
        vapix,
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

/// Registers the element with an application that links this crate instead of loading the plugin.
pub fn plugin_register_static() -> Result<(), glib::BoolError> {
    plugin::plugin_register_static()
}
