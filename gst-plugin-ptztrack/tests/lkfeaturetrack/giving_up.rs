// SPDX-License-Identifier: MPL-2.0

//! `stationary-timeout` and `max-tracking-time`.

use gst::prelude::*;
use ptztrack_contract::{CameraEvent, ReleaseReason, TargetChange, TargetState};

use crate::bench::*;

const SECOND: u64 = 1_000_000_000;
/// Frames in a second.
const RATE: i32 = 25;
const PLACE: (i32, i32) = (140, 80);

/// A detector that finds people whether they move or not.
fn patient_for(property: &'static str, seconds: u64) -> Bench {
    Bench::new(|element| {
        element.set_property("roi-type", "person");
        element.set_property(property, seconds * SECOND);
    })
}

/// A frame in which people are detected.
fn show(bench: &mut Bench, pan: usize, people: &[(i32, i32)]) -> TargetState {
    let boxes =
        people.iter().map(|(x, y)| ("person", (*x as u32, *y as u32, PERSON.0 as u32, PERSON.1 as u32)));
    bench.push(street(pan, people.iter().copied()), &boxes.collect::<Vec<_>>()).state
}

/// So many frames with people by frame; what the tracker did in the last.
fn shown<const N: usize>(
    bench: &mut Bench,
    frames: i32,
    people: impl Fn(i32) -> [(i32, i32); N],
) -> TargetState {
    (1..=frames).map(|frame| show(bench, 0, &people(frame))).last().unwrap()
}

fn reasons(bench: &Bench) -> Vec<ReleaseReason> {
    bench.messages().into_iter().filter_map(|message| message.reason).collect()
}

/// Somebody stood until they were given up.
fn given_up() -> Bench {
    let mut bench = patient_for("stationary-timeout", 2);
    assert_eq!(shown(&mut bench, 2 * RATE, |_| [PLACE]), TargetState::Tracking);
    assert_eq!(shown(&mut bench, 5, |_| [PLACE]), TargetState::Searching);
    bench.messages();
    bench
}

#[test]
fn who_stands_is_released_once_and_not_taken_again() {
    let mut bench = patient_for("stationary-timeout", 2);
    assert_eq!(shown(&mut bench, 20 * RATE, |_| [PLACE]), TargetState::Searching);
    assert_eq!(bench.events(), [TargetState::Tracking, TargetState::Searching]);
    let messages = bench.messages();
    let told: Vec<_> = messages.iter().map(|message| (message.change, message.reason, message.id)).collect();
    let stationary = Some(ReleaseReason::Stationary);
    assert_eq!(told, [(TargetChange::Acquired, None, 1), (TargetChange::Released, stationary, 1)]);
    assert_eq!(messages[1].state, TargetState::Searching);
    assert!(messages[1].bounds.width > 0.0, "the message says where");
}

#[test]
fn nobody_is_given_up_without_being_told_to() {
    let mut bench = patient_for("stationary-timeout", 0);
    assert_eq!(shown(&mut bench, 20 * RATE, |_| [PLACE]), TargetState::Tracking);
    assert_eq!(bench.changes(), [TargetChange::Acquired]);
}

#[test]
fn who_sways_stands() {
    let mut bench = patient_for("stationary-timeout", 3);
    let sway = |frame: i32| [(PLACE.0 + (3.0 * (f64::from(frame) * 0.15).sin()).round() as i32, PLACE.1)];
    for frame in 1..=5 * RATE {
        let [place] = sway(frame);
        let mut pixels = street(0, [place]);
        // The noise of the sensor, and an arm that swings.
        for (index, pixel) in pixels.iter_mut().enumerate() {
            *pixel = pixel.saturating_add(texture(frame as usize, 5 * index, 0) / 20);
        }
        let arm = place.0 + 4 + (8.0 * (f64::from(frame) * 0.4).sin()) as i32;
        for y in (place.1 + 20)..(place.1 + 50) {
            pixels[y as usize * WIDTH + arm as usize..][..10].fill(90);
        }
        let bounds = (place.0 as u32, place.1 as u32, PERSON.0 as u32, PERSON.1 as u32);
        bench.push(pixels, &[("person", bounds)]);
    }
    assert_eq!(reasons(&bench), [ReleaseReason::Stationary]);
}

