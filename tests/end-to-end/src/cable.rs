// SPDX-License-Identifier: MPL-2.0

//! A cable between an application and its camera that can be pulled: packets are lost, and nobody is told.

use std::net::Ipv4Addr;
use std::process::Command;

/// A network namespace for an application, and its only cable; both go when this is dropped.
pub struct Cable {
    /// Also the name of its end on the camera's side.
    namespace: String,
    /// The third byte of its addresses.
    number: u8,
}

impl Cable {
    /// Lays one, different from all others of this number.
    ///
    /// # Errors
    /// What `ip` says where this process may not: it takes root and iproute2.
    pub fn lay(number: u8) -> Result<Self, String> {
        let cable = Self { namespace: format!("ptz{}-{number}", std::process::id()), number };
        let Self { namespace, .. } = &cable;
        let (here, there) = (cable.camera_side(), Ipv4Addr::new(10, 255, number, 2));
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
        Ipv4Addr::new(10, 255, self.number, 1)
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
        ip(&format!("link set {} down", self.namespace))
    }

    /// Everything passes again.
    ///
    /// # Errors
    /// What `ip` says.
    pub fn plug(&self) -> Result<(), String> {
        ip(&format!("link set {} up", self.namespace))
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        // One end of the link takes the other with it. What was never made cannot be taken away.
        let _ = ip(&format!("link delete {}", self.namespace));
        let _ = ip(&format!("netns delete {}", self.namespace));
    }
}

fn ip(arguments: &str) -> Result<(), String> {
    let done = Command::new("ip").args(arguments.split(' ')).output();
    let done = done.map_err(|err| format!("ip cannot be run: {err}"))?;
    let said = || format!("ip {arguments}: {}", String::from_utf8_lossy(&done.stderr).trim());
    if done.status.success() { Ok(()) } else { Err(said()) }
}
