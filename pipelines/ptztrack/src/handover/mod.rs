// SPDX-License-Identifier: MPL-2.0

//! Cameras that work together: whom one sees, another turns to. A thread of its own, which nobody waits for: where it fails, every
//! camera follows whom it sees itself.

mod call;
mod calling;
mod exchange;
mod link;
mod maps;
mod motion;
mod points;
mod sharing;
#[cfg(test)]
mod stage;
mod view;
mod walkers;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, Weak};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use call::Call;
use exchange::Errand;
pub use exchange::{Exchange, Message};
use link::Link;
use maps::Maps;
use ptztrack_contract::lock::lock;
use sharing::Sharing;
use view::View;
use walkers::Walkers;

use crate::camera::Known;
use crate::config::{Config, HandOver};
use crate::event::{Event, Level};
use crate::fleet::Fleet;
use crate::log::Log;

/// Between two looks at what the cameras see: about as often as pictures come.
const EVERY: Duration = Duration::from_millis(50);
/// Between two times at which what was learned is kept.
const KEEP_EVERY: Duration = Duration::from_secs(10);

/// The thread that hands over.
#[derive(Debug)]
pub struct HandingOver {
    /// Which cameras call which, as the file says; the thread ends with it.
    wishes: Arc<Mutex<Vec<HandOver>>>,
    thread: JoinHandle<()>,
}

