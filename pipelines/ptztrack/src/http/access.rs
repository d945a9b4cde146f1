// SPDX-License-Identifier: MPL-2.0

//! Who may see and steer.

use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use subtle::ConstantTimeEq;

use super::Visit;
use crate::config::{Credentials, Http, Secret};

/// What is asked of everybody, for all but `/healthz`.
#[derive(Debug)]
pub struct Access {
    hosts: Vec<String>,
    credentials: Option<Credentials>,
}

impl Access {
    pub fn new(http: &Http) -> Self {
        let ip = match http.listen.ip() {
            IpAddr::V6(ip) => format!("[{ip}]"),
            ip @ IpAddr::V4(_) => ip.to_string(),
        };
        let own = [ip, "localhost".to_owned(), "127.0.0.1".to_owned(), "[::1]".to_owned()];
        Self {
            hosts: own.into_iter().chain(http.hosts.clone()).collect(),
            credentials: http.credentials.clone(),
        }
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
            Some(credentials) if !is(credentials, headers) => {
                Some((StatusCode::UNAUTHORIZED, "user and password are needed\n"))
            }
            _ => None,
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
    let visit = request.extensions().get::<Visit>();
    match access.refuse(request.method(), request.headers(), visit.map(|visit| visit.local)) {
        None => {
            if let Some(visit) = visit {
                visit.welcome.store(true, Ordering::Relaxed);
            }
            next.run(request).await
        }
        Some((StatusCode::UNAUTHORIZED, reason)) => {
            let ask = [(header::WWW_AUTHENTICATE, "Basic realm=\"ptztrack\", charset=\"UTF-8\"")];
            (StatusCode::UNAUTHORIZED, ask, reason).into_response()
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

    fn access(credentials: Option<Credentials>) -> Access {
        Access::new(&Http {
            listen: "127.0.0.1:9100".parse().unwrap(),
            hosts: vec!["cameras.example".to_owned()],
            credentials,
        })
    }

    fn answer(access: &Access, method: Method, headers: &[(header::HeaderName, &str)]) -> Option<u16> {
        let headers = headers.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect();
        let ip = Some("192.0.2.7".parse().unwrap());
        access.refuse(&method, &headers, ip).map(|(status, _)| status.as_u16())
    }

    #[test]
    fn it_answers_to_its_own_names_only() {
        let access = access(None);
        for host in ["127.0.0.1:9100", "localhost:9100", "[::1]:9100", "cameras.example", "192.0.2.7:9100"] {
            assert_eq!(answer(&access, Method::GET, &[(header::HOST, host)]), None, "{host}");
        }
        for host in ["evil.example:9100", "127.0.0.1.evil.example", "", "192.0.2.8:9100"] {
            assert_eq!(answer(&access, Method::GET, &[(header::HOST, host)]), Some(421), "{host}");
        }
    }

    #[test]
    fn only_its_own_page_steers() {
        let access = access(None);
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
    fn a_password_is_asked_for_where_there_is_one() {
        let credentials = Credentials { user: "guard".to_owned(), password: Secret::new("xyzzy") };
        let access = access(Some(credentials));
        let with = |text: &str| {
            let basic = format!("Basic {}", BASE64_STANDARD.encode(text));
            answer(&access, Method::GET, &[(header::HOST, "localhost"), (header::AUTHORIZATION, &basic)])
        };
        assert_eq!(with("guard:xyzzy"), None);
        assert_eq!((with("guard:plugh"), with("guard:xyzzy2"), with("")), (Some(401), Some(401), Some(401)));
        assert_eq!(answer(&access, Method::GET, &[(header::HOST, "localhost")]), Some(401));
    }
}
