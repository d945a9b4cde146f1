// SPDX-License-Identifier: MPL-2.0

use super::super::dwell_time::TimeLimits;
use super::super::policy::Choice;
use super::super::profile::Profile;
use super::super::synthetic::{Picture, Scene};
use super::*;
use crate::vision::{self, SceneModel};
use std::time::Duration;

const SIZE: (usize, usize) = (480, 320);
const PERSON: (f32, f32) = (40.0, 90.0);
const DT: f64 = 0.1;

mod requests;

fn config() -> Config {
    Config {
        profile: Profile::Robust,
        choice: Choice::Largest,
        confirm_frames: 1,
        coast_s: 1.5,
        memory_s: 60.0,
        manual_size: 0.3,
        must_travel: false,
        detector_pause_s: 0.0,
        limits: TimeLimits { stationary_s: f64::INFINITY, tracked_s: f64::INFINITY },
    }
}

/// A tracker behind what sees the whole picture.
struct Chain {
    scene: SceneModel,
    tracker: Tracker,
}

impl Chain {
    fn process(&mut self, picture: &Picture, dt_s: f64, detections: &[Detection]) -> Tracked {
        let luma = picture.luma();
        let whole = vision::Picture { luma, chroma: None };
        let elapsed = Duration::try_from_secs_f64(dt_s).unwrap_or_default();
        let scene = self.scene.update(&whole, 320, elapsed, None).expect("scene");
        let seen = Observation { luma, scene: Some(scene) };
        self.tracker.process(&seen, dt_s, detections).expect("track")
    }
}

/// The street moved by `pan` with people of their own textures at these places.
fn street(pan: (f32, f32), people: &[(f32, f32, u32)]) -> Picture {
    let mut picture = Scene::new(SIZE.0, SIZE.1).background(pan);
    for (x, y, texture) in people {
        picture.paint(Rect2f::new(*x, *y, PERSON.0, PERSON.1), *texture);
    }
    picture
}

fn following(profile: Profile, picture: &Picture, x: f32, y: f32) -> Chain {
    following_with(Config { profile, ..config() }, picture, x, y)
}

fn following_with(config: Config, picture: &Picture, x: f32, y: f32) -> Chain {
    let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config) };
    let tracked = chain.process(picture, DT, &[detection(Rect2f::new(x, y, PERSON.0, PERSON.1))]);
    assert_eq!(tracked.changes, [TargetChange::Acquired]);
    chain
}

fn detection(bounds: Rect2f) -> Detection {
    let frame = Frame { width: SIZE.0 as f32, height: SIZE.1 as f32 };
    Detection { bounds: frame.rect(bounds), ..Detection::default() }
}

/// Somebody of that width.
fn detected(x: f32, width: f32) -> Detection {
    detection(Rect2f::new(x, 100.0, width, PERSON.1))
}

fn step(chain: &mut Chain, picture: &Picture) -> Tracked {
    chain.process(picture, DT, &[])
}

#[track_caller]
fn assert_at(tracked: &Tracked, x: f32, y: f32) {
    assert_near(tracked, x, y, 8.0);
}

#[track_caller]
fn assert_near(tracked: &Tracked, x: f32, y: f32, tolerance: f32) {
    assert_eq!((tracked.state, tracked.id), (TargetState::Tracking, 1), "{:?}", tracked.bounds);
    let off = ((tracked.bounds.x * SIZE.0 as f64) as f32 - x, (tracked.bounds.y * SIZE.1 as f64) as f32 - y);
    assert!(off.0.abs().max(off.1.abs()) < tolerance, "{off:?} pixels off");
}

#[test]
fn a_walker_is_followed() {
    let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(80.0, 100.0, 7)]), 80.0, 100.0);
    for n in 1..30 {
        let x = 80.0 + 8.5 * n as f32;
        assert_at(&step(&mut tracker, &street((0.0, 0.0), &[(x, 100.0, 7)])), x, 100.0);
    }
}

#[test]
fn the_thesis_follows_a_walker_before_an_even_wall() {
    let wall = |x| before_a_wall(&[x]);
    let mut tracker = following(Profile::Thesis, &wall(80.0), 80.0, 100.0);
    for n in 1..30 {
        let x = 80.0 + 8.5 * n as f32;
        assert_near(&step(&mut tracker, &wall(x)), x, 100.0, 12.0);
    }
}

