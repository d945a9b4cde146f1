// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use proptest::prelude::*;
use ptztrack_contract::{CameraMotion, Homography, Point};

use super::CameraMotionEstimator;
use super::estimator::to_pixels;
use crate::vision::synthetic::{Canvas, hash, texture};

const SIZE: (usize, usize) = (320, 180);
const STEP: Duration = Duration::from_millis(40);

/// The motion of a camera that turns by so many pixels and zooms: `perspective` is that of a picture 60
/// degrees wide.
fn turned(x: f64, y: f64, zoom: f64, roll: f64) -> Homography {
    let focal = 277.0;
    let (cos, sin) = (zoom * roll.cos(), zoom * roll.sin());
    let centred =
        Homography([[cos, -sin, x], [sin, cos, y], [-x / (focal * focal), -y / (focal * focal), 1.0]]);
    let middle = Homography::translation(-160.0, -90.0);
    middle.then(&centred).then(&Homography::translation(160.0, 90.0))
}

fn world(x: f64, y: f64) -> f64 {
    texture(1, x, y)
}

fn seen(motion: &Homography, seed: u32) -> Canvas {
    Canvas::seen(SIZE, motion, world).noisy(2.0, seed)
}

fn measure(estimator: &mut CameraMotionEstimator, picture: &Canvas) -> Option<CameraMotion> {
    estimator.update(&picture.luma(), None, None, STEP).expect("OpenCV")
}

/// How far the measured motion is off at most, pixels, nine places over.
fn error(measured: &CameraMotion, truth: &Homography) -> f64 {
    let measured = to_pixels(&measured.homography, (SIZE.0 as f64, SIZE.1 as f64));
    let places = (0..9).map(|n| Point { x: f64::from(n % 3) * 159.0, y: f64::from(n / 3) * 89.0 });
    let off = |place: Point| {
        let (a, b) = (measured.apply(place), truth.apply(place));
        (a.x - b.x).hypot(a.y - b.y)
    };
    places.map(off).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn turns_and_zooms_are_measured(
        x in -14.0..14.0, y in -10.0..10.0, zoom in 0.97..1.03, roll in -0.02..0.02, seed in any::<u32>(),
    ) {
        let truth = turned(x, y, zoom, roll);
        let mut estimator = CameraMotionEstimator::default();
        prop_assert_eq!(measure(&mut estimator, &seen(&Homography::IDENTITY, seed)), None);
        let motion = measure(&mut estimator, &seen(&truth, seed ^ 1)).expect("textured everywhere");
        prop_assert!(error(&motion, &truth) < 0.4, "{} pixels off", error(&motion, &truth));
    }
}

#[test]
fn a_camera_at_rest_does_not_drift() {
    let mut estimator = CameraMotionEstimator::default();
    let mut sum = Homography::IDENTITY;
    for seed in 0..40 {
        if let Some(motion) = measure(&mut estimator, &seen(&Homography::IDENTITY, seed)) {
            sum = sum.then(&motion.homography);
        }
    }
    let total = CameraMotion { homography: sum, ..CameraMotion::default() };
    assert!(error(&total, &Homography::IDENTITY) < 0.1);
}

#[test]
fn somebody_who_fills_half_the_picture_and_goes_along_is_not_taken_for_the_world() {
    let mut estimator = CameraMotionEstimator::default();
    for step in 0..12 {
        let pan = turned(-4.0 * f64::from(step), 0.0, 1.0, 0.0);
        let mut picture = Canvas::seen(SIZE, &pan, world);
        // The camera follows: they stay in the middle.
        let width = 40.0 + 10.0 * f64::from(step);
        picture.paint((160.0 - width / 2.0, 10.0, width, 170.0), |x, y| texture(9, x + width / 2.0, y));
        let motion = measure(&mut estimator, &picture.noisy(2.0, step));
        if step > 0 {
            let before = turned(-4.0 * f64::from(step - 1), 0.0, 1.0, 0.0);
            let truth = before.inverse().expect("a camera").then(&pan);
            assert!(error(&motion.expect("seen"), &truth) < 1.0, "{step}");
        }
    }
}

#[test]
fn a_fast_pan_is_followed_through_its_blur() {
    let mut estimator = CameraMotionEstimator::default();
    let mut at = 0.0;
    for (step, speed) in [0.0, 5.0, 10.0, 16.0, 20.0, 20.0, 20.0].into_iter().enumerate() {
        at += speed;
        let picture =
            Canvas::seen(SIZE, &Homography::translation(at, 0.0), world).blurred(speed as usize / 2);
        let motion = measure(&mut estimator, &picture.noisy(2.0, step as u32));
        if step > 0 {
            let truth = Homography::translation(speed, 0.0);
            let motion = motion.unwrap_or_else(|| panic!("lost at {step}"));
            assert!(error(&motion, &truth) < 1.0, "{step}: {}", error(&motion, &truth));
        }
    }
}

#[test]
fn what_the_camera_was_told_helps_over_a_jump() {
    let jump = Homography::translation(70.0, 0.0);
    let motion = |expected| {
        let mut estimator = CameraMotionEstimator::default();
        measure(&mut estimator, &seen(&Homography::IDENTITY, 1));
        estimator.update(&seen(&jump, 2).luma(), None, expected, STEP).expect("OpenCV")
    };
    assert!(motion(None).is_none_or(|motion| error(&motion, &jump) > 10.0));
    let told = Homography::translation(66.0 / SIZE.0 as f64, 0.0);
    assert!(error(&motion(Some(told)).expect("seen"), &jump) < 0.4);
}

