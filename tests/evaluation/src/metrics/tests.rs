// SPDX-License-Identifier: MPL-2.0

//! Cases computed by hand, in a picture of 80x60: its radius a is 50, so that distances are easy.

use proptest::prelude::*;

use super::*;
use crate::{
    record::{Bounds, Estimate, TargetState::*},
    report::made_up,
};

fn person(id: u32, centroid: (f64, f64)) -> GroundTruth {
    let bounds = Bounds { left: centroid.0 - 5.0, top: centroid.1 - 10.0, width: 10.0, height: 20.0 };
    let (visible, unhidden, in_view) = (1.0, 1.0, 1.0);
    GroundTruth { id, bounds, centroid, visible, unhidden, in_view, position_m: None, direction_deg: None }
}

fn says(state: TargetState, centroid: (f64, f64)) -> Option<Estimate> {
    let bounds = Bounds { left: centroid.0 - 5.0, top: centroid.1 - 10.0, width: 10.0, height: 20.0 };
    Some(Estimate { state, centroid, bounds, id: 1, features: 9 })
}

fn frame(truth: Option<GroundTruth>, estimate: Option<Estimate>) -> FrameRecord {
    let record = FrameRecord { truth, estimate, ..made_up::frame((80, 60)) };
    made_up::judged_by_boxes(record)
}

fn at(centroid: (f64, f64), estimate: Option<Estimate>) -> FrameRecord {
    frame(Some(person(1, centroid)), estimate)
}

fn seen(visible: f64, frame: FrameRecord) -> FrameRecord {
    let truth = frame.truth.map(|truth| GroundTruth { visible, unhidden: visible, ..truth });
    FrameRecord { truth, ..frame }
}

const MIDDLE: (f64, f64) = (40.0, 30.0);

/// Ten pictures a second.
fn timed(frames: impl IntoIterator<Item = FrameRecord>) -> Vec<FrameRecord> {
    frames
        .into_iter()
        .enumerate()
        .map(|(i, frame)| FrameRecord { time_s: i as f64 / 10.0, ..frame })
        .collect()
}

#[test]
fn precision_counts_only_what_is_said_to_be_tracked() {
    let frames = [
        at(MIDDLE, says(Tracking, (44.0, 39.0))),      // on the person
        at(MIDDLE, says(Tracking, (36.0, 21.0))),      // on the person
        at(MIDDLE, says(Tracking, (45.5, 30.0))),      // beside
        seen(0.0, at(MIDDLE, says(Tracking, MIDDLE))), // where the person is hidden
        frame(None, says(Tracking, MIDDLE)),           // nobody there
        at(MIDDLE, says(Occluded, MIDDLE)),            // says nothing
        at(MIDDLE, says(Searching, (0.0, 0.0))),       // says nothing
        at(MIDDLE, says(Lost, MIDDLE)),                // says nothing
        at(MIDDLE, None),                              // says nothing
    ];
    assert_eq!(precision(&frames), Some(2.0 / 5.0));
    assert_eq!(
        precision(&frames[5..]),
        None,
        "one that never tracks has no precision, rather than a good or bad one"
    );
    assert_eq!(precision(&[]), None);
}

#[test]
fn a_predicted_box_counts_as_tracked_where_it_is_asked_for() {
    let frames = [
        at(MIDDLE, says(Tracking, MIDDLE)),
        seen(0.0, at(MIDDLE, says(Occluded, MIDDLE))), // behind something, and foretold
        at(MIDDLE, says(Occluded, (60.0, 30.0))),
        at(MIDDLE, says(Lost, MIDDLE)), // says nothing
    ];
    assert_eq!(precision_predicted(&frames), Some(2.0 / 3.0));
    assert_eq!(precision_predicted(&frames[3..]), None);
}

#[test]
fn the_person_is_in_the_middle_when_they_stay_there_for_half_a_second() {
    // d_gc is 0.2, then 0.04 for 0.4 s, 0.2 again, and 0.04 from 0.9 s on.
    let far = |index: usize| index < 2 || (7..9).contains(&index);
    let frames = timed((0..20).map(|index| at((if far(index) { 50.0 } else { 42.0 }, 30.0), None)));
    assert_eq!(centred_after_s(&frames), Some(0.9));
    assert!((mean_dgc_centred(&frames).unwrap() - 0.04).abs() < 1e-9);
    assert_eq!((centred_after_s(&frames[..12]), mean_dgc_centred(&frames[..12])), (None, None));
}

