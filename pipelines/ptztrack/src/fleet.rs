// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use ptztrack_contract::lock::lock;

use crate::accounts_file::{Account, Accounts, AccountsFile};
#[cfg(test)]
use crate::camera::Control;
use crate::camera::{Camera, Known};
use crate::config::{CameraSettings, Codec, Kind};
use crate::control_file::{ControlFile, Kept, state_folder};
use crate::event::{Event, Level};
use crate::log::Log;
use crate::shard::Shard;

/// That of the sinks.
const TARGET_HEIGHT: f64 = 0.4;

/// All cameras, by name.
#[derive(Debug)]
pub struct Fleet {
    cameras: Mutex<BTreeMap<String, Camera>>,
    /// They were told to end; changed while the cameras are locked.
    ended: AtomicBool,
    /// Those that were told to end and have no successor.
    ending: Mutex<Vec<JoinHandle<()>>>,
    had: ControlFile,
    accounts: AccountsFile,
    log: Arc<Log>,
}

impl Fleet {
    pub fn new(log: Arc<Log>) -> Self {
        Self::of_share(None, log)
    }

    /// Of a process that has this share of the cameras.
    pub fn of_share(shard: Option<Shard>, log: Arc<Log>) -> Self {
        Self::at(state_folder().as_deref(), shard, log)
    }

    /// The same, with what outlives it in this folder, if any.
    fn at(folder: Option<&Path>, shard: Option<Shard>, log: Arc<Log>) -> Self {
        Self {
            cameras: Mutex::default(),
            ended: AtomicBool::new(false),
            ending: Mutex::default(),
            had: ControlFile::at(folder, shard, log.clone()),
            accounts: AccountsFile::at(folder, shard, log.clone()),
            log,
        }
    }

    /// A camera of this name that is never started.
    #[cfg(test)]
    pub fn at_rest(name: &str) -> Self {
        let text = format!("[camera.{name}]\naddress = \"http://127.0.0.1:1\"\n");
        let settings = crate::config::Config::parse(&text).unwrap().cameras.remove(0);
        let fleet = Self::new(Arc::new(Log::unwritten()));
        let camera = Camera::new(settings, Control::Ours, false, fleet.log.clone(), None);
        lock(&fleet.cameras).insert(name.to_owned(), camera);
        fleet
    }

    /// Has these cameras run and no others; those that stay as they were are not touched, unless they were given up. Waits for
    /// none that ends: who takes a camera over does.
    pub fn apply(&self, wanted: Vec<CameraSettings>) {
        // Who has a camera has it whatever becomes of its entry.
        let (had, accounts) = (self.had.load(), self.accounts.load());
        let mut cameras = lock(&self.cameras);
        // Nobody would end those that begin now.
        if self.ended.load(Ordering::SeqCst) {
            return;
        }
        let stays = |camera: &Camera| !camera.is_over() && wanted.contains(&camera.settings);
        let (stay, mut go): (BTreeMap<_, _>, BTreeMap<_, _>) =
            std::mem::take(&mut *cameras).into_iter().partition(|(_, camera)| stays(camera));
        *cameras = stay;
        go.values().for_each(Camera::end);
        let (has, worked) = (control_of(&go), worked_of(&go));
        for settings in wanted {
            if cameras.contains_key(&settings.name) {
                continue;
            }
            let name = settings.name.clone();
            let control = has.get(&name).or_else(|| had.get(&name)).copied().unwrap_or_default();
            let has_worked = accounts.get(&name) == Some(&Account::of(&settings));
            let camera = Camera::new(settings, control, has_worked, self.log.clone(), go.remove(&name));
            cameras.insert(name, camera);
        }
        let mut ending = lock(&self.ending);
        ending.retain(|thread| !thread.is_finished());
        ending.extend(go.into_values().filter_map(Camera::into_thread));
        drop((ending, cameras));
        self.had.remember(has);
        self.accounts.remember(worked);
        self.start_all();
    }

