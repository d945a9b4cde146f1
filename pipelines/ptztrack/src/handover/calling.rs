// SPDX-License-Identifier: MPL-2.0

//! Who is called for whom.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use ptztrack_contract::lock::lock;

use super::Dispatcher;
use super::call::{self, Call, Progress};
use super::exchange::Errand;
use super::link::Link;
use super::view::View;
use crate::camera::Person;
use crate::config::HandOver;
use crate::event::Level;

/// Somebody who was called for in vain, or is lost again, is called for again after this.
const CALL_AGAIN: Duration = Duration::from_secs(5);

/// A camera that refused to turn is not called for so long: the reason may be over by then.
const REFUSED: Duration = Duration::from_secs(60);

/// A track behind which a fixed camera sees nobody for so long is nobody's.
const NOBODY: Duration = Duration::from_secs(1);

impl Dispatcher {
    /// Sees to those that are on their way.
    pub(super) fn advance(&mut self, wishes: &[HandOver], views: &BTreeMap<String, View>) {
        for (to, mut call) in std::mem::take(&mut self.calls) {
            let Some(called) = views.get(&to).filter(|view| view.is_here) else { continue };
            let Errand { from, id, .. } = call.errand.clone();
            let caller = views.get(&from).filter(|_| !gives_way(&to, &call, wishes, views));
            let Some(caller) = caller else {
                call.cancel(&called.known);
                continue;
            };
            let link = self.links.get(&(from.clone(), to.clone()));
            let progress = link.map_or(Progress::Failed, |link| call.advance(link, caller, called));
            let whom = format!("target {id} of {from}");
            match progress {
                Progress::Going => {}
                Progress::TakenUp(id) => {
                    self.tell(&to, Level::Info, "taken-up", format!("target {id} is {whom}"));
                }
                Progress::Again => {
                    self.tell(
                        &to,
                        Level::Info,
                        "astray",
                        format!("does not follow {whom}: turns there again"),
                    );
                }
                Progress::Failed => {
                    self.tell(&to, Level::Info, "not-found", format!("{whom} was not found"));
                }
                Progress::Refused => self.leave_alone(&to),
                // One before may have sent it somewhere.
                Progress::Over => call.cancel(&called.known),
            }
            match progress {
                Progress::Failed | Progress::Over => {
                    self.spared.insert((from, id), Instant::now() + CALL_AGAIN);
                }
                // Another one is called in its place.
                Progress::Refused => {}
                Progress::Going | Progress::TakenUp(_) | Progress::Again => {
                    self.calls.insert(to, call);
                }
            }
        }
    }

    /// Whether it refused to turn lately.
    pub(super) fn has_refused(&self, camera: &str) -> bool {
        self.refused.get(camera).is_some_and(|until| *until > Instant::now())
    }

    /// Calls it no more for a while. That is said once.
    fn leave_alone(&mut self, to: &str) {
        if self.refused.insert(to.to_owned(), Instant::now() + REFUSED).is_none() {
            let detail = format!(
                "refuses to turn to where another camera sees somebody: without moves to a position (ONVIF's AbsoluteMove, VAPIX' \
                 pan= and tilt=) it cannot be called. It keeps following on its own, and is called again after {} s",
                REFUSED.as_secs()
            );
            self.tell(to, Level::Warning, "not-called", detail);
        }
    }

