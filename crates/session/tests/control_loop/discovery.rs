// SPDX-License-Identifier: MPL-2.0

//! What a control asks of a camera just met, and what becomes of questions without an answer.

use std::time::Duration;

use servo::{
    HardLimits, Home, Measurement, Motion, Position, Presets, Range, ServoSettings, Time, Visibility,
};
use session::session::ConnectionChange;
use session::{Command, Error, Parameters, QueueRequest};
use session::{Next, Query, Request, Response, SessionEvent};

use session::{ControlLoop, LoopEvent};

fn ms<T: From<Duration>>(ms: u64) -> T {
    Duration::from_millis(ms).into()
}

fn timeout() -> Error {
    Error::Timeout(ms(1))
}

fn starting() -> Error {
    Error::Status { status: 503, reason: "Service Unavailable" }
}

fn refused() -> Error {
    Error::Camera("none".to_owned())
}

/// What a willing camera answers.
fn told(request: &Request) -> Result<Response, Error> {
    Ok(match request {
        Request::Command(_) => Response::Accepted,
        Request::Query(Query::Position) => {
            Response::Position(Position { pan_deg: Some(0.0), tilt_deg: Some(0.0), zoom: Some(0.0) })
        }
        Request::Query(Query::Limits) => Response::Limits(HardLimits {
            pan_deg: Some(Range { min: -170.0, max: 170.0 }),
            ..HardLimits::default()
        }),
        Request::Query(Query::Parameters) => {
            Response::Parameters(Parameters { proportional_speed: Some(false), ..Parameters::default() })
        }
        Request::Query(Query::MoveSpeed) => Response::MoveSpeed(0.4),
        Request::Query(Query::Presets) => Response::Presets(Presets(vec![(4, "Gate".to_owned())])),
        Request::Query(_) => return Err(refused()),
    })
}

struct Meeting {
    control: ControlLoop,
    now: Time,
    requests: Vec<Request>,
    reports: Vec<LoopEvent>,
}

impl Meeting {
    fn new(settings: ServoSettings) -> Self {
        Self {
            control: crate::control_loop(settings),
            now: ms(1000),
            requests: Vec::new(),
            reports: Vec::new(),
        }
    }

    /// Lets time pass, with pictures and with what is due; every answer takes so long.
    fn run(
        &mut self,
        (seconds, per_answer): (u64, Duration),
        seen: impl Fn(Time) -> Measurement,
        mut answer: impl FnMut(&Request) -> Result<Response, Error>,
    ) {
        let end = self.now + Duration::from_secs(seconds);
        while self.now < end {
            self.control.measure(seen(self.now), self.now);
            while self.now < end
                && let Next::Do(request) = self.control.next_request(self.now)
            {
                let sent = self.now;
                self.control.sending(&request, sent);
                self.now += per_answer;
                self.requests.push(request);
                self.control.on_response(&request, answer(&request), sent, self.now);
                self.control.measure(seen(self.now), self.now);
            }
            self.now += ms(40);
        }
        self.reports.extend(self.control.take_events());
    }

    fn asked(&self, query: Query) -> usize {
        self.requests.iter().filter(|request| **request == Request::Query(query)).count()
    }

    fn met(&self) -> Option<&str> {
        self.reports.iter().find_map(|report| match report {
            LoopEvent::Session(SessionEvent::Discovered(text)) => Some(text.as_str()),
            _ => None,
        })
    }

    fn faults(&self) -> usize {
        let fault = |report: &&LoopEvent| {
            matches!(
                report,
                LoopEvent::Session(SessionEvent::Connection(
                    ConnectionChange::Disconnected(_) | ConnectionChange::Refused(_)
                ))
            )
        };
        self.reports.iter().filter(fault).count()
    }
}

fn nobody(now: Time) -> Measurement {
    Measurement { visibility: Visibility::Gone, ..Measurement::at(0.5, 0.5, now) }
}

/// Who is somewhere else at every moment: there is always something to send.
fn somebody(now: Time) -> Measurement {
    let time_s = now.since_zero().as_secs_f64();
    Measurement::at(0.6 + 0.3 * (3.0 * time_s).sin().abs(), 0.5 + 0.1 * (2.3 * time_s).sin(), now)
}

#[test]
fn a_question_without_an_answer_is_asked_again() {
    for err in [timeout(), starting(), Error::Broken("reset".to_owned()), Error::TooLong(9)] {
        let mut meeting = Meeting::new(ServoSettings::default());
        let mut failures = 2;
        meeting.run((10, ms(0)), nobody, |request| {
            if *request == Request::Query(Query::Parameters) && failures > 0 {
                failures -= 1;
                return Err(err.clone());
            }
            told(request)
        });
        assert_eq!(meeting.asked(Query::Parameters), 3, "{err}");
        assert!(meeting.met().is_some_and(|text| text.contains("not proportional")), "{err}");
        assert_eq!(meeting.faults(), 0, "{err}");
    }
}

