// SPDX-License-Identifier: MPL-2.0

//! To be loaded before a program (`LD_PRELOAD`): in it, the machine's clock is off by as many seconds as the file says that `WALL_CLOCK`
//! names, eight bytes that may change at any time. Nobody else's clock is, and no right to set one is needed. Clocks that never jump,
//! as those that tell for how long a machine has run, are what they are; and so is the time by which the system itself stamps files.

use std::ffi::{c_int, c_void};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::ptr;
use std::sync::OnceLock;

use libc::{clockid_t, time_t, timespec, timeval};

/// By how many seconds the clock is off.
fn off_s() -> i64 {
    static FILE: OnceLock<Option<File>> = OnceLock::new();
    let file = FILE.get_or_init(|| File::open(std::env::var_os("WALL_CLOCK")?).ok());
    let mut seconds = [0; 8];
    // Before anything was said it is right.
    let said = file.as_ref().is_some_and(|file| file.read_exact_at(&mut seconds, 0).is_ok());
    if said { i64::from_ne_bytes(seconds) } else { 0 }
}

/// Takes the place of the C library's, and asks the system itself.
///
/// # Safety
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn clock_gettime(clock: clockid_t, time: *mut timespec) -> c_int {
    // SAFETY: the system checks the address, and says where it is none.
    let failed = unsafe { libc::syscall(libc::SYS_clock_gettime, clock, time) } != 0;
    if failed {
        return -1;
    }
    if [libc::CLOCK_REALTIME, libc::CLOCK_REALTIME_COARSE].contains(&clock) {
        // SAFETY: the system has just written there.
        unsafe { (*time).tv_sec += off_s() };
    }
    0
}

/// Takes the place of the C library's.
///
/// # Safety
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn gettimeofday(time: *mut timeval, zone: *mut c_void) -> c_int {
    // SAFETY: the system checks the addresses, and says where one is none.
    let failed = unsafe { libc::syscall(libc::SYS_gettimeofday, time, zone) } != 0;
    if failed {
        return -1;
    }
    if !time.is_null() {
        // SAFETY: the system has just written there.
        unsafe { (*time).tv_sec += off_s() };
    }
    0
}

/// Takes the place of the C library's.
///
/// # Safety
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn time(told: *mut time_t) -> time_t {
    let mut now = timeval { tv_sec: 0, tv_usec: 0 };
    // SAFETY: what is written is ours, and the caller's where there is such a place.
    unsafe {
        gettimeofday(&raw mut now, ptr::null_mut());
        if !told.is_null() {
            *told = now.tv_sec;
        }
    }
    now.tv_sec
}
