// SPDX-License-Identifier: MPL-2.0

//! What the camera's task does between two exchanges: takes what came in, keeps count, reports changes.

use std::mem;
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use servo::Time;

use super::dead_man::DeadMan;
use super::mailbox::{Mail, Mailbox};
use super::{DeadManState, Event, LAST_RETRIES, STOP_GRACE, Statistics};
use crate::http::Credentials;
use crate::watchdog::Unavailable;
use crate::{ControlLoop, Error, Request, Response, Status};
use ptztrack_contract::lock::lock;

/// Everything but the client, which is lent out while a request is in flight.
pub struct TaskState<O> {
    pub control: ControlLoop,
    pub mailbox: Arc<Mailbox>,
    pub statistics: Arc<Mutex<Statistics>>,
    observer: O,
    last_status: Status,
    pub credentials: Option<Option<Credentials>>,
    waiting: Vec<SyncSender<()>>,
    settling: Vec<Arc<SyncSender<()>>>,
    /// The end, once it has been asked for.
    pub deadline: Option<Time>,
    /// Nobody waits any more.
    gave_up: bool,
    /// Somebody else has the camera from here on, who knows what is to be stopped.
    pub is_succeeded: bool,
}

impl<O: Fn(Event)> TaskState<O> {
    /// Nothing has come in yet.
    pub fn new(
        control: ControlLoop,
        mailbox: Arc<Mailbox>,
        statistics: Arc<Mutex<Statistics>>,
        observer: O,
    ) -> Self {
        Self {
            control,
            mailbox,
            statistics,
            observer,
            last_status: Status::default(),
            credentials: None,
            waiting: Vec::new(),
            settling: Vec::new(),
            deadline: None,
            gave_up: false,
            is_succeeded: false,
        }
    }

    /// Whether the end has come: at rest for good, out of time, or with no right to speak.
    pub fn is_over(&self) -> bool {
        let session = self.control.session();
        let done = session.stays_at_rest() && !session.awaits_mover() && !session.is_queued();
        self.deadline.is_some_and(|deadline| done || session.halted() || deadline <= self.mailbox.now())
    }

    /// When the time for a confirmed stop is over, nobody waits for it any more; it is retried for a while.
    pub fn check_deadline(&mut self) {
        let now = self.mailbox.now();
        if !self.gave_up && self.deadline.is_some_and(|deadline| deadline <= now) {
            self.give_up();
            self.deadline = Some(now + LAST_RETRIES);
        }
    }

    pub fn give_up(&mut self) {
        if !mem::replace(&mut self.gave_up, true) && !self.control.session().is_at_rest() {
            (self.observer)(Event::GaveUp { halted: self.control.session().halted() });
        }
        self.waiting.clear();
    }

    pub fn take_mail(&mut self) {
        let Mail { credentials, settings, rest, measurement, waiting, settling, finish, quit } =
            self.mailbox.take();
        let now = self.mailbox.now();
        self.credentials = credentials.or(self.credentials.take());
        if let Some(settings) = settings {
            self.control.configure(settings);
        }
        if rest {
            self.control.release();
        }
        if let Some(within) = finish {
            self.deadline.get_or_insert(now + within);
            self.control.session_mut().leave(now);
        }
        if quit {
            (self.deadline, self.gave_up, self.is_succeeded) = (Some(now), true, true);
        }
        if let Some(measurement) = measurement.filter(|_| self.deadline.is_none()) {
            self.control.measure(measurement, now);
        }
        self.waiting.extend(waiting);
        self.settling.extend(settling);
    }

    /// Has the watchdog go on, where it is to stop the camera, and tells how it stands with it.
    pub fn keep_dead_man(&self, dead_man: &mut DeadMan) {
        let missing = dead_man.keep();
        self.tell_dead_man(dead_man.state(), missing);
    }

