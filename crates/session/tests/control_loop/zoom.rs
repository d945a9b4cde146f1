// SPDX-License-Identifier: MPL-2.0

//! How well the whole servo zooms, and moves where it may not or knows one way only, in closed loop.

use std::time::Duration;

use super::closed_loop::{Run, Setup};
use super::{HALT, STOP};
use servo::{Mode, Motion, PanTilt, Range, Visibility};
use session::Command;

const MODES: [Mode; 3] = [Mode::Velocity, Mode::Absolute, Mode::Centre];

/// At 4 m somebody is nearly as tall in the widest picture.
const TARGET_HEIGHT: f64 = 0.5;

fn zooming(delay_ms: u64, magnification: f64) -> Setup {
    let mut setup = Setup { jitter: 0.004, ..Setup::new(delay_ms, magnification) };
    setup.settings.target_height = Some(TARGET_HEIGHT);
    setup
}

/// Somebody 1.75 m tall who stands 4 m away, walks off to 15 m at 1.2 m/s and somewhat aside, and stands there.
fn departing(time_s: f64) -> (PanTilt, f64) {
    walker(walked(time_s))
}

/// And back again by that way.
fn returning(time_s: f64) -> (PanTilt, f64) {
    walker(WAY - walked(time_s))
}

const WAY: f64 = 11.0;

fn walked(time_s: f64) -> f64 {
    (1.2 * (time_s - 8.0)).clamp(0.0, WAY)
}

fn walker(gone: f64) -> (PanTilt, f64) {
    let (far, aside) = (4.0 + gone, 0.2 * gone);
    let distance = f64::hypot(far, aside);
    (PanTilt::new(aside.atan2(far).to_degrees(), 0.0), 2.0 * (1.75 / 2.0 / distance).atan().to_degrees())
}

fn heights(run: &Run, from_s: f64, to_s: f64) -> (f64, f64) {
    let all = || run.frames_between(from_s, to_s).map(|frame| frame.height);
    (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max))
}

fn in_view(run: &Run) -> bool {
    run.frames
        .iter()
        .all(|frame| frame.offset.x.abs() < 0.45 && frame.offset.y.abs() + frame.height / 2.0 < 0.5)
}

fn assert_as_tall(target: fn(f64) -> (PanTilt, f64)) {
    for (delay, mode) in [100, 300].into_iter().flat_map(|delay| MODES.map(|mode| (delay, mode))) {
        // Who sets out is known to grow or shrink when he was seen to for a while. A step to the side that was begun
        // before is not over, nor seen to be, until a second later.
        let tolerance = if delay > 100 && mode != Mode::Velocity { 0.25 } else { 0.2 };
        let range = (1.0 - tolerance) * TARGET_HEIGHT..(1.0 + tolerance) * TARGET_HEIGHT;
        for seed in 1..=3u64 {
            let mut setup = Setup { seed, ..zooming(delay, 1.0) };
            setup.settings.mode = mode;
            let run = setup.run(25.0, target);
            let (least, most) = heights(&run, 6.0, 25.0);
            let case = format!("{delay} ms, {mode:?}, {seed}");
            assert!(range.contains(&least) && range.contains(&most), "{case}: {least} to {most}");
            assert!(in_view(&run), "{case}");
        }
    }
}

#[test]
fn somebody_who_walks_away_stays_as_tall() {
    assert_as_tall(departing);
}

#[test]
fn somebody_who_comes_nearer_stays_as_tall() {
    assert_as_tall(returning);
}

/// Once the first step is over, each of the others is right about half way to the next.
#[test]
fn a_walk_that_is_known_is_kept_up_with_from_step_to_step() {
    for (delay, mode) in [100, 300].into_iter().flat_map(|delay| MODES.map(|mode| (delay, mode))) {
        let mut setup = zooming(delay, 1.0);
        setup.settings.mode = mode;
        let (least, most) = heights(&setup.run(25.0, departing), 11.0, 25.0);
        let range = 0.88 * TARGET_HEIGHT..1.12 * TARGET_HEIGHT;
        assert!(range.contains(&least) && range.contains(&most), "{delay} ms, {mode:?}: {least} to {most}");
    }
}

#[test]
fn the_zoom_comes_to_rest_with_the_target() {
    for (delay, mode) in
        [(100, Mode::Velocity), (300, Mode::Velocity), (300, Mode::Absolute), (300, Mode::Centre)]
    {
        let mut setup = zooming(delay, 1.0);
        setup.settings.mode = mode;
        let run = setup.run(60.0, |_| (PanTilt::new(3.0, 1.0), 12.0));
        assert_eq!(run.commands_between(15.0, 60.0), 0, "{delay} ms, {mode:?}: {:?}", run.commands);
        let (least, most) = heights(&run, 15.0, 60.0);
        let range = 0.85 * TARGET_HEIGHT..1.15 * TARGET_HEIGHT;
        assert!(range.contains(&least) && range.contains(&most), "{delay} ms, {mode:?}: {least} to {most}");
    }
}

