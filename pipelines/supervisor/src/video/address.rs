// SPDX-License-Identifier: MPL-2.0

//! Where a camera is, by its address of RTSP.

/// RFC 7826, section 4.2; IANA.
const PORT: u16 = 554;
const TLS_PORT: u16 = 322;

/// Host and port of an address of RTSP, and whether it is by TLS.
pub fn rtsp_host(address: &str) -> Option<(String, u16, bool)> {
    let (rest, tls) = match address.strip_prefix("rtsp://") {
        Some(rest) => (rest, false),
        None => (address.strip_prefix("rtsps://")?, true),
    };
    let rest = rest.trim_end_matches('/');
    let wrong = |c: char| c.is_whitespace() || matches!(c, '/' | '@' | '?' | '#');
    let colon = rest.rfind(':').filter(|colon| rest.rfind(']').is_none_or(|end| end < *colon));
    let (host, port) = match colon {
        Some(colon) => (rest.get(..colon)?, rest.get(colon + 1..)?.parse().ok()?),
        None => (rest, if tls { TLS_PORT } else { PORT }),
    };
    (!host.is_empty() && !rest.contains(wrong)).then(|| (host.to_owned(), port, tls))
}
