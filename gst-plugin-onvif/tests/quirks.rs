// SPDX-License-Identifier: MPL-2.0

//! Cameras as they are, followed with over real HTTP, in stepped time and with properties as they are by default.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

#[path = "../../gst-plugin-vapix/tests/common/mod.rs"]
mod common;

use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use common::stage::{FRAME, Shown, Stage, departing, in_part, mean_distance, pacing, seen};
use common::{Heard, Rig, target};
use ptztrack_contract::{TargetMeta, TargetState, Vector};
use virtual_camera::{
    Auth, Kinematics, OnvifSettings, Pose, ProportionalSpeed, Quirk, Settings, SpeedMap, SyntheticSettings,
    World,
};

/// How long somebody is followed: to and fro, and to and fro again.
const FOLLOWED_S: f64 = 60.0;

fn camera(onvif: OnvifSettings, full_speed_deg_s: f64) -> Settings {
    static REGISTER: Once = Once::new();
    REGISTER.call_once(|| {
        gst::init().unwrap();
        gstonvifptz::plugin_register_static().unwrap();
    });
    let proportional_speed = ProportionalSpeed { enabled: false, ..Kinematics::default().proportional_speed };
    let speed_map = SpeedMap::Linear { max_deg_s: full_speed_deg_s };
    let kinematics = Kinematics { speed_map, proportional_speed, ..Kinematics::default() };
    Settings { auth: Auth::Digest { qop: true }, onvif: Some(onvif), ..pacing(2, 6, 55.2, kinematics) }
}

fn log_in(rig: Rig) -> Rig {
    rig.with("user", "root").with("password", "pass")
}

/// Has every case tested, some at once: each waits for its camera most of the time.
fn each<T: Copy + Sync>(cases: &[T], test: impl Fn(T) + Sync) {
    const AT_ONCE: usize = 4;
    let next = AtomicUsize::new(0);
    let take = || cases.get(next.fetch_add(1, Ordering::Relaxed)).copied();
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| std::iter::from_fn(take).for_each(&test));
        }
    });
}

/// Follows for a while, loses the target and sees the camera come to rest; returns what was to be seen.
fn follow(what: &str, settings: Settings) -> (Vec<Shown>, Stage) {
    let mut stage = Stage::new(settings, log_in);
    let shown = stage.follow(FOLLOWED_S);
    let pictures = (FOLLOWED_S / FRAME.as_secs_f64()).round() as usize;
    assert!(shown.len() >= pictures - 5, "{what}: seen in {} of {pictures} pictures", shown.len());
    assert!(stage.heard.iter().all(|heard| !matches!(heard, Heard::Error(_))), "{what}: {:?}", stage.heard);
    stage.run(8.0, &target(TargetState::Searching, 0.5, 0.5));
    assert!(!stage.camera.status().moving, "{what}: it turns on: {:?}", stage.moves());
    (shown, stage)
}

/// How far from the middle, in the second half, once latency and speeds are known.
fn follows(what: &str, settings: Settings, farthest: f64) -> Stage {
    let (shown, stage) = follow(what, settings);
    let settled = mean_distance(&shown[shown.len() / 2..]);
    assert!(settled < farthest, "{what}: {settled} from the middle");
    stage
}

#[test]
fn a_camera_as_specified() {
    let stage = follows("as specified", camera(OnvifSettings::default(), 120.0), 0.12);
    assert!(
        stage.moves().iter().any(|sent| sent.contains("ContinuousMove") && sent.contains("Timeout=PT2S"))
    );
    assert!(!stage.heard.iter().any(Heard::is_warning), "{:?}", stage.heard);
}

#[test]
fn each_quirk() {
    each(Quirk::ALL, |quirk| {
        let stage = follows(quirk.switch(), camera(OnvifSettings::with(&[quirk]), 120.0), 0.25);
        let warnings: Vec<_> = stage.heard.into_iter().filter_map(Heard::into_warning).collect();
        let expected = match quirk {
            Quirk::TimeoutRefused => &["refuses moves with a time limit"][..],
            _ => &[],
        };
        let told = warnings.iter().zip(expected).all(|(warning, expected)| warning.contains(expected));
        assert!(warnings.len() == expected.len() && told, "{}: {warnings:?}", quirk.switch());
    });
}

#[test]
fn all_that_can_be_had_together() {
    follows("together", camera(OnvifSettings::with(&Quirk::together()), 120.0), 0.25);
}

/// Velocities are told in degrees a second where the camera takes them so; what it says of these is believed as far as the picture
/// bears it out.
#[test]
fn cameras_that_take_degrees_a_second() {
    each(&[(120.0, 0.12), (40.0, 0.2), (360.0, 0.2)], |(announced_deg_s, farthest)| {
        let onvif = OnvifSettings { degrees_s: Some(announced_deg_s), ..OnvifSettings::default() };
        let what = format!("{announced_deg_s} degrees a second, which are 120");
        let stage = follows(&what, camera(onvif, 120.0), farthest);
        assert!(stage.moves().iter().any(|sent| sent.contains("VelocitySpaceDegrees")), "{what}");
    });
}

