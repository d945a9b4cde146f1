// SPDX-License-Identifier: MPL-2.0

//! Where targets were given up, so that they are not taken again until they move.

use opencv::core::Rect2f;

use super::ego_motion::EgoMotion;
use super::geometry::{breadth, centre};

/// More places are not remembered: the oldest goes.
const MAX_PLACES: usize = 16;

/// Who is so many times as tall as the one given up has come nearer.
const NEARER: f32 = 1.3;

/// The places, in the newest picture; they go with the background.
#[derive(Debug, Default)]
pub(super) struct SuppressedRegions {
    places: Vec<Rect2f>,
}

impl SuppressedRegions {
    /// Remembers the box of a target that was given up.
    pub fn add(&mut self, bounds: Rect2f) {
        if self.places.len() == MAX_PLACES {
            self.places.remove(0);
        }
        self.places.push(bounds);
    }

    /// Carries the places into the next picture. Where nobody knows how the camera moved, nobody knows any more where
    /// they are.
    pub fn carry(&mut self, ego: Option<EgoMotion>) {
        match ego {
            Some(ego) => self.places.iter_mut().for_each(|place| *place = ego.apply_to(*place)),
            None => self.clear(),
        }
    }

    /// Forgets all places.
    pub fn clear(&mut self) {
        self.places.clear();
    }

    /// Whether a detection there is a target that was given up and has not moved since.
    pub fn holds(&self, bounds: Rect2f) -> bool {
        self.places.iter().any(|place| is_at(*place, bounds, 1.0) && bounds.height < NEARER * place.height)
    }

    /// Somebody is followed from `taken` on. Next to a place where nobody is seen any more, it is who stood there.
    pub fn free(&mut self, taken: Rect2f, seen: impl Iterator<Item = Rect2f> + Clone) {
        self.places.retain(|place| {
            !is_at(*place, taken, 2.0)
                || seen.clone().any(|other| other != taken && is_at(*place, other, 1.0))
        });
    }
}

/// Whether the middle of `bounds` is less than so many widths away from `place`, sideways; the box of an arm or a
/// leg at the place is there as well.
fn is_at(place: Rect2f, bounds: Rect2f, widths: f32) -> bool {
    let offset = centre(bounds) - centre(place);
    let sideways = widths * breadth(place);
    offset.x.abs() < sideways && offset.y.abs() < sideways.max(place.height / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::Point2f;
    use proptest::prelude::*;

    const PERSON: Rect2f = Rect2f { x: 300.0, y: 200.0, width: 40.0, height: 90.0 };

    fn one() -> SuppressedRegions {
        let mut suppressed = SuppressedRegions::default();
        suppressed.add(PERSON);
        suppressed
    }

    fn moved(x: f32, y: f32) -> Rect2f {
        PERSON + Point2f::new(x, y)
    }

    #[test]
    fn held_until_moved_by_a_width() {
        let suppressed = one();
        assert!(
            suppressed.holds(PERSON)
                && suppressed.holds(moved(-30.0, 0.0))
                && suppressed.holds(moved(30.0, 20.0))
        );
        assert!(!suppressed.holds(moved(-41.0, 0.0)) && !suppressed.holds(moved(0.0, 46.0)));
        assert!(!SuppressedRegions::default().holds(PERSON));
    }

    #[test]
    fn the_box_of_a_waving_arm_is_held_too() {
        assert!(one().holds(Rect2f::new(285.0, 205.0, 30.0, 15.0)));
    }

    #[test]
    fn who_was_suppressed_and_has_moved_is_free() {
        let mut suppressed = one();
        suppressed.free(moved(45.0, 0.0), [moved(45.0, 0.0)].into_iter());
        assert!(!suppressed.holds(PERSON));
    }

    #[test]
    fn who_comes_nearer_is_free() {
        let grown = |factor: f32| {
            let (width, height) = (factor * PERSON.width, factor * PERSON.height);
            Rect2f::new(320.0 - width / 2.0, 245.0 - height / 2.0, width, height)
        };
        assert!(one().holds(grown(1.2)) && !one().holds(grown(1.35)));
    }

    #[test]
    fn who_passes_by_frees_nobody_who_still_stands_there() {
        let mut suppressed = one();
        suppressed.free(moved(45.0, 0.0), [moved(45.0, 0.0), moved(2.0, 0.0)].into_iter());
        assert!(suppressed.holds(PERSON));
        suppressed.free(moved(200.0, 0.0), [moved(200.0, 0.0)].into_iter());
        assert!(suppressed.holds(PERSON), "nobody was near");
    }

    #[test]
    fn selecting_who_stands_there_frees_them() {
        let mut suppressed = one();
        suppressed.free(moved(2.0, 0.0), [moved(2.0, 0.0)].into_iter());
        assert!(!suppressed.holds(PERSON));
    }

    #[test]
    fn where_the_camera_looks_now_must_be_known() {
        let mut suppressed = one();
        suppressed.carry(Some(EgoMotion::default()));
        assert!(suppressed.holds(PERSON));
        suppressed.carry(None);
        assert!(!suppressed.holds(PERSON));
    }

    #[test]
    fn many_are_too_many() {
        let mut suppressed = SuppressedRegions::default();
        for n in 0..1000 {
            suppressed.add(moved(1000.0 * n as f32, 0.0));
        }
        assert!(suppressed.places.len() == MAX_PLACES && suppressed.holds(moved(999_000.0, 0.0)));
        assert!(!suppressed.holds(PERSON));
    }

    proptest! {
        #[test]
        fn the_place_goes_with_the_street(dx in -12.0_f32..12.0, dy in -6.0_f32..6.0) {
            let mut suppressed = one();
            for _ in 0..12 {
                suppressed.carry(Some(EgoMotion::translation(Point2f::new(dx, dy))));
            }
            let error = centre(suppressed.places[0]) - centre(moved(12.0 * dx, 12.0 * dy));
            prop_assert!(error.x.hypot(error.y) < 0.1, "{error:?}");
        }
    }
}
