// SPDX-License-Identifier: MPL-2.0

//! It goes home, gives way to others, and stops what nobody else does. By the stream's time, over real HTTP.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::stage::{FRAME, Stage};
use common::{Heard, PATIENCE, Rig, target};
use gst::prelude::*;
use ptztrack_contract::{CameraChange, Rect, TargetMeta, TargetState};
use virtual_camera::{Clock, Fault, Kinematics, Pose, Settings, SpeedMap, VirtualCamera};

const TAKEN_OVER: Heard = Heard::Camera(CameraChange::TakenOver);
const RESUMED: Heard = Heard::Camera(CameraChange::Resumed);

const HALT: &str = "camera=1&continuouspantiltmove=0,0";

/// A person walks to and fro.
fn walk(stage: &mut Stage, seconds: f64) {
    for _ in 0..(seconds / FRAME.as_secs_f64()).round() as u32 {
        let meta = person_at(stage, 10.0 * stage.now.as_secs_f64().sin());
        stage.picture(Some(&meta));
    }
}

/// Runs until this is heard; returns how long it took, in seconds.
#[track_caller]
fn run_until(stage: &mut Stage, wanted: &Heard, most: f64, meta: &TargetMeta) -> f64 {
    let begin = stage.now;
    while !stage.heard.contains(wanted) {
        stage.picture(Some(meta));
        let seconds = (stage.now - begin).as_secs_f64();
        assert!(seconds <= most, "{wanted:?} not after {most} s: {:?}", stage.heard);
    }
    stage.heard.retain(|heard| heard != wanted);
    (stage.now - begin).as_secs_f64()
}

/// Where a person at this pan is in the picture.
fn person_at(stage: &Stage, pan_deg: f64) -> TargetMeta {
    let status = stage.camera.status();
    let wide = (status.horizontal_fov_deg / 2.0).to_radians().tan();
    let x = 0.5 + (pan_deg - status.pan_deg).to_radians().tan() / (2.0 * wide);
    target(TargetState::Tracking, x.clamp(0.0, 1.0), 0.5)
}

fn centred() -> TargetMeta {
    target(TargetState::Tracking, 0.5, 0.5)
}

fn aside() -> TargetMeta {
    target(TargetState::Tracking, 0.8, 0.5)
}

fn nobody() -> TargetMeta {
    target(TargetState::Searching, 0.0, 0.0)
}

#[test]
fn an_operator_is_given_way_and_control_comes_back() {
    let mut stage = Stage::new(Settings::default(), |rig| rig.with("override-timeout", 4_000_000_000u64));
    stage.run(12.0, &centred());
    assert_eq!(stage.times(&TAKEN_OVER), 0);
    assert!(stage.camera.operate("rpan=-6"));
    run_until(&mut stage, &TAKEN_OVER, 3.0, &centred());
    let before = stage.moves().len();
    // The target is followed in the picture, and not by the camera.
    stage.run(2.0, &aside());
    assert!(stage.camera.operate("rpan=3"));
    stage.run(3.5, &aside());
    assert_eq!(stage.moves().len(), before);
    assert_eq!(stage.rig.stats().get::<&str>("state").unwrap(), "taken-over");
    assert_eq!(stage.times(&RESUMED), 0, "he moved it again");
    run_until(&mut stage, &RESUMED, 4.0, &aside());
    stage.run(1.0, &aside());
    assert!(stage.moves().len() > before);
    assert_eq!((stage.times(&TAKEN_OVER), stage.times(&RESUMED)), (0, 0));
}

#[test]
fn an_operator_who_steers_against_us_is_noticed_and_his_move_not_ended() {
    let mut stage = Stage::new(Settings::default(), |rig| rig);
    stage.run(2.0, &centred());
    let mut seconds = 0.0;
    while !stage.heard.contains(&TAKEN_OVER) {
        // His stick says left thirty times for each of our commands to the right.
        stage.picture(Some(&aside()));
        stage.camera.operate("continuouspantiltmove=-20,0");
        seconds += FRAME.as_secs_f64();
        assert!(seconds < 6.0, "not noticed");
    }
    // He lets go of nothing; ours would have ended within this.
    let before = stage.moves().len();
    stage.run(3.0, &aside());
    assert_eq!(stage.moves()[before..], [] as [String; 0]);
    assert!(stage.camera.status().pan_rate_deg_s < 0.0);
}

