// SPDX-License-Identifier: MPL-2.0

//! The whole loop, with a camera that answers at once, or late, or not at all.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod closed_loop;
mod discovery;
mod learning;
mod motion;
mod others;
mod out_of_view;
mod point_to_point;
mod words;
mod zoom;

use std::collections::VecDeque;
use std::mem;

use std::time::Duration;

use proptest::prelude::*;
use servo::{
    HardLimits, Measurement, Mode, Motion, Position, Range, ServoSettings, SpeedMap, TableRow, Time,
    Visibility,
};
use session::session::{ConnectionChange, ControlOwner};
use session::{
    Attributes, Client, Command, ControlLoop, Error, LoopEvent, LoopSettings, Next, Query, Request, Response,
    SessionEvent, SessionSettings, Stop,
};

const HALT: Command = Command::Stop(Stop::PanTilt);
const REST: Command = Command::Stop(Stop::AllAxes);
const STOP: Command = Command::Stop(Stop::Position);

/// At which level of the speed map it pans.
fn pan_level(command: &Command) -> i8 {
    match command {
        Command::Move { motion: Motion::Velocity { pan, .. }, .. } => SpeedMap::level_of(*pan),
        _ => 0,
    }
}

/// A loop that speaks VAPIX.
fn control_loop(settings: impl Into<LoopSettings>) -> ControlLoop {
    ControlLoop::new(settings, &vapix::Client::PROTOCOL)
}

fn ms<T: From<Duration>>(ms: u64) -> T {
    Duration::from_millis(ms).into()
}

/// A camera that answers at once, and the loop that steers it.
struct Rig {
    control: ControlLoop,
    now: Time,
    sent: Vec<Command>,
}

impl Rig {
    fn new(settings: impl Into<LoopSettings>) -> Self {
        let mut rig = Self { control: control_loop(settings), now: ms(1000), sent: Vec::new() };
        rig.run(|_| Ok(Response::Accepted));
        assert_eq!(rig.sent, [], "a camera just met is asked, not moved");
        rig.reports();
        rig
    }

    /// Does everything that is due now; `position` answers the commands.
    fn run(&mut self, mut answer: impl FnMut(&Command) -> Result<Response, Error>) {
        self.run_jobs(|request| match request {
            Request::Command(command) => Some(answer(command)),
            Request::Query(_) => None,
        });
    }

    /// The same; `answer` may answer anything.
    fn run_jobs(&mut self, mut answer: impl FnMut(&Request) -> Option<Result<Response, Error>>) {
        while let Next::Do(request) = self.control.next_request(self.now) {
            self.control.sending(&request, self.now);
            if let Request::Command(command) = &request {
                self.sent.push(*command);
            }
            let result = answer(&request).unwrap_or_else(|| match &request {
                Request::Command(_) => Ok(Response::Accepted),
                Request::Query(Query::Position) => Ok(Response::Position(Position {
                    pan_deg: Some(0.0),
                    tilt_deg: Some(0.0),
                    zoom: Some(0.0),
                })),
                Request::Query(Query::Limits) => Ok(Response::Limits(HardLimits {
                    pan_deg: Some(Range { min: -170.0, max: 170.0 }),
                    field_angle_deg: Some(Range { min: 3.2, max: 60.0 }),
                    ..HardLimits::default()
                })),
                Request::Query(_) => Err(Error::Camera("none".to_owned())),
            });
            self.control.on_response(&request, result, self.now, self.now);
        }
    }

    fn see(&mut self, x: f64, y: f64) {
        self.control.measure(Measurement::at(x, y, self.now), self.now);
    }

    /// Sends what is due after a while, everything accepted, and returns the commands.
    fn after(&mut self, wait: Duration) -> Vec<Command> {
        self.now += wait;
        self.run(|_| Ok(Response::Accepted));
        mem::take(&mut self.sent)
    }