    /// Calls for those whom this camera sees and nobody follows.
    pub(super) fn call(&mut self, wish: &HandOver, wishes: &[HandOver], views: &BTreeMap<String, View>) {
        let Some(from) = views.get(&wish.from).filter(|view| view.is_fresh()) else { return };
        // On its way it sees what only seems to go; and it is about to leave whom it sees once it is called.
        if from.turns && (!from.follows() || self.errand(&wish.from, from).is_some()) {
            return;
        }
        let Some(walkers) = self.walkers.get(&wish.from) else { return };
        let in_zone = |person: &Person| {
            let feet = person.feet();
            wish.zones.is_empty() || wish.zones.iter().any(|zone| zone.contains(feet.x, feet.y))
        };
        let walking: Vec<Person> = walkers.walking(from).filter(|person| in_zone(person)).cloned().collect();
        for person in walking {
            let is_spared = self.spared.contains_key(&(wish.from.clone(), person.id));
            if is_spared || self.is_attended(wish, from, &person, views) {
                continue;
            }
            let new_call = |to: &String| {
                let called = views.get(to)?;
                let occupied = self.precedence(to, called, wishes).max(self.waits_for(to, views));
                let is_free = called.follows() || self.errand(to, called).is_some();
                let can_be_called = called.can_be_called
                    && !self.has_refused(to)
                    && is_free
                    && occupied.is_none_or(|occupied| occupied < wish.precedence);
                can_be_called.then(|| self.new_call(wish, to, (from, &person), called)).flatten()
            };
            let free = wish.calls.iter().find_map(new_call);
            // One of another process is called there.
            if let Some((to, call)) = free.filter(|(to, _)| views.get(to).is_some_and(|view| view.is_here)) {
                let detail = format!("turns to target {} of {}", person.id, wish.from);
                self.tell(&to, Level::Info, "called", detail);
                self.calls.insert(to, call);
            }
        }
    }

    /// Sees which cameras follow a track that nobody is behind.
    pub(super) fn look_for_nobody(
        &mut self,
        wishes: &[HandOver],
        views: &BTreeMap<String, View>,
        now: Instant,
    ) {
        let is_nobody = |(name, to): &(&String, &View)| {
            let calls = wishes.iter().filter(|wish| wish.calls.contains(name));
            calls.into_iter().any(|wish| {
                let link = self.links.get(&(wish.from.clone(), (*name).clone()));
                let from = views.get(&wish.from).filter(|from| !from.turns);
                link.zip(from).is_some_and(|(link, from)| link.is_nobody(from, to))
            })
        };
        let before = |name: &String| self.nobody.get(name).copied().unwrap_or(now);
        self.nobody = views.iter().filter(is_nobody).map(|(name, _)| (name.clone(), before(name))).collect();
    }

