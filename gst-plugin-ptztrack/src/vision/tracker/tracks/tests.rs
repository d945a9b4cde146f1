// SPDX-License-Identifier: MPL-2.0

use super::looks::Looks;
use super::*;
use crate::vision::Luma;

use proptest::prelude::*;

const DT: f64 = 0.1;
const STILL: Option<EgoMotion> = None;

/// Takes these regions of a picture of 640x480 of which nothing else is known; who is seen in three of them is confirmed.
pub(in super::super) fn seen_in(tracks: &mut Tracks, regions: &[Rect2f], ego: Option<EgoMotion>, dt_s: f64) {
    seen_by(tracks, regions, ego, dt_s, 0.0);
}

/// The same of regions whose outlines are known.
pub(in super::super) fn seen_as(tracks: &mut Tracks, regions: impl IntoIterator<Item = Region>, dt_s: f64) {
    take(tracks, regions.into_iter(), STILL, dt_s, 0.0);
}

fn seen_by(
    tracks: &mut Tracks,
    regions: &[Rect2f],
    ego: Option<EgoMotion>,
    dt_s: f64,
    detector_pause_s: f64,
) {
    let regions = regions.iter().map(|bounds| Region::new(*bounds, Vec::new(), false));
    take(tracks, regions, ego, dt_s, detector_pause_s);
}

fn take(
    tracks: &mut Tracks,
    regions: impl Iterator<Item = Region>,
    ego: Option<EgoMotion>,
    dt_s: f64,
    detector_pause_s: f64,
) {
    let rules = Rules { confirm_pictures: 3, coast_s: 3.0, memory_s: 60.0, detector_pause_s };
    tracks.update(&black(), regions, ego, dt_s, rules);
}

/// A picture of 640x480 of which nothing else is known.
fn black() -> Observation<'static> {
    static BLACK: [u8; 640 * 480] = [0; 640 * 480];
    Observation::from(Luma::packed(&BLACK, 640))
}

fn at(x: f32, y: f32, width: f32, height: f32) -> Rect2f {
    Rect2f::new(x, y, width, height)
}

fn person(x: f32) -> Rect2f {
    at(x, 100.0, 40.0, 90.0)
}

fn numbers(tracks: &Tracks) -> Vec<u64> {
    tracks.iter().map(|track| track.id).collect()
}

#[test]
fn a_walker_is_one_track_with_their_speed() {
    let mut tracks = Tracks::default();
    for n in 0..20 {
        seen_in(&mut tracks, &[person(100.0 + 6.0 * n as f32)], STILL, DT);
    }
    assert_eq!(numbers(&tracks), [1]);
    let track = tracks.get(1).expect("there");
    assert!((track.velocity().x - 60.0).abs() < 6.0 && track.velocity().y.abs() < 3.0, "{track:?}");
    assert!((track.bounds().x - 214.0).abs() < 4.0, "{track:?}");
}

/// By a detector that tells everything again and again, each time elsewhere.
#[test]
fn there_are_no_more_regions_and_tracks_than_a_picture_has_time_for() {
    let mut tracks = Tracks::default();
    for picture in 0..10 {
        let place = |n: i32| ((n * 7919 + picture * 104_729) % 590) as f32;
        let regions: Vec<_> = (0..5000).map(|n| at(place(n), place(n / 3) * 0.6, 40.0, 90.0)).collect();
        seen_in(&mut tracks, &regions, STILL, DT);
        let on_trial = tracks.tracks.iter().filter(|track| !track.is_confirmed()).count();
        assert!(tracks.regions.len() <= MOST && on_trial <= MOST && tracks.tracks.len() <= 10 * MOST);
    }
}

#[test]
fn somebody_small_is_not_lost_among_many_who_are_larger() {
    let mut tracks = Tracks::default();
    let small = at(600.0, 20.0, 10.0, 25.0);
    for _ in 0..5 {
        seen_in(&mut tracks, &[small], STILL, DT);
    }
    assert_eq!(numbers(&tracks), [1]);
    let large = (0..200).map(|n| at((n % 20) as f32 * 20.0, (n / 20) as f32 * 30.0 + 60.0, 40.0, 90.0));
    let regions: Vec<_> = large.chain([small]).collect();
    for _ in 0..5 {
        seen_in(&mut tracks, &regions, STILL, DT);
        let track = tracks.get(1).expect("there");
        assert!(track.region().is_some(), "{track:?}");
    }
}

