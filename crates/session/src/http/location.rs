// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use reqwest::Url;
use serde::{Deserialize, Serialize};

use super::Secret;
use crate::Error;

/// Where the camera is: `http://host`, `https://host:port`, or behind a proxy `https://host/path`. Holds no user and no
/// password.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Location(Url);

/// What an address of the form `http://user:password@host` carries besides the location.
#[derive(Debug, Default)]
pub struct UserInfo {
    /// The user.
    pub user: Option<String>,
    /// The password.
    pub password: Option<Secret>,
}

impl Location {
    /// Reads an address; a user and a password in it are taken out and given back apart, so that the
    /// location can be logged.
    ///
    /// # Errors
    /// [`Error::Location`] where it is no `http` or `https` address of a host.
    pub fn parse(text: &str) -> Result<(Self, UserInfo), Error> {
        let shown = without_user_info(text);
        let wrong = |reason: String| Error::Location { location: shown.clone(), reason };
        let mut url = Url::parse(text.trim()).map_err(|err| wrong(err.to_string()))?;
        if !matches!(url.scheme(), "http" | "https") {
            return Err(wrong("neither http nor https".to_owned()));
        }
        if !url.has_host() {
            return Err(wrong("no host".to_owned()));
        }
        let user_info = UserInfo {
            user: Some(decoded(url.username())).filter(|user| !user.is_empty()),
            password: url.password().map(|password| Secret::new(decoded(password))),
        };
        // A cleared address has no query and no user that could reach a log or a request.
        if url.set_username("").and_then(|()| url.set_password(None)).is_err() {
            return Err(wrong("user and password cannot be taken out".to_owned()));
        }
        let path = prefix(url.path()).to_owned();
        url.set_path(&path);
        url.set_query(None);
        url.set_fragment(None);
        Ok((Self(url), user_info))
    }

    /// Whether it is spoken to over TLS.
    pub fn is_https(&self) -> bool {
        self.0.scheme() == "https"
    }

    /// Its path; empty where there is none.
    pub fn path(&self) -> &str {
        self.0.path().trim_end_matches('/')
    }

    /// The same without a path.
    pub fn origin(&self) -> Self {
        let mut url = self.0.clone();
        url.set_path("");
        Self(url)
    }

    /// The address of a request below its own path; `target` is path and query.
    pub(super) fn join(&self, target: &str) -> Url {
        self.at(&format!("{}{target}", self.path()))
    }

    /// The address of a request to this path and query of its host, and of no other: cameras tell paths, and one that begins
    /// with two slashes names a host where it is resolved as a link is.
    pub(super) fn at(&self, target: &str) -> Url {
        let (path, query) =
            target.split_once('?').map_or((target, None), |(path, query)| (path, Some(query)));
        let mut url = self.0.clone();
        url.set_path(path);
        url.set_query(query);
        url
    }

    /// The camera's own HTTPS, where `redirect` leads there from `target`; anything else could carry off the credentials.
    pub(super) fn upgraded_by(&self, redirect: &str, target: &str) -> Option<Self> {
        let redirected = self.0.join(redirect).ok()?;
        let upgrade =
            !self.is_https() && redirected.scheme() == "https" && redirected.host() == self.0.host();
        let (location, _) = upgrade.then(|| Self::parse(redirected.as_str()).ok())??;
        if self.at(target).path() == redirected.path() {
            let mut url = redirected;
            url.set_path(self.0.path());
            url.set_query(None);
            return Some(Self(url));
        }
        // Elsewhere on the same host somebody else may be.
        Some(location).filter(|location| location.0.path() == self.0.path())
    }
}

impl From<Location> for String {
    fn from(location: Location) -> Self {
        location.to_string()
    }
}

impl TryFrom<String> for Location {
    type Error = Error;

    fn try_from(text: String) -> Result<Self, Error> {
        Self::parse(&text).map(|(location, _)| location)
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.as_str().trim_end_matches('/'))
    }
}

/// What of a path stands before that of the camera's own requests, which is often pasted along.
fn prefix(path: &str) -> &str {
    const OWN: [&str; 2] = ["/axis-cgi", "/axis-media"];
    let end = OWN.iter().filter_map(|own| path.find(own)).min().unwrap_or(path.len());
    path.get(..end).unwrap_or(path).trim_end_matches('/')
}

/// `text` without what stands before an `@` in its authority, for messages about addresses that do not parse.
pub fn without_user_info(text: &str) -> String {
    match text.rsplit_once('@') {
        Some((before, host)) => {
            let scheme = before.split_once("://").map_or("", |(scheme, _)| scheme);
            if scheme.is_empty() { host.to_owned() } else { format!("{scheme}://{host}") }
        }
        None => text.to_owned(),
    }
}

