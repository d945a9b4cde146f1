// SPDX-License-Identifier: MPL-2.0

//! The words of VAPIX: requests understood, answers spelt. No network here.

pub(crate) mod device;
mod help;
pub(crate) mod params;
mod ptz;
pub(crate) mod queue;

/// Name and value pairs of a request, decoded, in their order.
pub(crate) type Args = Vec<(String, String)>;

/// Takes a query or a form apart.
pub(crate) fn parse_args(encoded: &[u8]) -> Args {
    form_urlencoded::parse(encoded).into_owned().collect()
}

/// What a CGI says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum CgiResponse {
    /// 204: accepted.
    Accepted,
    /// 200 with text.
    Text(String),
    /// 200 with text, and a cookie by which the client is to be known.
    Introduced { cookie: String, text: String },
}

impl CgiResponse {
    /// A failure, which VAPIX reports as success with a text.
    pub fn error(message: impl std::fmt::Display) -> Self {
        Self::Text(format!("Error:{message}\r\n"))
    }
}