#[test]
fn the_panning_camera_does_not_drag_the_walker() {
    let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(200.0, 100.0, 7)]), 200.0, 100.0);
    for n in 1..30 {
        // The camera keeps the walker in the middle: only the street moves.
        let (pan, x) = (-9.0 * n as f32, 200.0 + (n % 3) as f32);
        let tracked = step(&mut tracker, &street((pan, 0.0), &[(x, 100.0, 7)]));
        assert_at(&tracked, x, 100.0);
        let ego = tracked.ego_velocity.expect("textured").x * SIZE.0 as f64 * DT;
        assert!((ego + 9.0).abs() < 0.5, "{ego}");
    }
}

/// Whether anybody is followed or not, and however the camera turns meanwhile.
#[test]
fn how_fast_the_background_grows_is_told() {
    for (growth, pan, is_followed) in
        [(0.01, 0.0, true), (-0.02, 0.0, false), (0.0, -9.0, false), (0.005, 6.0, true)]
    {
        let view = |n: u32, person: bool| {
            let (scale, shift) = (f32::powf(1.0 + growth, n as f32), pan * n as f32);
            let middle = (SIZE.0 as f32 / 2.0, SIZE.1 as f32 / 2.0);
            let mut picture = Scene::new(SIZE.0, SIZE.1).warped(|x, y| {
                (middle.0 + (x - middle.0) / scale - shift, middle.1 + (y - middle.1) / scale)
            });
            if person {
                picture.paint(Rect2f::new(200.0, 100.0, PERSON.0, PERSON.1), 7);
            }
            picture
        };
        let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
        let somebody = [detection(Rect2f::new(200.0, 100.0, PERSON.0, PERSON.1))];
        chain.process(&view(0, is_followed), DT, if is_followed { &somebody } else { &[] });
        for n in 1..20 {
            let tracked = step(&mut chain, &view(n, is_followed));
            assert_eq!(tracked.id > 0, is_followed);
            let zoom = tracked.ego_zoom.expect("textured");
            let expected = f64::from(1.0 + growth).ln() / DT;
            assert!((zoom - expected).abs() < 0.02, "{growth}, {pan}: {zoom} for {expected}");
            assert!(tracked.ego_velocity.is_some());
        }
    }
}

#[test]
fn somebody_standing_is_kept_under_a_camera_that_starts_to_pan() {
    let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(200.0, 100.0, 7)]), 200.0, 100.0);
    let mut pan = 0.0;
    for n in 1..30 {
        pan -= if n > 10 { 7.0 } else { 0.0 };
        let tracked = step(&mut tracker, &street((pan, 0.0), &[(200.0 + pan, 100.0, 7)]));
        assert_at(&tracked, 200.0 + pan, 100.0);
    }
}

#[test]
fn a_large_motion_of_the_whole_picture_is_followed() {
    let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(60.0, 100.0, 7)]), 60.0, 100.0);
    let mut x = 60.0;
    for speed in [12.0, 28.0, 44.0, 60.0, 60.0] {
        x += speed;
        let tracked = step(&mut tracker, &street((x - 60.0, 0.0), &[(x, 100.0, 7)]));
        assert_at(&tracked, x, 100.0);
    }
}

#[test]
fn two_who_cross_are_not_confused() {
    let mut tracker =
        following(Profile::Robust, &street((0.0, 0.0), &[(60.0, 100.0, 7), (360.0, 104.0, 99)]), 60.0, 100.0);
    let mut last = Tracked::default();
    for n in 1..34 {
        let (x, other) = (60.0 + 9.0 * n as f32, 360.0 - 9.0 * n as f32);
        // The other passes in front.
        last = step(&mut tracker, &street((0.0, 0.0), &[(x, 100.0, 7), (other, 104.0, 99)]));
    }
    assert_at(&last, 60.0 + 9.0 * 33.0, 100.0);
}

#[test]
fn hidden_for_a_second_and_found_again() {
    let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(40.0, 100.0, 7)]), 40.0, 100.0);
    let mut changes = Vec::new();
    let mut last = Tracked::default();
    for n in 1..40 {
        let mut picture = street((0.0, 0.0), &[(40.0 + 8.0 * n as f32, 100.0, 7)]);
        picture.paint(Rect2f::new(150.0, 0.0, 110.0, 320.0), 4321);
        last = step(&mut tracker, &picture);
        changes.extend(last.changes.iter().copied());
    }
    assert_eq!(changes, [TargetChange::Occluded, TargetChange::Reacquired]);
    assert_at(&last, 40.0 + 8.0 * 39.0, 100.0);
}