/// Nobody is there when he turns it, and then somebody is, whom we turn to the same way: from then on his move cannot be told from ours.
#[test]
fn an_operator_who_steers_while_nobody_is_followed_is_noticed_before_somebody_is() {
    for seconds in 20..25 {
        let mut stage = Stage::new(Settings::default(), |rig| rig);
        stage.run(2.0, &centred());
        stage.run(f64::from(seconds), &nobody());
        assert_eq!(stage.times(&TAKEN_OVER), 0);
        assert!(stage.camera.operate("rpan=6"));
        run_until(&mut stage, &TAKEN_OVER, 1.6, &nobody());
        let before = stage.moves().len();
        stage.run(3.0, &aside());
        assert_eq!(stage.moves()[before..], [] as [String; 0]);
    }
}

/// He nudged it once, and our command came after that.
#[test]
fn where_an_operator_is_noticed_a_move_of_ours_is_ended() {
    let mut stage = Stage::new(Settings::default(), |rig| rig);
    stage.run(2.0, &centred());
    let mut seconds = 0.0;
    while !stage.heard.contains(&TAKEN_OVER) {
        stage.camera.operate("continuouspantiltmove=-20,0");
        stage.picture(Some(&aside()));
        seconds += FRAME.as_secs_f64();
        assert!(seconds < 6.0, "not noticed");
    }
    stage.camera.operate("continuouspantiltmove=20,0");
    stage.run(2.0, &aside());
    assert_eq!(stage.moves().last().unwrap(), "camera=1&continuouspantiltmove=0,0");
    assert_eq!(stage.camera.status().pan_rate_deg_s, 0.0);
}

#[test]
fn where_nobody_is_to_be_given_way_nobody_is() {
    let mut stage = Stage::new(Settings::default(), |rig| rig.with("override-timeout", 0u64));
    stage.run(12.0, &centred());
    stage.camera.operate("rpan=-6");
    stage.run(5.0, &aside());
    assert_eq!(stage.times(&TAKEN_OVER), 0);
    assert!(!stage.moves().is_empty());
}

#[test]
fn zooming_by_hand_is_no_override() {
    let mut stage = Stage::new(Settings::default(), |rig| rig);
    stage.run(12.0, &centred());
    stage.camera.operate("zoom=3000");
    stage.run(8.0, &centred());
    assert_eq!(stage.times(&TAKEN_OVER), 0);
}

#[test]
fn zooming_by_hand_against_auto_zoom_is_an_override() {
    let auto = |rig: Rig| rig.with("auto-zoom", true).with("target-height", 0.4);
    let mut stage = Stage::new(Settings::default(), auto);
    // As tall as is wished: nothing zooms.
    let mut person = centred();
    person.bounds = Rect { y: 0.3, height: 0.4, ..person.bounds };
    stage.run(12.0, &person);
    assert_eq!(stage.times(&TAKEN_OVER), 0);
    stage.camera.operate("zoom=3000");
    run_until(&mut stage, &TAKEN_OVER, 3.0, &person);
}

/// The camera's delays, speeds and ends differ from all that is assumed, and nobody else is there.
#[track_caller]
fn our_own_moves_are_nobody_elses(kinematics: Kinematics) {
    for mode in ["velocity", "absolute", "centre"] {
        let settings = Settings { kinematics: kinematics.clone(), ..Settings::default() };
        let mut stage = Stage::new(settings, |rig| rig.with_str("mode", mode));
        let end = stage.camera.limits().pan_deg.1;
        // To and fro, and on beyond the end of the range.
        for second in 0..40 {
            for _ in 0..25 {
                let phase = stage.now.as_secs_f64() * 0.5;
                let meta = person_at(&stage, (end + 3.0) * phase.sin());
                stage.picture(Some(&meta));
            }
            assert_eq!(stage.times(&TAKEN_OVER), 0, "{mode}, second {second}");
        }
        assert!(!stage.moves().is_empty());
    }
}

