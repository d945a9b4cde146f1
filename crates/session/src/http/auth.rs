// SPDX-License-Identifier: MPL-2.0

//! Basic and Digest authentication (RFC 7617; RFC 2069, 2617, 7616).

use base64::prelude::{BASE64_STANDARD, Engine};
use digest_auth::{AuthContext, HttpMethod, WwwAuthenticateHeader};
use reqwest::header::{HeaderMap, HeaderValue, WWW_AUTHENTICATE};
use serde::{Deserialize, Serialize};

use super::{Secret, excerpt};
use crate::Error;

/// A longer challenge is none: real ones have about 200 characters.
const MAX_CHALLENGE_BYTES: usize = 4096;

/// By which kinds of authentication user and password may be proved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Authentication {
    /// Digest, or over TLS Basic where the camera has never asked for Digest.
    #[default]
    Auto,
    /// Also Basic in clear: whoever listens, or answers in the camera's place, then has the password.
    Basic,
}

/// A user and the password. Serialised with the password, for the socket of the watchdog and nothing else.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Credentials {
    /// The user.
    pub user: String,
    /// The password.
    #[serde(with = "super::secret::in_clear")]
    pub password: Secret,
}

/// Answers the camera's challenges, and keeps the last one: every later request is signed without
/// being asked, which saves a round trip for each command.
#[derive(Debug)]
pub struct Authenticator {
    credentials: Option<Credentials>,
    allowed: Authentication,
    challenge: Option<Challenge>,
    /// Whether the camera has ever asked for Digest: whoever asks for less then may be somebody else.
    knows_digest: bool,
}

#[derive(Debug)]
enum Challenge {
    Basic,
    /// Counts its own uses (`nc`). Boxed as it is a dozen times the other's size.
    Digest(Box<WwwAuthenticateHeader>),
}

impl Authenticator {
    /// Nobody has asked yet.
    pub fn new(credentials: Option<Credentials>, allowed: Authentication) -> Self {
        Self { credentials, allowed, challenge: None, knows_digest: false }
    }

    /// Takes another user or password.
    pub fn set_credentials(&mut self, credentials: Option<Credentials>) {
        (self.credentials, self.challenge) = (credentials, None);
    }

    /// Who we are.
    pub fn user(&self) -> &str {
        self.credentials.as_ref().map_or("", |credentials| &credentials.user)
    }

    /// Whether requests are signed: the camera has asked for it.
    pub fn is_signing(&self) -> bool {
        self.challenge.is_some()
    }

    /// The `Authorization` of a request with this method for exactly this path and query, or in RTSP this address; `None`
    /// before the first challenge.
    ///
    /// # Errors
    /// [`Error::UnsupportedAuthentication`] where the challenge cannot be answered.
    pub fn authorization(&mut self, method: &str, target: &str) -> Result<Option<HeaderValue>, Error> {
        let (Some(credentials), Some(challenge)) = (&self.credentials, &mut self.challenge) else {
            return Ok(None);
        };
        let password = credentials.password.reveal();
        let text = match challenge {
            Challenge::Basic => basic(&credentials.user, password),
            Challenge::Digest(challenge) => challenge
                .respond(&AuthContext::new_with_method(
                    credentials.user.as_str(),
                    password,
                    target,
                    None::<&[u8]>,
                    HttpMethod::from(method),
                ))
                .map_err(|err| Error::UnsupportedAuthentication(err.to_string()))?
                .to_string(),
        };
        let mut value = HeaderValue::from_str(&text).map_err(|_| {
            Error::UnsupportedAuthentication("user or realm has characters HTTP cannot carry".to_owned())
        })?;
        value.set_sensitive(true);
        Ok(Some(value))
    }

