// SPDX-License-Identifier: MPL-2.0

//! What processes that share the cameras of a file tell each other of them, so that people are handed over between all.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use ptztrack_contract::lock::lock;
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;

use super::view::View;
use crate::camera::{Known, Origin, Sight};

/// Of a camera of which nothing was heard for so long, nothing is known.
const SILENT: Duration = Duration::from_secs(2);
/// No picture is later than that.
const LATEST: Duration = Duration::from_secs(60);
/// So many messages wait to be sent: a picture of each of many cameras. Later ones tell more.
const WAITING: usize = 64;

/// What is told of one camera with each of its pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    sight: Sight,
    /// The picture came so long before this was told.
    age: Duration,
    /// It is late by so much itself.
    video: Duration,
    turns: bool,
    can_be_called: bool,
    /// It follows, and nothing else is wanted of it.
    follows: bool,
    target: Option<u64>,
    selected: Option<u64>,
    origin: Option<Origin>,
    errand: Option<Errand>,
    /// Another number with each of its pipelines, of a process that was started anew as well: tracks are numbered anew.
    pipelines: u64,
}

/// For whom a camera was called.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Errand {
    /// The camera that sees them.
    pub from: String,
    /// Their number there.
    pub id: u64,
    pub precedence: u32,
}

/// A camera and what is said of it, in JSON.
pub type Message = (String, String);

/// Between the thread that hands over and whoever passes messages on.
#[derive(Debug)]
pub struct Exchange {
    /// When it began, milliseconds since 1970: no camera has a new pipeline as often.
    began_ms: u64,
    said: mpsc::Sender<Message>,
    /// Cameras that ours work with; of no other anything is taken, so that nobody can have us remember any number of them.
    concerned: Mutex<BTreeSet<String>>,
    heard: Mutex<BTreeMap<String, Heard>>,
}

/// A camera of another process.
#[derive(Debug, Clone)]
struct Heard {
    at: Instant,
    errand: Option<Errand>,
    video: Duration,
    turns: bool,
    can_be_called: bool,
    /// As if it were here; nothing runs it, so what it is told has no effect.
    known: Arc<Known>,
}

impl Exchange {
    pub fn new() -> (Arc<Self>, mpsc::Receiver<Message>) {
        let (said, saying) = mpsc::channel(WAITING);
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let began_ms = u64::try_from(since.as_millis()).unwrap_or_default();
        (Arc::new(Self { began_ms, said, concerned: Mutex::default(), heard: Mutex::default() }), saying)
    }

    /// Hears of these cameras from now on.
    pub fn listen_for(&self, cameras: BTreeSet<String>) {
        *lock(&self.concerned) = cameras;
    }

    /// Tells others of a camera.
    pub fn tell(&self, view: &View) {
        if let Ok(text) = serde_json::to_string(&Report::of(view, self.began_ms)) {
            // Where it finds no place, the next one will.
            let _ = self.said.try_send((view.known.name.clone(), text));
        }
    }

    /// Takes what others say of a camera, where it is one that is listened for.
    ///
    /// # Errors
    /// Where it makes no sense.
    pub fn hear(&self, camera: &str, said: &[u8]) -> Result<(), String> {
        if !lock(&self.concerned).contains(camera) {
            return Ok(());
        }
        let report: Report = serde_json::from_slice(said).map_err(|err| err.to_string())?;
        report.check()?;
        let mut heard = lock(&self.heard);
        heard.retain(|_, heard| heard.at.elapsed() < SILENT);
        let known =
            heard.get(camera).map_or_else(|| Arc::new(Known::new(camera)), |heard| heard.known.clone());
        report.make_known(&known);
        let Report { errand, video, turns, can_be_called, .. } = report;
        heard.insert(
            camera.to_owned(),
            Heard { at: Instant::now(), errand, video, turns, can_be_called, known },
        );
        Ok(())
    }

    /// The cameras of others that were heard of lately.
    pub fn views(&self, now: Instant) -> Vec<View> {
        let heard: Vec<Heard> = lock(&self.heard).values().cloned().collect();
        let lately = |heard: &Heard| now.saturating_duration_since(heard.at) < SILENT;
        heard.into_iter().filter(lately).map(View::from).collect()
    }
}

impl From<Heard> for View {
    fn from(heard: Heard) -> Self {
        let Heard { errand, video, turns, can_be_called, known, .. } = heard;
        let seen = known.sight.borrow().clone();
        Self {
            is_here: false,
            errand,
            video,
            turns,
            can_be_called,
            known,
            seen,
            widest_fov_deg: None,
            target_height: None,
        }
    }
}

impl Report {
    fn of(view: &View, began_ms: u64) -> Self {
        let known = &view.known;
        Self {
            sight: view.seen.1.clone(),
            age: view.seen.0.elapsed(),
            video: view.video,
            turns: view.turns,
            can_be_called: view.can_be_called,
            follows: view.follows(),
            target: lock(&known.state).target_id,
            selected: *lock(&known.selected),
            origin: lock(&known.origin).clone(),
            errand: view.errand.clone(),
            pipelines: began_ms.saturating_add(known.rebuilt.load(Ordering::Relaxed)),
        }
    }

