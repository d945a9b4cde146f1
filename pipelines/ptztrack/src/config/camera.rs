// SPDX-License-Identifier: MPL-2.0

use std::path::PathBuf;
use std::time::Duration;

use gst::prelude::*;
use pipeline_supervisor::video::rtsp_host;
use serde::{Deserialize, Serialize};
use session::http::{Authentication, Trust};

use super::choices::{Codec, Isolation, Kind};
use super::credentials::{self, Credentials};
use super::properties::{self, ELEMENTS, Property};
use super::protocol::{Protocol, Watchdogs};
use super::store::Kept;
use super::table::{Read, Table, whole};
use super::units;

/// Packages of Debian that ours does not depend on.
const BAD: &str = "gstreamer1.0-plugins-bad";
const LIBAV: &str = "gstreamer1.0-libav";
const UGLY: &str = "gstreamer1.0-plugins-ugly";

/// One camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraSettings {
    pub name: String,
    pub kind: Kind,
    /// What it is spoken to by.
    pub protocol: Protocol,
    /// `http://` or `https://`; with ONVIF there may be a path, of its device service.
    pub address: String,
    /// `rtsp://` or `rtsps://`, no path, where it is said.
    pub rtsp: Option<String>,
    pub codec: Codec,
    /// Width and height in pixels; the camera's own where it is not said.
    pub size: Option<(u32, u32)>,
    /// Pictures per second; the camera's own where it is not said.
    pub rate: Option<u32>,
    pub credentials: Option<Credentials>,
    /// Why the password cannot be had yet.
    pub no_password: Option<String>,
    pub properties: Vec<Property>,
    pub recording: Option<Recording>,
    /// A pipeline of one's own instead of ours, as `gst-launch-1.0` takes it.
    pub pipeline: Option<String>,
    /// In a window, too.
    pub show: bool,
    pub isolation: Isolation,
    /// It has a process of its own, which is to tell whom it sees: people are handed over from it or to it.
    pub hands_over: bool,
    /// What is kept of those who were followed.
    pub kept: Option<Kept>,
}

/// What is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recording {
    pub folder: PathBuf,
    /// Length of one file.
    pub segment: Duration,
    /// How long files are kept.
    pub keep: Option<Duration>,
    /// How many bytes of files are kept.
    pub keep_bytes: Option<u64>,
    /// With what was seen drawn in, instead of the camera's own stream.
    pub overlay: bool,
}

impl CameraSettings {
    /// One at an address, with everything else as it is by default.
    ///
    /// # Errors
    /// Where that is no address.
    pub fn at(name: &str, protocol: Protocol, address: &str) -> Result<Self, String> {
        let address = address.trim_end_matches('/');
        let (server, path) = split_path(address);
        if host(server).is_none() || !path.is_empty() && protocol == Protocol::Vapix {
            return Err(format!("`{address}` is not {ADDRESS}"));
        }
        let camera = Self { protocol, address: address.to_owned(), ..Self::without_address(name) };
        Ok(Self { codec: Codec::usual(protocol), ..camera })
    }

    /// Where its RTSP is: as it is said; else on its own host, at `port`.
    pub fn rtsp_server(&self, port: u16) -> String {
        let host = host(split_path(&self.address).0).unwrap_or_default();
        match &self.rtsp {
            Some(rtsp) => rtsp.clone(),
            // Who asks for the one to be encrypted does not want the other in clear.
            None if self.address.starts_with("https") => format!("rtsps://{host}:{RTSPS_PORT}"),
            None => format!("rtsp://{host}:{port}"),
        }
    }

    /// Has the watchdog of its protocol stop the camera, unless the file names another.
    pub fn use_watchdog(&mut self, watchdogs: &Watchdogs) {
        let Some(socket) = watchdogs.of(self.protocol) else { return };
        let (element, name) = (self.protocol.sink(), "dead-man-socket");
        if !self.properties.iter().any(|property| property.element == element && property.name == name) {
            self.properties.push(Property {
                element: element.to_owned(),
                name: name.to_owned(),
                value: format!("{socket:?}"),
            });
        }
    }

    /// What GStreamer has not got on this machine, and needs for this camera.
    pub fn lacks(&self) -> Option<String> {
        if self.pipeline.is_some() {
            return None;
        }
        let (mut needed, parser) = match self.codec {
            Codec::Mjpeg => (Vec::new(), "jpegparse"),
            Codec::Mpeg4 => (vec![("avdec_mpeg4", LIBAV)], "mpeg4videoparse"),
            Codec::H264 => (vec![("avdec_h264", LIBAV)], "h264parse"),
            Codec::H265 => (vec![("avdec_h265", LIBAV)], "h265parse"),
        };
        match &self.recording {
            Some(recording) if recording.overlay => needed.extend([("x264enc", UGLY), ("h264parse", BAD)]),
            Some(_) => needed.push((parser, BAD)),
            None => {}
        }
        let missing = |needed: &(&str, _)| gst::ElementFactory::find(needed.0).is_none();
        let (element, package) = needed.into_iter().find(missing)?;
        Some(format!("GStreamer has no element {element}; on Debian it is in the package {package}"))
    }

