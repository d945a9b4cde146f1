// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use ptztrack_contract::lock::lock;

use crate::camera::{Camera, Known};
use crate::config::CameraSettings;
use crate::log::Log;

/// All cameras, by name.
#[derive(Debug)]
pub struct Fleet {
    cameras: Mutex<BTreeMap<String, Camera>>,
    log: Arc<Log>,
}

impl Fleet {
    pub fn new(log: Arc<Log>) -> Self {
        Self { cameras: Mutex::default(), log }
    }

    /// Has these cameras run and no others; those that stay as they were are not touched, unless they were given up. Waits
    /// until the others have ended.
    pub fn apply(&self, wanted: Vec<CameraSettings>) {
        let mut cameras = lock(&self.cameras);
        let stays = |camera: &Camera| !camera.is_over() && wanted.contains(&camera.settings);
        let (stay, go): (BTreeMap<_, _>, BTreeMap<_, _>) =
            std::mem::take(&mut *cameras).into_iter().partition(|(_, camera)| stays(camera));
        *cameras = stay;
        drop(cameras);
        end(go.into_values());
        for settings in wanted {
            let mut cameras = lock(&self.cameras);
            if cameras.contains_key(&settings.name) {
                continue;
            }
            let name = settings.name.clone();
            match Camera::start(settings, self.log.clone()) {
                Ok(camera) => drop(cameras.insert(name, camera)),
                Err(err) => self.log.error("not-started", format!("{name} cannot be started: {err}")),
            }
        }
    }

    /// Ends all, and waits until their cameras rest.
    pub fn end(&self) {
        let cameras = std::mem::take(&mut *lock(&self.cameras));
        end(cameras.into_values());
    }

    /// What is known of each.
    pub fn known(&self) -> Vec<Arc<Known>> {
        lock(&self.cameras).values().map(|camera| camera.known.clone()).collect()
    }

    /// What is known of one.
    pub fn of(&self, name: &str) -> Option<Arc<Known>> {
        lock(&self.cameras).get(name).map(|camera| camera.known.clone())
    }

    /// Those whose thread does nothing any more, though it should.
    pub fn stuck(&self) -> Vec<String> {
        let stuck = |camera: &&Camera| !camera.is_over() && camera.known.is_stuck();
        lock(&self.cameras).values().filter(stuck).map(|camera| camera.settings.name.clone()).collect()
    }

    /// All were given up, so that there is nothing left to do.
    pub fn is_over(&self) -> bool {
        lock(&self.cameras).values().all(Camera::is_over)
    }
}

/// All at once: each may take seconds.
fn end(cameras: impl Iterator<Item = Camera>) {
    let cameras: Vec<Camera> = cameras.inspect(Camera::end).collect();
    cameras.into_iter().for_each(Camera::join);
}
