// SPDX-License-Identifier: MPL-2.0

//! What there is to choose from for a camera.

use onvif::Encoding;
use serde::{Deserialize, Serialize};

use super::protocol::Protocol;
use super::table::Read;

/// Whether a camera is moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// It follows.
    #[default]
    Ptz,
    /// It only sees who is there.
    Fixed,
}

/// What a camera shares with the others.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Isolation {
    /// A process.
    #[default]
    None,
    /// Nothing: it has a process of its own.
    Process,
}

/// How pictures come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
pub enum Codec {
    /// MJPEG over HTTP: the shortest delay, the most bandwidth
    Mjpeg,
    /// MPEG-4 part 2 over RTSP
    Mpeg4,
    /// H.264 over RTSP
    H264,
    /// H.265 over RTSP
    H265,
}

impl Read for Codec {
    const WHAT: &'static str = "\"mjpeg\", \"mpeg4\", \"h264\" or \"h265\"";

    fn read(value: &toml::de::DeValue) -> Option<Self> {
        match value.as_str()? {
            "mjpeg" => Some(Self::Mjpeg),
            "mpeg4" => Some(Self::Mpeg4),
            "h264" => Some(Self::H264),
            "h265" => Some(Self::H265),
            _ => None,
        }
    }
}

impl Codec {
    /// What is taken where nothing is said.
    pub fn usual(protocol: Protocol) -> Self {
        match protocol {
            Protocol::Vapix => Self::Mjpeg,
            Protocol::Onvif => Self::H264,
        }
    }

    /// As ONVIF calls it; MJPEG comes otherwise.
    pub fn encoding(self) -> Option<Encoding> {
        match self {
            Self::Mjpeg => None,
            Self::Mpeg4 => Some(Encoding::Mpeg4),
            Self::H264 => Some(Encoding::H264),
            Self::H265 => Some(Encoding::H265),
        }
    }

    /// What ONVIF calls so.
    pub fn of(encoding: Encoding) -> Option<Self> {
        [Self::Mpeg4, Self::H264, Self::H265].into_iter().find(|codec| codec.encoding() == Some(encoding))
    }

    /// Whether pictures come so by a protocol.
    ///
    /// # Errors
    /// That they do not.
    pub fn check(self, protocol: Protocol) -> Result<(), String> {
        match (self, protocol) {
            (Self::Mjpeg, Protocol::Onvif) => {
                Err("with ONVIF `codec` must be \"h264\", \"h265\" or \"mpeg4\": pictures come by RTSP"
                    .to_owned())
            }
            _ => Ok(()),
        }
    }
}

impl Read for Kind {
    const WHAT: &'static str = "\"ptz\" or \"fixed\"";

    fn read(value: &toml::de::DeValue) -> Option<Self> {
        match value.as_str()? {
            "ptz" => Some(Self::Ptz),
            "fixed" => Some(Self::Fixed),
            _ => None,
        }
    }
}

impl Read for Isolation {
    const WHAT: &'static str = "\"none\" or \"process\"";

    fn read(value: &toml::de::DeValue) -> Option<Self> {
        match value.as_str()? {
            "none" => Some(Self::None),
            "process" => Some(Self::Process),
            _ => None,
        }
    }
}
