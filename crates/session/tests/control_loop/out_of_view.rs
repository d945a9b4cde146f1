// SPDX-License-Identifier: MPL-2.0

//! A target that goes out of the picture.

use super::*;
use ptztrack_contract::{Point, Rect, Vector};

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

/// A picture in which they are not found any more.
fn lose(rig: &mut Rig) {
    rig.control
        .measure(Measurement { visibility: Visibility::Lost, ..Measurement::at(0.0, 0.0, rig.now) }, rig.now);
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
    lose(&mut rig);
    let lasted = goes_on_for(&mut rig, Visibility::Gone);
    let search_time = ServoSettings::default().search_time;
    assert!(lasted <= search_time && lasted >= ms(1500), "{lasted:?}");
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
    assert_eq!(goes_on_for(&mut rig, Visibility::Lost), PICTURE);
}

/// As where the picture in which they were lost was dropped.
#[test]
fn nobody_is_gone_after_who_is_not_known_to_be_lost() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    assert_eq!(goes_on_for(&mut rig, Visibility::Gone), PICTURE);
}

#[test]
fn who_is_let_go_after_they_were_lost_is_gone_after_no_longer() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    lose(&mut rig);
    assert_eq!(goes_on_for(&mut rig, Visibility::Released), PICTURE);
}

/// They are hidden where they are predicted to go out of view.
#[test]
fn who_was_hidden_before_they_would_have_left_is_not_gone_after() {
    let mut rig = Rig::new(ServoSettings::default());
    let inside = |now| Measurement {
        centroid: Point { x: 0.8, y: 0.5 },
        bounds: Rect { x: 0.74, y: 0.3, width: 0.12, height: 0.4 },
        ..leaving(now)
    };
    rig.control.measure(inside(rig.now), rig.now);
    rig.after(ms(20));
    rig.control.measure(Measurement { visibility: Visibility::Predicted, ..leaving(rig.now) }, rig.now);
    rig.after(ms(20));
    assert_eq!(goes_on_for(&mut rig, Visibility::Lost), PICTURE);
}

/// Where the background was not seen in the last picture before they were lost.
#[test]
fn who_was_hidden_for_a_picture_as_they_left_is_gone_after_all_the_same() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    rig.control.measure(Measurement { visibility: Visibility::Predicted, ..leaving(rig.now) }, rig.now);
    rig.after(ms(20));
    lose(&mut rig);
    assert!(goes_on_for(&mut rig, Visibility::Gone) >= ms::<Duration>(1500));
}

/// It never goes further than whoever walks straight on could get.
#[test]
fn however_fast_they_went_the_camera_comes_to_rest_before_it_looks_back() {
    for velocity in [Vector { x: 1.5, y: 0.0 }, Vector { x: 1.5, y: -1.5 }] {
        comes_to_rest_after(velocity);
    }
}

fn comes_to_rest_after(velocity: Vector) {
    let settings = ServoSettings { search_time: ms(10_000), ..ServoSettings::default() };
    let mut rig = Rig::new(settings);
    let begin = rig.now;
    for _ in 0..5 {
        rig.control.measure(Measurement { velocity, ..leaving(rig.now) }, rig.now);
        rig.after(ms(20));
    }
    for _ in 0..120 {
        let picture = Measurement { visibility: Visibility::Lost, ..Measurement::at(0.0, 0.0, rig.now) };
        rig.control.measure(picture, rig.now);
        let sent = rig.after(PICTURE);
        assert!(sent.iter().all(|command| pan_level(command) >= 0), "{sent:?}");
    }
    let turned = rig.control.servo().camera().history.rotation(begin, rig.now);
    assert!((60.0..140.0).contains(&turned.pan) && turned.tilt < 100.0, "{turned:?}");
    assert!(rig.control.session().is_at_rest());
}

#[test]
fn who_is_lost_at_the_edge_but_goes_inwards_is_not_gone_after() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    let inwards = Measurement { velocity: Vector { x: -0.3, y: 0.0 }, ..leaving(rig.now) };
    rig.control.measure(inwards, rig.now);
    rig.after(ms(1));
    assert_eq!(goes_on_for(&mut rig, Visibility::Lost), PICTURE);
}

#[test]
fn without_pictures_it_is_stopped_as_soon_as_ever() {
    let mut rig = with_somebody_leaving(ServoSettings::default());
    lose(&mut rig);
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
        lose(&mut rig);
        rig.after(PICTURE);
    }
    rig.see(0.1, 0.5);
    let sent = rig.after(PICTURE);
    assert!(pan_level(sent.last().unwrap()) < 0, "{sent:?}");
}

/// Follows somebody who is to the right, while the background is seen to move as the camera pans; tilt is never told.
fn with_pan_known() -> Rig {
    let settings = ServoSettings { learn_axes: true, ..ServoSettings::default() };
    let mut rig = Rig::new(settings);
    for _ in 0..100 {
        let fields_s = rig.control.status(rig.now).rate.pan / rig.control.estimates().fov_deg;
        let ego_velocity = Some(Vector { x: -fields_s, y: 0.0 });
        rig.control.measure(Measurement { ego_velocity, ..Measurement::at(0.8, 0.5, rig.now) }, rig.now);
        rig.after(ms(50));
    }
    rig
}

/// For how long the camera goes on after somebody who goes there.
fn goes_after(mut rig: Rig, leaving: impl Fn(Time) -> Measurement) -> Duration {
    for _ in 0..5 {
        rig.control.measure(leaving(rig.now), rig.now);
        rig.after(ms(20));
    }
    assert!(!rig.control.session().is_at_rest());
    goes_on_for(&mut rig, Visibility::Lost)
}

#[test]
fn nobody_is_gone_after_by_an_axis_of_which_nobody_knows_which_way_it_turns() {
    let below = |now| Measurement {
        centroid: Point { x: 0.6, y: 0.9 },
        bounds: Rect { x: 0.55, y: 0.7, width: 0.1, height: 0.3 },
        velocity: Vector { x: 0.0, y: 0.3 },
        ..leaving(now)
    };
    assert!(goes_after(with_pan_known(), leaving) >= ms::<Duration>(1000));
    assert_eq!(goes_after(with_pan_known(), below), PICTURE);
    let unknown = Rig::new(ServoSettings { learn_axes: true, ..ServoSettings::default() });
    assert_eq!(goes_after(unknown, leaving), PICTURE);
}
