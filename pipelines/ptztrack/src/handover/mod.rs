// SPDX-License-Identifier: MPL-2.0

//! Cameras that work together: whom one sees, another turns to. A thread of its own, which nobody waits for: where it fails, every
//! camera follows whom it sees itself.

mod call;
mod link;
mod maps;
mod walkers;

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, Weak};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use call::{Call, Progress};
use link::{Link, Seen};
use maps::Maps;
use ptztrack_contract::lock::lock;
use walkers::Walkers;

use crate::camera::{Known, Person, Steering};
use crate::config::{Config, HandOver};
use crate::event::{Event, Level};
use crate::fleet::Fleet;
use crate::log::Log;

/// Between two looks at what the cameras see: about as often as pictures come.
const EVERY: Duration = Duration::from_millis(50);
/// Between two times at which what was learned is kept.
const KEEP_EVERY: Duration = Duration::from_secs(10);
/// Somebody who was called for in vain, or is lost again, is called for again after this.
const CALL_AGAIN: Duration = Duration::from_secs(5);
/// What was seen longer ago says nothing of where somebody is.
const FRESH: Duration = Duration::from_millis(500);

/// The thread that hands over.
#[derive(Debug)]
pub struct HandingOver {
    /// Which cameras call which, as the file says; the thread ends with it.
    wishes: Arc<Mutex<Vec<HandOver>>>,
    thread: JoinHandle<()>,
}

impl HandingOver {
    /// Starts it.
    ///
    /// # Errors
    /// Where the system has no thread left.
    pub fn start(config: &Config, fleet: Arc<Fleet>, log: Arc<Log>) -> std::io::Result<Self> {
        let wishes = Arc::new(Mutex::new(config.hand_over.clone()));
        let watched = Arc::downgrade(&wishes);
        let work = move || Dispatcher::new(fleet, log).run(&watched);
        let thread = thread::Builder::new().name("hand-over".to_owned()).spawn(work)?;
        Ok(Self { wishes, thread })
    }

    /// What the file says now.
    pub fn change(&self, config: &Config) {
        lock(&self.wishes).clone_from(&config.hand_over);
    }

    /// Ends it, once what was learned is kept.
    pub fn end(self) {
        drop(self.wishes);
        // One that panicked has said so.
        let _ = self.thread.join();
    }
}

/// One camera as this thread sees it in one moment.
struct View {
    known: Arc<Known>,
    seen: Arc<Seen>,
    /// How late its pictures are.
    video: Duration,
    /// Horizontal, zoomed out, as far as that was seen.
    widest_fov_deg: Option<f64>,
    /// How tall whom it follows is to be, where it zooms.
    target_height: Option<f64>,
}

/// Sees who is where, and calls.
struct Dispatcher {
    fleet: Arc<Fleet>,
    log: Arc<Log>,
    maps: Maps,
    /// By who calls and who is called.
    links: BTreeMap<(String, String), Link>,
    walkers: BTreeMap<String, Walkers>,
    /// By who is called.
    calls: BTreeMap<String, Call>,
    /// The widest field of view of each.
    widest: BTreeMap<String, f64>,
    /// Who was called for, by the camera that sees them, and until when they are not again.
    spared: BTreeMap<(String, u64), Instant>,
}

impl Dispatcher {
    fn new(fleet: Arc<Fleet>, log: Arc<Log>) -> Self {
        Self {
            maps: Maps::new(log.clone()),
            fleet,
            log,
            links: BTreeMap::new(),
            walkers: BTreeMap::new(),
            calls: BTreeMap::new(),
            widest: BTreeMap::new(),
            spared: BTreeMap::new(),
        }
    }

    fn run(mut self, wishes: &Weak<Mutex<Vec<HandOver>>>) {
        let mut kept = Instant::now();
        while let Some(wishes) = wishes.upgrade() {
            let wishes = lock(&wishes).clone();
            if !wishes.is_empty() {
                self.tick(&wishes);
            }
            if kept.elapsed() > KEEP_EVERY {
                kept = Instant::now();
                self.keep();
            }
            thread::sleep(EVERY);
        }
        self.keep();
    }

