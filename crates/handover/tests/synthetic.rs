// SPDX-License-Identifier: MPL-2.0

//! How well one camera learns to call another, on made-up ground.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod site;

use fastrand::Rng;
use handover::{Direction, Learned, Map, NotRead, Pair, Place};
use proptest::prelude::*;
use site::{PLANE, STEP, Site, Vector, Walk, at, error_of, errors, learn, site};

#[test]
fn a_minute_of_one_walk_is_enough_and_more_is_better() {
    let tried = [(0.0, 60, 2.5, 9), (0.3, 60, 2.5, 7), (0.0, 300, 1.0, 9), (0.3, 300, 1.0, 9)];
    for (wrong, seconds, median, wanted) in tried {
        let found: Vec<_> = (0..10).map(|seed| error_of(&site(PLANE), seconds, wrong, seed)).collect();
        let good = found.iter().filter(|found| found.0 < median).count();
        assert!(good >= wanted, "{seconds} s, {wrong} wrong: {found:.2?}");
    }
}

#[test]
fn ground_with_a_step_is_learned_locally() {
    let found: Vec<_> = (0..10).map(|seed| error_of(&site(STEP), 300, 0.0, seed)).collect();
    let good = found.iter().filter(|found| found.0 < 2.0).count();
    assert!(good >= 9, "{found:.2?}");
}

#[test]
fn who_was_seen_on_one_line_only_is_doubted_beside_it() {
    let (site, mut map, mut rng) = (site(PLANE), Map::default(), Rng::with_seed(7));
    for step in 0..300 {
        let pair = site.pair((f64::from(step % 60) * 0.15 - 4.0, 8.0), 1, &mut rng).unwrap();
        map.learn(pair);
    }
    let doubt = |z| {
        let (x, y) = site.place(site.person((0.0, z), 1.75).0).unwrap();
        map.aim(Place::in_picture(x, y)).unwrap().doubt_deg
    };
    assert!(doubt(8.0) < 2.5 && doubt(5.0) > 2.0 * doubt(8.0), "{} {}", doubt(8.0), doubt(5.0));
}

/// What is known of the rest after a few steps is wrong by more than is doubted.
#[test]
fn enough_is_learned_in_half_a_minute_of_a_walk() {
    for ground in [PLANE, STEP] {
        let knows = |seconds, seed| {
            let mut map = Map::default();
            learn(&mut map, &site(ground), seconds, 0.0, seed);
            map.knows_enough()
        };
        let rooms = |seconds| (0..10).filter(|seed| knows(seconds, *seed)).count();
        assert_eq!([5, 20, 60].map(rooms), [0, 0, 10]);
    }
}

/// An error beyond three times what the map doubts is rare, and of the places that it is sure of, more so with what it has learned.
#[test]
fn the_error_is_no_larger_than_the_doubt_says() {
    for (wrong, seconds, within) in [(0.0, 60, 0.95), (0.3, 60, 0.85), (0.3, 300, 0.98)] {
        let parts: Vec<f64> =
            (0..10).flat_map(|seed| parts_of_doubt(&site(PLANE), seconds, wrong, seed)).collect();
        let good = parts.iter().filter(|part| **part < 3.0).count();
        assert!(good as f64 > within * parts.len() as f64, "{seconds} s: {good} of {}", parts.len());
    }
}

/// Errors as parts of the doubt, where that is below 5 degrees.
fn parts_of_doubt(site: &Site, seconds: u32, wrong: f64, seed: u64) -> Vec<f64> {
    let mut map = Map::default();
    learn(&mut map, site, seconds, wrong, seed);
    let places = (0..100).map(|n| (f64::from(n % 10) * 0.9 - 4.0, 4.0 + f64::from(n / 10) * 0.8));
    let part = |place| {
        let feet = site.person(place, 1.75).0;
        let (x, y) = site.place(feet)?;
        let aim = map.aim(Place::in_picture(x, y)).filter(|aim| aim.doubt_deg < 5.0)?;
        Some(aim.feet.angle_to_deg(site.direction(feet)) / (aim.doubt_deg * 2f64.sqrt()))
    };
    places.filter_map(part).collect()
}

#[test]
fn a_camera_that_was_moved_is_noticed_and_learned_anew() {
    let (before, mut map) = (site(PLANE), Map::default());
    assert!(!learn(&mut map, &before, 600, 0.3, 1).contains(&Learned::Moved));
    let after = Site { turned: (78.0, 24.0), ..before };
    let told = learn(&mut map, &after, 600, 0.3, 2);
    let when = told.iter().position(|learned| *learned == Learned::Moved).expect("unnoticed");
    assert!(when < 200 * 5, "after {} s only", when / 5);
    assert!(!told[when + 1..].contains(&Learned::Moved), "twice");
    assert!(errors(&map, &after).0 < 1.0, "{:?}", errors(&map, &after));
}

