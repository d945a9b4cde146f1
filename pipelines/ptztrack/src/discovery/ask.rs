// SPDX-License-Identifier: MPL-2.0

//! Asks one camera what it is spoken to by.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

use onvif::VideoStream;
use session::http::{
    Authentication, ClientSettings, Credentials, Location, Secret, Trust, without_user_info,
};
use session::{Client, Error, Query, Request};
use tokio::net::{UdpSocket, lookup_host};

use super::probe::listen;
use crate::config::{self, Protocol};

/// Longest wait for one answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// What was found at an address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    pub protocol: Protocol,
    /// Where the camera is, as the file of cameras has it.
    pub address: String,
    /// Its video streams, where it tells them.
    pub streams: Vec<VideoStream>,
}

/// Finds out what the camera at an address, or of a host, is spoken to by: VAPIX is asked for first, then ONVIF, wherever the
/// camera says that it has it; or only `wanted`.
///
/// # Errors
/// Why it cannot be followed with, in words.
pub async fn ask(
    address: &str,
    wanted: Option<Protocol>,
    credentials: Option<&config::Credentials>,
) -> Result<Found, String> {
    let address = with_scheme(address);
    let mut refusals = Vec::new();
    if wanted != Some(Protocol::Onvif) {
        match ask_vapix(&address, credentials).await {
            Ok(()) => return Ok(Found { protocol: Protocol::Vapix, address, streams: Vec::new() }),
            Err(err) if err.is_final() || matches!(err, Error::Location { .. }) => {
                return Err(sentence(&address, &err));
            }
            Err(err) => refusals.push((Protocol::Vapix, err)),
        }
    }
    if wanted != Some(Protocol::Vapix) {
        match ask_onvif(&address, credentials).await {
            Ok(streams) => return Ok(Found { protocol: Protocol::Onvif, address, streams }),
            Err(err) if err.is_final() => return Err(sentence(&address, &err)),
            Err(err) => refusals.push((Protocol::Onvif, err)),
        }
        for elsewhere in told_by(&address).await {
            match ask_onvif(&elsewhere, credentials).await {
                Ok(streams) => return Ok(Found { protocol: Protocol::Onvif, address: elsewhere, streams }),
                Err(err) if err.is_final() => return Err(sentence(&elsewhere, &err)),
                Err(err) => refusals.push((Protocol::Onvif, err)),
            }
        }
    }
    Err(format!("{} is not a usable camera:{}", without_user_info(&address), told(&refusals)))
}

/// Why, by each protocol; once where it is the same.
fn told(refusals: &[(Protocol, Error)]) -> String {
    match refusals {
        [(_, first), (_, second)] if first.to_string() == second.to_string() => format!(" {first}"),
        _ => refusals.iter().map(|(protocol, err)| format!("\n  by {}: {err}", protocol.name())).collect(),
    }
}

fn sentence(address: &str, err: &Error) -> String {
    let advice = match err {
        Error::CredentialsMissing => {
            "Say who you are by --user, with the password in the environment variable CAMERA_PASSWORD, or by --password-file."
        }
        Error::BadCredentials { .. } => {
            "Check both; nothing more was tried, so that the account is not locked. Some cameras have users of their own for ONVIF: --protocol onvif asks as one of these only."
        }
        _ => err.advice(),
    };
    format!("{}: {err}. {advice}", without_user_info(address))
}

/// Host names and bare addresses are asked by HTTP.
fn with_scheme(address: &str) -> String {
    let address = address.trim_end_matches('/');
    match address {
        _ if address.contains("://") => address.to_owned(),
        _ if address.parse::<Ipv6Addr>().is_ok() => format!("http://[{address}]"),
        _ => format!("http://{address}"),
    }
}

/// Whether who is asked there may be asked by plain HTTP.
fn is_plain(address: &str) -> bool {
    address.get(..7).is_some_and(|scheme| scheme.eq_ignore_ascii_case("http://"))
}

fn settings(
    location: &str,
    channel: &str,
    credentials: Option<&config::Credentials>,
) -> Result<ClientSettings, Error> {
    let credentials = credentials.map(|credentials| Credentials {
        user: credentials.user.clone(),
        password: Secret::new(credentials.password.reveal()),
    });
    Ok(ClientSettings {
        location: Location::parse(location)?.0,
        channel: channel.to_owned(),
        credentials,
        authentication: Authentication::Auto,
        timeout: PATIENCE,
        trust: Trust::System,
    })
}

async fn ask_vapix(address: &str, credentials: Option<&config::Credentials>) -> Result<(), Error> {
    let mut client = vapix::Client::new(settings(address, "1", credentials)?)?;
    match client.exchange(&Request::Query(Query::Position)).await {
        // In VAPIX' own words: it is spoken there.
        Err(Error::Camera(_)) => Ok(()),
        other => other.map(drop),
    }
}

/// Whether VAPIX is spoken there, as far as can be told without logging in.
pub async fn has_vapix(address: &str) -> bool {
    matches!(ask_vapix(address, None).await, Ok(()) | Err(Error::CredentialsMissing))
}

/// What speaks ONVIF to a camera.
///
/// # Errors
/// Where that is no address.
pub fn onvif_client(
    location: &str,
    credentials: Option<&config::Credentials>,
) -> Result<onvif::Client, Error> {
    onvif::Client::new(settings(location, "", credentials)?)
}

/// The streams of a camera that turns.
async fn ask_onvif(
    address: &str,
    credentials: Option<&config::Credentials>,
) -> Result<Vec<VideoStream>, Error> {
    let mut client = onvif_client(address, credentials)?;
    if !client.has_ptz().await? {
        return Err(Error::NoPtz);
    }
    client.streams().await
}