/// Undoes percent encoding.
fn decoded(text: &str) -> String {
    percent_encoding::percent_decode_str(text).decode_utf8_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn user_and_password_are_taken_out() {
        let (location, info) = Location::parse("http://root:p%40ss@camera:8080/axis-cgi?x=1#y").unwrap();
        assert_eq!(location.to_string(), "http://camera:8080");
        assert_eq!(info.user.as_deref(), Some("root"));
        assert_eq!(info.password, Some(Secret::new("p@ss")));
        assert!(!format!("{location:?} {info:?}").contains("p@ss"));
    }

    #[test]
    fn a_path_in_front_of_the_cameras_own_is_kept() {
        for (text, shown, request) in [
            ("http://camera", "http://camera", "http://camera/axis-cgi/a?b=c"),
            ("http://camera/", "http://camera", "http://camera/axis-cgi/a?b=c"),
            ("https://proxy/door/1", "https://proxy/door/1", "https://proxy/door/1/axis-cgi/a?b=c"),
            ("https://proxy/door/1/", "https://proxy/door/1", "https://proxy/door/1/axis-cgi/a?b=c"),
            ("http://proxy/1/axis-cgi/com/ptz.cgi?info=1", "http://proxy/1", "http://proxy/1/axis-cgi/a?b=c"),
        ] {
            let (location, _) = Location::parse(text).unwrap();
            assert_eq!(location.to_string(), shown);
            assert_eq!(location.join("/axis-cgi/a?b=c").as_str(), request);
            assert_eq!(Location::parse(&location.to_string()).unwrap().0, location);
        }
        let (location, _) = Location::parse("http://proxy/1").unwrap();
        let upgraded = |redirect| location.upgraded_by(redirect, "/").map(|location| location.to_string());
        assert_eq!(upgraded("https://proxy/1/axis-cgi/a"), Some("https://proxy/1".to_owned()));
        assert_eq!(upgraded("https://proxy/2/axis-cgi/a"), None);
        let (location, _) = Location::parse("http://camera").unwrap();
        let service = "/onvif/ptz_service";
        let upgraded = location.upgraded_by("https://camera/onvif/ptz_service", service).unwrap();
        assert_eq!(upgraded.at(service).as_str(), "https://camera/onvif/ptz_service");
    }

    #[test]
    fn nonsense_is_refused_without_repeating_the_password() {
        for text in
            ["", "camera", "rtsp://root:geheim@camera/", "http://root:geheim@", "http://a:geheim@b:99999"]
        {
            let err = Location::parse(text).unwrap_err().to_string();
            assert!(!err.contains("geheim"), "{err}");
            assert!(err.contains("http://192.168.0.90"), "{err}");
        }
    }

    #[test]
    fn only_the_cameras_own_https_is_an_upgrade() {
        let (location, _) = Location::parse("http://camera").unwrap();
        let upgraded = location.upgraded_by("https://camera/axis-cgi/com/ptz.cgi?query=limits", "/").unwrap();
        assert_eq!(upgraded.to_string(), "https://camera");
        assert_eq!(location.upgraded_by("https://elsewhere/axis-cgi", "/axis-cgi"), None);
        assert_eq!(location.upgraded_by("/login.html", "/login.html"), None);
        assert_eq!(upgraded.upgraded_by("http://camera/", "/"), None);
    }

    /// Who tells such a path would have the password for another host.
    #[test]
    fn no_path_leads_to_another_host() {
        for base in ["http://camera:8080", "https://camera:8443/door/1"] {
            let (location, _) = Location::parse(base).unwrap();
            for target in [
                "//elsewhere/x",
                "/\\elsewhere/x",
                "\\\\elsewhere",
                "http://elsewhere/",
                "@elsewhere",
                ":1@elsewhere/",
            ] {
                assert_eq!(location.at(target).origin(), location.0.origin(), "{target}");
                assert_eq!(location.join(target).origin(), location.0.origin(), "{target}");
            }
        }
    }

    /// Else a signature would be for something else than is asked.
    #[test]
    fn path_and_query_are_sent_as_they_are() {
        let (location, _) = Location::parse("http://camera:8080/1").unwrap();
        for target in [
            "/axis-cgi/com/ptz.cgi?camera=1&continuouspantiltmove=-12,100",
            "/axis-cgi/param.cgi?action=list&group=root.PTZ,Properties.PTZ",
            "/axis-cgi/com/ptz.cgi?gotoserverpresetname=T%C3%BCr%20%26%20Tor",
            "/axis-cgi/com/ptz.cgi?center=320,240&imagewidth=640?b",
            "/onvif/ptz_service?",
            "//onvif/ptz_service",
        ] {
            assert_eq!(location.at(target).as_str(), format!("http://camera:8080{target}"));
            assert_eq!(location.join(target).as_str(), format!("http://camera:8080/1{target}"));
            let below = format!("http://camera:8080/1{target}");
            assert_eq!(Url::parse(&below).unwrap(), location.join(target), "as it was resolved before");
        }
    }

    proptest! {
        #[test]
        fn no_text_leads_to_another_host(target in ".{0,64}") {
            let (location, _) = Location::parse("http://camera:8080").unwrap();
            prop_assert_eq!(location.at(&target).origin(), location.0.origin());
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,64}") {
            let _ = Location::parse(&text);
        }
    }
}
