// SPDX-License-Identifier: MPL-2.0

//! A target that goes out of the picture.

use super::*;
use ptztrack_contract::{Rect, Vector};

const PICTURE: Duration = Duration::from_millis(100);

/// Somebody who walks out of the picture to the right, 18 degrees a second, so near its edge that they are cut by it.
fn leaving(now: Time) -> Measurement {
    Measurement {
        bounds: Rect { x: 0.88, y: 0.3, width: 0.12, height: 0.4 },
        velocity: Vector { x: 0.3, y: 0.0 },
        ..Measurement::at(0.95, 0.5, now)
    }
}

/// They were seen, too short for the camera's turn to show, and it turns after them.
fn with_somebody_leaving(settings: ServoSettings) -> Rig {
    let mut rig = Rig::new(settings);
    for _ in 0..5 {
        rig.control.measure(leaving(rig.now), rig.now);
        rig.after(ms(20));
    }
    assert!(!rig.control.session().is_at_rest());
    rig
}

/// Pictures without them: for how long the camera goes on to the right before it is stopped.
fn goes_on_for(rig: &mut Rig, visibility: Visibility) -> Duration {
    let begin = rig.now;
    loop {
        let picture = Measurement { visibility, ..Measurement::at(0.0, 0.0, rig.now) };
        rig.control.measure(picture, rig.now);
        let sent = rig.after(PICTURE);
        if sent.contains(&HALT) {
            assert!(rig.control.session().is_at_rest());
            return rig.now - begin;
        }
        assert!(sent.iter().all(|command| pan_level(command) > 0), "{sent:?}");
        assert!(rig.now - begin < ms(20_000), "it turns on and on");
    }
}

#[test]
fn the_camera_turns_on_after_whoever_goes_out_of_the_picture_but_not_for_ever() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    let lasted = goes_on_for(&mut rig, Visibility::Gone);
    let search_time = ServoSettings::default().search_time;
    assert!(lasted <= search_time && lasted + 2 * PICTURE >= search_time, "{lasted:?}");
    assert_eq!(goes_on_for_nobody(&mut rig), []);
}

/// What is sent in a minute of pictures without anybody.
fn goes_on_for_nobody(rig: &mut Rig) -> Vec<Command> {
    (0..600)
        .flat_map(|_| {
            let picture = Measurement { visibility: Visibility::Gone, ..Measurement::at(0.0, 0.0, rig.now) };
            rig.control.measure(picture, rig.now);
            rig.after(PICTURE)
        })
        .collect()
}

#[test]
fn whoever_is_let_go_on_purpose_is_not_gone_after() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    assert_eq!(goes_on_for(&mut rig, Visibility::Released), PICTURE);
}

#[test]
fn nobody_is_gone_after_where_that_is_not_wanted() {
    let mut rig =
        with_somebody_leaving(ServoSettings { search_time: Duration::ZERO, ..ServoSettings::default() });
    assert_eq!(goes_on_for(&mut rig, Visibility::Gone), PICTURE);
}

#[test]
fn who_is_lost_at_the_edge_but_goes_inwards_is_not_gone_after() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    let inwards = Measurement { velocity: Vector { x: -0.3, y: 0.0 }, ..leaving(rig.now) };
    rig.control.measure(inwards, rig.now);
    rig.after(ms(1));
    assert_eq!(goes_on_for(&mut rig, Visibility::Gone), PICTURE);
}

#[test]
fn without_pictures_it_is_stopped_as_soon_as_ever() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    rig.control
        .measure(Measurement { visibility: Visibility::Gone, ..Measurement::at(0.0, 0.0, rig.now) }, rig.now);
    let begin = rig.now;
    while !rig.after(PICTURE).contains(&HALT) {
        assert!(rig.now - begin < ms(20_000), "it turns on and on");
    }
    assert_eq!(rig.now - begin, ServoSettings::default().stale_timeout);
}

#[test]
fn who_comes_back_into_view_is_followed() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    for _ in 0..10 {
        rig.control.measure(
            Measurement { visibility: Visibility::Gone, ..Measurement::at(0.0, 0.0, rig.now) },
            rig.now,
        );
        rig.after(PICTURE);
    }
    rig.see(0.1, 0.5);
    let sent = rig.after(PICTURE);
    assert!(pan_level(sent.last().unwrap()) < 0, "{sent:?}");
}