/// What is left of somebody at the edge of a wall does not hold back the box: it goes on behind the wall as fast as they went.
#[test]
fn a_hidden_target_goes_on_as_fast_as_before() {
    const WALL: Rect2f = Rect2f { x: 180.0, y: 0.0, width: 110.0, height: 320.0 };
    let picture = |people: &[(f32, f32, u32)]| {
        let mut picture = street((0.0, 0.0), people);
        picture.paint(WALL, 4321);
        picture
    };
    let mut tracker = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
    for _ in 0..10 {
        step(&mut tracker, &picture(&[]));
    }
    let x = |n: usize| 40.0 + 8.0 * n as f32;
    tracker.process(&picture(&[(x(0), 100.0, 7)]), DT, &[detected(x(0), PERSON.0)]);
    let mut changes = Vec::new();
    let mut off = 0.0_f32;
    for n in 1..50 {
        let tracked = step(&mut tracker, &picture(&[(x(n), 100.0, 7)]));
        if tracked.state == TargetState::Occluded {
            off = off.max(((tracked.bounds.x * SIZE.0 as f64) as f32 - x(n)).abs());
        }
        changes.extend(tracked.changes);
    }
    assert_eq!(changes, [TargetChange::Occluded, TargetChange::Reacquired]);
    assert!(off < PERSON.0 / 2.0, "{off} pixels off");
}

/// Whoever turns looks unlike what was learned of them and is now broad, now narrow; in their colours and where they are expected
/// it is they.
#[test]
fn who_turns_round_is_followed_on() {
    let mut tracker = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
    for _ in 0..10 {
        step(&mut tracker, &street((0.0, 0.0), &[]));
    }
    for n in 0..40 {
        let x = 60.0 + 6.0 * n as f32;
        let (width, texture) = if n < 15 { (PERSON.0, 7) } else { (30.0 + 3.0 * (n % 5) as f32, 20 + n) };
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(Rect2f::new(x, 100.0, width, PERSON.1), texture);
        let tracked = tracker.process(&picture, DT, &[detected(x, width)]);
        assert_eq!((tracked.state, tracked.id), (TargetState::Tracking, 1), "picture {n}");
        let middle = (tracked.centroid.x * SIZE.0 as f64) as f32;
        assert!((middle - x - width / 2.0).abs() < 15.0, "picture {n}: {middle} for {}", x + width / 2.0);
    }
}

#[test]
fn the_same_pictures_give_the_same_answers() {
    let run = || {
        let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(80.0, 100.0, 7)]), 80.0, 100.0);
        (1..8)
            .map(|n| step(&mut tracker, &street((0.0, 0.0), &[(80.0 + 7.0 * n as f32, 100.0, 7)])))
            .collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}

#[test]
fn a_long_gap_is_a_loss() {
    let picture = street((0.0, 0.0), &[(80.0, 100.0, 7)]);
    for gap in [3.0, f64::NAN, f64::INFINITY] {
        let mut tracker = following(Profile::Robust, &picture, 80.0, 100.0);
        let tracked = tracker.process(&picture, gap, &[]);
        assert_eq!(tracked.changes, [TargetChange::Lost], "{gap}");
    }
}

#[test]
fn who_comes_out_changed_beside_a_hidden_target_is_followed_on() {
    let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(40.0, 100.0, 7)]), 40.0, 100.0);
    let walk = |tracker: &mut Chain, texture: u32| {
        let mut last = Tracked::default();
        for n in 1..24 {
            let mut picture = street((0.0, 0.0), &[]);
            if n < 8 {
                picture.paint(Rect2f::new(40.0 + 8.0 * n as f32, 100.0, PERSON.0, PERSON.1), 7);
                last = step(tracker, &picture);
                continue;
            }
            // Behind a wall they turn round, and stoop.
            let x = 96.0 - 8.0 * (n - 12) as f32;
            if n >= 12 {
                picture.paint(Rect2f::new(x, 130.0, PERSON.0, 60.0), texture);
                last = tracker.process(&picture, DT, &[detection(Rect2f::new(x, 130.0, PERSON.0, 60.0))]);
            } else {
                last = step(tracker, &picture);
            }
        }
        last
    };
    let last = walk(&mut tracker, 7);
    assert_eq!((last.state, last.id), (TargetState::Tracking, 1), "{:?}", last.bounds);
}

