// SPDX-License-Identifier: MPL-2.0

//! What passes between the [`Session`](super::Session) and those who speak with the camera for it.

use std::fmt;
use std::time::Duration;

use servo::{HardLimits, Mode, Position, Presets};

use super::{ConnectionChange, ControlOwner};
use crate::wire::{Attributes, Command, Error, Parameters, QueuePlace, QueueRequest};

/// Something to ask the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Query {
    /// Where it looks.
    Position,
    /// How far it can look.
    Limits,
    /// Its PTZ parameters.
    Parameters,
    /// What its steps mean.
    Attributes,
    /// How fast its moves to a position are.
    MoveSpeed,
    /// Which presets it has.
    Presets,
    /// For its control.
    Queue(QueueRequest),
}

impl Query {
    /// What a camera just met is asked, what matters most first.
    pub const DISCOVERY: [Self; 5] =
        [Self::Position, Self::Limits, Self::Attributes, Self::Parameters, Self::MoveSpeed];

    /// Whether the answer is part of what the camera tells of itself.
    pub(super) fn is_of_description(&self) -> bool {
        *self != Self::Position && Self::DISCOVERY.contains(self)
    }
}

/// One exchange with the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request {
    /// Tell it.
    Command(Command),
    /// Ask it.
    Query(Query),
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command(command) => command.fmt(f),
            Self::Query(query) => write!(f, "query for {query:?}"),
        }
    }
}

/// What the camera answered.
#[derive(Debug, Clone, PartialEq)]
pub enum Response {
    /// To a command: yes.
    Accepted,
    /// To [`Query::Position`].
    Position(Position),
    /// To [`Query::Limits`].
    Limits(HardLimits),
    /// To [`Query::Parameters`].
    Parameters(Parameters),
    /// To [`Query::Attributes`].
    Attributes(Attributes),
    /// To [`Query::MoveSpeed`]: a speed step.
    MoveSpeed(u8),
    /// To [`Query::Presets`].
    Presets(Presets),
    /// To [`Query::Queue`]: where we stand; `None`: no more than yes.
    Place(Option<QueuePlace>),
}

/// What is to be done now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// This.
    Do(Request),
    /// Nothing before this time, or before something new is seen.
    Wait(Option<Duration>),
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub enum SessionEvent {
    /// The connection came, went, or is refused.
    Connection(ConnectionChange),
    /// The camera was asked what it is: this is what it told.
    Discovered(String),
    /// The camera was at rest and has accepted a move.
    Moving,
    /// The camera has accepted a stop, or arrived.
    Stopped,
    /// The camera does not tell where it looks: the limits of pan and tilt that are set cannot be kept.
    LimitsUnkept,
    /// Somebody else moves the camera: it is left to him.
    TakenOver(ControlOwner),
    /// Nobody else does any more: it is moved again.
    Resumed,
    /// The camera moved when it was met, and is being stopped.
    Orphan,
    /// The camera has no preset of the name that is to be its home.
    NoSuchPreset(String),
    /// The camera will not go home.
    HomeRefused(Error),
    /// It is moved otherwise than before, or than is set, as it does not take the words for that.
    Mode(Mode),
}
