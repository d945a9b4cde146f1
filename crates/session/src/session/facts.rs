// SPDX-License-Identifier: MPL-2.0

use servo::{Actuation, Capabilities, Position, Presets, Time};

use super::CommandedMotion;

/// What an exchange with the camera tells.
#[derive(Debug, Clone, PartialEq)]
pub enum Fact {
    /// It accepted this.
    Accepted {
        /// What it is to do.
        actuation: Actuation,
        /// When it was told: it can act from then on, however late its answer is.
        sent: Time,
    },
    /// It did not answer to this: it may have acted on it, or may yet.
    Unanswered(Actuation),
    /// Where it looked at a time. [`Session::positioned`](super::Session::positioned) is to be called next.
    Position {
        /// As it told.
        position: Position,
        /// When it was so.
        at: Time,
    },
    /// It does not tell where it looks. [`Session::not_positioned`](super::Session::not_positioned) is to be called next.
    NoPosition,
    /// It turns otherwise than at our word: whatever it was told, it does that no more.
    Superseded,
    /// Somebody else moves it.
    Operator,
    /// What it can.
    Capabilities(Capabilities),
    /// Its presets; none where it will not tell them.
    Presets(Presets),
    /// It did not tell them, and is not to be asked again before then.
    PresetsNotBefore(Time),
    /// It will not go home.
    HomeRefused,
}

/// How the camera is being steered, as far as it matters to what is asked of it, and to what its answers mean.
#[derive(Debug, Clone, Copy)]
pub struct Steering<'a> {
    /// What it was told.
    pub commands: CommandedMotion<'a>,
    /// There is a target.
    pub holds_target: bool,
    /// A move to a position is under way.
    pub is_under_way: bool,
    /// The zoom was last told to move.
    pub is_zooming: bool,
    /// The command that the camera answers was to take it home.
    pub leads_home: bool,
    /// When it is to be asked for its presets, where it is.
    pub presets_due: Option<Time>,
}
