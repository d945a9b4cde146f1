// SPDX-License-Identifier: MPL-2.0

//! What became of it all.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

use end_to_end::growths;

use crate::fault::Happening;
use crate::known::Known;
use crate::sample::Samples;

/// What was counted of one camera.
pub struct Account {
    camera: usize,
    /// How often each thing happened, and the longest that it took to be back.
    happened: BTreeMap<&'static str, (u32, Duration)>,
    /// What stock GStreamer may complain of here, and how often it did.
    known: Vec<(&'static Known, u32)>,
    /// What must not be.
    faults: Vec<String>,
    /// Pipelines that were built.
    pipelines: u64,
}

impl Account {
    pub fn of(camera: usize, known: &'static [Known]) -> Self {
        let known = known.iter().map(|known| (known, 0)).collect();
        Self { camera, happened: BTreeMap::new(), known, faults: Vec::new(), pipelines: 0 }
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

    /// All that who followed has said: a complaint is a fault, but for those that are known, which are counted.
    pub fn said(&mut self, output: &str) {
        let complains = |line: &&str| line.contains("panicked") || line.contains("CRITICAL");
        let mut faulty = false;
        for line in output.lines().filter(complains) {
            match self.known.iter_mut().find(|(known, _)| known.is(line)) {
                Some((_, times)) => *times += 1,
                None => faulty = true,
            }
        }
        if faulty {
            self.fault(&format!("who followed complained: {output}"));
        }
    }

    pub fn ended(&mut self, well: bool, output: &str) {
        self.said(output);
        if !well {
            self.fault(&format!("who followed ended badly: {output}"));
        }
    }

    /// So many pipelines, one after the other.
    pub fn built(&mut self, pipelines: u64) {
        self.pipelines = pipelines;
    }

    fn was_killed(&self) -> bool {
        self.happened.contains_key(Happening::Kill.name())
    }

    fn fault(&mut self, fault: &str) {
        self.faults.push(format!("camera {}: {fault}", self.camera));
    }
}

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
    text.push_str("\n| of a process that lived all the time, after the first third | on average | in an hour (95 %) | |\n|---|---:|---:|---|\n");
    let mut faults: Vec<_> = accounts.iter().flat_map(|account| &account.faults).cloned().collect();
    // Of one that was killed no process lived long enough to tell a slope from how it began.
    for camera in accounts.iter().filter(|account| !account.was_killed()).map(|account| account.camera) {
        for growth in growths(&samples.usages(camera)) {
            writeln!(text, "| camera {camera}: {growth} |").unwrap();
            faults.extend(growth.fault().map(|fault| format!("camera {camera}: {fault}")));
        }
    }
    text.push_str(&known_complaints(accounts));
    let pipelines: u64 = accounts.iter().map(|account| account.pipelines).sum();
    writeln!(text, "\n{pipelines} pipelines were built, each once the one before was dropped.").unwrap();
    match &faults[..] {
        [] => text.push_str("\nEvery camera is at rest, nothing has grown, nothing was lost.\n"),
        faults => writeln!(text, "\nNot well:\n\n- {}", faults.join("\n- ")).unwrap(),
    }
    println!("{text}");
    std::fs::write(out.join("account.md"), text).unwrap();
    faults.is_empty()
}

/// A line for each that came: they are no faults, but nobody shall have to guess that they were there.
fn known_complaints(accounts: &[Account]) -> String {
    let mut text = String::new();
    for account in accounts {
        for (known, times) in account.known.iter().filter(|(_, times)| *times > 0) {
            let (camera, Known { text: line, why, .. }) = (account.camera, known);
            writeln!(text, "\nCamera {camera}: {times} times GStreamer's own `{line}`: {why}.").unwrap();
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known::OF_RTSPSRC;

    fn complaint(of: &str) -> String {
        format!("\n(ptztrack:4711): {of}\n")
    }

    fn known() -> String {
        complaint(&format!("GStreamer-CRITICAL **: 12:34:56.789: {}", OF_RTSPSRC[0].text))
    }

    #[test]
    fn a_known_complaint_is_counted_and_told_and_no_fault() {
        let mut account = Account::of(2, OF_RTSPSRC);
        account.said(&known());
        account.ended(true, &known().repeat(3));
        assert!(account.faults.is_empty(), "{:?}", account.faults);
        let told = known_complaints(&[Account::of(3, OF_RTSPSRC), account]);
        assert!(told.contains("Camera 2: 4 times") && told.contains(OF_RTSPSRC[0].text), "{told}");
        assert!(!told.contains("Camera 3"), "{told}");
    }

    #[test]
    fn nothing_else_hides_behind_a_known_complaint() {
        let others = [
            complaint(
                "GStreamer-CRITICAL **: 12:34:56.789: gst_event_unref: assertion 'event != NULL' failed",
            ),
            "thread 'main' panicked at src/main.rs:1:1:\n".to_owned(),
        ];
        for other in others {
            let mut account = Account::of(2, OF_RTSPSRC);
            account.said(&format!("{}{other}{}", known(), known()));
            assert_eq!(account.faults.len(), 1, "{other}");
            assert!(known_complaints(&[account]).contains("2 times"));
        }
        let mut ended_badly = Account::of(2, OF_RTSPSRC);
        ended_badly.ended(false, &known());
        assert_eq!(ended_badly.faults.len(), 1);
    }

    #[test]
    fn who_was_killed_is_known() {
        let mut account = Account::of(1, &[]);
        account.came_back(Happening::Close.name(), Some(Duration::ZERO));
        assert!(!account.was_killed());
        account.came_back(Happening::Kill.name(), Some(Duration::ZERO));
        assert!(account.was_killed());
    }

    /// Who has no `rtspsrc` has no excuse.
    #[test]
    fn where_none_is_known_each_is_a_fault() {
        let mut account = Account::of(0, &[]);
        account.said(&known());
        assert_eq!(account.faults.len(), 1);
    }
}