    /// Starts those that have not been started. Where the system has no thread for one, that is said once, and it is not forgotten:
    /// the next call starts it.
    pub fn start_all(&self) {
        for camera in lock(&self.cameras).values_mut().filter(|camera| !camera.is_started()) {
            camera.known.beat();
            let before = lock(&camera.known.state).trouble.take();
            let Err(err) = camera.start() else { continue };
            let trouble = format!("cannot be started: {err}; it is tried again");
            if before.as_ref() != Some(&trouble) {
                let name = Some(camera.settings.name.as_str());
                self.log.tell(&Event::new(Level::Error, name, "not-started", trouble.clone()));
            }
            lock(&camera.known.state).trouble = Some(trouble);
        }
    }

    /// Who has which; `None` once they were told to end, when that was kept for the last time.
    fn control(&self) -> Option<Kept> {
        let cameras = lock(&self.cameras);
        (!self.ended.load(Ordering::SeqCst)).then(|| control_of(&cameras))
    }

    /// Keeps who has which camera, and which accounts have worked, for after a restart.
    pub fn keep_control(&self) {
        self.keep(|| self.control());
        {
            let cameras = lock(&self.cameras);
            self.accounts.remember(worked_of(&cameras));
            self.accounts.forget(&refused_of(&cameras));
        }
        if let Err(err) = self.accounts.keep() {
            let detail = format!("which accounts have worked is forgotten at a restart: {err}");
            self.log.tell(&Event::new(Level::Warning, None, "not-kept", detail));
        }
    }

    fn keep(&self, control: impl FnOnce() -> Option<Kept>) {
        if let Err(err) = self.had.keep(control) {
            let detail = format!("who has which camera is forgotten at a restart: {err}");
            self.log.tell(&Event::new(Level::Warning, None, "not-kept", detail));
        }
    }

