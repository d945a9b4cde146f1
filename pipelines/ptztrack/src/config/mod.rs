// SPDX-License-Identifier: MPL-2.0

//! The file of cameras: what is in it, read whole before anything starts, every mistake named with its line.

mod again;
mod camera;
mod choices;
mod credentials;
mod handover;
mod mqtt;
mod problem;
mod properties;
mod protocol;
mod restream;
mod store;
mod table;
pub mod units;
mod zone;

use std::cell::RefCell;
use std::net::SocketAddr;
use std::path::Path;

use toml::de::DeTable;

pub use again::Again;
pub use camera::{CameraSettings, RTSP_PORT, Recording, size};
pub use choices::{Codec, Isolation, Kind};
pub use credentials::{Credentials, Secret};
pub use handover::HandOver;
pub use mqtt::Mqtt;
pub use problem::Problems;
pub use protocol::{Protocol, Watchdogs};
pub use restream::Restream;
pub use store::{Kept, Store};
use table::{Source, Table};
pub use zone::Zone;

/// An example with everything in it, commented.
pub const EXAMPLE: &str = include_str!("example.toml");

/// All that the file says.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    pub cameras: Vec<CameraSettings>,
    pub http: Option<Http>,
    /// Or why there is none yet.
    pub mqtt: Result<Option<Mqtt>, String>,
    pub hand_over: Vec<HandOver>,
    pub store: Store,
    /// By whose names events are asked for.
    pub zones: Vec<Zone>,
    /// Or why there is none yet.
    pub restream: Result<Option<Restream>, String>,
}

/// Why a file is of no use, in words.
#[derive(Debug)]
pub enum NotLoaded {
    /// It may be readable later.
    Unreadable(String),
    /// It is not as it should be.
    Mistaken(String),
}

impl NotLoaded {
    pub fn reason(self) -> String {
        match self {
            Self::Unreadable(reason) | Self::Mistaken(reason) => reason,
        }
    }
}

/// The page, `/metrics` and `/healthz`.
#[derive(Debug, Clone, PartialEq)]
pub struct Http {
    pub listen: SocketAddr,
    /// Names by which the page may be asked for, besides its address.
    pub hosts: Vec<String>,
    /// Or why they cannot be had yet: until then it lets nobody in.
    pub credentials: Result<Option<Credentials>, String>,
}