    fn reports(&mut self) -> Vec<LoopEvent> {
        self.control.take_events()
    }
}

#[test]
fn no_target_no_command() {
    let mut rig = Rig::new(ServoSettings::default());
    for _ in 0..100 {
        rig.control.measure(
            Measurement { visibility: Visibility::Gone, ..Measurement::at(0.9, 0.1, rig.now) },
            rig.now,
        );
        assert_eq!(rig.after(ms(100)), []);
    }
    assert_eq!(rig.reports(), []);
}

#[test]
fn a_centred_target_moves_nothing() {
    let mut rig = Rig::new(ServoSettings::default());
    for _ in 0..100 {
        rig.see(0.51, 0.49);
        assert_eq!(rig.after(ms(100)), []);
    }
}

#[test]
fn the_camera_turns_towards_the_target() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.see(0.9, 0.2);
    match rig.after(ms(0))[..] {
        [Command::Move { motion: Motion::Velocity { pan, tilt, zoom: None }, free: false }] => {
            assert!(pan > 0.0 && tilt > 0.0, "{pan}, {tilt}")
        }
        ref other => panic!("{other:?}"),
    }
    assert_eq!(rig.reports(), [LoopEvent::Session(SessionEvent::Moving)]);
    assert!(rig.control.status(rig.now).rate.pan > 0.0);
}

#[test]
fn a_lost_target_stops_it_at_once() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.see(0.9, 0.5);
    rig.after(ms(0));
    rig.control
        .measure(Measurement { visibility: Visibility::Gone, ..Measurement::at(0.9, 0.5, rig.now) }, rig.now);
    assert_eq!(rig.after(ms(1)), [HALT]);
    assert_eq!(
        rig.reports(),
        [LoopEvent::Session(SessionEvent::Moving), LoopEvent::Session(SessionEvent::Stopped)]
    );
    assert!(rig.control.session().is_at_rest());
    assert_eq!(rig.after(ms(60_000)), []);
}

#[test]
fn a_stale_target_stops_it() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.see(0.9, 0.5);
    rig.after(ms(0));
    let wake = match rig.control.next_request(rig.now) {
        Next::Wait(Some(wake)) => wake,
        other => panic!("{other:?}"),
    };
    assert!(wake <= rig.now + ServoSettings::default().stale_timeout);
    assert_eq!(rig.after(ms(1000)), [HALT]);
}

#[test]
fn a_camera_is_stopped_and_nobody_is_followed_while_the_picture_is_frozen() {
    let mut rig = Rig::new(ServoSettings::default());
    let begin = rig.now;
    let see = |rig: &mut Rig, unchanged_for: Duration| {
        let measurement = Measurement::at(0.9, 0.5, rig.now);
        rig.control.measure(Measurement { unchanged_for: Some(unchanged_for), ..measurement }, rig.now);
        let sent = rig.after(ms(40));
        (sent.last().copied(), rig.reports())
    };
    let frozen = loop {
        let lasted = rig.now - begin;
        assert!(lasted < ms(2000), "it turns on by a frozen picture");
        let (sent, events) = see(&mut rig, lasted);
        if events.contains(&LoopEvent::PictureFrozen) {
            break sent;
        }
    };
    assert_eq!(frozen, Some(HALT));
    for _ in 0..100 {
        let lasted = rig.now - begin;
        assert_eq!(see(&mut rig, lasted), (None, vec![]), "it is told once");
    }
    let (sent, events) = see(&mut rig, Duration::ZERO);
    assert!(matches!(sent, Some(Command::Move { .. })) && events.contains(&LoopEvent::PictureLive));
}

#[test]
fn a_predicted_target_is_followed_no_longer_than_a_stale_one() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.see(0.9, 0.5);
    rig.after(ms(0));
    let mut commands = Vec::new();
    for _ in 0..12 {
        rig.control.measure(
            Measurement { visibility: Visibility::Predicted, ..Measurement::at(0.9, 0.5, rig.now) },
            rig.now,
        );
        commands.extend(rig.after(ms(100)));
    }
    assert_eq!(commands.last(), Some(&HALT));
    assert!(commands.len() > 1, "it was followed for a while: {commands:?}");
}

