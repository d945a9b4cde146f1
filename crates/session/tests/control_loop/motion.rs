// SPDX-License-Identifier: MPL-2.0

//! How well the whole servo moves, in closed loop.

use std::time::Duration;

use super::closed_loop::{ASPECT, Run, Setup};
use servo::{Mode, PanTilt};
use session::LoopEvent;

/// Delay in milliseconds, and magnification.
const CASES: [(u64, f64); 4] = [(100, 1.0), (300, 1.0), (100, 10.0), (300, 10.0)];

/// Degrees per second that look as fast at any magnification.
fn brisk(magnification: f64) -> f64 {
    12.0 / magnification
}

/// A target with its pan over time, in degrees; it stands 20 degrees high.
fn pan(path: impl Fn(f64) -> f64) -> impl Fn(f64) -> (PanTilt, f64) {
    move |time| (PanTilt::new(path(time), 0.0), 20.0)
}

/// What it has walked at a speed that changes over time.
fn walked(speed: impl Fn(f64) -> f64) -> impl Fn(f64) -> f64 {
    const STEP_S: f64 = 0.01;
    move |time| (0..(time / STEP_S) as u32).map(|step| speed(f64::from(step) * STEP_S) * STEP_S).sum()
}

/// To and fro, 6 s each way; turning takes about a second, as it takes people.
fn pacing(speed: f64) -> impl Fn(f64) -> f64 {
    walked(move |time| speed * (4.0 * (time / 12.0 * std::f64::consts::TAU).sin()).clamp(-1.0, 1.0))
}

/// 5 s one way, 3 s of rest, and back, for ever; starting and stopping take half a second.
fn errand(speed: f64) -> impl Fn(f64) -> f64 {
    walked(move |time| {
        let phase = time % 8.0;
        let pace = (phase / 0.5).min((5.5 - phase) / 0.5).clamp(0.0, 1.0);
        if time % 16.0 < 8.0 { speed * pace } else { -speed * pace }
    })
}

