// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeMap;

use handover::Place;

use super::view::View;
use crate::camera::Person;

/// Who goes somewhere, of those whom a camera sees: what moves to and fro in one place is nobody to turn to.
#[derive(Debug, Default)]
pub struct Walkers {
    /// Where they were seen first, and whether they have gone from there.
    first: BTreeMap<u64, (Place, bool)>,
}

impl Walkers {
    pub fn see(&mut self, view: &View) {
        self.first.retain(|id, _| view.person(*id).is_some());
        for person in view.people().iter().filter(|person| person.seen) {
            let Some((feet, beside)) = view.place(person, 0.0).zip(view.beside(person)) else { continue };
            let (first, walks) = self.first.entry(person.id).or_insert((feet, false));
            // By as much as they are wide.
            *walks |= feet.angle_to_deg(*first) > feet.angle_to_deg(beside);
        }
    }

    /// Those whose feet are in the picture.
    pub fn walking<'a>(&'a self, view: &'a View) -> impl Iterator<Item = &'a Person> {
        let walks = |person: &&Person| self.first.get(&person.id).is_some_and(|(_, walks)| *walks);
        view.people().iter().filter(|person| person.stands_in_picture()).filter(walks)
    }
}