#[test]
fn commands_keep_to_the_rate() {
    let session = SessionSettings { max_rate_hz: 5.0, ..SessionSettings::default() };
    let mut rig = Rig::new(LoopSettings { session, ..LoopSettings::default() });
    let mut commands = 0;
    for frame in 0..250u32 {
        rig.see(0.7 + f64::from(frame % 7) * 0.04, 0.5);
        commands += rig.after(ms(4)).len();
    }
    assert!((4..=6).contains(&commands), "{commands} commands in a second");
}

#[test]
fn at_its_limit_the_camera_is_stopped_in_that_axis_and_it_is_said_once() {
    let mut rig = point_to_point::met(ServoSettings::default(), Some(170.0));
    rig.reports();
    for _ in 0..5 {
        rig.see(0.9, 0.1);
        for command in rig.after(ms(100)) {
            assert!(
                matches!(
                    command,
                    Command::Move { motion: Motion::Velocity { pan: 0.0, tilt: 0.01.., zoom: None }, .. }
                ),
                "{command:?}"
            );
        }
    }
    assert_eq!(rig.reports(), [LoopEvent::AtLimit, LoopEvent::Session(SessionEvent::Moving)]);
}

#[test]
fn a_failed_stop_is_repeated() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.see(0.9, 0.5);
    rig.after(ms(0));
    rig.control.release();
    let mut failures = 3;
    for _ in 0..100 {
        rig.now += ms(50);
        rig.run(|_| {
            if failures == 0 {
                return Ok(Response::Accepted);
            }
            failures -= 1;
            Err(Error::Timeout(ms(1)))
        });
    }
    assert_eq!(mem::take(&mut rig.sent), [HALT; 4]);
    assert!(rig.control.session().is_at_rest());
    let disconnected = rig
        .reports()
        .into_iter()
        .filter(|report| {
            matches!(report, LoopEvent::Session(SessionEvent::Connection(ConnectionChange::Disconnected(_))))
        })
        .count();
    assert_eq!(disconnected, 1);
}

/// Over a network that holds them back for seconds nobody is followed by moves.
#[test]
fn what_a_move_that_went_unanswered_does_is_ended_before_the_next() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.see(0.9, 0.5);
    rig.run(|_| Err(Error::Timeout(ms(1))));
    rig.sent.clear();
    for _ in 0..20 {
        rig.now += ms(250);
        rig.see(0.9, 0.5);
        rig.run(|_| Err(Error::Timeout(ms(1))));
    }
    assert!(!rig.sent.is_empty() && rig.sent.iter().all(Command::is_stop), "{:?}", rig.sent);
    rig.sent.clear();
    rig.see(0.9, 0.5);
    assert_eq!(rig.after(ms(1000)), [HALT]);
    rig.see(0.9, 0.5);
    assert!(matches!(rig.after(ms(100))[..], [Command::Move { .. }]), "it hears again");
}

#[test]
fn what_a_predecessor_left_is_stopped_twice() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.control.session_mut().inherit(Stop::AllAxes, rig.now);
    assert_eq!(rig.after(ms(0)), [REST]);
    assert!(rig.control.session().is_at_rest() && !rig.control.session().stays_at_rest());
    assert_eq!(rig.after(ms(5000)), []);
    assert_eq!(rig.after(ms(1000)), [REST], "he may have said something that acts late");
    assert!(rig.control.session().stays_at_rest());
    assert_eq!(rig.after(ms(60_000)), []);
}

