// SPDX-License-Identifier: MPL-2.0

//! ONVIF, the interface of network cameras of most makes, as far as following a target needs it: PTZ of Profile S. And what is
//! seen, in its words: [`metadata`].
//!
//! [`Client`] puts what the [`session`] wants to say or ask into SOAP messages, and reads the answers. Nothing here knows
//! GStreamer.
//!
//! Cameras answer otherwise than the specification has it (ONVIF PTZ Service Specification; ONVIF Core, 5.9 and 5.12 on
//! faults and WS-UsernameToken), so names are read without their namespaces, what is missing is done without, and what a
//! camera refuses it is told in other words.

mod abilities;
mod answers;
mod client;
mod clock;
mod findings;
mod messages;
pub mod metadata;
mod moves;
mod soap;
mod streams;
mod token;
mod ws_discovery;

pub use abilities::{Abilities, MoveTimeout, parse_abilities};
pub use answers::{
    Profile, Services, parse_date, parse_position, parse_presets, parse_profiles, parse_services,
};
pub use client::Client;
pub use soap::{Answer, Element, read_answer};
pub use streams::{Encoding, StreamAddress, VideoStream, parse_stream_address, parse_streams};
pub use ws_discovery::{Announcement, GROUP, Probe, parse_announcements, probe};