    /// Nothing that is no angle and no part of a picture reaches a camera.
    fn check(&self) -> Result<(), String> {
        let Sight { people, poses, reckoned, rate_deg_s, .. } = &self.sight;
        let is_part = |part: &f64| part.abs() <= 10.0;
        let wrong = people.iter().find(|person| !person.bounds.iter().chain(&person.velocity).all(is_part));
        if let Some(person) = wrong {
            return Err(format!("{person:?} is in no picture"));
        }
        let is_view = |degrees: f64| degrees > 0.0 && degrees < 180.0;
        let wrong = poses.iter().chain(reckoned).find(|pose| {
            let [pan, tilt] = [pose.pan_deg, pose.tilt_deg].map(f64::abs);
            !(pan <= 720.0
                && tilt <= 180.0
                && is_view(pose.horizontal_fov_deg)
                && is_view(pose.vertical_fov_deg))
        });
        if let Some(pose) = wrong {
            return Err(format!("no camera looks like that: {pose:?}"));
        }
        let ages = poses.iter().chain(reckoned).map(|pose| pose.age);
        let latest = ages.fold(self.age.max(self.video), Duration::max);
        if latest > LATEST {
            return Err(format!("a picture or a direction that is {latest:?} late"));
        }
        let fast = rate_deg_s.iter().find(|rate| rate.abs() > 1000.0);
        fast.map_or(Ok(()), |rate| Err(format!("no camera turns by {rate} degrees per second")))
    }

    fn make_known(&self, known: &Known) {
        if known.rebuilt.swap(self.pipelines, Ordering::Relaxed) != self.pipelines {
            known.forget_tracks();
        }
        let came = Instant::now().checked_sub(self.age).unwrap_or_else(Instant::now);
        known.sight.send_replace(Arc::new((came, self.sight.clone())));
        let mut state = lock(&known.state);
        (state.picture, state.target_id) = (self.follows, self.target);
        drop(state);
        *lock(&known.selected) = self.selected;
        lock(&known.origin).clone_from(&self.origin);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Person;
    use crate::handover::stage::{FEET, RATE, person, target, view};

    fn said() -> (View, String) {
        let (exchange, mut saying) = Exchange::new();
        // JSON tells these parts to the last digit.
        let somebody = Person { bounds: [0.25, 0.375, 0.125, 0.25], ..target(person(7, FEET, RATE)) };
        let mut door = view("door", true, Instant::now(), vec![somebody]);
        door.errand = Some(Errand { from: "yard".to_owned(), id: 3, precedence: 2 });
        door.video = Duration::from_millis(120);
        lock(&door.known.state).target_id = Some(7);
        *lock(&door.known.selected) = Some(7);
        exchange.tell(&door);
        let (camera, said) = saying.try_recv().unwrap();
        assert_eq!(camera, "door");
        (door, said)
    }

    /// Of another process, which works with the door.
    fn another() -> Arc<Exchange> {
        let (exchange, _) = Exchange::new();
        exchange.listen_for(["door".to_owned()].into());
        exchange
    }

    #[test]
    fn of_cameras_that_ours_do_not_work_with_nothing_is_taken() {
        let (_, said) = said();
        let exchange = another();
        (0..1000).for_each(|n| exchange.hear(&format!("camera-{n}"), said.as_bytes()).unwrap());
        assert!(lock(&exchange.heard).is_empty());
    }

    #[test]
    fn what_one_process_sees_another_one_knows() {
        let (door, said) = said();
        let exchange = another();
        let before = Instant::now();
        exchange.hear("door", said.as_bytes()).unwrap();
        let views = exchange.views(before);
        let [there] = views.as_slice() else { panic!("{}", views.len()) };
        assert!(!there.is_here && there.turns && there.follows() && there.can_be_called);
        assert_eq!((&there.seen.1, &there.errand, there.video), (&door.seen.1, &door.errand, door.video));
        assert_eq!(lock(&there.known.state).target_id, Some(7));
        assert_eq!(*lock(&there.known.selected), Some(7));
        assert!(there.is_called_for("yard", 3) && !there.is_called_for("yard", 4));
        assert!(exchange.views(Instant::now() + SILENT).is_empty(), "nothing was heard of it since");
    }

    #[test]
    fn what_makes_no_sense_is_not_believed() {
        let (_, said) = said();
        let exchange = another();
        for (right, wrong) in [
            ("\"tilt_deg\":-10.0", "\"tilt_deg\":1e300"),
            ("\"horizontal_fov_deg\":60.0", "\"horizontal_fov_deg\":0.0"),
            ("\"velocity\":[0.2,0.0]", "\"velocity\":[0.2,1e30]"),
            ("\"rate_deg_s\":[0.0,0.0]", "\"rate_deg_s\":[0.0,1e9]"),
            ("\"secs\":0,\"nanos\":120000000", "\"secs\":18446744073709551615,\"nanos\":120000000"),
            ("\"age\":{\"secs\":0,\"nanos\":0}", "\"age\":{\"secs\":100,\"nanos\":0}"),
            ("\"turns\":true", "\"turns\":7"),
        ] {
            assert!(said.contains(right), "{right}: {said}");
            assert!(exchange.hear("door", said.replace(right, wrong).as_bytes()).is_err(), "{wrong}");
        }
        assert!(exchange.views(Instant::now()).is_empty());
    }

    #[test]
    fn with_another_pipeline_its_tracks_are_others() {
        let (door, said) = said();
        let report: Report = serde_json::from_str(&said).unwrap();
        report.make_known(&door.known);
        lock(&door.known.ignored).insert(9);
        report.make_known(&door.known);
        assert!(lock(&door.known.ignored).contains(&9));
        let anew = Report::of(&door, 1_700_000_000_000);
        assert_ne!(anew.pipelines, report.pipelines, "of a process that was started anew");
        anew.make_known(&door.known);
        assert!(lock(&door.known.ignored).is_empty());
    }
}