#[test]
fn a_camera_that_hears_is_stopped_before_we_are_somebody_else() {
    let mut rig = Rig::new(ServoSettings::default());
    assert_eq!(rig.control.session().parting_stop(rig.now), None);
    rig.see(0.9, 0.5);
    rig.after(ms(0));
    assert_eq!(rig.control.session().parting_stop(rig.now), Some(Stop::PanTilt));
    rig.see(0.1, 0.5);
    rig.now += ms(200);
    rig.run(|_| Err(Error::BadCredentials { user: "root".to_owned() }));
    assert_eq!(rig.control.session().parting_stop(rig.now), None, "nor would it listen");
}

#[test]
fn what_was_learned_outlives_the_same_answers_and_no_others() {
    let mut rig = Rig::new(ServoSettings::default());
    let limits =
        |wide| HardLimits { field_angle_deg: Some(Range { min: 3.2, max: wide }), ..HardLimits::default() };
    let attributes = |fastest| Attributes {
        speeds: [(1.0, 0.05), (100.0, fastest)]
            .map(|(step, value)| TableRow { setting: step / 100.0, value })
            .to_vec(),
        ..Attributes::default()
    };
    let tell = |rig: &mut Rig, query, answer| {
        rig.control.on_response(&Request::Query(query), Ok(answer), rig.now, rig.now);
        format!("{:?}", rig.control.servo())
    };
    tell(&mut rig, Query::Limits, Response::Limits(limits(60.0)));
    tell(&mut rig, Query::Attributes, Response::Attributes(attributes(150.0)));
    for step in 0..100 {
        let pan_deg = Some(0.1 * f64::from(step));
        let position = Position { pan_deg, tilt_deg: Some(0.0), zoom: Some(0.0) };
        tell(&mut rig, Query::Position, Response::Position(position));
        let ego_velocity = Some(ptztrack_contract::Vector { x: -0.02, y: 0.0 });
        rig.control.measure(Measurement { ego_velocity, ..Measurement::at(0.9, 0.5, rig.now) }, rig.now);
        rig.after(ms(40));
    }
    let learned = format!("{:?}", rig.control.servo());
    assert_eq!(tell(&mut rig, Query::Limits, Response::Limits(limits(60.0))), learned);
    assert_eq!(tell(&mut rig, Query::Attributes, Response::Attributes(attributes(150.0))), learned);
    let without_field = tell(&mut rig, Query::Limits, Response::Limits(limits(50.0)));
    assert_ne!(without_field, learned);
    let without_speeds = tell(&mut rig, Query::Attributes, Response::Attributes(attributes(90.0)));
    assert_ne!(without_speeds, without_field);
}

#[test]
fn wrong_credentials_end_all_asking_until_they_change() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.see(0.9, 0.5);
    rig.run(|_| Err(Error::BadCredentials { user: "root".to_owned() }));
    assert_eq!(mem::take(&mut rig.sent).len(), 1);
    for _ in 0..100 {
        rig.see(0.9, 0.5);
        assert_eq!(rig.after(ms(100)), []);
    }
    rig.control.session_mut().owner_changed(rig.now);
    rig.see(0.9, 0.5);
    assert_eq!(rig.after(ms(100)).len(), 1);
}

/// His password is for the end of what he began.
#[test]
fn who_stands_in_for_another_stops_the_camera_and_does_not_move_it() {
    let mut rig = Rig::new(ServoSettings::default());
    rig.control.session_mut().inherit(Stop::PanTilt, rig.now);
    rig.control.session_mut().stand_in(rig.now);
    let mut sent = Vec::new();
    for _ in 0..100 {
        rig.see(0.9, 0.5);
        sent.extend(rig.after(ms(100)));
    }
    assert_eq!(sent, [HALT; 2], "at once, and when the last doubt is over");
    assert!(rig.control.session().stays_at_rest());
    rig.control.session_mut().settle_speaker(rig.now);
    rig.see(0.9, 0.5);
    assert!(matches!(rig.after(ms(100))[..], [Command::Move { .. }]));
}

