// SPDX-License-Identifier: MPL-2.0

//! `gst-launch-1.0` and friends as a user starts them, with the freshly built plugins.

use std::borrow::BorrowMut;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// The folder that holds the built `libgst*.so` and the watchdog: the one that this program was built into.
///
/// # Panics
/// Where the plugins were not built: `cargo test` alone does not build them.
pub fn plugin_folder() -> PathBuf {
    let program = std::env::current_exe().expect("a running program has a path");
    // target/<profile>, and `deps` or `examples` in it.
    let within = |folder: &&Path| !folder.ends_with("deps") && !folder.ends_with("examples");
    let folder = program.ancestors().skip(1).find(within).expect("target/<profile>").to_owned();
    for file in ["libgstptztrack.so", "libgstvapix.so", "vapix-watchdog", "ptztrack-launch", "ptztrack"] {
        assert!(folder.join(file).exists(), "{file} is not built: run `cargo build` first");
    }
    folder
}

/// Where a test leaves what nobody else is to find, by a name that says whose it is. It is not below the plugins' folder: GStreamer looks
/// for plugins there, whoever starts meanwhile, and would remember those that a test has linked for itself.
pub fn scratch(name: &str) -> PathBuf {
    let folder = plugin_folder().with_file_name("tmp");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(format!("{}-{name}", std::process::id()))
}

/// A file that has to do with a certificate: `camera.pem` and its key `camera.key.pem`, which `authority.pem` has signed, or
/// `self-signed.pem`.
pub fn certificate(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../gst-plugin-vapix/tests/certificates");
    folder.join(name).canonicalize().unwrap()
}

/// A GStreamer or other tool with the plugins and a registry of our own, so that a user's stays as it is.
pub fn tool(program: &str) -> Command {
    let folder = plugin_folder();
    let mut command = Command::new(program);
    command
        .env("GST_PLUGIN_PATH", &folder)
        .env("GST_REGISTRY", folder.join("registry.bin"))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY");
    command
}

/// Sends a process a signal by name (`INT`, `TERM`).
pub fn signal(process: u32, name: &str) {
    let status = Command::new("kill").args(["-s", name, &process.to_string()]).status().unwrap();
    assert!(status.success());
}

/// A running `gst-launch-1.0` (or a script that ends in one) whose output can be waited for.
pub struct GstLaunch {
    child: Child,
    lines: mpsc::Receiver<String>,
    seen: Vec<String>,
    /// How many of them were waited for.
    waited: usize,
}

impl GstLaunch {
    /// Starts `gst-launch-1.0 <options> <pipeline>`.
    pub fn start(options: &[&str], pipeline: &str) -> Self {
        let mut command = tool("gst-launch-1.0");
        command.args(options).args(pipeline.split_whitespace());
        Self::spawn(command)
    }

    /// Starts any command whose output is to be read.
    pub fn spawn(mut command: impl BorrowMut<Command>) -> Self {
        let command = command.borrow_mut().stdout(Stdio::piped()).stderr(Stdio::piped()).stdin(Stdio::null());
        let mut child = command.spawn().unwrap();
        let (sender, lines) = mpsc::channel();
        let streams: [Box<dyn Read + Send>; 2] =
            [Box::new(child.stdout.take().unwrap()), Box::new(child.stderr.take().unwrap())];
        for stream in streams {
            let sender = sender.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(stream).split(b'\n').map_while(Result::ok) {
                    if sender.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
                        return;
                    }
                }
            });
        }
        Self { child, lines, seen: Vec::new(), waited: 0 }
    }

    /// Waits for a line that contains `text` after the one that was last waited for, and gives it.
    #[track_caller]
    pub fn wait_for_line(&mut self, text: &str) -> String {
        let deadline = Instant::now() + crate::PATIENCE;
        loop {
            while let Some(line) = self.seen.get(self.waited) {
                self.waited += 1;
                if line.contains(text) {
                    return line.clone();
                }
            }
            match self.lines.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(line) => self.seen.push(line),
                Err(_) => panic!("`{text}` never came; output so far:\n{}", self.seen.join("\n")),
            }
        }
    }

    /// Waits for the next line from the first on again: for what is said at the start in no certain order.
    pub fn rewind(&mut self) {
        self.waited = 0;
    }

    /// Its number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal by name (`INT`, `TERM`).
    pub fn signal(&self, name: &str) {
        signal(self.id(), name);
    }

    /// Waits until it has ended by itself, as long as it has something to say; gives the exit status and everything it
    /// printed.
    #[track_caller]
    pub fn finish(mut self) -> (ExitStatus, String) {
        // The channel closes when both streams do, which is when the process and its children end.
        loop {
            match self.lines.recv_timeout(crate::PATIENCE) {
                Ok(line) => self.seen.push(line),
                Err(mpsc::RecvTimeoutError::Disconnected) => break,
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    panic!("it did not end; output so far:\n{}", self.seen.join("\n"))
                }
            }
        }
        let status = self.child.wait().unwrap();
        (status, std::mem::take(&mut self.seen).join("\n"))
    }

    /// The lines seen so far.
    pub fn seen(&self) -> &[String] {
        &self.seen
    }

    /// All that it has said so far, whether waited for or not.
    pub fn said(&mut self) -> String {
        self.read_for(Duration::ZERO);
        self.seen.join("\n")
    }

    /// Reads lines for `duration` of real time: for tests that something does *not* come.
    pub fn read_for(&mut self, duration: Duration) {
        let deadline = Instant::now() + duration;
        while let Ok(line) = self.lines.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            self.seen.push(line);
        }
        self.waited = self.seen.len();
    }
}

impl Drop for GstLaunch {
    fn drop(&mut self) {
        // A failed test must not leave processes behind; one that has ended already is no error.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
