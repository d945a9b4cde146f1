// SPDX-License-Identifier: MPL-2.0

//! Stops cameras whose application has died or hangs. Started by `vapixptzsink`, with the socket as its standard input;
//! or by an administrator, to run elsewhere than the application:
//!
//! ```sh
//! vapix-watchdog --listen /run/ptztrack/watchdog.sock
//! ```
//! for `vapixptzsink dead-man-socket=/run/ptztrack/watchdog.sock`.

use std::process::ExitCode;

fn main() -> ExitCode {
    session::watchdog::run::<vapix::Client>("vapix-watchdog", "vapixptzsink")
}
