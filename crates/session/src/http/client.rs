// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use bytes::Bytes;
use reqwest::header::{AUTHORIZATION, CONTENT_TYPE, HeaderMap, LOCATION, WWW_AUTHENTICATE};
use reqwest::{Response, StatusCode, Url, redirect};
use serde::{Deserialize, Serialize};

use super::auth::Authenticator;
use super::cookies::Cookies;
use super::location::without_user_info;
use super::{Authentication, Credentials, Location, Trust, excerpt};
use crate::Error;

/// The media type of SOAP 1.2.
const SOAP: &str = "application/soap+xml; charset=utf-8";

/// Longest answer that is read; a full PTZ parameter list is a few kilobytes.
const MAX_BODY_BYTES: usize = 64 * 1024;

/// Requests that one exchange may take: a redirect, a closed connection, a challenge and a stale one.
const MAX_ATTEMPTS: usize = 5;

/// How a camera is spoken to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClientSettings {
    /// Where it is.
    pub location: Location,
    /// Which of its channels, as the protocol names them; empty: the first.
    pub channel: String,
    /// Who we are.
    pub credentials: Option<Credentials>,
    /// How that may be proved.
    pub authentication: Authentication,
    /// Longest time for one answer.
    pub timeout: Duration,
    /// Whose certificates are believed.
    pub trust: Trust,
}

/// Who a client is to its camera: whoever has it speaks in the client's place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// As they are by now: redirects followed, user and password those of the last request.
    pub settings: ClientSettings,
    cookies: Cookies,
    /// The camera has accepted user and password: where it refuses them, that may pass.
    #[serde(default)]
    pub accepted: bool,
    /// What the camera has told, in the protocol's own form: whoever has it need not ask again.
    #[serde(default)]
    pub findings: serde_json::Value,
}

impl Identity {
    /// Whether both are the same to a camera: user, password, and the ways on which they may be sent.
    pub fn is_account_of(&self, other: &Self) -> bool {
        let (own, others) = (&self.settings, &other.settings);
        own.credentials == others.credentials
            && own.authentication == others.authentication
            && own.trust == others.trust
    }

    /// The same as this one, whose account the camera knows from another.
    #[must_use]
    pub fn known_from(self, other: Self) -> Self {
        Self { cookies: other.cookies, accepted: other.accepted, ..self }
    }
}

impl From<ClientSettings> for Identity {
    fn from(settings: ClientSettings) -> Self {
        Self { settings, cookies: Cookies::default(), accepted: false, findings: serde_json::Value::Null }
    }
}

/// One camera. Every request takes `&mut self`: there is at most one in flight.
#[derive(Debug)]
pub struct HttpClient {
    settings: ClientSettings,
    http: reqwest::Client,
    /// The same, but for connections of a single request.
    http_once: reqwest::Client,
    authenticator: Authenticator,
    cookies: Cookies,
    /// Set once user and password were refused: asking again could lock the account.
    locked_out: bool,
    /// Set once the camera did something for this user and password: what it refuses then is not for them.
    accepted: bool,
    /// Whether the connection may be one that the camera has closed since its last answer.
    connected: bool,
}

/// A request that nobody waits for any more is hung up on, unless it must be heard; then after so long, as on a connection
/// that comes about late and a network that holds it back.
const STAYS_UNDER_WAY: Duration = Duration::from_secs(6);

/// Whether a request is sent again where the connection breaks, as it does where the camera has closed it meanwhile. It
/// may have arrived all the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeat {
    /// Twice is as good as once.
    WhereBroken,
    /// The same, and it must be heard however late: where its answer is waited for no longer it is left under way, as a
    /// camera may forget what it was told by who hangs up.
    UntilHeard,
    /// Twice is too much: sent over a connection of its own, that the camera cannot have closed.
    Never,
}

/// A response whose body was received whole.
#[derive(Debug)]
pub struct CompleteResponse {
    /// The HTTP status.
    pub status: u16,
    /// As text; what is not UTF-8 is replaced.
    pub body: String,
}

impl HttpClient {
    /// Prepares to speak to a camera; nothing is sent yet.
    ///
    /// # Errors
    /// [`Error::Tls`] where `trust` cannot be used.
    pub fn in_place_of(identity: Identity) -> Result<Self, Error> {
        let Identity { settings, cookies, accepted, .. } = identity;
        Ok(Self {
            http: http_client(&settings, 1)?,
            http_once: http_client(&settings, 0)?,
            authenticator: Authenticator::new(settings.credentials.clone(), settings.authentication),
            cookies,
            settings,
            locked_out: false,
            accepted,
            connected: false,
        })
    }

    /// Who this client is to the camera.
    pub fn identity(&self) -> Identity {
        Identity { cookies: self.cookies.clone(), accepted: self.accepted, ..self.settings.clone().into() }
    }

    /// Takes another user or password, and asks again even where the last were refused.
    pub fn set_credentials(&mut self, credentials: Option<Credentials>) {
        self.authenticator.set_credentials(credentials.clone());
        self.settings.credentials = credentials;
        (self.locked_out, self.accepted) = (false, false);
    }

