// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeSet;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use pipeline_supervisor::video::Ended;
use ptztrack_contract::Point;
use ptztrack_contract::lock::lock;
use serde::{Deserialize, Serialize};
use tokio::sync::{broadcast, oneshot, watch};

use super::packets::{self, Packet};
use super::running::Running;
use super::servo_stats::ServoStats;
use super::sight::Sight;
use super::stopwatch::Stopwatch;
use super::view::Shown;

/// A camera's thread waits for 10 s at most, for the end of a stream, and for as long as its elements take to stop.
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

/// What a tracker does that has found nobody yet.
pub const SEARCHING: &str = "searching";

/// What is known of one camera, for everybody who asks.
#[derive(Debug)]
pub struct Known {
    pub name: String,
    /// Since when.
    begin: Instant,
    pub state: Mutex<State>,
    /// What runs now.
    pub running: Mutex<Option<Arc<dyn Running>>>,
    pub pictures: AtomicU64,
    pub processed: AtomicU64,
    /// User and password have worked, if not in this program, then in one before it.
    pub worked: AtomicBool,
    /// By the pipelines before this one; between two, more than there can be.
    processed_before: AtomicU64,
    pub rebuilt: AtomicU64,
    pub failures: AtomicU64,
    /// Nanoseconds after `begin`.
    last_picture: AtomicU64,
    last_heartbeat: AtomicU64,
    pub steering: Mutex<Steering>,
    /// Somebody else moves the camera, as was told last.
    pub operator: AtomicBool,
    /// What ended the pictures, where that is known better than an element can say.
    pub ended: Ended,
    /// How many look at the picture.
    pub looking: Arc<AtomicUsize>,
    /// What was seen last, and when, of a camera that people are handed over from or to.
    pub sight: watch::Sender<Arc<(Instant, Sight)>>,
    /// What somebody has said that it sees, which nobody has taken notice of yet.
    pub points: Mutex<Vec<Pointed>>,
    /// Tracks that it does not follow by itself, as another camera follows them.
    pub ignored: Mutex<BTreeSet<u64>>,
    /// Whom it calls, where people are handed over.
    pub calls: Mutex<Vec<String>>,
    /// Number of whom somebody selected in the picture, of a camera that people are handed over from or to.
    pub selected: Mutex<Option<u64>>,
    /// Whom another camera saw before this one took them up.
    pub origin: Mutex<Option<Origin>>,
    /// The last picture for who looks.
    pub view: watch::Sender<Shown>,
    /// Its stream and what is seen in it, for who passes them on.
    pub packets: broadcast::Sender<Packet>,
    pub times: Vec<Stopwatch>,
}

/// Somebody, as two cameras know them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// The number that they have here ...
    pub target: u64,
    /// ... and there.
    pub id: u64,
    /// Who called.
    pub camera: String,
}

/// One place in the pictures of two cameras, as somebody says: 0 to 1 from the left and from the top.
#[derive(Debug)]
pub struct Pointed {
    /// The other camera.
    pub from: String,
    pub there: Point,
    pub here: Point,
    /// Whether that can be, in words.
    pub answer: oneshot::Sender<Result<String, String>>,
}

/// What its messages told.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct State {
    /// Pictures come.
    pub picture: bool,
    /// `searching`, `tracking`, `occluded` or `lost`.
    pub target: String,
    /// Number of the target, where there is one.
    pub target_id: Option<u64>,
    /// What was told last that is not as it should be.
    pub trouble: Option<String>,
    /// How often the camera refused to be sent to a position.
    pub refused_moves: u64,
    /// It will not be tried again by itself.
    pub given_up: bool,
}

/// Who has the camera.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Steering {
    /// It follows.
    #[default]
    Follow,
    /// It was sent home then.
    GoHome(Instant),
    /// Another camera sees somebody there; since then.
    LookAt(Gaze, Instant),
    /// Nobody was found there: it turns to where it looked before; since then.
    TurnBack(Gaze, Instant),
    /// It is somebody else's, who asked for it.
    HandedOver,
    /// Somebody at the page has it look there; until then it is left alone.
    Turned(Gaze, Instant),
    /// Somebody else was moving it when the last pipeline ended; until then it is left alone.
    Operator(Instant),
}

