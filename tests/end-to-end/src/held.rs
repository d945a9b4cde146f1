// SPDX-License-Identifier: MPL-2.0

//! Threads of another process that hang, as in a driver that never returns, while all its others go on.

use std::fs;
use std::io;
use std::marker::PhantomData;
use std::ptr;

use libc::{c_int, c_uint, pid_t};

/// A debugger holds them, which is this thread, until this is dropped. Before that the process cannot be seen to end.
pub struct Held {
    threads: Vec<pid_t>,
    /// To a debugger each of its threads is another one.
    of_this_thread: PhantomData<*const ()>,
}

impl Held {
    /// All threads of a process, one of our own children, that have this name.
    #[track_caller]
    pub fn threads(process: u32, name: &str) -> Self {
        let tasks = fs::read_dir(format!("/proc/{process}/task")).unwrap();
        let paths = tasks.map(|task| task.unwrap().path());
        let named =
            paths.filter(|path| fs::read_to_string(path.join("comm")).is_ok_and(|is| is.trim() == name));
        let threads: Vec<pid_t> =
            named.map(|path| path.file_name().unwrap().to_str().unwrap().parse().unwrap()).collect();
        assert!(!threads.is_empty(), "no thread of {process} is called {name}");
        let held = Self { threads, of_this_thread: PhantomData };
        for thread in &held.threads {
            for request in [libc::PTRACE_SEIZE, libc::PTRACE_INTERRUPT] {
                assert!(ask(request, *thread), "{thread} cannot be held: {}", io::Error::last_os_error());
            }
        }
        held.threads.iter().for_each(|thread| wait_until_held(*thread));
        held
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        for thread in &self.threads {
            // One that has ended is held by nobody.
            ask(libc::PTRACE_DETACH, *thread);
        }
    }
}

fn ask(request: c_uint, thread: pid_t) -> bool {
    // SAFETY: these requests read and write no memory.
    unsafe { libc::ptrace(request, thread, ptr::null_mut::<()>(), ptr::null_mut::<()>()) == 0 }
}

#[track_caller]
fn wait_until_held(thread: pid_t) {
    let mut status: c_int = 0;
    // SAFETY: the status is written during the call only.
    let found = unsafe { libc::waitpid(thread, &raw mut status, libc::__WALL) };
    assert!(found == thread && libc::WIFSTOPPED(status), "{thread} is not held: {status:#x}");
}
