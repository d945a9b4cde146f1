// SPDX-License-Identifier: MPL-2.0

//! What is learned of a camera that is otherwise than it was taken for, in closed loop.

use std::ops::Range;
use std::time::Duration;

use super::closed_loop::{Run, Setup, WIDE_FOV_DEG};
use super::pan_level;
use servo::{PanTilt, SpeedCurve};
use virtual_camera::{Kinematics, Limits, SpeedMap};

type Walk = fn(f64) -> (PanTilt, f64);

/// Somebody who paces to and fro, 4 s each way, at up to 12 degrees per second.
fn pacing(time_s: f64) -> (PanTilt, f64) {
    const TURN: f64 = std::f64::consts::TAU / 8.0;
    (PanTilt::new(12.0 / TURN * (1.0 - (TURN * time_s).cos()), 0.0), 20.0)
}

/// Somebody who goes somewhere, waits, comes back by another way, and goes again.
fn errand(time_s: f64) -> (PanTilt, f64) {
    let there = [(3.0, 8.0, -1.0), (2.0, 0.0, 0.0)];
    let back = [(3.5, -11.0, 1.5), (1.5, 0.0, 0.0), (3.0, 5.0, -0.5), (1.0, 0.0, 0.0)];
    along(&[there.as_slice(), &back].concat(), time_s)
}

/// Somebody who goes one way, faster and faster, and stops now and then.
fn one_way(time_s: f64) -> (PanTilt, f64) {
    let first = [(4.0, 6.0, 0.0), (1.5, 0.0, 0.0), (3.0, 10.0, 0.0)];
    along(&[first.as_slice(), &[(2.0, 0.0, 0.0), (3.0, 12.0, 0.0), (1.0, 0.0, 0.0)]].concat(), time_s)
}

const WALKS: [(&str, Walk); 3] = [("pacing", pacing), ("errand", errand), ("one way", one_way)];

/// Legs again and again: seconds, and degrees per second of pan and tilt.
fn along(legs: &[(f64, f64, f64)], time_s: f64) -> (PanTilt, f64) {
    let (mut left_s, mut place) = (time_s, PanTilt::default());
    for (seconds, pan, tilt) in legs.iter().cycle().take(100) {
        let lasted_s = left_s.clamp(0.0, *seconds);
        place = place + PanTilt::new(*pan, *tilt) * lasted_s;
        left_s -= lasted_s;
    }
    (place, 20.0)
}

/// Each with other noise.
const RUNS: u64 = 8;

/// A camera with so much delay and the noise of a real tracker, of which the servo is then told this.
fn setup(delay_ms: u64, run: u64, lie: impl Fn(&mut Setup)) -> Setup {
    let noise =
        Setup { jitter: 0.003, ground_jitter: 0.005, sees_beyond: false, ..Setup::new(delay_ms, 1.0) };
    let mut setup = Setup { seed: run.wrapping_mul(0x9E37_79B9_7F4A_7C15), ..noise };
    lie(&mut setup);
    setup
}

/// The steps that the camera was turned with for more than a second, when it had been followed for 8 s.
fn used_steps(run: &Run) -> impl Iterator<Item = i8> {
    let mut seconds = [0.0; 101];
    for pair in run.commands.windows(2).filter(|pair| pair[0].0 > 8.0) {
        seconds[usize::from(pan_level(&pair[0].1).unsigned_abs())] += pair[1].0 - pair[0].0;
    }
    (1..=100).filter(move |step| seconds[*step as usize] > 1.0)
}

/// After 20 s of each walk, with each noise. `speeds`: in which parts of the right ones those that were used are.
fn assert_right(
    case: &str,
    delay_ms: u64,
    walks: &[(&str, Walk)],
    speeds: Range<f64>,
    lie: impl Fn(&mut Setup),
) {
    for (walk, way) in walks {
        for run in 1..=RUNS {
            let setup = setup(delay_ms, run, &lie);
            let (real, case) =
                (setup.kinematics.speed_map.clone(), format!("{case}, {delay_ms} ms, {walk}, run {run}"));
            let delay_s = (setup.video_delay + setup.kinematics.command_delay).as_secs_f64();
            let run = setup.run(20.0, way);
            let estimates = run.estimates.unwrap();
            let off_s = (estimates.delays.sum().as_secs_f64() - delay_s).abs();
            // Of a short one, what lies within a picture.
            assert!(off_s < (0.1 * delay_s).max(0.04), "{case}: latency {:?}", estimates.delays.sum());
            let fov = estimates.fov_deg / WIDE_FOV_DEG;
            assert!((0.9..1.1).contains(&fov), "{case}: field of view {fov}");
            // Slower ones are told by no picture.
            let used = used_steps(&run).filter(|step| real.deg_s(f64::from(*step)) >= 2.0);
            let parts: Vec<_> =
                used.map(|step| (step, estimates.map.deg_s(step) / real.deg_s(f64::from(step)))).collect();
            assert!(!parts.is_empty(), "{case}: it was not followed");
            assert!(parts.iter().all(|(_, part)| speeds.contains(part)), "{case}: {parts:?}");
        }
    }
}

const TENTH: Range<f64> = 0.9..1.1;

fn late(setup: &mut Setup) {
    setup.settings.latency += Duration::from_millis(300);
}

fn early(setup: &mut Setup) {
    setup.settings.latency -= Duration::from_millis(300);
}

fn linear(setup: &mut Setup) {
    setup.settings.speed_curve = SpeedCurve::Linear;
}

fn wide(setup: &mut Setup) {
    setup.settings.fov_deg = Some(1.3 * WIDE_FOV_DEG);
}

