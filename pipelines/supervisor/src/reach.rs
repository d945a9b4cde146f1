// SPDX-License-Identifier: MPL-2.0

//! Whether somebody accepts connections, asked before a pipeline is built for it.
//!
//! A connection that `souphttpsrc` gives up before it is accepted costs a file descriptor for good: libsoup keeps what runs
//! it. A camera that hangs, or is behind a cable that was pulled, would cost one with every other try.

use std::error::Error;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use gst::prelude::*;
use session::http::without_user_info;
use url::Url;

use crate::video::Failure;

/// As long as a pipeline's own source waits.
const PATIENCE: Duration = Duration::from_secs(1);
/// Of RTSP, where an address has none (RFC 7826, section 4.2).
const RTSP_PORT: u16 = 554;
/// What a person can do about nothing coming from an address.
pub const ADVICE: &str = "Check the address, the cable and the camera";

/// Connects to the host of an address, and leaves it at that.
///
/// # Errors
/// [`Failure`] where nobody accepts a connection there, and another where nobody ever will, as it is no address.
pub fn check(address: &str) -> Result<(), Box<dyn Error>> {
    let (host, port) = endpoint(address).ok_or_else(|| {
        let shown = without_user_info(address);
        format!("`{shown}` names no host: an address begins with http:// or https://")
    })?;
    let said = |err: std::io::Error| Failure::new(format!("{host}, port {port}: {err}. {ADVICE}"));
    let addresses = (host.as_str(), port).to_socket_addrs().map_err(said)?;
    let mut last = std::io::Error::other("the name has no address");
    for address in addresses {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => return Ok(()),
            Err(err) => last = err,
        }
    }
    Err(said(last).into())
}

/// Connects to whom `souphttpsrc` asks for an address: a proxy, where there is one.
///
/// # Errors
/// Those of [`check`].
pub fn check_http(address: &str, proxy: Option<String>) -> Result<(), Box<dyn Error>> {
    match proxy.filter(|proxy| !proxy.is_empty()) {
        Some(proxy) if proxy.contains("://") => check(&proxy),
        // It is often given without.
        Some(proxy) => check(&format!("http://{proxy}")),
        None => check(address),
    }
}

/// Connects to whom each `souphttpsrc` of a pipeline asks.
///
/// # Errors
/// Those of [`check`].
pub fn check_sources(pipeline: &gst::Pipeline) -> Result<(), Box<dyn Error>> {
    for element in pipeline.iterate_recurse().into_iter().flatten() {
        if element.factory().is_some_and(|factory| factory.name() == "souphttpsrc")
            && let Some(address) = element.property::<Option<String>>("location")
        {
            check_http(&address, element.property("proxy"))?;
        }
    }
    Ok(())
}

/// Host and port of an address; `None` where it has no host.
fn endpoint(address: &str) -> Option<(String, u16)> {
    let url = Url::parse(address).ok()?;
    let port = url.port_or_known_default().unwrap_or(RTSP_PORT);
    Some((url.host_str()?.trim_matches(['[', ']']).to_owned(), port))
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

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

    #[test]
    fn behind_a_proxy_it_is_the_proxy_that_is_asked() {
        let proxy = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = proxy.local_addr().unwrap().to_string();
        let camera = "http://127.0.0.1:1";
        for proxy in [address.clone(), format!("http://{address}")] {
            check_http(camera, Some(proxy)).unwrap();
        }
        drop(proxy);
        let said = |proxy| check_http(camera, proxy).unwrap_err().to_string();
        assert!(said(Some(address.clone())).contains(&address.replace(':', ", port ")));
        for none in [None, Some(String::new())] {
            assert!(said(none).starts_with("127.0.0.1, port 1: "));
        }
    }

    /// Nobody who is not there may come to be there, at what is no address.
    #[test]
    fn what_is_no_address_is_no_failure_that_may_pass() {
        let passes = |address| check(address).unwrap_err().is::<Failure>();
        assert!(passes("http://127.0.0.1:1"));
        for address in ["127.0.0.1:1", "localhost:1", "http://"] {
            assert!(!passes(address), "{address}");
        }
    }
}