    /// Whether a camera follows this person, or is on its way.
    fn is_attended(
        &self,
        wish: &HandOver,
        from: &View,
        person: &Person,
        views: &BTreeMap<String, View>,
    ) -> bool {
        let on_the_way = |call: &Call| call.errand.from == wish.from && call.errand.id == person.id;
        let elsewhere = |view: &View| !view.is_here && view.is_called_for(&wish.from, person.id);
        (from.turns && person.is_target && !person.is_leaving())
            || self.calls.values().any(on_the_way)
            || views.values().any(elsewhere)
            || wish.calls.iter().any(|to| {
                let link = self.links.get(&(wish.from.clone(), to.clone()));
                let followed = |(link, view): (&Link, &View)| call::follows(link, from, person, view);
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
        call.gaze(link, from, called)?;
        Some((to.to_owned(), call))
    }

    /// For whom a camera was called that is on its way.
    fn errand<'a>(&'a self, to: &str, called: &'a View) -> Option<&'a Errand> {
        let ours = self.calls.get(to).filter(|call| !call.has_taken_up()).map(|call| &call.errand);
        if called.is_here { ours } else { called.errand.as_ref() }
    }

    /// That of whom this camera called another one for, which is on its way and is told where to look by this one.
    fn waits_for(&self, from: &str, views: &BTreeMap<String, View>) -> Option<u32> {
        let errands = views.iter().filter_map(|(to, called)| self.errand(to, called));
        errands.filter(|errand| errand.from == from).map(|errand| errand.precedence).max()
    }

    /// That of whom a camera follows or turns to; `None` where it does neither.
    fn precedence(&self, to: &str, called: &View, wishes: &[HandOver]) -> Option<u32> {
        if let Some(call) = self.calls.get(to).filter(|_| called.is_here) {
            return Some(call.errand.precedence);
        }
        if let Some(errand) = &called.errand {
            return Some(errand.precedence);
        }
        let target = lock(&called.known.state).target_id?;
        if self.nobody.get(to).is_some_and(|since| since.elapsed() > NOBODY) {
            return None;
        }
        let origin = lock(&called.known.origin).clone().filter(|origin| origin.target == target);
        let from = origin.and_then(|origin| wishes.iter().find(|wish| wish.from == origin.camera));
        Some(from.map_or(0, |wish| wish.precedence))
    }
}

/// Whether another process has called at the same time: for the same person a camera that comes before this one in the list, or the
/// very camera that called, which then looks elsewhere. Of two that call each other the first by name goes.
fn gives_way(to: &str, call: &Call, wishes: &[HandOver], views: &BTreeMap<String, View>) -> bool {
    let Errand { from, id, .. } = &call.errand;
    let elsewhere = |name: &String| views.get(name).filter(|view| !view.is_here);
    let before = |wish: &HandOver| {
        let mut others = wish.calls.iter().take_while(|other| *other != to).filter_map(elsewhere);
        others.any(|other| other.is_called_for(from, *id))
    };
    let is_crossed = || {
        let errand = elsewhere(from).and_then(|caller| caller.errand.as_ref());
        errand.is_some_and(|errand| errand.from == to) && from.as_str() < to
    };
    !call.has_taken_up() && (is_crossed() || wishes.iter().filter(|wish| wish.from == *from).any(before))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::Ordering;

    use super::*;
    use crate::camera::{Known, Origin, Steering};
    use crate::fleet::Fleet;
    use crate::handover::stage::{FEET, RATE, link, person, target, turning_link, view, wish};
    use crate::handover::walkers::Walkers;
    use crate::log::Log;

    /// `yard` sees somebody walk, whom it knows as 3, and calls `door` before `gate`.
    struct Site {
        dispatcher: Dispatcher,
        wishes: Vec<HandOver>,
        views: BTreeMap<String, View>,
    }

    impl Site {
        fn new() -> Self {
            let log = Arc::new(Log::unwritten());
            let mut dispatcher = Dispatcher::new(Arc::new(Fleet::new(log.clone())), None, log);
            for to in ["door", "gate"] {
                dispatcher.links.insert(("yard".to_owned(), to.to_owned()), link());
            }
            // As if it were seen for long yet: what is seen now is old soon on a busy machine.
            let now = Instant::now() + Duration::from_secs(60);
            let yard = view("yard", false, now, vec![person(3, FEET, RATE)]);
            let mut walkers = Walkers::default();
            walkers.see(&view("yard", false, now, vec![person(3, [0.2, FEET[1]], RATE)]));
            walkers.see(&yard);
            dispatcher.walkers.insert("yard".to_owned(), walkers);
            let turning = |name| view(name, true, now, Vec::new());
            let views = [yard, turning("door"), turning("gate")];
            let views = views.into_iter().map(|view| (view.known.name.clone(), view)).collect();
            Self { dispatcher, wishes: vec![wish(&["door", "gate"])], views }
        }

        fn change(mut self, name: &str, change: impl FnOnce(&mut View)) -> Self {
            change(self.views.get_mut(name).unwrap());
            self
        }

        /// Which cameras are on their way, once all was seen.
        fn called(&mut self) -> Vec<&str> {
            self.dispatcher.advance(&self.wishes, &self.views);
            for wish in &self.wishes {
                self.dispatcher.call(wish, &self.wishes, &self.views);
            }
            self.dispatcher.calls.keys().map(String::as_str).collect()
        }

        fn known(&self, name: &str) -> &Known {
            &self.views[name].known
        }
    }

    fn follow(view: &mut View, id: u64) {
        lock(&view.known.state).target_id = Some(id);
    }

    fn errand(precedence: u32) -> Option<Errand> {
        Some(Errand { from: "yard".to_owned(), id: 3, precedence })
    }

    #[test]
    fn the_first_that_is_free_is_called_once() {
        let mut site = Site::new();
        assert_eq!(site.called(), ["door"]);
        assert_eq!(site.called(), ["door"]);
        assert!(matches!(*lock(&site.known("door").steering), Steering::LookAt(..)));
        assert_eq!(*lock(&site.known("gate").steering), Steering::Follow);
    }

    #[test]
    fn another_one_is_called_at_once_in_place_of_one_that_refuses() {
        let mut site = Site::new();
        assert_eq!(site.called(), ["door"]);
        assert_eq!(site.called(), ["door"], "it is told where to look");
        lock(&site.known("door").state).refused_moves += 1;
        assert_eq!(site.called(), ["gate"]);
        assert_eq!(site.called(), ["gate"]);
    }

    #[test]
    fn one_that_is_not_to_be_called_any_more_turns_back() {
        let mut site = Site::new();
        assert_eq!(site.called(), ["door"]);
        assert_eq!(site.called(), ["door"], "it is told where to look");
        let cameras: Vec<_> = site.views.values().map(|view| view.known.clone()).collect();
        lock(&site.known("gate").ignored).insert(9);
        site.dispatcher.change(&site.wishes, &cameras);
        assert!(matches!(*lock(&site.known("door").steering), Steering::LookAt(..)), "nothing has changed");
        site.dispatcher.change(&[], &cameras);
        assert!(matches!(*lock(&site.known("door").steering), Steering::TurnBack(..)));
        assert!(site.dispatcher.calls.is_empty() && lock(&site.known("gate").ignored).is_empty());
    }

    /// It would look there for half a minute, and follow nobody.
    #[test]
    fn what_a_camera_was_told_for_a_call_goes_with_the_one_that_took_its_place() {
        let mut site = Site::new();
        assert_eq!(site.called(), ["door"]);
        assert_eq!(site.called(), ["door"], "it is told where to look");
        site.dispatcher.calls.insert("door".to_owned(), Call::new(&site.wishes[0], 3));
        site.known("door").operator.store(true, Ordering::Relaxed);
        site.dispatcher.advance(&site.wishes, &site.views);
        assert_eq!(*lock(&site.known("door").steering), Steering::Follow);
        assert!(site.dispatcher.calls.is_empty());
    }

    #[test]
    fn one_that_follows_somebody_or_is_somebody_elses_is_not_called() {
        assert_eq!(Site::new().change("door", |door| follow(door, 5)).called(), ["gate"]);
        let taken = |door: &mut View| *lock(&door.known.steering) = Steering::HandedOver;
        assert_eq!(Site::new().change("door", taken).called(), ["gate"]);
        assert_eq!(Site::new().change("door", |door| door.can_be_called = false).called(), ["gate"]);
        let mut site = Site::new().change("door", |door| follow(door, 5));
        site.wishes[0].precedence = 1;
        assert_eq!(site.called(), ["door"], "it has found them itself");
        lock(&site.known("door").origin).replace(Origin { target: 5, id: 9, camera: "yard".to_owned() });
        site.dispatcher.calls.clear();
        assert_eq!(site.called(), ["gate"], "they are of the same precedence");
    }

    #[test]
    fn what_stays_where_nobody_is_seen_keeps_a_camera_from_no_call() {
        let following = |rate: f64| {
            let mut site = Site::new().change("door", |door| {
                let elsewhere = target(person(7, [0.8, 0.9], rate));
                *door = view("door", true, door.seen.0, vec![elsewhere]);
                follow(door, 7);
            });
            let long_ago = Instant::now().checked_sub(2 * NOBODY).unwrap();
            site.dispatcher.look_for_nobody(&site.wishes, &site.views, long_ago);
            site.called()[0].to_owned()
        };
        assert_eq!(following(0.0), "door");
        assert_eq!(following(RATE), "gate", "whoever walks is somebody");
    }

    #[test]
    fn whoever_is_followed_or_spared_is_not_called_for() {
        let theirs =
            |door: &mut View| *door = view("door", true, door.seen.0, vec![target(person(7, FEET, RATE))]);
        assert_eq!(Site::new().change("door", theirs).called(), [""; 0]);
        let mut site = Site::new();
        let later = Instant::now() + CALL_AGAIN;
        site.dispatcher.spared.insert(("yard".to_owned(), 3), later);
        assert_eq!(site.called(), [""; 0]);
    }

    #[test]
    fn a_camera_of_another_process_is_called_there() {
        let mut site = Site::new().change("door", |door| door.is_here = false);
        assert_eq!(site.called(), [""; 0], "it goes first");
        assert_eq!(*lock(&site.known("door").steering), Steering::Follow);
        let busy = |door: &mut View| (door.is_here, door.errand) = (false, errand(0));
        assert_eq!(Site::new().change("door", busy).called(), [""; 0], "it is on its way to them");
        let busy = |door: &mut View| {
            door.is_here = false;
            follow(door, 5);
        };
        assert_eq!(Site::new().change("door", busy).called(), ["gate"]);
    }

    #[test]
    fn of_two_that_are_called_at_once_by_two_processes_the_first_goes() {
        let mut site = Site::new().change("door", |door| {
            door.is_here = false;
            follow(door, 5);
        });
        assert_eq!(site.called(), ["gate"]);
        assert_eq!(site.called(), ["gate"]);
        let mut site = site.change("door", |door| door.errand = errand(0));
        assert_eq!(site.called(), [""; 0]);
        assert!(matches!(*lock(&site.known("gate").steering), Steering::TurnBack(..)));
    }

    #[test]
    fn a_camera_is_free_again_where_the_one_that_called_is_gone() {
        let mut site = Site::new();
        assert_eq!(site.called(), ["door"]);
        assert_eq!(site.called(), ["door"]);
        site.views.remove("yard");
        assert_eq!(site.called(), [""; 0]);
        assert!(matches!(*lock(&site.known("door").steering), Steering::TurnBack(..)));
    }

    /// Each sees somebody walk whom it does not follow.
    fn two_that_turn() -> Site {
        let mut site = Site::new();
        site.wishes = vec![
            HandOver { from: "gate".to_owned(), ..wish(&["door"]) },
            HandOver { from: "door".to_owned(), ..wish(&["gate"]) },
        ];
        for (from, to) in [("gate", "door"), ("door", "gate")] {
            let mut walkers = Walkers::default();
            for x in [0.2, FEET[0]] {
                let came = site.views["yard"].seen.0;
                let view = view(from, true, came, vec![person(4, [x, FEET[1]], RATE)]);
                walkers.see(&view);
                site.views.insert(from.to_owned(), view);
            }
            site.dispatcher.walkers.insert(from.to_owned(), walkers);
            site.dispatcher.links.insert((from.to_owned(), to.to_owned()), turning_link());
        }
        site
    }

    #[test]
    fn of_two_that_would_call_each_other_at_once_one_does() {
        let mut site = two_that_turn();
        assert_eq!(site.called(), ["door"]);
        assert_eq!(site.called(), ["door"]);
        assert_eq!(*lock(&site.known("gate").steering), Steering::Follow);
    }

    #[test]
    fn a_camera_that_waits_for_another_one_is_called_for_what_is_more_important_only() {
        let mut site = two_that_turn();
        site.wishes.push(wish(&["gate"]));
        assert_eq!(site.called(), ["door"]);
        site.wishes[2].precedence = 1;
        assert_eq!(site.called(), ["door", "gate"]);
    }

    #[test]
    fn of_two_that_have_called_each_other_by_two_processes_the_first_goes() {
        let errand = |from: &str| Some(Errand { from: from.to_owned(), id: 4, precedence: 0 });
        let mut site = two_that_turn();
        assert_eq!(site.called(), ["door"]);
        let mut site = site.change("gate", |gate| (gate.is_here, gate.errand) = (false, errand("door")));
        assert_eq!(site.called(), ["door"], "it goes before the gate");
        let mut site = two_that_turn();
        site.wishes.rotate_left(1);
        assert_eq!(site.called(), ["gate"]);
        let mut site = site.change("door", |door| (door.is_here, door.errand) = (false, errand("gate")));
        assert_eq!(site.called(), [""; 0]);
    }
}
