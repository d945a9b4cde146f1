// SPDX-License-Identifier: MPL-2.0

//! As whom the camera is spoken to where it may move at somebody else's word, or at ours from before our password was changed. It does
//! not stop for whom it does not know, so whoever moved it stops it, or we where it does not obey him; and nobody moves it until then.

use std::mem;
use std::time::Duration;

use servo::Time;

use super::connection::Connection;
use super::control_queue::ControlQueue;
use super::{Forbidden, Session, StopConfirmation};

/// As whom the camera is spoken to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speaker {
    /// Who may move it.
    Owner,
    /// Who moved it before, to stop it.
    Mover,
    /// Who is to be its owner, to stop it in the mover's place.
    Newcomer,
}

/// Where one stands with the camera.
#[derive(Debug)]
pub(super) struct Standing {
    connection: Connection,
    queue: ControlQueue,
    /// What the one who speaks said, and the camera answered with yes, had no effect: this one speaks once nothing is under way.
    is_next: bool,
}

impl Standing {
    /// Of somebody who was not heard of yet, where another stands so in its queue.
    fn of_another(queue: &ControlQueue) -> Self {
        Self { connection: Connection::default(), queue: queue.of_another(), is_next: false }
    }

    /// It is the end: his place is given up.
    pub fn leave(&mut self) {
        self.queue.leave();
    }

    /// When he may speak again.
    fn heard_at(&self) -> Time {
        heard_at(&self.connection, &self.queue)
    }
}

/// When whoever stands so may speak again.
fn heard_at(connection: &Connection, queue: &ControlQueue) -> Time {
    connection.retry_at().max(queue.heard_at())
}

impl Session {
    /// As whom the camera is to be spoken to.
    pub fn speaker(&self) -> Speaker {
        self.speaker
    }

    /// The camera moves at the word of whoever speaks, and somebody else is to be its owner.
    pub fn stand_in(&mut self, now: Time) {
        self.connection.note_obeyed();
        self.speaker = Speaker::Mover;
        self.other = Some(Standing::of_another(&self.arbitration.queue));
        if self.connection.faulty() {
            self.pass_turn(now);
        }
    }

    /// Whoever moved the camera is its owner after all.
    pub fn mover_stays(&mut self) {
        if self.speaker == Speaker::Newcomer {
            self.give_way();
        }
        self.other = None;
        self.speaker = Speaker::Owner;
        self.ask_anew();
    }

    /// The camera may be asked anew: its owner is another. He need not wait for whom it does not hear.
    pub fn owner_changed(&mut self, now: Time) {
        let at_rest = self.is_at_rest();
        match (&mut self.other, self.speaker) {
            (Some(owner), Speaker::Mover) => {
                *owner = Standing::of_another(&owner.queue);
                if self.connection.faulty() {
                    self.pass_turn(now);
                }
            }
            (Some(mover), _) => {
                // Who is new tells it himself, unless nothing is left to be told but what the mover says.
                mover.is_next &= at_rest;
                self.connection = Connection::default();
                self.arbitration.queue = self.arbitration.queue.of_another();
            }
            (None, _) => {
                self.connection = Connection::default();
                self.ask_anew();
            }
        }
    }

    /// Where nobody else is needed any more to stop the camera, its owner may move it. Whoever would not be heard leaves it to the other.
    pub fn settle_speaker(&mut self, now: Time) {
        let is_next = self.other.as_ref().is_some_and(|other| other.is_next);
        if is_next && self.pass_turn(now) {
            return;
        }
        if self.has_stopped(now) {
            self.decide_speaker();
        } else if self.arbitration.queue.heard_at() > now {
            self.pass_turn(now);
        }
    }

    /// What whoever speaks has told the camera, and it said yes to, had no effect.
    pub(super) fn was_told_in_vain(&mut self) {
        if let Some(other) = &mut self.other {
            other.is_next = true;
        }
    }

    /// It had.
    pub(super) fn had_effect(&mut self) {
        if let Some(other) = &mut self.other {
            other.is_next = false;
        }
    }

