// SPDX-License-Identifier: MPL-2.0

use super::super::tracks::{Region, seen_as, seen_in};
use super::*;

const FRAME: Frame = Frame { width: 640.0, height: 480.0 };
const DT: f64 = 0.1;
const STILL: Option<EgoMotion> = None;

fn at(x: f32, y: f32, width: f32, height: f32) -> Rect2f {
    Rect2f::new(x, y, width, height)
}

/// Tracks that are confirmed in three pictures, and the policy beside them.
#[derive(Default)]
struct Chain {
    tracks: Tracks,
    policy: Policy,
}

impl Chain {
    fn see(&mut self, regions: &[Rect2f], ego: Option<EgoMotion>) {
        seen_in(&mut self.tracks, regions, ego, DT);
        self.policy.pass(&self.tracks, ego, DT);
    }

    fn see_outlines<const COUNT: usize>(&mut self, regions: [(Rect2f, Vec<Point2f>); COUNT]) {
        let regions = regions.into_iter().map(|(bounds, outline)| Region::new(bounds, outline, false));
        seen_as(&mut self.tracks, regions, DT);
    }

    fn choose(&self, choice: Choice, must_travel: bool) -> Option<&Track> {
        self.policy.choices(&self.tracks, choice, None, must_travel, FRAME).first().copied()
    }

    fn chosen(&self) -> Option<Rect2f> {
        self.choose(Choice::Largest, false).map(Track::seen_bounds)
    }
}

fn seen(frames: usize, regions: &[Rect2f]) -> Chain {
    let mut chain = Chain::default();
    (0..frames).for_each(|_| chain.see(regions, STILL));
    chain
}

#[test]
fn choices() {
    let mut chain = seen(2, &[at(300.0, 200.0, 20.0, 50.0)]);
    for _ in 0..3 {
        let all = [at(300.0, 200.0, 20.0, 50.0), at(30.0, 30.0, 60.0, 120.0), at(400.0, 220.0, 30.0, 60.0)];
        chain.see(&all, STILL);
    }
    let x = |choice| chain.choose(choice, false).map(|track| track.seen_bounds().x);
    assert_eq!(x(Choice::Largest), Some(30.0));
    assert_eq!(x(Choice::First), Some(300.0));
    assert_eq!(x(Choice::NearestCentre), Some(300.0));
    assert_eq!(x(Choice::Manual), None);
    let known = chain.choose(Choice::First, false).map(|track| track.id);
    let again = chain.policy.choices(&chain.tracks, Choice::Largest, known, false, FRAME).first().copied();
    assert_eq!(again.map(|track| track.seen_bounds().x), Some(300.0), "who was lost goes before all others");
}

#[test]
fn a_flicker_is_not_chosen() {
    assert_eq!(seen(2, &[at(100.0, 100.0, 40.0, 90.0)]).chosen(), None);
    let mut chain = Chain::default();
    for n in 0..9 {
        chain.see(&[at(60.0 * n as f32, 100.0, 20.0, 30.0)], STILL);
    }
    assert_eq!(chain.chosen(), None);
}

#[test]
fn half_a_person_at_the_edge_is_awaited_but_not_for_ever() {
    let edge = [at(0.0, 100.0, 30.0, 90.0)];
    assert_eq!(seen(5, &edge).chosen(), None);
    assert_eq!(seen(16, &edge).chosen(), Some(edge[0]));
}

/// Whether what looks like `path` at each frame is chosen within two seconds, where it must travel.
fn travels(ego: EgoMotion, path: impl Fn(f32) -> Rect2f) -> bool {
    let mut chain = Chain::default();
    (0..20).any(|n| {
        chain.see(&[path(n as f32)], Some(ego));
        chain.choose(Choice::Largest, true).is_some()
    })
}

#[test]
fn whoever_walks_past_below_is_chosen_at_once() {
    let head = [at(100.0, 400.0, 70.0, 80.0)];
    assert_eq!(seen(5, &head).chosen(), Some(head[0]));
}

