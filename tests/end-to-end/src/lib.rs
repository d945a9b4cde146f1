// SPDX-License-Identifier: MPL-2.0

//! What the whole-system tests share: finding the built plugins, running `gst-launch-1.0`, pipelines
//! inside the test, and waiting for something to happen without sleeping.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod broker;
mod cable;
mod chance;
mod counter;
mod disk;
pub mod following;
mod front;
mod held;
mod in_view;
mod launch;
mod pipeline;
mod program;
mod recording;
pub mod scene;
mod trend;
mod usage;
mod viewer;
mod watchdog;

pub use broker::Broker;
pub use cable::Cable;
pub use chance::Chance;
pub use counter::Counter;
pub use disk::Disk;
pub use front::{Front, Way};
pub use held::Held;
pub use in_view::InView;
pub use launch::{GstLaunch, certificate, plugin_folder, scratch, signal, tool};
pub use pipeline::{Running, init};
pub use program::{Program, ask_page, complaints_in, process_of};
pub use recording::pictures_in;
pub use usage::{Growth, Usage, growths};
pub use viewer::{Times, Viewer};
pub use watchdog::Watchdog;

use std::time::Duration;

/// How long a test waits for something that must happen; only a failure takes this long. It covers programs that load
/// their plugins from a cold disk on a loaded machine, and then wait for the person to come by again.
pub const PATIENCE: Duration = Duration::from_secs(120);
