// SPDX-License-Identifier: MPL-2.0

//! Who may: Basic and Digest, as Axis cameras ask for them.

use std::{
    hash::{BuildHasher, RandomState},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use axum::{
    extract::{Request, State},
    http::{StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Response},
};
use digest_auth::{AuthContext, AuthorizationHeader, HttpMethod};

use super::Site;
use crate::{
    Fault,
    settings::{Auth, Settings},
    sync::lock,
};

/// Lets in whoever knows the password.
pub(super) struct Guard {
    auth: Auth,
    user: String,
    password: String,
    serial: String,
    nonce_lifetime: Duration,
    identity: Mutex<Identity>,
    wrong_logins: AtomicU64,
}

/// What a reboot changes.
#[derive(Clone)]
struct Identity {
    realm: String,
    /// Signs nonces, so that none need be remembered.
    key: RandomState,
}

impl Identity {
    fn new(realm: String) -> Self {
        Self { realm, key: RandomState::new() }
    }

    /// The form of Apache's mod_auth_digest: time of issue, then a signature of 40 hex digits.
    fn nonce(&self, issued: Duration) -> String {
        let micros = issued.as_micros() as u64;
        let part = |part: u8| self.key.hash_one((micros, part));
        let signature = format!("{:016x}{:016x}{:016x}", part(0), part(1), part(2));
        format!("{}{}", glib::base64_encode(&micros.to_le_bytes()), &signature[..40])
    }
}

/// Why somebody is not let in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Refusal {
    Unknown,
    /// Right, but with a nonce of the past.
    Stale,
}

impl Guard {
    pub fn new(settings: &Settings) -> Self {
        Self {
            auth: settings.auth,
            user: settings.user.clone(),
            password: settings.password.clone(),
            identity: Mutex::new(Identity::new(format!("AXIS_{}", settings.serial))),
            serial: settings.serial.clone(),
            nonce_lifetime: settings.nonce_lifetime,
            wrong_logins: AtomicU64::new(0),
        }
    }

    /// Takes another realm, as after an update of the firmware, and forgets all nonces.
    pub fn reboot(&self) {
        let mut identity = lock(&self.identity);
        let classic = format!("AXIS_{}", self.serial);
        let other = if identity.realm == classic { format!("AXIS_WS_{}", self.serial) } else { classic };
        *identity = Identity::new(other);
    }

    /// Requests so far that came with wrong credentials, and not just with an old nonce.
    pub fn wrong_logins(&self) -> u64 {
        self.wrong_logins.load(Ordering::Relaxed)
    }

    /// The 401 for a request that may not pass.
    pub fn refuse(&self, request: &Request, fault: &Fault) -> Option<Response> {
        let now = time(fault);
        let authorization =
            request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
        let target = request.uri().path_and_query().map_or("/", |target| target.as_str());
        let checked = match fault {
            Fault::Locked => Err(Refusal::Unknown),
            _ => self.check(authorization, request.method().as_str(), target, now),
        };
        let refusal = checked.err()?;
        if authorization.is_some() && refusal == Refusal::Unknown {
            self.wrong_logins.fetch_add(1, Ordering::Relaxed);
        }
        Some(self.challenge(refusal, now))
    }

    /// The 401 for whoever may not do this, known or not.
    pub fn forbid(&self, now: Duration) -> Response {
        self.challenge(Refusal::Unknown, now)
    }

    fn challenge(&self, refusal: Refusal, now: Duration) -> Response {
        let mut response =
            (StatusCode::UNAUTHORIZED, [(header::CONTENT_TYPE, "text/html")], "<H1>401 Unauthorized</H1>\n")
                .into_response();
        for challenge in self.challenges(refusal, now) {
            if let Ok(value) = challenge.parse() {
                response.headers_mut().append(header::WWW_AUTHENTICATE, value);
            }
        }
        response
    }

