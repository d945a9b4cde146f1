//! Where targets were given up, so that they are not taken again until they move.

use opencv::core::Rect2f;

use super::background::Background;
use super::ego_motion::EgoMotion;
use super::geometry::{around, centre};
use crate::vision::Luma;

/// More places are not remembered: the oldest goes.
const MAX_PLACES: usize = 16;

/// The places, in the newest picture; they go with the background.
#[derive(Default)]
pub(super) struct GivenUp {
    places: Vec<Rect2f>,
    background: Background,
    ego: EgoMotion,
}

impl GivenUp {
    /// Remembers the box of a target that was given up in this frame.
    pub fn add(&mut self, luma: &Luma, bounds: Rect2f) -> opencv::Result<()> {
        if self.places.is_empty() {
            self.background = Background::default();
            self.ego = EgoMotion::default();
            self.background.remember(luma, bounds)?;
        } else if self.places.len() == MAX_PLACES {
            self.places.remove(0);
        }
        self.places.push(bounds);
        Ok(())
    }

    /// Carries the places into the next frame. Where the background cannot be seen, the camera may still be known
    /// to rest; otherwise nobody knows any more where they are.
    pub fn watch(&mut self, luma: &Luma, camera_rests: bool) -> opencv::Result<()> {
        if self.places.is_empty() {
            return Ok(());
        }
        match self.background.motion(luma, self.ego)? {
            Some(ego) => self.carry(ego),
            None if camera_rests => (),
            None => self.clear(),
        }
        self.background.remember(luma, Rect2f::default())
    }

    fn carry(&mut self, ego: EgoMotion) {
        self.ego = ego;
        for place in &mut self.places {
            let middle = ego.apply(centre(*place));
            *place = around(middle, place.width * ego.scale(), place.height * ego.scale());
        }
    }

    /// Forgets all places.
    pub fn clear(&mut self) {
        self.places.clear();
    }

    /// Whether a detection there is a target that was given up and has not moved since.
    pub fn holds(&self, bounds: Rect2f) -> bool {
        self.places.iter().any(|place| is_at(*place, bounds, 1.0))
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
    let sideways = widths * place.width;
    offset.x.abs() < sideways && offset.y.abs() < sideways.max(place.height / 2.0)
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::Scene;
    use super::*;
    use opencv::core::Point2f;
    use proptest::prelude::*;

    const PERSON: Rect2f = Rect2f { x: 300.0, y: 200.0, width: 40.0, height: 90.0 };

    fn one() -> GivenUp {
        let mut given_up = GivenUp::default();
        given_up.add(&Scene::new(640, 480).background((0.0, 0.0)).luma(), PERSON).expect("remember");
        given_up
    }

    fn moved(x: f32, y: f32) -> Rect2f {
        PERSON + Point2f::new(x, y)
    }

    #[test]
    fn held_until_moved_by_a_width() {
        let given_up = one();
        assert!(
            given_up.holds(PERSON) && given_up.holds(moved(-30.0, 0.0)) && given_up.holds(moved(30.0, 20.0))
        );
        assert!(!given_up.holds(moved(-41.0, 0.0)) && !given_up.holds(moved(0.0, 46.0)));
        assert!(!GivenUp::default().holds(PERSON));
    }

    #[test]
    fn the_box_of_a_waving_arm_is_held_too() {
        assert!(one().holds(Rect2f::new(285.0, 205.0, 30.0, 15.0)));
    }

    #[test]
    fn who_was_given_up_and_has_moved_is_free() {
        let mut given_up = one();
        given_up.free(moved(45.0, 0.0), [moved(45.0, 0.0)].into_iter());
        assert!(!given_up.holds(PERSON));
    }

    #[test]
    fn who_passes_by_frees_nobody_who_still_stands_there() {
        let mut given_up = one();
        given_up.free(moved(45.0, 0.0), [moved(45.0, 0.0), moved(2.0, 0.0)].into_iter());
        assert!(given_up.holds(PERSON));
        given_up.free(moved(200.0, 0.0), [moved(200.0, 0.0)].into_iter());
        assert!(given_up.holds(PERSON), "nobody was near");
    }

    #[test]
    fn selecting_who_stands_there_frees_them() {
        let mut given_up = one();
        given_up.free(moved(2.0, 0.0), [moved(2.0, 0.0)].into_iter());
        assert!(!given_up.holds(PERSON));
    }

    #[test]
    fn before_a_blank_wall_the_camera_s_word_counts() {
        let wall = Scene::new(640, 480).flat(120);
        let mut given_up = one();
        given_up.watch(&wall.luma(), true).expect("watch");
        assert!(given_up.holds(PERSON));
        given_up.watch(&wall.luma(), false).expect("watch");
        assert!(!given_up.holds(PERSON));
    }

    #[test]
    fn many_are_too_many() {
        let picture = Scene::new(640, 480).flat(120);
        let mut given_up = GivenUp::default();
        for n in 0..1000 {
            given_up.add(&picture.luma(), moved(1000.0 * n as f32, 0.0)).expect("remember");
        }
        assert!(given_up.places.len() == MAX_PLACES && given_up.holds(moved(999_000.0, 0.0)));
        assert!(!given_up.holds(PERSON));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]
        #[test]
        fn the_place_goes_with_the_street(dx in -12.0_f32..12.0, dy in -6.0_f32..6.0) {
            let scene = Scene::new(640, 480);
            let mut given_up = one();
            for n in 1..=12 {
                let picture = scene.background((dx * n as f32, dy * n as f32));
                given_up.watch(&picture.luma(), false).expect("watch");
            }
            let error = centre(given_up.places[0]) - centre(moved(12.0 * dx, 12.0 * dy));
            prop_assert!(error.x.hypot(error.y) < 4.0, "{error:?}");
        }
    }
}
