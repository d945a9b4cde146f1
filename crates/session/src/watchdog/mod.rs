// SPDX-License-Identifier: MPL-2.0

//! A camera moves until it is told otherwise, so whoever moves it must not die in between. What is to be done then is the
//! job of another process, the watchdog: it holds a [`Lease`] for each camera that may move, and stops a camera when its
//! lease runs out or when the socket to the application closes.
//!
//! ```text
//! application ─ Lease ─ Watchdog ─ AF_UNIX ─▶ the program: serve ─ guard ─▶ camera
//! ```
//! An application has one watchdog for all its cameras; it starts it when it first moves one, or connects to one that runs
//! elsewhere. What passes between them is one JSON object on a line, see [`protocol`]. The watchdog answers each line, so that
//! an application knows before it moves a camera that somebody will stop it.

mod camera_lock;
mod connection;
mod guard;
mod lease;
mod link;
mod process;
mod program;
mod protocol;
mod serve;

pub use lease::{Lease, Standing};
pub use link::{Unavailable, Watchdog, WatchdogAddress};
pub use program::run;
pub use protocol::{Answer, Message, StopOrder};
pub use serve::{Armed, serve};

use std::time::Duration;

/// A lease that is not renewed ends after this.
pub const LEASE: Duration = Duration::from_secs(2);

/// A lease is renewed this often, so that a machine may be late three times.
pub const RENEWAL: Duration = Duration::from_millis(500);

/// A stop that the camera does not confirm is repeated for this long.
pub const LAST_TRIES: Duration = Duration::from_secs(60);
