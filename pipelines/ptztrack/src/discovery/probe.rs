// SPDX-License-Identifier: MPL-2.0

//! WS-Discovery over UDP.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::time::Duration;

use futures_util::future::join_all;
use onvif::Announcement;
use socket2::{Domain, Protocol, Socket, Type};
use tokio::net::UdpSocket;
use tokio::time::{Instant, timeout_at};

/// Longest answer; one that is longer is cut by the network in any case.
const LONGEST: usize = 65_536;

/// Who answers with any number of cameras has no more than these taken.
pub const MOST: usize = 512;

/// Where ONVIF has its device service, unless a camera says otherwise.
const DEVICE_SERVICE: &str = "/onvif/device_service";

/// A camera that answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Heard {
    /// From where.
    host: IpAddr,
    /// Port and path of its device service, by its own word.
    port: u16,
    path: String,
    pub name: String,
}

impl Heard {
    /// Where to be told from `sender`; the host that a camera tells is often another. `None` where it tells no address by HTTP.
    fn of(announcement: &Announcement, sender: IpAddr) -> Option<Self> {
        let (port, path) = announcement.addresses.iter().find_map(|address| {
            let rest = address.strip_prefix("http://")?;
            let (host, path) = rest.find('/').map_or((rest, DEVICE_SERVICE), |path| rest.split_at(path));
            let port = host.rsplit_once(':').filter(|(_, port)| !port.contains(']'));
            let port = port.map_or(Some(80), |(_, port)| port.parse().ok())?;
            let is_path = !path.contains(|c: char| c.is_control() || c.is_whitespace());
            is_path.then(|| (port, path.to_owned()))
        })?;
        Some(Self { host: sender, port, path, name: announcement.name.clone() })
    }

    /// Whether it answered from there.
    pub fn is_of(&self, host: IpAddr) -> bool {
        self.host == host
    }

    /// Its HTTP server.
    pub fn origin(&self) -> String {
        let host = SocketAddr::new(self.host, self.port);
        if self.port == 80 { format!("http://{}", self.host) } else { format!("http://{host}") }
    }

    /// Its device service.
    pub fn location(&self) -> String {
        format!("{}{}", self.origin(), self.path)
    }

    /// What to type to follow with it.
    pub fn address(&self) -> String {
        if self.path == DEVICE_SERVICE { self.origin() } else { self.location() }
    }
}

/// Who answers on any of this machine's networks within this time.
///
/// # Errors
/// Why nobody can be asked.
pub async fn probe(wait: Duration) -> Result<Vec<Heard>, String> {
    let interfaces = if_addrs::get_if_addrs().map_err(|err| format!("the network interfaces: {err}"))?;
    let own = interfaces.iter().filter_map(|interface| match interface.ip() {
        IpAddr::V4(address) => Some(address),
        IpAddr::V6(_) => None,
    });
    let asked = join_all(own.map(|address| ask_network(address, wait))).await;
    let (heard, failures): (Vec<_>, Vec<_>) = asked.into_iter().partition(Result::is_ok);
    let mut heard: Vec<Heard> = heard.into_iter().flatten().flatten().collect();
    heard.sort_by_key(|heard| (heard.host, heard.port));
    heard.dedup();
    heard.truncate(MOST);
    match failures.into_iter().find_map(Result::err) {
        Some(failure) if heard.is_empty() => Err(format!("nobody can be asked: {failure}")),
        _ => Ok(heard),
    }
}

/// Asks over the interface that has this address.
async fn ask_network(own: Ipv4Addr, wait: Duration) -> io::Result<Vec<Heard>> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    socket.set_multicast_if_v4(&own)?;
    socket.set_nonblocking(true)?;
    socket.bind(&SocketAddr::from((own, 0)).into())?;
    listen(UdpSocket::from_std(socket.into())?, onvif::GROUP.into(), wait).await
}

/// Asks there, twice as a datagram may be lost, and hears who answers that, and nobody else: so many at most.
pub async fn listen(socket: UdpSocket, whom: SocketAddr, wait: Duration) -> io::Result<Vec<Heard>> {
    let question = onvif::probe();
    let end = Instant::now() + wait;
    let mut heard = Vec::new();
    let mut answer = vec![0; LONGEST];
    for until in [end - wait / 2, end] {
        socket.send_to(question.message.as_bytes(), whom).await?;
        while let Ok(received) = timeout_at(until, socket.recv_from(&mut answer)).await {
            // Refused by a host that has nobody there, for one.
            let Ok((length, sender)) = received else { break };
            let text = String::from_utf8_lossy(answer.get(..length).unwrap_or_default());
            let announcements = onvif::parse_announcements(&text);
            let answers = announcements.iter().filter(|camera| camera.answers(&question.id));
            let cameras = answers.filter_map(|camera| Heard::of(camera, sender.ip()));
            for camera in cameras {
                if heard.len() < MOST && !heard.contains(&camera) {
                    heard.push(camera);
                }
            }
        }
    }
    Ok(heard)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_is_where_its_answer_comes_from() {
        let heard = |addresses: &[&str]| {
            let addresses = addresses.iter().map(|&address| address.to_owned()).collect();
            let announcement = Announcement { addresses, name: "Door".to_owned(), ..Announcement::default() };
            let heard = Heard::of(&announcement, IpAddr::from([10, 0, 0, 7]))?;
            Some((heard.address(), heard.location()))
        };
        let is = |address: &str, location: &str| Some((address.to_owned(), location.to_owned()));
        let usual = is("http://10.0.0.7", "http://10.0.0.7/onvif/device_service");
        assert_eq!(heard(&["https://a/", "http://192.168.1.1/onvif/device_service"]), usual);
        assert_eq!(heard(&["http://192.168.1.1"]), usual);
        let other = "http://10.0.0.7:8899/onvif/device";
        assert_eq!(heard(&["http://[fe80::1]:8899/onvif/device"]), is(other, other));
        assert_eq!(heard(&["ftp://a/", "http://a:x/", "http://a/\u{1b}[2J", "http://a/b c"]), None);
    }
}