    /// Whether requests are signed by HTTP: the camera has asked for it.
    pub fn is_signing(&self) -> bool {
        self.authenticator.is_signing()
    }

    /// The camera did something for user and password that a message carried, which HTTP knows nothing of: what it refuses
    /// from here on is not for them.
    pub fn note_accepted(&mut self) {
        self.accepted = true;
    }

    /// Nothing is signed until the camera asks for it again: one that is restarting may have done so for a moment only.
    pub fn forget_challenge(&mut self) {
        self.authenticator.forget_challenge();
    }

    /// Who we are, where anybody is set.
    pub fn credentials(&self) -> Option<&Credentials> {
        self.settings.credentials.as_ref()
    }

    /// How the camera is spoken to, as it is by now.
    pub fn settings(&self) -> &ClientSettings {
        &self.settings
    }

    /// The answer to a GET of this path and query, below the location.
    ///
    /// # Errors
    /// Any; an HTTP status that is no success is [`Error::Status`].
    pub async fn get(&mut self, target: &str, repeat: Repeat) -> Result<CompleteResponse, Error> {
        let url = self.settings.location.join(target);
        self.exchange(&path_and_query(&url), None, repeat).await
    }

    /// The answer to a POST of this SOAP message to a path and query of the camera, whatever its HTTP status: a fault has one
    /// too. Nor is it an error where the camera answers 401 and offers no authentication of HTTP's.
    ///
    /// # Errors
    /// Any.
    pub async fn post(
        &mut self,
        target: &str,
        message: &str,
        repeat: Repeat,
    ) -> Result<CompleteResponse, Error> {
        // As it is sent, or what is signed is another.
        let target = path_and_query(&self.settings.location.at(target));
        self.exchange(&target, Some(message), repeat).await
    }

    /// Asks for something without end, as MJPEG is; the answer must begin within this time, and from then on something must
    /// come within the timeout of an answer.
    ///
    /// # Errors
    /// Any.
    pub async fn open(&mut self, target: &str, longest: Duration) -> Result<Stream, Error> {
        let target = path_and_query(&self.settings.location.join(target));
        let mut broken = None;
        let opened = self.attempts(&target, None, Repeat::WhereBroken, &mut broken);
        let response = tokio::time::timeout(longest, opened).await.unwrap_or(Err(Error::Timeout(longest)))?;
        Ok(Stream { response, longest: self.settings.timeout })
    }

    /// One exchange, with the challenges, the redirect to the camera's own HTTPS and the closed connection that may lie in
    /// between. All of it takes no longer than an answer may.
    async fn exchange(
        &mut self,
        target: &str,
        message: Option<&str>,
        repeat: Repeat,
    ) -> Result<CompleteResponse, Error> {
        if self.locked_out {
            return Err(self.bad_credentials());
        }
        let longest = self.settings.timeout;
        let mut broken = None;
        let whole = async {
            let response = self.attempts(target, message, repeat, &mut broken).await?;
            let status = response.status().as_u16();
            Ok(CompleteResponse { status, body: self.body(response).await? })
        };
        let answer = tokio::time::timeout(longest, whole).await;
        match answer.unwrap_or(Err(Error::Timeout(longest))) {
            // However the second attempt failed, the camera may have acted on the first.
            Err(err) if !err.may_have_acted() => Err(broken.unwrap_or(err)),
            answer => answer,
        }
    }

    /// The attempts themselves; `broken`: how the first ended where its connection broke.
    async fn attempts(
        &mut self,
        target: &str,
        message: Option<&str>,
        repeat: Repeat,
        broken: &mut Option<Error>,
    ) -> Result<Response, Error> {
        // Whether the signature answers a challenge of this very exchange.
        let mut signed_fresh = false;
        for _ in 0..MAX_ATTEMPTS {
            let response = match self.request(target, message, repeat).await {
                Err(err @ Error::Broken(_)) if self.connected && repeat != Repeat::Never => {
                    self.connected = false;
                    broken.get_or_insert(err);
                    continue;
                }
                other => other?,
            };
            let status = response.status();
            let challenges = message.is_none() || response.headers().contains_key(WWW_AUTHENTICATE);
            if status == StatusCode::UNAUTHORIZED && challenges {
                let is_verified = self.settings.trust.is_verified(self.settings.location.is_https());
                let stale = self.authenticator.challenged(response.headers(), is_verified)?;
                if signed_fresh && !stale {
                    return Err(self.refused());
                }
                signed_fresh = true;
                // Read to its end, so that the connection can carry the answer to the challenge.
                if let Err(err @ Error::Timeout(_)) = self.body(response).await {
                    return Err(err);
                }
            } else if status.is_redirection() {
                self.follow(&response, target)?;
            } else if status.is_success() || message.is_some() {
                self.accepted |= status.is_success() && self.authenticator.is_signing();
                return Ok(response);
            } else {
                let reason = status.canonical_reason().unwrap_or("");
                return Err(Error::Status { status: status.as_u16(), reason });
            }
        }
        Err(Error::Unexpected("challenged or redirected again and again".to_owned()))
    }

