// SPDX-License-Identifier: MPL-2.0

//! VAPIX, the HTTP interface of Axis cameras.
//!
//! * [`session`]: who may move the camera, what to ask and say next, what its answers mean. Sees no picture.
//! * [`wire`]: the words, and the client that exchanges them. Knows no servo but the model of a camera.
//! * [`watchdog`]: the process that stops the camera when the one that moves it has died, or hangs.
//!
//! Nothing here knows GStreamer.

pub mod session;
pub mod watchdog;
pub mod wire;
