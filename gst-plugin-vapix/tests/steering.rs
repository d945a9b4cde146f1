// SPDX-License-Identifier: MPL-2.0

//! What the camera is told, and that it is never left moving.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::mpsc;
use std::time::{Duration, Instant};

use common::{FRAME, Heard, PATIENCE, Rig, Stamps, camera, moves, target};
use gst::prelude::*;
use ptztrack_contract::{BufferMeta, CameraChange, CameraEvent, Rect, TargetMeta, TargetState, Vector};
use virtual_camera::{Auth, Settings, VirtualCamera};

const STATES_WITHOUT_TARGET: [TargetState; 2] = [TargetState::Searching, TargetState::Lost];

#[test]
fn it_turns_towards_the_target_and_tells() {
    let camera = camera(Auth::None);
    let mut rig = far_from_its_limits(&camera);
    rig.set_going(&camera);
    let first = moves(&camera).remove(0);
    assert!(first.starts_with("camera=1&continuouspantiltmove="), "{first}");
    let lost = target(TargetState::Lost, 0.9, 0.4);
    let stopped = Heard::Camera(CameraChange::Stopped);
    let mut heard = rig.push_until_message(&lost, |heard| *heard == stopped);
    assert_eq!(moves(&camera).last().unwrap(), "camera=1&continuouspantiltmove=0,0");
    push_until_known(&mut rig, &lost, &camera, "field-of-view");
    heard.extend(rig.heard());
    heard.dedup();
    let expected = [CameraChange::Connected, CameraChange::Moving, CameraChange::Stopped].map(Heard::Camera);
    assert_eq!(heard, expected);

    let stats = rig.stats();
    assert!(stats.get::<u64>("commands-sent").unwrap() >= 2);
    assert_eq!(stats.get::<u64>("commands-failed").unwrap(), 0);
    assert!(stats.get::<u64>("round-trip").unwrap() > 0);
    assert!((stats.get::<f64>("field-of-view").unwrap() - 36.0).abs() < 0.2, "{stats}");
    assert_eq!(stats.get::<&str>("state").unwrap(), "at-rest");
}

#[test]
fn upstream_hears_what_the_camera_does() {
    let camera = camera(Auth::None);
    let mut rig = far_from_its_limits(&camera);
    let nobody = target(TargetState::Searching, 0.0, 0.0);
    push_until_known(&mut rig, &nobody, &camera, "field-of-view");
    push_until_told(&mut rig, &target(TargetState::Tracking, 0.9, 0.4), |event| {
        event.moving && event.pan_rate_deg_s > 0.0 && event.horizontal_fov_deg.is_some()
    });
    push_until_told(&mut rig, &nobody, |event| !event.moving && event.pan_rate_deg_s == 0.0);
}

/// So slow that it is on its way for much longer than a test takes.
fn far_from_its_limits(camera: &VirtualCamera) -> Rig {
    Rig::ready(&camera.url()).with("max-speed", 1.0).play()
}

/// Pushes pictures until this is among the statistics.
#[track_caller]
fn push_until_known(rig: &mut Rig, meta: &TargetMeta, camera: &VirtualCamera, what: &str) {
    let sink = rig.sink.clone();
    rig.push_until(meta, camera, |_| sink.property::<gst::Structure>("stats").has_field(what));
}

/// Pushes pictures until upstream is told this.
#[track_caller]
fn push_until_told(rig: &mut Rig, meta: &TargetMeta, wanted: impl Fn(&CameraEvent) -> bool) {
    let (start, mut told) = (Instant::now(), Vec::new());
    while !told.iter().any(&wanted) {
        assert!(start.elapsed() < PATIENCE, "told only {told:?}");
        rig.push(meta);
        rig.hear(FRAME);
        let events = std::iter::from_fn(|| rig.harness().try_pull_upstream_event());
        told.extend(events.filter_map(|event| CameraEvent::of(&event)).map(Result::unwrap));
    }
}

#[test]
fn without_a_target_it_commands_nothing() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    for state in STATES_WITHOUT_TARGET {
        // Until it has asked all it wants to know.
        rig.push_until(&target(state, 0.9, 0.1), &camera, |status| status.requests >= 3);
    }
    drop(rig);
    assert_eq!(moves(&camera), [] as [&str; 0]);
}

#[test]
fn a_target_in_the_middle_moves_nothing() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.push_until(&target(TargetState::Tracking, 0.5, 0.5), &camera, |status| status.requests >= 3);
    // Its next looks at the position come after all there was to command.
    let requests = camera.status().requests;
    let aside = target(TargetState::Tracking, 0.51, 0.49);
    rig.push_until(&aside, &camera, |status| status.requests > requests + 1);
    drop(rig);
    assert_eq!(moves(&camera), [] as [&str; 0]);
}