impl Config {
    /// Reads a file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn load(path: &Path) -> Result<Self, NotLoaded> {
        let text = std::fs::read_to_string(path)
            .map_err(|err| NotLoaded::Unreadable(format!("{}: {err}", path.display())))?;
        Self::parse(&text).map_err(|problems| NotLoaded::Mistaken(format!("{}:\n{problems}", path.display())))
    }

    /// Reads the text of a file. GStreamer has to be initialised, as it is asked for the properties of elements.
    ///
    /// # Errors
    /// Every mistake.
    pub fn parse(text: &str) -> Result<Self, Problems> {
        let source = Source { text, problems: RefCell::default() };
        let (root, errors) = DeTable::parse_recoverable(text);
        for error in &errors {
            source.wrong(error.span().unwrap_or(0..0), error.message());
        }
        let config = errors.is_empty().then(|| Self::read(Table::new(&source, root.get_ref(), 0..0)));
        let problems = source.problems.into_inner().sorted();
        config.filter(|_| problems.is_empty()).ok_or(problems)
    }

    /// What this machine has not got, a line for each camera and each service that cannot start without, and for a certificate that
    /// is of no use.
    ///
    /// # Errors
    /// Those lines.
    pub fn check_machine(&self) -> Result<(), String> {
        let lack = |camera: &CameraSettings| {
            let reason = camera.no_password.clone().or_else(|| camera.lacks())?;
            Some(format!("camera `{}`: {reason}", camera.name))
        };
        let restream = self.restream.as_ref().ok().and_then(Option::as_ref);
        let certificate = restream.and_then(|restream| restream.tls.as_ref());
        let useless = certificate.and_then(|certificate| certificate.load().err());
        let useless = useless.map(|reason| format!("[restream]: {reason}"));
        let waiting = self.waiting().into_iter().map(|(table, reason)| format!("[{table}]: {reason}"));
        let lacks: Vec<String> = self.cameras.iter().filter_map(lack).chain(waiting).chain(useless).collect();
        if lacks.is_empty() { Ok(()) } else { Err(lacks.join("\n")) }
    }

    /// The services that are wanted and cannot be started yet, by their tables, and why.
    pub fn waiting(&self) -> Vec<(&'static str, &str)> {
        let http = self.http.as_ref().and_then(|http| http.credentials.as_ref().err());
        let (mqtt, restream) = (self.mqtt.as_ref().err(), self.restream.as_ref().err());
        let all = [("http", http), ("mqtt", mqtt), ("restream", restream)];
        all.into_iter().filter_map(|(table, reason)| Some((table, reason?.as_str()))).collect()
    }

    /// The same with the page there, where somewhere is said.
    ///
    /// # Errors
    /// Where others would get at it without a password.
    pub fn with_page_at(mut self, listen: Option<SocketAddr>) -> Result<Self, String> {
        let Some(listen) = listen else { return Ok(self) };
        let (hosts, credentials) =
            self.http.map_or((Vec::new(), Ok(None)), |http| (http.hosts, http.credentials));
        let http = Http { listen, hosts, credentials };
        http.check()?;
        self.http = Some(http);
        Ok(self)
    }

    /// Whether a camera that is not among these calls one of these, or is called by one.
    pub fn hands_over_to_others(&self) -> bool {
        let ours = |name: &String| self.cameras.iter().any(|camera| camera.name == *name);
        self.hand_over.iter().any(|wish| wish.calls.iter().any(|called| ours(called) != ours(&wish.from)))
    }

    fn read(mut root: Table) -> Self {
        let http = root.table("http").map(Http::read);
        let mqtt = root.table("mqtt").and_then(Mqtt::read).transpose();
        let store = root.table("events").map(Store::read).unwrap_or_default();
        let restream = root.table("restream").map(Restream::read).transpose();
        let cameras = root.tables("camera");
        if cameras.is_empty() {
            root.wrong("there is no camera: [camera.door] begins one that is called door");
        }
        let read =
            |(name, table)| Some(CameraSettings { kept: store.what, ..CameraSettings::read(name, table)? });
        let mut cameras: Vec<_> = cameras.into_iter().filter_map(read).collect();
        let hand_over = HandOver::read_all(&mut root, &cameras);
        for camera in &mut cameras {
            // In this process it is seen who is where, and the camera need not begin anew where this changes.
            camera.hands_over = camera.isolation == Isolation::Process
                && hand_over.iter().any(|hand_over| hand_over.concerns(&camera.name));
        }
        let zones = Zone::read_all(&mut root, &cameras);
        root.no_more();
        Self { cameras, http, mqtt, hand_over, store, zones, restream }
    }
}

impl Http {
    fn read(mut table: Table) -> Self {
        let listen = table.get_with("listen", "an address and a port, as \"127.0.0.1:9100\"", |value| {
            value.as_str()?.parse().ok()
        });
        let hosts = table.get("hosts").unwrap_or_default();
        let credentials = credentials::read_for_visitors(&mut table);
        let this = Self { listen: listen.unwrap_or(Self::LISTEN), hosts, credentials };
        if let Err(reason) = this.check() {
            table.wrong(reason);
        }
        table.no_more();
        this
    }

    /// Where it listens by default.
    pub const LISTEN: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 9100);

    /// Nobody elsewhere sees and steers without a password.
    pub fn check(&self) -> Result<(), String> {
        if self.listen.ip().is_loopback() || self.credentials != Ok(None) {
            return Ok(());
        }
        let listen = self.listen;
        Err(format!(
            "to listen on {listen}, beyond this machine, it needs `user` and `password-file` in [http]"
        ))
    }
}

#[cfg(test)]
mod tests;
