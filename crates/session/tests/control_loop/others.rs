// SPDX-License-Identifier: MPL-2.0

//! The camera in others' hands, or perhaps in others' hands.

use super::*;
use ptztrack_contract::Vector;
use servo::Access;
use session::{Parameters, Protocol, QueuePlace};

type Said = Option<Result<Response, Error>>;

/// A camera with a control queue that says so, and where we stand; `None`: it is full. A stop is taken or not.
fn queued(place: Option<u32>, takes_stops: bool) -> impl Fn(&Request) -> Said {
    move |request| {
        let refused = |text: &str| Some(Err(Error::Camera(text.to_owned())));
        match request {
            Request::Query(Query::Parameters) => {
                let control_queue = Some(true);
                Some(Ok(Response::Parameters(Parameters { control_queue, ..Parameters::default() })))
            }
            Request::Query(Query::Queue(_)) => {
                let Some(position) = place else { return refused("queue full") };
                let place = QueuePlace { position, poll_every: ms(10_000) };
                Some(Ok(Response::Place(Some(place))))
            }
            Request::Command(command) if place != Some(1) && !(takes_stops && command.is_stop()) => {
                refused("not in control")
            }
            _ => None,
        }
    }
}

impl Rig {
    /// A camera that turns, after it was told so in our turn.
    fn turning_in_turn() -> Self {
        let mut rig =
            Self { control: control_loop(ServoSettings::default()), now: ms(1000), sent: Vec::new() };
        rig.run_jobs(queued(Some(1), true));
        rig.aside(ms(1000), queued(Some(1), true));
        assert!(!rig.control.session().is_at_rest());
        rig.reports();
        rig
    }

    /// A target far to the right is seen all the time; returns what was sent.
    fn aside(&mut self, time: Duration, answer: impl Fn(&Request) -> Said) -> Vec<Command> {
        self.sent.clear();
        for _ in 0..time.as_millis() / 50 {
            self.now += ms(50);
            self.see(0.9, 0.5);
            self.run_jobs(&answer);
        }
        mem::take(&mut self.sent)
    }
}

#[test]
fn who_loses_the_turn_stops_the_camera() {
    let mut rig = Rig::turning_in_turn();
    rig.aside(ms(6000), queued(Some(2), true));
    assert!(rig.control.session().is_at_rest());
    assert_eq!(rig.aside(ms(30_000), queued(Some(2), true)), []);
}

#[test]
fn a_stop_that_is_refused_out_of_turn_is_tried_at_each_answer_and_says_nothing_of_the_mode() {
    let mut rig = Rig::turning_in_turn();
    rig.aside(ms(6000), queued(Some(2), false));
    assert!(!rig.control.session().is_at_rest());
    rig.control.release();
    assert_eq!(rig.aside(ms(20_000), queued(Some(2), false)), [HALT; 4]);
    let reports = rig.reports();
    let taken = |report: &LoopEvent| matches!(report, LoopEvent::Session(SessionEvent::TakenOver(_)));
    assert!(reports.iter().all(taken), "{reports:?}");
    // The end: the place is kept until the camera rests.
    rig.control.session_mut().leave(rig.now);
    rig.aside(ms(6000), queued(Some(2), false));
    assert!(rig.control.session().is_queued());
    rig.control.release();
    rig.run_jobs(queued(Some(1), false));
    rig.now += ms(6000);
    rig.run_jobs(queued(Some(1), false));
    assert!(rig.control.session().is_at_rest() && !rig.control.session().is_queued());
    assert_eq!(rig.sent.last(), Some(&HALT));
}