    fn keep(&mut self) {
        for ((from, to), link) in self.links.iter_mut().filter(|(_, link)| link.changed) {
            link.changed = false;
            self.maps.keep(from, to, &link.map);
        }
    }

    fn tick(&mut self, wishes: &[HandOver]) {
        let concerned = |known: &Arc<Known>| wishes.iter().any(|wish| wish.concerns(&known.name));
        let known: Vec<_> = self.fleet.known().into_iter().filter(concerned).collect();
        let views: BTreeMap<String, View> =
            known.into_iter().map(|known| (known.name.clone(), self.view(known))).collect();
        for wish in wishes {
            let Some(from) = views.get(&wish.from) else { continue };
            self.walkers.entry(wish.from.clone()).or_default().see(&from.seen);
            for called in &wish.calls {
                if let Some(to) = views.get(called) {
                    self.learn((&wish.from, from), (called, to));
                }
            }
        }
        self.take_points(wishes, &views);
        self.advance(&views);
        let now = Instant::now();
        self.spared.retain(|_, until| *until > now);
        for wish in wishes {
            self.call(wish, wishes, &views);
        }
    }

    fn view(&mut self, known: Arc<Known>) -> View {
        let seen = known.sight.borrow().clone();
        for pose in &seen.1.poses {
            let widest = self.widest.entry(known.name.clone()).or_default();
            *widest = widest.max(pose.horizontal_fov_deg);
        }
        View {
            video: known.video_delay(),
            widest_fov_deg: self.widest.get(&known.name).copied(),
            target_height: self.fleet.target_height(&known.name),
            known,
            seen,
        }
    }

    fn link(&mut self, from: &str, to: &str) -> &mut Link {
        let maps = &self.maps;
        let key = (from.to_owned(), to.to_owned());
        self.links.entry(key).or_insert_with(|| Link::new(maps.load(from, to)))
    }

    fn learn(&mut self, (from, caller): (&str, &View), (to, called): (&str, &View)) {
        // On its way it follows nobody.
        if !called.follows() {
            return;
        }
        if self.link(from, to).see(&caller.seen, &called.seen, called.video) {
            let detail = format!(
                "{from} or {to} was moved: where {to} has to look for whom {from} sees is learned anew"
            );
            self.tell(to, Level::Warning, "map-void", detail);
        }
    }

    /// What somebody says.
    fn take_points(&mut self, wishes: &[HandOver], views: &BTreeMap<String, View>) {
        for (to, called) in views {
            for (from, x, y) in std::mem::take(&mut *lock(&called.known.points)) {
                if !wishes.iter().any(|wish| wish.from == from && wish.calls.contains(to)) {
                    let detail = format!("{from} does not call it: [handover.{from}] says who calls whom");
                    self.tell(to, Level::Warning, "pointed", detail);
                    continue;
                }
                let learned =
                    called.seen.1.pose_at(called.video).map(|pose| self.link(&from, to).point(x, y, &pose));
                let place = format!("{x:.2},{y:.2} of {from}");
                let detail = match learned {
                    Some(true) => format!("looks at {place}, as somebody says"),
                    Some(false) => format!("does not look at {place}, by all that is known"),
                    None => format!(
                        "cannot be told that it looks at {place}: it turns, or does not say where it looks"
                    ),
                };
                self.tell(to, Level::Info, "pointed", detail);
            }
        }
    }

    /// Sees to those that are on their way.
    fn advance(&mut self, views: &BTreeMap<String, View>) {
        for (to, mut call) in std::mem::take(&mut self.calls) {
            let (Some(from), Some(called)) = (views.get(&call.from), views.get(&to)) else { continue };
            let link = self.links.get(&(call.from.clone(), to.clone()));
            let progress = link.map_or(Progress::Failed, |link| call.advance(link, &from.seen, called));
            let whom = format!("target {} of {}", call.id, call.from);
            match progress {
                Progress::Going => {
                    self.calls.insert(to, call);
                    continue;
                }
                Progress::TakenUp(id) => {
                    self.tell(&to, Level::Info, "taken-up", format!("target {id} is {whom}"));
                }
                Progress::Overruled => {}
                Progress::Failed => {
                    self.tell(&to, Level::Info, "not-found", format!("{whom} was not found"));
                }
            }
            self.spared.insert((call.from, call.id), Instant::now() + CALL_AGAIN);
        }
    }