/// The numbers of those who are there after number 1, in dark clothes, was not seen alone for half a second, and not at all for `unseen_s`;
/// in that half second somebody came whose clothes are white by that share.
fn numbers_after(white: f32, unseen_s: f64) -> Vec<u64> {
    let mut tracks = Tracks::default();
    for regions in [[person(100.0)], [person(164.0)]] {
        (0..5).for_each(|_| seen_in(&mut tracks, &regions, STILL, DT));
    }
    tracks.tracks[0].views.learn(&Looks::of_greys(&[(40, 1.0)]), 0.0);
    tracks.tracks[0].journey.unseen_s = unseen_s;
    tracks.regions[0].looks = Looks::of_greys(&[(40, 1.0 - white), (200, white)]);
    tracks.find_again(1, false);
    numbers(&tracks)
}

#[test]
fn somebody_new_is_who_is_not_seen_only_where_they_look_more_like_it_than_anybody() {
    assert_eq!(numbers_after(0.1, 0.5), [1]);
    assert_eq!(numbers_after(0.45, 0.5), [1, 2]);
}

/// Whoever walks past carries its box along for a while.
#[test]
fn who_comes_out_while_it_is_seen_in_one_region_with_another_is_found_once_that_one_has_gone() {
    assert_eq!(numbers_after(0.1, DT), [1]);
}

/// As whoever was found again behind somebody is: only one of the two knows of it.
#[test]
fn who_is_who_is_weighed_whichever_of_two_knows_that_they_met() {
    for knows in [0, 1] {
        let mut tracks = Tracks::default();
        let see = |tracks: &mut Tracks| {
            for _ in 0..15 {
                seen_in(tracks, &[person(100.0), person(300.0)], STILL, DT);
            }
        };
        see(&mut tracks);
        let other = tracks.tracks[1 - knows].id;
        tracks.tracks[knows].companions.push(other);
        see(&mut tracks);
        assert!(tracks.iter().all(|track| track.companions.is_empty() && track.is_seen_whole()));
    }
}

#[test]
fn whoever_goes_into_another_leaves_them_whom_it_met() {
    let mut tracks = Tracks::default();
    for _ in 0..5 {
        seen_in(&mut tracks, &[person(100.0), person(200.0), person(300.0)], STILL, DT);
    }
    let ids: Vec<_> = tracks.tracks.iter().map(|track| track.id).collect();
    tracks.tracks[0].companions = vec![ids[1], ids[2]];
    tracks.merge(0, 1, true);
    assert_eq!((tracks.tracks[1].id, &tracks.tracks[1].companions), (ids[0], &vec![ids[2]]));
}

#[test]
fn the_cameras_own_motion_is_no_motion_of_theirs() {
    let mut tracks = Tracks::default();
    let pan = EgoMotion::translation(Point2f::new(-9.0, 0.0));
    for n in 0..20 {
        seen_in(&mut tracks, &[person(500.0 - 9.0 * n as f32)], Some(pan), DT);
    }
    assert_eq!(numbers(&tracks), [1]);
    assert!(tracks.get(1).is_some_and(|track| track.velocity().x.abs() < 3.0));
}

#[test]
fn two_who_pass_through_each_other_keep_their_numbers() {
    let mut tracks = Tracks::default();
    for n in 0..41 {
        let (one, other) = (100.0 + 8.0 * n as f32, 420.0 - 8.0 * n as f32);
        let (left, right) = (person(one.min(other)), person(one.max(other)));
        let merged = right.x < left.x + 44.0;
        let regions = if merged { vec![left | right] } else { vec![person(one), person(other)] };
        seen_in(&mut tracks, &regions, STILL, DT);
        if n == 20 {
            assert!(tracks.iter().all(Track::is_shared));
        }
    }
    let place = |id| tracks.get(id).map(|track| track.bounds().x);
    assert!(place(1).is_some_and(|x| (x - 420.0).abs() < 10.0), "{:?}", place(1));
    assert!(place(2).is_some_and(|x| (x - 100.0).abs() < 10.0), "{:?}", place(2));
}

/// Somebody walks into the light of a car, which is one region with them and is still there for a second and a half after they left it.
#[test]
fn who_stands_upright_does_not_become_as_broad_as_what_is_beside_them() {
    let mut tracks = Tracks::default();
    for n in 0..15 {
        seen_in(&mut tracks, &[person(100.0 + 4.0 * n as f32)], STILL, DT);
    }
    for n in 15..30 {
        seen_in(&mut tracks, &[at(100.0 + 4.0 * n as f32, 96.0, 180.0, 94.0)], STILL, DT);
    }
    let bounds = tracks.get(1).map(Track::bounds).expect("there");
    assert!(bounds.width < 60.0, "{bounds:?}");
}

