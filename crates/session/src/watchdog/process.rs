// SPDX-License-Identifier: MPL-2.0

//! What this process is to the system.

use std::io;

/// Becomes nobody's child, in a session of its own, in the root folder, with nothing open but the standard streams. To be
/// called before there are threads.
pub fn leave_parent() -> io::Result<()> {
    // SAFETY: there is one thread only.
    checked(unsafe { libc::daemon(0, 1) })?;
    // SAFETY: nothing has been opened yet; what is open beyond these was inherited and is used by nobody here.
    checked(unsafe { libc::close_range(3, libc::c_uint::MAX, 0) })
}

/// Lets neither a core dump nor a debugger have the passwords.
pub fn keep_secrets() -> io::Result<()> {
    let none = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: the limit is read only during the call.
    checked(unsafe { libc::setrlimit(libc::RLIMIT_CORE, &raw const none) })?;
    // SAFETY: takes numbers only.
    checked(unsafe { libc::prctl(libc::PR_SET_DUMPABLE, 0, 0, 0, 0) })
}

/// Ignores what a service manager, a terminal or a user ends a process with; or does not.
pub fn ignore_termination(ignored: bool) {
    let action = if ignored { libc::SIG_IGN } else { libc::SIG_DFL };
    for signal in [libc::SIGTERM, libc::SIGHUP, libc::SIGINT] {
        // SAFETY: neither action runs code of ours.
        unsafe { libc::signal(signal, action) };
    }
}

fn checked(result: libc::c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}
