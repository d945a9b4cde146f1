// SPDX-License-Identifier: MPL-2.0

//! What tests of several modules begin with.

use std::time::Duration;

use crate::Protocol;
use crate::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};

/// Nothing is asked.
pub const PROTOCOL: Protocol = Protocol {
    questions: &[],
    keep_alive: Duration::from_secs(1),
    confirms_stops: false,
    has_control_queue: false,
};

/// A camera's only channel, without a user.
pub fn client_settings(location: &str) -> ClientSettings {
    ClientSettings {
        location: Location::parse(location).unwrap().0,
        channel: String::new(),
        credentials: None,
        authentication: Authentication::default(),
        timeout: Duration::from_secs(1),
        trust: Trust::System,
    }
}

/// Those of the user `root`.
pub fn credentials(password: &str) -> Option<Credentials> {
    Some(Credentials { user: "root".to_owned(), password: Secret::new(password) })
}
