// SPDX-License-Identifier: MPL-2.0

//! What runs a camera in tests: it does nothing, and remembers how it was told to steer.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

use ptztrack_contract::lock::lock;

use super::running::Running;
use super::servo_stats::ServoStats;
use super::{Abilities, Known, Steering, Turn};

/// It can do all that a camera can.
#[derive(Debug, Default)]
pub struct Told {
    known: Weak<Known>,
    /// In turn, and whether nobody could take the camera meanwhile.
    steering: Mutex<Vec<(Steering, bool)>>,
}

impl Told {
    /// A camera that is run by it.
    pub fn running(name: &str) -> (Arc<Known>, Arc<Self>) {
        let known = Arc::new(Known::new(name));
        let told = Self::run(&known);
        (known, told)
    }

    /// Has it run this camera.
    pub fn run(known: &Arc<Known>) -> Arc<Self> {
        let told = Arc::new(Self { known: Arc::downgrade(known), ..Self::default() });
        *lock(&known.running) = Some(told.clone());
        told
    }

    /// How it was told to steer so far.
    pub fn steering(&self) -> Vec<Steering> {
        lock(&self.steering).iter().map(|(steering, _)| *steering).collect()
    }

    /// Whether nobody could take the camera while it was told.
    pub fn was_told_under_lock(&self) -> bool {
        lock(&self.steering).iter().all(|(_, locked)| *locked)
    }
}

impl Running for Told {
    fn look(&self, _: bool) {}

    fn select(&self, _: f64, _: f64) {}

    fn select_track(&self, _: u64) {}

    fn ignore(&self, _: &BTreeSet<u64>) {}

    fn release(&self) {}

    fn steer(&self, steering: Steering) {
        let locked = self.known.upgrade().is_some_and(|known| known.steering.try_lock().is_err());
        lock(&self.steering).push((steering, locked));
    }

    fn turn(&self, known: &Known, turn: Turn) -> bool {
        known.turn_here(turn, Duration::from_secs(5))
    }

    fn abilities(&self, _: &Known) -> Abilities {
        Abilities { home: true, hand_over: true, turn: true }
    }

    fn servo_stats(&self) -> Option<ServoStats> {
        None
    }
}