#[test]
fn a_question_without_any_answer_is_given_up_and_so_is_one_that_is_refused() {
    for (err, times) in [(timeout(), 3), (refused(), 1), (Error::NoPtz, 1)] {
        let mut meeting = Meeting::new(ServoSettings::default());
        meeting.run((20, ms(0)), nobody, |request| match request {
            Request::Query(Query::Limits) => Err(err.clone()),
            _ => told(request),
        });
        assert_eq!(meeting.asked(Query::Limits), times, "{err}");
        assert!(meeting.met().is_some_and(|text| text.contains("pan not told")), "{err}");
    }
}

#[test]
fn an_outage_takes_no_knowledge_away() {
    let mut meeting = Meeting::new(ServoSettings::default());
    meeting.run((1, ms(0)), nobody, |request| match request {
        Request::Query(Query::Position) => told(request),
        _ => Err(timeout()),
    });
    meeting.run((30, ms(0)), nobody, |_| Err(timeout()));
    assert_eq!(meeting.met(), None);
    meeting.run((10, ms(0)), nobody, told);
    let text = meeting.met().unwrap();
    assert!(text.starts_with("pan -170 to 170") && text.contains("not proportional"), "{text}");
}

#[test]
fn what_a_starting_camera_refused_to_tell_is_asked_after_its_first_outage() {
    for err in [refused(), Error::NoPtz, Error::Status { status: 404, reason: "Not Found" }, starting()] {
        let mut meeting = Meeting::new(ServoSettings::default());
        meeting.run((20, ms(0)), nobody, |request| match request {
            Request::Query(Query::Position) => told(request),
            _ => Err(err.clone()),
        });
        assert!(meeting.met().is_some_and(|text| text.contains("pan not told")), "{err}");
        meeting.reports.clear();
        meeting.run((10, ms(0)), nobody, |_| Err(timeout()));
        meeting.run((10, ms(0)), nobody, told);
        let text = meeting.met().unwrap();
        assert!(text.starts_with("pan -170 to 170") && text.contains("not proportional"), "{err}: {text}");
    }
}

#[test]
fn after_an_outage_all_is_asked_and_only_what_is_new_is_told() {
    let mut meeting = Meeting::new(ServoSettings::default());
    let outage = |meeting: &mut Meeting, answer: fn(&Request) -> Result<Response, Error>| {
        meeting.reports.clear();
        meeting.run((20, ms(0)), nobody, |_| Err(timeout()));
        meeting.run((20, ms(0)), nobody, answer);
    };
    meeting.run((10, ms(0)), nobody, told);
    assert!(meeting.met().is_some());
    outage(&mut meeting, told);
    assert_eq!((meeting.met(), meeting.asked(Query::Limits), meeting.asked(Query::MoveSpeed)), (None, 2, 2));
    outage(&mut meeting, |request| match request {
        Request::Query(Query::Limits) => Ok(Response::Limits(HardLimits {
            pan_deg: Some(Range { min: -90.0, max: 90.0 }),
            ..HardLimits::default()
        })),
        Request::Query(Query::Position) => told(request),
        _ => Err(refused()),
    });
    let text = meeting.met().unwrap();
    assert!(text.starts_with("pan -90 to 90") && text.contains("not proportional"), "{text}");
}

/// It has been asked before.
#[test]
fn after_an_outage_the_first_move_waits_for_no_question() {
    let mut meeting = Meeting::new(ServoSettings::default());
    meeting.run((10, ms(100)), somebody, told);
    meeting.run((10, ms(100)), somebody, |_| Err(timeout()));
    let before = meeting.requests.len();
    meeting.run((10, ms(100)), somebody, told);
    assert!(
        meeting.requests[before..before + 3].iter().any(|request| matches!(request, Request::Command(_)))
    );
    assert_eq!(meeting.asked(Query::Limits), 2);
}

#[test]
fn another_user_may_ask_what_the_last_might_not() {
    let forbidden = || Err(Error::NotPermitted { user: "root".to_owned() });
    let queueing = |request: &Request| match request {
        Request::Query(Query::Parameters) => {
            Ok(Response::Parameters(Parameters { control_queue: Some(true), ..Parameters::default() }))
        }
        _ => told(request),
    };
    let asked_for_control = |meeting: &Meeting| meeting.asked(Query::Queue(QueueRequest::Request));
    let mut meeting = Meeting::new(ServoSettings::default());
    meeting.run((10, ms(0)), nobody, |request| match request {
        Request::Query(Query::Position | Query::Parameters) => queueing(request),
        _ => forbidden(),
    });
    assert_eq!((meeting.asked(Query::Limits), asked_for_control(&meeting)), (1, 1));
    meeting.run((10, ms(0)), nobody, |_| Err(timeout()));
    meeting.run((10, ms(0)), nobody, queueing);
    assert_eq!(asked_for_control(&meeting), 1, "who may not does not try again: it counts as a wrong login");
    meeting.reports.clear();
    meeting.control.session_mut().owner_changed(meeting.now);
    meeting.run((10, ms(0)), nobody, queueing);
    assert_eq!((meeting.asked(Query::Limits), asked_for_control(&meeting)), (3, 3));
}

