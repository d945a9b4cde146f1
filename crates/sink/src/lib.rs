// SPDX-License-Identifier: MPL-2.0

//! What the sinks that steer a camera have in common, whatever protocol they speak: properties, caps, state changes, clock,
//! messages. An element is a [`PtzSink`], of which [`ptz_sink!`] makes what GObject wants.

mod events;
mod home;
mod measure;
mod messages;
mod picture;
mod plumbing;
mod properties;
mod setters;
mod settings;
mod sink;
mod statistics;
mod stream;
mod watchdog;

pub use plumbing::{Core, Plumbing, PtzSink, stats_spec};
pub use properties::{EnumOf, Property, Table, Takes, mutable, special, string, text};
pub use settings::{Settings, Steering};

/// What a sink is called, and what belongs to it.
#[derive(Debug, Clone, Copy)]
pub struct Particulars {
    /// The element.
    pub name: &'static str,
    /// What its environment variables begin with.
    pub environment: &'static str,
    /// The program that stops the camera where the application cannot.
    pub watchdog: &'static str,
    /// An address as a camera may have it.
    pub example: &'static str,
}
