// SPDX-License-Identifier: MPL-2.0

//! The program `ptztrack` with a file of cameras, as a service has it.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};
use std::time::Instant;

use crate::{GstLaunch, PATIENCE, plugin_folder, scene, scratch, tool};

/// It runs, with a folder of its own.
pub struct Program {
    /// Its process, and what it says.
    pub launch: GstLaunch,
    folder: PathBuf,
    /// Where its page is: host and port.
    page: String,
}

impl Program {
    /// With what `file` makes for it in its folder, named after the test.
    #[track_caller]
    pub fn start(test: &str, file: impl FnOnce(&Path) -> String, more: &[&str]) -> Self {
        Self::start_in(test, file, more, &[])
    }

    /// The same in an environment of its own.
    #[track_caller]
    pub fn start_in(
        test: &str,
        file: impl FnOnce(&Path) -> String,
        more: &[&str],
        environment: &[(&str, &Path)],
    ) -> Self {
        Self::start_as(test, file, more, |mut command| {
            command.envs(environment.iter().copied());
            command
        })
    }

    /// The same by what is made of its command: in a network of its own, nobody can ask its page.
    #[track_caller]
    pub fn start_as(
        test: &str,
        file: impl FnOnce(&Path) -> String,
        more: &[&str],
        made: impl FnOnce(Command) -> Command,
    ) -> Self {
        let folder = scratch(&format!("program-{test}"));
        let mut command = Self::command(&folder, file);
        command.args(["--http", "127.0.0.1:0"]).args(more);
        let mut launch = GstLaunch::spawn(made(command));
        let line = launch.wait_for_line("/healthz at http://");
        // A camera may have spoken before the page.
        launch.rewind();
        let page = line.split("http://").nth(1).and_then(|page| page.split('/').next()).unwrap().to_owned();
        Self { launch, folder, page }
    }

    /// What starts it with what `file` makes for it in this folder, and without a page.
    pub fn command(folder: &Path, file: impl FnOnce(&Path) -> String) -> Command {
        fs::create_dir_all(folder).unwrap();
        fs::write(folder.join("password"), scene::PASSWORD).unwrap();
        let cameras = folder.join("cameras.toml");
        fs::write(&cameras, file(folder)).unwrap();
        let mut command = tool(plugin_folder().join("ptztrack").to_str().unwrap());
        command.arg("run").arg(&cameras);
        command.env("XDG_STATE_HOME", folder.join("state")).env_remove("STATE_DIRECTORY");
        command
    }

