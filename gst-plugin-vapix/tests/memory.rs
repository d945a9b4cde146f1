// SPDX-License-Identifier: MPL-2.0

//! Text of any length is read in a bounded space. A test of its own process: others need memory, too.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;
mod surviving;

use std::time::Duration;

use surviving::{cases, survive};

const TIMEOUT: Duration = Duration::from_secs(1);

/// Far more than allocators keep, and far less than the bodies that are sent.
const MUCH: u64 = 32 << 20;

#[test]
fn memory_stays_as_it_is() {
    for name in ["a body without end", "a byte every 100 ms, without end", "connection refused"] {
        let case = cases().into_iter().find(|case| case.name == name).unwrap();
        survive(&case, TIMEOUT, Duration::ZERO);
        let before = resident_bytes();
        survive(&case, TIMEOUT, Duration::from_secs(4));
        let grown = resident_bytes().saturating_sub(before);
        assert!(grown < MUCH, "{name}: {grown} bytes more");
    }
}

fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() * 1024
}
