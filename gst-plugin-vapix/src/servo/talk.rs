//! What passes between the [`Pilot`](super::Pilot) and those who speak with the camera for it.

use std::fmt;
use std::time::Duration;

use super::{Holder, LinkChange, Mode, PanTilt, SpeedMap};
use crate::vapix::{
    Attributes, Command, Error, Limits, Parameters, Position, Presets, QueuePlace, QueueRequest,
};

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
    pub const INTRODUCTION: [Self; 5] =
        [Self::Position, Self::Limits, Self::Attributes, Self::Parameters, Self::MoveSpeed];
}

/// One exchange with the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Job {
    /// Tell it.
    Command(Command),
    /// Ask it.
    Query(Query),
}

impl fmt::Display for Job {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command(command) => command.fmt(f),
            Self::Query(query) => write!(f, "query for {query:?}"),
        }
    }
}

/// What the camera answered.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// To a command: yes.
    Accepted,
    /// To [`Query::Position`].
    Position(Position),
    /// To [`Query::Limits`].
    Limits(Limits),
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
    Do(Job),
    /// Nothing before this time, or before something new is seen.
    Wait(Option<Duration>),
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Report {
    /// The connection came, went, or is refused.
    Link(LinkChange),
    /// The camera was asked what it is: this is what it told.
    Met(String),
    /// The camera was at rest and has accepted a move.
    Moving,
    /// The camera has accepted a stop, or arrived.
    Stopped,
    /// The target lies beyond the camera's range.
    AtLimit,
    /// The camera does not tell where it looks: the limits of pan and tilt that are set cannot be kept.
    LimitsUnkept,
    /// The camera swung to and fro about the target: from now on only this part of the speed is asked for.
    Swinging(f64),
    /// Somebody else moves the camera: it is left to him.
    TakenOver(Holder),
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

/// The camera as it is known.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Status {
    /// It answers and does as it is told.
    pub connected: bool,
    /// It may be moving on our behalf.
    pub moving: bool,
    /// Somebody else moves it.
    pub taken_over: bool,
    /// Where it last said it looks.
    pub position: Position,
    /// What it was last told, degrees per second.
    pub rate: PanTilt,
    /// Horizontal field of view in degrees, where it is set, told or learned.
    pub fov_deg: Option<f64>,
    /// How far it can look and zoom, by its own word.
    pub limits: Limits,
    /// How it is moved, where it is.
    pub mode: Option<Mode>,
}

/// The camera as it was learned, or is taken for where there was nothing to learn by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief {
    /// From sending a command to the timestamp of the first picture that shows it.
    pub latency: Duration,
    /// Horizontal field of view in degrees.
    pub fov_deg: f64,
    /// Degrees per second of the speed steps.
    pub map: SpeedMap,
}