#[test]
fn a_hidden_target_widens_the_view() {
    let mut setup = zooming(200, 6.0);
    setup.settings.stale_timeout = Duration::from_secs(5);
    setup.visible = |time| if time < 10.0 { Visibility::Seen } else { Visibility::Predicted };
    let run = setup.run(14.0, |_| (PanTilt::default(), 5.0));
    let height = |time_s| heights(&run, time_s, time_s + 0.5).1;
    assert!((height(9.0) / TARGET_HEIGHT - 1.0).abs() < 0.15);
    assert!(height(12.0) < 0.7 * height(9.0), "{} of {}", height(12.0), height(9.0));
}

#[test]
fn without_auto_zoom_nothing_zooms() {
    let run = Setup::new(200, 3.0).run(20.0, departing);
    let zooms = |command: &Command| {
        matches!(
            command,
            Command::Move { motion: Motion::Velocity { zoom: Some(_), .. }, .. }
                | Command::Move { motion: Motion::Absolute { zoom: Some(_), .. }, .. }
                | Command::Move { motion: Motion::Centre { magnify: Some(_), .. }, .. }
        )
    };
    assert!(run.commands.len() > 5 && !run.commands.iter().any(|(_, command)| zooms(command)));
}

#[test]
fn soft_limits_are_not_left() {
    for mode in MODES {
        let mut setup = zooming(300, 1.0);
        setup.settings.mode = mode;
        setup.settings.limits.pan_deg = Range { min: -5.0, max: 20.0 };
        setup.settings.limits.zoom = Range { min: 0.0, max: 0.1 };
        let run = setup.run(20.0, |time| (PanTilt::new(6.0 * time, 0.0), 2.0));
        let farthest = run.frames.iter().map(|frame| frame.pose.pan).fold(0.0, f64::max);
        // A degree for what the head does after it was told to stop.
        assert!((19.0..21.0).contains(&farthest), "{mode:?}: {farthest}");
        let near = run.frames.iter().filter(|frame| frame.offset.x.abs() < 0.2);
        let tallest = near.map(|frame| frame.height).fold(0.0, f64::max);
        // 2.7 times its height zoomed out.
        assert!((0.12..0.15).contains(&tallest), "{mode:?}: {tallest}");
    }
}

/// Pan that turns round and round goes on over the back.
#[test]
fn endless_pan_takes_the_shortest_way() {
    for mode in MODES {
        let mut setup = Setup::new(200, 1.0);
        setup.settings.mode = mode;
        let run = setup.run(30.0, |time| (PanTilt::new(10.0 * time, 0.0), 20.0));
        let offset = run.mean_offset(3.0, 30.0);
        assert!(offset < 0.15, "{mode:?}: {offset}");
        let backwards = run.frames.iter().filter(|frame| frame.rate.pan < -5.0).count();
        assert_eq!(backwards, 0, "{mode:?}");
    }
}

type Refuses = fn(&Command) -> bool;

/// A camera that knows one kind of command only is followed with by that.
#[test]
fn each_mode_does_with_its_own_commands() {
    let cases: [(Mode, Refuses); 3] = [
        (Mode::Velocity, |command| {
            !matches!(*command, Command::Move { motion: Motion::Velocity { .. }, .. } | HALT)
        }),
        (Mode::Absolute, |command| {
            !matches!(*command, Command::Move { motion: Motion::Absolute { .. }, .. } | STOP)
        }),
        (Mode::Centre, |command| {
            !matches!(*command, Command::Move { motion: Motion::Centre { .. }, .. } | STOP)
        }),
    ];
    for (mode, refuses) in cases {
        let mut setup = Setup { refuses, jitter: 0.003, ..Setup::new(200, 1.0) };
        setup.settings.mode = mode;
        let run = setup.run(30.0, |time| (PanTilt::new(3.0 * time.min(10.0), 0.0), 20.0));
        assert!(run.mean_offset(15.0, 30.0) < 0.03, "{mode:?}: {}", run.mean_offset(15.0, 30.0));
        assert_eq!(run.commands_between(15.0, 30.0), 0, "{mode:?}: {:?}", run.commands);
        assert!(!run.commands.iter().any(|(_, command)| refuses(command)), "{mode:?}");
    }
}
