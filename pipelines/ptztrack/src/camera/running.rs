// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeSet;
use std::fmt::Debug;

use serde::{Deserialize, Serialize};

use super::servo_stats::ServoStats;
use super::{Known, Steering, Turn};

/// What can be done with a camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Abilities {
    /// There is a home to go to.
    pub home: bool,
    pub hand_over: bool,
    /// By hand.
    pub turn: bool,
}

/// What runs a camera, a pipeline of this process or another process: what can be told to it, and asked.
pub trait Running: Debug + Send + Sync {
    /// Makes pictures for who looks, or none.
    fn look(&self, somebody: bool);

    /// Follows who is at this place of the picture, 0 to 1.
    fn select(&self, x: f64, y: f64);

    /// Follows whom the tracker knows by this number.
    fn select_track(&self, id: u64);
    /// These are followed by nobody's choice but somebody's at the page.
    fn ignore(&self, ids: &BTreeSet<u64>);

    fn release(&self);

    /// Lets the camera follow, sends it home, or leaves it to somebody else.
    fn steer(&self, steering: Steering);

    /// Turns the camera by hand, which is left alone for a while after that; `false`: it is handed over.
    fn turn(&self, known: &Known, turn: Turn) -> bool;

    /// What can be done with the camera.
    fn abilities(&self, known: &Known) -> Abilities;

    /// What the sink says of itself.
    fn servo_stats(&self) -> Option<ServoStats>;
}
