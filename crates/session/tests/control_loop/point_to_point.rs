// SPDX-License-Identifier: MPL-2.0

//! Where the camera looks, told or not, and what follows from that for limits and home.

use super::*;
use servo::{Home, Mounting, SoftLimits};

/// A camera at this pan; `None`: it will not tell.
fn looking(pan_deg: Option<f64>) -> impl Fn(&Request) -> Option<Result<Response, Error>> {
    move |request| {
        let position =
            pan_deg.map(|pan| Position { pan_deg: Some(pan), tilt_deg: Some(0.0), zoom: Some(0.0) });
        let answer = position.map(Response::Position).ok_or_else(|| Error::Camera("not now".to_owned()));
        (*request == Request::Query(Query::Position)).then_some(answer)
    }
}

fn within(min: f64, max: f64) -> ServoSettings {
    let limits = SoftLimits { pan_deg: Range { min, max }, ..SoftLimits::default() };
    ServoSettings { limits, ..ServoSettings::default() }
}

pub fn met(settings: ServoSettings, pan_deg: Option<f64>) -> Rig {
    let mut rig = Rig { control: control_loop(settings), now: ms(1000), sent: Vec::new() };
    rig.run_jobs(looking(pan_deg));
    rig
}

#[test]
fn limits_are_kept_while_the_camera_does_not_tell_for_once_and_it_is_asked_again_soon() {
    let mut rig = met(within(-30.0, 30.0), Some(30.0));
    rig.now += ms(5000);
    rig.see(0.9, 0.5);
    let asked = std::cell::Cell::new(0);
    for _ in 0..40 {
        rig.run_jobs(|request| {
            asked.set(asked.get() + u32::from(*request == Request::Query(Query::Position)));
            looking(None)(request)
        });
        rig.now += ms(50);
        rig.see(0.9, 0.5);
    }
    assert_eq!(rig.sent, [], "it looks at its end");
    assert!((2..=4).contains(&asked.get()), "{}", asked.get());
}

#[test]
fn limits_that_cannot_be_kept_are_told_once() {
    for (settings, pan, times) in [
        (within(-30.0, 30.0), None, 1),
        (within(-30.0, 30.0), Some(0.0), 0),
        (ServoSettings::default(), None, 0),
    ] {
        let mut rig = met(settings, pan);
        for _ in 0..100 {
            rig.now += ms(1000);
            rig.run_jobs(looking(pan));
        }
        let told = rig.reports().into_iter().filter(|report| *report == LoopEvent::LimitsUnkept).count();
        assert_eq!(told, times, "{pan:?}");
    }
    let mut rig = met(ServoSettings::default(), None);
    rig.control.configure(within(-30.0, 30.0));
    assert!(rig.reports().contains(&LoopEvent::LimitsUnkept), "set later");
}

#[test]
fn a_zoom_is_ended_before_the_camera_goes_home() {
    let there = Position { pan_deg: Some(9.0), tilt_deg: Some(0.0), zoom: None };
    let settings = ServoSettings {
        home: Some(Home::Position(there)),
        home_timeout: Duration::ZERO,
        ..ServoSettings::default()
    };
    let mut rig = Rig::new(settings);
    let zoom = Request::Command(Command::Move {
        motion: Motion::Velocity { pan: 0.0, tilt: 0.0, zoom: Some(0.2) },
        free: false,
    });
    rig.control.sending(&zoom, rig.now);
    rig.control.on_response(&zoom, Ok(Response::Accepted), rig.now, rig.now);
    rig.control
        .measure(Measurement { visibility: Visibility::Gone, ..Measurement::at(0.5, 0.5, rig.now) }, rig.now);
    let mut sent = rig.after(ms(100));
    sent.extend(rig.after(ms(100)));
    assert!(
        matches!(sent[..], [REST, Command::Move { motion: Motion::Absolute { pan_deg: 9.0, .. }, .. }]),
        "{sent:?}"
    );
}

/// Where nobody is, to be at home.
fn homeward() -> Rig {
    let there = Position { pan_deg: Some(90.0), tilt_deg: Some(0.0), zoom: None };
    Rig::new(ServoSettings {
        home: Some(Home::Position(there)),
        home_timeout: Duration::ZERO,
        ..ServoSettings::default()
    })
}

fn nobody(rig: &Rig) -> Measurement {
    Measurement { visibility: Visibility::Gone, ..Measurement::at(0.5, 0.5, rig.now) }
}

#[test]
fn a_move_that_went_unanswered_on_the_way_home_is_stopped() {
    let mut rig = homeward();
    rig.control.measure(nobody(&rig), rig.now);
    assert!(matches!(rig.after(ms(0))[..], [Command::Move { motion: Motion::Absolute { .. }, .. }]));
    rig.now += ms(200);
    rig.see(0.9, 0.5);
    rig.run(|_| Err(Error::Timeout(ms(1500))));
    let sent = mem::take(&mut rig.sent);
    assert!(matches!(sent[..], [Command::Move { motion: Motion::Velocity { .. }, .. }, ..]), "{sent:?}");
    // Nobody, before a stop could be sent.
    rig.control.lose_target();
    let sent: Vec<_> = (0..20).flat_map(|_| rig.after(ms(100))).collect();
    assert!(sent.first().is_some_and(Command::is_stop), "{sent:?}");
}

#[test]
fn a_move_home_that_is_accepted_once_it_is_not_wanted_any_more_is_stopped() {
    let mut rig = homeward();
    rig.control.measure(nobody(&rig), rig.now);
    let Next::Do(request) = rig.control.next_request(rig.now) else { panic!("it does not go home") };
    rig.control.sending(&request, rig.now);
    // As where the pipeline is paused.
    rig.control.release();
    rig.now += ms(100);
    rig.control.on_response(&request, Ok(Response::Accepted), rig.now, rig.now);
    let sent: Vec<_> = (0..5).flat_map(|_| rig.after(ms(100))).collect();
    assert!(matches!(sent[..], [Command::Stop(_)]), "{sent:?}");
}

/// The camera counts in its own picture, which is the one that arrives: an axis that is inverted within it inverts that too.
#[test]
fn whichever_axis_is_inverted_the_camera_centres_the_place_that_is_seen() {
    for (invert_pan, invert_tilt) in [(false, false), (true, false), (false, true), (true, true)] {
        let mounting = Mounting { invert_pan, invert_tilt, ..Mounting::default() };
        let mut rig = Rig::new(ServoSettings { mode: Mode::Centre, mounting, ..ServoSettings::default() });
        rig.see(0.9, 0.2);
        let sent = rig.after(ms(0));
        let [Command::Move { motion: Motion::Centre { x, y, width: 640, height: 480, .. }, .. }] = sent[..]
        else {
            panic!("{sent:?}")
        };
        assert!(x.abs_diff(576) <= 1 && y.abs_diff(96) <= 1, "{mounting:?}: {x}, {y}");
    }
}
