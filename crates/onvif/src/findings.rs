// SPDX-License-Identifier: MPL-2.0

use serde::{Deserialize, Serialize};

use crate::abilities::MoveTimeout;
use crate::answers::{Profile, Services};
use crate::moves::Moves;

/// What a camera has told and shown, as far as it takes to stop it: whoever does so in our place need not ask, which takes
/// a slow camera seconds.
#[derive(Debug, Serialize, Deserialize)]
pub struct Findings {
    /// Where its services are.
    pub services: Services,
    /// The one that is moved.
    pub profile: Profile,
    /// How long its moves go on by themselves.
    pub timeout: MoveTimeout,
    /// By how many seconds its clock is ahead of this machine's.
    pub clock_ahead_s: i64,
    /// What it turned out to understand.
    pub moves: Moves,
}
