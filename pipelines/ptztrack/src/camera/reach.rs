// SPDX-License-Identifier: MPL-2.0

//! Whether a camera accepts connections, asked before a pipeline is built for it.
//!
//! A connection that `souphttpsrc` gives up before the camera has answered costs a file descriptor for good: libsoup keeps
//! what runs it. A camera that hangs, or is behind a cable that was pulled, would cost one with every try.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use crate::config::{CameraSettings, Codec};

/// As long as the pipeline's own source waits.
const PATIENCE: Duration = Duration::from_secs(1);

/// Says why the camera does not accept a connection for its pictures.
///
/// # Errors
/// That reason.
pub fn check(camera: &CameraSettings) -> Result<(), String> {
    // A pipeline of one's own may have its pictures from elsewhere, and a proxy is asked instead of the camera.
    if camera.pipeline.is_some() || camera.codec == Codec::Mjpeg && std::env::var_os("http_proxy").is_some() {
        return Ok(());
    }
    let (host, port) = endpoint(if camera.codec == Codec::Mjpeg { &camera.address } else { &camera.rtsp });
    let said = |err: std::io::Error| format!("{host}, port {port}: {err}");
    let addresses = (host, port).to_socket_addrs().map_err(said)?;
    let mut last = std::io::Error::other("the name has no address");
    for address in addresses {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => return Ok(()),
            Err(err) => last = err,
        }
    }
    Err(said(last))
}

/// Host and port of an address, which was checked as it was read.
fn endpoint(address: &str) -> (&str, u16) {
    let (scheme, rest) = address.split_once("://").unwrap_or(("", address));
    let default = match scheme {
        "https" => 443,
        "rtsp" => 554,
        _ => 80,
    };
    let (host, port) = match rest.rsplit_once(':') {
        Some((host, port)) if !port.contains(']') => (host, port.parse().unwrap_or(default)),
        _ => (rest, default),
    };
    (host.trim_matches(['[', ']']), port)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_and_port_are_those_of_the_address() {
        for (address, host, port) in [
            ("http://10.0.0.1", "10.0.0.1", 80),
            ("https://camera.example", "camera.example", 443),
            ("http://10.0.0.1:8080", "10.0.0.1", 8080),
            ("http://[2001:db8::1]", "2001:db8::1", 80),
            ("rtsp://[2001:db8::1]:5540", "2001:db8::1", 5540),
        ] {
            assert_eq!(endpoint(address), (host, port), "{address}");
        }
    }
}