    /// Takes the challenges of a 401, which came over TLS with a certificate that was verified, or not. Returns whether the camera calls
    /// the old one stale, which means that the credentials themselves were right.
    ///
    /// # Errors
    /// [`Error::CredentialsMissing`], [`Error::UnsupportedAuthentication`] where none is Basic or Digest, or
    /// [`Error::BasicRefused`].
    pub fn challenged(&mut self, headers: &HeaderMap, is_verified: bool) -> Result<bool, Error> {
        if self.credentials.is_none() {
            return Err(Error::CredentialsMissing);
        }
        let offers: Vec<String> = headers
            .get_all(WWW_AUTHENTICATE)
            .iter()
            .filter_map(|value| value.to_str().ok())
            .filter(|offer| offer.len() <= MAX_CHALLENGE_BYTES)
            .flat_map(split_challenges)
            .collect();
        let digest = offers.iter().filter_map(|offer| parameters_of(offer, "Digest")).find_map(parse_digest);
        if let Some(digest) = digest {
            let stale = digest.stale;
            self.knows_digest = true;
            self.challenge = Some(Challenge::Digest(Box::new(digest)));
            return Ok(stale);
        }
        if offers.iter().any(|offer| parameters_of(offer, "Basic").is_some()) {
            if self.allowed == Authentication::Auto && (!is_verified || self.knows_digest) {
                self.challenge = None;
                return Err(Error::BasicRefused);
            }
            self.challenge = Some(Challenge::Basic);
            return Ok(false);
        }
        Err(Error::UnsupportedAuthentication(excerpt(&offers.join("; "))))
    }

    /// Forgets the challenge: what was asked over HTTP says nothing of what HTTPS will ask.
    pub fn forget_challenge(&mut self) {
        self.challenge = None;
    }
}

/// The `Authorization` with which a GET of `target` (path and query) answers a `WWW-Authenticate`.
///
/// # Errors
/// [`Error::UnsupportedAuthentication`] where the challenge is neither Basic nor Digest, or cannot be answered.
pub fn answer_to_challenge(
    challenge: &str,
    credentials: Credentials,
    target: &str,
) -> Result<HeaderValue, Error> {
    let unsupported = || Error::UnsupportedAuthentication(excerpt(challenge));
    let mut authenticator = Authenticator::new(Some(credentials), Authentication::Basic);
    let challenge = HeaderValue::from_str(challenge).map_err(|_| unsupported())?;
    authenticator.challenged(&HeaderMap::from_iter([(WWW_AUTHENTICATE, challenge)]), false)?;
    authenticator.authorization("GET", target)?.ok_or_else(unsupported)
}

fn basic(user: &str, password: &str) -> String {
    format!("Basic {}", BASE64_STANDARD.encode(format!("{user}:{password}")))
}

fn parse_digest(parameters: &str) -> Option<WwwAuthenticateHeader> {
    WwwAuthenticateHeader::parse(parameters).ok()
}

/// What follows the scheme, where the challenge is of that scheme; its case does not matter.
fn parameters_of<'a>(challenge: &'a str, scheme: &str) -> Option<&'a str> {
    let (name, parameters) = challenge.split_once(' ').unwrap_or((challenge, ""));
    name.eq_ignore_ascii_case(scheme).then_some(parameters)
}

/// Splits a header that carries several challenges: commas part both challenges and their parameters,
/// and only a part that begins with a word of its own (`Digest realm=...`) begins a challenge.
fn split_challenges(header: &str) -> Vec<String> {
    let mut challenges: Vec<String> = Vec::new();
    for part in split_unquoted(header) {
        let part = part.trim();
        let word = part.split('=').next().unwrap_or(part).trim_end();
        let begins = word.contains(' ') || !part.contains('=');
        match challenges.last_mut() {
            Some(challenge) if !begins => {
                challenge.push_str(", ");
                challenge.push_str(part);
            }
            _ if part.is_empty() => {}
            _ => challenges.push(part.to_owned()),
        }
    }
    challenges
}