/// The same in fields of view a second, of which degrees are made by the picture's scale.
#[test]
fn cameras_that_take_fields_of_view_a_second() {
    let really = 120.0 / 55.2;
    each(&[(really, 0.12), (really / 3.0, 0.2), (3.0 * really, 0.2)], |(announced, farthest)| {
        let onvif = OnvifSettings { fields_s: Some(announced), ..OnvifSettings::default() };
        let what = format!("{announced} fields of view a second, which are {really}");
        let stage = follows(&what, camera(onvif.clone(), 120.0), farthest);
        assert!(stage.moves().iter().any(|sent| sent.contains("VelocitySpaceFOV")), "{what}");
        let mut stage = zooming(camera(onvif, 120.0));
        let (least, most) = walk_away(&mut stage);
        let parts = (least / TARGET_HEIGHT, most / TARGET_HEIGHT);
        assert!(parts.0 > 0.8 && parts.1 < 1.2, "{what}: {parts:?}");
    });
}

#[test]
fn a_camera_that_refuses_the_units_that_it_announces() {
    let onvif = OnvifSettings {
        fields_s: Some(2.0),
        degrees_s: Some(120.0),
        refuses_units: true,
        ..OnvifSettings::default()
    };
    let stage = follows("refused units", camera(onvif, 120.0), 0.12);
    assert!(!stage.heard.iter().any(Heard::is_warning), "{:?}", stage.heard);
    let refused = stage.moves().iter().filter(|sent| sent.contains("VelocitySpace")).count();
    assert!((1..=4).contains(&refused), "each is tried once, with a `Timeout` and without: {refused}");
}

#[test]
fn cameras_much_faster_and_slower_than_is_assumed() {
    each(&[30.0, 60.0, 240.0, 360.0], |full_speed_deg_s| {
        let what = format!("{full_speed_deg_s} degrees a second");
        follows(&what, camera(OnvifSettings::default(), full_speed_deg_s), 0.12);
    });
}

#[test]
fn commands_that_act_late() {
    each(&[5, 100, 400, 800], |delay_ms| {
        let mut settings = camera(OnvifSettings::default(), 120.0);
        settings.kinematics.command_delay = Duration::from_millis(delay_ms);
        follows(&format!("{delay_ms} ms"), settings, 0.25);
    });
}

/// The camera turns away from the person at first; how far is bounded by moves that are slow until it is known better.
#[test]
fn a_mirrored_pan_is_corrected_within_five_seconds() {
    each(&[60, 800], |delay_ms| {
        let mut settings = camera(OnvifSettings::with(&[Quirk::PanMirrored]), 120.0);
        settings.kinematics.command_delay = Duration::from_millis(delay_ms);
        let mut stage = Stage::new(settings, log_in);
        let shown = stage.follow(FOLLOWED_S);
        let farthest = shown.iter().map(|shown| 55.2 * shown.offset.0.abs()).fold(0.0, f64::max);
        assert!(farthest < 20.0, "{delay_ms} ms late: {farthest} degrees away");
        let begins = shown.iter().find(|shown| shown.distance() > 0.05).unwrap().at;
        let later = shown.iter().filter(|shown| shown.at > begins + Duration::from_secs(5));
        let farthest = later.map(|shown| 55.2 * shown.offset.0.abs()).fold(0.0, f64::max);
        assert!(farthest < 10.0, "{delay_ms} ms late: {farthest} degrees away after 5 s");
        let told = |heard: &Heard| matches!(heard, Heard::Info(text) if text.contains("invert-pan"));
        assert!(stage.heard.iter().any(told), "{delay_ms} ms late");
    });
}

/// How tall somebody is to be kept.
const TARGET_HEIGHT: f64 = 0.5;

/// Before somebody who walks away, with `auto-zoom`.
fn zooming(settings: Settings) -> Stage {
    let world = SyntheticSettings { wide_fov_deg: 55.2, ..SyntheticSettings::default() };
    let settings = Settings { world: World::Synthetic(world), home: Some(Pose::default()), ..settings };
    Stage::new(settings, |rig| log_in(rig).with("auto-zoom", true).with("target-height", TARGET_HEIGHT))
}

/// What a tracker says of the next picture: of who goes this way, and of the background.
fn next(stage: &mut Stage, way: impl Fn(Duration) -> (f64, f64)) -> TargetMeta {
    let exposure = (stage.now + FRAME).saturating_sub(stage.camera.video_delay());
    stage.camera.advance_to(stage.now + FRAME);
    let before = exposure.saturating_sub(FRAME);
    let meta = seen(stage, exposure, way(exposure)).unwrap_or_else(|| panic!("lost after {:?}", stage.now));
    let was = seen(stage, before, way(before)).unwrap_or_else(|| meta.clone());
    let turned = seen(stage, exposure, way(before)).unwrap_or_else(|| meta.clone());
    let per_s = |to: &TargetMeta| Vector {
        x: (to.centroid.x - was.centroid.x) / FRAME.as_secs_f64(),
        y: (to.centroid.y - was.centroid.y) / FRAME.as_secs_f64(),
    };
    let ego_zoom = Some(stage.growth(before, exposure));
    TargetMeta { velocity: per_s(&meta), ego_velocity: Some(per_s(&turned)), ego_zoom, ..meta }
}