/// Follows somebody who is `hidden` in some pictures while another of the looks `painted` walks along beside them: how far the
/// box goes towards the other, as a share of the way, and what is said in the end.
fn beside_another(
    hidden: std::ops::Range<usize>,
    paint: impl Fn(&mut Picture, Rect2f),
) -> (f32, TargetState, u64) {
    const BESIDE: f32 = 60.0;
    let other = |picture: &mut Picture, x: f32| paint(picture, Rect2f::new(x, 100.0, PERSON.0, PERSON.1));
    let mut tracker = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
    for _ in 0..10 {
        step(&mut tracker, &street((0.0, 0.0), &[]));
    }
    let mut first = street((0.0, 0.0), &[(80.0, 100.0, 7)]);
    other(&mut first, 80.0 + BESIDE);
    let tracked = tracker.process(&first, DT, &[detected(80.0, PERSON.0)]);
    assert_eq!(tracked.changes, [TargetChange::Acquired]);
    let (mut farthest, mut last) = (0.0_f32, tracked);
    for n in 1..30 {
        let x = 80.0 + 6.0 * n as f32;
        let people = [(x, 100.0, 7)];
        let mut picture = street((0.0, 0.0), if hidden.contains(&n) { &[] } else { &people });
        other(&mut picture, x + BESIDE);
        last = tracker.process(&picture, DT, &[detected(x + BESIDE, PERSON.0)]);
        farthest = farthest.max(((last.bounds.x * SIZE.0 as f64) as f32 - x) / BESIDE);
    }
    (farthest, last.state, last.id)
}

/// In a crowd somebody else always walks near whoever is not seen for a moment.
#[test]
fn a_neighbour_in_other_clothes_is_not_taken_for_the_target() {
    let (farthest, state, id) = beside_another(13..22, |picture, bounds| {
        picture.paint(bounds, 99);
        picture.darken(bounds);
    });
    assert!(farthest < 0.5, "{farthest} of the way");
    assert_eq!((state, id), (TargetState::Tracking, 1));
}

/// Who was seen beside the target is somebody else, whatever they wear.
#[test]
fn a_neighbour_in_the_same_clothes_is_not_taken_for_the_target() {
    let (farthest, state, id) = beside_another(13..22, |picture, bounds| picture.paint(bounds, 7));
    assert!(farthest < 0.5, "{farthest} of the way");
    assert_eq!((state, id), (TargetState::Tracking, 1));
}

/// The width and height, in the end, of the box of somebody whom the detector sees in `first` for three seconds, and in `later` then.
fn measured(first: Rect2f, later: Rect2f) -> (f64, f64) {
    let street = street((0.0, 0.0), &[(200.0, 100.0, 7)]);
    let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
    let mut tracked = chain.process(&street, DT, &[detection(first)]);
    for region in [first, later] {
        for _ in 0..30 {
            tracked = chain.process(&street, DT, &[detection(region)]);
        }
    }
    (tracked.bounds.width * SIZE.0 as f64, tracked.bounds.height * SIZE.1 as f64)
}

#[test]
fn the_box_takes_the_size_of_the_whole_once_that_is_seen() {
    let whole = Rect2f::new(200.0, 100.0, PERSON.0, PERSON.1);
    let first = [
        ("a trunk", Rect2f::new(205.0, 105.0, 30.0, 40.0)),
        ("a shadow", Rect2f::new(190.0, 100.0, 70.0, 90.0)),
    ];
    for (name, first) in first {
        let (width, height) = measured(first, whole);
        assert!((width - 40.0).abs() < 6.0 && (height - 90.0).abs() < 6.0, "{name}: {width} x {height}");
    }
    let (_, height) = measured(whole, Rect2f::new(200.0, 100.0, 40.0, 45.0));
    assert!(height > 80.0, "a table hides the legs: {height}");
}

#[test]
fn whoever_walks_while_hidden_does_not_stand() {
    let limits = TimeLimits { stationary_s: 2.5, tracked_s: f64::INFINITY };
    let tracker = Tracker::new(Config { limits, coast_s: 3.0, ..config() });
    let mut chain = Chain { scene: SceneModel::default(), tracker };
    let nobody = street((0.0, 0.0), &[]);
    for _ in 0..30 {
        step(&mut chain, &nobody);
    }
    let mut stand = |seconds: f64, x: f32| {
        let picture = street((0.0, 0.0), &[(x, 100.0, 7)]);
        let reports = (0..(seconds / DT) as usize)
            .map(|_| chain.process(&picture, DT, &[detected(x, PERSON.0)]))
            .collect::<Vec<_>>();
        for _ in 0..12 {
            step(&mut chain, &nobody);
        }
        reports
    };
    assert_eq!(stand(1.5, 60.0)[0].changes, [TargetChange::Acquired]);
    let there = stand(3.0, 130.0);
    assert_at(&there[17], 130.0, 100.0);
    assert!(
        there.iter().any(|tracked| tracked
            .released
            .is_some_and(|released| released.reason == ReleaseReason::Stationary)),
        "they stand now"
    );
}

/// The scenes below begin with nobody, as a camera sees them.
fn watching(config: Config) -> Chain {
    let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config) };
    for _ in 0..10 {
        step(&mut chain, &street((0.0, 0.0), &[]));
    }
    chain
}