#[test]
fn a_person_is_as_tall_as_they_are_there() {
    let (site, mut map) = (site(PLANE), Map::default());
    learn(&mut map, &site, 300, 0.3, 3);
    for place in [(-1.0, 6.0), (0.0, 8.0), (3.0, 11.0)] {
        let (feet, head) = site.person(place, 1.75);
        let (x, y) = site.place(feet).unwrap();
        let height = site.direction(head).tilt_deg - site.direction(feet).tilt_deg;
        let aim = map.aim(Place::in_picture(x, y)).unwrap();
        let off = (aim.height_deg.unwrap() / height).ln().abs();
        assert!(off < 0.3, "{place:?}: {aim:?} instead of {height}");
    }
}

#[test]
fn pairs_given_by_hand_will_do() {
    let (site, mut map) = (site(PLANE), Map::default());
    assert_eq!(map.aim(Place::in_picture(0.5, 0.5)), None);
    for place in [(-3.5, 5.0), (-3.0, 11.5), (4.5, 11.0), (4.0, 5.0), (0.0, 6.0), (1.0, 10.0)] {
        let feet = site.person(place, 1.75).0;
        let Some((x, y)) = site.place(feet) else { continue };
        let pair = Pair {
            place: Place::in_picture(x, y),
            direction: site.direction(feet),
            height_deg: None,
            person: 0,
        };
        assert_eq!(map.learn(pair), Learned::Taken);
    }
    assert!(errors(&map, &site).0 < 1.0, "{:?}", errors(&map, &site));
}

/// The camera that calls may turn as well: then its places are directions.
#[test]
fn between_two_that_turn_there_is_a_map_too() {
    let (site, mut map, mut rng) = (site(PLANE), Map::default(), Rng::with_seed(3));
    let from = |point: Vector| Site { ptz: site.fixed, ..site }.direction(point);
    let mut walk = Walk::new(5);
    for _ in 0..600 {
        let place = walk.step();
        let Some(pair) = site.pair(place, 1, &mut rng) else { continue };
        map.learn(Pair { place: Place::towards(from(site.person(place, 1.75).0)), ..pair });
    }
    let feet = site.person((1.0, 8.0), 1.75).0;
    let aim = map.aim(Place::towards(from(feet))).unwrap();
    assert!(aim.feet.angle_to_deg(site.direction(feet)) < 1.0, "{aim:?}");
}

#[test]
fn a_map_is_read_as_it_was_kept_and_one_of_another_version_is_not() {
    let (site, mut map) = (site(PLANE), Map::default());
    learn(&mut map, &site, 60, 0.3, 1);
    let (text, place) = (map.to_json(), Place::in_picture(0.4, 0.6));
    let again = Map::from_json(&text).unwrap();
    assert_eq!(again.len(), map.len());
    let (one, other) = (map.aim(place).unwrap(), again.aim(place).unwrap());
    assert!(one.feet.angle_to_deg(other.feet) < 0.5, "{one:?} {other:?}");
    let newer = text.replacen("\"version\":1", "\"version\":2", 1);
    assert_eq!(Map::from_json(&newer).err(), Some(NotRead::Version(2)));
    assert!(matches!(Map::from_json("{"), Err(NotRead::Nonsense(_))));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    /// Wherever both hang: the errors are as large as the doubts say.
    #[test]
    fn any_two_cameras_learn_each_other(
        fixed_x in -10.0..10.0f64, height in 3.0..6.0f64, ptz_height in 2.5..6.0f64, seed in 0u64..1000,
    ) {
        let right = (0.5 - fixed_x).atan2(8.0 + 2.0).to_degrees();
        let site = Site {
            fixed: at(fixed_x, height, -2.0),
            turned: (right, 15.0),
            ptz: at(0.0, ptz_height, 0.0),
            ground: PLANE,
        };
        let mut parts = parts_of_doubt(&site, 120, 0.3, seed);
        parts.sort_by(f64::total_cmp);
        prop_assert!(parts.get(parts.len() / 2).is_none_or(|median| *median < 2.0), "{parts:?}");
    }

    #[test]
    fn any_pairs_are_borne(
        pairs in prop::collection::vec((-1e3..1e3f64, -1e3..1e3f64, -400.0..400.0f64, -90.0..90.0f64, 0u64..4), 0..60),
    ) {
        let mut map = Map::default();
        for (x, y, pan_deg, tilt_deg, person) in pairs {
            let direction = Direction { pan_deg, tilt_deg };
            map.learn(Pair { place: Place::in_picture(x, y), direction, height_deg: Some(3.0), person });
            if let Some(aim) = map.aim(Place::in_picture(y, x)) {
                prop_assert!(aim.doubt_deg.is_finite() && aim.feet.pan_deg.is_finite(), "{aim:?}");
            }
        }
        let text = map.to_json();
        prop_assert!(Map::from_json(&text).is_ok());
    }
}
