// SPDX-License-Identifier: MPL-2.0

//! VAPIX, the HTTP interface of Axis cameras, as far as following a target needs it.
//!
//! [`Client`] asks and commands one camera; [`Command`] is what it can be told; [`Parameters`] and [`Attributes`],
//! with positions, limits and presets as the model has them, are what it says of itself.
//!
//! Facts of the wire (Axis, "VAPIX Pan/tilt/zoom API"): a move is accepted with `204 No Content`; a
//! `200` in answer to a move is a refusal whose text begins with `Error:`; queries answer `200` with
//! `key=value` lines in no fixed order, with CRLF or LF.

mod attributes;
mod auth;
mod client;
mod command;
mod cookies;
mod error;
mod location;
mod presets;
mod queue;
mod secret;
mod text;
mod tls;

pub use attributes::Attributes;
pub use auth::{Authentication, Authenticator, Credentials, answer_to_challenge};
pub use client::{Client, ClientSettings, Identity, Stream};
pub use command::Command;
pub use cookies::answer_to_cookie;
pub use error::Error;
pub use location::Location;
pub use presets::parse_presets;
pub use queue::{QueuePlace, QueueRequest};
pub use secret::Secret;
pub use text::{Parameters, parse_limits, parse_move_speed, parse_position};
pub use tls::Trust;
