// SPDX-License-Identifier: MPL-2.0

//! What passes between the [`Session`](crate::session::Session) and those who speak with the camera for it.

use std::fmt;
use std::time::Duration;

use servo::{HardLimits, Mode, Position, Presets, SpeedUnit, TableRow, Time};

use crate::session::{ConnectionChange, ControlOwner};
use crate::{Command, Error};

/// Something to ask the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Query {
    /// Where it looks.
    Position,
    /// How far it can look.
    Limits,
    /// Its PTZ parameters.
    Parameters,
    /// What its speeds and its zoom mean.
    Attributes,
    /// How fast its moves to a position are.
    MoveSpeed,
    /// Which presets it has.
    Presets,
    /// For its control.
    Queue(QueueRequest),
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
    /// To [`Query::MoveSpeed`]: a part of the fastest.
    MoveSpeed(f64),
    /// To [`Query::Presets`].
    Presets(Presets),
    /// To [`Query::Queue`]: where we stand; `None`: no more than yes.
    Place(Option<QueuePlace>),
}

/// How a camera is set up, as far as it tells and as it matters here.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Parameters {
    /// How far it can look and zoom.
    pub limits: HardLimits,
    /// Its speed is bound to the field of view.
    pub proportional_speed: Option<bool>,
    /// That bound, in fields of view per second.
    pub max_proportional_speed: Option<f64>,
    /// It can be moved by speed.
    pub continuous_pan: Option<bool>,
    /// It can zoom at a speed.
    pub continuous_zoom: Option<bool>,
    /// It can be moved to a position.
    pub absolute_pan: Option<bool>,
    /// Only who holds the control queue may move it.
    pub control_queue: Option<bool>,
}

/// What a camera's speeds and zoom mean, as far as it tells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attributes {
    /// What parts of the fastest are per second, growing ...
    pub speeds: Vec<TableRow>,
    /// ... in this unit.
    pub speed_unit: SpeedUnit,
    /// Magnification by the zoom's travel, growing.
    pub zooms: Vec<TableRow>,
    /// Magnification at the end of the optical zoom.
    pub max_optical_magnification: Option<f64>,
}

/// What can be asked of a control queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QueueRequest {
    /// To be let in, or up.
    Request,
    /// To be let out.
    Drop,
    /// Where we stand; without it at least once in [`QueuePlace::poll_every`] we are out.
    Query,
}

/// Our place in the control queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueuePlace {
    /// 1 is in control; 0 is not in the queue.
    pub position: u32,
    /// How often it wants to be asked again.
    pub poll_every: Duration,
}

/// What is to be done now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// This.
    Do(Request),
    /// Nothing before this time, or before something new is seen.
    Wait(Option<Time>),
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
    /// Somebody else moves the camera: it is left to him.
    TakenOver(ControlOwner),
    /// Nobody else does any more: it is moved again.
    Resumed,
    /// The camera has accepted stop after stop, and is seen to turn.
    StopInVain,
    /// The camera moved when it was met, and is being stopped.
    Orphan,
    /// The camera will not go home.
    HomeRefused(Error),
    /// It is moved otherwise than before, or than is set, as it does not take the words for that.
    Mode(Mode),
}