#[test]
fn a_walker_travels_whatever_the_camera_does() {
    for pan in [0.0, -4.0, 7.0] {
        let ego = EgoMotion::translation(Point2f::new(pan, 0.0));
        assert!(travels(ego, |n| at(300.0 + (4.0 + pan) * n, 100.0, 40.0, 90.0)), "{pan}");
    }
    let nearer = |n| at(300.0 - 0.5 * n, 100.0, 40.0 + n, 90.0 + 2.0 * n);
    assert!(travels(EgoMotion::default(), nearer));
}

#[test]
fn what_changes_but_stays_does_not_travel() {
    let still = EgoMotion::default();
    assert!(!travels(still, |_| at(300.0, 100.0, 60.0, 40.0)), "a screen");
    assert!(!travels(still, |n| at(300.0, 100.0, 40.0 + 4.0 * n, 200.0)), "a door");
    assert!(!travels(still, |n| at(300.0 + 5.0 * (n % 2.0), 100.0, 60.0, 200.0)), "a curtain");
    let pan = EgoMotion::translation(Point2f::new(6.0, 0.0));
    assert!(!travels(pan, |n| at(200.0 + 6.0 * n, 100.0, 60.0, 40.0)), "a screen, the camera turning");
}

/// Somebody in a film goes from one side of the screen to the other.
#[test]
fn who_is_where_much_changed_for_nothing_must_come_out_of_there() {
    let film = |chain: &mut Chain, n: usize| {
        let x = 200.0 + 10.0 * (n % 8) as f32;
        chain.see(&[at(x, 100.0, 30.0, 40.0)], Some(EgoMotion::default()));
        chain.choose(Choice::Largest, true).is_some()
    };
    let mut chain = Chain::default();
    for _ in 0..30 {
        chain.see(&[at(190.0, 90.0, 130.0, 60.0)], Some(EgoMotion::default()));
    }
    for _ in 0..40 {
        chain.see(&[], Some(EgoMotion::default()));
    }
    assert!(!(0..8).any(|n| film(&mut chain, n)));
    let mut elsewhere = Chain::default();
    assert!((0..8).any(|n| film(&mut elsewhere, n)));
}

#[test]
fn what_was_released_is_held_back() {
    let one = [at(300.0, 200.0, 30.0, 60.0)];
    let mut chain = seen(4, &one);
    let id = chain.choose(Choice::Largest, false).expect("confirmed").id;
    chain.policy.release(id);
    chain.see(&one, STILL);
    assert_eq!(chain.chosen(), None);
    for _ in 0..40 {
        chain.see(&one, STILL);
    }
    assert_eq!(chain.chosen(), Some(one[0]));
}

#[test]
fn who_is_ignored_is_not_chosen_and_somebody_else_is() {
    let both = [at(300.0, 200.0, 60.0, 120.0), at(100.0, 200.0, 30.0, 60.0)];
    let mut chain = seen(4, &both);
    let id = chain.choose(Choice::Largest, false).expect("confirmed").id;
    chain.policy.ignore([id].into());
    assert_eq!(chain.chosen(), Some(both[1]));
    chain.policy.restart();
    assert_eq!(chain.chosen(), Some(both[1]), "for as long as they are to be ignored");
    chain.policy.ignore([].into());
    assert_eq!(chain.chosen(), Some(both[0]));
}

#[test]
fn who_stood_is_not_chosen_until_they_move_or_come_nearer() {
    let moved = |x: f32, growth: f32| at(300.0 + x, 200.0, 40.0 * growth, 90.0 * growth);
    for (bounds, chosen) in [
        (moved(-30.0, 1.0), false),
        (moved(45.0, 1.0), true),
        (moved(0.0, 1.4), true),
        (at(285.0, 205.0, 30.0, 15.0), false),
    ] {
        let still = Some(EgoMotion::default());
        let mut chain = seen(4, &[moved(0.0, 1.0)]);
        let id = chain.choose(Choice::Largest, false).expect("confirmed").id;
        chain.policy.park(id, moved(0.0, 1.0));
        chain.see(&[moved(0.0, 1.0)], still);
        assert_eq!(chain.chosen(), None);
        for n in 1..=40 {
            let mix = |from: f32, to: f32| from + (to - from) * (n as f32 / 10.0).min(1.0);
            let from = moved(0.0, 1.0);
            let step = at(
                mix(from.x, bounds.x),
                mix(from.y, bounds.y),
                mix(from.width, bounds.width),
                mix(from.height, bounds.height),
            );
            chain.see(&[step], still);
        }
        assert_eq!(chain.chosen().is_some(), chosen, "{bounds:?}");
    }
}

