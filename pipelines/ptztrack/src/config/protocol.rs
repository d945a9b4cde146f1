// SPDX-License-Identifier: MPL-2.0

use serde::{Deserialize, Serialize};

use super::table::Read;

/// What a camera is spoken to by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
pub enum Protocol {
    /// Axis' own
    #[default]
    Vapix,
    /// That of cameras of most makes
    Onvif,
}

/// Sockets of watchdogs that stop cameras if this process dies; without one, the sink starts its own.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Watchdogs {
    /// Socket of a `vapix-watchdog --listen` that stops the cameras if this process dies; else one is started
    #[arg(long = "watchdog", value_name = "SOCKET")]
    vapix: Option<String>,
    /// The same of an `onvif-watchdog --listen`, for cameras by ONVIF
    #[arg(long = "onvif-watchdog", value_name = "SOCKET")]
    onvif: Option<String>,
}

impl Protocol {
    /// The elements that speak one.
    pub const SINKS: [&str; 2] = ["vapixptzsink", "onvifptzsink"];

    /// The element that speaks it.
    pub fn sink(self) -> &'static str {
        match self {
            Self::Vapix => "vapixptzsink",
            Self::Onvif => "onvifptzsink",
        }
    }

    /// Its name as people write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vapix => "VAPIX",
            Self::Onvif => "ONVIF",
        }
    }
}

impl Read for Protocol {
    const WHAT: &'static str = "\"vapix\" or \"onvif\"";

    fn read(value: &toml::de::DeValue) -> Option<Self> {
        match value.as_str()? {
            "vapix" => Some(Self::Vapix),
            "onvif" => Some(Self::Onvif),
            _ => None,
        }
    }
}

impl Watchdogs {
    /// The one for cameras by this protocol.
    pub fn of(&self, protocol: Protocol) -> Option<&str> {
        match protocol {
            Protocol::Vapix => self.vapix.as_deref(),
            Protocol::Onvif => self.onvif.as_deref(),
        }
    }
}