/// Pictures have timestamps, by which they are of now.
fn by_the_clock(rig: &mut Rig) {
    let clock = gst::SystemClock::obtain();
    rig.sink.set_clock(Some(&clock)).unwrap();
    rig.sink.set_base_time(clock.time());
    rig.stamps = Some(Stamps::default());
}

/// One waits in the sink's preroll meanwhile, others in queues.
#[test]
fn a_picture_of_before_a_pause_moves_nothing_after_it() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    by_the_clock(&mut rig);
    let middle = target(TargetState::Tracking, 0.5, 0.5);
    rig.push_until(&middle, &camera, |status| status.requests >= 3);
    let capture_time = rig.sink.current_running_time();
    rig.sink.set_state(gst::State::Paused).unwrap();
    rig.sink.set_state(gst::State::Playing).unwrap();
    rig.push(&TargetMeta { capture_time, ..target(TargetState::Tracking, 0.9, 0.4) });
    let requests = camera.status().requests;
    rig.push_until(&middle, &camera, |status| status.requests > requests + 1);
    drop(rig);
    assert_eq!(moves(&camera), [] as [&str; 0]);
}

/// As by `intervideosrc` or `videorate`, where the tracker's pictures have stopped.
#[test]
fn a_picture_that_is_shown_again_does_not_keep_the_camera_turning() {
    let camera = camera(Auth::None);
    for flags in [gst::BufferFlags::GAP, gst::BufferFlags::empty()] {
        let mut rig = far_from_its_limits(&camera);
        by_the_clock(&mut rig);
        let aside = target(TargetState::Tracking, 0.9, 0.4);
        rig.push_until(&aside, &camera, |status| status.moving);
        let capture_time = rig.sink.current_running_time();
        rig.flags = flags;
        rig.push_until(&TargetMeta { capture_time, ..aside }, &camera, |status| !status.moving);
    }
}

/// Sets a camera going, ends it in some way, and expects rest.
#[track_caller]
fn comes_to_rest(end: impl FnOnce(&mut Rig)) {
    let camera = camera(Auth::Digest { qop: true });
    let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass").play();
    rig.set_going(&camera);
    end(&mut rig);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "{:?}", camera.status());
    let last = moves(&camera).pop().unwrap();
    assert!(last.ends_with("continuouspantiltmove=0,0"), "{last}");
}

#[test]
fn eos_stops_the_camera() {
    comes_to_rest(|rig| assert!(rig.harness().push_event(gst::event::Eos::new())));
}

#[test]
fn a_flush_stops_the_camera() {
    comes_to_rest(|rig| {
        assert!(rig.harness().push_event(gst::event::FlushStart::new()));
        assert!(rig.harness().push_event(gst::event::FlushStop::new(true)));
    });
}

#[test]
fn paused_stops_the_camera() {
    comes_to_rest(|rig| assert!(rig.sink.set_state(gst::State::Paused).is_ok()));
}

#[test]
fn ready_stops_the_camera() {
    comes_to_rest(|rig| assert!(rig.sink.set_state(gst::State::Ready).is_ok()));
}

#[test]
fn null_stops_the_camera() {
    comes_to_rest(|rig| assert!(rig.sink.set_state(gst::State::Null).is_ok()));
}

#[test]
fn a_stream_that_dries_up_stops_the_camera() {
    comes_to_rest(|_| {});
}

