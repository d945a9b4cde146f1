// SPDX-License-Identifier: MPL-2.0

//! Who may see and steer.

use std::net::IpAddr;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use subtle::ConstantTimeEq;

use ptztrack_contract::lock::lock;

use super::Visit;
use crate::config::{Credentials, Http, Secret};
use crate::event::{Event, Level};
use crate::log::Log;

/// Who says a wrong user or password waits for so long: whoever tries all of them has no more than so many tries a second on each of a
/// few connections.
const PAUSE: Duration = Duration::from_millis(500);
/// Between two times at which that is told.
const TELL_EVERY: Duration = Duration::from_secs(60);

/// What is asked of everybody, for all but `/healthz`.
#[derive(Debug)]
pub struct Access {
    hosts: Vec<String>,
    credentials: Result<Option<Credentials>, String>,
    refused: Mutex<Refused>,
    log: Arc<Log>,
}

/// Log-ins that were refused.
#[derive(Debug, Default)]
struct Refused {
    /// Since that was told last.
    count: u64,
    told: Option<Instant>,
}

impl Refused {
    /// One more: how many, where that is to be told.
    fn one_more(&mut self, now: Instant) -> Option<u64> {
        self.count += 1;
        if self.told.is_some_and(|told| now.saturating_duration_since(told) < TELL_EVERY) {
            return None;
        }
        self.told = Some(now);
        Some(std::mem::take(&mut self.count))
    }
}

impl Access {
    pub fn new(http: &Http, log: Arc<Log>) -> Self {
        let ip = match http.listen.ip() {
            IpAddr::V6(ip) => format!("[{ip}]"),
            ip @ IpAddr::V4(_) => ip.to_string(),
        };
        let own = [ip, "localhost".to_owned(), "127.0.0.1".to_owned(), "[::1]".to_owned()];
        Self {
            hosts: own.into_iter().chain(http.hosts.clone()).collect(),
            credentials: http.credentials.clone(),
            refused: Mutex::default(),
            log,
        }
    }

    /// Somebody there said a wrong user or password.
    fn tell_refused(&self, peer: Option<IpAddr>) {
        let Some(count) = lock(&self.refused).one_more(Instant::now()) else { return };
        let peer = peer.map_or_else(|| "an unknown address".to_owned(), |peer| peer.to_string());
        let detail = format!(
            "the page refused user and password, times: {count}; the last time they came from {peer}"
        );
        self.log.tell(&Event::new(Level::Warning, None, "log-in-refused", detail));
    }

    /// Why it is refused.
    fn refuse(
        &self,
        method: &Method,
        headers: &HeaderMap,
        ip: Option<IpAddr>,
    ) -> Option<(StatusCode, &'static str)> {
        let host = text(headers, header::HOST).unwrap_or_default();
        // A page elsewhere whose name was made to mean this machine (DNS rebinding) asks by that name.
        if !self.hosts.iter().any(|known| known == name_of(host)) && !is_own(host, ip) {
            return Some((
                StatusCode::MISDIRECTED_REQUEST,
                "not known by this name: `hosts` in [http] lists more\n",
            ));
        }
        let origin =
            text(headers, header::ORIGIN).map(|origin| origin.split_once("://").map(|(_, host)| host));
        if !method.is_safe() && origin.is_some_and(|origin| origin != Some(host)) {
            return Some((StatusCode::FORBIDDEN, "asked for by a page of somebody else\n"));
        }
        match &self.credentials {
            Ok(Some(credentials)) if !is(credentials, headers) => {
                Some((StatusCode::UNAUTHORIZED, "user and password are needed\n"))
            }
            Ok(_) => None,
            Err(_) => Some((
                StatusCode::SERVICE_UNAVAILABLE,
                "nobody is let in before the password in [http] can be read: the log says why it cannot\n",
            )),
        }
    }
}

/// Whether user `guard` with the password `xyzzy` is who says this of himself.
pub fn lets_in(authorization: &[u8]) -> bool {
    let Ok(authorization) = HeaderValue::from_bytes(authorization) else { return false };
    let guard = Credentials { user: "guard".to_owned(), password: Secret::new("xyzzy") };
    is(&guard, &HeaderMap::from_iter([(header::AUTHORIZATION, authorization)]))
}