#[test]
fn who_walks_to_and_fro_does_not_stand() {
    let mut bench = patient_for("stationary-timeout", 2);
    let pace = |frame: i32| [(60 + (2 * frame % 280 - 140).abs(), PLACE.1)];
    assert_eq!(shown(&mut bench, 20 * RATE, pace), TargetState::Tracking);
    assert_eq!(bench.changes(), [TargetChange::Acquired]);
}

#[test]
fn who_stands_is_released_under_a_camera_that_turns() {
    let mut bench = patient_for("stationary-timeout", 2);
    shown(&mut bench, 5, |_| [(240, 80)]);
    (1..=3 * RATE).for_each(|frame| {
        show(&mut bench, 2 * frame as usize, &[(240 - 2 * frame, 80)]);
    });
    assert_eq!(reasons(&bench), [ReleaseReason::Stationary]);
}

#[test]
fn whom_the_camera_keeps_in_the_middle_does_not_stand() {
    let mut bench = patient_for("stationary-timeout", 2);
    shown(&mut bench, 5, |_| [PLACE]);
    let last = (1..=8 * RATE).map(|frame| show(&mut bench, 2 * frame as usize, &[PLACE])).last();
    assert_eq!(last, Some(TargetState::Tracking));
    assert_eq!(bench.changes(), [TargetChange::Acquired]);
}

#[test]
fn the_thesis_believes_the_servo_about_the_camera() {
    for moving in [false, true] {
        let mut bench = patient_for("stationary-timeout", 2);
        bench.harness.element().unwrap().set_property_from_str("profile", "thesis");
        for _ in 0..4 {
            // As a servo says it, again and again.
            bench.harness.push_upstream_event(CameraEvent { moving, ..CameraEvent::default() }.to_event());
            shown(&mut bench, RATE, |_| [PLACE]);
        }
        let expected: &[_] = if moving { &[] } else { &[ReleaseReason::Stationary] };
        assert_eq!(reasons(&bench), expected);
    }
}

#[test]
fn a_servo_that_says_nothing_more_is_not_believed_for_ever() {
    let mut bench = patient_for("stationary-timeout", 2);
    bench.harness.element().unwrap().set_property_from_str("profile", "thesis");
    bench.harness.push_upstream_event(CameraEvent { moving: true, ..CameraEvent::default() }.to_event());
    shown(&mut bench, 6 * RATE, |_| [PLACE]);
    assert_eq!(reasons(&bench), [ReleaseReason::Stationary]);
}

#[test]
fn who_moves_after_all_is_taken_again() {
    let mut bench = given_up();
    shown(&mut bench, 12, |frame| [(PLACE.0 + 2 * frame, PLACE.1)]);
    assert_eq!(bench.changes(), [], "less than the width of a person");
    assert_eq!(shown(&mut bench, 12, |frame| [(PLACE.0 + 24 + 2 * frame, PLACE.1)]), TargetState::Tracking);
    assert_eq!(bench.changes(), [TargetChange::Acquired]);
}

#[test]
fn who_comes_is_taken_at_once_while_the_other_still_stands() {
    let mut bench = given_up();
    assert_eq!(shown(&mut bench, 5, |frame| [PLACE, (30 + 2 * frame, 120)]), TargetState::Tracking);
    let newcomer = bench.messages().pop().unwrap();
    assert!(newcomer.bounds.x < 0.2, "{newcomer:?}");
}

#[test]
fn two_who_stand_are_given_up_one_after_the_other() {
    let mut bench = patient_for("stationary-timeout", 2);
    assert_eq!(shown(&mut bench, 20 * RATE, |_| [PLACE, (30, 120)]), TargetState::Searching);
    assert_eq!(reasons(&bench), [ReleaseReason::Stationary; 2]);
}

