// SPDX-License-Identifier: MPL-2.0

//! Of two cameras that turn only one follows the same person.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use super::call::nearest;
use super::link::Link;
use super::view::View;
use crate::camera::Person;
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
    /// Takes what two cameras see of whom the first one follows. Returns who is not to be followed by one of them any more, as the
    /// other one does.
    pub fn see(&mut self, link: &Link, (from, to): (&View, &View), now: Instant) -> Option<Track> {
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
        let other = to.track(person);
        // Who took them over from another camera keeps them.
        let took_over = person.is_target && to.took_over(person, &from.known.name);
        let (leaves, keeps) = if took_over { (one, other) } else { (other, one) };
        if self.left.contains_key(&leaves) || (self.left.contains_key(&keeps) && !took_over) {
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

    /// Whom a camera leaves to others.
    pub fn left_by(&self, camera: &str) -> BTreeSet<u64> {
        self.left.keys().filter(|(name, _)| name == camera).map(|(_, id)| *id).collect()
    }
}

/// Whom another camera sees where this person has to be, where that is well known.
fn same<'a>(link: &Link, from: &View, person: &Person, to: &'a View) -> Option<&'a Person> {
    let expected = link.expect(from, Some(person).filter(|person| person.stands_in_picture())?, to)?;
    nearest(&expected, to, None).filter(|_| expected.doubt_deg < WELL_KNOWN_DEG)
}

impl View {
    fn track(&self, person: &Person) -> Track {
        (self.known.name.clone(), person.id)
    }

    fn took_over(&self, person: &Person, from: &str) -> bool {
        let origin = lock(&self.known.origin);
        origin.as_ref().is_some_and(|origin| origin.target == person.id && origin.camera == from)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use handover::{Direction, Map, Pair, Place};

    use super::*;
    use crate::camera::{Known, Origin, Pose, Sight};

    fn link() -> Link {
        let mut map = Map::default();
        for n in 0..60 {
            let (pan_deg, tilt_deg) = (f64::from(n % 10) * 5.0 - 25.0, f64::from(n / 10) * 4.0 - 26.0);
            let direction = Direction { pan_deg, tilt_deg };
            map.learn(Pair { place: Place::towards(direction), direction, height_deg: Some(9.0), person: 1 });
        }
        Link::new(map)
    }

    /// A camera that sees one person, and follows them or not.
    fn view(name: &str, id: u64, is_target: bool) -> View {
        let bounds = [0.46, 0.4, 0.08, 0.3];
        let person = Person { id, bounds, velocity: [0.0; 2], seen: true, confidence: 1.0, is_target };
        let pose = Pose {
            age: Duration::ZERO,
            pan_deg: 0.0,
            tilt_deg: -10.0,
            horizontal_fov_deg: 60.0,
            vertical_fov_deg: 46.0,
        };
        let sight = Sight { people: vec![person], poses: vec![pose], ..Sight::default() };
        View {
            known: Arc::new(Known::new(name)),
            seen: Arc::new((Instant::now(), sight)),
            turns: true,
            video: Duration::ZERO,
            widest_fov_deg: Some(60.0),
            target_height: None,
        }
    }

    fn views(gate: View, door: View) -> BTreeMap<String, View> {
        [gate, door].into_iter().map(|view| (view.known.name.clone(), view)).collect()
    }

    /// Who leaves when the gate has called the door, for a second.
    fn leaves(sharing: &mut Sharing, gate: &View, door: &View) -> Option<Track> {
        let now = Instant::now();
        let link = link();
        let first = sharing.see(&link, (gate, door), now);
        assert_eq!(first, None, "they may have met by chance");
        sharing.see(&link, (gate, door), now + SAME)
    }

    #[test]
    fn the_one_that_is_called_leaves_them_until_they_are_free() {
        let (mut sharing, gate, door) = (Sharing::default(), view("gate", 3, true), view("door", 7, true));
        assert_eq!(leaves(&mut sharing, &gate, &door), Some(("door".to_owned(), 7)));
        assert_eq!((sharing.left_by("door"), sharing.left_by("gate")), ([7].into(), BTreeSet::new()));
        sharing.pass(&views(gate, door));
        assert_eq!(sharing.left_by("door"), [7].into());
        sharing.pass(&views(view("gate", 3, false), view("door", 7, false)));
        assert_eq!(sharing.left_by("door"), BTreeSet::new());
    }

    #[test]
    fn who_took_them_over_keeps_them() {
        let (mut sharing, gate, door) = (Sharing::default(), view("gate", 3, true), view("door", 7, true));
        let origin = Origin { target: 7, id: 3, camera: "gate".to_owned() };
        *lock(&door.known.origin) = Some(origin);
        assert_eq!(leaves(&mut sharing, &gate, &door), Some(("gate".to_owned(), 3)));
        assert_eq!((sharing.left_by("gate"), sharing.left_by("door")), ([3].into(), BTreeSet::new()));
    }

    #[test]
    fn whom_another_one_follows_is_left_before_they_are_chosen() {
        let (mut sharing, gate, door) = (Sharing::default(), view("gate", 3, true), view("door", 7, false));
        assert_eq!(leaves(&mut sharing, &gate, &door), None, "nothing is to be released");
        assert_eq!(sharing.left_by("door"), [7].into());
    }
}