impl HandingOver {
    /// Starts it, for cameras of other processes, too, where there is an exchange with these.
    ///
    /// # Errors
    /// Where the system has no thread left.
    pub fn start(
        config: &Config,
        fleet: Arc<Fleet>,
        exchange: Option<Arc<Exchange>>,
        log: Arc<Log>,
    ) -> std::io::Result<Self> {
        let wishes = Arc::new(Mutex::new(config.hand_over.clone()));
        let watched = Arc::downgrade(&wishes);
        let work = move || Dispatcher::new(fleet, exchange, log).run(&watched);
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

/// Sees who is where, and calls.
struct Dispatcher {
    fleet: Arc<Fleet>,
    exchange: Option<Arc<Exchange>>,
    log: Arc<Log>,
    maps: Maps,
    /// By who calls and who is called.
    links: BTreeMap<(String, String), Link>,
    walkers: BTreeMap<String, Walkers>,
    /// By who is called.
    calls: BTreeMap<String, Call>,
    sharing: Sharing,
    /// How many pipelines each has had.
    pipelines: BTreeMap<String, u64>,
    /// When the last picture came of which others were told.
    told: BTreeMap<String, Instant>,
    /// The widest field of view of each.
    widest: BTreeMap<String, f64>,
    /// Cameras that follow nobody, by what a fixed one sees there, since then.
    nobody: BTreeMap<String, Instant>,
    /// Who was called for, by the camera that sees them, and until when they are not again.
    spared: BTreeMap<(String, u64), Instant>,
    /// Cameras that refused to turn, and until when they are not called again.
    refused: BTreeMap<String, Instant>,
}

impl Dispatcher {
    fn new(fleet: Arc<Fleet>, exchange: Option<Arc<Exchange>>, log: Arc<Log>) -> Self {
        Self {
            maps: Maps::new(log.clone()),
            fleet,
            exchange,
            log,
            links: BTreeMap::new(),
            walkers: BTreeMap::new(),
            calls: BTreeMap::new(),
            sharing: Sharing::default(),
            pipelines: BTreeMap::new(),
            told: BTreeMap::new(),
            widest: BTreeMap::new(),
            nobody: BTreeMap::new(),
            spared: BTreeMap::new(),
            refused: BTreeMap::new(),
        }
    }

    fn run(mut self, wishes: &Weak<Mutex<Vec<HandOver>>>) {
        let mut kept = Instant::now();
        let mut before = Vec::new();
        while let Some(wishes) = wishes.upgrade() {
            let wishes = lock(&wishes).clone();
            if wishes != before {
                self.change(&wishes, &self.fleet.known());
                before.clone_from(&wishes);
            }
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

    /// The file says something else: nobody is called any more by a camera that is not to call them, and what a camera was told for
    /// the sake of others is over where it works with none.
    fn change(&mut self, wishes: &[HandOver], cameras: &[Arc<Known>]) {
        if let Some(exchange) = &self.exchange {
            exchange.listen_for(wishes.iter().flat_map(HandOver::cameras).cloned().collect());
        }
        let is_over = |to: &String, call: &mut Call| {
            !wishes.iter().any(|wish| wish.from == call.errand.from && wish.calls.contains(to))
        };
        for (to, call) in self.calls.extract_if(.., is_over) {
            cameras.iter().filter(|known| known.name == to).for_each(|known| call.cancel(known));
        }
        for known in cameras {
            if !wishes.iter().any(|wish| wish.concerns(&known.name)) {
                self.sharing.forget(&known.name);
                known.ignore(BTreeSet::new());
            }
            if !wishes.iter().any(|wish| wish.from == known.name) {
                lock(&known.calls).clear();
            }
        }
    }

    fn tick(&mut self, wishes: &[HandOver]) {
        let views = self.views(wishes);
        for wish in wishes {
            let Some(from) = views.get(&wish.from) else { continue };
            let is_here = |name: &&String| views.get(*name).is_some_and(|view| view.is_here);
            *lock(&from.known.calls) = wish.calls.iter().filter(is_here).cloned().collect();
            self.walkers.entry(wish.from.clone()).or_default().see(from);
            for called in &wish.calls {
                if let Some(to) = views.get(called) {
                    self.learn((&wish.from, from), (called, to));
                }
            }
        }
        self.take_points(wishes, &views);
        self.share(wishes, &views);
        self.advance(wishes, &views);
        let now = Instant::now();
        self.spared.retain(|_, until| *until > now);
        self.look_for_nobody(wishes, &views, now);
        for wish in wishes {
            self.call(wish, wishes, &views);
        }
    }

    /// All cameras that are concerned: ours, of which others are told, and those that others tell of.
    fn views(&mut self, wishes: &[HandOver]) -> BTreeMap<String, View> {
        let concerned = |name: &str| wishes.iter().any(|wish| wish.concerns(name));
        let ours = self.fleet.known().into_iter().filter(|known| concerned(&known.name));
        let ours: Vec<View> = ours.map(|known| self.view(known)).collect();
        let others =
            self.exchange.as_ref().map(|exchange| exchange.views(Instant::now())).unwrap_or_default();
        let is_ours = |name: &String| ours.iter().any(|view| view.known.name == *name);
        let concerns_others =
            |name: &str| wishes.iter().any(|wish| wish.concerns(name) && !wish.cameras().all(is_ours));
        let told = ours.iter().filter(|view| concerns_others(&view.known.name));
        told.for_each(|view| self.tell_others(view));
        // A broker sends us what we tell others, too.
        let is_theirs = |view: &View| concerned(&view.known.name) && !is_ours(&view.known.name);
        let others: Vec<_> = others.into_iter().filter(is_theirs).collect();
        let mut views = BTreeMap::new();
        for mut view in others.into_iter().chain(ours) {
            let name = view.known.name.clone();
            view.widest_fov_deg = self.widest(&view);
            self.notice_pipeline(&view);
            views.insert(name, view);
        }
        views
    }

    fn view(&self, known: Arc<Known>) -> View {
        let seen = known.sight.borrow().clone();
        View {
            is_here: true,
            can_be_called: !self.has_refused(&known.name),
            video: known.video_delay(),
            widest_fov_deg: None,
            target_height: self.fleet.target_height(&known.name),
            turns: self.fleet.turns(&known.name),
            errand: self.on_its_way(&known.name),
            known,
            seen,
        }
    }

    fn on_its_way(&self, camera: &str) -> Option<Errand> {
        self.calls.get(camera).filter(|call| !call.has_taken_up()).map(|call| call.errand.clone())
    }

    fn tell_others(&mut self, view: &View) {
        let Some(exchange) = &self.exchange else { return };
        let came = view.seen.0;
        if self.told.insert(view.known.name.clone(), came) != Some(came) {
            exchange.tell(view);
        }
    }

    /// The widest field of view so far.
    fn widest(&mut self, view: &View) -> Option<f64> {
        let fields = view.seen.1.poses.iter().map(|pose| pose.horizontal_fov_deg);
        let before = self.widest.get(&view.known.name).copied();
        let widest = fields.chain(before).max_by(f64::total_cmp)?;
        self.widest.insert(view.known.name.clone(), widest);
        Some(widest)
    }

    /// With another pipeline all that is known by a track's number is void.
    fn notice_pipeline(&mut self, view: &View) {
        let (name, pipelines) = (&view.known.name, view.known.rebuilt.load(Ordering::Relaxed));
        if self.pipelines.insert(name.clone(), pipelines).is_some_and(|before| before != pipelines) {
            self.sharing.forget(name);
            self.walkers.remove(name);
            self.refused.remove(name);
            self.spared.retain(|(camera, _), _| camera != name);
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
        if self.link(from, to).see(caller, called) {
            let detail = format!(
                "{from} or {to} was moved: where {to} has to look for whom {from} sees is learned anew"
            );
            if called.is_here {
                self.tell(to, Level::Warning, "map-void", detail);
            }
        }
    }

    /// Has no two cameras that turn follow the same person, unless they are to.
    fn share(&mut self, wishes: &[HandOver], views: &BTreeMap<String, View>) {
        self.sharing.pass(views);
        let mut leaving = Vec::new();
        for wish in wishes.iter().filter(|wish| !wish.together) {
            for called in &wish.calls {
                let both = views.get(&wish.from).zip(views.get(called)).filter(|(from, _)| from.turns);
                let link = self.links.get(&(wish.from.clone(), called.clone()));
                let mutual = wishes
                    .iter()
                    .any(|back| back.from == *called && !back.together && back.calls.contains(&wish.from));
                let leaves = link
                    .zip(both)
                    .and_then(|(link, both)| self.sharing.see(link, both, mutual, Instant::now()));
                leaving.extend(leaves);
            }
        }
        for (name, view) in views {
            view.known.ignore(self.sharing.left_by(name));
        }
        for (camera, id) in leaving {
            // One of another process is released there.
            let Some(view) = views.get(&camera).filter(|view| view.is_here) else { continue };
            view.known.release();
            self.tell(
                &camera,
                Level::Info,
                "left",
                format!("leaves target {id} to another camera that follows them"),
            );
        }
    }

    fn tell(&self, camera: &str, level: Level, event: &str, detail: String) {
        self.log.tell(&Event::new(level, Some(camera), event, detail));
    }
}

#[cfg(test)]
mod tests {
    use super::stage::wish;
    use super::*;

    /// A broker echoes: what is told of `yard` comes back, with numbers of pipelines that only others can tell apart.
    #[test]
    fn what_we_say_ourselves_is_not_what_others_say() {
        let log = Arc::new(Log::unwritten());
        let (exchange, mut saying) = Exchange::new();
        let fleet = Arc::new(Fleet::at_rest("yard"));
        let mut dispatcher = Dispatcher::new(fleet.clone(), Some(exchange.clone()), log);
        let wishes = [wish(&["door"])];
        dispatcher.change(&wishes, &fleet.known());
        dispatcher.tick(&wishes);
        let pipelines = dispatcher.pipelines.clone();
        assert!(pipelines.contains_key("yard"));
        dispatcher.refused.insert("yard".to_owned(), Instant::now());
        let (camera, said) = saying.try_recv().unwrap();
        exchange.hear(&camera, said.as_bytes()).unwrap();
        assert_eq!(exchange.views(Instant::now()).len(), 1);
        dispatcher.tick(&wishes);
        assert_eq!(dispatcher.pipelines, pipelines);
        assert!(dispatcher.refused.contains_key("yard"), "what was known of its tracks is gone");
    }
}