    /// A camera's entry in the file.
    pub fn entry(name: &str, address: &str, password_file: &Path) -> String {
        format!(
            "[camera.{name}]\naddress = \"{address}\"\nsize = \"320x240\"\nuser = \"{}\"\npassword-file = {password_file:?}\n",
            scene::USER
        )
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The address of its page.
    pub fn url(&self) -> String {
        format!("http://{}/", self.page)
    }

    /// Status and body of what is asked of the page.
    pub fn ask(&self, method: &str, path: &str) -> (u16, String) {
        self.ask_as(&self.page, method, path)
    }

    /// The same by another name.
    pub fn ask_as(&self, host: &str, method: &str, path: &str) -> (u16, String) {
        let (status, body) = ask_page(&self.page, host, method, path);
        (status, String::from_utf8_lossy(&body).into_owned())
    }

    /// Asks again and again until this is so of the answer.
    #[track_caller]
    pub fn wait_for(&self, path: &str, wanted: impl Fn(&str) -> bool) -> String {
        let begin = Instant::now();
        loop {
            let (_, body) = self.ask("GET", path);
            if wanted(&body) {
                return body;
            }
            assert!(begin.elapsed() < PATIENCE, "never came at {path}:\n{body}");
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
    }

    /// What the page counts by this name, of all cameras together.
    pub fn metric(&self, name: &str) -> f64 {
        sum_of(&self.ask("GET", "/metrics").1, name, "")
    }

    /// What it counts by each of these names at one moment, of each of these cameras. A camera that is set otherwise begins anew.
    pub fn metrics_of<const N: usize>(&self, names: [&str; N], cameras: &[String]) -> [Vec<u64>; N] {
        let metrics = self.ask("GET", "/metrics").1;
        let of = |name, camera: &String| sum_of(&metrics, name, &format!("camera=\"{camera}\"")) as u64;
        names.map(|name| cameras.iter().map(|camera| of(name, camera)).collect())
    }

    /// The process of a camera that has one of its own.
    #[track_caller]
    pub fn process_of(&self, camera: &str) -> u32 {
        process_of(self.launch.id(), camera)
    }

    /// Ends it by a signal; gives what it said.
    #[track_caller]
    pub fn end(self, signal: &str) -> String {
        let (status, output) = self.end_somehow(signal);
        assert!(status.success(), "{output}");
        output
    }

    /// The same, however it ends.
    #[track_caller]
    pub fn end_somehow(self, signal: &str) -> (ExitStatus, String) {
        self.launch.signal(signal);
        let ended = self.launch.finish();
        // Where a test fails, it stays for a look.
        fs::remove_dir_all(&self.folder).unwrap();
        ended
    }
}

/// The process of its own that this program has for a camera.
#[track_caller]
pub fn process_of(program: u32, camera: &str) -> u32 {
    let wanted = format!("ptztrack\0camera\0{camera}\0");
    let parent = format!("PPid:\t{program}");
    let is = |process: &u32| {
        let read = |file: &str| fs::read_to_string(format!("/proc/{process}/{file}")).unwrap_or_default();
        read("cmdline") == wanted && read("status").lines().any(|line| line == parent)
    };
    let begin = Instant::now();
    loop {
        let processes = fs::read_dir("/proc").unwrap();
        let numbers = processes.filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
        if let Some(found) = numbers.into_iter().find(is) {
            return found;
        }
        assert!(begin.elapsed() < PATIENCE, "no process for {camera}");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

/// The warnings and errors in its log, without their times.
pub fn complaints_in(log: &str) -> Vec<String> {
    let is_complaint = |line: &&str| line.contains("warning: ") || line.contains("error: ");
    let without_time = |line: &str| line.split_once(' ').map(|(_, complaint)| complaint.to_owned());
    log.lines().filter(is_complaint).filter_map(without_time).collect()
}

/// Of the lines `name{labels} value` of OpenMetrics whose labels begin with these.
fn sum_of(metrics: &str, name: &str, labels: &str) -> f64 {
    let labels = |line: &str| {
        let found = line.strip_prefix(name).and_then(|rest| rest.strip_prefix('{'));
        found.is_some_and(|found| found.starts_with(labels))
    };
    let value = |line: &str| line.rsplit(' ').next()?.parse::<f64>().ok();
    metrics.lines().filter(|line| labels(line)).filter_map(value).sum()
}

/// Status and body of what is asked of a page, host and port, by a name of it.
pub fn ask_page(page: &str, name: &str, method: &str, path: &str) -> (u16, Vec<u8>) {
    let mut stream = TcpStream::connect(page).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    write!(
        stream,
        "{method} {path} HTTP/1.1\r\nHost: {name}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
    )
    .unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let head = String::from_utf8_lossy(&answer[..end]);
    (head.split(' ').nth(1).unwrap().parse().unwrap(), answer[end + 4..].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metric_is_that_of_all_cameras_and_no_other() {
        let metrics = "# HELP p_total Pictures.\np_total{camera=\"a b\"} 3.0\np_total{camera=\"c\"} 4.0\n\
                       p_dropped_total{camera=\"c\"} 8.0\n# EOF\n";
        assert_eq!(sum_of(metrics, "p_total", ""), 7.0);
        assert_eq!(sum_of(metrics, "p_total", "camera=\"c\""), 4.0);
        assert_eq!(sum_of(metrics, "q_total", ""), 0.0);
    }
}