#[test]
fn who_finds_the_queue_full_after_an_outage_stops_the_camera() {
    for takes_stops in [true, false] {
        let mut rig = Rig::turning_in_turn();
        rig.aside(ms(1000), |_| Some(Err(Error::Broken("reset".to_owned()))));
        let sent = rig.aside(ms(4000), queued(None, takes_stops));
        assert!(!sent.is_empty() && sent.iter().all(Command::is_stop), "{sent:?}");
        assert_eq!(rig.control.session().is_at_rest(), takes_stops);
        let sent = rig.aside(ms(20_000), queued(None, takes_stops));
        assert!(sent.len() <= 5 && sent.iter().all(Command::is_stop), "{sent:?}");
        let taken = LoopEvent::Session(SessionEvent::TakenOver(ControlOwner::Queue));
        assert_eq!(rig.reports().iter().filter(|report| **report == taken).count(), 1);
        assert!(rig.control.status(rig.now).taken_over);
        let sent = rig.aside(ms(6000), queued(Some(1), true));
        assert!(sent.iter().any(|command| !command.is_stop()), "{sent:?}");
        assert!(
            rig.reports().contains(&LoopEvent::Session(SessionEvent::Resumed))
                && !rig.control.status(rig.now).taken_over
        );
    }
}

#[test]
fn the_place_is_kept_for_the_second_stop_of_an_unanswered_move() {
    let mut rig = Rig::turning_in_turn();
    let in_turn = |request: &Request| queued(Some(1), true)(request);
    rig.aside(ms(2500), |request| match request {
        Request::Command(_) => Some(Err(Error::Timeout(ms(1)))),
        Request::Query(_) => in_turn(request),
    });
    rig.control.release();
    rig.control.session_mut().leave(rig.now);
    rig.now += ms(1000);
    rig.run_jobs(in_turn);
    assert!(rig.control.session().is_at_rest() && rig.control.session().is_queued());
    rig.now += ms(6000);
    rig.run_jobs(in_turn);
    assert!(rig.control.session().stays_at_rest() && !rig.control.session().is_queued());
}

/// Were the lease given up with the turn, nobody would stop the camera where we cannot any more.
#[test]
fn what_moves_for_us_is_ours_to_stop_until_it_rests_whoever_has_the_camera() {
    let mut rig = Rig::turning_in_turn();
    rig.aside(ms(6000), queued(Some(2), false));
    let session = rig.control.session();
    assert!(session.is_taken_over(rig.now) && session.is_ours_to_stop(rig.now));
    rig.aside(ms(6000), queued(Some(2), true));
    let session = rig.control.session();
    assert!(session.is_taken_over(rig.now) && !session.is_ours_to_stop(rig.now));
}

fn at(pan_deg: f64) -> Said {
    let position = Position { pan_deg: Some(pan_deg), tilt_deg: Some(0.0), zoom: Some(0.0) };
    Some(Ok(Response::Position(position)))
}

/// A camera whose position is told so, and the rest as usual.
fn positioned(answer: impl Fn() -> Said) -> impl Fn(&Request) -> Said {
    move |request| if *request == Request::Query(Query::Position) { answer() } else { None }
}

#[test]
fn a_suspicion_that_no_answer_resolves_does_not_leave_the_camera_turning() {
    let status = Error::Status { status: 503, reason: "Service Unavailable" };
    let unexpected = Error::Unexpected("garbage".to_owned());
    for failure in [Error::Camera("busy".to_owned()), Error::NoPtz, unexpected, status] {
        let mut rig = Rig::new(ServoSettings::default());
        for _ in 0..10 {
            rig.after(ms(5000));
        }
        // To the right, and back by a hand at the stick.
        rig.aside(ms(500), |_| None);
        let asked = std::cell::Cell::new(0);
        let odd_once = || {
            asked.set(asked.get() + 1);
            if asked.get() == 1 { at(-5.0) } else { Some(Err(failure.clone())) }
        };
        rig.aside(ms(1500), positioned(odd_once));
        assert!(asked.get() > 1, "{failure}: it was suspicious");
        let actuator = rig.control.session().actuator(rig.now);
        assert_eq!(actuator.access, Access::Ours, "{failure}");
        // On the other side: it is steered there.
        for _ in 0..30 {
            rig.now += ms(50);
            rig.see(0.1, 0.5);
            rig.run_jobs(positioned(|| Some(Err(failure.clone()))));
        }
        assert!(
            matches!(
                rig.sent.last(),
                Some(Command::Move { motion: Motion::Velocity { pan: ..0.0, .. }, .. })
            ),
            "{failure}"
        );
    }
}

