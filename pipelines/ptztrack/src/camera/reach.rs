// SPDX-License-Identifier: MPL-2.0

//! Whether a camera accepts connections, asked before a pipeline is built for it.
//!
//! A connection that `souphttpsrc` gives up before the camera has answered costs a file descriptor for good: libsoup keeps
//! what runs it. A camera that hangs, or is behind a cable that was pulled, would cost one with every try.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use url::Url;

use crate::config::{CameraSettings, Codec};

/// As long as the pipeline's own source waits.
const PATIENCE: Duration = Duration::from_secs(1);
/// Of RTSP, where an address has none (RFC 7826, section 4.2).
const RTSP_PORT: u16 = 554;

/// Says why the camera does not accept a connection for its pictures.
///
/// # Errors
/// That reason.
pub fn check(camera: &CameraSettings) -> Result<(), String> {
    // A pipeline of one's own may have its pictures from elsewhere, and a proxy is asked instead of the camera.
    if camera.pipeline.is_some() || camera.codec == Codec::Mjpeg && std::env::var_os("http_proxy").is_some() {
        return Ok(());
    }
    let address = if camera.codec == Codec::Mjpeg { &camera.address } else { &camera.rtsp };
    let (host, port) = endpoint(address).ok_or_else(|| format!("{address} names no host"))?;
    let said = |err: std::io::Error| format!("{host}, port {port}: {err}");
    let addresses = (host.as_str(), port).to_socket_addrs().map_err(said)?;
    let mut last = std::io::Error::other("the name has no address");
    for address in addresses {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => return Ok(()),
            Err(err) => last = err,
        }
    }
    Err(said(last))
}

/// Host and port of an address; `None` where it has no host.
fn endpoint(address: &str) -> Option<(String, u16)> {
    let url = Url::parse(address).ok()?;
    let port = url.port_or_known_default().unwrap_or(RTSP_PORT);
    Some((url.host_str()?.trim_matches(['[', ']']).to_owned(), port))
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
            ("rtsp://camera.example/stream", "camera.example", 554),
        ] {
            assert_eq!(endpoint(address), Some((host.to_owned(), port)), "{address}");
        }
    }
}