/// Whoever walks away is followed for half a minute; returns the least and the greatest height meanwhile, once it began.
fn walk_away(stage: &mut Stage) -> (f64, f64) {
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    while stage.now < Duration::from_secs(30) {
        let meta = next(stage, departing);
        stage.picture(Some(&meta));
        if stage.now > Duration::from_secs(6) {
            (least, most) = (least.min(meta.bounds.height), most.max(meta.bounds.height));
        }
    }
    (least, most)
}

/// Nobody is there, and the background is seen; for so long.
fn nobody(stage: &mut Stage, seconds: u64) {
    let end = stage.now + Duration::from_secs(seconds);
    while stage.now < end {
        let exposure = (stage.now + FRAME).saturating_sub(stage.camera.video_delay());
        stage.camera.advance_to(stage.now + FRAME);
        let ego_zoom = Some(stage.growth(exposure.saturating_sub(FRAME), exposure));
        let ego_velocity = Some(Vector::default());
        stage.picture(Some(&TargetMeta {
            ego_velocity,
            ego_zoom,
            ..target(TargetState::Searching, 0.5, 0.5)
        }));
    }
}

/// By what the picture shows: the camera tells nothing of its lens. Once nobody is there the view is as wide as it goes again.
#[test]
fn somebody_who_walks_away_stays_as_tall() {
    let quirks = Quirk::ALL.iter().copied().filter(|quirk| *quirk != Quirk::ZoomBreaks).map(Some);
    let cases: Vec<_> = quirks.chain([None]).collect();
    each(&cases, |quirk| {
        let what = quirk.map_or("as specified", Quirk::switch);
        let tolerance = match quirk {
            // Half a second late, nobody knows how tall they are by now.
            Some(Quirk::Late) => 0.5,
            // It goes farther than it is told, and is brought back: only that it does not run away is asked.
            Some(Quirk::ZoomOneSpeed) => 1.0,
            _ => 0.2,
        };
        let mut stage = zooming(camera(OnvifSettings::with(quirk.as_slice()), 120.0));
        let (least, most) = walk_away(&mut stage);
        let parts = (least / TARGET_HEIGHT, most / TARGET_HEIGHT);
        assert!(parts.0 > 1.0 - tolerance && parts.1 < 1.0 + tolerance, "{what}: {parts:?}");
        assert!(stage.camera.status().zoom_step > 500.0, "{what}: {:?}", stage.camera.status());
        nobody(&mut stage, 30);
        let status = stage.camera.status();
        assert!(!status.moving && status.zoom_step < 10.0, "{what}: {status:?}, {:?}", stage.moves());
    });
}

#[test]
fn somebody_seen_in_part_for_a_while_is_not_zoomed_in_on() {
    let mut stage = zooming(camera(OnvifSettings::default(), 120.0));
    let mut narrowest = 0.0f64;
    while stage.now < Duration::from_secs(12) {
        let whole = next(&mut stage, |_| (8.0, 0.0));
        let is_part = stage.now > Duration::from_secs(8);
        stage.picture(Some(&if is_part { in_part(&whole) } else { whole }));
        let zoom_step = stage.camera.status().zoom_step;
        if !is_part {
            narrowest = narrowest.max(zoom_step);
        }
        assert!(zoom_step <= narrowest, "{zoom_step} after {narrowest}");
    }
    assert!(narrowest > 100.0, "it zoomed to {narrowest}");
}

/// What it was told it does, whatever it answers.
#[test]
fn a_zoom_that_breaks_the_answer_is_stopped_and_left_alone() {
    for quirks in [
        &[Quirk::ZoomBreaks][..],
        &[Quirk::ZoomBreaks, Quirk::StopMissing],
        &[Quirk::ZoomBreaks, Quirk::TimeoutIgnored],
    ] {
        let mut stage = zooming(camera(OnvifSettings::with(quirks), 120.0));
        walk_away(&mut stage);
        let zoom_step = stage.camera.status().zoom_step;
        let told = |heard: &Heard| matches!(heard, Heard::Warning(text) if text.contains("it is not zoomed from now on"));
        assert_eq!(
            stage.heard.iter().filter(|heard| told(heard)).count(),
            1,
            "{quirks:?}: {:?}",
            stage.heard
        );
        nobody(&mut stage, 10);
        let status = stage.camera.status();
        assert!(!status.moving && status.zoom_step == zoom_step, "{quirks:?}: {zoom_step}, then {status:?}");
    }
}
