// SPDX-License-Identifier: MPL-2.0

//! What became of it all.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

use crate::sample::{Sample, Samples};

/// What was counted of one camera.
pub struct Account {
    camera: usize,
    /// How often each thing happened, and the longest that it took to be back.
    happened: BTreeMap<&'static str, (u32, Duration)>,
    /// What must not be.
    faults: Vec<String>,
}

impl Account {
    pub fn of(camera: usize) -> Self {
        Self { camera, happened: BTreeMap::new(), faults: Vec::new() }
    }

    /// How long it took to be followed again, where it was.
    pub fn came_back(&mut self, after: &'static str, back: Option<Duration>) {
        let (times, longest) = self.happened.entry(after).or_default();
        *times += 1;
        match back {
            Some(back) => *longest = (*longest).max(back),
            None => self.fault(&format!("lost after: {after}")),
        }
    }

    pub fn rests(&mut self, rests: bool) {
        if !rests {
            self.fault("left turning");
        }
    }

    pub fn ended(&mut self, well: bool, output: &str) {
        if !well || output.contains("panicked") || output.contains("CRITICAL") {
            self.fault(&format!("who followed ended badly: {output}"));
        }
    }

    fn fault(&mut self, fault: &str) {
        self.faults.push(format!("camera {}: {fault}", self.camera));
    }
}

/// What may not grow, and by how much it may differ: by this share, and this much.
type Quantity = (&'static str, fn(&Sample) -> f64, f64, f64);
const QUANTITIES: [Quantity; 3] = [
    ("memory, MB", |sample| sample.memory_mb, 0.1, 4.0),
    ("threads", |sample| sample.threads, 0.0, 2.0),
    ("open files", |sample| sample.files, 0.0, 4.0),
];

/// Prints it and writes it down; whether all is well.
pub fn tell(accounts: &[Account], samples: &Samples, out: &Path) -> bool {
    let mut text = "| what happened | times | followed again after, at most |\n|---|---:|---:|\n".to_owned();
    let mut happened: BTreeMap<&str, (u32, Duration)> = BTreeMap::new();
    for (name, (times, longest)) in accounts.iter().flat_map(|account| &account.happened) {
        let all = happened.entry(name).or_default();
        *all = (all.0 + times, all.1.max(*longest));
    }
    for (name, (times, longest)) in happened {
        writeln!(text, "| {name} | {times} | {:.1} s |", longest.as_secs_f64()).unwrap();
    }
    text.push_str("\n| of a process that lived all the time | in the second third | in the last | |\n|---|---:|---:|---|\n");
    let mut faults: Vec<_> = accounts.iter().flat_map(|account| &account.faults).cloned().collect();
    // Odd ones are killed.
    for camera in accounts.iter().map(|account| account.camera).filter(|camera| camera % 2 == 0) {
        let samples = samples.of(camera);
        let thirds: Vec<_> = samples.chunks(samples.len().div_ceil(3).max(1)).collect();
        for (name, value, share, more) in QUANTITIES {
            let (before, after) = (median(thirds[1], value), median(thirds[2], value));
            let grown = after > before * (1.0 + share) + more;
            let verdict = if grown { "**grown**" } else { "not grown" };
            writeln!(text, "| camera {camera}: {name} | {before:.0} | {after:.0} | {verdict} |").unwrap();
            if grown {
                faults.push(format!("camera {camera}: {name} grew from {before:.0} to {after:.0}"));
            }
        }
    }
    match &faults[..] {
        [] => text.push_str("\nEvery camera is at rest, nothing has grown, nothing was lost.\n"),
        faults => writeln!(text, "\nNot well:\n\n- {}", faults.join("\n- ")).unwrap(),
    }
    println!("{text}");
    std::fs::write(out.join("account.md"), text).unwrap();
    faults.is_empty()
}

fn median(samples: &[Sample], value: fn(&Sample) -> f64) -> f64 {
    let mut values: Vec<_> = samples.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
