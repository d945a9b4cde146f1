// SPDX-License-Identifier: MPL-2.0

//! An MQTT broker, the one of Debian.

use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use crate::{GstLaunch, PATIENCE, scratch};

/// Debian's `mosquitto`, which has no part of anybody's `PATH` but root's.
const MOSQUITTO: [&str; 2] = ["/usr/sbin/mosquitto", "mosquitto"];

/// It runs until it is dropped.
pub struct Broker {
    child: Child,
    settings: PathBuf,
    /// Where it listens, on 127.0.0.1.
    pub port: u16,
}

impl Broker {
    /// With no settings but where it listens.
    pub fn start() -> Self {
        Self::start_with("")
    }

    /// With more settings.
    pub fn start_with(more: &str) -> Self {
        let program = MOSQUITTO.into_iter().find(|program| Command::new(program).arg("-h").output().is_ok());
        let program = program.expect("mosquitto is not installed: `make test` installs it");
        // It cannot choose a port itself.
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let settings = scratch(&format!("mosquitto-{port}.conf"));
        std::fs::write(
            &settings,
            format!("listener {port} 127.0.0.1\nallow_anonymous true\nlog_dest none\n{more}"),
        )
        .unwrap();
        let child = Command::new(program).arg("-c").arg(&settings).spawn().unwrap();
        let broker = Self { child, settings, port };
        let begin = Instant::now();
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(begin.elapsed() < PATIENCE, "mosquitto does not listen");
            std::thread::sleep(Duration::from_millis(20));
        }
        broker
    }

    /// A line for each message, topic and payload: what is kept there, then what comes.
    pub fn listen(&self, topic: &str) -> GstLaunch {
        self.listen_with(topic, &["-v"])
    }

    /// The same with the length of the payload in its place.
    pub fn listen_to_sizes(&self, topic: &str) -> GstLaunch {
        self.listen_with(topic, &["-F", "%t %l"])
    }

    fn listen_with(&self, topic: &str, more: &[&str]) -> GstLaunch {
        let mut command = Command::new("mosquitto_sub");
        command.args(["-h", "127.0.0.1", "-p", &self.port.to_string(), "-t", topic]).args(more);
        GstLaunch::spawn(command)
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        // It may be gone already; its file is only litter.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.settings);
    }
}