#[test]
fn our_own_moves_are_nobody_elses_on_a_camera_as_assumed() {
    our_own_moves_are_nobody_elses(Kinematics::default());
}

#[test]
fn our_own_moves_are_nobody_elses_on_a_late_camera() {
    let command_delay = Duration::from_millis(900);
    our_own_moves_are_nobody_elses(Kinematics { command_delay, ..Kinematics::default() });
}

#[test]
fn our_own_moves_are_nobody_elses_on_a_lazy_camera() {
    our_own_moves_are_nobody_elses(Kinematics { acceleration_deg_s2: 20.0, ..Kinematics::default() });
}

#[test]
fn our_own_moves_are_nobody_elses_on_a_camera_of_linear_speeds() {
    let speed_map = SpeedMap::Linear { max_deg_s: 200.0 };
    our_own_moves_are_nobody_elses(Kinematics { speed_map, ..Kinematics::default() });
}

#[test]
fn a_camera_that_comes_back_from_a_reboot_elsewhere_was_not_moved_by_anybody() {
    let mut stage = Stage::new(Settings::default(), |rig| rig);
    stage.run(12.0, &centred());
    stage.camera.set_fault(Fault::Reboot);
    stage.run(8.0, &centred());
    // It looks for its zero.
    stage.camera.operate("rpan=15");
    stage.run(1.0, &centred());
    stage.camera.set_fault(Fault::None);
    for pan in ["pan=-12", "pan=12", "pan=0"] {
        stage.camera.operate(pan);
        stage.run(1.0, &centred());
    }
    stage.run(10.0, &centred());
    assert_eq!(stage.times(&TAKEN_OVER), 0);
}

#[test]
fn it_goes_home_when_nobody_was_there_for_a_while() {
    let presets = vec![("Gate".to_owned(), Pose { pan_deg: 9.0, tilt_deg: 2.0, zoom_step: 1.0 })];
    for (home, command, pan) in [
        ("-8,1", "camera=1&pan=-8.0000&tilt=1.0000&speed=100", -8.0),
        ("start", "camera=1&pan=0.0000&tilt=0.0000&speed=100&zoom=1", 0.0),
        ("Gate", "camera=1&gotoserverpresetno=2", 9.0),
    ] {
        let settings = Settings { presets: presets.clone(), ..Settings::default() };
        let mut stage =
            Stage::new(settings, |rig| rig.with("home", home).with("home-timeout", 3_000_000_000u64));
        stage.run(2.0, &target(TargetState::Tracking, 0.3, 0.5));
        stage.run(2.8, &nobody());
        assert!(!stage.moves().contains(&command.to_owned()), "{home}: too early");
        stage.run(20.0, &nobody());
        let there: Vec<_> = stage.moves().into_iter().filter(|query| query == command).collect();
        assert_eq!(there.len(), 1, "{home}: {:?}", stage.moves());
        assert_eq!(stage.moves().last().unwrap(), command);
        assert!((stage.camera.status().pan_deg - pan).abs() < 0.01, "{home}");
        assert_eq!(stage.times(&TAKEN_OVER), 0, "{home}");
        assert!(!stage.heard.iter().any(Heard::is_warning), "{:?}", stage.heard);
        // And away again.
        stage.run(2.0, &aside());
        assert!(stage.moves().last().unwrap().contains("continuous"), "{home}");
    }
}

#[test]
fn without_a_home_it_stays_where_the_last_target_was() {
    let mut stage = Stage::new(Settings::default(), |rig| rig.with("home-timeout", 0u64));
    stage.run(1.0, &aside());
    stage.run(1.0, &nobody());
    let before = stage.moves().len();
    stage.run(30.0, &nobody());
    assert_eq!(stage.moves().len(), before);
}

