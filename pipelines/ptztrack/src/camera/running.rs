// SPDX-License-Identifier: MPL-2.0

use std::fmt::Debug;

use super::Steering;
use super::servo_stats::ServoStats;

/// What runs a camera, a pipeline of this process or another process: what can be told to it, and asked.
pub trait Running: Debug + Send + Sync {
    /// Makes pictures for who looks, or none.
    fn look(&self, somebody: bool);

    /// Follows who is at this place of the picture, 0 to 1.
    fn select(&self, x: f64, y: f64);

    /// Follows whom the tracker knows by this number.
    fn select_track(&self, id: u64);

    fn release(&self);

    /// Lets the camera follow, sends it home, or leaves it to somebody else.
    fn steer(&self, steering: Steering);

    /// Whether there is a home to go to, and whether the camera can be handed over.
    fn abilities(&self) -> (bool, bool);

    /// What the sink says of itself.
    fn servo_stats(&self) -> Option<ServoStats>;
}