    async fn request(
        &mut self,
        target: &str,
        message: Option<&str>,
        repeat: Repeat,
    ) -> Result<Response, Error> {
        let url = self.settings.location.at(target);
        let http = if repeat == Repeat::Never { &self.http_once } else { &self.http };
        let (method, mut request) = match message {
            None => ("GET", http.get(url)),
            Some(message) => ("POST", http.post(url).header(CONTENT_TYPE, SOAP).body(message.to_owned())),
        };
        if let Some(authorization) = self.authenticator.authorization(method, target)? {
            request = request.header(AUTHORIZATION, authorization);
        }
        let mut headers = HeaderMap::new();
        self.cookies.put(&mut headers);
        let sending = request.headers(headers).send();
        let response = if repeat == Repeat::UntilHeard { under_way(sending).await? } else { sending.await };
        let response = response.map_err(|err| self.failure(&err))?;
        self.cookies.take(response.headers());
        self.connected = true;
        Ok(response)
    }

    /// The body as text, bounded; what is not UTF-8 is replaced, as it is only searched for keys.
    async fn body(&self, mut response: Response) -> Result<String, Error> {
        let mut body = Vec::new();
        while let Some(chunk) = response.chunk().await.map_err(|err| self.failure(&err))? {
            if body.len() + chunk.len() > MAX_BODY_BYTES {
                return Err(Error::TooLong(MAX_BODY_BYTES));
            }
            body.extend_from_slice(&chunk);
        }
        Ok(String::from_utf8_lossy(&body).into_owned())
    }

    fn follow(&mut self, response: &Response, target: &str) -> Result<(), Error> {
        let redirect = response.headers().get(LOCATION).and_then(|value| value.to_str().ok()).unwrap_or("");
        let Some(location) = self.settings.location.upgraded_by(redirect, target) else {
            let elsewhere = redirect.split('?').next().unwrap_or("");
            return Err(Error::Redirected(excerpt(&without_user_info(elsewhere))));
        };
        // Where TLS cannot be set up nothing changes, so that each attempt fails alike.
        let settings = ClientSettings { location, ..self.settings.clone() };
        (self.http, self.http_once) = (http_client(&settings, 1)?, http_client(&settings, 0)?);
        self.settings = settings;
        self.authenticator.forget_challenge();
        self.connected = false;
        Ok(())
    }

    /// The camera does not take the signature that it has asked for.
    fn refused(&mut self) -> Error {
        if self.accepted {
            return self.not_permitted();
        }
        self.locked_out = true;
        self.bad_credentials()
    }

    fn bad_credentials(&self) -> Error {
        Error::BadCredentials { user: self.authenticator.user().to_owned() }
    }

    fn not_permitted(&self) -> Error {
        Error::NotPermitted { user: self.authenticator.user().to_owned() }
    }

    fn failure(&self, err: &reqwest::Error) -> Error {
        failure(err, self.settings.timeout)
    }
}

/// What a camera sends without end.
#[derive(Debug)]
pub struct Stream {
    response: Response,
    longest: Duration,
}

impl Stream {
    /// What comes next; `None` at the end.
    ///
    /// # Errors
    /// [`Error::Timeout`] or [`Error::Broken`].
    pub async fn next(&mut self) -> Result<Option<Bytes>, Error> {
        let chunk = tokio::time::timeout(self.longest, self.response.chunk()).await;
        chunk.map_err(|_| Error::Timeout(self.longest))?.map_err(|err| failure(&err, self.longest))
    }
}

/// What comes of this, which goes on where nobody waits for it any more.
async fn under_way<T: Send + 'static>(sending: impl Future<Output = T> + Send + 'static) -> Result<T, Error> {
    let goes_on = tokio::spawn(tokio::time::timeout(STAYS_UNDER_WAY, sending));
    let broken = |err: tokio::task::JoinError| Error::Broken(err.to_string());
    goes_on.await.map_err(broken)?.map_err(|_| Error::Timeout(STAYS_UNDER_WAY))
}

fn failure(err: &reqwest::Error, longest: Duration) -> Error {
    if err.is_timeout() {
        Error::Timeout(longest)
    } else if err.is_connect() {
        Error::Unreachable(innermost(err))
    } else {
        Error::Broken(innermost(err))
    }
}

/// What a request names of its address, and a signature covers.
fn path_and_query(url: &Url) -> String {
    url.query().map_or_else(|| url.path().to_owned(), |query| format!("{}?{query}", url.path()))
}

/// `idle`: connections that are kept for the next request.
fn http_client(settings: &ClientSettings, idle: usize) -> Result<reqwest::Client, Error> {
    let tls = settings.trust.client_config(settings.location.is_https())?;
    reqwest::Client::builder()
        .tls_backend_preconfigured(tls)
        // The camera is at hand; a proxy from the environment would be asked for every command.
        .no_proxy()
        .redirect(redirect::Policy::none())
        .http1_only()
        .pool_max_idle_per_host(idle)
        .tcp_nodelay(true)
        .build()
        .map_err(|err| Error::Tls(innermost(&err)))
}

/// What happened at the bottom: the outer errors only repeat the address.
fn innermost(err: &reqwest::Error) -> String {
    let mut cause: &dyn std::error::Error = err;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}
