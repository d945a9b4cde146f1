// SPDX-License-Identifier: MPL-2.0

//! What happens to a camera, or to who follows with it.

use std::time::Duration;

use end_to_end::{Chance, Way};
use virtual_camera::Fault;

/// Something that happens.
#[derive(Debug, Clone, PartialEq)]
pub enum Happening {
    /// The way to the camera is like this for a while.
    Network(Way),
    /// Connections are reset, or closed.
    Reset,
    Close,
    /// It is away for longer, then has another realm.
    Reboot,
    /// Its answers are like this for a while.
    Answers(Fault),
    /// Somebody turns it.
    Operator,
    /// It has forgotten its RTSP sessions.
    Forget,
    /// Its entry in the file is another, with pictures of another size.
    Reload,
    /// The application is killed; another is started.
    Kill,
}

impl Happening {
    /// The next; `killed` where applications may be.
    pub fn next(chance: &mut Chance, killed: bool) -> Self {
        match chance.within((0, if killed { 12 } else { 10 })) {
            0 => Self::Network(Way::Stalled),
            1 => Self::Network(Way::Refused),
            2 => Self::Reset,
            3 => Self::Close,
            4 => Self::Reboot,
            5 => Self::Answers(Fault::Status(503)),
            6 => Self::Answers(Fault::Hang),
            7 => Self::Operator,
            8 => Self::Forget,
            9 => Self::Reload,
            _ => Self::Kill,
        }
    }

    /// In the account.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Network(Way::Stalled) => "nothing passes",
            Self::Network(_) => "connections refused",
            Self::Reset => "connections reset",
            Self::Close => "connections closed",
            Self::Reboot => "reboot",
            Self::Answers(Fault::Hang) => "no answers to PTZ",
            Self::Answers(_) => "503 to PTZ",
            Self::Operator => "operator",
            Self::Forget => "RTSP sessions forgotten",
            Self::Reload => "settings changed, SIGHUP",
            Self::Kill => "SIGKILL",
        }
    }

    /// How long it lasts.
    pub fn lasts(&self, chance: &mut Chance) -> Duration {
        Duration::from_secs(match self {
            Self::Network(_) | Self::Answers(_) => chance.within((1, 9)),
            Self::Reboot => chance.within((10, 25)),
            _ => 0,
        })
    }
}