fn narrow(setup: &mut Setup) {
    setup.settings.fov_deg = Some(0.7 * WIDE_FOV_DEG);
}

#[test]
fn a_camera_taken_for_what_it_is_stays_so() {
    assert_right("right", 100, &WALKS, TENTH, |_| {});
    assert_right("right", 300, &WALKS, TENTH, |_| {});
}

#[test]
fn the_latency_is_found_within_20_s() {
    assert_right("late", 100, &WALKS, TENTH, late);
    assert_right("late", 300, &WALKS, TENTH, late);
    assert_right("early", 400, &WALKS, TENTH, early);
}

/// At first it is off the middle, where every camera is turned fast.
#[test]
fn a_longer_latency_is_found_before_the_loop_swings() {
    for (delay_ms, sees_ground) in [(300, true), (400, true), (300, false)] {
        let mut setup = Setup { jitter: 0.003, sees_ground, ..Setup::new(delay_ms, 1.0) };
        setup.settings.latency = Duration::from_millis(200);
        let run = setup.run(10.0, |time| (PanTilt::new(18.0 + 3.0 * time, 0.0), 20.0));
        let offset = run.mean_offset(3.0, 10.0);
        assert!(offset < 0.02, "{delay_ms} ms, {sees_ground}: {offset}");
        assert!(
            run.farthest(-1.0, 0.0, 10.0) < 0.2,
            "{delay_ms} ms, {sees_ground}: {}",
            run.farthest(-1.0, 0.0, 10.0)
        );
    }
}

#[test]
fn the_field_of_view_is_found_within_20_s() {
    assert_right("wide", 100, &WALKS, TENTH, wide);
    assert_right("wide", 300, &WALKS, TENTH, wide);
    assert_right("narrow", 100, &WALKS, TENTH, narrow);
    assert_right("narrow", 300, &WALKS, TENTH, narrow);
}

#[test]
fn the_speed_map_is_found_within_20_s() {
    assert_right("linear", 100, &WALKS, TENTH, linear);
    assert_right("linear", 300, &WALKS, TENTH, linear);
}

/// Of curves that no floor bends, taken for a cubic one.
#[test]
fn any_growing_speed_map_is_found_within_20_s() {
    type Curve = fn(f64) -> f64;
    let curves: [(&str, Curve); 3] = [
        ("in proportion", |step| 1.0 * step),
        ("twice as fast", |step| 2.0 * step),
        ("by the root", |step| 6.0 * step.sqrt()),
    ];
    for (curve, deg_s) in curves {
        for delay_ms in [100, 300] {
            assert_right(curve, delay_ms, &WALKS, TENTH, |setup| {
                let rows = (1..=100).map(|step| (f64::from(step), deg_s(f64::from(step))));
                setup.kinematics.speed_map = SpeedMap::Table(rows.collect());
            });
        }
    }
}

/// The speeds then fit the field of view that was set: in the picture they are right.
#[test]
fn a_camera_that_does_not_tell_its_position_is_learned_by_the_picture() {
    for (walk, way) in WALKS {
        let setup = setup(100, 1, |setup| {
            wide(setup);
            setup.tells_position = false;
        });
        let real = setup.kinematics.speed_map.clone();
        let run = setup.run(20.0, way);
        let estimates = run.estimates.unwrap();
        assert!((estimates.fov_deg - 1.3 * WIDE_FOV_DEG).abs() < 0.1, "{walk}: {}", estimates.fov_deg);
        let wider = (1.3 * WIDE_FOV_DEG / 2.0).to_radians().tan() / (WIDE_FOV_DEG / 2.0).to_radians().tan();
        let parts: Vec<_> = used_steps(&run)
            .map(|step| (step, estimates.map.deg_s(step) / real.deg_s(f64::from(step)) / wider))
            .collect();
        assert!(parts.iter().all(|(_, part)| TENTH.contains(part)), "{walk}: {parts:?}");
    }
}

#[test]
fn everything_wrong_at_once_is_put_right_within_20_s() {
    // Whoever comes and goes is lost now and then, before anything is known.
    assert_right("all", 200, &WALKS[..1], TENTH, |setup| {
        wide(setup);
        late(setup);
        linear(setup);
    });
}

/// A linear camera that takes a second for each command, where everything else is as by default.
#[test]
fn a_slow_camera_of_another_make_is_followed() {
    let taken_for = Setup::new(200, 1.0);
    let setup = Setup {
        settings: super::ServoSettings::default(),
        kinematics: Kinematics {
            speed_map: SpeedMap::Linear { max_deg_s: 100.0 },
            limits: Some(Limits { pan_deg: (-170.0, 170.0), tilt_deg: (-90.0, 20.0) }),
            endless_pan: false,
            ..taken_for.kinematics.clone()
        },
        round_trip: Duration::from_secs(1),
        jitter: 0.003,
        ..taken_for
    };
    let run = setup.run(40.0, |time| (PanTilt::new(10.0 * (0.4 * time).sin(), 0.0), 20.0));
    assert!(run.mean_offset(15.0, 40.0) < 0.1, "{}", run.mean_offset(15.0, 40.0));
    for side in [-1.0, 1.0] {
        // Only just in view at first: a command a second, and thrice as fast as it was meant.
        assert!(run.farthest(side, 0.0, 40.0) < 1.0, "{}", run.farthest(side, 0.0, 40.0));
        assert!(run.farthest(side, 15.0, 40.0) < 0.4, "{}", run.farthest(side, 15.0, 40.0));
    }
}