    /// How it stands with the watchdog, and whether it is missing since just now.
    pub fn tell_dead_man(&self, dead_man: DeadManState, missing: Option<Unavailable>) {
        lock(&self.statistics).dead_man = dead_man;
        if let Some(missing) = missing {
            (self.observer)(Event::NoWatchdog(missing));
        }
    }

    /// Has the user told what the camera cannot do.
    pub fn warn(&self, warning: Option<String>) {
        if let Some(warning) = warning {
            (self.observer)(Event::Warning(warning));
        }
    }

    /// Whether nobody needs the answer: the end has come, and nothing in flight can move the camera.
    pub fn is_in_vain(&mut self, request: &Request, now: Time) -> bool {
        match request {
            Request::Command(_) => self.deadline.is_some_and(|deadline| deadline <= now),
            Request::Query(_) => {
                self.tell_rest();
                self.is_over()
            }
        }
    }

    /// When to abandon what was sent then for a stop that waits behind it: a stop that is not due any more hurries nobody.
    pub fn give_up_at(&self, request: &Request, sent: Time, now: Time) -> Option<Time> {
        self.stop_waits_behind(request, now).then(|| sent + STOP_GRACE)
    }

    /// When the target is lost, as for so long neither a picture nor an answer to this has come, while the camera may turn:
    /// the network holds back both, and the stop will be as late.
    pub fn silent_at(&self, request: &Request, sent: Time) -> Option<Time> {
        let newest = self.control.servo().newest_picture()?;
        self.may_turn(request).then(|| newest.max(sent) + STOP_GRACE)
    }

    /// Whether something else than a stop is in flight while a stop is what the camera needs.
    fn stop_waits_behind(&self, request: &Request, now: Time) -> bool {
        self.may_turn(request) && !self.control.has_errand(now)
    }

    /// Whether the camera may turn while this is in flight, and is not being stopped by it.
    fn may_turn(&self, request: &Request) -> bool {
        match request {
            Request::Command(command) => !command.is_stop(),
            Request::Query(_) => !self.control.session().is_at_rest(),
        }
    }

    pub fn answered(&mut self, request: &Request, answer: Result<Response, Error>, sent: Time) {
        let now = self.mailbox.now();
        self.count(request, answer.as_ref().err().cloned(), now - sent);
        self.control.on_response(request, answer, sent, now);
    }

    pub fn abandoned(&mut self, request: &Request, sent: Time) {
        let now = self.mailbox.now();
        let waited = now - sent;
        self.count(request, Some(Error::Timeout(waited)), waited);
        self.control.abandoned(request, now);
    }

    fn count(&self, request: &Request, failure: Option<Error>, round_trip: Duration) {
        {
            let mut statistics = lock(&self.statistics);
            if let Some(err) = &failure {
                statistics.last_error = Some(err.to_string());
            }
            match (request, &failure) {
                (Request::Query(_), _) => {}
                (Request::Command(_), Some(_)) => statistics.failed += 1,
                (Request::Command(_), None) => statistics.succeeded(round_trip),
            }
        }
        (self.observer)(Event::Exchanged { request: *request, failure, round_trip });
    }

    /// Notes how it stands for whoever asks, or comes next.
    pub fn note_statistics(&self) -> Status {
        let now = self.mailbox.now();
        let status = self.control.status(now);
        let (estimates, stop) = (Some(self.control.estimates()), Some(self.control.stop()));
        let session = self.control.session();
        let (may_yet_move, halted) = (!session.stays_at_rest() || session.awaits_mover(), session.halted());
        let refusal = session.refusal(now);
        let coalesced = self.control.overtaken() + self.mailbox.overtaken();
        let mut statistics = lock(&self.statistics);
        (statistics.status, statistics.estimates, statistics.stop) = (status, estimates, stop);
        (statistics.may_yet_move, statistics.halted) = (may_yet_move, halted);
        // Whoever comes next has another clock.
        statistics.forbidden = refusal.map(|(forbidden, wait)| (forbidden, Instant::now() + wait));
        statistics.coalesced = coalesced;
        status
    }