/// Where else its host says that it has ONVIF: many have it at another port. Nowhere, where that would be by plain HTTP in place of what
/// was asked for, or where a port was said: another camera may be at another.
async fn told_by(address: &str) -> Vec<String> {
    let rest = address.split_once("://").map_or(address, |(_, rest)| rest);
    let host = rest.split('/').next().unwrap_or(rest);
    let says_port = host.rsplit_once(':').is_some_and(|(_, port)| !port.contains(']'));
    if !is_plain(address) || says_port {
        return Vec::new();
    }
    let found = lookup_host(format!("{host}:{}", onvif::GROUP.port())).await;
    let Some(whom) = found.ok().and_then(|mut found| found.find(SocketAddr::is_ipv4)) else {
        return Vec::new();
    };
    let Ok(socket) = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).await else { return Vec::new() };
    let mut heard = listen(socket, whom, PATIENCE / 3).await.unwrap_or_default();
    // Nobody else is heard: whoever answers is asked next, by who we are.
    heard.retain(|heard| heard.is_of(whom.ip()));
    let mut addresses: Vec<_> = heard.iter().map(super::Heard::address).collect();
    addresses.dedup();
    addresses.retain(|elsewhere| elsewhere != address);
    addresses
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;

    use socket2::{Domain, Socket, Type};

    use super::*;

    #[test]
    fn what_is_the_same_by_both_protocols_is_told_once() {
        let [no_ptz, silent] = [Error::NoPtz, Error::Timeout(PATIENCE)];
        let vapix = (Protocol::Vapix, silent.clone());
        assert_eq!(told(&[vapix.clone(), (Protocol::Onvif, silent.clone())]), format!(" {silent}"));
        assert_eq!(told(std::slice::from_ref(&vapix)), format!("\n  by VAPIX: {silent}"));
        let both = told(&[vapix, (Protocol::Onvif, no_ptz.clone())]);
        assert_eq!(both, format!("\n  by VAPIX: {silent}\n  by ONVIF: {no_ptz}"));
    }

    #[test]
    fn a_host_is_enough() {
        for (typed, asked) in [
            ("192.168.0.90", "http://192.168.0.90"),
            ("camera.local/", "http://camera.local"),
            ("2001:db8::1", "http://[2001:db8::1]"),
            ("camera:8080", "http://camera:8080"),
            ("https://camera", "https://camera"),
        ] {
            assert_eq!(with_scheme(typed), asked);
        }
    }

    /// Where a host of this machine is asked; a virtual camera beside it listens at all addresses.
    fn asked_at(host: [u8; 4]) -> std::net::UdpSocket {
        let socket = Socket::new(Domain::IPV4, Type::DGRAM, None).unwrap();
        socket.set_reuse_address(true).unwrap();
        socket.set_nonblocking(true).unwrap();
        socket.bind(&SocketAddr::from((host, onvif::GROUP.port())).into()).unwrap();
        socket.into()
    }

    /// Whoever hears the question can answer it, too; and who does not can send what looks as if its own host had sent it.
    #[tokio::test]
    async fn where_else_it_is_is_told_by_its_own_host() {
        let answer = |id: &str, port: u16| {
            format!(
                "<e:Envelope xmlns:e='x' xmlns:d='y'><e:Header><e:RelatesTo>{id}</e:RelatesTo></e:Header><e:Body><d:ProbeMatches>\
                 <d:ProbeMatch><d:XAddrs>http://camera:{port}/onvif/device_service</d:XAddrs></d:ProbeMatch></d:ProbeMatches>\
                 </e:Body></e:Envelope>"
            )
        };
        let camera = UdpSocket::from_std(asked_at([127, 0, 0, 2])).unwrap();
        let stranger = UdpSocket::bind("127.0.0.3:0").await.unwrap();
        tokio::spawn(async move {
            let mut question = [0; 4096];
            while let Ok((length, asking)) = camera.recv_from(&mut question).await {
                let question = String::from_utf8_lossy(&question[..length]);
                let id = question.split("MessageID>").nth(1).and_then(|rest| rest.split('<').next()).unwrap();
                stranger.send_to(answer(id, 8001).as_bytes(), asking).await.unwrap();
                camera.send_to(answer(&onvif::probe().id, 8003).as_bytes(), asking).await.unwrap();
                camera.send_to(answer(id, 8002).as_bytes(), asking).await.unwrap();
            }
        });
        assert_eq!(told_by("http://127.0.0.2").await, ["http://127.0.0.2:8002"]);
    }

    /// Who answers the question is logged in to by plain HTTP.
    #[tokio::test]
    async fn who_is_asked_by_https_is_asked_nowhere_else() {
        let camera = asked_at([127, 0, 0, 4]);
        let question = || camera.recv_from(&mut [0; 4096]).map_err(|err| err.kind());
        // Nobody is at this port.
        for address in ["https://127.0.0.4:1", "HTTPS://127.0.0.4:1"] {
            assert!(ask(address, None, None).await.is_err());
            assert_eq!(question(), Err(ErrorKind::WouldBlock), "{address}");
        }
        // Nor at the usual one, nor is another one wanted where one is said.
        assert!(ask("http://127.0.0.4:1", None, None).await.is_err());
        assert_eq!(question(), Err(ErrorKind::WouldBlock));
        assert!(ask("http://127.0.0.4", None, None).await.is_err());
        assert!(question().is_ok());
    }
}