#[test]
fn what_the_user_may_not_ask_is_not_asked_again_and_the_rest_is_done() {
    for err in [Error::NotPermitted { user: "root".to_owned() }, Error::CredentialsMissing] {
        let mut control = control_loop(ServoSettings::default());
        let mut asked = Vec::new();
        while let Next::Do(Request::Query(query)) = control.next_request(ms(1000)) {
            asked.push(query);
            let answer = match query {
                Query::Position => Ok(Response::Position(Position::default())),
                _ => Err(err.clone()),
            };
            control.on_response(&Request::Query(query), answer, ms(1000), ms(1000));
        }
        assert_eq!(asked, vapix::Client::PROTOCOL.questions);
        assert!(!control.session().halted() && control.status(ms(1000)).connected);
        control.measure(Measurement::at(0.9, 0.5, ms(1000)), ms(1000));
        assert!(matches!(
            control.next_request(ms(1000)),
            Next::Do(Request::Command(Command::Move { motion: Motion::Velocity { .. }, .. }))
        ));
    }
}

#[test]
fn a_move_that_the_user_may_not_make_is_tried_rarely() {
    let mut rig = Rig::new(ServoSettings::default());
    for _ in 0..2000 {
        rig.see(0.9, 0.5);
        rig.run(|_| Err(Error::NotPermitted { user: "root".to_owned() }));
        rig.now += ms(100);
    }
    assert_eq!(
        mem::take(&mut rig.sent).len(),
        7,
        "at once, once more, after 10, 20, 40 and 60 s, and in each minute once"
    );
    assert!(matches!(
        rig.reports()[..],
        [LoopEvent::Session(SessionEvent::Connection(ConnectionChange::Refused(_)))]
    ));
    rig.now += Duration::from_secs(60);
    rig.see(0.9, 0.5);
    assert_eq!(rig.after(ms(0)).len(), 1);
}

#[test]
fn absolute_mode_steps_from_rest_to_rest() {
    let mut rig = Rig::new(ServoSettings { mode: Mode::Absolute, ..ServoSettings::default() });
    rig.see(1.0, 0.5);
    match rig.after(ms(0))[..] {
        [Command::Move { motion: Motion::Absolute { pan_deg, tilt_deg, speed: 1.0, zoom: None }, .. }] => {
            assert!((pan_deg - 30.0).abs() < 1e-6 && tilt_deg.abs() < 1e-6, "{pan_deg}, {tilt_deg}");
        }
        ref other => panic!("{other:?}"),
    }
    rig.see(1.0, 0.5);
    assert_eq!(rig.after(ms(100)), [], "under way");
    rig.after(ms(200));
    rig.after(ms(150));
    assert_eq!(
        rig.reports(),
        [LoopEvent::Session(SessionEvent::Moving), LoopEvent::Session(SessionEvent::Stopped)]
    );
    rig.see(1.0, 0.5);
    assert_eq!(rig.after(ms(10)), [], "the picture does not show the rest yet");
    rig.after(ms(300));
    rig.see(1.0, 0.5);
    assert_eq!(rig.after(ms(0)).len(), 1);
}

#[test]
fn centre_mode_names_the_pixel_and_stops_with_move_stop() {
    let mut rig = Rig::new(ServoSettings { mode: Mode::Centre, ..ServoSettings::default() });
    rig.see(0.75, 0.25);
    let expected = Command::Move {
        motion: Motion::Centre { x: 480, y: 120, width: 640, height: 480, magnify: None },
        free: false,
    };
    assert_eq!(rig.after(ms(0)), [expected]);
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [STOP]);
}

