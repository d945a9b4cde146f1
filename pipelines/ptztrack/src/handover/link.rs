// SPDX-License-Identifier: MPL-2.0

//! From one camera to another: what is learned while both see the same person.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use handover::{Aim, Direction, Learned, Map, Pair, Place};
use ptztrack_contract::Point;

use super::motion::{Expected, Motion};
use super::view::{View, direction};
use crate::camera::Person;

/// A picture of each that come within so long show the same moment: no longer than one is under way.
const SAME_MOMENT: Duration = Duration::from_millis(150);
/// Between two pairs: somebody who walks has come a foot further.
const EVERY: Duration = Duration::from_millis(200);
/// A camera that turns tells where it looks at least as often.
const LONGEST_WAIT: Duration = Duration::from_secs(3);
/// Over so long it is measured how fast somebody goes.
const STEP_S: f64 = 0.5;

/// Somebody in the picture that came then.
type Appearance = (Instant, Person);

/// A person whom both see, until it is known where the cameras looked.
#[derive(Debug)]
struct Moment {
    from: Appearance,
    to: Appearance,
}

/// From a camera that calls to one that is called.
#[derive(Debug)]
pub struct Link {
    pub map: Map,
    /// Something was learned since it was last kept.
    pub changed: bool,
    waiting: VecDeque<Moment>,
    last: Option<Instant>,
}

impl Link {
    pub fn new(map: Map) -> Self {
        Self { map, changed: false, waiting: VecDeque::new(), last: None }
    }

    /// Takes what both see. Returns whether one of them was moved.
    pub fn see(&mut self, from: &View, to: &View) -> bool {
        self.notice(from, to);
        let mut moved = false;
        while let Some(moment) = self.waiting.front() {
            let pair = moment.pair(from, to);
            let age = to.seen.0.saturating_duration_since(moment.to.0);
            if pair.is_none() && age < LONGEST_WAIT {
                break;
            }
            self.waiting.pop_front();
            match pair.map(|pair| self.map.learn(pair)) {
                Some(Learned::Taken) => self.changed = true,
                Some(Learned::Moved) => (self.changed, moved) = (true, true),
                Some(Learned::Contradicts) | None => {}
            }
        }
        moved
    }

    /// Keeps who is seen by both, if there is no doubt who that is.
    fn notice(&mut self, from: &View, to: &View) {
        let (came, other) = (to.seen.0, from.seen.0);
        let apart = if came > other { came - other } else { other - came };
        if apart > SAME_MOMENT || self.last.is_some_and(|last| came < last + EVERY) {
            return;
        }
        let whole: Vec<&Person> = from.people().iter().filter(|person| person.is_whole()).collect();
        // Several may be told apart by what is known already; here they are left alone.
        let ([seen], Some(person)) = (whole.as_slice(), to.seen.1.target()) else { return };
        self.last = Some(came);
        self.waiting.push_back(Moment { from: (other, (*seen).clone()), to: (came, person.clone()) });
    }

    /// Takes a place that both see, as somebody says. Returns whether it can be the same.
    pub fn point(&mut self, place: Place, direction: Direction) -> bool {
        let pair = Pair { place, direction, height_deg: None, person: 0 };
        let learned = self.map.learn(pair) == Learned::Taken;
        self.changed |= learned;
        learned
    }

    /// Whether the camera that is called follows nobody: what it follows stays where it is, and where the other one would see them, it
    /// sees nobody. Who goes somewhere is somebody, though the other one may have lost them.
    pub fn is_nobody(&self, from: &View, to: &View) -> bool {
        let stays = |(person, motion): &(&Person, Motion)| person.is_whole() && !motion.goes();
        let Some((_, motion)) = to.target().filter(stays) else { return false };
        let is_there = |person: &Person| {
            self.expect(from, person, to).is_none_or(|expected| expected.is_place_of(&motion))
        };
        from.is_fresh() && self.map.covers(motion.feet) && !from.people().iter().any(is_there)
    }

    /// Where to look for somebody whom the camera that calls sees, so many seconds after its last picture.
    pub fn aim(&self, from: &View, person: &Person, ahead_s: f64) -> Option<Aim> {
        self.map.aim(from.place(person, ahead_s)?)
    }

    /// Somebody as the camera that is called has to see them in its last picture.
    pub fn expect(&self, from: &View, person: &Person, to: &View) -> Option<Expected> {
        let (came, other) = (to.seen.0, from.seen.0);
        let since_s = if came > other { (came - other).as_secs_f64() } else { -(other - came).as_secs_f64() };
        let [now, then] = [since_s, since_s + STEP_S].map(|ahead_s| self.aim(from, person, ahead_s));
        let (now, then) = (now?, then?);
        let motion = Motion::between(now.feet, then.feet, STEP_S);
        Some(Expected { motion, doubt_deg: now.doubt_deg })
    }
}

impl Moment {
    /// `None` where it is not known yet where the cameras looked.
    fn pair(&self, from: &View, to: &View) -> Option<Pair> {
        let (came, person) = &self.to;
        let view = to.pose_when(*came)?.view()?;
        let at = |point: Point| direction(&view, point);
        let (feet, head) = (at(person.feet()), at(person.head()));
        Some(Pair {
            place: from.place_when(&self.from.1, self.from.0)?,
            direction: feet,
            height_deg: Some(head.tilt_deg - feet.tilt_deg).filter(|height| *height > 0.0),
            person: person.id,
        })
    }
}