    fn check(
        &self,
        authorization: Option<&str>,
        method: &str,
        target: &str,
        now: Duration,
    ) -> Result<(), Refusal> {
        if self.auth == Auth::None {
            return Ok(());
        }
        let (scheme, credentials) =
            authorization.and_then(|value| value.split_once(' ')).ok_or(Refusal::Unknown)?;
        let digest = matches!(self.auth, Auth::Digest { .. } | Auth::Both);
        if digest && scheme.eq_ignore_ascii_case("digest") {
            return self.check_digest(credentials, method, target, now);
        }
        let basic = matches!(self.auth, Auth::Basic | Auth::Both) && scheme.eq_ignore_ascii_case("basic");
        let expected = format!("{}:{}", self.user, self.password);
        let known = basic && glib::base64_decode(credentials.trim()) == expected.as_bytes();
        if known { Ok(()) } else { Err(Refusal::Unknown) }
    }

    fn check_digest(
        &self,
        credentials: &str,
        method: &str,
        target: &str,
        now: Duration,
    ) -> Result<(), Refusal> {
        let identity = lock(&self.identity).clone();
        let given = AuthorizationHeader::parse(credentials).map_err(|_| Refusal::Unknown)?;
        // Like the real ones, the server compares the signed target with the one asked for.
        if given.username != self.user || given.realm != identity.realm || given.uri != target {
            return Err(Refusal::Unknown);
        }
        let context = AuthContext::new_with_method(
            self.user.as_str(),
            self.password.as_str(),
            target,
            None::<&[u8]>,
            HttpMethod::from(method),
        );
        let mut expected = given.clone();
        expected.digest(&context);
        if expected.response != given.response {
            return Err(Refusal::Unknown);
        }
        if self.is_fresh(&identity, &given.nonce, now) { Ok(()) } else { Err(Refusal::Stale) }
    }

    fn challenges(&self, refusal: Refusal, now: Duration) -> Vec<String> {
        let identity = lock(&self.identity).clone();
        let stale = if refusal == Refusal::Stale { ", stale=true" } else { "" };
        let digest = |qop: bool| {
            let nonce = identity.nonce(now);
            let qop = if qop { ", algorithm=MD5, qop=\"auth\"" } else { "" };
            format!("Digest realm=\"{}\", nonce=\"{nonce}\"{stale}{qop}", identity.realm)
        };
        let basic = || format!("Basic realm=\"{}\"", identity.realm);
        match self.auth {
            Auth::None => vec![],
            Auth::Basic => vec![basic()],
            Auth::Digest { qop } => vec![digest(qop)],
            Auth::Both => vec![digest(true), basic()],
        }
    }

    fn is_fresh(&self, identity: &Identity, nonce: &str, now: Duration) -> bool {
        let stamp = nonce.get(..12).map(glib::base64_decode);
        let Some(Ok(micros)) = stamp.map(<[u8; 8]>::try_from) else {
            return false;
        };
        let issued = Duration::from_micros(u64::from_le_bytes(micros));
        // One of the future is from before the clock was set back: as void as one of long ago.
        let age = now.checked_sub(issued);
        nonce == identity.nonce(issued) && age.is_some_and(|age| age <= self.nonce_lifetime)
    }
}

/// What the camera's clock shows.
pub(super) fn time(fault: &Fault) -> Duration {
    let ahead = if let Fault::ClockAhead(ahead) = fault { *ahead } else { Duration::ZERO };
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default() + ahead
}

/// Middleware for what faults do not touch.
pub(super) async fn require(State(site): State<Arc<Site>>, request: Request, next: Next) -> Response {
    let fault = site.camera.fault.borrow().clone();
    if let Some(refusal) = site.guard.refuse(&request, &fault) {
        site.camera.note_refused();
        return refusal;
    }
    next.run(request).await
}

#[cfg(test)]
mod tests {
    use super::*;
    use digest_auth::WwwAuthenticateHeader;

    const TARGET: &str = "/axis-cgi/com/ptz.cgi?camera=1&continuouspantiltmove=-49,0";

    fn guard(auth: Auth) -> Guard {
        Guard::new(&Settings { auth, ..Settings::default() })
    }

    fn now() -> Duration {
        time(&Fault::None)
    }

    fn respond(challenge: &str, password: &str, target: &str) -> String {
        let mut parsed = WwwAuthenticateHeader::parse(challenge).unwrap();
        parsed.respond(&AuthContext::new("root", password, target)).unwrap().to_string()
    }