#[test]
fn a_blank_wall_and_a_cut_tell_nothing() {
    let mut estimator = CameraMotionEstimator::default();
    for seed in 0..5 {
        assert_eq!(measure(&mut estimator, &blank(seed)), None);
    }
    measure(&mut estimator, &seen(&Homography::IDENTITY, 1));
    let other = Canvas::seen(SIZE, &Homography::IDENTITY, |x, y| texture(77, x, y));
    assert_eq!(measure(&mut estimator, &other), None);
    assert!(measure(&mut estimator, &other).is_some(), "and goes on from there");
}

/// A wall without texture, as a flash or fog shows it.
fn blank(seed: u32) -> Canvas {
    Canvas::seen(SIZE, &Homography::IDENTITY, |_, _| 120.0).noisy(2.0, seed)
}

/// One that has seen ten pictures of a pan of 3 pixels each.
fn panning() -> CameraMotionEstimator {
    let mut estimator = CameraMotionEstimator::default();
    for step in 0..10 {
        measure(&mut estimator, &seen(&Homography::translation(-3.0 * f64::from(step), 0.0), step));
    }
    estimator
}

#[test]
fn where_a_picture_tells_nothing_the_camera_goes_on_and_nothing_of_its_way_is_lost() {
    let mut estimator = panning();
    assert_eq!(estimator.coasted(), None, "its motion was seen");
    let mut total = Homography::IDENTITY;
    for seed in 0..4 {
        assert_eq!(measure(&mut estimator, &blank(seed)), None);
        total = total.then(&estimator.coasted().expect("it goes on"));
    }
    // Meanwhile it has stopped: from picture 9 on it has come 6 pixels farther, not 15.
    let motion = measure(&mut estimator, &seen(&Homography::translation(-33.0, 0.0), 20)).expect("textured");
    assert_eq!(estimator.coasted(), None);
    let whole = CameraMotion { homography: total.then(&motion.homography), ..CameraMotion::default() };
    let truth = Homography::translation(-6.0, 0.0);
    assert!(error(&whole, &truth) < 0.4, "{} pixels off", error(&whole, &truth));
}

#[test]
fn a_camera_that_is_not_seen_to_move_for_long_is_taken_to_rest() {
    let mut estimator = panning();
    let coasted = (0..20).map(|seed| {
        assert_eq!(measure(&mut estimator, &blank(seed)), None);
        estimator.coasted().is_some()
    });
    let coasted: Vec<bool> = coasted.collect();
    assert!(coasted[..7].iter().all(|coasted| *coasted), "{coasted:?}");
    assert!(!coasted[7..].contains(&true), "{coasted:?}");
}

/// The same pan by night, with rain in the camera's light: bright and two pixels wide.
fn rainy(step: u32) -> Canvas {
    let pan = Homography::translation(-3.0 * f64::from(step), 0.0);
    let mut picture = Canvas::seen(SIZE, &pan, |x, y| 20.0 + 0.2 * world(x, y));
    for drop in 0..250 {
        let place = |salt: i32, range: usize| hash(step, drop, salt) * range as f64;
        picture.paint((place(1, SIZE.0), place(2, SIZE.1), 2.0, 14.0), |_, _| 160.0);
    }
    picture.noisy(1.0, step)
}

#[test]
fn a_pan_is_followed_through_rain_by_night() {
    let mut estimator = CameraMotionEstimator::default();
    let truth = Homography::translation(-3.0, 0.0);
    for step in 0..40 {
        let motion = measure(&mut estimator, &rainy(step));
        if step >= 12 {
            let motion = motion.unwrap_or_else(|| panic!("lost at {step}"));
            assert!(error(&motion, &truth) < 1.0, "{step}: {}", error(&motion, &truth));
        }
    }
    // The rain stops.
    let dry = |step: u32| seen(&Homography::translation(-3.0 * f64::from(step), 0.0), step);
    assert_eq!(measure(&mut estimator, &dry(40)), None, "another view");
    assert!(error(&measure(&mut estimator, &dry(41)).expect("textured"), &truth) < 0.4);
}

#[test]
fn a_cut_while_it_turns_is_gone_on_from_with_the_second_picture() {
    let mut estimator = panning();
    let other = |step: u32| {
        let at = f64::from(step);
        Canvas::seen(SIZE, &Homography::translation(-3.0 * at, 0.0), |x, y| texture(77, x, y))
            .noisy(2.0, step)
    };
    assert_eq!(measure(&mut estimator, &other(0)), None);
    assert!(!estimator.may_be_elsewhere(), "it may be a picture that tells nothing");
    let motion = measure(&mut estimator, &other(1)).expect("textured");
    assert!(estimator.may_be_elsewhere());
    assert!(error(&motion, &Homography::translation(-3.0, 0.0)) < 0.4);
}

#[test]
fn pictures_of_another_size_are_a_new_beginning() {
    let mut estimator = panning();
    assert_eq!(measure(&mut estimator, &blank(0)), None);
    let smaller = |step: u32| {
        Canvas::seen((240, 136), &Homography::translation(-3.0 * f64::from(step), 0.0), world)
            .noisy(2.0, step)
    };
    assert_eq!(measure(&mut estimator, &smaller(0)), None);
    assert!(estimator.coasted().is_none() && estimator.may_be_elsewhere());
    assert!(measure(&mut estimator, &smaller(1)).is_some());
}