    /// Tells what has changed: reports and status; and those who wait for rest.
    pub fn publish(&mut self) {
        let status = self.note_statistics();
        for event in self.control.take_events() {
            (self.observer)(Event::Loop(event));
        }
        if status != self.last_status {
            self.last_status = status;
            (self.observer)(Event::Status(status));
        }
        self.tell_rest();
        if cfg!(debug_assertions) {
            self.check_invariants();
        }
    }

    /// What holds whenever everything was told; asked then where debug assertions are on.
    pub fn check_invariants(&self) {
        assert!(
            self.waiting.is_empty() || !self.has_come_to_rest(),
            "somebody waits for a rest that has come"
        );
        assert!(!self.gave_up || self.deadline.is_some(), "given up before the end was asked for");
    }

    /// Nothing is to be done at this time that has not been done.
    pub fn tell_settled(&mut self) {
        for settling in self.settling.drain(..) {
            (self.observer)(Event::Settled(settling));
        }
    }

    /// Whether the camera rests, and at the end its queue has been left, too: whoever comes next, in this process or
    /// another, would stand in line behind us until the camera forgets us.
    fn has_come_to_rest(&self) -> bool {
        let session = self.control.session();
        let takes_leave = self.deadline.is_some() && session.stays_at_rest() && session.is_queued();
        session.is_at_rest() && !takes_leave
    }

