// SPDX-License-Identifier: MPL-2.0

//! As whom the camera is spoken to where it may move at somebody else's word, or at ours from before our password was changed. It does
//! not stop for whom it does not know, so whoever moved it stops it, or we where it does not obey him; and nobody moves it until then.

use std::mem;

use servo::Time;

use super::Session;
use super::connection::Connection;
use super::control_queue::ControlQueue;

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
}

impl Standing {
    /// Of somebody who was not heard of yet, where another stands so in its queue.
    fn of_another(queue: &ControlQueue) -> Self {
        Self { connection: Connection::default(), queue: queue.of_another() }
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
            self.exchange();
        }
        self.other = None;
        self.speaker = Speaker::Owner;
        self.ask_anew();
    }

    /// The camera may be asked anew: its owner is another. He need not wait for whom it does not hear.
    pub fn owner_changed(&mut self, now: Time) {
        match (&mut self.other, self.speaker) {
            (Some(owner), Speaker::Mover) => {
                *owner = Standing::of_another(&owner.queue);
                if self.connection.faulty() {
                    self.pass_turn(now);
                }
            }
            (Some(_), _) => {
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
        if self.has_stopped(now) {
            self.decide_speaker();
        } else if mem::take(&mut self.gives_way) || self.arbitration.queue.heard_at() > now {
            self.pass_turn(now);
        }
    }

    /// Whether nothing is left to be told for the camera to rest for good.
    pub fn has_stopped(&self, now: Time) -> bool {
        self.stays_at_rest() && !self.stop_confirmation.as_ref().is_some_and(|stop| stop.is_open(now))
    }

    /// It did as whoever speaks has told it; where its yes is not to be trusted, that shows later.
    pub(super) fn was_obeyed(&mut self) {
        if self.speaker == Speaker::Newcomer && self.stop_confirmation.is_none() {
            self.decide_speaker();
        }
    }

    /// It did not: it is the other's turn, but not his whom it has locked out, nor sooner than he may ask again.
    pub(super) fn pass_turn(&mut self, now: Time) {
        let Some(other) = &self.other else { return };
        let heard_at = heard_at(&self.connection, &self.arbitration.queue).max(now);
        if !other.connection.halted() && (self.connection.halted() || other.heard_at() <= heard_at) {
            self.exchange();
            self.speaker = if self.speaker == Speaker::Mover { Speaker::Newcomer } else { Speaker::Mover };
        } else if self.connection.halted() && other.connection.halted() {
            self.decide_speaker();
        }
    }

    /// Has the other speak.
    fn exchange(&mut self) {
        if let Some(other) = &mut self.other {
            mem::swap(&mut self.connection, &mut other.connection);
            mem::swap(&mut self.arbitration.queue, &mut other.queue);
        }
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
    use crate::session::StopConfirmation;
    use crate::session::scheduler::Scheduler;
    use crate::{Error, SessionSettings, Stop};
    use servo::Mode;
    use std::time::Duration;

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
        session.fails(&Error::Broken("reset".to_owned()));
        session.scheduler = Scheduler::new(PROTOCOL.keep_alive);
        session.stop_confirmation.as_mut().unwrap().stopped(Time::ZERO);
        for picture in 0..5 {
            let at = Time::from_millis(2000 + 40 * picture);
            session.see_background(Some(0.5), at, at);
        }
        assert!(!session.is_at_rest());
        assert_eq!(session.speaker(), Speaker::Newcomer);
        session.settle_speaker(Time::from_millis(3000));
        assert_eq!(session.speaker(), Speaker::Mover);
        session.settle_speaker(Time::from_millis(3000));
        assert_eq!(session.speaker(), Speaker::Mover, "once");
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
