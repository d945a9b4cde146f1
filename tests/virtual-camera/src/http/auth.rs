//! Who may: Basic and Digest, as Axis cameras ask for them.

use std::{
    hash::{BuildHasher, RandomState},
    sync::Arc,
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
use crate::settings::{Auth, Settings};

/// Lets in whoever knows the password.
pub(super) struct Guard {
    auth: Auth,
    user: String,
    password: String,
    realm: String,
    nonce_lifetime: Duration,
    /// Signs nonces, so that none need be remembered.
    key: RandomState,
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
            realm: format!("AXIS_{}", settings.serial),
            nonce_lifetime: settings.nonce_lifetime,
            key: RandomState::new(),
        }
    }

    /// The 401 for a request that may not pass.
    pub fn refuse(&self, request: &Request) -> Option<Response> {
        let authorization =
            request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
        let target = request.uri().path_and_query().map_or("/", |target| target.as_str());
        let refusal = self.check(authorization, request.method().as_str(), target).err()?;
        let mut response =
            (StatusCode::UNAUTHORIZED, [(header::CONTENT_TYPE, "text/html")], "<H1>401 Unauthorized</H1>\n")
                .into_response();
        for challenge in self.challenges(refusal) {
            if let Ok(value) = challenge.parse() {
                response.headers_mut().append(header::WWW_AUTHENTICATE, value);
            }
        }
        Some(response)
    }

    fn check(&self, authorization: Option<&str>, method: &str, target: &str) -> Result<(), Refusal> {
        if self.auth == Auth::None {
            return Ok(());
        }
        let (scheme, credentials) =
            authorization.and_then(|value| value.split_once(' ')).ok_or(Refusal::Unknown)?;
        let digest = matches!(self.auth, Auth::Digest { .. } | Auth::Both);
        if digest && scheme.eq_ignore_ascii_case("digest") {
            return self.check_digest(credentials, method, target);
        }
        let basic = matches!(self.auth, Auth::Basic | Auth::Both) && scheme.eq_ignore_ascii_case("basic");
        let expected = format!("{}:{}", self.user, self.password);
        let known = basic && glib::base64_decode(credentials.trim()) == expected.as_bytes();
        if known { Ok(()) } else { Err(Refusal::Unknown) }
    }

    fn check_digest(&self, credentials: &str, method: &str, target: &str) -> Result<(), Refusal> {
        let given = AuthorizationHeader::parse(credentials).map_err(|_| Refusal::Unknown)?;
        // Like the real ones, the server compares the signed target with the one asked for.
        if given.username != self.user || given.realm != self.realm || given.uri != target {
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
        if self.is_fresh(&given.nonce) { Ok(()) } else { Err(Refusal::Stale) }
    }

    fn challenges(&self, refusal: Refusal) -> Vec<String> {
        let stale = if refusal == Refusal::Stale { ", stale=true" } else { "" };
        let digest = |qop: bool| {
            let nonce = self.nonce(now());
            let qop = if qop { ", algorithm=MD5, qop=\"auth\"" } else { "" };
            format!("Digest realm=\"{}\", nonce=\"{nonce}\"{stale}{qop}", self.realm)
        };
        let basic = || format!("Basic realm=\"{}\"", self.realm);
        match self.auth {
            Auth::None => vec![],
            Auth::Basic => vec![basic()],
            Auth::Digest { qop } => vec![digest(qop)],
            Auth::Both => vec![digest(true), basic()],
        }
    }

    /// The form of Apache's mod_auth_digest: time of issue, then a signature of 40 hex digits.
    fn nonce(&self, issued: Duration) -> String {
        let micros = issued.as_micros() as u64;
        let part = |part: u8| self.key.hash_one((micros, part));
        let signature = format!("{:016x}{:016x}{:016x}", part(0), part(1), part(2));
        format!("{}{}", glib::base64_encode(&micros.to_le_bytes()), &signature[..40])
    }

    fn is_fresh(&self, nonce: &str) -> bool {
        let stamp = nonce.get(..12).map(glib::base64_decode);
        let Some(Ok(micros)) = stamp.map(<[u8; 8]>::try_from) else {
            return false;
        };
        let issued = Duration::from_micros(u64::from_le_bytes(micros));
        nonce == self.nonce(issued) && now().saturating_sub(issued) <= self.nonce_lifetime
    }
}

fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Middleware for what faults do not touch.
pub(super) async fn require(State(site): State<Arc<Site>>, request: Request, next: Next) -> Response {
    if let Some(refusal) = site.guard.refuse(&request) {
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

    fn respond(challenge: &str, password: &str, target: &str) -> String {
        let mut parsed = WwwAuthenticateHeader::parse(challenge).unwrap();
        parsed.respond(&AuthContext::new("root", password, target)).unwrap().to_string()
    }

    #[test]
    fn digest_lets_in_who_signs_this_very_request() {
        for qop in [true, false] {
            let guard = guard(Auth::Digest { qop });
            let challenge = &guard.challenges(Refusal::Unknown)[0];
            assert_eq!(challenge.contains("qop=\"auth\""), qop);
            assert!(challenge.starts_with("Digest realm=\"AXIS_ACCC8E012345\", nonce=\""), "{challenge}");
            let right = respond(challenge, "pass", TARGET);
            assert_eq!(guard.check(Some(&right), "GET", TARGET), Ok(()));
            assert_eq!(guard.check(Some(&right), "POST", TARGET), Err(Refusal::Unknown));
            assert_eq!(guard.check(Some(&right), "GET", "/axis-cgi/com/ptz.cgi"), Err(Refusal::Unknown));
            let wrong = respond(challenge, "guess", TARGET);
            assert_eq!(guard.check(Some(&wrong), "GET", TARGET), Err(Refusal::Unknown));
        }
    }

    #[test]
    fn an_old_nonce_is_stale_and_a_foreign_one_too() {
        let settings = Settings { nonce_lifetime: Duration::ZERO, auth: Auth::Both, ..Settings::default() };
        let guard = Guard::new(&settings);
        let old =
            format!("Digest realm=\"{}\", nonce=\"{}\"", guard.realm, guard.nonce(Duration::from_secs(5)));
        let foreign = "Digest realm=\"AXIS_ACCC8E012345\", nonce=\"PNHWZB6nBQA=316099a1\"";
        for challenge in [old.as_str(), foreign] {
            let answer = respond(challenge, "pass", TARGET);
            assert_eq!(guard.check(Some(&answer), "GET", TARGET), Err(Refusal::Stale));
            let wrong = respond(challenge, "guess", TARGET);
            assert_eq!(guard.check(Some(&wrong), "GET", TARGET), Err(Refusal::Unknown));
        }
        assert!(guard.challenges(Refusal::Stale)[0].contains("stale=true"));
    }

    #[test]
    fn basic_knows_the_password() {
        let right = format!("Basic {}", glib::base64_encode(b"root:pass"));
        let wrong = format!("Basic {}", glib::base64_encode(b"root:guess"));
        for auth in [Auth::Basic, Auth::Both] {
            assert_eq!(guard(auth).check(Some(&right), "GET", TARGET), Ok(()));
            assert_eq!(guard(auth).check(Some(&wrong), "GET", TARGET), Err(Refusal::Unknown));
            assert_eq!(guard(auth).check(None, "GET", TARGET), Err(Refusal::Unknown));
        }
        assert_eq!(
            guard(Auth::Digest { qop: true }).check(Some(&right), "GET", TARGET),
            Err(Refusal::Unknown)
        );
        assert_eq!(guard(Auth::None).check(None, "GET", TARGET), Ok(()));
    }
}
