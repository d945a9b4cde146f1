// SPDX-License-Identifier: MPL-2.0

//! How long the example in Python waits before it starts anew, with nothing real to wait for.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::process::Command;

use end_to_end::following::pipeline;

/// Doubled while it comes to nothing, and never so long that a camera that is back waits for it, s.
const PAUSES: &str = "0.1 0.2 0.4 0.4 0.4";

#[test]
fn of_the_example_in_python() {
    const TEST: &str = "
import sys, types
sys.path.insert(0, sys.argv[1])
import follow
pauses = []
loop = types.SimpleNamespace(run=lambda: None, quit=lambda: None)
follow.GLib = types.SimpleNamespace(
    MainLoop=lambda: loop, unix_signal_add=lambda *_: None, PRIORITY_DEFAULT=0,
    timeout_add=lambda milliseconds, _: pauses.append(str(milliseconds / 1000)),
)
class Failing(follow.Follower):
    def answers(self):
        return True
    def play(self):
        self.ending = len(pauses) == 5
Failing('http://camera.example', '').run()
print(' '.join(pauses))
";
    let output = Command::new("/usr/bin/python3").args(["-c", TEST]).arg(pipeline("embed")).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), PAUSES, "{output:?}");
}