#[test]
fn a_move_by_speed_is_stopped_when_the_mode_becomes_one_of_steps() {
    for mode in [Mode::Absolute, Mode::Centre] {
        let mut rig = Rig::new(ServoSettings::default());
        rig.see(0.9, 0.5);
        rig.after(ms(0));
        rig.control.configure(ServoSettings { mode, ..ServoSettings::default() });
        // In the middle: no step is due that would end the move.
        rig.see(0.5, 0.5);
        assert_eq!(rig.after(ms(100)), [HALT], "{mode:?}");
        assert!(rig.control.session().is_at_rest());
    }
}

#[test]
fn a_step_under_way_is_forgotten_when_the_mode_becomes_speed() {
    let mut rig = Rig::new(ServoSettings { mode: Mode::Absolute, ..ServoSettings::default() });
    rig.see(1.0, 0.5);
    rig.after(ms(0));
    rig.control.configure(ServoSettings::default());
    for _ in 0..50 {
        rig.see(0.9, 0.5);
        rig.after(ms(100));
    }
    assert!(
        !rig.control.session().is_at_rest(),
        "a position that stays the same is no arrival of a move by speed"
    );
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [HALT]);
}

#[test]
fn a_step_is_ended_by_the_words_for_steps_whatever_the_mode_is_by_then() {
    let mut rig = Rig::new(ServoSettings { mode: Mode::Absolute, ..ServoSettings::default() });
    rig.see(1.0, 0.5);
    rig.after(ms(0));
    rig.control.configure(ServoSettings::default());
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [STOP]);
}

#[test]
fn a_target_goes_stale_while_an_answer_is_waited_for() {
    let mut rig = Rig::new(ServoSettings::default());
    assert_eq!(rig.control.stale_at(), None);
    rig.see(0.9, 0.5);
    let stale_at = rig.now + ServoSettings::default().stale_timeout;
    assert_eq!(rig.control.stale_at(), Some(stale_at));
    assert!(
        rig.control.servo().has_target(stale_at - Duration::from_millis(1))
            && !rig.control.servo().has_target(stale_at)
    );
}

#[test]
fn what_was_abandoned_for_a_stop_is_no_fault_but_may_have_acted() {
    let mut rig = Rig::new(ServoSettings::default());
    let request = Request::Command(Command::Move {
        motion: Motion::Velocity { pan: 0.1, tilt: 0.0, zoom: None },
        free: false,
    });
    rig.control.sending(&request, rig.now);
    rig.control.abandoned(&request, rig.now);
    rig.control.abandoned(&Request::Query(Query::Position), rig.now);
    assert!(!rig.control.session().is_at_rest());
    assert_eq!(rig.reports(), []);
    assert_eq!(rig.after(ms(1)), [HALT]);
    assert!(rig.control.session().is_at_rest());
}

/// A camera that turns as told, with everything late, before a person who walks.
fn walk(settings: ServoSettings, target_deg_s: f64, delay_frames: usize) -> Vec<f64> {
    const FRAME: Duration = Duration::from_millis(40);
    let mut rig = Rig::new(settings);
    let (mut camera_deg, mut target_deg, mut in_force) = (0.0, 5.0, VecDeque::from(vec![0i8; delay_frames]));
    let (mut offsets, mut command) = (Vec::new(), 0i8);
    let map = rig.control.estimates().map;
    for _ in 0..250 {
        in_force.push_back(command);
        let rate = map.deg_s(in_force.pop_front().unwrap());
        camera_deg += rate * FRAME.as_secs_f64();
        target_deg += target_deg_s * FRAME.as_secs_f64();
        let offset_deg: f64 = target_deg - camera_deg;
        offsets.push(offset_deg);
        let x = |deg: f64| 0.5 + deg.to_radians().tan() / (2.0 * 30f64.to_radians().tan());
        let velocity = (x(offset_deg) - x(offset_deg - (target_deg_s - rate) * 0.04)) / 0.04;
        let ego = (x(offset_deg) - x(offset_deg + rate * 0.04)) / 0.04;
        let seen = Measurement {
            velocity: ptztrack_contract::Vector { x: velocity, y: 0.0 },
            ego_velocity: Some(ptztrack_contract::Vector { x: ego, y: 0.0 }),
            ..Measurement::at(x(offset_deg), 0.5, rig.now)
        };
        rig.control.measure(seen, rig.now);
        for sent in rig.after(ms(0)) {
            command = pan_level(&sent);
        }
        rig.now += FRAME;
    }
    offsets
}

