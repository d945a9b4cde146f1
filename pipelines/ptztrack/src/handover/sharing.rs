// SPDX-License-Identifier: MPL-2.0

//! Of two cameras that turn only one follows the same person.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use super::call::nearest;
use super::link::Link;
use super::view::View;
use crate::camera::{Origin, Person};
use ptztrack_contract::lock::lock;

/// Two who are in the same place for so long are the same.
const SAME: Duration = Duration::from_secs(1);
/// Where it is doubted by more where somebody is, they are told apart from nobody.
const WELL_KNOWN_DEG: f64 = 3.0;

/// A track of a camera.
type Track = (String, u64);

/// Whom which camera leaves to which other one.
#[derive(Debug, Default)]
pub struct Sharing {
    /// Whom one camera follows seems to be this one for another camera, since then.
    same: BTreeMap<(Track, String), (u64, Instant)>,
    /// Whoever is the first track is left to the camera of the second, which follows them under that number.
    left: BTreeMap<Track, Track>,
}

impl Sharing {
    /// Takes what two cameras see of whom the first one follows, which calls the other one, or each the other where it is `mutual`.
    /// Returns who is to be released now by one of them, as the other one follows them; once a second, for as long as they are
    /// followed all the same.
    pub fn see(
        &mut self,
        link: &Link,
        (from, to): (&View, &View),
        mutual: bool,
        now: Instant,
    ) -> Option<Track> {
        let target = from.people().iter().find(|person| person.is_target)?;
        let one = from.track(target);
        let key = (one.clone(), to.known.name.clone());
        let Some(person) = same(link, from, target, to) else {
            self.same.remove(&key);
            return None;
        };
        let (id, since) = self.same.entry(key).or_insert((person.id, now));
        if *id != person.id {
            (*id, *since) = (person.id, now);
        }
        if now - *since < SAME {
            return None;
        }
        *since = now;
        self.settle((from, target), (to, person), mutual)
    }

    /// Decides which of two cameras leaves the person to the other one. Of two that call each other the last by name does, where neither
    /// has a claim: processes that share the cameras have to come to the same, whoever of them looks first.
    fn settle(
        &mut self,
        (from, target): (&View, &Person),
        (to, person): (&View, &Person),
        mutual: bool,
    ) -> Option<Track> {
        let (one, other) = (from.track(target), to.track(person));
        let was_called = to.was_called_for(person, &one);
        let is_last = mutual && person.is_target && one > other;
        let from_leaves = was_called || is_last || to.has_claim(person);
        let (leaves, keeps, stays) = if from_leaves {
            let stays = if was_called { from.was_selected(target) } else { from.has_claim(target) };
            (one, other, stays)
        } else {
            (other, one, to.has_claim(person))
        };
        let is_free = self.left.get(&keeps).is_none_or(|to| *to == leaves);
        if stays || !(is_free || was_called) {
            return None;
        }
        self.left.remove(&keeps);
        self.left.insert(leaves.clone(), keeps);
        Some(leaves).filter(|_| person.is_target)
    }

    /// Forgets who is followed by nobody any more.
    pub fn pass(&mut self, views: &BTreeMap<String, View>) {
        let is_followed = |(camera, id): &Track| {
            views.get(camera).and_then(|view| view.person(*id)).is_some_and(|person| person.is_target)
        };
        self.same.retain(|(one, _), _| is_followed(one));
        self.left.retain(|_, keeps| is_followed(keeps));
    }

    /// The tracks of a camera have other numbers from now on.
    pub fn forget(&mut self, camera: &str) {
        self.same.retain(|((one, _), other), _| one != camera && other != camera);
        self.left.retain(|(leaves, _), (keeps, _)| leaves != camera && keeps != camera);
    }

    /// Whom a camera leaves to others.
    pub fn left_by(&self, camera: &str) -> BTreeSet<u64> {
        self.left.keys().filter(|(name, _)| name == camera).map(|(_, id)| *id).collect()
    }
}

/// Whom another camera sees where this person has to be, where that is well known. There is more to learn while both
/// follow them, for as long as it is known nowhere else.
fn same<'a>(link: &Link, from: &View, person: &Person, to: &'a View) -> Option<&'a Person> {
    let expected = link.expect(from, Some(person).filter(|person| person.stands_in_picture())?, to)?;
    nearest(&expected, to, None).filter(|_| expected.doubt_deg < WELL_KNOWN_DEG && link.map.knows_enough())
}

impl View {
    fn track(&self, person: &Person) -> Track {
        (self.known.name.clone(), person.id)
    }