    /// Ends all, keeps who has them, for those who have taken one since that was kept last, and waits until their cameras rest.
    pub fn end(&self) {
        let mut cameras = lock(&self.cameras);
        self.ended.store(true, Ordering::SeqCst);
        let ends = std::mem::take(&mut *cameras);
        drop(cameras);
        let (cameras, ending) = (ends, std::mem::take(&mut *lock(&self.ending)));
        // All at once: each may take seconds.
        cameras.values().for_each(Camera::end);
        let control = control_of(&cameras);
        thread::scope(|scope| {
            // A disk that hangs keeps no camera waiting, and a camera that hangs loses no hand-over.
            let keep = || self.keep(|| Some(control.clone()));
            if thread::Builder::new().spawn_scoped(scope, keep).is_err() {
                keep();
            }
            for thread in cameras.into_values().filter_map(Camera::into_thread).chain(ending) {
                // One that panicked has said so.
                let _ = thread.join();
            }
        });
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

    /// Whether a camera is one that turns.
    pub fn turns(&self, name: &str) -> bool {
        lock(&self.cameras).get(name).is_some_and(|camera| camera.settings.kind != Kind::Fixed)
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

fn control_of(cameras: &BTreeMap<String, Camera>) -> Kept {
    cameras.iter().map(|(name, camera)| (name.clone(), camera.known.control())).collect()
}

/// Where pictures have come by it.
fn worked_of(cameras: &BTreeMap<String, Camera>) -> Accounts {
    let worked = cameras.iter().filter(|(_, camera)| camera.known.worked.load(Ordering::Relaxed));
    worked.map(|(name, camera)| (name.clone(), Account::of(&camera.settings))).collect()
}

/// Which are given up, and their account has not worked: another password than the one that had is wrong.
fn refused_of(cameras: &BTreeMap<String, Camera>) -> Vec<String> {
    let is_refused =
        |camera: &Camera| lock(&camera.known.state).given_up && !camera.known.worked.load(Ordering::Relaxed);
    cameras.iter().filter(|(_, camera)| is_refused(camera)).map(|(name, _)| name.clone()).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::process::Command;

    use rustix::process::{Resource, Rlimit, Uid, getrlimit, getuid, setrlimit};
    use rustix::thread::set_thread_res_uid;
    use tokio::sync::broadcast::Receiver;

    use super::*;
    use crate::camera::Steering;
    use crate::config::Config;

    /// Does this while the system has no thread left for us.
    fn without_threads(what: impl FnOnce()) {
        let limit = getrlimit(Resource::Nproc);
        setrlimit(Resource::Nproc, Rlimit { current: Some(0), ..limit }).unwrap();
        // The limit is not for root, so this thread is somebody else meanwhile.
        let is_root = getuid().is_root();
        let be = |uid| set_thread_res_uid(uid, uid, Uid::ROOT).unwrap();
        if is_root {
            be(Uid::from_raw(65534));
        }
        what();
        if is_root {
            be(Uid::ROOT);
        }
        setrlimit(Resource::Nproc, limit).unwrap();
    }

    /// The camera without a password, which has no pipeline.
    fn door(address: &str) -> Vec<CameraSettings> {
        let text =
            format!("[camera.door]\naddress = \"{address}\"\nuser = \"u\"\npassword-file = \"/nowhere\"\n");
        Config::parse(&text).unwrap().cameras
    }

    fn wait_for(event: &str, told: &mut Receiver<Event>) -> Vec<String> {
        let mut all = Vec::new();
        while all.last().is_none_or(|last| last != event) {
            all.push(told.blocking_recv().unwrap().event);
        }
        all
    }

    /// One that keeps who has which camera in this folder.
    fn fleet_in(folder: &Path) -> Fleet {
        Fleet::at(Some(folder), None, Arc::new(Log::unwritten()))
    }

    fn control(fleet: &Fleet) -> Control {
        fleet.of("door").unwrap().control()
    }

    /// They are tried again where a camera that is starting refuses everybody.
    #[test]
    fn user_and_password_that_were_right_are_so_when_something_else_of_the_camera_changes() {
        gst::init().unwrap();
        let fleet = Fleet::new(Arc::new(Log::unwritten()));
        let changed = |change: fn(&mut CameraSettings)| {
            fleet.apply(door("http://127.0.0.1:1"));
            fleet.of("door").unwrap().worked.store(true, Ordering::Relaxed);
            let mut cameras = door("http://127.0.0.1:1");
            change(&mut cameras[0]);
            fleet.apply(cameras);
            fleet.of("door").unwrap().worked.load(Ordering::Relaxed)
        };
        assert!(changed(|camera| camera.rate = Some(5)));
        assert!(!changed(|camera| camera.address = "http://127.0.0.1:2".to_owned()));
        fleet.end();
    }

    /// As after a power cut, when a camera that boots refuses everybody.
    #[test]
    fn an_account_that_worked_is_known_to_after_a_restart_and_no_other() {
        gst::init().unwrap();
        let folder = std::env::temp_dir().join(format!("ptztrack-fleet-worked-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let worked = |fleet: &Fleet, cameras: Vec<CameraSettings>| {
            fleet.apply(cameras);
            fleet.of("door").unwrap().worked.load(Ordering::Relaxed)
        };
        let before = fleet_in(&folder);
        assert!(!worked(&before, door("http://127.0.0.1:1")));
        before.of("door").unwrap().worked.store(true, Ordering::Relaxed);
        before.keep_control();
        before.end();
        let after = fleet_in(&folder);
        assert!(worked(&after, door("http://127.0.0.1:1")));
        // Nor is it forgotten before a picture has come.
        after.keep_control();
        assert!(worked(&after, door("http://127.0.0.1:1")));
        after.end();
        let changed = fleet_in(&folder);
        assert!(!worked(&changed, door("http://127.0.0.1:2")), "somebody else's");
        changed.keep_control();
        changed.apply(Vec::new());
        assert!(worked(&changed, door("http://127.0.0.1:1")), "its entry is back");
        // A wrong password was read since.
        let known = changed.of("door").unwrap();
        known.worked.store(false, Ordering::Relaxed);
        lock(&known.state).given_up = true;
        changed.keep_control();
        changed.end();
        let refused = fleet_in(&folder);
        assert!(!worked(&refused, door("http://127.0.0.1:1")), "it was refused");
        refused.end();
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_camera_that_is_handed_over_in_the_last_second_is_so_after_a_restart_whatever_is_kept_later() {
        gst::init().unwrap();
        let folder = std::env::temp_dir().join(format!("ptztrack-fleet-end-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let fleet = fleet_in(&folder);
        fleet.apply(door("http://127.0.0.1:1"));
        fleet.keep_control();
        let known = fleet.of("door").unwrap();
        known.steer(Steering::HandedOver);
        fleet.end();
        fleet.keep_control();
        fleet.apply(door("http://127.0.0.1:1"));
        assert!(fleet.of("door").is_none(), "it has ended");
        let next = fleet_in(&folder);
        next.apply(door("http://127.0.0.1:1"));
        assert_eq!(control(&next), Control::HandedOver);
        next.end();
        // An operator's camera is forgotten where it seems to be gone.
        let last = fleet_in(&folder);
        last.apply(door("http://127.0.0.1:1"));
        let known = last.of("door").unwrap();
        known.steer(Steering::Follow);
        known.operator.store(true, Ordering::Relaxed);
        last.end();
        last.keep_control();
        let text = fs::read_to_string(folder.join("control.json")).unwrap();
        assert_eq!(text, r#"{"door":"operator"}"#);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_camera_whose_entry_comes_back_is_handed_over_as_it_was() {
        gst::init().unwrap();
        let folder = std::env::temp_dir().join(format!("ptztrack-fleet-gone-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let fleet = fleet_in(&folder);
        fleet.apply(door("http://127.0.0.1:1"));
        fleet.of("door").unwrap().steer(Steering::HandedOver);
        fleet.apply(Vec::new());
        fleet.keep_control();
        fleet.apply(door("http://127.0.0.1:1"));
        assert_eq!(control(&fleet), Control::HandedOver);
        fleet.apply(Vec::new());
        fleet.end();
        let next = fleet_in(&folder);
        next.apply(Vec::new());
        next.keep_control();
        next.apply(door("http://127.0.0.1:1"));
        assert_eq!(control(&next), Control::HandedOver, "after a restart, too");
        next.end();
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    #[ignore = "has a process to itself, by the test below"]
    fn without_a_thread() {
        gst::init().unwrap();
        let log = Arc::new(Log::unwritten());
        let mut told = log.subscribe();
        let fleet = Fleet::new(log);
        fleet.apply(door("http://127.0.0.1:1"));
        wait_for("started", &mut told);
        fleet.of("door").unwrap().steer(Steering::HandedOver);
        without_threads(|| {
            fleet.apply(door("http://127.0.0.1:2"));
            fleet.start_all();
        });
        assert!(!fleet.is_over() && fleet.stuck().is_empty());
        let known = fleet.of("door").unwrap();
        assert_eq!(known.control(), Control::HandedOver);
        assert!(known.in_words().contains("cannot be started: "), "{}", known.in_words());
        fleet.start_all();
        let said = wait_for("started", &mut told);
        // The one before may have ended sooner than this one could not be started.
        let count = |wanted: &str| said.iter().filter(|event| *event == wanted).count();
        assert_eq!(["not-started", "stopped", "started"].map(count), [1, 1, 1], "{said:?}");
        assert_eq!(said.last().map(String::as_str), Some("started"));
        fleet.end();
    }

    #[test]
    fn a_camera_for_which_there_is_no_thread_is_started_once_there_is_one() {
        let mut test = Command::new(std::env::current_exe().unwrap());
        let output = test.args(["--exact", "fleet::tests::without_a_thread", "--ignored"]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("1 passed"), "{said}");
    }
}