    #[test]
    fn digest_lets_in_who_signs_this_very_request() {
        for qop in [true, false] {
            let guard = guard(Auth::Digest { qop });
            let challenge = &guard.challenges(Refusal::Unknown, now())[0];
            assert_eq!(challenge.contains("qop=\"auth\""), qop);
            assert!(challenge.starts_with("Digest realm=\"AXIS_ACCC8E012345\", nonce=\""), "{challenge}");
            let right = respond(challenge, "pass", TARGET);
            assert_eq!(guard.check(Some(&right), "GET", TARGET, now()), Ok(()));
            assert_eq!(guard.check(Some(&right), "POST", TARGET, now()), Err(Refusal::Unknown));
            assert_eq!(
                guard.check(Some(&right), "GET", "/axis-cgi/com/ptz.cgi", now()),
                Err(Refusal::Unknown)
            );
            let wrong = respond(challenge, "guess", TARGET);
            assert_eq!(guard.check(Some(&wrong), "GET", TARGET, now()), Err(Refusal::Unknown));
        }
    }

    #[test]
    fn an_old_nonce_is_stale_and_a_foreign_one_too() {
        let settings = Settings { nonce_lifetime: Duration::ZERO, auth: Auth::Both, ..Settings::default() };
        let guard = Guard::new(&settings);
        let identity = lock(&guard.identity).clone();
        let old = format!(
            "Digest realm=\"{}\", nonce=\"{}\"",
            identity.realm,
            identity.nonce(Duration::from_secs(5))
        );
        let foreign = "Digest realm=\"AXIS_ACCC8E012345\", nonce=\"PNHWZB6nBQA=316099a1\"";
        for challenge in [old.as_str(), foreign] {
            let answer = respond(challenge, "pass", TARGET);
            assert_eq!(guard.check(Some(&answer), "GET", TARGET, now()), Err(Refusal::Stale));
            let wrong = respond(challenge, "guess", TARGET);
            assert_eq!(guard.check(Some(&wrong), "GET", TARGET, now()), Err(Refusal::Unknown));
        }
        assert!(guard.challenges(Refusal::Stale, now())[0].contains("stale=true"));
    }

    #[test]
    fn a_clock_set_forth_or_back_makes_nonces_stale() {
        let guard = guard(Auth::Digest { qop: true });
        let hour = Duration::from_secs(3600);
        let issued = now();
        let answer = respond(&guard.challenges(Refusal::Unknown, issued)[0], "pass", TARGET);
        assert_eq!(guard.check(Some(&answer), "GET", TARGET, issued), Ok(()));
        for jump in [issued + hour, issued - hour] {
            assert_eq!(guard.check(Some(&answer), "GET", TARGET, jump), Err(Refusal::Stale));
        }
    }

    #[test]
    fn a_reboot_changes_the_realm() {
        let guard = guard(Auth::Digest { qop: true });
        let before = respond(&guard.challenges(Refusal::Unknown, now())[0], "pass", TARGET);
        guard.reboot();
        assert_eq!(guard.check(Some(&before), "GET", TARGET, now()), Err(Refusal::Unknown));
        let after = respond(&guard.challenges(Refusal::Unknown, now())[0], "pass", TARGET);
        assert_eq!(guard.check(Some(&after), "GET", TARGET, now()), Ok(()));
    }

    #[test]
    fn basic_knows_the_password() {
        let right = format!("Basic {}", glib::base64_encode(b"root:pass"));
        let wrong = format!("Basic {}", glib::base64_encode(b"root:guess"));
        for auth in [Auth::Basic, Auth::Both] {
            assert_eq!(guard(auth).check(Some(&right), "GET", TARGET, now()), Ok(()));
            assert_eq!(guard(auth).check(Some(&wrong), "GET", TARGET, now()), Err(Refusal::Unknown));
            assert_eq!(guard(auth).check(None, "GET", TARGET, now()), Err(Refusal::Unknown));
        }
        assert_eq!(
            guard(Auth::Digest { qop: true }).check(Some(&right), "GET", TARGET, now()),
            Err(Refusal::Unknown)
        );
        assert_eq!(guard(Auth::None).check(None, "GET", TARGET, now()), Ok(()));
    }
}
