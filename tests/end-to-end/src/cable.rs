// SPDX-License-Identifier: MPL-2.0

//! A cable between an application and its camera that loses some packets, or all when it is pulled, and nobody is told.

use std::net::Ipv4Addr;
use std::path::Path;
use std::process::Command;

/// A network namespace for an application, and its only cable; both go when this is dropped.
pub struct Cable {
    /// Also the name of its end on the camera's side.
    namespace: String,
    /// Which of the networks for tests it is.
    network: u32,
}

/// For tests of network devices (RFC 2544), so that no real network is meant.
const TEST_NETWORKS: Ipv4Addr = Ipv4Addr::new(198, 18, 0, 0);
/// Bits of a network's number: each has four of a /15's addresses.
const NETWORK_BITS: u32 = 15;
/// Bits of a cable's number among those of its process.
const CABLE_BITS: u32 = 5;

impl Cable {
    /// Lays one, different from all others of this number below 32, of this process or another.
    ///
    /// # Errors
    /// What `ip` says where this process may not: it takes root and iproute2.
    pub fn lay(number: u8) -> Result<Self, String> {
        take_away_what_was_left();
        let process = std::process::id();
        let network = (process << CABLE_BITS | u32::from(number)) & ((1 << NETWORK_BITS) - 1);
        let cable = Self { namespace: format!("{PREFIX}{process}-{number}"), network };
        let Self { namespace, .. } = &cable;
        let (here, there) = (cable.camera_side(), cable.side(2));
        ip(&format!("netns add {namespace}"))?;
        ip(&format!("link add {namespace} type veth peer name cable netns {namespace}"))?;
        ip(&format!("address add {here}/30 dev {namespace}"))?;
        ip(&format!("-n {namespace} address add {there}/30 dev cable"))?;
        ip(&format!("-n {namespace} link set cable up"))?;
        ip(&format!("-n {namespace} link set lo up"))?;
        cable.plug()?;
        Ok(cable)
    }

    /// Where the application finds the camera.
    pub fn camera_side(&self) -> Ipv4Addr {
        self.side(1)
    }

    /// Loses this share of all packets from now on, by chance and in both directions; to be said once.
    ///
    /// Each end loses what it receives: who sends a packet that its own end refuses is told so, and sends it again at once. A packet is
    /// what a wire takes, and not what a kernel would hand on in one piece.
    ///
    /// # Errors
    /// What `iptables` says where this process may not, or it is missing.
    pub fn lose(&self, share: f64) -> Result<(), String> {
        let Self { namespace, .. } = self;
        let loss = format!("--match statistic --mode random --probability {share} --jump DROP");
        ip(&format!("link set {namespace} gso_max_segs 1"))?;
        ip(&format!("-n {namespace} link set cable gso_max_segs 1"))?;
        ip(&format!("netns exec {namespace} iptables --append INPUT --in-interface cable {loss}"))?;
        // Here by a chain of its own, which is found by its name.
        iptables(&format!("--new-chain {namespace}"))?;
        iptables(&format!("--append {namespace} {loss}"))?;
        iptables(&format!("--insert INPUT --in-interface {namespace} --jump {namespace}"))?;
        Ok(())
    }

    fn side(&self, host: u32) -> Ipv4Addr {
        Ipv4Addr::from(u32::from(TEST_NETWORKS) + 4 * self.network + host)
    }

    /// Runs a program at its far end.
    pub fn at_the_end(&self, program: &Command) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.namespace]).arg(program.get_program()).args(program.get_args());
        for (name, value) in program.get_envs() {
            match value {
                Some(value) => command.env(name, value),
                None => command.env_remove(name),
            };
        }
        command
    }

    /// Nothing passes any more.
    ///
    /// # Errors
    /// What `ip` says.
    pub fn pull(&self) -> Result<(), String> {
        ip(&format!("link set {} down", self.namespace)).map(drop)
    }

    /// Everything passes again.
    ///
    /// # Errors
    /// What `ip` says.
    pub fn plug(&self) -> Result<(), String> {
        ip(&format!("link set {} up", self.namespace)).map(drop)
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        take_away(&self.namespace);
    }
}

/// An interface's name has 15 characters at most, and a process' number up to 7.
const PREFIX: &str = "ptz-";

/// Processes that were killed left theirs.
fn take_away_what_was_left() {
    for left in ip("netns list").unwrap_or_default().lines() {
        let name = left.split_whitespace().next().unwrap_or_default();
        let process = name.strip_prefix(PREFIX).and_then(|rest| rest.split('-').next());
        if process.is_some_and(|process| !Path::new("/proc").join(process).exists()) {
            take_away(name);
        }
    }
}

fn take_away(namespace: &str) {
    // One end of the link takes the other with it. What was never made cannot be taken away.
    let _ = ip(&format!("link delete {namespace}"));
    let _ = ip(&format!("netns delete {namespace}"));
    let _ = iptables(&format!("--delete INPUT --in-interface {namespace} --jump {namespace}"));
    let _ = iptables(&format!("--flush {namespace}"));
    let _ = iptables(&format!("--delete-chain {namespace}"));
}

fn ip(arguments: &str) -> Result<String, String> {
    run("ip", arguments)
}

fn iptables(arguments: &str) -> Result<String, String> {
    run("iptables", &format!("--wait {arguments}"))
}

fn run(program: &str, arguments: &str) -> Result<String, String> {
    let done = Command::new(program).args(arguments.split(' ')).output();
    let done = done.map_err(|err| format!("{program} cannot be run: {err}"))?;
    let said = || format!("{program} {arguments}: {}", String::from_utf8_lossy(&done.stderr).trim());
    if done.status.success() { Ok(String::from_utf8_lossy(&done.stdout).into_owned()) } else { Err(said()) }
}