    /// How it may be proved who we are, and whose certificates are believed: as the sink is told, for pictures too.
    pub fn security(&self) -> (Authentication, Trust) {
        let of = |name| self.sink_property(name);
        let authentication = match of("auth") {
            Some("basic") => Authentication::Basic,
            _ => Authentication::Auto,
        };
        let trust = match (of("insecure"), of("ca-file")) {
            (Some("true"), _) => Trust::Anyone,
            (_, Some(file)) => Trust::Authority(file.into()),
            _ => Trust::System,
        };
        (authentication, trust)
    }

    /// A property of its sink, where it is set.
    pub fn sink_property(&self, name: &str) -> Option<&str> {
        let is = |property: &&Property| property.element == self.protocol.sink() && property.name == name;
        // The last one counts.
        self.properties.iter().rfind(is).map(|property| property.value.trim_matches('"'))
    }

    pub(super) fn read(name: String, mut table: Table) -> Option<Self> {
        if !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_') {
            table.wrong(format!("camera `{name}`: a name has letters, digits, `-` and `_` only"));
        }
        let address: Option<String> = table.need("address");
        let protocol = table.get("protocol").unwrap_or_default();
        let camera = address.and_then(|address| {
            let wrong = |reason| match table.value("address") {
                Some(value) => table.source.wrong(value.span(), reason),
                None => table.wrong(reason),
            };
            Self::at(&name, protocol, &address).map_err(wrong).ok()
        });
        // The rest is read all the same, so that every mistake is found at once.
        let mut camera = camera.unwrap_or_else(|| Self::without_address(&name));
        camera.kind = table.get("kind").unwrap_or_default();
        let of_rtsp = |value: &toml::de::DeValue| {
            value.as_str().filter(|text| rtsp_host(text).is_some()).map(str::to_owned)
        };
        let what = "an address such as \"rtsp://192.168.0.90:554\", or with rtsps:// and port 322";
        if let Some(rtsp) = table.get_with("rtsp", what, of_rtsp) {
            camera.rtsp = Some(rtsp.trim_end_matches('/').to_owned());
        }
        camera.codec = table.get("codec").unwrap_or(Codec::usual(protocol));
        if let Err(reason) = camera.codec.check(protocol) {
            table.wrong(reason);
        }
        if protocol == Protocol::Onvif && table.value("rate").is_some() {
            table.wrong("with ONVIF `rate` is set on the camera's own pages");
        }
        camera.size = table
            .get_with("size", "width and height in pixels, as \"640x480\"", |value| size(value.as_str()?));
        camera.rate = table.get_with("rate", "pictures per second, a whole number from 1 to 60", |value| {
            whole(value).and_then(|rate| u32::try_from(rate).ok()).filter(|rate| (1..=60).contains(rate))
        });
        match credentials::read(&mut table) {
            Ok(credentials) => camera.credentials = credentials,
            Err(reason) => camera.no_password = Some(reason),
        }
        camera.isolation = table.get("isolation").unwrap_or_default();
        camera.recording = table.table("recording").and_then(Recording::read);
        camera.properties = zones(&mut table);
        camera.properties.extend(security(&mut table, protocol.sink()));
        camera.pipeline = pipeline(&mut table);
        for element in ELEMENTS {
            let Some(table) = table.table(element) else { continue };
            if camera.pipeline.is_none() && element != protocol.sink() && Protocol::SINKS.contains(&element) {
                table.wrong(format!(
                    "[camera.{name}.{element}] has no effect: the camera speaks {}, so write {}",
                    protocol.name(),
                    protocol.sink()
                ));
            }
            camera.properties.extend(properties::read(element, &table));
        }
        if let Some(source) = camera.credentials.as_ref().and_then(|_| camera.source_that_gives_password()) {
            table.wrong(format!(
                "`{source}` sends the password in clear to whoever answers in the camera's place: let `source` be an \
                 `appsrc name=source is-live=true do-timestamp=true format=time`, which gets the same, or allow it by \
                 `auth = \"basic\"`",
            ));
        }
        if camera.pipeline.is_some() && camera.recording.is_some() {
            table.wrong("`recording` belongs to the program's own pipeline: with `pipeline`, put a splitmuxsink into that");
        }
        if camera.pipeline.is_some() && camera.kind == Kind::Fixed {
            table.wrong(
                "`kind` belongs to the program's own pipeline: with `pipeline`, leave the sink out of that",
            );
        }
        table.no_more();
        Some(camera)
    }

    /// The source of a pipeline of one's own, by the name of its factory, where it would be given the password.
    fn source_that_gives_password(&self) -> Option<String> {
        let text = self.pipeline.as_ref().filter(|_| self.security().0 != Authentication::Basic)?;
        let source = gst::parse::launch(text).ok()?.downcast::<gst::Bin>().ok()?.by_name("source")?;
        let name = source.factory()?.name().to_string();
        // An `rtspsrc` is given a way on which it needs none.
        (source.has_property("user-pw") && name != "rtspsrc").then_some(name)
    }

    fn without_address(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            kind: Kind::default(),
            protocol: Protocol::default(),
            address: String::new(),
            rtsp: None,
            codec: Codec::Mjpeg,
            size: None,
            rate: None,
            credentials: None,
            no_password: None,
            properties: Vec::new(),
            recording: None,
            pipeline: None,
            show: false,
            isolation: Isolation::default(),
            hands_over: false,
            kept: None,
        }
    }
}

