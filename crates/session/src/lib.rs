// SPDX-License-Identifier: MPL-2.0

//! What every protocol shares that a camera is moved by.
//!
//! * [`session`]: who may move the camera, what to ask and say next, what its answers mean. Sees no picture.
//! * [`ControlLoop`]: joins a session and a servo.
//! * [`task`]: the one task that talks to a camera, with mailbox and clock.
//! * [`watchdog`]: the process that stops the camera when the one that moves it has died, or hangs.
//! * [`http`]: the client that exchanges the words.
//!
//! A protocol is a [`Client`]: it puts a [`Request`] into words and reads the [`Response`]. Nothing here knows GStreamer, or
//! a word of any protocol.

mod client;
mod command;
mod control_loop;
mod error;
mod exchange;
#[cfg(test)]
mod fixtures;
pub mod http;
pub mod session;
mod settings;
pub mod task;
pub mod watchdog;
mod zoom_step;

pub use client::{Client, Protocol};
pub use command::{Command, Stop};
pub use control_loop::{ControlLoop, LoopEvent, Status};
pub use error::Error;
pub use exchange::{
    Attributes, Next, Parameters, Query, QueuePlace, QueueRequest, Request, Response, SessionEvent,
};
pub use settings::{LoopSettings, SessionSettings};
pub use zoom_step::ZoomStep;