/// Where a camera is to look, in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gaze {
    pub pan_deg: f64,
    pub tilt_deg: f64,
    /// Horizontal; `None` leaves the zoom as it is.
    pub fov_deg: Option<f64>,
}

impl fmt::Display for Gaze {
    /// As the property `look-at` has it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.pan_deg, self.tilt_deg)?;
        self.fov_deg.map_or(Ok(()), |fov_deg| write!(f, ",{fov_deg}"))
    }
}

/// What is known of who has a camera, and outlives pipelines and the program.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Control {
    /// Nobody but us.
    #[default]
    Ours,
    HandedOver,
    /// Somebody else moves it.
    Operator,
}

impl Known {
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            begin: Instant::now(),
            state: Mutex::new(State { target: SEARCHING.to_owned(), ..State::default() }),
            running: Mutex::default(),
            pictures: AtomicU64::default(),
            processed: AtomicU64::default(),
            worked: AtomicBool::default(),
            processed_before: AtomicU64::default(),
            rebuilt: AtomicU64::default(),
            failures: AtomicU64::default(),
            last_picture: AtomicU64::default(),
            last_heartbeat: AtomicU64::default(),
            steering: Mutex::default(),
            operator: AtomicBool::default(),
            ended: Ended::default(),
            looking: Arc::default(),
            sight: watch::Sender::new(Arc::new((Instant::now(), Sight::default()))),
            points: Mutex::default(),
            ignored: Mutex::default(),
            calls: Mutex::default(),
            selected: Mutex::default(),
            origin: Mutex::default(),
            view: watch::Sender::new(Shown::default()),
            packets: packets::channel(),
            times: Stopwatch::all(),
        }
    }

    /// Who has the camera, for who comes after us.
    pub fn control(&self) -> Control {
        match *lock(&self.steering) {
            Steering::HandedOver => Control::HandedOver,
            Steering::Operator(_) | Steering::Turned(..) => Control::Operator,
            _ if self.operator.load(Ordering::Relaxed) => Control::Operator,
            _ => Control::Ours,
        }
    }

    /// It is left alone until it is taken back.
    pub fn is_handed_over(&self) -> bool {
        *lock(&self.steering) == Steering::HandedOver
    }

    /// Who had the camera before us.
    pub fn take_control(&self, control: Control) {
        match control {
            Control::Ours => {}
            Control::HandedOver => *lock(&self.steering) = Steering::HandedOver,
            Control::Operator => self.operator.store(true, Ordering::Relaxed),
        }
    }

    /// Steers it by what `next` says to who has it now, if it says anything; whether it did. Nobody takes the camera between that
    /// question and the word to what runs it, which waits for nothing.
    pub fn steer_by(&self, next: impl FnOnce(Steering) -> Option<Steering>) -> bool {
        let mut steering = lock(&self.steering);
        let Some(next) = next(*steering) else { return false };
        *steering = next;
        self.with(|running| running.steer(next));
        true
    }

    /// Lets it follow, or hands it over, whoever has it.
    pub fn steer(&self, steering: Steering) {
        self.steer_by(|_| Some(steering));
    }

    /// The same, where who has it now may lose it to that; whether it was done.
    pub fn steer_if(&self, may: impl FnOnce(Steering) -> bool, steering: Steering) -> bool {
        self.steer_by(|now| may(now).then_some(steering))
    }

    /// Tells what runs now who has the camera, if somebody has taken it since that was `told`.
    pub fn steer_since(&self, told: Steering) {
        self.steer_by(|now| (now != told).then_some(now));
    }

    /// Tells the next pipeline how to begin: who is moving the camera has it for as long as they would have had in the last one.
    pub fn steer_at_start(&self, operator_has_it: Duration) {
        self.steer_by(|now| {
            // The next pipeline tells anew whether somebody moves it.
            let moves = self.operator.swap(false, Ordering::Relaxed);
            Some(match now {
                Steering::HandedOver => now,
                // Whatever it was to do, he took it from us.
                _ if moves => Steering::Operator(Instant::now() + operator_has_it),
                _ => now,
            })
        });
    }

    /// A picture went all the way.
    pub fn saw_picture(&self) {
        self.processed.fetch_add(1, Ordering::Relaxed);
        self.worked.store(true, Ordering::Relaxed);
        self.last_picture.store(self.now(), Ordering::Relaxed);
    }

    /// Pictures count no more, those that are still under way neither: the pipeline is over.
    pub fn ends(&self) {
        self.processed_before.store(u64::MAX, Ordering::Relaxed);
    }

    /// Another pipeline begins, the one before having stopped.
    pub fn begins(&self) {
        self.processed_before.store(self.processed.load(Ordering::Relaxed), Ordering::Relaxed);
        self.forget_tracks();
        self.reset_silence();
    }

    /// Another pipeline's tracks have other numbers.
    pub fn forget_tracks(&self) {
        lock(&self.ignored).clear();
        lock(&self.selected).take();
        lock(&self.origin).take();
    }

    /// The last picture counts from now.
    pub fn reset_silence(&self) {
        self.last_picture.store(self.now(), Ordering::Relaxed);
    }

    /// The last picture came so long ago.
    pub fn last_picture_was(&self, ago: Duration) {
        let ago = u64::try_from(ago.as_nanos()).unwrap_or(u64::MAX);
        self.last_picture.store(self.now().saturating_sub(ago), Ordering::Relaxed);
    }

    /// The pipeline that runs now has had one.
    pub fn has_picture(&self) -> bool {
        self.processed.load(Ordering::Relaxed) > self.processed_before.load(Ordering::Relaxed)
    }

    pub fn since_picture(&self) -> Duration {
        self.since(&self.last_picture)
    }

    /// Whoever runs the camera is alive.
    pub fn beat(&self) {
        self.last_heartbeat.store(self.now(), Ordering::Relaxed);
    }

    /// Whoever runs the camera has not been heard of for too long.
    pub fn is_stuck(&self) -> bool {
        self.since(&self.last_heartbeat) > LONGEST_PAUSE
    }

    fn since(&self, moment: &AtomicU64) -> Duration {
        Duration::from_nanos(self.now().saturating_sub(moment.load(Ordering::Relaxed)))
    }

    fn now(&self) -> u64 {
        u64::try_from(self.begin.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    /// What the sink says of itself, where one runs.
    pub fn servo(&self) -> Option<ServoStats> {
        let running = lock(&self.running).clone();
        running?.servo_stats()
    }

    /// From when a picture is taken until it is here. Of the whole delay of commands and pictures, half is taken to be that of
    /// pictures, as everywhere.
    pub fn video_delay(&self) -> Duration {
        let latency = self.servo().and_then(|servo| servo.numbers.get("latency").copied()).unwrap_or(0);
        Duration::from_nanos(latency / 2)
    }

    /// Whether the camera rests.
    pub fn is_at_rest(&self) -> bool {
        self.servo().and_then(|servo| servo.state).as_deref() == Some("at-rest")
    }

    fn origin_in_words(&self, target: u64) -> String {
        match &*lock(&self.origin) {
            Some(origin) if origin.target == target => format!(" ({} of {})", origin.id, origin.camera),
            _ => String::new(),
        }
    }

    /// Its state in words.
    pub fn in_words(&self) -> String {
        self.words(lock(&self.state).clone())
    }

    /// The same, with whom a picture shows.
    pub fn words_of(&self, shown: &Shown) -> String {
        let mut state = lock(&self.state).clone();
        if let Some(target) = &shown.target {
            (state.target, state.target_id) = (target.state.clone(), target.id);
        }
        self.words(state)
    }

    fn words(&self, state: State) -> String {
        if state.given_up {
            return format!("given up: {}", state.trouble.unwrap_or_default());
        }
        if !state.picture {
            return format!("no picture: {}", state.trouble.as_deref().unwrap_or("none came yet"));
        }
        let target = match (state.target.as_str(), state.target_id) {
            ("tracking", Some(id)) => format!("follows target {id}{}", self.origin_in_words(id)),
            ("occluded", Some(id)) => format!("target {id} is hidden"),
            _ => "looks for somebody".to_owned(),
        };
        let camera = self.servo().and_then(|servo| servo.state);
        let camera = match (*lock(&self.steering), camera.as_deref()) {
            (Steering::HandedOver, _) => "the camera is handed over",
            // Also from us who sent it somewhere.
            (_, Some("taken-over")) => "an operator has the camera",
            (Steering::GoHome(_), _) => "the camera goes home",
            (Steering::LookAt(..), _) => "the camera turns to whom another one sees",
            (Steering::TurnBack(..), _) => "the camera turns back",
            (Steering::Operator(_) | Steering::Turned(..), _) => "an operator has the camera",
            (_, Some("at-rest")) => "the camera rests",
            (_, Some("moving")) => "the camera turns",
            (_, Some("refused")) => "the camera refuses to be moved",
            (_, Some("disconnected")) => "the camera does not answer",
            _ => "the camera is not moved",
        };
        format!("{target}, {camera}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::told::Told;

    #[test]
    fn who_has_a_camera_has_it_beyond_a_pipeline() {
        let known = Known::new("door");
        let begin = |known: &Known| {
            known.steer_at_start(Duration::from_secs(5));
            *lock(&known.steering)
        };
        assert_eq!(begin(&known), Steering::Follow);
        known.operator.store(true, Ordering::Relaxed);
        assert_eq!(known.control(), Control::Operator);
        assert!(matches!(begin(&known), Steering::Operator(_)));
        // Nor is it moved on in the next one where it was sent somewhere.
        let gaze = Gaze { pan_deg: 0.0, tilt_deg: 0.0, fov_deg: None };
        let now = Instant::now();
        for errand in [Steering::GoHome(now), Steering::LookAt(gaze, now), Steering::Turned(gaze, now)] {
            *lock(&known.steering) = errand;
            assert_eq!(begin(&known), errand);
            known.operator.store(true, Ordering::Relaxed);
            assert!(matches!(begin(&known), Steering::Operator(_)), "{errand:?}");
        }
        known.operator.store(true, Ordering::Relaxed);
        let next = Known::new("door");
        next.take_control(known.control());
        assert_eq!(next.control(), Control::Operator);
        *lock(&known.steering) = Steering::HandedOver;
        next.take_control(known.control());
        assert_eq!(begin(&next), Steering::HandedOver);
        // Who moved it before it was handed over has it no more once it is taken back.
        next.steer(Steering::Follow);
        assert_eq!(next.control(), Control::Ours);
    }

    #[test]
    fn what_runs_a_camera_is_told_of_who_has_it_before_anybody_else_can_take_it() {
        let (known, told) = Told::running("door");
        known.steer(Steering::HandedOver);
        assert!(!known.steer_if(|now| now == Steering::Follow, Steering::GoHome(Instant::now())));
        assert_eq!(
            (*lock(&known.steering), told.steering()),
            (Steering::HandedOver, vec![Steering::HandedOver])
        );
        assert!(known.steer_if(|now| now == Steering::HandedOver, Steering::Follow));
        assert_eq!(told.steering(), [Steering::HandedOver, Steering::Follow]);
        assert!(told.was_told_under_lock());
    }

    /// The pipeline or the process before was there no more, or had been told already.
    #[test]
    fn who_took_a_camera_while_nothing_ran_it_has_it_from_what_runs_next() {
        let (known, told) = Told::running("door");
        *lock(&known.steering) = Steering::HandedOver;
        known.steer_at_start(Duration::ZERO);
        known.steer_since(Steering::Follow);
        known.steer_since(Steering::HandedOver);
        assert_eq!(told.steering(), [Steering::HandedOver; 2], "it had heard of the last one");
    }

    /// The connection breaks while a picture is on its way through the tracker.
    #[test]
    fn a_picture_that_is_under_way_at_the_end_is_none_of_the_next_pipeline() {
        let known = Known::new("door");
        known.begins();
        assert!(!known.has_picture());
        known.saw_picture();
        assert!(known.has_picture());
        known.ends();
        known.saw_picture();
        assert!(!known.has_picture(), "between two pipelines");
        known.begins();
        assert!(!known.has_picture(), "in the next one");
        known.saw_picture();
        assert!(known.has_picture());
    }
}
