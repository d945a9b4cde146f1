// SPDX-License-Identifier: MPL-2.0

//! What tests of several modules begin with.

use std::sync::Mutex;
use std::time::Duration;

use ptztrack_contract::lock::lock;
use servo::Position;

use crate::http::{Authentication, ClientSettings, Credentials, Identity, Location, Secret, Trust};
use crate::{Client, Error, Protocol, Request, Response};

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

/// A camera that was moved, and does not let the user stop it, as the account is locked since.
#[derive(Debug)]
pub struct Locked(Identity);

/// Where stops were refused, and to whom.
static REFUSED: Mutex<Vec<(Location, Option<Credentials>)>> = Mutex::new(Vec::new());

impl Locked {
    /// How often the camera at this address refused a stop to who has this password.
    pub fn refused(location: &str, password: &str) -> usize {
        let refusal = (client_settings(location).location, credentials(password));
        lock(&REFUSED).iter().filter(|other| **other == refusal).count()
    }
}

impl Client for Locked {
    const PROTOCOL: Protocol = PROTOCOL;

    fn in_place_of(identity: Identity) -> Result<Self, Error> {
        Ok(Self(identity))
    }

    fn identity(&self) -> Identity {
        self.0.clone()
    }

    fn set_credentials(&mut self, credentials: Option<Credentials>) {
        (self.0.settings.credentials, self.0.accepted) = (credentials, false);
    }

    async fn exchange(&mut self, request: &Request) -> Result<Response, Error> {
        match request {
            Request::Query(_) => Ok(Response::Position(Position::default())),
            Request::Command(command) if !command.is_stop() => {
                self.0.accepted = true;
                Ok(Response::Accepted)
            }
            Request::Command(_) => {
                lock(&REFUSED).push((self.0.settings.location.clone(), self.0.settings.credentials.clone()));
                let user = "root".to_owned();
                Err(if self.0.accepted {
                    Error::NotPermitted { user }
                } else {
                    Error::BadCredentials { user }
                })
            }
        }
    }
}