#[test]
fn who_was_given_up_stays_so_when_the_camera_turns() {
    let mut bench = given_up();
    for frame in 1..=40 {
        assert_eq!(
            show(&mut bench, 2 * frame, &[(PLACE.0 - 2 * frame as i32, PLACE.1)]),
            TargetState::Searching
        );
    }
    assert_eq!(bench.changes(), []);
}

#[test]
fn an_operator_selects_whom_the_tracker_gave_up() {
    let mut bench = given_up();
    let element = bench.harness.element().unwrap();
    element.emit_by_name::<()>("select-target", &[&(156.0 / 320.0), &(116.0 / 240.0)]);
    assert_eq!(shown(&mut bench, 5, |_| [PLACE]), TargetState::Tracking);
}

#[test]
fn the_longest_time_goes_to_nobody() {
    let walk = |frame: i32| (60 + (2 * frame % 280 - 140).abs(), PLACE.1);
    let mut bench = patient_for("max-tracking-time", 3);
    assert_eq!(shown(&mut bench, 3 * RATE, |frame| [walk(frame)]), TargetState::Tracking);
    // Released for three seconds, then taken again: they have moved.
    assert_eq!(shown(&mut bench, 2 * RATE, |frame| [walk(3 * RATE + frame)]), TargetState::Searching);
    assert_eq!(reasons(&bench), [ReleaseReason::MaxTrackingTime]);
    assert_eq!(shown(&mut bench, 2 * RATE, |frame| [walk(5 * RATE + frame)]), TargetState::Tracking);
}

#[test]
fn after_the_longest_time_somebody_else_has_a_turn() {
    let mut bench = patient_for("max-tracking-time", 3);
    assert_eq!(shown(&mut bench, 3 * RATE + 10, |_| [PLACE, (30, 120)]), TargetState::Tracking);
    let taken: Vec<_> = bench.messages().into_iter().filter(|m| m.change == TargetChange::Acquired).collect();
    assert_eq!(taken.len(), 2);
    assert!((taken[0].bounds.x - taken[1].bounds.x).abs() > 0.2, "{taken:?}");
    // Neither is taken again while they stand.
    assert_eq!(shown(&mut bench, 10 * RATE, |_| [PLACE, (30, 120)]), TargetState::Searching);
}

#[test]
fn the_limits_hold_from_when_they_are_set() {
    let mut bench = patient_for("stationary-timeout", 0);
    assert_eq!(shown(&mut bench, 4 * RATE, |_| [PLACE]), TargetState::Tracking);
    bench.harness.element().unwrap().set_property("stationary-timeout", 2 * SECOND);
    assert_eq!(show(&mut bench, 0, &[PLACE]), TargetState::Searching);
}

#[test]
fn a_release_by_hand_says_so() {
    let mut bench = patient_for("stationary-timeout", 2);
    shown(&mut bench, 5, |_| [PLACE]);
    bench.harness.element().unwrap().emit_by_name::<()>("release-target", &[]);
    show(&mut bench, 0, &[PLACE]);
    assert_eq!(reasons(&bench), [ReleaseReason::Request]);
}

#[test]
fn with_the_motion_detector_who_walks_on_is_followed_on() {
    init();
    let mut bench = Bench::of(gst_check::Harness::new_parse(
        "bgavgdetect ! lkfeaturetrack stationary-timeout=2000000000",
    ));
    let mut at = |seconds: i32, from: i32, step: i32| {
        (1..=seconds * RATE)
            .map(|frame| bench.push(street(0, [(from + step * frame, PLACE.1)]), &[]).state)
            .collect::<Vec<_>>()
    };
    let nobody = at(4, -100, 0);
    assert!(nobody.iter().all(|state| *state == TargetState::Searching));
    assert_eq!(at(2, 0, 2).last(), Some(&TargetState::Tracking));
    let stands = at(12, 100, 0);
    assert!(stands.starts_with(&[TargetState::Tracking; 40]));
    assert!(stands[3 * RATE as usize..].iter().all(|state| *state == TargetState::Searching));
    assert_eq!(at(2, 100, 2).last(), Some(&TargetState::Tracking));
    assert_eq!(reasons(&bench), [ReleaseReason::Stationary]);
}