/// How often the target changes sides, by more than the part of the picture.
fn crossings(run: &Run, part: f64, from_s: f64) -> usize {
    let sides: Vec<f64> = run
        .frames_between(from_s, f64::INFINITY)
        .map(|frame| frame.offset.x)
        .filter(|x| x.abs() > part)
        .map(f64::signum)
        .collect();
    sides.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

#[test]
fn a_walking_person_is_kept_in_the_middle() {
    for (delay, zoom) in CASES {
        let run = Setup::new(delay, zoom).run(15.0, pan(|t| brisk(zoom) * t));
        assert!(run.mean_offset(3.0, 15.0) < 0.01, "{delay} ms, {zoom}x: {}", run.mean_offset(3.0, 15.0));
    }
}

/// Too little for a camera at rest to move for.
#[test]
fn while_it_pans_little_offsets_of_tilt_are_corrected_too() {
    for (delay, zoom) in CASES {
        let tilt = 1.3 / zoom;
        let run = Setup::new(delay, zoom).run(10.0, |t| (PanTilt::new(brisk(zoom) * t, tilt), 20.0));
        let last = run.frames.last().unwrap().offset.y.abs() / ASPECT;
        assert!(last < 0.011, "{delay} ms, {zoom}x: {last} of the width");
    }
}

#[test]
fn a_step_in_the_targets_speed_neither_overshoots_nor_oscillates() {
    for (delay, zoom) in CASES {
        for first in [0.0, 0.5, -0.5] {
            let speed = brisk(zoom);
            let path = |t: f64| speed * if t < 5.0 { first * t } else { first * 5.0 + t - 5.0 };
            let run = Setup::new(delay, zoom).run(15.0, pan(path));
            let overshoot = run.farthest(-1.0, 5.0, 15.0);
            assert!(overshoot < 0.1, "{delay} ms, {zoom}x, from {first}: {overshoot} of the half width");
            assert!(crossings(&run, 0.015, 5.0) <= 1, "{delay} ms, {zoom}x, from {first}");
            assert_eq!(
                run.reports.iter().filter(|report| matches!(report, LoopEvent::Oscillating(_))).count(),
                0
            );
        }
    }
}

#[test]
fn a_camera_that_takes_long_to_answer_is_turned_no_farther_than_the_target() {
    for round_trip_ms in [500, 1000, 2000] {
        let round_trip = Duration::from_millis(round_trip_ms);
        let run = Setup { round_trip, ..Setup::new(200, 1.0) }.run(20.0, pan(|_| 15.0));
        let overshoot = run.farthest(-1.0, 0.0, 20.0);
        assert!(overshoot < 0.05, "{round_trip_ms} ms: {overshoot} of the half width");
        assert!(run.mean_offset(10.0, 20.0) < 0.03, "{round_trip_ms} ms");
    }
}

#[test]
fn three_times_the_delay_is_not_half_as_much_again_off_the_middle() {
    for zoom in [1.0, 10.0] {
        let offset = |delay| {
            let setup = Setup { jitter: 0.005, ..Setup::new(delay, zoom) };
            setup.run(15.0, pan(|t| brisk(zoom) * t)).mean_offset(3.0, 15.0)
        };
        let (short, long) = (offset(100), offset(300));
        assert!(long <= 1.5 * short, "{zoom}x: {short} and {long}");
    }
}

/// Nobody knows of a turn before it can be seen: there it is the distance itself that is small.
#[test]
fn somebody_who_starts_stops_and_turns_is_kept_in_the_middle() {
    for (delay, zoom) in CASES {
        for path in [Box::new(errand(brisk(zoom))) as Box<dyn Fn(f64) -> f64>, Box::new(pacing(brisk(zoom)))]
        {
            let setup = Setup { jitter: 0.005, ..Setup::new(delay, zoom) };
            let offset = setup.run(48.0, pan(path)).mean_offset(4.0, 48.0);
            assert!(offset < 0.015, "{delay} ms, {zoom}x: {offset}");
        }
    }
}

#[test]
fn the_sway_of_a_walk_is_not_swung_after() {
    for (delay, zoom) in CASES {
        for steps_hz in [1.0, 2.0] {
            let sway = |t: f64| 0.025 * (t * std::f64::consts::TAU * steps_hz).sin();
            let run = Setup { jitter: 0.003, ..Setup::new(delay, zoom) }
                .run(30.0, pan(|t| brisk(zoom) * (t + sway(t))));
            let offset = run.mean_offset(3.0, 30.0);
            assert!(offset < 0.015, "{delay} ms, {zoom}x, {steps_hz} Hz: {offset}");
            assert!(!run.reports.iter().any(|report| matches!(report, LoopEvent::Oscillating(_))));
        }
    }
}

#[test]
fn a_standing_person_is_let_be_though_the_tracker_trembles() {
    for (delay, zoom) in CASES {
        for noisy_velocity in [false, true] {
            let setup = Setup { jitter: 0.01, noisy_velocity, ..Setup::new(delay, zoom) };
            let run = setup.run(70.0, pan(|_| 10.0 / zoom));
            assert_eq!(run.commands_between(10.0, 70.0), 0, "{delay} ms, {zoom}x, {:?}", run.commands);
            assert!(run.mean_offset(10.0, 70.0) < 0.03);
        }
    }
}

#[test]
fn somebody_who_goes_to_and_fro_is_no_swing_of_the_loop() {
    for (delay, zoom) in CASES {
        for rhythm in [0.7, 1.0, 1.5, 2.0] {
            let run = Setup { jitter: 0.003, ..Setup::new(delay, zoom) }
                .run(60.0, pan(|t| 10.0 / zoom * (rhythm * t).sin()));
            let said =
                run.reports.iter().filter(|report| matches!(report, LoopEvent::Oscillating(_))).count();
            assert_eq!(said, 0, "{delay} ms, {zoom}x, {rhythm} rad/s");
        }
    }
}

#[test]
fn coarse_speed_steps_make_no_limit_cycle() {
    // Its slowest is 4.5 degrees per second, nearly a picture's width.
    for delay in [100, 300] {
        let mut setup = Setup { jitter: 0.003, ..Setup::new(delay, 10.0) };
        setup.kinematics.speed_map = virtual_camera::SpeedMap::Linear { max_deg_s: 450.0 };
        setup.settings.speed_curve = servo::SpeedCurve::Linear;
        let run = setup.run(70.0, pan(|_| 1.0));
        assert_eq!(run.commands_between(10.0, 70.0), 0, "{:?}", run.commands);
    }
}

#[test]
fn a_loop_that_swings_is_calmed_and_said_so() {
    let mut setup = Setup::new(900, 1.0);
    setup.settings.learn = false;
    setup.settings.latency = Duration::from_millis(50);
    setup.settings.gain = 3.0;
    setup.settings.dead_zone = 0.01;
    let run = setup.run(60.0, pan(|_| 8.0));
    assert!(
        run.reports.iter().any(|report| matches!(report, LoopEvent::Oscillating(_))),
        "{:?}",
        run.reports
    );
    assert!(run.farthest(1.0, 0.0, 10.0) > 0.2);
    assert!(
        run.farthest(1.0, 30.0, 60.0) < 0.1 && run.farthest(-1.0, 30.0, 60.0) < 0.1,
        "{}",
        run.farthest(-1.0, 30.0, 60.0)
    );
}

/// Steeply below the camera, and all but below it.
const STEEP_DEG: [f64; 2] = [-75.0, -88.0];

/// How often the camera turns to the other side, by pan so fast that nobody overlooks it.
fn swings(run: &Run) -> usize {
    let sides: Vec<f64> = run
        .frames
        .iter()
        .map(|frame| frame.rate.pan)
        .filter(|rate| rate.abs() > 10.0)
        .map(f64::signum)
        .collect();
    sides.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

#[test]
fn a_person_who_stands_below_is_let_be_too() {
    for tilt in STEEP_DEG {
        for (delay, zoom) in CASES {
            for noisy_velocity in [false, true] {
                let pose = PanTilt::new(3.0, tilt + 5.0 / zoom);
                let setup = Setup { jitter: 0.01, noisy_velocity, pose, ..Setup::new(delay, zoom) };
                let run = setup.run(70.0, |_| (PanTilt::new(0.0, tilt), 20.0));
                assert_eq!(run.commands_between(10.0, 70.0), 0, "{tilt} degrees, {delay} ms, {zoom}x");
                assert!(run.mean_offset(10.0, 70.0) < 0.03, "{tilt} degrees, {delay} ms, {zoom}x");
            }
        }
    }
}

#[test]
fn by_steps_too_a_person_who_stands_below_is_let_be() {
    for mode in [Mode::Absolute, Mode::Centre] {
        for tilt in STEEP_DEG {
            let pose = PanTilt::new(3.0, tilt + 5.0);
            let mut setup = Setup { jitter: 0.01, pose, ..Setup::new(300, 1.0) };
            setup.settings.mode = mode;
            let run = setup.run(70.0, |_| (PanTilt::new(0.0, tilt), 20.0));
            assert_eq!(run.commands_between(10.0, 70.0), 0, "{mode:?}, {tilt} degrees");
            assert!(run.mean_offset(10.0, 70.0) < 0.03, "{mode:?}, {tilt} degrees");
        }
    }
}

/// Who stands beyond the nadir is as far away to the left as to the right, and by the tremble now here, now there.
#[test]
fn to_who_stands_beyond_the_nadir_it_turns_one_way_round() {
    for delay in [100, 300] {
        for seed in 1..=8 {
            let pose = PanTilt::new(0.0, -82.0);
            let setup = Setup { jitter: 0.01, seed, pose, ..Setup::new(delay, 1.0) };
            let run = setup.run(20.0, |_| (PanTilt::new(180.0, -80.0), 20.0));
            assert!(swings(&run) <= 1, "{delay} ms, run {seed}: {}", swings(&run));
            assert!(run.mean_offset(8.0, 20.0) < 0.03, "{delay} ms, run {seed}");
        }
    }
}

/// Somebody who walks past 3 m below the camera, when nearest in a direction so steep.
fn past(nearest_deg: f64) -> impl Fn(f64) -> PanTilt {
    move |time| {
        let (height, aside) = (3.0f64, 3.0 / nearest_deg.abs().to_radians().tan());
        let along = 1.2 * (time - 5.0);
        PanTilt::new(along.atan2(aside).to_degrees(), -height.atan2(along.hypot(aside)).to_degrees())
    }
}

/// In view even where no head turns as fast as pan would have to: there it may go too far once, and back.
#[test]
fn a_person_who_walks_past_below_is_followed_without_a_swing() {
    for (tilt, (farthest, most_swings)) in STEEP_DEG.into_iter().zip([(0.12, 0), (0.4, 3)]) {
        for delay in [100, 300] {
            let path = past(tilt);
            let setup = Setup { jitter: 0.005, pose: path(0.0), ..Setup::new(delay, 1.0) };
            let run = setup.run(12.0, |time| (path(time), 20.0));
            let offsets = run.frames.iter().map(|frame| frame.offset.x.hypot(frame.offset.y / ASPECT));
            let far = offsets.fold(0.0, f64::max);
            assert!(far < farthest, "{tilt} degrees, {delay} ms: {far}");
            assert!(swings(&run) <= most_swings, "{tilt} degrees, {delay} ms: {}", swings(&run));
            assert!(!run.reports.iter().any(|report| matches!(report, LoopEvent::Oscillating(_))));
            let after = run.mean_offset(9.0, 12.0);
            assert!(after < 0.04, "{tilt} degrees, {delay} ms: {after}");
        }
    }
}