/// RFC 7826, section 4.2; IANA.
pub const RTSP_PORT: u16 = 554;
const RTSPS_PORT: u16 = 322;

const ADDRESS: &str = "an address such as http://192.168.0.90";

/// An address, and the path behind it.
fn split_path(address: &str) -> (&str, &str) {
    let begin = address.find("://").map_or(0, |scheme| scheme + 3);
    let end = address[begin..].find('/').map_or(address.len(), |end| begin + end);
    address.split_at(end)
}

/// Host of an address, in brackets where it is of IPv6.
fn host(address: &str) -> Option<&str> {
    let rest = address.strip_prefix("http://").or_else(|| address.strip_prefix("https://"))?;
    let end = match rest.find(']') {
        Some(end) => end + 1,
        None => rest.find(':').unwrap_or(rest.len()),
    };
    let wrong = |c: char| c.is_whitespace() || matches!(c, '/' | '@' | '?' | '#');
    rest.get(..end).filter(|host| !host.is_empty() && !rest.contains(wrong))
}

/// Width and height, from `640x480`.
pub fn size(text: &str) -> Option<(u32, u32)> {
    let (width, height) = text.split_once('x')?;
    let side = |text: &str| text.parse().ok().filter(|side| (16..=8192).contains(side));
    Some((side(width)?, side(height)?))
}

/// Where to look, and where not.
fn zones(table: &mut Table) -> Vec<Property> {
    let mut found = Vec::new();
    for key in ["zones", "exclude-zones"] {
        let Some(value) = table.value(key) else { continue };
        let Some(zones) = table.get::<Vec<String>>(key) else { continue };
        match properties::of("bgavgdetect", key, &zones.join(";")) {
            Ok(property) => found.push(property),
            Err(reason) => table.source.wrong(value.span(), reason),
        }
    }
    found
}

/// What the sink and the pictures are to believe, among its properties.
fn security(table: &mut Table, sink: &'static str) -> Vec<Property> {
    let mut found = Vec::new();
    for key in ["auth", "ca-file", "insecure"] {
        let Some(value) = table.value(key) else { continue };
        let text = match value.get_ref() {
            toml::de::DeValue::Boolean(yes) => yes.to_string(),
            other => other.as_str().unwrap_or_default().to_owned(),
        };
        match properties::of(sink, key, &text) {
            Ok(property) => found.push(property),
            Err(reason) => table.source.wrong(value.span(), reason),
        }
    }
    found
}

/// What GStreamer can make a pipeline of.
fn pipeline(table: &mut Table) -> Option<String> {
    let value = table.value("pipeline")?;
    let text: Option<String> = Read::read(value.get_ref());
    let parsed = text.as_deref().map(gst::parse::launch);
    match parsed {
        Some(Err(err)) => table.source.wrong(value.span(), format!("`pipeline`: {}", err.message())),
        Some(Ok(_)) => {}
        None => {
            table.source.wrong(value.span(), "`pipeline` must be text in quotes, as gst-launch-1.0 takes it")
        }
    }
    text
}

impl Recording {
    fn read(mut table: Table) -> Option<Self> {
        let folder: Option<String> = table.need("folder");
        let segment = table.get("segment").unwrap_or(Duration::from_secs(600));
        if segment < Duration::from_secs(1) {
            table.wrong("`segment` must be 1 s or more");
        }
        let keep = table.get("keep");
        let keep_bytes = table.get_with("keep-bytes", units::BYTES, |value| units::bytes(value.as_str()?));
        if keep.is_none() && keep_bytes.is_none() {
            table.wrong(
                "a recording needs `keep` = \"7d\" or `keep-bytes` = \"20GB\", as it would fill the disk",
            );
        }
        let overlay = table.get("overlay").unwrap_or(false);
        table.no_more();
        Some(Self { folder: folder?.into(), segment, keep, keep_bytes, overlay })
    }
}