#[test]
fn detection_precision_counts_frames_that_contain_the_target() {
    let right = says(Tracking, MIDDLE);
    let frames = [
        at(MIDDLE, right.clone()),
        at(MIDDLE, None),
        at(MIDDLE, says(Tracking, (0.0, 0.0))),
        seen(0.1, at(MIDDLE, right.clone())),
        seen(0.09, at(MIDDLE, right.clone())), // too little of them to count, though right
        seen(0.0, at(MIDDLE, None)),
    ];
    assert_eq!(detection_precision(&frames), Some(2.0 / 4.0));
    assert_eq!(detection_precision(&frames[5..]), None);
    assert_eq!(detection_precision(&[]), None);
}

#[test]
fn track_fragmentation_is_the_share_of_frames_with_the_target_outside() {
    let frames = [
        at((0.0, 0.0), None),
        at((79.9, 59.9), None),
        at((80.0, 30.0), None),
        at((40.0, -0.1), None),
        frame(None, None),
        seen(0.0, at(MIDDLE, None)), // hidden is not outside
        at(MIDDLE, None),
        at(MIDDLE, None),
    ];
    assert_eq!(track_fragmentation(&frames), Some(3.0 / 8.0));
    assert_eq!(track_fragmentation(&[]), None);
}

#[test]
fn distances_are_in_radii_and_diagonals() {
    let corner = at((80.0, 60.0), says(Tracking, (50.0, 20.0)));
    assert_eq!(d_gc(&corner), Some(1.0), "40 and 30 pixels from the middle: one radius");
    assert_eq!(d_gp(&corner), Some(0.5), "30 and 40 pixels from the estimate: half a diagonal");
    assert_eq!(d_gc(&at((46.0, 38.0), None)), Some(0.2));
    assert_eq!(d_gp(&at(MIDDLE, says(Occluded, MIDDLE))), None);
    assert_eq!(d_gp(&at(MIDDLE, None)), None);
    assert_eq!(d_gc(&frame(None, says(Tracking, MIDDLE))), None);
    assert_eq!(d_gp(&frame(None, says(Tracking, MIDDLE))), None);
}

#[test]
fn means_and_variances_are_over_frames_with_the_target_inside() {
    let run = run(vec![
        at((46.0, 38.0), says(Tracking, (46.0, 38.0))), // d_gc 0.2, d_gp 0
        at((52.0, 46.0), says(Tracking, (49.0, 42.0))), // d_gc 0.4, d_gp 0.05
        at((52.0, 46.0), None),                         // d_gc 0.4
        at((-100.0, 30.0), says(Tracking, (40.0, 30.0))), // outside
    ]);
    let metrics = Metrics::of(&run);
    let close = |value: Option<f64>, to: f64| assert!((value.unwrap() - to).abs() < 1e-12, "{value:?} {to}");
    close(metrics.mean_dgc, 1.0 / 3.0);
    close(metrics.var_dgc, 0.08 / 9.0);
    close(metrics.mean_dgp, 0.025);
    close(metrics.var_dgp, 0.000_625);
    assert_eq!((metrics.frames, metrics.frames_with_target), (4, 4));
}

#[test]
fn nothing_counted_gives_no_numbers() {
    assert_eq!(Metrics::of(&run(vec![])), Metrics::default());
    let never = Metrics::of(&run(vec![at(MIDDLE, None), at(MIDDLE, None)]));
    assert_eq!((never.precision, never.mean_dgp, never.var_dgp), (None, None, None));
    assert_eq!((never.time_to_acquire_s, never.identity_kept), (None, None));
    assert_eq!(
        (never.detection_precision, never.track_fragmentation, never.mean_dgc),
        (Some(0.0), Some(0.0), Some(0.0))
    );
}

#[test]
fn time_to_acquire_ends_with_the_first_frame_that_is_right() {
    let wrong = at(MIDDLE, says(Tracking, (0.0, 0.0)));
    let right = at(MIDDLE, says(Tracking, MIDDLE));
    let frames = timed([wrong.clone(), wrong.clone(), right.clone(), wrong.clone()]);
    assert_eq!(time_to_acquire_s(&frames), Some(0.2));
    assert_eq!(time_to_acquire_s(&frames[2..]), Some(0.0));
    assert_eq!(time_to_acquire_s(&frames[3..]), None);
}

#[test]
fn commands_are_counted_over_whole_periods() {
    let mut frames = timed(vec![at(MIDDLE, None); 20]);
    frames[0].commands = 3;
    frames[19].commands = 4;
    assert_eq!(commands_per_s(&frames, 10.0), Some(3.5));
    assert_eq!(commands_per_s(&[], 10.0), None);
}

/// Hidden from frame 10 to 19, so that the second looked at is frames 30 to 39; right in `right` of them.
fn comes_out(right: usize) -> Vec<FrameRecord> {
    timed((0..60).map(|index| match index {
        10..20 => seen(0.0, at(MIDDLE, says(Occluded, MIDDLE))),
        30..40 if index >= 30 + right => at(MIDDLE, says(Tracking, (0.0, 0.0))),
        _ => at(MIDDLE, says(Tracking, MIDDLE)),
    }))
}

