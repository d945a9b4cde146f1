// SPDX-License-Identifier: MPL-2.0

//! The watchdog of one test's application: under a name of its own, by which its processes are found.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use crate::{PATIENCE, plugin_folder};

/// Between two looks.
const MOMENT: Duration = Duration::from_millis(20);

/// The program `vapix-watchdog` by another name.
pub struct Watchdog {
    program: PathBuf,
}

impl Watchdog {
    /// Named after the test.
    pub fn new(test: &str) -> Self {
        let folder = plugin_folder();
        let program = folder.join(format!("watchdog-{test}-{}", std::process::id()));
        // What a test that was killed left behind.
        let _ = fs::remove_file(&program);
        fs::hard_link(folder.join("vapix-watchdog"), &program).unwrap();
        Self { program }
    }

    /// Has this application use it.
    pub fn of(&self, mut application: Command) -> Command {
        application.env("VAPIX_WATCHDOG", &self.program);
        application
    }

    /// The program by its own name.
    pub fn program(&self) -> &Path {
        &self.program
    }

    /// Those that run.
    pub fn processes(&self) -> Vec<u32> {
        let entries = fs::read_dir("/proc").unwrap();
        entries
            .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
            .filter(|id| fs::read_link(format!("/proc/{id}/exe")).is_ok_and(|exe| exe == self.program))
            .collect()
    }

    /// Waits until this is so of those that run.
    #[track_caller]
    pub fn wait_for(&self, what: &str, wanted: impl Fn(&[u32]) -> bool) {
        let begin = Instant::now();
        while !wanted(&self.processes()) {
            assert!(begin.elapsed() < PATIENCE, "{what}: {:?}", self.processes());
            std::thread::sleep(MOMENT);
        }
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        // A failed test must not leave a file behind either.
        let _ = fs::remove_file(&self.program);
    }
}
