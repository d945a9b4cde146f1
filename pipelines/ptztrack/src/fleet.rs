// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use ptztrack_contract::lock::lock;

use crate::camera::{Camera, Control, Known};
use crate::config::{CameraSettings, Codec};
use crate::control_file::ControlFile;
use crate::log::Log;

/// That of the sinks.
const TARGET_HEIGHT: f64 = 0.4;

/// All cameras, by name.
#[derive(Debug)]
pub struct Fleet {
    cameras: Mutex<BTreeMap<String, Camera>>,
    /// Those that were told to end and have no successor.
    ending: Mutex<Vec<Camera>>,
    had: ControlFile,
    log: Arc<Log>,
}

impl Fleet {
    pub fn new(log: Arc<Log>) -> Self {
        Self { cameras: Mutex::default(), ending: Mutex::default(), had: ControlFile::new(), log }
    }

    /// Has these cameras run and no others; those that stay as they were are not touched, unless they were given up. Waits for
    /// none that ends: who takes a camera over does.
    pub fn apply(&self, wanted: Vec<CameraSettings>) {
        // Who has a camera has it whatever becomes of its entry.
        let mut had = self.had.load();
        had.extend(self.control());
        let mut cameras = lock(&self.cameras);
        let stays = |camera: &Camera| !camera.is_over() && wanted.contains(&camera.settings);
        let (stay, mut go): (BTreeMap<_, _>, BTreeMap<_, _>) =
            std::mem::take(&mut *cameras).into_iter().partition(|(_, camera)| stays(camera));
        *cameras = stay;
        go.values().for_each(Camera::end);
        for settings in wanted {
            if cameras.contains_key(&settings.name) {
                continue;
            }
            let name = settings.name.clone();
            let control = had.get(&name).copied().unwrap_or_default();
            match Camera::start(settings, control, self.log.clone(), go.remove(&name)) {
                Ok(camera) => drop(cameras.insert(name, camera)),
                Err(err) => self.log.error("not-started", format!("{name} cannot be started: {err}")),
            }
        }
        let mut ending = lock(&self.ending);
        ending.retain(|camera| !camera.is_over());
        ending.extend(go.into_values());
    }

    fn control(&self) -> BTreeMap<String, Control> {
        self.known().iter().map(|known| (known.name.clone(), known.control())).collect()
    }

    /// Keeps who has which camera, for after a restart.
    pub fn keep_control(&self) {
        if let Err(err) = self.had.keep(self.control()) {
            self.log.error("not-kept", format!("who has which camera is forgotten at a restart: {err}"));
        }
    }

    /// Ends all, and waits until their cameras rest.
    pub fn end(&self) {
        let cameras = std::mem::take(&mut *lock(&self.cameras));
        let ending = std::mem::take(&mut *lock(&self.ending));
        // All at once: each may take seconds.
        let all: Vec<Camera> = cameras.into_values().chain(ending).inspect(Camera::end).collect();
        all.into_iter().for_each(Camera::join);
    }

    /// What is known of each.
    pub fn known(&self) -> Vec<Arc<Known>> {
        lock(&self.cameras).values().map(|camera| camera.known.clone()).collect()
    }

    /// What is known of one.
    pub fn of(&self, name: &str) -> Option<Arc<Known>> {
        lock(&self.cameras).get(name).map(|camera| camera.known.clone())
    }

    /// The same, where its stream comes in this form.
    pub fn of_codec(&self, name: &str, codec: Codec) -> Option<Arc<Known>> {
        let cameras = lock(&self.cameras);
        let camera = cameras.get(name).filter(|camera| camera.settings.codec == codec)?;
        Some(camera.known.clone())
    }

    /// At which height in its picture a camera keeps whom it follows, where it zooms.
    pub fn target_height(&self, name: &str) -> Option<f64> {
        let cameras = lock(&self.cameras);
        let settings = &cameras.get(name)?.settings;
        let zooms = settings.sink_property("auto-zoom") == Some("true");
        let height = settings.sink_property("target-height").and_then(|height| height.parse().ok());
        zooms.then(|| height.unwrap_or(TARGET_HEIGHT))
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