#[test]
fn pictures_without_target_meta_stop_the_camera() {
    comes_to_rest(|rig| {
        for _ in 0..5 {
            let buffer = gst::Buffer::with_size(320 * 240).unwrap();
            assert_eq!(rig.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
        }
    });
}

/// By itself the camera would go on for so long after somebody who walks out of the picture.
const SEARCH_TIME: Duration = Duration::from_secs(10);

/// Somebody who walks out of the picture is followed, and lost. How soon after that the camera is stopped, by pictures like this.
fn stopped_after(search_time: Duration, then: impl FnOnce(&mut Rig, TargetMeta) -> TargetMeta) -> Duration {
    let camera = camera(Auth::None);
    let search_time = u64::try_from(search_time.as_nanos()).unwrap();
    let mut rig = Rig::ready(&camera.url()).with("max-speed", 1.0).with("search-time", search_time).play();
    let leaving = TargetMeta {
        bounds: Rect { x: 0.8, y: 0.2, width: 0.2, height: 0.4 },
        velocity: Vector { x: 0.1, y: 0.0 },
        ..target(TargetState::Tracking, 0.9, 0.4)
    };
    rig.push_until(&leaving, &camera, |status| status.moving);
    let lost = Instant::now();
    rig.push(&TargetMeta { state: TargetState::Lost, ..leaving.clone() });
    let meta = then(&mut rig, leaving);
    rig.push_until(&meta, &camera, |status| !status.moving);
    lost.elapsed()
}

#[test]
fn the_camera_keeps_turning_after_whoever_leaves_the_picture() {
    let nobody = |_: &mut Rig, _| TargetMeta::default();
    let stopped_after = stopped_after(Duration::from_secs(2), nobody);
    assert!(stopped_after >= Duration::from_millis(1500), "{stopped_after:?}");
}

#[test]
fn whoever_is_let_go_as_they_leave_is_not_gone_after() {
    let let_go = |_: &mut Rig, leaving| TargetMeta { state: TargetState::Searching, ..leaving };
    assert!(stopped_after(SEARCH_TIME, let_go) < SEARCH_TIME / 2);
}

/// Where everybody may be in another place.
#[test]
fn whoever_leaves_is_not_gone_after_into_a_picture_of_another_size() {
    let resized = |rig: &mut Rig, _| {
        rig.harness().set_src_caps_str("video/x-raw,format=GRAY8,width=640,height=480,framerate=25/1");
        TargetMeta::default()
    };
    assert!(stopped_after(SEARCH_TIME, resized) < SEARCH_TIME / 2);
}

#[test]
fn whoever_leaves_is_gone_after_only_as_long_as_that_is_wanted() {
    let not_wanted = |rig: &mut Rig, _| {
        rig.sink.set_property("search-time", 0u64);
        TargetMeta::default()
    };
    assert!(stopped_after(SEARCH_TIME, not_wanted) < SEARCH_TIME / 2);
}

#[test]
fn a_long_occlusion_stops_the_camera() {
    let camera = camera(Auth::None);
    let mut rig = Rig::ready(&camera.url()).with("stale-timeout", 300_000_000u64).play();
    rig.set_going(&camera);
    rig.push_until(&target(TargetState::Occluded, 0.9, 0.4), &camera, |status| !status.moving);
}

#[test]
fn it_resumes_after_a_pause() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.set_going(&camera);
    rig.sink.set_state(gst::State::Paused).unwrap();
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    rig.sink.set_state(gst::State::Playing).unwrap();
    rig.push_until(&target(TargetState::Tracking, 0.1, 0.5), &camera, |status| status.pan_rate_deg_s < 0.0);
}

#[test]
fn it_resumes_after_ready() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.set_going(&camera);
    rig.sink.set_state(gst::State::Ready).unwrap();
    assert!(!camera.status().moving || camera.wait_for(PATIENCE, |status| !status.moving));
    assert_eq!(rig.stats().get::<&str>("state").unwrap(), "stopped");
    rig.sink.set_state(gst::State::Playing).unwrap();
    rig.push_until(&target(TargetState::Tracking, 0.1, 0.5), &camera, |status| status.pan_rate_deg_s < 0.0);
}

#[test]
fn paused_commands_nothing() {
    let camera = camera(Auth::None);
    let rig = Rig::ready(&camera.url());
    let source = gst::ElementFactory::make("videotestsrc").build().unwrap();
    let pipeline = gst::Pipeline::new();
    pipeline.add_many([&source, &rig.sink]).unwrap();
    source.link(&rig.sink).unwrap();
    let (rendered, to_render) = mpsc::channel();
    rig.sink.static_pad("sink").unwrap().add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        let Some(buffer) = info.buffer_mut() else { return gst::PadProbeReturn::Ok };
        target(TargetState::Tracking, 0.9, 0.5).attach(buffer.make_mut()).unwrap();
        let _ = rendered.send(());
        gst::PadProbeReturn::Ok
    });
    pipeline.set_state(gst::State::Paused).unwrap();
    to_render.recv_timeout(PATIENCE).unwrap();
    // It has got to know the camera, and could move it.
    assert!(camera.wait_for(PATIENCE, |status| status.requests >= 3));
    assert_eq!(moves(&camera), [] as [&str; 0]);
    pipeline.set_state(gst::State::Playing).unwrap();
    assert!(camera.wait_for(PATIENCE, |status| status.moving));
    for _ in 0..10 {
        pipeline.set_state(gst::State::Paused).unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
    }
    pipeline.set_state(gst::State::Paused).unwrap();
    assert!(!camera.status().moving || camera.wait_for(PATIENCE, |status| !status.moving));
    let commanded = moves(&camera).len();
    // Its next look at the position comes after all there was to command.
    let requests = camera.status().requests;
    assert!(camera.wait_for(PATIENCE, |status| status.requests > requests));
    assert_eq!(moves(&camera).len(), commanded, "{:?}", camera.commands());
    pipeline.set_state(gst::State::Null).unwrap();
}