#[test]
fn identity_is_kept_when_right_in_half_of_the_second_after_a_second() {
    assert_eq!(identity_kept(&comes_out(5)), Some(true));
    assert_eq!(identity_kept(&comes_out(4)), Some(false));
    assert_eq!(identity_kept(&comes_out(5)[..28]), None, "ended before it could be seen");
    assert_eq!(identity_kept(&comes_out(5)[20..]), None, "nobody was hidden");
    // A finger beside the screen ends no occlusion: what is said a second after it is not what counts.
    let mut finger = comes_out(10);
    finger[11] = FrameRecord { time_s: finger[11].time_s, ..seen(0.005, at(MIDDLE, says(Occluded, MIDDLE))) };
    for frame in &mut finger[20..30] {
        frame.estimate = says(Tracking, (0.0, 0.0));
    }
    assert_eq!(identity_kept(&finger), Some(true));
    let twice = timed(comes_out(10).into_iter().chain(comes_out(0)));
    assert_eq!(identity_kept(&twice), Some(false), "every time counts");
}

#[test]
fn another_person_under_the_point_is_a_switch() {
    let with_others = |tracked: (f64, f64)| {
        made_up::judged_by_boxes(FrameRecord {
            others: vec![person(2, (48.0, 30.0)), person(3, (70.0, 30.0))],
            ..at(MIDDLE, says(Tracking, tracked))
        })
    };
    let [target, both, second, third, nobody] =
        [(36.0, 30.0), (44.0, 30.0), (50.0, 30.0), (70.0, 30.0), (10.0, 10.0)].map(with_others);
    let switches =
        |frames: &[&FrameRecord]| identity_switches(&frames.iter().map(|f| (*f).clone()).collect::<Vec<_>>());
    assert_eq!(switches(&[&target, &both, &target]), Some(0), "in both boxes is on the target");
    assert_eq!(switches(&[&target, &nobody, &target]), Some(0));
    assert_eq!(switches(&[&target, &second, &third, &nobody, &third, &target]), Some(3));
    assert_eq!(identity_switches(&[at(MIDDLE, says(Tracking, MIDDLE))]), None);
}

#[test]
fn boxes_overlap() {
    let half_beside = at(MIDDLE, says(Tracking, (45.0, 30.0))); // 100 of 300 square pixels in common
    let frames = [
        half_beside,
        at(MIDDLE, says(Tracking, MIDDLE)),
        at(MIDDLE, None),
        at(MIDDLE, says(Tracking, (61.0, 30.0))),
    ];
    assert_eq!(success(&frames), Some((1.0 / 3.0 + 1.0) / 4.0));
    assert_eq!(box_precision(&frames), Some(0.5));
    assert_eq!((success(&[]), box_precision(&[])), (None, None));
    let apart = |x| box_precision(&[at(MIDDLE, says(Tracking, (x, 30.0)))]);
    assert_eq!((apart(60.0), apart(60.5)), (Some(1.0), Some(0.0)), "20 pixels are near");
    let hidden = [seen(0.0, at(MIDDLE, says(Occluded, MIDDLE)))];
    assert_eq!((success(&hidden), box_precision(&hidden)), (None, None), "no frame contains the target");
}

fn run(frames: Vec<FrameRecord>) -> Run {
    made_up::run(frames)
}

prop_compose! {
    fn any_frame()(
        person_at in (-100.0..200.0, -100.0..200.0), visible in 0.0..=1.0, there: bool,
        state in 0..4usize, estimate in (-100.0..200.0, -100.0..200.0), spoken: bool,
    ) -> FrameRecord {
        let estimate = says([Searching, Tracking, Occluded, Lost][state], estimate).filter(|_| spoken);
        let truth = there.then(|| person(1, person_at));
        seen(visible, frame(truth, estimate))
    }
}

proptest! {
    #[test]
    fn every_metric_stays_within_its_bounds(frames in prop::collection::vec(any_frame(), 0..40)) {
        let metrics = Metrics::of(&run(timed(frames)));
        let shares = [
            metrics.precision, metrics.detection_precision, metrics.track_fragmentation,
            metrics.success, metrics.box_precision,
            metrics.mean_dgc, // the middle of the person is inside, so at most one radius away
        ];
        prop_assert!(shares.into_iter().flatten().all(|share| (0.0..=1.0).contains(&share)));
        prop_assert!(metrics.mean_dgp.is_none_or(|mean| mean >= 0.0));
        prop_assert!([metrics.var_dgc, metrics.var_dgp].into_iter().flatten().all(|variance| variance >= 0.0));
        prop_assert!(metrics.frames_with_target <= metrics.frames);
    }
}