#[test]
fn a_walking_person_is_kept_in_the_middle_without_oscillation() {
    let offsets = walk(ServoSettings::default(), 5.0, 5);
    let settled = &offsets[100..];
    assert!(settled.iter().all(|offset| offset.abs() < 1.5), "{settled:?}");
    assert!(offsets.iter().all(|offset| *offset > -3.0), "overshoot: {offsets:?}");
}

#[test]
fn a_wrong_idea_of_the_latency_does_not_make_it_swing() {
    for delay_frames in [0, 2, 9] {
        let offsets = walk(ServoSettings::default(), 3.0, delay_frames);
        let worst = offsets[150..].iter().fold(0.0f64, |worst, offset| worst.max(offset.abs()));
        assert!(worst < 3.0, "{delay_frames} frames late: {worst} deg");
    }
}

#[test]
fn the_camera_comes_to_rest_at_a_standing_person() {
    let mut rig = Rig::new(ServoSettings::default());
    let offsets = walk(ServoSettings::default(), 0.0, 5);
    let settled = &offsets[100..];
    assert!(settled.iter().all(|offset| (offset - settled[0]).abs() < 1e-9), "{settled:?}");
    assert!(settled[0].abs() < 1.8);
    rig.see(0.5, 0.5);
    assert_eq!(rig.after(ms(500)), []);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Whatever is seen and whatever is answered, after the target is gone the camera is stopped.
    #[test]
    fn it_always_ends_at_rest(
        events in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64, 0u8..5, 1u64..500), 1..40),
    ) {
        let mut rig = Rig::new(ServoSettings::default());
        for (x, y, answer, wait) in events {
            rig.see(x, y);
            rig.now += ms(wait);
            rig.run(|_| match answer {
                0 => Err(Error::Timeout(ms(1))),
                1 => Err(Error::Camera("no".to_owned())),
                2 => Err(Error::Unreachable("no".to_owned())),
                _ => Ok(Response::Accepted),
            });
        }
        rig.control.release();
        let moved = !rig.control.session().is_at_rest();
        rig.sent.clear();
        for _ in 0..40 {
            rig.now += ms(250);
            rig.run(|_| Ok(Response::Accepted));
        }
        prop_assert!(rig.control.session().is_at_rest());
        prop_assert!(rig.sent.iter().all(Command::is_stop), "{:?}", rig.sent);
        prop_assert!(!moved || !rig.sent.is_empty());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Timestamps jump with the stream's segment or the pipeline's clock: what they say is not to be trusted.
    #[test]
    fn pictures_of_any_time_are_steered_by(
        jumps in prop::collection::vec((0u64..5000, any::<bool>()), 1..40),
        zooms in any::<bool>(),
    ) {
        let target_height = zooms.then_some(0.5);
        let mut rig = Rig::new(ServoSettings { target_height, ..ServoSettings::default() });
        for (late, right) in jumps {
            rig.now += ms(40);
            let x = if right { 0.9 } else { 0.1 };
            rig.control.measure(Measurement::at(x, 0.5, rig.now - Duration::from_millis(late)), rig.now);
            rig.after(ms(0));
        }
        // Two seconds of pictures that are what they seem.
        for _ in 0..50 {
            rig.see(0.9, 0.5);
            let sent = rig.after(ms(40));
            prop_assert!(sent.len() <= 2);
        }
        prop_assert!(rig.control.status(rig.now).rate.pan > 0.0);
        prop_assert!(rig.after(ms(1100)).last().is_some_and(Command::is_stop));
    }
}