/// How much of the target's box is that of `person`, intersection over union.
fn is_on(tracked: &Tracked, person: Rect2f) -> f32 {
    let frame = Frame { width: SIZE.0 as f32, height: SIZE.1 as f32 };
    super::super::geometry::overlap(frame.rect_to_pixels(tracked.bounds), person)
}

/// Somebody who comes in shows a hand first, which is a region of its own and is taken; then all of them walks in.
#[test]
fn a_hand_that_was_taken_first_is_the_whole_person_half_a_second_later() {
    let mut chain = watching(Config { must_travel: true, ..config() });
    let mut last = Tracked::default();
    for n in 0..30 {
        let person = Rect2f::new(6.0 * n as f32 - 30.0, 90.0, 60.0, 150.0);
        let hand = Rect2f::new(person.x + 45.0, 150.0, 18.0, 14.0);
        let mut picture = street((0.0, 0.0), &[]);
        let region = if n < 15 { hand } else { person };
        picture.paint(region, 7);
        last = chain.process(&picture, DT, &[detection(region)]);
        assert!((10..15).contains(&n) <= (last.state == TargetState::Tracking), "the hand is taken: {n}");
        if n >= 20 {
            assert!(is_on(&last, person) > 0.6, "picture {n}: {:?}", last.bounds);
        }
    }
    assert_eq!(last.id, 1);
}

/// Somebody walks in past a rack, which sways from the touch and is taken; then it hangs still, and they are a region of their own.
#[test]
fn a_rack_that_was_taken_first_is_given_up_for_the_person_within_half_a_second() {
    let mut chain = watching(Config { must_travel: true, ..config() });
    let mut since = None;
    for n in 0..40 {
        let rack = Rect2f::new(60.0 + 6.0 * (n.min(7) as f32), 100.0, 50.0, 80.0);
        let person = Rect2f::new(140.0 + 7.0 * (n as f32 - 10.0), 80.0, 60.0, 150.0);
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(rack, 50);
        let mut detections = vec![];
        if n < 8 {
            detections.push(detection(rack));
        }
        if n >= 10 {
            picture.paint(person, 7);
            detections.push(detection(person));
        }
        let last = chain.process(&picture, DT, &detections);
        assert!(n != 7 || is_on(&last, rack) > 0.6, "the rack is taken: {last:?}");
        let is_person = last.state == TargetState::Tracking && is_on(&last, person) > 0.6;
        since = since.or(is_person.then_some(n));
        assert!(since.is_none() || is_person, "picture {n}: {:?} {:?}", last.state, last.bounds);
    }
    assert!(since.is_some_and(|since| since <= 10 + 5), "{since:?}");
}

/// Of three who walk the first leaves, and the tallest of the others is taken up, who has just come in. In the picture after that there is
/// no region of them. The other has gone farther than either is tall.
#[test]
fn who_was_just_taken_up_is_kept_through_a_picture_without_a_region() {
    let mut chain = watching(Config { must_travel: true, ..config() });
    let mut taken = None;
    for n in 0..45 {
        let along = n as f32;
        let first = Rect2f::new(150.0 - 10.0 * along, 80.0, 60.0, 170.0);
        let person = Rect2f::new(600.0 - 12.0 * along, 90.0, 60.0, 150.0);
        let other = Rect2f::new(20.0 + 8.0 * along, 230.0, 36.0, 80.0);
        let mut picture = street((0.0, 0.0), &[]);
        let mut detections = vec![];
        for (texture, bounds) in [(7, first), (50, other), (21, person)] {
            let is_missed = bounds == person && taken.is_some_and(|taken| n == taken + 1);
            if bounds.x > 0.0 && bounds.br().x < SIZE.0 as f32 {
                picture.paint(bounds, texture);
                if !is_missed {
                    detections.push(detection(bounds));
                }
            }
        }
        let last = chain.process(&picture, DT, &detections);
        if n > 15 && last.changes.contains(&TargetChange::Acquired) {
            taken = Some(n);
        }
        assert!(
            taken.is_none() || is_on(&last, person) > 0.6,
            "picture {n}: {:?} {:?}",
            last.state,
            last.bounds
        );
    }
    assert!(taken.is_some_and(|taken| taken < 40), "{taken:?}");
}