/// The shadow of a cloud was let go because it stood; then somebody walks over the lawn.
#[test]
fn who_has_come_to_where_something_larger_stood_is_chosen() {
    let still = Some(EgoMotion::default());
    let shadow = at(100.0, 100.0, 400.0, 300.0);
    let mut chain = seen(4, &[shadow]);
    let id = chain.choose(Choice::Largest, false).expect("confirmed").id;
    chain.policy.park(id, shadow);
    (0..40).for_each(|_| chain.see(&[], still));
    let chosen = (0..30).map(|n| {
        chain.see(&[at(250.0 + 8.0 * n as f32, 200.0, 30.0, 80.0)], still);
        chain.choose(Choice::Largest, true).is_some()
    });
    let since = chosen.collect::<Vec<_>>().iter().position(|chosen| *chosen);
    assert!(since.is_some_and(|since| (17..22).contains(&since)), "half as far as that is tall: {since:?}");
}

#[test]
fn a_click_means_the_smallest_track_there() {
    let chain = seen(1, &[at(100.0, 40.0, 240.0, 400.0), at(400.0, 200.0, 30.0, 60.0)]);
    let x = |x, y| clicked(&chain.tracks, Point2f::new(x, y)).map(|track| track.seen_bounds().x);
    assert_eq!(x(405.0, 220.0), Some(400.0));
    assert_eq!(x(220.0, 120.0), Some(100.0));
    assert_eq!(x(600.0, 20.0), None);
}

/// Somebody far away is seen between the arm and the legs of somebody near, whose box is around both.
#[test]
fn a_click_means_whose_outline_it_is_in() {
    let corners = |points: &[(f32, f32)]| points.iter().map(|(x, y)| Point2f::new(*x, *y)).collect();
    let near = corners(&[(100.0, 100.0), (160.0, 100.0), (110.0, 130.0), (120.0, 300.0), (100.0, 300.0)]);
    let far = corners(&[(130.0, 150.0), (200.0, 150.0), (200.0, 350.0), (130.0, 350.0)]);
    let mut chain = Chain::default();
    chain.see_outlines([(at(100.0, 100.0, 60.0, 200.0), near), (at(130.0, 150.0, 70.0, 200.0), far)]);
    let x = |x, y| clicked(&chain.tracks, Point2f::new(x, y)).map(|track| track.seen_bounds().x);
    assert_eq!(x(140.0, 200.0), Some(130.0), "of the two boxes the larger one's");
    assert_eq!(x(105.0, 200.0), Some(100.0));
    assert_eq!(x(95.0, 120.0), Some(100.0), "beside both");
}

#[test]
fn who_was_seen_beside_the_target_is_somebody_else() {
    let target = at(300.0, 100.0, 40.0, 90.0);
    let mut chain = seen(4, &[target, at(60.0, 100.0, 40.0, 90.0)]);
    for is_another in [false, false, true] {
        let beside: Vec<_> = chain.tracks.seen().map(Track::is_another).collect();
        assert_eq!(beside.contains(&true), is_another);
        let id = clicked(&chain.tracks, centre(target)).map_or(0, |track| track.id);
        tell_apart(&mut chain.tracks, id, target, DT / 2.0);
    }
    assert!(clicked(&chain.tracks, centre(target)).is_some_and(|track| !track.is_another()));
}

#[test]
fn a_leg_goes_before_the_body() {
    let (leg, body, bystander) =
        (at(20.0, 300.0, 30.0, 100.0), at(0.0, 120.0, 45.0, 160.0), at(0.0, 120.0, 15.0, 280.0));
    let chosen = |regions: &[Rect2f]| seen(5, regions).chosen();
    assert_eq!(chosen(&[leg]), Some(leg), "of a dog, say");
    assert_eq!(chosen(&[leg, body]), None);
    assert_eq!(chosen(&[leg, bystander]), Some(leg), "beside it");
    let inside = at(6.0, 120.0, 45.0, 160.0);
    assert_eq!(chosen(&[leg, inside]), Some(inside), "all of the body");
}