    /// When whoever moved the camera may stop it, where he is next.
    pub(super) fn last_word_at(&self) -> Option<Time> {
        let is_heard = |mover: &&Standing| mover.is_next && !mover.connection.halted();
        let mover = self.other.as_ref().filter(|_| self.speaker == Speaker::Newcomer).filter(is_heard)?;
        Some(mover.heard_at())
    }

    /// Whether he is to stop it yet.
    pub fn awaits_mover(&self) -> bool {
        self.last_word_at().is_some()
    }

    /// Whether nothing is left to be told for the camera to rest for good.
    pub fn has_stopped(&self, now: Time) -> bool {
        let most = self.unseen_repeats();
        let is_open = self.stop_confirmation.as_ref().is_some_and(|stop| stop.is_open(most, now));
        let is_leaving = self.stop_confirmation.as_ref().is_some_and(StopConfirmation::is_leaving);
        // Nobody is followed meanwhile; at the end nobody is anyway.
        let patience = if is_leaving { Forbidden::RARELY } else { Forbidden::PAUSE };
        let waits = self.last_word_at().is_some_and(|at| at <= now + patience);
        self.stays_at_rest() && !is_open && !waits
    }

    /// It did as whoever speaks has told it; where its yes is not to be trusted, that shows later.
    pub(super) fn was_obeyed(&mut self) {
        if self.speaker == Speaker::Newcomer && self.stop_confirmation.is_none() {
            self.decide_speaker();
        }
    }

    /// It did not: it is the other's turn, but not his whom it has locked out, nor sooner than he may ask again. Whether it is.
    pub(super) fn pass_turn(&mut self, now: Time) -> bool {
        let Some(other) = &self.other else { return false };
        let heard_at = heard_at(&self.connection, &self.arbitration.queue).max(now);
        let is_heard =
            !other.connection.halted() && (self.connection.halted() || other.heard_at() <= heard_at);
        if is_heard {
            self.give_way();
            self.speaker = if self.speaker == Speaker::Mover { Speaker::Newcomer } else { Speaker::Mover };
        } else if self.connection.halted() && other.connection.halted() {
            self.decide_speaker();
        }
        is_heard
    }

    /// Has the other speak, who stops the camera where he was to be next.
    fn give_way(&mut self) {
        if self.other.as_ref().is_some_and(|other| other.is_next) {
            // Even where it has said yes once more meanwhile: that is worth no more than the yes before.
            self.scheduler.turns_on();
        }
        self.exchange();
    }

    fn exchange(&mut self) {
        if let Some(other) = &mut self.other {
            mem::swap(&mut self.connection, &mut other.connection);
            mem::swap(&mut self.arbitration.queue, &mut other.queue);
            other.is_next = false;
        }
    }

    /// How whoever moved the camera is refused, and how long he is to wait.
    pub fn refusal(&self, now: Time) -> Option<(Forbidden, Duration)> {
        let mover = self.other.as_ref().filter(|_| self.speaker == Speaker::Newcomer);
        mover.map_or(&self.connection, |mover| &mover.connection).forbidden(now)
    }

    fn decide_speaker(&mut self) {
        if self.speaker == Speaker::Mover {
            self.exchange();
        }
        if self.other.take().is_some() {
            self.speaker = Speaker::Owner;
            self.ask_anew();
        }
    }

