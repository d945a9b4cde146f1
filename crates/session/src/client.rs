// SPDX-License-Identifier: MPL-2.0

use std::fmt::Debug;
use std::future::Future;
use std::time::Duration;

use crate::http::{ClientSettings, Credentials, Identity};
use crate::{Error, Query, Request, Response};

/// What the session is to know of a protocol.
#[derive(Debug, Clone, Copy)]
pub struct Protocol {
    /// What a camera just met is asked, what matters most first.
    pub questions: &'static [Query],
    /// An accepted move is repeated this often: somebody else's command may have come in between, or it ends by itself.
    pub keep_alive: Duration,
    /// Whether a camera's yes to a stop is believed only where the picture bears it out.
    pub confirms_stops: bool,
    /// Whether cameras may have a control queue.
    pub has_control_queue: bool,
}

/// Speaks a protocol with one camera. Every request takes `&mut self`: there is at most one in flight. One that is dropped
/// before it is answered leaves the client as it may be found.
pub trait Client: Debug + Send + Sync + Sized + 'static {
    /// What the session is to know of the protocol.
    const PROTOCOL: Protocol;

    /// Prepares to speak to a camera; nothing is sent yet.
    ///
    /// # Errors
    /// [`Error::Tls`] where `trust` cannot be used.
    fn new(settings: ClientSettings) -> Result<Self, Error> {
        Self::in_place_of(settings.into())
    }

    /// Speaks to the camera in another client's place.
    ///
    /// # Errors
    /// [`Error::Tls`] where `trust` cannot be used.
    fn in_place_of(identity: Identity) -> Result<Self, Error>;

    /// Who this client is to the camera.
    fn identity(&self) -> Identity;

    /// Takes another user or password, and asks again even where the last were refused.
    fn set_credentials(&mut self, credentials: Option<Credentials>);

    /// One exchange. That a command is accepted does not mean that the camera has done it.
    ///
    /// # Errors
    /// Any; see [`Error::may_have_acted`].
    fn exchange(&mut self, request: &Request) -> impl Future<Output = Result<Response, Error>> + Send;

    /// What the user is to be told since the last exchange: how this camera cannot be spoken to as others can.
    fn take_warning(&mut self) -> Option<String> {
        None
    }
}