    fn tell_rest(&mut self) {
        if self.has_come_to_rest() {
            // Who waits no longer is not there to be told.
            for waiting in self.waiting.drain(..) {
                let _ = waiting.try_send(());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{Clock, FINISH_BUDGET};
    use crate::{Command, LoopSettings, Next, Protocol, Query, SessionSettings, Stop};
    use proptest::prelude::*;
    use servo::{Measurement, Motion, Position, ServoSettings, Visibility};
    use std::cell::RefCell;
    use std::sync::mpsc::{Receiver, TryRecvError};

    const MOVE: Request = Request::Command(Command::Move {
        motion: Motion::Velocity { pan: 0.09, tilt: 0.0, zoom: None },
        free: false,
    });
    const HALT: Command = Command::Stop(Stop::PanTilt);
    const ASK: Request = Request::Query(Query::Position);

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    const PROTOCOL: Protocol = Protocol {
        questions: &[Query::Position, Query::Limits],
        keep_alive: Duration::from_secs(2),
        confirms_stops: false,
        has_control_queue: true,
    };

    fn timeout() -> Result<Response, Error> {
        Err(Error::Timeout(ms(1)))
    }

    /// What the world was told.
    type Told = Receiver<Event>;

    /// A task at one second of its time.
    fn state() -> (TaskState<impl Fn(Event)>, Told) {
        state_of(&PROTOCOL)
    }

    fn state_of(protocol: &Protocol) -> (TaskState<impl Fn(Event) + use<>>, Told) {
        let (events, told) = std::sync::mpsc::channel();
        let mailbox = Arc::new(Mailbox::new(Clock::held()));
        mailbox.hold_at(ms(1000));
        let control = ControlLoop::new(ServoSettings::default(), protocol);
        (TaskState::new(control, mailbox, Arc::default(), move |event| drop(events.send(event))), told)
    }

    impl<O: Fn(Event)> TaskState<O> {
        fn see(&mut self, visibility: Visibility) {
            self.mailbox.see(Measurement { visibility, ..Measurement::at(0.9, 0.5, self.mailbox.now()) });
            self.take_mail();
        }

        /// Does what is due at this time; returns the commands.
        fn serve_at(
            &mut self,
            at: Time,
            answer: impl Fn(&Command) -> Result<Response, Error>,
        ) -> Vec<Command> {
            self.mailbox.hold_at(at.since_zero());
            self.take_mail();
            self.check_deadline();
            let exchanges = std::iter::from_fn(|| self.exchange(&answer)).collect::<Vec<_>>();
            self.publish();
            let command =
                |request| if let Request::Command(command) = request { Some(command) } else { None };
            exchanges.into_iter().filter_map(command).collect()
        }

        /// Does the next of what is due now; returns what that was.
        fn exchange(&mut self, answer: impl Fn(&Command) -> Result<Response, Error>) -> Option<Request> {
            let now = self.mailbox.now();
            self.control.session_mut().settle_speaker(now);
            let Next::Do(request) = self.control.next_request(now) else { return None };
            let answer = match &request {
                Request::Command(command) => answer(command),
                Request::Query(Query::Position) => Ok(Response::Position(Position::default())),
                Request::Query(Query::Queue(_)) => Ok(Response::Place(None)),
                Request::Query(_) => Err(Error::Camera("none".to_owned())),
            };
            self.control.sending(&request, now);
            self.answered(&request, answer, now);
            Some(request)
        }

        /// A move goes unanswered, the end comes, and with it a stop; returns who waits for that.
        fn end_in_doubt(&mut self) -> Receiver<()> {
            self.see(Visibility::Seen);
            self.serve_at(ms(1000), |_| timeout());
            let rest = self.mailbox.finish(FINISH_BUDGET);
            assert_eq!(self.serve_at(ms(2000), |_| Ok(Response::Accepted)), [HALT]);
            assert!(self.control.session().is_at_rest());
            rest
        }
    }

    fn gave_up(told: &Told) -> bool {
        told.try_iter().any(|event| matches!(event, Event::GaveUp { .. }))
    }

    #[test]
    fn at_the_end_too_an_unanswered_move_is_stopped_twice_and_nobody_waits_for_that() {
        let (mut state, told) = state();
        let rest = state.end_in_doubt();
        assert_eq!(rest.try_recv(), Ok(()));
        assert!(!state.is_over() && lock(&state.statistics).may_yet_move);
        assert_eq!(state.serve_at(ms(5000), |_| Ok(Response::Accepted)), []);
        assert!(!state.is_over());
        assert_eq!(state.serve_at(ms(9000), |_| Ok(Response::Accepted)), [HALT]);
        assert!(state.is_over() && !lock(&state.statistics).may_yet_move);
        assert!(!gave_up(&told));
    }

    /// He was refused twice, so that he may ask again after ten seconds; meanwhile somebody else is told yes, which has no effect.
    #[test]
    fn at_the_end_too_whoever_moved_the_camera_is_waited_for_to_stop_it() {
        let (mut state, _told) =
            state_of(&Protocol { confirms_stops: true, has_control_queue: false, ..PROTOCOL });
        let yes = |_: &Command| Ok(Response::Accepted);
        state.see(Visibility::Seen);
        assert_eq!(state.serve_at(ms(1000), yes).len(), 1, "it turns");
        state.control.session_mut().stand_in(ms(1000));
        state.control.release();
        let forbidden = || Error::NotPermitted { user: "root".to_owned() };
        let answers = RefCell::new(vec![forbidden(), Error::Broken("reset".to_owned()), forbidden()]);
        let refuse = |_: &Command| {
            let mut answers = answers.borrow_mut();
            if answers.is_empty() { Ok(Response::Accepted) } else { Err(answers.remove(0)) }
        };
        assert_eq!([1100, 1200, 1300, 1400].map(|at| state.serve_at(ms(at), refuse).len()), [1; 4]);
        let rest = state.mailbox.finish(FINISH_BUDGET);
        for at in [1500, 1600, 1800, 2000, 9000] {
            state.serve_at(ms(at), yes);
        }
        assert_eq!(rest.try_recv(), Ok(()));
        let session = state.control.session();
        assert!(session.stays_at_rest() && session.is_ours_to_stop(ms(9000)));
        assert!(!state.is_over() && lock(&state.statistics).may_yet_move);
        assert_eq!(state.serve_at(ms(11_400), yes), [HALT]);
        state.serve_at(ms(11_600), yes);
        assert!(state.is_over() && !lock(&state.statistics).may_yet_move);
    }

    /// Else whoever comes next would find us still in its way.
    #[test]
    fn at_the_end_the_queue_is_left_before_whoever_waits_hears_of_it() {
        let (mut state, _told) = state();
        state.see(Visibility::Seen);
        let yes = |_: &Command| Ok(Response::Accepted);
        state.serve_at(ms(1000), |_| Err(Error::Camera("not in control".to_owned())));
        state.serve_at(ms(1200), yes);
        assert!(state.control.session().is_queued() && !state.control.session().is_at_rest());
        let rest = state.mailbox.finish(FINISH_BUDGET);
        state.take_mail();
        while !state.control.session().stays_at_rest() {
            assert!(state.exchange(yes).is_some());
            state.publish();
            assert_eq!(rest.try_recv(), Err(TryRecvError::Empty));
        }
        state.serve_at(ms(1200), yes);
        assert_eq!(rest.try_recv(), Ok(()));
        assert!(state.is_over());
    }

    #[test]
    fn a_second_stop_that_is_not_confirmed_is_not_tried_for_ever() {
        let (mut state, told) = state();
        state.end_in_doubt();
        let mut now = ms(5000);
        while now < Time::from_millis(2000) + FINISH_BUDGET + LAST_RETRIES {
            state.serve_at(now, |_| timeout());
            assert!(!state.is_over());
            now += ms(1000);
        }
        state.serve_at(now + ms(5000), |_| timeout());
        assert!(state.is_over() && !gave_up(&told));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Whatever is left in the mailbox, in whatever order, and however the camera answers.
        #[test]
        fn nobody_waits_for_ever(
            events in prop::collection::vec((0u8..10, any::<bool>(), 1u64..3000), 1..40),
        ) {
            let (mut state, _told) = state();
            let (mut now, mut waiting) = (ms(1000), Vec::new());
            for (event, answers, wait) in events {
                match event {
                    0 | 1 => state.see(Visibility::Seen),
                    2 => state.see(Visibility::Gone),
                    3 => waiting.push(state.mailbox.rest()),
                    4 => state.mailbox.accept_measurements(false),
                    5 => state.mailbox.accept_measurements(true),
                    6 => state.control.session_mut().inherit(Stop::Position, now),
                    7 => state.mailbox.configure(LoopSettings { session: SessionSettings { max_rate_hz: 5.0, ..SessionSettings::default() }, ..LoopSettings::default() }),
                    8 => state.mailbox.set_credentials(None),
                    _ => waiting.push(state.mailbox.finish(FINISH_BUDGET)),
                }
                state.mailbox.check_invariants();
                now += ms(wait);
                state.serve_at(now, |_| if answers { Ok(Response::Accepted) } else { timeout() });
                if state.is_over() {
                    break;
                }
            }
            waiting.push(state.mailbox.finish(FINISH_BUDGET));
            for _ in 0..70 {
                now += ms(1000);
                state.serve_at(now, |_| timeout());
            }
            prop_assert!(state.is_over());
            state.give_up();
            state.check_invariants();
            prop_assert!(waiting.iter().all(|heard| heard.try_recv() != Err(TryRecvError::Empty)));
        }
    }

    /// As one that restarts may refuse anybody: were that for good, it would turn on, and no watchdog stop it.
    #[test]
    fn a_stop_that_was_refused_for_a_moment_is_sent_again_and_the_lease_held_until_then() {
        for refusal in [Error::CredentialsMissing, Error::NotPermitted { user: "root".to_owned() }] {
            let (mut state, _told) = state();
            state.see(Visibility::Seen);
            assert_eq!(state.serve_at(ms(1000), |_| Ok(Response::Accepted)).len(), 1, "it turns");
            state.control.release();
            assert_eq!(state.serve_at(ms(1500), |_| Err(refusal.clone())), [HALT]);
            assert!(state.control.session().is_ours_to_stop(state.mailbox.now()));
            assert_eq!(state.serve_at(ms(2000), |_| Ok(Response::Accepted)), [HALT]);
            let session = state.control.session();
            assert!(!session.is_ours_to_stop(state.mailbox.now()) && session.stays_at_rest());
        }
    }

    #[test]
    fn only_a_stop_that_still_waits_has_a_move_abandoned() {
        let (mut state, _) = state();
        state.see(Visibility::Seen);
        let sent = ms(1000);
        assert_eq!(state.give_up_at(&MOVE, sent, ms(1000)), None);
        state.see(Visibility::Gone);
        assert_eq!(state.give_up_at(&MOVE, sent, ms(1400)), Some(sent + STOP_GRACE));
        state.see(Visibility::Seen);
        assert_eq!(state.give_up_at(&MOVE, sent, ms(1450)), None);
        assert_eq!(state.give_up_at(&Request::Command(HALT), sent, ms(1450)), None);
    }

    impl<O: Fn(Event)> TaskState<O> {
        /// The camera tells at this time that it looks there.
        fn tell(&mut self, pan_deg: f64, at: Time) {
            self.mailbox.hold_at(at.since_zero());
            let position = Position { pan_deg: Some(pan_deg), tilt_deg: Some(0.0), zoom: None };
            self.answered(&ASK, Ok(Response::Position(position)), at);
        }
    }

    /// Were the question given up for the stop that waits for its answer, it would be asked and given up for ever.
    #[test]
    fn whose_move_the_camera_is_in_is_waited_for_however_slow_it_answers() {
        let (mut state, _told) = state();
        state.see(Visibility::Seen);
        assert_eq!(state.serve_at(ms(1000), |_| Ok(Response::Accepted)).len(), 1, "it turns to the right");
        for (pan_deg, at) in [(0.0, 1100), (0.0, 1600), (-20.0, 2100), (-20.0, 2200)] {
            state.tell(pan_deg, ms(at));
        }
        let session = state.control.session();
        assert!(session.is_taken_over(ms(2200)) && !session.is_at_rest(), "by a hand it turned to the left");
        assert_eq!(state.serve_at(ms(2200), |_| panic!("it may be his move that it is in")), []);
        assert_eq!(state.give_up_at(&ASK, ms(2700), ms(2700)), None);
        // To the right again.
        state.tell(-17.0, ms(3500));
        assert_eq!(state.give_up_at(&ASK, ms(3500), ms(3500)), Some(Time::from_millis(3500) + STOP_GRACE));
        assert_eq!(state.serve_at(ms(3500), |_| Ok(Response::Accepted)), [HALT]);
    }

    #[test]
    fn a_target_is_lost_for_silence_where_neither_pictures_nor_answers_come() {
        let (mut state, _) = state();
        assert_eq!(state.silent_at(&MOVE, ms(900)), None, "nobody is followed");
        state.see(Visibility::Seen);
        assert_eq!(state.silent_at(&MOVE, ms(900)), Some(ms(1500)), "the picture is of 1000 ms");
        assert_eq!(state.silent_at(&MOVE, ms(1200)), Some(ms(1700)));
        assert_eq!([Request::Command(HALT), ASK].map(|it| state.silent_at(&it, ms(900))), [None; 2]);
        assert_eq!(state.serve_at(ms(1000), |_| Ok(Response::Accepted)).len(), 1, "it turns");
        assert_eq!(state.silent_at(&ASK, ms(900)), Some(ms(1500)));
        state.control.lose_target();
        assert_eq!(state.give_up_at(&ASK, ms(900), ms(1500)), Some(ms(1400)), "a stop is due");
    }
}