/// Splits at commas outside of quoted strings.
fn split_unquoted(text: &str) -> Vec<&str> {
    let (mut parts, mut start, mut quoted, mut escaped) = (Vec::new(), 0, false, false);
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            b',' if !quoted => {
                parts.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn authenticator(user: &str, password: &str) -> Authenticator {
        let credentials = Credentials { user: user.to_owned(), password: Secret::new(password) };
        Authenticator::new(Some(credentials), Authentication::Auto)
    }

    fn headers(challenges: &[&str]) -> HeaderMap {
        challenges
            .iter()
            .map(|challenge| (WWW_AUTHENTICATE, HeaderValue::from_str(challenge).unwrap()))
            .collect()
    }

    fn authorization(authenticator: &mut Authenticator, target: &str) -> String {
        authenticator.authorization("GET", target).unwrap().unwrap().to_str().unwrap().to_owned()
    }

    #[test]
    fn nothing_is_sent_before_the_challenge() {
        assert_eq!(authenticator("root", "pass").authorization("GET", "/").unwrap(), None);
    }

    #[test]
    fn digest_is_taken_where_basic_is_offered_too() {
        let offers: [&[&str]; 3] = [
            &[r#"Basic realm="AXIS_1""#, r#"Digest realm="AXIS_1", nonce="n", algorithm=MD5, qop="auth""#],
            &[r#"Basic realm="a, b", digest realm="AXIS_1", nonce="n", algorithm=MD5, qop="auth""#],
            &[r#"Digest realm="AXIS_1", nonce="n", algorithm=MD5, qop="auth", Basic realm="AXIS_1""#],
        ];
        for offer in offers {
            let mut authenticator = authenticator("root", "pass");
            assert!(!authenticator.challenged(&headers(offer), true).unwrap());
            let sent = authorization(&mut authenticator, "/a");
            assert!(sent.starts_with("Digest ") && sent.contains(r#"realm="AXIS_1""#), "{sent}");
        }
    }

    #[test]
    fn the_nonce_is_reused_and_counted() {
        let mut authenticator = authenticator("root", "pass");
        let challenge =
            r#"Digest realm="AXIS_ACCC8EB3494E", nonce="PNHWZB6nBQA=316099a1", algorithm=MD5, qop="auth""#;
        authenticator.challenged(&headers(&[challenge]), true).unwrap();
        let target = "/axis-cgi/com/ptz.cgi?camera=1&continuouspantiltmove=-49,0";
        for count in ["nc=00000001", "nc=00000002", "nc=00000003"] {
            let sent = authorization(&mut authenticator, target);
            assert!(sent.contains(count) && sent.contains(target), "{sent}");
        }
    }

    #[test]
    fn a_stale_nonce_is_no_refusal() {
        let challenge = r#"Digest realm="AXIS_1", nonce="n", stale=true, algorithm=MD5, qop="auth""#;
        assert!(authenticator("root", "pass").challenged(&headers(&[challenge]), true).unwrap());
    }

    #[test]
    fn rfc_2069_is_answered_without_qop() {
        // RFC 2069's example with the response of its erratum.
        let mut authenticator = authenticator("Mufasa", "CircleOfLife");
        let challenge = r#"Digest realm="testrealm@host.com", nonce="dcd98b7102dd2f0e8b11d0f600bfb0c093", opaque="5ccc069c403ebaf9f0171e9517f40e41""#;
        authenticator.challenged(&headers(&[challenge]), true).unwrap();
        let sent = authorization(&mut authenticator, "/dir/index.html");
        assert!(sent.contains(r#"response="1949323746fe6a43ef61f9606e7febea""#), "{sent}");
        assert!(!sent.contains("qop") && !sent.contains("cnonce"), "{sent}");
    }

    /// RFC 2617 section 3.5 and RFC 7616 section 3.9.1; the client nonce must be theirs.
    #[test]
    fn vectors_of_the_rfcs() {
        let rfc_7616 = r#"realm="http-auth@example.org", qop="auth, auth-int", nonce="7ypf/xlj9XXwfDPEoM4URrv/xwf94BcCAzFZH4GiTo0v", opaque="FQhe/qaU925kfnzjCev0ciny7QMkPqMAFRtzCUYo5tdS""#;
        let vectors = [
            (
                r#"realm="testrealm@host.com", qop="auth,auth-int", nonce="dcd98b7102dd2f0e8b11d0f600bfb0c093", opaque="5ccc069c403ebaf9f0171e9517f40e41""#.to_owned(),
                "Circle Of Life",
                "0a4f113b",
                "6629fae49393a05397450978507c4ef1",
            ),
            (
                format!("{rfc_7616}, algorithm=MD5"),
                "Circle of Life",
                "f2/wE4q74E6zIJEtWaHKaf5wv/H5QzzpXusqGemxURZJ",
                "8ca523f5e9506fed4657c9700eebdbec",
            ),
            (
                format!("{rfc_7616}, algorithm=SHA-256"),
                "Circle of Life",
                "f2/wE4q74E6zIJEtWaHKaf5wv/H5QzzpXusqGemxURZJ",
                "753927fa0e85d155564e2e272a28d1802ca10daf4496794697cf8db5856cb6c1",
            ),
        ];
        for (challenge, password, cnonce, response) in vectors {
            let mut context = AuthContext::new("Mufasa", password, "/dir/index.html");
            context.set_custom_cnonce(cnonce);
            assert_eq!(parse_digest(&challenge).unwrap().respond(&context).unwrap().response, response);
        }
    }

    /// Recorded with an Axis camera whose account was root/pass; over RTSP, hence the methods.
    #[test]
    fn recorded_answers_to_a_challenge_without_qop() {
        let challenge = r#"realm="AXIS_ACCC8E012345", nonce="0000eb57Y1462133062b37999f0cd530f02755fa37b8df1", stale=FALSE"#;
        let uri = "rtsp://127.0.0.1/axis-media/media.amp?video=0&audio=0&event=on";
        let recorded = [
            ("TEARDOWN", "2417a81b93d5ae64926d226e18a5ab99"),
            ("OPTIONS", "359495f9e42106627750e3cd65145f6b"),
        ];
        for (method, response) in recorded {
            let mut challenge = parse_digest(challenge).unwrap();
            assert!(!challenge.stale && challenge.qop.is_none());
            let mut context = AuthContext::new("root", "pass", uri);
            context.method = HttpMethod(std::borrow::Cow::Borrowed(method));
            assert_eq!(challenge.respond(&context).unwrap().response, response);
        }
    }

    #[test]
    fn basic_is_taken_where_the_camera_is_verified_or_it_is_allowed() {
        let basic = &[r#"Basic realm="x""#];
        for (allowed, is_verified, taken) in [
            (Authentication::Auto, false, false),
            (Authentication::Auto, true, true),
            (Authentication::Basic, false, true),
        ] {
            let mut authenticator = Authenticator { allowed, ..authenticator("root", "pass") };
            assert_eq!(authenticator.challenged(&headers(basic), is_verified).is_ok(), taken);
            assert_eq!(authenticator.authorization("GET", "/").unwrap().is_some(), taken);
        }
    }

    #[test]
    fn digest_once_seen_stays() {
        let digest = r#"Digest realm="AXIS_1", nonce="n", algorithm=MD5, qop="auth""#;
        let mut authenticator = authenticator("root", "pass");
        authenticator.challenged(&headers(&[digest]), true).unwrap();
        authenticator.set_credentials(Some(Credentials { user: "a".to_owned(), password: Secret::new("b") }));
        let err = authenticator.challenged(&headers(&[r#"Basic realm="x""#]), true).unwrap_err();
        assert_eq!(err, Error::BasicRefused);
        assert_eq!(authenticator.authorization("GET", "/").unwrap(), None);
    }

    #[test]
    fn basic_is_base64() {
        let mut authenticator = authenticator("Aladdin", "open sesame");
        authenticator.challenged(&headers(&[r#"Basic realm="x""#]), true).unwrap();
        assert_eq!(authorization(&mut authenticator, "/"), "Basic QWxhZGRpbjpvcGVuIHNlc2FtZQ==");
    }

    #[test]
    fn what_is_not_spoken_is_named() {
        let err = authenticator("root", "pass").challenged(&headers(&["Negotiate"]), true).unwrap_err();
        assert_eq!(err, Error::UnsupportedAuthentication("Negotiate".to_owned()));
        let err = Authenticator::new(None, Authentication::Basic)
            .challenged(&headers(&["Basic realm=\"x\""]), true)
            .unwrap_err();
        assert_eq!(err, Error::CredentialsMissing);
    }

    #[test]
    fn a_challenge_without_end_is_none() {
        let endless = format!("Digest realm=\"{}\", nonce=\"n\"", "x".repeat(MAX_CHALLENGE_BYTES));
        let credentials = Credentials { user: "root".to_owned(), password: Secret::new("pass") };
        let err = answer_to_challenge(&endless, credentials, "/").unwrap_err();
        assert!(err.to_string().len() < 256, "{err}");
    }

    proptest! {
        #[test]
        fn any_challenge_is_taken_or_refused(text in "[ -~]{0,128}") {
            let mut authenticator = authenticator("root", "pass");
            if authenticator.challenged(&headers(&[&text]), true).is_ok() {
                let _ = authenticator.authorization("GET", "/axis-cgi/com/ptz.cgi");
            }
        }

        #[test]
        fn any_digest_challenge_is_taken_or_refused(text in "(realm|nonce|qop|algorithm|stale|opaque|=|\"|,| |\\\\|MD5|x){0,24}") {
            let mut authenticator = authenticator("root", "pass");
            if authenticator.challenged(&headers(&[&format!("Digest {text}")]), true).is_ok() {
                let _ = authenticator.authorization("GET", "/axis-cgi/com/ptz.cgi");
            }
        }
    }
}