/// A poster flickers for a second: its points and its looks are there for ever, and nobody is.
#[test]
fn nobody_is_tracked_three_seconds_after_a_poster_flickered() {
    let poster = Rect2f::new(200.0, 60.0, 50.0, 90.0);
    let mut chain = watching(config());
    let picture = street((0.0, 0.0), &[]);
    let mut taken = false;
    for n in 0..50 {
        let detections = if n < 10 { vec![detection(poster)] } else { vec![] };
        let last = chain.process(&picture, DT, &detections);
        taken |= last.changes == [TargetChange::Acquired];
        if n > 40 {
            assert_eq!(last.state, TargetState::Searching, "picture {n}");
        }
    }
    assert!(taken);
}

/// What a screen shows, of that width and height, goes to and fro, farther than it is broad, and rests at either edge for a moment; after
/// three seconds somebody walks in. Since which picture they are followed, where what is shown was selected by hand or not.
fn since_they_are_followed((width, height): (f32, f32), by_hand: bool) -> Option<usize> {
    let mut chain = watching(Config { must_travel: true, ..config() });
    let mut since = None;
    for n in 0..70 {
        let along = (1.3 * (0.14 * n as f32).sin()).clamp(-1.0, 1.0);
        let shown = Rect2f::new(300.0 + width * along, 60.0, width, height);
        let person = Rect2f::new(10.0 * (n as f32 - 30.0), 100.0, 60.0, 150.0);
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(shown, 50);
        let mut detections = vec![detection(shown)];
        if n >= 30 {
            picture.paint(person, 7);
            detections.push(detection(person));
        }
        if by_hand && n == 20 {
            chain.tracker.request(TargetRequest::Select(detection(shown).bounds.centre()));
        }
        let last = chain.process(&picture, DT, &detections);
        assert!(!(15..30).contains(&n) || is_on(&last, shown) > 0.3, "the film is taken, {n}: {last:?}");
        let is_person = last.state == TargetState::Tracking && is_on(&last, person) > 0.6;
        since = since.or(is_person.then_some(n));
        assert!(since.is_none() || is_person, "picture {n}: {:?} {:?}", last.state, last.bounds);
    }
    since
}

#[test]
fn what_a_screen_shows_is_given_up_for_who_has_gone_as_far_as_they_are_tall() {
    for size in [(30.0, 24.0), (40.0, 170.0)] {
        let since = since_they_are_followed(size, false);
        assert!(since.is_some_and(|since| (45..=65).contains(&since)), "{size:?} {since:?}");
    }
}

#[test]
fn what_was_selected_by_hand_is_kept() {
    assert_eq!(since_they_are_followed((30.0, 24.0), true), None);
}

/// Who walked in, for so many pictures, stands and looks about while somebody taller walks past.
fn stands_while_somebody_walks_past(walks: usize) {
    let mut chain = watching(Config { must_travel: true, ..config() });
    for n in 0..60 {
        let first = Rect2f::new(460.0 - 10.0 * n.min(walks) as f32, 90.0, 50.0, 130.0);
        let other = Rect2f::new(10.0 * (n as f32 - 35.0) - 40.0, 90.0, 60.0, 150.0);
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(first, 7);
        let mut detections = vec![detection(first)];
        if n >= 35 {
            picture.paint(other, 50);
            detections.push(detection(other));
        }
        let last = chain.process(&picture, DT, &detections);
        if n >= 20 {
            assert!(is_on(&last, first) > 0.5, "picture {n}: {:?} {:?}", last.state, last.bounds);
        }
    }
}

#[test]
fn who_has_gone_as_far_and_stands_is_not_given_up_for_who_walks_past() {
    stands_while_somebody_walks_past(25);
}

/// Farther than an arm reaches is far enough.
#[test]
fn who_has_gone_less_far_than_they_are_tall_is_not_given_up_for_who_walks_past() {
    stands_while_somebody_walks_past(11);
}

/// Somebody nearer overtakes the target, and is one region with it.
#[test]
fn the_points_of_who_overtakes_do_not_draw_the_target_along() {
    let mut chain = watching(Config { choice: Choice::Manual, ..config() });
    for n in 0..24 {
        let target = Rect2f::new(100.0 + 3.0 * n as f32, 100.0, 36.0, 90.0);
        let other = Rect2f::new(7.0 * n as f32, 96.0, 60.0, 120.0);
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(target, 7);
        picture.paint(other, 99);
        let seen =
            if n < 9 { vec![detection(target), detection(other)] } else { vec![detection(target | other)] };
        if n == 5 {
            chain.tracker.request(TargetRequest::Select(detection(target).bounds.centre()));
        }
        let last = chain.process(&picture, DT, &seen);
        let expected = 3.0 / DT / picture.luma().width() as f64;
        assert!(
            n < 5 || (last.velocity.x - expected).abs() < 0.1 * expected,
            "picture {n}: {:?}",
            last.velocity
        );
    }
}

