// SPDX-License-Identifier: MPL-2.0

//! VAPIX, the HTTP interface of Axis cameras, as far as following a target needs it.
//!
//! [`Client`] puts what the [`session`] wants to say or ask into words, and reads the answers. Nothing here knows GStreamer.
//!
//! Facts of the wire (Axis, "VAPIX Pan/tilt/zoom API"): a move is accepted with `204 No Content`; a
//! `200` in answer to a move is a refusal whose text begins with `Error:`; queries answer `200` with
//! `key=value` lines in no fixed order, with CRLF or LF.

mod attributes;
mod client;
mod command;
mod presets;
mod queue;
mod steps;
mod text;

pub use attributes::parse_attributes;
pub use client::Client;
pub use command::Words;
pub use presets::parse_presets;
pub use queue::parse_queue_place;
pub use text::{parse_limits, parse_move_speed, parse_parameters, parse_position};