/// A car comes in from the left and nearer: first there is a strip of it.
#[test]
fn what_the_picture_cuts_off_becomes_as_broad_as_it_is() {
    let mut tracks = Tracks::default();
    for n in 0..20 {
        let nearer = n as f32;
        seen_in(&mut tracks, &[at(0.0, 200.0 - nearer, 20.0 + 12.0 * nearer, 90.0 + nearer)], STILL, DT);
    }
    let bounds = tracks.get(1).map(Track::bounds).expect("there");
    assert!(bounds.width > 200.0, "{bounds:?}");
}

#[test]
fn trunk_and_legs_are_parts_of_who_was_seen_whole() {
    let mut tracks = Tracks::default();
    for n in 0..30 {
        let whole = at(100.0 + 4.0 * n as f32, 100.0, 40.0, 120.0);
        let (trunk, legs) = (at(whole.x, 100.0, 40.0, 60.0), at(whole.x + 5.0, 170.0, 30.0, 50.0));
        let regions = if n < 10 { vec![whole] } else { vec![legs, trunk] };
        seen_in(&mut tracks, &regions, STILL, DT);
        assert!(tracks.seen().count() == 1, "picture {n}");
    }
    let track = tracks.get(1).expect("there");
    assert!((track.height() - 120.0).abs() < 6.0, "{track:?}");
}

/// Two who came in side by side, as one region, and walk apart.
#[test]
fn two_who_were_seen_as_one_are_two_once_they_part() {
    let mut tracks = Tracks::default();
    for n in 0..80 {
        let way = 2.0 * (n as f32 - 10.0).max(0.0);
        let (left, right) = (person(200.0 - way), person(245.0 + way));
        let regions = if way == 0.0 { vec![left | right] } else { vec![left, right] };
        seen_in(&mut tracks, &regions, STILL, DT);
    }
    let widths: Vec<f32> = tracks.iter().map(|track| track.bounds().width).collect();
    assert!(widths.len() == 2 && widths.iter().all(|width| (width - 40.0).abs() < 5.0), "{widths:?}");
}

/// A van comes in behind a pole, which parts it in two for a moment.
#[test]
fn a_van_that_was_seen_in_two_parts_is_one() {
    let mut tracks = Tracks::default();
    for n in 0..30 {
        let x = 40.0 + 6.0 * n as f32;
        let (rear, front) = (at(x, 100.0, 60.0, 55.0), at(x + 70.0, 104.0, 60.0, 51.0));
        let regions = match n {
            0..4 => vec![front],
            4..8 => vec![rear, front],
            _ => vec![rear | front],
        };
        seen_in(&mut tracks, &regions, STILL, DT);
    }
    assert_eq!(numbers(&tracks), [1]);
    assert!(tracks.get(1).is_some_and(|van| (van.bounds().width - 130.0).abs() < 8.0));
}

#[test]
fn two_who_walk_side_by_side_are_two_however_short_they_were_seen_apart() {
    let mut tracks = Tracks::default();
    for n in 0..60 {
        let x = 40.0 + 4.0 * n as f32;
        let (left, right) = (person(x), person(x + 42.0));
        let regions = if n < 10 { vec![left, right] } else { vec![left | right] };
        seen_in(&mut tracks, &regions, STILL, DT);
    }
    assert_eq!(numbers(&tracks), [1, 2]);
}

#[test]
fn trunk_and_legs_that_were_never_seen_together_become_one() {
    let mut tracks = Tracks::default();
    for n in 0..15 {
        let x = 100.0 + 4.0 * n as f32;
        seen_in(&mut tracks, &[at(x, 100.0, 40.0, 60.0), at(x + 5.0, 165.0, 35.0, 55.0)], STILL, DT);
    }
    assert_eq!(numbers(&tracks), [1]);
    assert!(tracks.get(1).is_some_and(|track| (track.height() - 120.0).abs() < 8.0));
}

/// Somebody who comes in shows a hand first.
#[test]
fn a_hand_that_was_seen_first_becomes_the_person() {
    let mut tracks = Tracks::default();
    for _ in 0..4 {
        seen_in(&mut tracks, &[at(60.0, 150.0, 20.0, 15.0)], STILL, DT);
    }
    for n in 0..15 {
        seen_in(&mut tracks, &[at(20.0 + 2.0 * n as f32, 100.0, 60.0, 150.0)], STILL, DT);
    }
    assert_eq!(tracks.seen().count(), 1);
    let track = tracks.seen().next().expect("there");
    assert!(track.is_alone() && (track.height() - 150.0).abs() < 10.0, "{track:?}");
}