#[test]
fn at_the_start_it_goes_home_without_waiting() {
    let mut stage =
        Stage::new(Settings::default(), |rig| rig.with("home", "-8,1").with("home-at-start", true));
    stage.run(0.5, &nobody());
    assert_eq!(stage.moves(), ["camera=1&pan=-8.0000&tilt=1.0000&speed=100"]);
}

#[test]
fn a_way_home_is_broken_off_for_a_target_and_for_a_pause() {
    let slow = Settings {
        kinematics: Kinematics { acceleration_deg_s2: 4.0, ..Kinematics::default() },
        ..Settings::default()
    };
    let mut stage = Stage::new(slow, |rig| rig.with("home", "-15,0").with("home-at-start", true));
    stage.run(1.0, &nobody());
    assert!(stage.camera.status().moving);
    stage.run(0.2, &aside());
    assert!(stage.moves().last().unwrap().contains("continuouspantiltmove="), "{:?}", stage.moves());
    stage.run(13.0, &nobody());
    assert!(stage.camera.status().moving, "on the way again");
    let sent = stage.camera.status().commands;
    stage.rig.sink.set_state(gst::State::Paused).unwrap();
    // Without a wait.
    assert!(stage.camera.wait_for(PATIENCE, |status| status.commands > sent));
    assert_eq!(stage.moves().last().unwrap(), "camera=1&move=stop");
}

#[test]
fn a_home_that_is_none_is_said_once_and_nothing_else_suffers() {
    let mut stage = Stage::new(Settings::default(), |rig| {
        rig.with("home", "Nowhere").with("home-timeout", 100_000_000u64)
    });
    stage.run(10.0, &nobody());
    let warnings: Vec<_> = stage.heard.iter().filter(|heard| heard.is_warning()).collect();
    let [Heard::Warning(text)] = warnings[..] else { panic!("{warnings:?}") };
    assert!(text.contains("Nowhere") && text.contains("home"), "{text}");
    stage.run(1.0, &aside());
    assert!(!stage.moves().is_empty());
}

#[test]
fn a_home_that_does_not_parse_is_refused_and_the_old_one_stays() {
    let rig = Rig::ready("http://192.168.0.90").with("home", "10,5").with("home", "10,500");
    assert_eq!(rig.sink.property::<Option<String>>("home").as_deref(), Some("10,5"));
    assert!(matches!(&rig.heard()[..], [Heard::Warning(text)] if text.contains("180")));
}

#[test]
fn a_camera_found_moving_is_stopped_whoever_left_it_so() {
    for query in ["continuouspantiltmove=12,0", "continuouspantiltmove=0,8&continuouszoommove=20"] {
        let camera = VirtualCamera::start(Settings { clock: Clock::Stepped, ..Settings::default() }).unwrap();
        // The predecessor, before it crashed.
        assert!(camera.operate(query));
        camera.advance_to(Duration::from_millis(500));
        let mut stage = Stage::before(camera, |rig| rig);
        stage.run(6.0, &nobody());
        assert!(!stage.camera.status().moving, "{query}");
        assert_eq!(stage.moves().len(), 1, "{:?}", stage.moves());
        assert_eq!(stage.times(&TAKEN_OVER), 0);
    }
}

#[test]
fn a_camera_found_at_rest_is_told_nothing() {
    let mut stage = Stage::new(Settings::default(), |rig| rig);
    stage.run(15.0, &nobody());
    assert_eq!(stage.moves(), [] as [&str; 0]);
}

