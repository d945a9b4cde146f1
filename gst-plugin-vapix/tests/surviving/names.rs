// SPDX-License-Identifier: MPL-2.0

//! Names that tests give and take away: the C library's name service, but for those that end in `.test`, which no
//! other has (RFC 6761). It stands in front of the library's own, so that what is tested is what users run.

use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char, c_int};
use std::net::Ipv4Addr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::sleep;
use std::time::Duration;

use libc::{EAI_AGAIN, EAI_NONAME, addrinfo};

/// What becomes of a question for a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lookup {
    Unknown,
    /// The name server does not answer; what was asked meanwhile stays unanswered.
    Silent,
    Address(Ipv4Addr),
}

impl Lookup {
    /// Of a camera on this machine.
    pub const LOOPBACK: Self = Self::Address(Ipv4Addr::LOCALHOST);
}

/// After so long the C library gives up a silent name server: it asks twice for 5 s.
const SILENCE: Duration = Duration::from_secs(10);

struct Entry {
    lookup: Lookup,
    asked: u64,
}

static NAMES: Mutex<BTreeMap<String, Entry>> = Mutex::new(BTreeMap::new());

fn names() -> MutexGuard<'static, BTreeMap<String, Entry>> {
    NAMES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A name that nobody else uses.
#[derive(Debug)]
pub struct Name(String);

impl Name {
    pub fn new(lookup: Lookup) -> Self {
        let mut names = names();
        let name = format!("camera-{}.test", names.len());
        names.insert(name.clone(), Entry { lookup, asked: 0 });
        Self(name)
    }

    pub fn set(&self, lookup: Lookup) {
        names().get_mut(&self.0).unwrap().lookup = lookup;
    }

    /// How often it was asked for.
    pub fn asked(&self) -> u64 {
        names()[&self.0].asked
    }

    pub fn url(&self, port: u16) -> String {
        format!("http://{}:{port}", self.0)
    }
}

fn look_up(name: &str) -> Option<Lookup> {
    let mut names = names();
    let entry = names.get_mut(name)?;
    entry.asked += 1;
    Some(entry.lookup)
}

type GetAddrInfo =
    unsafe extern "C" fn(*const c_char, *const c_char, *const addrinfo, *mut *mut addrinfo) -> c_int;

/// Takes the place of the C library's in this program.
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
    let name = (!node.is_null()).then(|| unsafe { CStr::from_ptr(node) }.to_string_lossy());
    let address = match name.and_then(|name| look_up(&name)) {
        Some(Lookup::Unknown) => return EAI_NONAME,
        Some(Lookup::Silent) => {
            sleep(SILENCE);
            return EAI_AGAIN;
        }
        Some(Lookup::Address(address)) => CString::new(address.to_string()).ok(),
        None => None,
    };
    let node = address.as_ref().map_or(node, |address| address.as_ptr());
    // SAFETY: the next of this name is the C library's, and all but the node is the caller's.
    unsafe {
        let next = libc::dlsym(libc::RTLD_NEXT, c"getaddrinfo".as_ptr());
        let next: GetAddrInfo = std::mem::transmute(next);
        next(node, service, hints, result)
    }
}