/// A detector looks at every eighth picture, and somebody walks faster in between.
#[test]
fn between_two_looks_of_a_detector_the_points_say_how_the_target_moves() {
    let mut chain = watching(Config { detector_pause_s: 1.0, ..config() });
    let mut x = 60.0;
    for n in 0..40 {
        let step = if n < 33 { 3.0 } else { 6.0 };
        x += step;
        let person = Rect2f::new(x, 100.0, 36.0, 90.0);
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(person, 7);
        let seen = if n % 8 == 0 { vec![detection(person)] } else { Vec::new() };
        let last = chain.process(&picture, DT, &seen);
        let expected = f64::from(step) / DT / picture.luma().width() as f64;
        let off = (last.velocity.x - expected).abs() / expected;
        assert!(n < 25 || off < 0.1, "picture {n}: {:?}, not {expected}", last.velocity);
    }
}

/// Two come in as one, side by side, and an operator clicks on the left one's middle; then the other walks ahead.
#[test]
fn who_was_clicked_of_two_who_came_in_as_one_is_followed_when_they_part() {
    let mut chain = watching(Config { choice: Choice::Manual, must_travel: true, ..config() });
    let mut last = Tracked::default();
    let (mut left, mut right) = (Rect2f::default(), Rect2f::default());
    for n in 0..40 {
        let x = 60.0 + 4.0 * n as f32;
        left = Rect2f::new(x, 100.0, 36.0, 90.0);
        right = Rect2f::new(x + 34.0 + 8.0 * (n as f32 - 18.0).max(0.0), 104.0, 36.0, 94.0);
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(left, 7);
        picture.paint(right, 99);
        picture.darken(right);
        let seen =
            if n <= 18 { vec![detection(left | right)] } else { vec![detection(left), detection(right)] };
        if n == 10 {
            chain.tracker.request(TargetRequest::Select(detection(left).bounds.centre()));
        }
        last = chain.process(&picture, DT, &seen);
    }
    assert_eq!(last.state, TargetState::Tracking);
    assert!(is_on(&last, left) > 0.5 && is_on(&last, right) < 0.2, "{:?}, not {left:?}", last.bounds);
}

/// Somebody alone is clicked beside their middle: they may be two for a while, and are one again then.
#[test]
fn who_was_clicked_beside_their_middle_is_one_person() {
    let mut chain = watching(Config { choice: Choice::Manual, must_travel: true, ..config() });
    let mut last = Tracked::default();
    for n in 0..50 {
        let person = Rect2f::new(20.0 + 6.0 * n as f32, 100.0, PERSON.0, PERSON.1);
        let mut picture = street((0.0, 0.0), &[]);
        picture.paint(person, 7);
        if n == 15 {
            let middle = detection(person).bounds.centre();
            let place = ptztrack_contract::Point { x: middle.x + 10.0 / SIZE.0 as f64, ..middle };
            chain.tracker.request(TargetRequest::Select(place));
        }
        last = chain.process(&picture, DT, &[detection(person)]);
        assert!(n < 16 || is_on(&last, person) > 0.4, "picture {n}: {:?}", last.bounds);
        if n >= 45 {
            assert_eq!((last.tracks.len(), last.id), (1, 1), "{:?}", last.tracks);
            assert!(is_on(&last, person) > 0.7, "picture {n}: {:?}", last.bounds);
        }
    }
    assert_eq!(last.state, TargetState::Tracking);
}

/// A detector that knows nothing of the background took something for somebody: it looks the same for ever, and nothing else speaks for it.
#[test]
fn looks_alone_keep_nobody_where_the_background_is_not_known() {
    let picture = street((0.0, 0.0), &[(200.0, 100.0, 7)]);
    let mut tracker = Tracker::new(config());
    let mut process = |detections: &[Detection]| {
        let seen = Observation { luma: picture.luma(), scene: None };
        tracker.process(&seen, DT, detections).expect("track")
    };
    assert_eq!(process(&[detected(200.0, PERSON.0)]).changes, [TargetChange::Acquired]);
    let lost = (0..200).find(|_| process(&[]).changes.contains(&TargetChange::Lost));
    assert!(lost.is_some_and(|pictures| pictures > 20), "{lost:?}");
}

/// The same where whoever is hidden is waited for for long: that is no evidence of anybody.
#[test]
fn looks_alone_keep_nobody_however_long_the_hidden_are_coasted() {
    let picture = street((0.0, 0.0), &[(200.0, 100.0, 7)]);
    let mut tracker = Tracker::new(Config { coast_s: 10.0, ..config() });
    let mut process = |detections: &[Detection]| {
        let seen = Observation { luma: picture.luma(), scene: None };
        tracker.process(&seen, DT, detections).expect("track")
    };
    assert_eq!(process(&[detected(200.0, PERSON.0)]).changes, [TargetChange::Acquired]);
    assert!((0..700).any(|_| process(&[]).changes.contains(&TargetChange::Lost)));
}