#[test]
fn a_table_before_the_legs_costs_nothing_at_first() {
    let mut tracks = Tracks::default();
    for n in 0..35 {
        let height = if n < 20 { 120.0 } else { 60.0 };
        seen_in(&mut tracks, &[at(100.0 + 4.0 * n as f32, 100.0, 40.0, height)], STILL, DT);
    }
    let track = tracks.get(1).expect("there");
    assert!((track.height() - 120.0).abs() < 15.0 && track.is_alone(), "{track:?}");
}

/// Somebody comes by where somebody else left their ghost in the background, and both are seen as one for a while.
#[test]
fn who_is_seen_whole_on_the_floor_has_their_own_height_again_soon() {
    let height = |walkers_before: usize| {
        let (mut tracks, ego) = (Tracks::default(), Some(EgoMotion::default()));
        for n in 0..30 * walkers_before {
            let down = 4.0 * (n % 30) as f32;
            seen_in(&mut tracks, &[at(300.0, 60.0 + down, 35.0, 90.0 + down / 4.0)], ego, DT);
        }
        for n in 0..40 {
            let x = 400.0 - 4.0 * n as f32;
            let ghost = if (5..25).contains(&n) { 120.0 } else { 0.0 };
            seen_in(&mut tracks, &[at(x, 100.0, 40.0, 100.0 + ghost)], ego, DT);
        }
        tracks.seen().map(|track| track.height()).next().expect("there")
    };
    assert!((height(2) - 100.0).abs() < 10.0, "{}", height(2));
    assert!(height(0) > 150.0, "nothing is known of the floor: the legs may be hidden");
}

#[test]
fn nobody_is_there_after_three_seconds_and_a_new_one_is_somebody_else() {
    let mut tracks = Tracks::default();
    for _ in 0..15 {
        seen_in(&mut tracks, &[person(300.0)], STILL, DT);
    }
    for n in 0..35 {
        seen_in(&mut tracks, &[], STILL, DT);
        assert_eq!(tracks.get(1).is_some(), n < 30, "picture {n}");
    }
    for _ in 0..4 {
        seen_in(&mut tracks, &[person(100.0)], STILL, DT);
    }
    assert_eq!(numbers(&tracks), [2], "nothing is known of their looks");
}

/// A neural network may look at every fourth frame, or less.
#[test]
fn a_detector_need_not_see_every_frame() {
    let count = |detector_pause_s: f64| {
        let mut tracks = Tracks::default();
        for n in 0..40 {
            let seen = [person(100.0 + 2.0 * n as f32)];
            seen_by(&mut tracks, if n % 8 == 0 { &seen } else { &[] }, STILL, DT, detector_pause_s);
        }
        tracks.iter().count()
    };
    assert_eq!(count(1.0), 1);
    assert_eq!(count(0.0), 0, "what flickers is not confirmed by one that sees every frame");
}

#[test]
fn absurd_regions_are_nobody() {
    let mut tracks = Tracks::default();
    let absurd = [
        at(10.0, 10.0, 0.0, 0.0),
        at(0.0, 0.0, 640.0, 480.0),
        at(f32::NAN, 10.0, 30.0, 60.0),
        at(-900.0, 10.0, 30.0, 60.0),
        at(10.0, 10.0, f32::INFINITY, 60.0),
        at(10.0, 10.0, -30.0, -60.0),
    ];
    for _ in 0..20 {
        seen_in(&mut tracks, &absurd, STILL, DT);
    }
    assert_eq!(tracks.iter().count(), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn every_region_has_an_owner_and_every_number_is_one_track(
        pictures in prop::collection::vec(
            prop::collection::vec((0.0_f32..600.0, 0.0_f32..400.0, 6.0_f32..150.0, 6.0_f32..250.0), 0..9), 1..20),
        pan in -20.0_f32..20.0,
    ) {
        let mut tracks = Tracks::default();
        let ego = EgoMotion::translation(Point2f::new(pan, 0.0));
        for picture in pictures {
            let regions: Vec<_> = picture.into_iter().map(|(x, y, w, h)| at(x, y, w, h)).collect();
            seen_in(&mut tracks, &regions, Some(ego), DT);
            let mut ids = numbers(&tracks);
            ids.sort_unstable();
            prop_assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "{:?}", ids);
            prop_assert!(tracks.regions.iter().all(|region| region.is_owned));
            for track in tracks.iter() {
                let b = track.bounds();
                prop_assert!([b.x, b.y, b.width, b.height].iter().all(|side| side.is_finite()));
            }
        }
    }
}