    /// Calls for those whom this camera sees and nobody follows.
    fn call(&mut self, wish: &HandOver, wishes: &[HandOver], views: &BTreeMap<String, View>) {
        let Some(from) = views.get(&wish.from).filter(|view| view.seen.0.elapsed() < FRESH) else { return };
        let Some(walkers) = self.walkers.get(&wish.from) else { return };
        let in_zone = |person: &Person| {
            let feet = person.feet();
            wish.zones.is_empty() || wish.zones.iter().any(|zone| zone.contains(feet.x, feet.y))
        };
        let walking: Vec<Person> =
            walkers.walking(&from.seen.1).filter(|person| in_zone(person)).cloned().collect();
        for person in walking {
            let is_spared = self.spared.contains_key(&(wish.from.clone(), person.id));
            if is_spared || self.is_attended(wish, from, &person, views) {
                continue;
            }
            let new_call = |to: &String| {
                let called = views.get(to)?;
                let occupied = self.precedence(to, called, wishes);
                let is_free = called.follows() || self.calls.contains_key(to);
                let call = || self.new_call(wish, to, (from, &person), called);
                if is_free && occupied.is_none_or(|occupied| occupied < wish.precedence) {
                    call()
                } else {
                    None
                }
            };
            let free = wish.calls.iter().find_map(new_call);
            if let Some((to, call)) = free {
                let detail = format!("turns to target {} of {}", person.id, wish.from);
                self.tell(&to, Level::Info, "called", detail);
                self.calls.insert(to, call);
            }
        }
    }

    /// Whether a camera follows this person, or is on its way.
    fn is_attended(
        &self,
        wish: &HandOver,
        from: &View,
        person: &Person,
        views: &BTreeMap<String, View>,
    ) -> bool {
        let on_the_way = |call: &Call| call.from == wish.from && call.id == person.id;
        self.calls.values().any(on_the_way)
            || wish.calls.iter().any(|to| {
                let link = self.links.get(&(wish.from.clone(), to.clone()));
                let followed = |(link, view): (&Link, &View)| call::follows(link, &from.seen, person, view);
                link.zip(views.get(to)).is_some_and(followed)
            })
    }

    /// A call of this camera for this person, if it is known where they are.
    fn new_call(
        &self,
        wish: &HandOver,
        to: &str,
        (from, person): (&View, &Person),
        called: &View,
    ) -> Option<(String, Call)> {
        let link = self.links.get(&(wish.from.clone(), to.to_owned()))?;
        let call = Call::new(wish, person.id);
        call.gaze(link, &from.seen, called)?;
        Some((to.to_owned(), call))
    }

    /// That of whom a camera follows or turns to; `None` where it does neither.
    fn precedence(&self, to: &str, called: &View, wishes: &[HandOver]) -> Option<u32> {
        if let Some(call) = self.calls.get(to) {
            return Some(call.precedence);
        }
        let target = lock(&called.known.state).target_id?;
        let origin = lock(&called.known.origin).clone().filter(|origin| origin.target == target);
        let from = origin.and_then(|origin| wishes.iter().find(|wish| wish.from == origin.camera));
        Some(from.map_or(0, |wish| wish.precedence))
    }

    fn tell(&self, camera: &str, level: Level, event: &str, detail: String) {
        self.log.tell(&Event::new(level, Some(camera), event, detail));
    }
}

impl View {
    /// It is ours, it has a picture, and nothing else is wanted of it.
    fn follows(&self) -> bool {
        *lock(&self.known.steering) == Steering::Follow
            && !self.known.operator.load(Ordering::Relaxed)
            && lock(&self.known.state).picture
    }
}