/// Every request passes here.
pub async fn check(State(access): State<Arc<Access>>, request: Request, next: Next) -> Response {
    let visit = request.extensions().get::<Visit>().cloned();
    match access.refuse(request.method(), request.headers(), visit.as_ref().map(|visit| visit.local)) {
        None => {
            if let Some(visit) = visit {
                visit.welcome.store(true, Ordering::Relaxed);
            }
            next.run(request).await
        }
        Some((StatusCode::UNAUTHORIZED, reason)) => {
            // A browser says nothing at first, and then asks who sits before it.
            if request.headers().contains_key(header::AUTHORIZATION) {
                access.tell_refused(visit.map(|visit| visit.peer));
                tokio::time::sleep(PAUSE).await;
            }
            let ask = [(header::WWW_AUTHENTICATE, "Basic realm=\"ptztrack\", charset=\"UTF-8\"")];
            (StatusCode::UNAUTHORIZED, ask, reason).into_response()
        }
        Some(refusal @ (StatusCode::SERVICE_UNAVAILABLE, _)) => {
            // Whoever stays connected is answered by this page, and not by the one that lets them in.
            ([(header::CONNECTION, "close")], refusal).into_response()
        }
        Some(refusal) => refusal.into_response(),
    }
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// A host without its port.
fn name_of(host: &str) -> &str {
    match (host.find(']'), host.rfind(':')) {
        (Some(end), _) => &host[..=end],
        (None, Some(colon)) => &host[..colon],
        (None, None) => host,
    }
}

/// Whether that is the very address that was connected to, as where it listens on all.
fn is_own(host: &str, ip: Option<IpAddr>) -> bool {
    let named = name_of(host).trim_matches(['[', ']']).parse().ok();
    named.is_some() && named == ip
}

/// Whether they have said user and password, by Basic authentication.
fn is(credentials: &Credentials, headers: &HeaderMap) -> bool {
    let said = text(headers, header::AUTHORIZATION).and_then(|value| value.strip_prefix("Basic "));
    let Some(said) = said.and_then(|said| BASE64_STANDARD.decode(said).ok()) else { return false };
    let expected = format!("{}:{}", credentials.user, credentials.password.reveal());
    // In a time that tells nothing of how much was right.
    said.ct_eq(expected.as_bytes()).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(credentials: Result<Option<Credentials>, String>) -> Access {
        let http = Http {
            listen: "127.0.0.1:9100".parse().unwrap(),
            hosts: vec!["cameras.example".to_owned()],
            credentials,
        };
        Access::new(&http, Arc::default())
    }

    fn answer(access: &Access, method: Method, headers: &[(header::HeaderName, &str)]) -> Option<u16> {
        let headers = headers.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect();
        let ip = Some("192.0.2.7".parse().unwrap());
        access.refuse(&method, &headers, ip).map(|(status, _)| status.as_u16())
    }

    #[test]
    fn it_answers_to_its_own_names_only() {
        let access = access(Ok(None));
        for host in ["127.0.0.1:9100", "localhost:9100", "[::1]:9100", "cameras.example", "192.0.2.7:9100"] {
            assert_eq!(answer(&access, Method::GET, &[(header::HOST, host)]), None, "{host}");
        }
        for host in ["evil.example:9100", "127.0.0.1.evil.example", "", "192.0.2.8:9100"] {
            assert_eq!(answer(&access, Method::GET, &[(header::HOST, host)]), Some(421), "{host}");
        }
    }

    #[test]
    fn only_its_own_page_steers() {
        let access = access(Ok(None));
        let from = |method, origin| {
            answer(&access, method, &[(header::HOST, "localhost:9100"), (header::ORIGIN, origin)])
        };
        assert_eq!(from(Method::POST, "http://localhost:9100"), None);
        for origin in ["http://evil.example", "null", "http://localhost:9101"] {
            assert_eq!(from(Method::POST, origin), Some(403), "{origin}");
        }
        // It learns nothing by this: browsers keep the answer from it.
        assert_eq!(from(Method::GET, "http://evil.example"), None);
    }

    #[test]
    fn without_the_password_that_there_should_be_nobody_is_let_in() {
        let access = access(Err("no password: it is not there".to_owned()));
        let basic = format!("Basic {}", BASE64_STANDARD.encode("guard:"));
        let headers = [(header::HOST, "localhost"), (header::AUTHORIZATION, &basic)];
        assert_eq!(answer(&access, Method::GET, &headers[..1]), Some(503));
        assert_eq!(answer(&access, Method::GET, &headers), Some(503));
    }

    #[test]
    fn refused_log_ins_are_told_once_a_minute_with_how_many_there_were() {
        let (begin, mut refused) = (Instant::now(), Refused::default());
        let told = (0..150).filter_map(|second| refused.one_more(begin + Duration::from_secs(second)));
        assert_eq!(told.collect::<Vec<_>>(), [1, 60, 60]);
    }

    #[test]
    fn a_password_is_asked_for_where_there_is_one() {
        let credentials = Credentials { user: "guard".to_owned(), password: Secret::new("xyzzy") };
        let access = access(Ok(Some(credentials)));
        let with = |text: &str| {
            let basic = format!("Basic {}", BASE64_STANDARD.encode(text));
            answer(&access, Method::GET, &[(header::HOST, "localhost"), (header::AUTHORIZATION, &basic)])
        };
        assert_eq!(with("guard:xyzzy"), None);
        assert_eq!((with("guard:plugh"), with("guard:xyzzy2"), with("")), (Some(401), Some(401), Some(401)));
        assert_eq!(answer(&access, Method::GET, &[(header::HOST, "localhost")]), Some(401));
    }
}
