// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeMap;

use ptztrack_contract::Point;

use super::link::Seen;
use crate::camera::{Person, Sight};

/// Who goes somewhere, of those whom a camera sees: what moves to and fro in one place is nobody to turn to.
#[derive(Debug, Default)]
pub struct Walkers {
    /// Where they were seen first, and whether they have gone from there.
    first: BTreeMap<u64, (Point, bool)>,
}

impl Walkers {
    pub fn see(&mut self, seen: &Seen) {
        let people = &seen.1.people;
        self.first.retain(|id, _| people.iter().any(|person| person.id == *id));
        for person in people.iter().filter(|person| person.seen) {
            let feet = person.feet();
            let (first, walks) = self.first.entry(person.id).or_insert((feet, false));
            // By as much as they are wide.
            let [_, _, width, _] = person.bounds;
            *walks |= (feet.x - first.x).hypot(feet.y - first.y) > width / 2.0;
        }
    }

    /// Those whose feet are in the picture.
    pub fn walking<'a>(&'a self, sight: &'a Sight) -> impl Iterator<Item = &'a Person> {
        let walks = |person: &&Person| self.first.get(&person.id).is_some_and(|(_, walks)| *walks);
        sight.people.iter().filter(|person| person.stands_in_picture()).filter(walks)
    }
}
