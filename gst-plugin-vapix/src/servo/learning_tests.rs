//! What is learned of a camera that is otherwise than it was taken for, in closed loop.

use std::time::Duration;

use super::simulation::{Setup, WIDE_FOV_DEG};
use super::{PanTilt, SpeedCurve};

/// Somebody who paces to and fro, 4 s each way, at up to 12 degrees per second.
fn pacing(time_s: f64) -> (PanTilt, f64) {
    const TURN: f64 = std::f64::consts::TAU / 8.0;
    (PanTilt::new(12.0 / TURN * (1.0 - (TURN * time_s).cos()), 0.0), 20.0)
}

/// What the servo believes of a camera with so much delay after 20 s, of which it was told this: as parts of what is right; the
/// latency also in seconds off.
fn learned(delay_ms: u64, lie: impl Fn(&mut Setup)) -> (f64, f64, f64, Vec<f64>) {
    let mut setup = Setup { jitter: 0.003, ..Setup::new(delay_ms, 1.0) };
    lie(&mut setup);
    let real = setup.map;
    let delay_s = (setup.video_delay + setup.command_delay).as_secs_f64();
    let belief = setup.run(20.0, pacing).belief.unwrap();
    // The speeds that were used.
    let steps = (1..=100).filter(|step| (4.0..12.0).contains(&real.deg_s(*step)));
    let speeds = steps.map(|step| belief.map.deg_s(step) / real.deg_s(step)).collect();
    let latency_s = belief.latency.as_secs_f64();
    (latency_s / delay_s, (latency_s - delay_s).abs(), belief.fov_deg / WIDE_FOV_DEG, speeds)
}

fn assert_right(case: &str, delay_ms: u64, lie: impl Fn(&mut Setup)) {
    let (latency, off_s, fov, speeds) = learned(delay_ms, lie);
    let right = 0.9..1.1;
    // Of a short one, what lies within a picture.
    assert!(right.contains(&latency) || off_s < 0.04, "{case}, {delay_ms} ms: latency {latency}");
    assert!(right.contains(&fov), "{case}, {delay_ms} ms: field of view {fov}");
    assert!(
        !speeds.is_empty() && speeds.iter().all(|speed| right.contains(speed)),
        "{case}, {delay_ms} ms: {speeds:?}"
    );
}

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
    assert_right("right", 100, |_| {});
    assert_right("right", 300, |_| {});
}

#[test]
fn the_latency_is_found_within_20_s() {
    assert_right("late", 100, late);
    assert_right("late", 300, late);
    assert_right("early", 400, early);
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
    assert_right("wide", 100, wide);
    assert_right("wide", 300, wide);
    assert_right("narrow", 100, narrow);
    assert_right("narrow", 300, narrow);
}

#[test]
fn the_speed_map_is_found_within_20_s() {
    assert_right("linear", 100, linear);
    assert_right("linear", 300, linear);
}

#[test]
fn everything_wrong_at_once_is_put_right_within_20_s() {
    assert_right("all", 200, |setup| {
        wide(setup);
        late(setup);
        linear(setup);
    });
}

/// A linear camera that takes a second for each command, where everything else is as by default.
#[test]
fn a_slow_camera_of_another_make_is_followed() {
    let setup = Setup {
        settings: super::ServoSettings::default(),
        map: super::SpeedMap::new(100.0, SpeedCurve::Linear),
        round_trip: Duration::from_secs(1),
        pan_limits: crate::vapix::Range { min: -170.0, max: 170.0 },
        jitter: 0.003,
        ..Setup::new(200, 1.0)
    };
    let run = setup.run(40.0, |time| (PanTilt::new(10.0 * (0.4 * time).sin(), 0.0), 20.0));
    assert!(run.mean_offset(15.0, 40.0) < 0.1, "{}", run.mean_offset(15.0, 40.0));
    for side in [-1.0, 1.0] {
        // Only just in view at first: a command a second, and thrice as fast as it was meant.
        assert!(run.farthest(side, 0.0, 40.0) < 1.0, "{}", run.farthest(side, 0.0, 40.0));
        assert!(run.farthest(side, 15.0, 40.0) < 0.4, "{}", run.farthest(side, 15.0, 40.0));
    }
}