#[test]
fn with_a_control_queue_it_waits_for_its_turn() {
    let settings = Settings { control_queue: Some(Duration::from_secs(10)), ..Settings::default() };
    let mut stage = Stage::new(settings, |rig| rig);
    walk(&mut stage, 60.0);
    assert!(!stage.heard.contains(&Heard::Camera(CameraChange::Refused)), "{:?}", stage.heard);
    assert_eq!(stage.times(&TAKEN_OVER), 0);
    assert!(stage.moves().len() > 5, "it keeps its place: {:?}", stage.moves());

    stage.camera.queue_operator(true);
    run_until(&mut stage, &TAKEN_OVER, 6.0, &aside());
    let before = stage.moves().len();
    walk(&mut stage, 20.0);
    // It asks every 5 s where it stands, and each time tries its stop, which is refused.
    let stops = &stage.moves()[before - 1..];
    assert!((3..=6).contains(&stops.len()) && stops.iter().all(|query| query == HALT), "{stops:?}");
    stage.camera.queue_operator(false);
    run_until(&mut stage, &RESUMED, 11.0, &aside());
    walk(&mut stage, 4.0);
    assert!(stage.moves().len() > before);
    assert!(!stage.heard.contains(&Heard::Camera(CameraChange::Refused)), "{:?}", stage.heard);

    // It gives up its place: another is let in at once.
    let Stage { camera, rig, .. } = stage;
    drop(rig);
    let mut stage = Stage::before(camera, |rig| rig);
    let before = stage.moves().len();
    walk(&mut stage, 4.0);
    assert!(stage.moves().len() > before && stage.times(&TAKEN_OVER) == 0);
}

#[test]
fn who_loses_its_turn_while_the_camera_turns_stops_it() {
    for queue_lets_stop in [true, false] {
        let control_queue = Some(Duration::from_secs(10));
        let kinematics = Kinematics { limits: None, ..Kinematics::default() };
        let mut stage = Stage::new(
            Settings { control_queue, queue_lets_stop, kinematics, ..Settings::default() },
            |rig| rig.with("max-speed", 1.0),
        );
        stage.run(4.0, &aside());
        stage.camera.queue_operator(true);
        run_until(&mut stage, &TAKEN_OVER, 6.0, &aside());
        stage.run(1.0, &aside());
        assert_eq!(stage.camera.status().moving, !queue_lets_stop, "a camera may refuse a stop out of turn");
        stage.run(1.0, &nobody());
        stage.camera.queue_operator(false);
        run_until(&mut stage, &RESUMED, 11.0, &nobody());
        stage.run(1.0, &nobody());
        assert!(!stage.camera.status().moving, "in its turn the stop is made up for");
        assert_eq!(stage.moves().last().unwrap(), HALT);
        assert!(!stage.heard.iter().any(|heard| matches!(heard, Heard::Info(_) | Heard::Warning(_))));
    }
}