#[test]
fn a_camera_that_does_not_tell_where_it_looks_tells_the_rest() {
    let mut meeting = Meeting::new(ServoSettings::default());
    meeting.run((10, ms(0)), nobody, |request| match request {
        Request::Query(Query::Position) => Err(refused()),
        _ => told(request),
    });
    assert_eq!((meeting.faults(), meeting.asked(Query::Position)), (0, 2), "once, and for the queue's sake");
    assert!(meeting.met().is_some_and(|text| text.starts_with("pan -170 to 170")));
    assert!(
        meeting.reports.contains(&LoopEvent::Session(SessionEvent::Connection(ConnectionChange::Connected)))
    );
}

#[test]
fn a_camera_that_tells_nothing_is_a_fault() {
    let mut meeting = Meeting::new(ServoSettings::default());
    meeting.run((10, ms(0)), nobody, |_| Err(refused()));
    assert_eq!(meeting.faults(), 1);
    assert!(meeting.asked(Query::Position) > 5, "it is asked on");
}

#[test]
fn the_first_move_waits_for_no_more_than_it_needs() {
    let mut meeting = Meeting::new(ServoSettings::default());
    meeting.run((12, ms(1000)), somebody, told);
    let known = [Request::Query(Query::Position), Request::Query(Query::Limits)];
    assert_eq!(meeting.requests[..2], known);
    assert!(matches!(meeting.requests[2], Request::Command(_)), "{:?}", meeting.requests);
}

#[test]
fn who_never_lets_up_does_not_keep_a_slow_camera_from_being_asked() {
    for (per_answer, seconds) in [(ms(400), 20), (ms(1000), 40)] {
        let mut meeting = Meeting::new(ServoSettings::default());
        meeting.run((seconds, per_answer), somebody, told);
        assert!(meeting.met().is_some(), "{per_answer:?}: {:?}", meeting.requests);
        let (before, asked) = (meeting.requests.len(), meeting.asked(Query::Position));
        meeting.run((60, per_answer), somebody, told);
        let polls = meeting.asked(Query::Position) - asked;
        let requests = meeting.requests.len() - before;
        assert!(polls >= 4, "{per_answer:?}: {polls} in a minute, so that others are noticed");
        assert!(requests >= 5 * polls, "{per_answer:?}: {polls} of {requests}, the rest are moves");
    }
}

#[test]
fn a_camera_that_is_busy_goes_home_later() {
    let home = Home::Position(Position { pan_deg: Some(30.0), tilt_deg: Some(0.0), zoom: None });
    for err in [starting(), timeout()] {
        let settings =
            ServoSettings { home: Some(home.clone()), home_timeout: ms(500), ..ServoSettings::default() };
        let mut meeting = Meeting::new(settings);
        let mut failures = 2;
        meeting.run((20, ms(0)), nobody, |request| match request {
            Request::Command(Command::Move { motion: Motion::Absolute { speed, .. }, .. })
                if failures > 0 =>
            {
                assert_eq!(*speed, 0.4, "as it told");
                failures -= 1;
                Err(err.clone())
            }
            _ => told(request),
        });
        let went = |request: &&Request| {
            matches!(request, Request::Command(Command::Move { motion: Motion::Absolute { .. }, .. }))
        };
        assert_eq!(meeting.requests.iter().filter(went).count(), 3, "{err}");
        assert!(
            !meeting
                .reports
                .iter()
                .any(|report| matches!(report, LoopEvent::Session(SessionEvent::HomeRefused(_)))),
            "{err}"
        );
    }
}

#[test]
fn presets_that_are_not_told_yet_are_asked_for_later() {
    for err in [starting(), timeout()] {
        let settings = ServoSettings {
            home: Some(Home::Preset("Gate".to_owned())),
            home_timeout: Duration::ZERO,
            ..ServoSettings::default()
        };
        let mut meeting = Meeting::new(settings);
        let mut failures = 4;
        meeting.run((40, ms(0)), nobody, |request| {
            if *request == Request::Query(Query::Presets) && failures > 0 {
                failures -= 1;
                return Err(err.clone());
            }
            told(request)
        });
        assert!(
            meeting.requests.contains(&Request::Command(Command::Move {
                motion: Motion::Preset { number: 4 },
                free: false
            })),
            "{err}"
        );
        assert_eq!(meeting.asked(Query::Presets), 5, "{err}");
        assert!(!meeting.reports.iter().any(|report| matches!(report, LoopEvent::NoSuchPreset(_))), "{err}");
    }
}