/// Where the camera turns, and a plain wall or blur fills the picture for a moment.
#[test]
fn tracks_go_on_with_a_background_whose_motion_is_not_seen() {
    let at = |n: usize| 300.0 - 9.0 * n as f32;
    let mut chain = following(Profile::Robust, &street((0.0, 0.0), &[(at(0), 100.0, 7)]), at(0), 100.0);
    for n in 1..10 {
        let picture = street((at(n) - at(0), 0.0), &[(at(n), 100.0, 7)]);
        chain.process(&picture, DT, &[detected(at(n), PERSON.0)]);
    }
    let plain = Scene::new(SIZE.0, SIZE.1).flat(120);
    for n in 10..12 {
        let tracked = step(&mut chain, &plain);
        assert_eq!(tracked.ego_velocity, None, "nobody saw it");
        let off = (tracked.bounds.x * SIZE.0 as f64) as f32 - at(n);
        assert!(off.abs() < 5.0, "picture {n}: {off} pixels off");
    }
}

/// Whoever goes after them is to hear of it.
#[test]
fn who_is_let_go_after_they_were_lost_is_told_of_once() {
    let picture = street((0.0, 0.0), &[(200.0, 100.0, 7)]);
    // What is told of so many pictures after the one of somebody, who is let go in the last two.
    let told = |pictures: usize| {
        let mut tracker = Tracker::new(config());
        let mut process = |detections: &[Detection], let_go: bool| {
            if let_go {
                tracker.request(TargetRequest::Release);
            }
            let seen = Observation { luma: picture.luma(), scene: None };
            let tracked = tracker.process(&seen, DT, detections).expect("track");
            (tracked.state, tracked.id)
        };
        let first = process(&[detected(200.0, PERSON.0)], false);
        assert_eq!(first, (TargetState::Tracking, 1));
        (0..pictures).map(|picture| process(&[], picture + 2 >= pictures)).collect::<Vec<_>>()
    };
    let lost = told(200).iter().position(|told| *told == (TargetState::Lost, 1)).unwrap();
    let nobody = (TargetState::Searching, 0);
    let let_go = (TargetState::Searching, 1);
    assert_eq!(told(lost + 4)[lost..], [(TargetState::Lost, 1), nobody, let_go, nobody]);
    assert_eq!(told(lost + 2)[lost..], [let_go, nobody], "in the very picture in which they are lost");
}

/// People of those places before an even wall.
fn before_a_wall(people: &[f32]) -> Picture {
    let mut picture = Scene::new(SIZE.0, SIZE.1).flat(240);
    for x in people {
        picture.paint(Rect2f::new(*x, 100.0, PERSON.0, PERSON.1), 7);
    }
    picture
}

/// Somebody who has come there before a wall that is known, beside these.
fn come_to(x: f32, others: &[f32]) -> Chain {
    let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
    for _ in 0..20 {
        step(&mut chain, &before_a_wall(others));
    }
    let mut last = Tracked::default();
    for n in 0..40 {
        let x = (30.0 + 10.0 * n as f32).min(x);
        let people = [others, &[x]].concat();
        last = chain.process(&before_a_wall(&people), DT, &[detected(x, PERSON.0)]);
    }
    assert_eq!(last.state, TargetState::Tracking);
    chain
}

/// Somebody stands before a statue that looks as they do, and is gone: it does not stand out, as they did.
#[test]
fn what_looks_like_somebody_and_does_not_stand_out_is_the_wall() {
    const STATUE_X: f32 = 330.0;
    let mut chain = come_to(STATUE_X - 12.0, &[STATUE_X]);
    let changes: Vec<_> =
        (0..40).flat_map(|_| step(&mut chain, &before_a_wall(&[STATUE_X])).changes).collect();
    assert_eq!(changes, [TargetChange::Occluded, TargetChange::Lost]);
}

/// Of a background that is not known, nobody can say what stands out.
#[test]
fn whoever_stands_where_the_background_was_forgotten_is_kept() {
    let mut chain = come_to(200.0, &[]);
    let picture = before_a_wall(&[200.0]);
    for _ in 0..12 {
        let seen = Observation { luma: picture.luma(), scene: None };
        assert_near(&chain.tracker.process(&seen, DT, &[]).expect("track"), 200.0, 100.0, 8.0);
    }
}
