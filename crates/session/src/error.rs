// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

/// Why the camera did not do what it was asked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The address is no camera address.
    #[error("`{location}` is not a camera address ({reason}); expected something like http://192.168.0.90")]
    Location {
        /// The address, without user and password.
        location: String,
        /// What is wrong with it.
        reason: String,
    },
    /// TLS could not be set up.
    #[error("TLS cannot be set up: {0}")]
    Tls(String),
    /// No connection came about.
    #[error("cannot connect to the camera: {0}")]
    Unreachable(String),
    /// The camera did not answer in time.
    #[error("the camera did not answer within {0:?}")]
    Timeout(Duration),
    /// The connection broke, or what came over it was not HTTP.
    #[error("the connection to the camera failed: {0}")]
    Broken(String),
    /// The camera wants credentials and none are set.
    #[error("the camera asks for a user and password, but none are set")]
    CredentialsMissing,
    /// The camera refused user and password. Nothing more is sent, so that the account is not locked.
    #[error("the camera refuses user `{user}` with this password")]
    BadCredentials {
        /// The user that was refused.
        user: String,
    },
    /// The camera asks again for user and password, which it accepted before for something else. To be asked rarely:
    /// it may count this as a wrong login.
    #[error("the camera accepts user `{user}`, but does not permit this")]
    NotPermitted {
        /// The user that may not.
        user: String,
    },
    /// The camera wants a kind of authentication that is not spoken here.
    #[error("the camera asks for an unsupported kind of authentication: {0}")]
    UnsupportedAuthentication(String),
    /// The camera asks for Basic authentication, and that may not be given.
    #[error("the camera asks for Basic authentication, which shows the password to whoever listens")]
    BasicRefused,
    /// An HTTP status that is neither success nor a challenge.
    #[error("the camera answered HTTP {status}{space}{reason}", space = if reason.is_empty() { "" } else { " " })]
    Status {
        /// The status code.
        status: u16,
        /// Its standard phrase.
        reason: &'static str,
    },
    /// The camera refuses, with this text.
    #[error("the camera refuses: {0}")]
    Camera(String),
    /// The answer has another form than documented.
    #[error("the camera's answer was not understood: {0}")]
    Unexpected(String),
    /// The answer is longer than any answer of this kind.
    #[error("the camera's answer is longer than {0} bytes")]
    TooLong(usize),
    /// The camera's answer says that it cannot pan or tilt.
    #[error("the camera has no pan, tilt and zoom: it gave an empty answer to a query")]
    NoPtz,
    /// The camera sends us elsewhere than to its own HTTPS.
    #[error("the camera redirects to {0}, which is not its own HTTPS")]
    Redirected(String),
}

impl Error {
    /// Whether the camera may have carried out the command although no success was reported.
    pub fn may_have_acted(&self) -> bool {
        matches!(self, Self::Timeout(_) | Self::Broken(_) | Self::Unexpected(_) | Self::TooLong(_))
            || matches!(self, Self::Status { status, .. } if *status >= 500)
    }

    /// Whether a camera answered and refused; otherwise there is no camera to talk to.
    pub fn is_refusal(&self) -> bool {
        !matches!(self, Self::Unreachable(_) | Self::Timeout(_) | Self::Broken(_))
    }

    /// Whether it understood what it was asked, and will answer no more than that if it is asked again.
    pub fn is_answer(&self) -> bool {
        matches!(self, Self::Camera(_) | Self::NoPtz | Self::Unexpected(_) | Self::NotPermitted { .. })
            || matches!(self, Self::Status { status: 400..=499, .. })
    }

    /// Whether asking again is useless, or harmful, until a setting changes; but a camera that did without a user before may
    /// do so again.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::CredentialsMissing | Self::BadCredentials { .. })
    }

    /// What a person can do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Location { .. } => "Correct `location`.",
            Self::Redirected(_) => "Set `location` to the right address; retrying.",
            Self::Tls(_) => "Check `ca-file`.",
            Self::Unreachable(_) => {
                "Check `location`, the cable and, with https, the certificate (`ca-file`, `insecure`); retrying."
            }
            Self::Timeout(_) | Self::Broken(_) => "Check camera and network; retrying.",
            Self::CredentialsMissing => {
                "Set `user` and `password`; until then nothing more is sent, except to a camera that once worked without."
            }
            Self::BadCredentials { .. } => {
                "Correct `user` or `password`; nothing more is sent until then, so as not to lock the account."
            }
            Self::UnsupportedAuthentication(_) => "Choose Basic or Digest in the camera's settings.",
            Self::BasicRefused => {
                "Use https with a certificate that is verified (`ca-file`), or choose Digest in the camera's settings; `auth=basic` allows it all the same; retrying."
            }
            Self::NotPermitted { .. } => {
                "Give this user the right to control PTZ, or set another `user` and `password`; retrying at growing pauses, up to a minute, so as not to lock the account."
            }
            Self::Status { status: 403, .. } => "Give this user the right to control PTZ; retrying.",
            Self::Status { status: 500.., .. } => "It may be starting up or busy; retrying.",
            Self::Status { .. } | Self::Unexpected(_) | Self::TooLong(_) => {
                "Check that `location` is a camera that speaks this protocol; retrying."
            }
            Self::Camera(_) => {
                "Check that this camera has pan and tilt, and that its settings allow it to be moved; retrying."
            }
            Self::NoPtz => "Check the channel that is set, and the camera's PTZ settings; retrying.",
        }
    }
}
