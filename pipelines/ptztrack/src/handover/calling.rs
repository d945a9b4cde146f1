// SPDX-License-Identifier: MPL-2.0

//! Who is called for whom.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use ptztrack_contract::lock::lock;

use super::Dispatcher;
use super::call::{self, Call, Progress};
use super::link::Link;
use super::view::View;
use crate::camera::Person;
use crate::config::HandOver;
use crate::event::Level;

/// Somebody who was called for in vain, or is lost again, is called for again after this.
const CALL_AGAIN: Duration = Duration::from_secs(5);

/// A track behind which a fixed camera sees nobody for so long is nobody's.
const NOBODY: Duration = Duration::from_secs(1);

impl Dispatcher {
    /// Sees to those that are on their way.
    pub(super) fn advance(&mut self, views: &BTreeMap<String, View>) {
        for (to, mut call) in std::mem::take(&mut self.calls) {
            let (Some(from), Some(called)) = (views.get(&call.from), views.get(&to)) else { continue };
            let link = self.links.get(&(call.from.clone(), to.clone()));
            let progress = link.map_or(Progress::Failed, |link| call.advance(link, from, called));
            let whom = format!("target {} of {}", call.id, call.from);
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
                Progress::Over => {}
            }
            if matches!(progress, Progress::Failed | Progress::Over) {
                self.spared.insert((call.from, call.id), Instant::now() + CALL_AGAIN);
            } else {
                self.calls.insert(to, call);
            }
        }
    }

    /// Calls for those whom this camera sees and nobody follows.
    pub(super) fn call(&mut self, wish: &HandOver, wishes: &[HandOver], views: &BTreeMap<String, View>) {
        let Some(from) = views.get(&wish.from).filter(|view| view.is_fresh()) else { return };
        // On its way it sees what only seems to go.
        if from.turns && !from.follows() {
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
                let occupied = self.precedence(to, called, wishes);
                let is_free = called.follows() || self.calls.contains_key(to);
                let can_be_called = is_free && occupied.is_none_or(|occupied| occupied < wish.precedence);
                can_be_called.then(|| self.new_call(wish, to, (from, &person), called)).flatten()
            };
            let free = wish.calls.iter().find_map(new_call);
            if let Some((to, call)) = free {
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
        let on_the_way = |call: &Call| call.from == wish.from && call.id == person.id;
        (from.turns && person.is_target && !person.is_leaving())
            || self.calls.values().any(on_the_way)
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

    /// That of whom a camera follows or turns to; `None` where it does neither.
    fn precedence(&self, to: &str, called: &View, wishes: &[HandOver]) -> Option<u32> {
        if let Some(call) = self.calls.get(to) {
            return Some(call.precedence);
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
