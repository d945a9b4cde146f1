// SPDX-License-Identifier: MPL-2.0

//! Where the application's watchdog is: one process for all its cameras.

use std::env::{current_exe, var_os};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Weak};

use gst::prelude::*;
use session::watchdog::{Watchdog, WatchdogAddress};

use ptztrack_contract::lock::lock;

use crate::Particulars;
use crate::settings::Settings;

/// The watchdog that the settings ask for, if they do; not started yet. In lockstep there is none: such a camera is not of
/// this world, nor is its time.
pub fn watchdog(
    settings: &Settings,
    particulars: &Particulars,
    element: &gst::Element,
) -> Option<Arc<Watchdog>> {
    let wanted = settings.dead_man && !settings.lockstep;
    wanted.then(|| {
        shared(match &settings.dead_man_socket {
            Some(socket) => WatchdogAddress::Socket(socket.into()),
            None => WatchdogAddress::Program(program(particulars, element)),
        })
    })
}

/// The same for all elements that ask for the same.
fn shared(address: WatchdogAddress) -> Arc<Watchdog> {
    static ALL: Mutex<Vec<Weak<Watchdog>>> = Mutex::new(Vec::new());
    let mut all = lock(&ALL);
    all.retain(|watchdog| watchdog.strong_count() > 0);
    let found = all.iter().filter_map(Weak::upgrade).find(|watchdog| *watchdog.address() == address);
    found.unwrap_or_else(|| {
        let watchdog = Watchdog::new(address);
        all.push(Arc::downgrade(&watchdog));
        watchdog
    })
}

fn program(particulars: &Particulars, element: &gst::Element) -> PathBuf {
    // Names the program where it is not found beside the plugin, as `GST_PLUGIN_SCANNER` does GStreamer's.
    if let Some(program) = var_os(format!("{}_WATCHDOG", particulars.environment)) {
        return program.into();
    }
    let plugin = element.factory().and_then(|factory| factory.plugin()).and_then(|plugin| plugin.filename());
    // An application that the plugin is linked into has it beside itself.
    beside(&plugin.or_else(|| current_exe().ok()).unwrap_or_default(), particulars.watchdog)
}

/// Where it is installed, beside what uses it; or built. Cargo builds tests and examples a folder deeper.
fn beside(user: &Path, program: &str) -> PathBuf {
    let folder = user.parent().unwrap_or(Path::new("/"));
    let installed = folder.join("libexec").join(program);
    let built = [folder.join(program), folder.join("..").join(program)];
    built.into_iter().find(|program| program.is_file()).unwrap_or(installed)
}
