// SPDX-License-Identifier: MPL-2.0

//! Proportional speed, on as cameras leave the factory: zoomed in, a person is followed as well as without it. Over real
//! HTTP, in stepped time.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::Heard;
use common::stage::{Shown, Stage, mean_distance, pacing};
use virtual_camera::{Kinematics, ProportionalRule, ProportionalSpeed, PtzApi, Settings, World};

const FOV_DEG: f64 = 36.0;
const OFF: ProportionalSpeed =
    ProportionalSpeed { enabled: false, max_fields_s: 2.0, rule: ProportionalRule::Cap };
/// By the factory's 200 % all speeds shrink with the view, ...
const SCALED: ProportionalSpeed =
    ProportionalSpeed { enabled: true, max_fields_s: 2.0, rule: ProportionalRule::Scale };
/// ... or the fastest are out of reach, ...
const CAPPED: ProportionalSpeed = ProportionalSpeed { rule: ProportionalRule::Cap, ..SCALED };
/// ... as is, by less, even the speed of who walks.
const TOO_SLOW: ProportionalSpeed = ProportionalSpeed { max_fields_s: 0.2, ..CAPPED };

/// A camera zoomed in ten times, before somebody small who paces at a third of its view a second.
fn zoomed_in(api: PtzApi, proportional_speed: ProportionalSpeed) -> Stage {
    let kinematics =
        Kinematics { proportional_speed, max_magnification: Some(10.0), ..Kinematics::default() };
    let mut settings = Settings { ptz_api: api, ..pacing(4, 25, FOV_DEG, kinematics) };
    if let World::Synthetic(world) = &mut settings.world {
        // Fine enough for steady ground truth, and whole in the narrow view.
        (world.size, world.person_height_deg) = ((4096, 3072), 1.2);
    }
    if let Some(home) = &mut settings.home {
        home.zoom_step = 9999.0;
    }
    Stage::new(settings, |rig| rig)
}

fn follow(stage: &mut Stage) -> Vec<Shown> {
    let shown = stage.follow(28.0);
    assert!(!stage.heard.iter().any(Heard::is_warning), "{:?}", stage.heard);
    shown
}

/// Mean distance from the middle once it is under way, in parts of the picture; infinite where the person was lost.
fn distance(shown: &[Shown]) -> f64 {
    if shown.len() < 690 { f64::INFINITY } else { mean_distance(&shown[200..]) }
}

/// How many of the moves were to be free of proportional speed.
fn free(stage: &Stage) -> usize {
    stage.moves().iter().filter(|query| query.contains("proportionalspeed=disabled")).count()
}

#[test]
fn it_is_turned_off_where_the_firmware_takes_that() {
    let mut without = zoomed_in(PtzApi::Extended, OFF);
    let aim = distance(&follow(&mut without));
    assert_eq!(free(&without), 0, "nothing to turn off");
    for proportional in [SCALED, CAPPED, TOO_SLOW] {
        let mut stage = zoomed_in(PtzApi::Extended, proportional);
        let found = distance(&follow(&mut stage));
        assert!(found < 1.1 * aim, "{proportional:?}: {found} instead of {aim}");
        assert!(free(&stage) > 10, "{:?}", stage.moves());
    }
}

#[test]
fn it_is_modelled_where_the_firmware_does_not_know_or_refuses_the_word() {
    for api in [PtzApi::Classic, PtzApi::Attributes] {
        let aim = distance(&follow(&mut zoomed_in(api, OFF)));
        let mut stage = zoomed_in(api, CAPPED);
        let found = distance(&follow(&mut stage));
        assert!(found < 1.1 * aim, "{api:?}: {found} instead of {aim}");
        // Asked once, of who seems to know it.
        assert_eq!(free(&stage), usize::from(api == PtzApi::Attributes), "{api:?}");
        assert_eq!(stage.rig.stats().get::<String>("mode").unwrap(), "velocity");
    }
}
