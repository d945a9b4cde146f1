// SPDX-License-Identifier: MPL-2.0

//! HTTP as cameras speak it: where they are, who we are to them, and whom of them to believe.

mod auth;
mod client;
mod cookies;
mod excerpt;
mod location;
mod secret;
mod tls;

pub use auth::{Authentication, Authenticator, Credentials, answer_to_challenge};
pub use client::{ClientSettings, CompleteResponse, HttpClient, Identity, Repeat, Stream};
pub use cookies::answer_to_cookie;
pub use excerpt::{excerpt, unexpected};
pub use location::{Location, UserInfo, without_user_info};
pub use secret::Secret;
pub use tls::Trust;
