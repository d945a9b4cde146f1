// SPDX-License-Identifier: MPL-2.0

//! GStreamer sink that steers a pan-tilt-zoom camera of any make after the tracked target.
//!
//! [`onvifptzsink`] is the element. What it computes is in the crate `ptztrack-servo`, what it says to the camera in
//! [`session`] and [`onvif`]; [`sink`] is what it has in common with sinks of other protocols.

pub mod onvifptzsink;

/// What GStreamer asks of a plugin; private, as nobody calls it from Rust.
mod plugin {
    fn plugin_init(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
        crate::onvifptzsink::register(plugin)
    }

    gst::plugin_define!(
        onvifptz,
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
