// SPDX-License-Identifier: MPL-2.0

//! To be loaded before a program (`LD_PRELOAD`): in it, names below `silent` are looked up at a name server that never answers.

use std::ffi::{CStr, c_char, c_int};
use std::thread::sleep;
use std::time::Duration;

use libc::addrinfo;

/// Longer than any test.
const SILENCE: Duration = Duration::from_secs(600);

type GetAddrInfo =
    unsafe extern "C" fn(*const c_char, *const c_char, *const addrinfo, *mut *mut addrinfo) -> c_int;

/// Takes the place of the C library's.
///
/// # Safety
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn getaddrinfo(
    node: *const c_char,
    service: *const c_char,
    hints: *const addrinfo,
    result: *mut *mut addrinfo,
) -> c_int {
    // SAFETY: a node that is not null is a string that ends in a zero, says the C library.
    let is_silent = !node.is_null() && unsafe { CStr::from_ptr(node) }.to_bytes().ends_with(b".silent");
    if is_silent {
        sleep(SILENCE);
        return libc::EAI_AGAIN;
    }
    // SAFETY: the next of this name is the C library's, and all is the caller's.
    unsafe {
        let next = libc::dlsym(libc::RTLD_NEXT, c"getaddrinfo".as_ptr());
        let next: GetAddrInfo = std::mem::transmute(next);
        next(node, service, hints, result)
    }
}