    fn ask_anew(&mut self) {
        self.discovery.renew();
        self.arbitration.queue.permitted();
        self.next_poll = Time::ZERO;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::PROTOCOL;
    use crate::session::scheduler::Scheduler;
    use crate::session::{CommandedMotion, Fact, Steering};
    use crate::{Command, Error, Next, Query, Request, Response, SessionSettings, Stop};
    use servo::{Actuation, CommandHistory, Mode, Position};

    /// With a camera that moves.
    fn session() -> Session {
        let mut session = Session::new(Mode::Velocity, SessionSettings::default(), &PROTOCOL);
        session.inherit(Stop::PanTilt, Time::ZERO);
        session.stand_in(Time::ZERO);
        session
    }

    impl Session {
        /// What is told fails; returns whose turn it is then.
        fn fails(&mut self, err: &Error) -> Speaker {
            self.connection.failed(err, true, Time::ZERO);
            self.pass_turn(Time::ZERO);
            self.speaker()
        }
    }

    /// Nobody is followed.
    fn with_steering<T>(act: impl FnOnce(&Steering) -> T) -> T {
        let history = CommandHistory::default();
        act(&Steering {
            commands: CommandedMotion { pan_tilt: &history, zoom: None },
            holds_target: false,
            is_under_way: false,
            is_zooming: false,
            leads_home: false,
            presets_due: None,
        })
    }

    const HALT: Request = Request::Command(Command::Stop(Stop::PanTilt));
    const ASK: Request = Request::Query(Query::Position);

    impl Session {
        /// What is done at this time.
        fn next(&mut self, now: Time) -> Next {
            self.settle_speaker(now);
            self.catch_up(now);
            with_steering(|steering| self.next_request(Actuation::Rest, steering, now))
        }

        /// What is sent at this time, if anything.
        fn sends(&mut self, now: Time) -> Option<Request> {
            let Next::Do(request) = self.next(now) else { return None };
            self.sending(&request, now);
            Some(request)
        }

        fn hears(&mut self, request: &Request, answer: Result<Response, Error>, now: Time) {
            with_steering(|steering| {
                for fact in self.on_response(request, answer, steering, (now, now)) {
                    if matches!(fact, Fact::Position { .. }) {
                        self.positioned(steering, now);
                    }
                }
            });
        }

        /// Everything that is sent at this time is answered with yes; returns who said a stop.
        fn obeyed_at(&mut self, now: Time) -> Vec<Speaker> {
            self.answered_at(now, |_| Ok(Response::Accepted))
        }

        /// A stop of whoever speaks is answered so.
        fn answered_at(
            &mut self,
            now: Time,
            mut answer: impl FnMut(Speaker) -> Result<Response, Error>,
        ) -> Vec<Speaker> {
            let mut said = Vec::new();
            while let Some(request) = self.sends(now) {
                let answer = match request {
                    Request::Command(_) => {
                        said.push(self.speaker());
                        answer(self.speaker())
                    }
                    Request::Query(_) => Ok(Response::Position(Position::default())),
                };
                self.hears(&request, answer, now);
            }
            said
        }

        /// Pictures from then on show it to turn.
        fn seen_turning(&mut self, from: Time) {
            for picture in 0..5 {
                let at = from + Duration::from_millis(40 * picture);
                self.see_background(Some(0.5), at, at);
            }
        }
    }

    /// The same, whose yes to a stop is not to be trusted; in doubt, or not.
    fn untrusted(in_doubt: bool) -> Session {
        let mut session = session();
        session.stop_confirmation = Some(StopConfirmation::default());
        if !in_doubt {
            session.scheduler = Scheduler::new(PROTOCOL.keep_alive);
            session.scheduler.found_moving(Stop::PanTilt);
        }
        session
    }

    fn broken() -> Error {
        Error::Broken("reset".to_owned())
    }

    fn wrong() -> Error {
        Error::BadCredentials { user: "root".to_owned() }
    }

    /// Rights or certificates may lack one or the other.
    #[test]
    fn who_is_not_obeyed_gives_way_for_as_long_as_somebody_may_be_heard() {
        for err in [
            Error::Timeout(Duration::from_secs(2)),
            Error::Camera("no".to_owned()),
            Error::Broken("reset".to_owned()),
        ] {
            let mut session = session();
            assert_eq!(session.speaker(), Speaker::Mover);
            assert_eq!(
                [0; 4].map(|_| session.fails(&err)),
                [Speaker::Newcomer, Speaker::Mover].repeat(2)[..]
            );
            session.fails(&err);
            session.was_obeyed();
            assert_eq!(session.speaker(), Speaker::Owner);
            assert_eq!(session.fails(&err), Speaker::Owner);
        }
    }

    #[test]
    fn whom_the_camera_locks_out_is_not_heard_again() {
        let mut session = session();
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        assert_eq!(session.fails(&forbidden), Speaker::Newcomer);
        assert_eq!(session.fails(&wrong()), Speaker::Mover);
        assert_eq!([0; 4].map(|_| session.fails(&forbidden)), [Speaker::Mover; 4], "it may pass");
        session.owner_changed(Time::ZERO);
        assert_eq!(session.speaker(), Speaker::Newcomer, "with another password he is, and at once");
        assert_eq!(session.fails(&wrong()), Speaker::Mover);
        assert_eq!(session.fails(&wrong()), Speaker::Owner, "nobody is left");
        assert!(session.halted());
    }

    /// Whom it refuses is to ask rarely; that is no reason for the other to wait.
    #[test]
    fn who_may_ask_again_first_speaks() {
        let mut session = session();
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        let broken = Error::Broken("reset".to_owned());
        session.fails(&forbidden);
        assert_eq!(session.fails(&broken), Speaker::Mover);
        assert_eq!(session.fails(&forbidden), Speaker::Newcomer);
        assert_eq!([0; 8].map(|_| session.fails(&broken)), [Speaker::Newcomer; 8]);
    }

    /// A pause that is over is none, however long ago the other's was.
    #[test]
    fn who_is_refused_without_a_pause_gives_way_to_who_may_ask_again() {
        let mut session = session();
        session.fails(&Error::Broken("reset".to_owned()));
        let later = Time::from_millis(5000);
        session.pass_turn(later);
        assert_eq!(session.speaker(), Speaker::Mover);
    }

    /// Whom the camera does not hear in its queue, who is to ask again where he stands in five seconds.
    fn with_newcomer_out_of_turn() -> Session {
        let mut session = session();
        session.arbitration.queue = ControlQueue::default();
        session.fails(&Error::Broken("reset".to_owned()));
        session.arbitration.queue = ControlQueue::default();
        session.arbitration.queue.told(Some(true));
        session.arbitration.queue.failed(Time::ZERO);
        assert!(session.arbitration.queue.refused_command() && session.is_deaf());
        session
    }

    /// Each has a place of his own in the camera's queue.
    #[test]
    fn who_is_out_of_turn_in_the_queue_leaves_the_stop_to_who_is_not() {
        let mut session = with_newcomer_out_of_turn();
        session.settle_speaker(Time::from_millis(1000));
        assert_eq!((session.speaker(), session.is_deaf()), (Speaker::Mover, false));
        session.fails(&Error::Broken("reset".to_owned()));
        assert_eq!(session.speaker(), Speaker::Mover, "he would not be heard");
        session.pass_turn(Time::from_millis(5000));
        assert_eq!(session.speaker(), Speaker::Newcomer, "by now he may be");
        session.settle_speaker(Time::from_millis(5000));
        assert_eq!(session.speaker(), Speaker::Newcomer, "he asks first");
    }

    /// What is under way is answered to whoever asked.
    #[test]
    fn who_was_told_yes_in_vain_gives_way_once_nothing_is_under_way() {
        let mut session = session();
        session.stop_confirmation = Some(StopConfirmation::default());
        session.fails(&broken());
        session.scheduler = Scheduler::new(PROTOCOL.keep_alive);
        session.stop_confirmation.as_mut().unwrap().stopped(Time::ZERO);
        session.seen_turning(Time::from_millis(2000));
        assert!(!session.is_at_rest());
        assert_eq!(session.speaker(), Speaker::Newcomer);
        session.settle_speaker(Time::from_millis(3000));
        assert_eq!(session.speaker(), Speaker::Mover);
        session.settle_speaker(Time::from_millis(3000));
        assert_eq!(session.speaker(), Speaker::Mover, "once");
    }

    /// Of a camera that says yes to whom it does not know, and turns on.
    #[test]
    fn whoever_moved_the_camera_has_the_last_word_where_no_picture_tells() {
        let mut session = untrusted(false);
        assert_eq!(session.fails(&broken()), Speaker::Newcomer);
        let said: Vec<_> =
            (0..16).flat_map(|half_second| session.obeyed_at(Time::from_millis(500 * half_second))).collect();
        assert_eq!(said.first(), Some(&Speaker::Newcomer));
        assert_eq!(said.last(), Some(&Speaker::Mover), "{said:?}");
        assert!(said.len() <= 3, "once: {said:?}");
        assert_eq!(session.speaker(), Speaker::Owner);
    }

    /// What the newcomer said is repeated without a pause then, and the mover's pause has grown.
    #[test]
    fn whoever_moved_the_camera_has_the_last_word_at_the_end_too() {
        let mut session = untrusted(false);
        assert_eq!([0; 3].map(|_| session.fails(&broken())).last(), Some(&Speaker::Newcomer));
        session.leave(Time::ZERO);
        let said: Vec<_> =
            (1..10).flat_map(|tenth| session.obeyed_at(Time::from_millis(100 * tenth))).collect();
        assert_eq!(said.last(), Some(&Speaker::Mover), "{said:?}");
        assert!(said.len() <= 3, "{said:?}");
        assert!(session.stays_at_rest());
    }

    fn seconds(seconds: u64) -> Time {
        Time::from_millis(1000 * seconds)
    }

    /// The mover was refused once and so many times more: after the first of them he may ask again after ten seconds, after each one
    /// more twice as late.
    fn with_refused_mover(times: u32) -> Session {
        let mut session = untrusted(false);
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        assert_eq!(session.fails(&forbidden), Speaker::Newcomer);
        for _ in 0..times {
            session.other.as_mut().unwrap().connection.failed(&forbidden, true, Time::ZERO);
        }
        session
    }

    impl Session {
        /// Everything is answered with yes up to that time, and nobody asks for the position; returns who said a stop, and when.
        fn obeyed_until(&mut self, from: Time, until: Time) -> Vec<(Speaker, Time)> {
            let (mut said, mut now) = (Vec::new(), from);
            while now < until {
                said.extend(self.obeyed_at(now).into_iter().map(|speaker| (speaker, now)));
                self.next_poll = until;
                let Next::Wait(Some(wake)) = self.next(now) else { panic!("all is said") };
                assert!(wake > now);
                now = wake;
            }
            said
        }
    }

    #[test]
    fn whoever_moved_the_camera_has_the_last_word_however_long_he_is_to_wait() {
        let mut session = with_refused_mover(2);
        let said = session.obeyed_until(Time::ZERO, seconds(15));
        assert!(
            said.iter().all(|(speaker, at)| *speaker == Speaker::Newcomer && *at < seconds(10)),
            "{said:?}"
        );
        assert!(session.stays_at_rest() && !session.has_stopped(seconds(15)));
        // Another password is no reason to forget him.
        session.owner_changed(seconds(15));
        assert_eq!(session.obeyed_until(seconds(15), seconds(22)), [(Speaker::Mover, seconds(20))]);
        session.obeyed_until(seconds(22), seconds(40));
        assert_eq!(session.speaker(), Speaker::Owner);
    }

    #[test]
    fn at_the_end_he_is_not_forgotten_however_long_he_is_to_wait() {
        let mut session = with_refused_mover(2);
        session.leave(Time::ZERO);
        session.obeyed_until(Time::ZERO, seconds(8));
        assert!(session.stays_at_rest() && session.awaits_mover());
        assert_eq!(session.obeyed_until(seconds(8), seconds(22)), [(Speaker::Mover, seconds(20))]);
        assert!(!session.awaits_mover());
    }

    #[test]
    fn nor_is_he_asked_sooner_where_nobody_else_may_ask() {
        let mut session = with_refused_mover(2);
        session.obeyed_until(Time::ZERO, seconds(15));
        session.owner_changed(seconds(15));
        session.hears(&ASK, Err(wrong()), seconds(15));
        assert_eq!(session.speaker(), Speaker::Mover);
        assert_eq!(session.obeyed_until(seconds(15), seconds(22)), [(Speaker::Mover, seconds(20))]);
    }

    #[test]
    fn where_the_mover_is_the_owner_after_all_he_has_the_last_word_as_such() {
        let mut session = with_refused_mover(1);
        session.obeyed_until(Time::ZERO, seconds(8));
        assert!(session.stays_at_rest() && session.awaits_mover());
        session.mover_stays();
        assert_eq!(session.obeyed_until(seconds(8), seconds(12)), [(Speaker::Owner, seconds(10))]);
    }

    #[test]
    fn nobody_waits_for_the_mover_where_the_camera_is_seen_to_rest() {
        let mut session = with_refused_mover(1);
        told_in_vain(&mut session);
        let later = Time::from_millis(3000);
        assert_eq!(session.obeyed_at(later), [Speaker::Newcomer]);
        let shown = Time::from_millis(4500);
        session.see_background(Some(0.0), shown, shown);
        session.settle_speaker(shown);
        assert_eq!(session.speaker(), Speaker::Owner);
    }

    #[test]
    fn a_stop_of_the_movers_that_is_lost_is_not_his_last_word() {
        let mut session = untrusted(false);
        assert_eq!(session.fails(&broken()), Speaker::Newcomer);
        let (mut said, mut is_lost) = (Vec::new(), false);
        for half_second in 0..40 {
            said.extend(session.answered_at(Time::from_millis(500 * half_second), |speaker| {
                let lost = speaker == Speaker::Mover && !is_lost;
                is_lost |= lost;
                if lost { Err(broken()) } else { Ok(Response::Accepted) }
            }));
        }
        assert!(is_lost && said.len() <= 6, "{said:?}");
        assert_eq!(said.last(), Some(&Speaker::Mover), "{said:?}");
        assert_eq!(session.speaker(), Speaker::Owner);
    }

    #[test]
    fn a_yes_that_comes_after_pictures_have_shown_it_to_be_worth_nothing_is_worth_no_more() {
        let mut session = untrusted(true);
        session.fails(&broken());
        assert_eq!(session.obeyed_at(Time::from_millis(4000)), [Speaker::Newcomer]);
        let now = Time::from_millis(6000);
        assert_eq!(session.sends(now), Some(HALT), "it may have acted on something since");
        session.seen_turning(now);
        session.hears(&HALT, Ok(Response::Accepted), now);
        assert_eq!(session.obeyed_at(Time::from_millis(6200)), [Speaker::Mover]);
    }

    /// Says a stop, to which the camera says yes, and turns on.
    fn told_in_vain(session: &mut Session) {
        session.obeyed_at(Time::from_millis(1000));
        session.seen_turning(Time::from_millis(2500));
        assert!(!session.is_at_rest());
    }

    #[test]
    fn a_yes_in_vain_is_held_against_nobody_but_who_was_told_it() {
        let later = Time::from_millis(3000);
        let mut session = Session::new(Mode::Velocity, SessionSettings::default(), &PROTOCOL);
        session.stop_confirmation = Some(StopConfirmation::default());
        session.scheduler.found_moving(Stop::PanTilt);
        told_in_vain(&mut session);
        session.stand_in(later);
        session.settle_speaker(later);
        assert_eq!(session.speaker(), Speaker::Mover, "nobody else was there then");

        let newcomer_in_vain = || {
            let mut session = untrusted(false);
            session.fails(&broken());
            told_in_vain(&mut session);
            assert_eq!(session.speaker(), Speaker::Newcomer);
            session
        };
        let mut session = newcomer_in_vain();
        session.owner_changed(later);
        session.settle_speaker(later);
        assert_eq!(session.speaker(), Speaker::Newcomer, "it is another");

        let mut session = newcomer_in_vain();
        session.pass_turn(later);
        assert_eq!(session.speaker(), Speaker::Mover);
        session.settle_speaker(later);
        assert_eq!(session.speaker(), Speaker::Mover, "he has given way already");
    }

    /// It is only to the mover that the camera says no, as far as anybody knows.
    #[test]
    fn what_is_refused_to_the_mover_says_nothing_of_the_mode() {
        let mut session = session();
        session.fails(&broken());
        assert_eq!(session.fails(&wrong()), Speaker::Mover);
        let refusal = || Err(Error::Camera("no".to_owned()));
        session.hears(&HALT, refusal(), Time::from_millis(1000));
        session.hears(&ASK, Ok(Response::Position(Position::default())), Time::from_millis(2000));
        session.hears(&HALT, refusal(), Time::from_millis(3000));
        assert!(!session.modes.lacks(Mode::Velocity, Time::from_millis(3000)));
        assert_eq!(session.stop(), Stop::PanTilt);
    }

    /// It is by the queue's answer that he is heard or not.
    #[test]
    fn a_position_that_is_not_told_passes_no_turn() {
        let mut session = with_newcomer_out_of_turn();
        let now = Time::from_millis(5000);
        session.hears(&ASK, Err(Error::Camera("no".to_owned())), now);
        assert_eq!((session.speaker(), session.is_deaf()), (Speaker::Newcomer, true));
    }

    #[test]
    fn how_the_mover_is_refused_is_known_whoever_speaks_and_heeded_by_who_comes_next() {
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        let mut session = session();
        assert_eq!(session.fails(&forbidden), Speaker::Newcomer);
        assert!(session.refusal(Time::ZERO).is_some());
        assert_eq!(session.fails(&broken()), Speaker::Mover);
        session.fails(&forbidden);
        let refusal = session.refusal(Time::from_millis(4000)).unwrap();
        assert_eq!(refusal.1, Duration::from_secs(6));

        let mut next = Session::new(Mode::Velocity, SessionSettings::default(), &PROTOCOL);
        next.inherit(Stop::PanTilt, Time::ZERO);
        next.inherit_refusal(refusal, Time::ZERO);
        assert_eq!([0, 100, 5900].map(|at| next.sends(Time::from_millis(at))), [None; 3]);
        assert_eq!(next.sends(Time::from_millis(6000)), Some(HALT));
        next.stand_in(Time::ZERO);
        assert_eq!(next.speaker(), Speaker::Newcomer, "with another password he need not wait");
    }

    #[test]
    fn who_is_out_of_turn_speaks_where_nobody_else_may() {
        let mut session = with_newcomer_out_of_turn();
        session.settle_speaker(Time::from_millis(1000));
        assert_eq!(session.fails(&wrong()), Speaker::Newcomer);
        assert!(!session.halted());
    }

    #[test]
    fn another_password_is_heard_though_the_one_before_was_out_of_turn() {
        let mut session = with_newcomer_out_of_turn();
        session.settle_speaker(Time::from_millis(1000));
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        assert_eq!(session.fails(&forbidden), Speaker::Mover);
        session.owner_changed(Time::from_millis(1000));
        assert_eq!((session.speaker(), session.is_deaf()), (Speaker::Newcomer, false));
    }

    #[test]
    fn the_movers_own_password_given_again_makes_him_the_owner() {
        let mut session = session();
        session.fails(&Error::Broken("reset".to_owned()));
        session.fails(&wrong());
        assert_eq!(session.speaker(), Speaker::Mover);
        session.mover_stays();
        assert_eq!(session.speaker(), Speaker::Owner);
        assert!(session.connection.faulty() && !session.halted(), "what was his is");
    }

    #[test]
    fn the_mover_speaks_until_the_camera_rests_for_good() {
        let mut session = session();
        session.was_obeyed();
        session.settle_speaker(Time::ZERO);
        assert_eq!(session.speaker(), Speaker::Mover, "it may yet act on what was said before");
        session.scheduler = Scheduler::new(PROTOCOL.keep_alive);
        session.settle_speaker(Time::ZERO);
        assert_eq!(session.speaker(), Speaker::Owner);
    }

    #[test]
    fn who_was_refused_just_before_does_not_begin() {
        let mut session = Session::new(Mode::Velocity, SessionSettings::default(), &PROTOCOL);
        session.connection.failed(&Error::CredentialsMissing, true, Time::ZERO);
        session.stand_in(Time::ZERO);
        assert_eq!(session.speaker(), Speaker::Newcomer);
    }
}