#[test]
fn a_stop_that_the_network_swallows_is_repeated_when_it_is_back() {
    let camera = common::camera(virtual_camera::Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.set_going(&camera);
    camera.set_fault(Fault::Refuse);
    let nobody = nobody();
    rig.push_until_message(&nobody, Heard::is_warning);
    assert!(camera.status().moving);
    camera.set_fault(Fault::None);
    rig.push_until(&nobody, &camera, |status| !status.moving);
}

#[test]
fn a_stop_outlives_the_element_that_could_not_send_it() {
    let camera = common::camera(virtual_camera::Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.set_going(&camera);
    camera.set_fault(Fault::Refuse);
    drop(rig);
    assert!(camera.status().moving);
    camera.set_fault(Fault::None);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

/// The same, where the element is used again in the meantime, with success or without.
#[test]
fn a_stop_outlives_what_the_element_turns_to_next() {
    let next = common::camera(virtual_camera::Auth::None);
    for (location, starts) in [(next.url(), true), ("https://127.0.0.1".to_owned(), false)] {
        let left = common::camera(virtual_camera::Auth::None);
        let mut rig = Rig::playing(&left.url());
        rig.set_going(&left);
        left.set_fault(Fault::Refuse);
        rig.sink.set_state(gst::State::Null).unwrap();
        let rig = rig.with("location", &location).with("ca-file", "/nowhere.pem");
        assert_eq!(rig.sink.set_state(gst::State::Playing).is_ok(), starts);
        assert!(left.status().moving);
        left.set_fault(Fault::None);
        assert!(left.wait_for(PATIENCE, |status| !status.moving), "{location}");
    }
}

/// And not only where it is found to move by its positions: not every camera tells them. Nor need it be the same element.
#[test]
fn a_stop_is_handed_over_to_who_comes_next() {
    for is_another in [false, true] {
        let camera = common::camera(virtual_camera::Auth::None);
        let mut rig = Rig::playing(&camera.url());
        rig.set_going(&camera);
        camera.set_fault(Fault::Refuse);
        rig.sink.set_state(gst::State::Null).unwrap();
        let before = camera.commands().len() as u64;
        let next = if is_another { Rig::ready(&camera.url()) } else { rig };
        next.sink.set_state(gst::State::Playing).unwrap();
        assert!(camera.status().moving);
        camera.set_fault(Fault::None);
        assert!(camera.wait_for(PATIENCE, |status| !status.moving));
        let told = camera.commands_after(before);
        let queries = told.iter().take_while(|command| command.query.contains("query=")).count();
        assert!(queries < 2, "{told:?}");
    }
}

/// Even where that one is ended before the camera could tell it that it moves.
#[test]
fn a_camera_that_refused_everybody_is_stopped_by_who_comes_next_and_leaves_at_once() {
    let camera = common::camera(virtual_camera::Auth::Digest { qop: true });
    let with_account = || Rig::ready(&camera.url()).with("user", "root").with("password", "pass");
    let mut rig = with_account().play();
    rig.set_going(&camera);
    camera.set_fault(Fault::Locked);
    rig.sink.set_state(gst::State::Null).unwrap();
    assert!(camera.status().moving);
    camera.set_fault(Fault::None);
    let next = with_account().play();
    next.sink.set_state(gst::State::Null).unwrap();
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "{:?}", camera.commands().last());
}

/// Whoever stands there meanwhile.
#[test]
fn it_goes_home_or_stays_at_a_word_and_follows_again() {
    let mut stage = Stage::new(Settings::default(), |rig| rig.with("home", "-8,1"));
    stage.run(1.0, &aside());
    stage.rig.sink.set_property_from_str("steering", "home");
    stage.run(10.0, &aside());
    let home = stage.camera.status();
    assert!((home.pan_deg + 8.0).abs() < 0.01 && !home.moving, "{home:?}: {:?}", stage.moves());
    stage.rig.sink.set_property_from_str("steering", "off");
    let before = stage.moves().len();
    stage.run(4.0, &aside());
    assert_eq!(stage.moves().len(), before, "{:?}", stage.moves());
    stage.rig.sink.set_property_from_str("steering", "follow");
    stage.run(1.0, &aside());
    assert!(stage.moves().last().unwrap().contains("continuous"), "{:?}", stage.moves());
}

/// As for somebody whom another camera sees: there, and as wide as is said, and on to the next place without a word in between.
#[test]
fn it_looks_where_it_is_told_and_follows_from_there() {
    let mut stage = Stage::new(Settings::default(), |rig| rig.with("look-at", "-8,1,20"));
    stage.run(1.0, &aside());
    stage.rig.sink.set_property_from_str("steering", "look-at");
    stage.run(6.0, &aside());
    let there = stage.camera.status();
    assert!((there.pan_deg + 8.0).abs() < 0.01 && !there.moving, "{there:?}: {:?}", stage.moves());
    assert!((there.horizontal_fov_deg - 20.0).abs() < 1.0, "{there:?}");
    stage.rig.sink.set_property_from_str("look-at", "4,-2,nonsense");
    stage.rig.sink.set_property_from_str("look-at", "4,-2");
    stage.run(6.0, &aside());
    let there = stage.camera.status();
    assert!((there.pan_deg - 4.0).abs() < 0.01 && !there.moving, "{there:?}: {:?}", stage.moves());
    stage.rig.sink.set_property_from_str("steering", "follow");
    stage.run(1.0, &aside());
    assert!(stage.moves().last().unwrap().contains("continuous"), "{:?}", stage.moves());
}
