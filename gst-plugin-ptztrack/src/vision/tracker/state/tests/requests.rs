// SPDX-License-Identifier: MPL-2.0

//! What an operator asks for.

use super::*;
use ptztrack_contract::Point;

/// Where nobody is, before an even wall.
const EMPTY: Point = Point { x: 0.8, y: 0.5 };
const NAMES: [u64; 2] = [1, 2];

/// One picture of people of those places before an even wall, all of whom are seen.
fn see(chain: &mut Chain, people: &[f32]) -> Tracked {
    let detections: Vec<_> = people.iter().map(|x| detected(*x, PERSON.0)).collect();
    chain.process(&before_a_wall(people), DT, &detections)
}

/// Two who are seen, the first of them followed.
fn two(config: Config) -> Chain {
    let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config) };
    for _ in 0..10 {
        see(&mut chain, &[80.0, 300.0]);
    }
    chain
}

#[test]
fn who_is_followed_stays_the_target_where_what_is_asked_for_cannot_be_followed() {
    let mut chain = following_with(config(), &before_a_wall(&[80.0]), 80.0, 100.0);
    chain.tracker.request(TargetRequest::Select(EMPTY));
    let asked = see(&mut chain, &[80.0]);
    assert_eq!((asked.state, asked.id, asked.changes.len()), (TargetState::Tracking, 1, 0));
    assert!(asked.without_corners.is_some());
    assert_eq!(see(&mut chain, &[80.0]).without_corners, None, "once");
}

#[test]
fn somebody_is_followed_beside_something_larger_that_cannot_be() {
    let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
    let shade = detection(Rect2f::new(220.0, 60.0, 150.0, 200.0));
    let tracked = chain.process(&before_a_wall(&[80.0]), DT, &[shade, detected(80.0, PERSON.0)]);
    assert_eq!(tracked.changes, [TargetChange::Acquired]);
    assert!((tracked.bounds.x * SIZE.0 as f64 - 80.0).abs() < 8.0, "{:?}", tracked.bounds);
}

/// Who has not been seen for longer than they are told of is drawn nowhere, and nobody can mean them.
#[test]
fn the_next_target_is_one_that_is_told_of() {
    let mut chain = two(config());
    let mut ask = |people: &[f32], request: TargetRequest| {
        for _ in 0..7 {
            see(&mut chain, people);
        }
        chain.tracker.request(request);
        see(&mut chain, people).id
    };
    assert_eq!(ask(&[80.0, 300.0], TargetRequest::Next), 2);
    assert_eq!(ask(&[80.0, 300.0], TargetRequest::Next), 1);
    assert_eq!(ask(&[80.0], TargetRequest::Next), 1);
    assert_eq!(ask(&[80.0], TargetRequest::SelectTrack(2)), 1);
}

/// Somebody who shows nothing to follow is passed over.
#[test]
fn the_next_target_is_one_that_can_be_followed() {
    let mut chain = Chain { scene: SceneModel::default(), tracker: Tracker::new(config()) };
    let shade = Rect2f::new(300.0, 60.0, 80.0, 200.0);
    let see = |chain: &mut Chain| {
        let seen = [detected(80.0, PERSON.0), detection(shade), detected(200.0, PERSON.0)];
        chain.process(&before_a_wall(&[80.0, 200.0]), DT, &seen)
    };
    let ids: Vec<_> =
        (0..5).map(|_| see(&mut chain)).last().unwrap().tracks.iter().map(|one| one.id).collect();
    assert_eq!(ids.len(), 3);
    let targets: std::collections::BTreeSet<_> = (0..4)
        .map(|_| {
            chain.tracker.request(TargetRequest::Next);
            see(&mut chain).id
        })
        .collect();
    assert_eq!(targets.len(), 2, "to and fro between those with corners: {targets:?} of {ids:?}");
}

#[test]
fn who_is_selected_in_a_group_is_followed_with_the_others() {
    let mut chain = two(Config { choice: Choice::Group, ..config() });
    let first = see(&mut chain, &[80.0, 300.0]).id;
    chain.tracker.request(TargetRequest::Next);
    see(&mut chain, &[80.0, 300.0]);
    for _ in 0..5 {
        let after = see(&mut chain, &[80.0, 300.0]);
        assert!(after.is_group && after.id != first, "{after:?}");
    }
}

/// As an operator who looks at this one and that one.
#[test]
fn who_is_selected_again_is_not_left_alone() {
    let mut chain = two(config());
    let first = see(&mut chain, &[80.0, 300.0]).id;
    let other = NAMES.into_iter().find(|id| *id != first).unwrap();
    for id in [other, first] {
        chain.tracker.request(TargetRequest::SelectTrack(id));
        see(&mut chain, &[80.0, 300.0]);
    }
    let frame = Frame { width: SIZE.0 as f32, height: SIZE.1 as f32 };
    let Tracker { policy, tracks, .. } = &chain.tracker;
    assert!(policy.ready(tracks, false, frame).any(|track| track.id == first));
}

#[test]
fn a_group_is_let_go_as_a_whole() {
    let mut chain = two(Config { choice: Choice::Group, ..config() });
    let group = see(&mut chain, &[80.0, 300.0]);
    assert!(group.is_group && NAMES.contains(&group.id), "{group:?}");
    chain.tracker.request(TargetRequest::Release);
    let released = see(&mut chain, &[80.0, 300.0]);
    assert_eq!(released.changes, [TargetChange::Released]);
    for _ in 0..20 {
        let after = see(&mut chain, &[80.0, 300.0]);
        assert_eq!((after.state, after.changes.len()), (TargetState::Searching, 0));
    }
    let again = (0..20).any(|_| see(&mut chain, &[80.0, 300.0]).is_group);
    assert!(again, "after a while");
}
