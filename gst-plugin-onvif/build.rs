// SPDX-License-Identifier: MPL-2.0

//! Puts version, commit and date into the plugin description.

fn main() {
    gst_plugin_version_helper::info();
}
