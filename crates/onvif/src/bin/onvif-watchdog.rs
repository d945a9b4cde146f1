// SPDX-License-Identifier: MPL-2.0

//! Stops cameras whose application has died or hangs. Started by `onvifptzsink`, with the socket as its standard input;
//! or by an administrator, to run elsewhere than the application:
//!
//! ```sh
//! onvif-watchdog --listen /run/ptztrack/onvif-watchdog.sock
//! ```
//! for `onvifptzsink dead-man-socket=/run/ptztrack/onvif-watchdog.sock`.

use std::process::ExitCode;

fn main() -> ExitCode {
    session::watchdog::run::<onvif::Client>("onvif-watchdog", "onvifptzsink")
}
