// SPDX-License-Identifier: MPL-2.0

//! WS-UsernameToken: who we are, without the password (OASIS Web Services Security UsernameToken Profile 1.1).

use base64::prelude::{BASE64_STANDARD, Engine};
use session::http::Credentials;
use sha1::{Digest, Sha1};

use crate::soap::escaped;

/// Longer ones are refused by some cameras (onvif-rs issue 114).
const NONCE_BYTES: usize = 16;

/// The header that proves who we are at a time of the camera's, such as `2026-11-24T20:00:00Z`.
///
/// A machine without random numbers proves nothing: the header is empty then.
pub fn security(credentials: &Credentials, created: &str) -> String {
    let mut nonce = [0; NONCE_BYTES];
    if getrandom::fill(&mut nonce).is_err() {
        return String::new();
    }
    let digest = password_digest(&nonce, created, credentials.password.reveal());
    format!(
        concat!(
            r#"<wsse:Security s:mustUnderstand="1""#,
            r#" xmlns:wsse="http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd""#,
            r#" xmlns:wsu="http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-utility-1.0.xsd">"#,
            "<wsse:UsernameToken><wsse:Username>{}</wsse:Username>",
            r#"<wsse:Password Type="http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-username-token-profile-1.0#PasswordDigest">{}</wsse:Password>"#,
            r#"<wsse:Nonce EncodingType="http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-soap-message-security-1.0#Base64Binary">{}</wsse:Nonce>"#,
            "<wsu:Created>{}</wsu:Created></wsse:UsernameToken></wsse:Security>"
        ),
        escaped(&credentials.user),
        digest,
        BASE64_STANDARD.encode(nonce),
        created
    )
}

/// `Base64(SHA-1(nonce + created + password))`.
fn password_digest(nonce: &[u8], created: &str, password: &str) -> String {
    let digest = Sha1::new().chain_update(nonce).chain_update(created).chain_update(password);
    BASE64_STANDARD.encode(digest.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use session::http::Secret;

    /// The example of the ONVIF Application Programmer's Guide, 6.1.1.3.
    #[test]
    fn the_documented_digest() {
        let nonce = BASE64_STANDARD.decode("LKqI6G/AikKCQrN0zqZFlg==").unwrap();
        let digest = password_digest(&nonce, "2010-09-16T07:50:45Z", "userpassword");
        assert_eq!(digest, "tuOSpGlFlIXsozq4HFNeeGeFLEI=");
    }

    #[test]
    fn the_password_is_not_in_it() {
        let credentials = Credentials { user: "<a>".to_owned(), password: Secret::new("geheim") };
        let header = security(&credentials, "2026-11-24T20:00:00Z");
        assert!(header.contains("&lt;a&gt;") && !header.contains("geheim"), "{header}");
    }
}