/// Where blocking on a runtime would panic.
#[test]
fn it_is_stopped_from_within_an_applications_own_task() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.set_going(&camera);
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    runtime.block_on(async {
        rig.sink.set_state(gst::State::Null).unwrap();
        rig.sink.set_state(gst::State::Playing).unwrap();
        rig.sink.set_state(gst::State::Null).unwrap();
    });
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

#[test]
fn absolute_and_centre_bring_the_target_to_the_middle() {
    for (mode, argument) in [("absolute", "&pan="), ("centre", "&center=")] {
        let camera = camera(Auth::None);
        let mut rig = Rig::ready(&camera.url()).with_str("mode", mode).play();
        rig.push_until(&target(TargetState::Tracking, 0.9, 0.5), &camera, |status| status.pan_deg > 10.0);
        rig.push_until(&target(TargetState::Tracking, 0.5, 0.5), &camera, |status| !status.moving);
        let moves = moves(&camera);
        assert!(moves[0].contains(argument), "{moves:?}");
        assert!(!moves.iter().any(|command| command.contains("continuous")), "{moves:?}");
    }
}

#[test]
fn at_its_limit_it_says_so_once_and_rests() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    let beyond = target(TargetState::Tracking, 0.9, 0.5);
    let heard = rig.push_until_message(&beyond, |heard| *heard == Heard::Camera(CameraChange::AtLimit));
    assert!(!heard.iter().any(Heard::is_warning), "{heard:?}");
    let end = camera.limits().pan_deg.1;
    rig.push_until(&beyond, &camera, |status| !status.moving && (status.pan_deg - end).abs() < 0.2);
    let requests = camera.status().requests;
    rig.push_until(&beyond, &camera, |status| status.requests > requests + 1);
    assert!(!rig.heard().contains(&Heard::Camera(CameraChange::AtLimit)));
}

#[test]
fn a_slow_camera_gets_the_newest_target_and_one_request_at_a_time() {
    let settings = Settings { service_time: Duration::from_millis(250), ..Settings::default() };
    let camera = VirtualCamera::start(settings).unwrap();
    let mut rig = Rig::playing(&camera.url());
    for frame in 0..60u32 {
        let x = 0.7 + f64::from(frame % 10) * 0.03;
        rig.push(&target(TargetState::Tracking, x, 0.5));
    }
    // The newest is on the left: whatever was queued would go to the right first, but for what is under way already.
    let left = target(TargetState::Tracking, 0.05, 0.5);
    rig.push(&left);
    let before = moves(&camera).len();
    rig.push_until(&left, &camera, |status| status.pan_rate_deg_s < 0.0);
    let moves = moves(&camera);
    let to_the_right = moves[before..].iter().filter(|query| !query.contains("move=-")).count();
    assert!(to_the_right <= 1, "after {before} of {moves:?}");
    assert!(rig.stats().get::<u64>("commands-coalesced").unwrap() > 0);
    // A stop at the end would not wait for ever for the camera's answer to something else.
    assert_eq!(camera.status().most_in_flight, 1);
}

#[test]
fn starting_and_stopping_leaves_nothing_behind() {
    const SINKS: usize = 50;
    let camera = camera(Auth::None);
    for _ in 0..SINKS {
        let mut rig = Rig::playing(&camera.url());
        rig.push(&target(TargetState::Tracking, 0.9, 0.5));
        let (freed, to_be_freed) = mpsc::channel();
        rig.sink.add_weak_ref_notify(move || {
            let _ = freed.send(());
        });
        drop(rig);
        // Whoever waited for the worker's end may be quicker than its last word to the sink.
        assert_eq!(to_be_freed.recv_timeout(PATIENCE), Ok(()), "the sink is still referred to");
    }
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    let threads = std::fs::read_dir("/proc/self/task").unwrap().filter(|task| {
        let name = std::fs::read_to_string(task.as_ref().unwrap().path().join("comm"));
        name.is_ok_and(|name| name.trim() == "vapix")
    });
    // Those of the plugin, and those in which messages of this and other tests were posted a moment ago.
    assert!(threads.count() < SINKS / 2, "threads are left behind");
}

#[test]
fn a_location_set_in_ready_counts() {
    let (old, new) = (camera(Auth::None), camera(Auth::None));
    let rig = Rig::ready(&old.url());
    rig.sink.set_state(gst::State::Ready).unwrap();
    let mut rig = rig.with("location", new.url()).play();
    rig.set_going(&new);
    assert_eq!(old.status().requests, 0);
}