#[test]
fn a_camera_that_may_not_be_steered_for_a_while_is_stopped() {
    let mut rig = Rig::turning_in_turn();
    // The connection is lost, and with it our place in the queue.
    let lost = Err(Error::Unreachable("not now".to_owned()));
    rig.control.on_response(&Request::Query(Query::Position), lost, rig.now, rig.now);
    // The queue's answer keeps away.
    let silent = |request: &Request| match request {
        Request::Query(Query::Queue(_)) => Some(Err(Error::Unreachable("not now".to_owned()))),
        _ => None,
    };
    let sent = rig.aside(ms(800), silent);
    assert_eq!(sent, [], "that may pass");
    rig.aside(ms(1500), silent);
    assert!(rig.control.session().is_at_rest());
}

#[test]
fn a_queue_that_may_not_be_asked_any_more_does_not_keep_the_stop() {
    let mut rig = Rig::turning_in_turn();
    // Somebody pushed in, and the stop is refused.
    rig.aside(ms(6000), queued(Some(2), false));
    rig.control.release();
    rig.aside(ms(100), queued(Some(2), false));
    assert!(!rig.control.session().is_at_rest());
    let not_permitted = |request: &Request| match request {
        Request::Query(Query::Queue(_)) => Some(Err(Error::CredentialsMissing)),
        _ => None,
    };
    rig.aside(ms(12_000), not_permitted);
    rig.control.release();
    rig.run_jobs(not_permitted);
    assert!(rig.control.session().is_at_rest());
}

/// A camera whose yes to a stop is not to be trusted has said it.
fn told_to_stop() -> Rig {
    let protocol = Protocol { confirms_stops: true, ..vapix::Client::PROTOCOL };
    let control = ControlLoop::new(ServoSettings::default(), &protocol);
    let mut rig = Rig { control, now: ms(1000), sent: Vec::new() };
    for _ in 0..10 {
        rig.after(ms(5000));
    }
    rig.aside(ms(500), |_| None);
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [HALT]);
    rig
}

/// A camera that turns on after its yes looks as one does that somebody else moves.
#[test]
fn a_stop_that_no_picture_tells_of_is_repeated_whoever_seems_to_move_the_camera() {
    let mut rig = told_to_stop();
    let mut pan_deg = 0.0;
    for _ in 0..8 {
        pan_deg -= 5.0;
        rig.now += ms(500);
        rig.run_jobs(positioned(|| at(pan_deg)));
    }
    assert!(rig.control.session().is_taken_over(rig.now));
    assert_eq!(rig.sent, [HALT]);
}

/// What no picture told of the stop before says nothing of this one.
#[test]
fn a_stop_after_a_move_that_went_unanswered_is_repeated_like_any_other() {
    let mut rig = told_to_stop();
    assert_eq!(rig.after(ms(3100)), [HALT]);
    rig.now += ms(200);
    rig.see(0.9, 0.5);
    rig.run(|_| Err(Error::Timeout(ms(1))));
    assert!(!rig.control.session().is_at_rest());
    rig.control.release();
    rig.sent.clear();
    let stops: Vec<_> = (0..40).flat_map(|_| rig.after(ms(200))).collect();
    // For what it may yet act on, and as no picture tells of it.
    assert_eq!(stops, [HALT; 3]);
}

/// Nobody else stops it for us.
#[test]
fn a_stop_that_pictures_show_is_not_repeated_whoever_seems_to_move_the_camera() {
    let mut rig = told_to_stop();
    let mut pan_deg = 0.0;
    while !rig.control.session().is_taken_over(rig.now) {
        pan_deg -= 5.0;
        rig.now += ms(250);
        rig.run_jobs(positioned(|| at(pan_deg)));
    }
    for _ in 0..8 {
        rig.now += ms(500);
        let nobody = Measurement { visibility: Visibility::Gone, ..Measurement::at(0.5, 0.5, rig.now) };
        rig.control.measure(Measurement { ego_velocity: Some(Vector::default()), ..nobody }, rig.now);
        rig.run_jobs(positioned(|| at(pan_deg)));
    }
    assert_eq!(rig.sent, []);
}