    /// Whether it follows them because the camera of that track called it for them.
    fn was_called_for(&self, person: &Person, (camera, id): &Track) -> bool {
        let is_theirs = |origin: &Origin| origin.camera == *camera && origin.id == *id;
        person.is_target && self.origin(person).as_ref().is_some_and(is_theirs)
    }

    /// Whether it follows them because somebody selected them, or some camera called it for them.
    fn has_claim(&self, person: &Person) -> bool {
        self.was_selected(person) || (person.is_target && self.origin(person).is_some())
    }

    fn was_selected(&self, person: &Person) -> bool {
        person.is_target && *lock(&self.known.selected) == Some(person.id)
    }

    fn origin(&self, person: &Person) -> Option<Origin> {
        lock(&self.known.origin).clone().filter(|origin| origin.target == person.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::handover::stage::{new_turning_link, person, target, turning_link, view as seeing};

    /// A camera that sees one person, and follows them or not.
    fn view(name: &str, id: u64, is_target: bool) -> View {
        let person = person(id, [0.5, 0.7], 0.0);
        let person = if is_target { target(person) } else { person };
        seeing(name, true, Instant::now(), vec![person])
    }

    fn views(gate: View, door: View) -> BTreeMap<String, View> {
        [gate, door].into_iter().map(|view| (view.known.name.clone(), view)).collect()
    }

    /// The gate calls the door; both look at one person.
    struct Bench {
        sharing: Sharing,
        link: Link,
        now: Instant,
        /// The door calls the gate as well.
        mutual: bool,
        gate: View,
        door: View,
    }

    impl Bench {
        fn new(gate_follows: bool, door_follows: bool) -> Self {
            let (gate, door) = (view("gate", 3, gate_follows), view("door", 7, door_follows));
            let (sharing, link) = (Sharing::default(), turning_link());
            Self { sharing, link, now: Instant::now(), mutual: false, gate, door }
        }

        fn called(self, camera: &str, id: u64) -> Self {
            *lock(&self.door.known.origin) = Some(Origin { target: 7, id, camera: camera.to_owned() });
            self
        }

        fn selected(self) -> Self {
            *lock(&self.door.known.selected) = Some(7);
            self
        }

        fn each_other(self) -> Self {
            Self { mutual: true, ..self }
        }

        /// Who is released a second later.
        fn see(&mut self) -> Option<Track> {
            self.now += SAME;
            self.sharing.see(&self.link, (&self.gate, &self.door), self.mutual, self.now)
        }

        /// The same as the door sees it.
        fn see_back(&mut self) -> Option<Track> {
            self.now += SAME;
            self.sharing.see(&self.link, (&self.door, &self.gate), self.mutual, self.now)
        }

        fn leaves(&mut self) -> Option<Track> {
            assert_eq!(self.see(), None, "they may have met by chance");
            self.see()
        }

        fn left(&self) -> [BTreeSet<u64>; 2] {
            ["gate", "door"].map(|camera| self.sharing.left_by(camera))
        }
    }

    fn track(camera: &str, id: u64) -> Option<Track> {
        Some((camera.to_owned(), id))
    }

    #[test]
    fn the_one_that_is_called_leaves_them_until_they_are_free() {
        let mut bench = Bench::new(true, true);
        assert_eq!(bench.leaves(), track("door", 7));
        assert_eq!(bench.left(), [BTreeSet::new(), [7].into()]);
        let Bench { mut sharing, gate, door, .. } = bench;
        sharing.pass(&views(gate, door));
        assert_eq!(sharing.left_by("door"), [7].into());
        sharing.pass(&views(view("gate", 3, false), view("door", 7, false)));
        assert_eq!(sharing.left_by("door"), BTreeSet::new());
    }

    #[test]
    fn while_where_they_are_is_all_that_is_known_both_follow() {
        let mut bench = Bench { link: new_turning_link(), ..Bench::new(true, true) };
        let expected = bench.link.expect(&bench.gate, &bench.gate.people()[0], &bench.door).unwrap();
        assert!(expected.doubt_deg < WELL_KNOWN_DEG, "{expected:?}");
        assert_eq!(bench.leaves(), None);
        bench.link = turning_link();
        assert_eq!(bench.leaves(), track("door", 7));
    }

    #[test]
    fn who_is_left_is_released_whenever_they_are_the_target_again() {
        let mut bench = Bench::new(true, true);
        assert_eq!(bench.leaves(), track("door", 7));
        bench.door = view("door", 7, false);
        assert_eq!(bench.see(), None, "they are left");
        bench.door = view("door", 7, true);
        assert_eq!(bench.see(), track("door", 7));
        let soon = bench.sharing.see(&bench.link, (&bench.gate, &bench.door), false, bench.now + SAME / 2);
        assert_eq!(soon, None, "a camera takes a while to release");
    }

    /// As in two processes, each of which looks from its own camera first.
    #[test]
    fn of_two_that_call_each_other_the_same_one_leaves_them_whoever_looks_first() {
        let mut bench = Bench::new(true, true).each_other();
        assert_eq!(bench.leaves(), track("gate", 3));
        assert_eq!(bench.see_back(), None);
        assert_eq!(bench.see_back(), track("gate", 3));
        assert_eq!(bench.left(), [[3].into(), BTreeSet::new()]);
        let mut bench = Bench::new(true, true).each_other();
        assert_eq!(bench.see_back(), None);
        assert_eq!(bench.see_back(), track("gate", 3));
        assert_eq!(bench.see(), None);
        assert_eq!(bench.see(), track("gate", 3));
        assert_eq!(bench.left(), [[3].into(), BTreeSet::new()]);
    }

    /// One that follows nobody yet is told to leave them; once both do, the last by name leaves.
    #[test]
    fn who_was_to_leave_them_may_keep_them() {
        let mut bench = Bench::new(true, false).each_other();
        assert_eq!(bench.leaves(), None);
        assert_eq!(bench.left(), [BTreeSet::new(), [7].into()]);
        bench.door = view("door", 7, true);
        assert_eq!(bench.see(), track("gate", 3));
        assert_eq!(bench.left(), [[3].into(), BTreeSet::new()]);
    }

    #[test]
    fn who_was_called_for_them_keeps_them() {
        let mut bench = Bench::new(true, true).called("gate", 3);
        assert_eq!(bench.leaves(), track("gate", 3));
        assert_eq!(bench.left(), [[3].into(), BTreeSet::new()]);
    }

    #[test]
    fn who_was_left_before_is_kept_by_who_is_called_for_them() {
        let mut bench = Bench::new(true, true);
        assert_eq!(bench.leaves(), track("door", 7));
        let mut bench = bench.called("gate", 3);
        assert_eq!(bench.see(), track("gate", 3));
        assert_eq!(bench.left(), [[3].into(), BTreeSet::new()]);
    }

    #[test]
    fn who_was_called_by_a_third_camera_keeps_them() {
        let mut bench = Bench::new(true, true).called("yard", 1);
        assert_eq!(bench.leaves(), track("gate", 3));
    }

    #[test]
    fn whom_somebody_selected_is_kept() {
        let mut bench = Bench::new(true, true).selected();
        assert_eq!(bench.leaves(), track("gate", 3), "who found them by itself leaves them");
        *lock(&bench.gate.known.selected) = Some(3);
        bench.sharing = Sharing::default();
        assert_eq!(bench.leaves(), None);
        let mut bench = Bench::new(true, true).called("gate", 3);
        *lock(&bench.gate.known.selected) = Some(3);
        assert_eq!(bench.leaves(), None);
        assert_eq!(bench.left(), [BTreeSet::new(), BTreeSet::new()]);
    }

    #[test]
    fn whom_another_one_follows_is_left_before_they_are_chosen() {
        let mut bench = Bench::new(true, false);
        assert_eq!(bench.leaves(), None, "nothing is to be released");
        assert_eq!(bench.left(), [BTreeSet::new(), [7].into()]);
    }

    #[test]
    fn whoever_has_the_number_of_somebody_after_a_camera_came_back_is_not_left() {
        let mut bench = Bench::new(true, true);
        assert_eq!(bench.leaves(), track("door", 7));
        bench.sharing.forget("door");
        assert_eq!(bench.left(), [BTreeSet::new(), BTreeSet::new()]);
    }

    #[test]
    fn nobody_is_left_to_a_camera_that_leaves_them_to_a_third_one() {
        let mut bench = Bench::new(true, true);
        bench.sharing.left.insert(("gate".to_owned(), 3), ("hall".to_owned(), 1));
        assert_eq!(bench.leaves(), None);
    }

    #[test]
    fn somebody_else_in_the_same_place_counts_from_anew() {
        let mut bench = Bench::new(true, true);
        assert_eq!(bench.see(), None);
        bench.door = view("door", 8, true);
        assert_eq!(bench.see(), None);
        assert_eq!(bench.see(), track("door", 8));
    }
}
