// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::Time;

use crate::{QueuePlace, QueueRequest};

/// Our place in the camera's control queue, where it has one.
#[derive(Debug, Default)]
pub struct ControlQueue {
    state: State,
    ask_at: Time,
    leaving: bool,
    /// A command was refused in our turn, and none was accepted since.
    doubted: bool,
    /// The camera said that it is not our turn.
    held: bool,
    /// A command was refused out of our turn: so would be the next, until it is said again where we stand.
    deaf: bool,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Nobody said whether there is one.
    #[default]
    Unknown,
    /// There is none.
    Absent,
    /// We may not ask: whether it is our turn shows when we move the camera.
    Forbidden,
    /// The camera refused something, as it would in others' hands: perhaps there is one.
    Presumed,
    /// There is one, and we are not in it.
    Outside,
    /// We wait.
    Waiting,
    /// It is our turn.
    InControl,
}

impl ControlQueue {
    /// A camera that names no time, or does not answer, is asked again after this.
    const PAUSE: Duration = Duration::from_secs(5);

    /// Of somebody else at the same camera, who has not asked for a place.
    pub fn of_another(&self) -> Self {
        let state = if self.state == State::Absent { State::Absent } else { State::Unknown };
        Self { state, leaving: self.leaving, ..Self::default() }
    }

    /// The protocol has none.
    pub fn absent() -> Self {
        Self { state: State::Absent, ..Self::default() }
    }

    /// The camera's parameters tell whether there is a queue; what it refused is a better witness.
    pub fn told(&mut self, queueing: Option<bool>) {
        match (queueing, self.state) {
            (Some(true), State::Unknown | State::Absent) => self.state = State::Outside,
            (Some(false), State::Unknown) => self.state = State::Absent,
            (Some(false), _) if self.exists() => {
                *self = Self { state: State::Absent, held: false, deaf: false, ..*self };
            }
            _ => {}
        }
    }

    /// The camera refused something with words; returns whether a queue may be the reason, and is worth asking.
    pub fn refused(&mut self, now: Time) -> bool {
        match self.state {
            State::Unknown => self.state = State::Presumed,
            State::InControl if !self.doubted => self.state = State::Waiting,
            _ => return false,
        }
        self.doubted = true;
        self.ask_at = now;
        true
    }

    /// A command was refused with words; returns whether that is no wonder, as it is not our turn.
    pub fn refused_command(&mut self) -> bool {
        self.deaf = !self.lets_us();
        self.deaf
    }

    /// Whether commands are pointless until the next answer, a stop too.
    pub fn is_deaf(&self) -> bool {
        self.deaf
    }

    /// When commands are worth a try again: where they are pointless now, once it was asked where we stand.
    pub fn heard_at(&self) -> Time {
        if self.deaf { self.ask_at } else { Time::ZERO }
    }

    /// The camera did as it was told.
    pub fn obeyed(&mut self) {
        self.doubted = false;
    }

    /// What to ask, and when. The place is not given up before the camera is at rest: to stop it may take our turn.
    pub fn next(&self, at_rest: bool) -> Option<(QueueRequest, Time)> {
        let leaving = self.leaving && at_rest;
        match self.state {
            State::Unknown | State::Absent | State::Forbidden => None,
            State::Waiting | State::InControl if leaving => Some((QueueRequest::Drop, Time::ZERO)),
            _ if leaving => None,
            State::Presumed | State::Outside => Some((QueueRequest::Request, self.ask_at)),
            State::Waiting | State::InControl => Some((QueueRequest::Query, self.ask_at)),
        }
    }

    /// The camera answered; `None`: it said no more than yes.
    pub fn answered(&mut self, request: QueueRequest, place: Option<QueuePlace>, now: Time) {
        self.state = match (request, place.map(|place| place.position)) {
            (QueueRequest::Drop, _) => State::Outside,
            (_, None | Some(1)) => State::InControl,
            (_, Some(0)) if self.state == State::Presumed => State::Absent,
            (_, Some(0)) => State::Outside,
            (_, Some(_)) => State::Waiting,
        };
        self.held = !matches!(self.state, State::InControl | State::Absent) && request != QueueRequest::Drop;
        self.deaf = false;
        // Twice as often as it wants, so that one lost question does not cost the place.
        self.ask_at = now + place.map_or(Self::PAUSE, |place| place.poll_every) / 2;
    }

    /// The camera did not say.
    pub fn failed(&mut self, now: Time) {
        self.state = if self.state == State::Presumed { State::Absent } else { State::Outside };
        self.ask_at = now + Self::PAUSE;
        self.deaf = false;
    }

    /// The camera refused to let us in: so many are before us that there is no place.
    pub fn turned_away(&mut self, now: Time) {
        self.failed(now);
        self.held = self.exists() && !self.leaving;
    }

    /// We may not ask.
    pub fn forbidden(&mut self) {
        (self.state, self.held, self.deaf) = (State::Forbidden, false, false);
    }

    /// Now we may perhaps.
    pub fn permitted(&mut self) {
        if self.state == State::Forbidden {
            self.state = State::Unknown;
        }
    }

    /// The connection was lost, and may be with it our place.
    pub fn forget(&mut self) {
        if self.exists() {
            *self = Self { state: State::Outside, ask_at: Time::ZERO, held: false, deaf: false, ..*self };
        }
    }

    /// It is the end: give up the place.
    pub fn leave(&mut self) {
        self.leaving = true;
    }

    /// Whether there is a place to be given up.
    pub fn is_in(&self) -> bool {
        matches!(self.state, State::Waiting | State::InControl)
    }

    /// Whether the camera said that it is somebody else's turn.
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        let held = matches!(self.state, State::Outside | State::Waiting);
        assert!(held || !self.held, "held by others, though it is no queue's turn: {self:?}");
        assert!(!self.deaf || !self.lets_us(), "deaf in our own turn: {self:?}");
    }

    fn exists(&self) -> bool {
        matches!(self.state, State::Outside | State::Waiting | State::InControl)
    }

    /// Whether we may move the camera.
    pub fn lets_us(&self) -> bool {
        !matches!(self.state, State::Presumed | State::Outside | State::Waiting)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s<T: From<Duration>>(s: u64) -> T {
        Duration::from_secs(s).into()
    }

    fn place(position: u32) -> Option<QueuePlace> {
        Some(QueuePlace { position, poll_every: s(20) })
    }

    #[test]
    fn a_camera_without_a_queue_is_asked_nothing() {
        let mut queue = ControlQueue::default();
        assert!(queue.lets_us() && queue.next(true).is_none());
        queue.told(Some(false));
        assert!(!queue.refused(s(1)));
        assert!(queue.lets_us() && queue.next(true).is_none());
    }

    #[test]
    fn it_queues_waits_and_comes_to_its_turn() {
        let mut queue = ControlQueue::default();
        queue.told(Some(true));
        assert!(!queue.lets_us() && !queue.is_held(), "that is not known yet");
        assert_eq!(queue.next(true), Some((QueueRequest::Request, s(0))));
        queue.answered(QueueRequest::Request, place(2), s(1));
        assert!(!queue.lets_us() && queue.is_in() && queue.is_held());
        assert_eq!(queue.next(true), Some((QueueRequest::Query, s(11))));
        queue.answered(QueueRequest::Query, place(1), s(11));
        assert!(queue.lets_us() && !queue.is_held());
        queue.answered(QueueRequest::Query, place(0), s(21));
        assert!(!queue.lets_us());
        assert_eq!(queue.next(true), Some((QueueRequest::Request, s(31))));
    }

    #[test]
    fn a_refusal_makes_it_look_once() {
        let mut queue = ControlQueue::default();
        assert!(queue.refused(s(3)));
        assert_eq!(queue.next(true), Some((QueueRequest::Request, s(3))));
        assert!(!queue.refused(s(3)), "there is something else amiss");
        queue.failed(s(3));
        assert!(queue.lets_us() && queue.next(true).is_none() && !queue.refused(s(4)));
        let mut queue = ControlQueue::default();
        queue.refused(s(3));
        queue.answered(QueueRequest::Request, place(1), s(3));
        assert!(queue.lets_us() && queue.exists());
        queue.obeyed();
        assert!(queue.refused(s(4)), "somebody pushed in");
        assert_eq!(queue.next(true), Some((QueueRequest::Query, s(4))));
        queue.answered(QueueRequest::Query, place(1), s(4));
        assert!(!queue.refused(s(5)), "it is our turn, so there is something else amiss");
    }

    #[test]
    fn where_we_may_not_ask_we_do_not() {
        let mut queue = ControlQueue::default();
        queue.told(Some(true));
        queue.forbidden();
        assert!(queue.lets_us() && queue.next(true).is_none() && !queue.refused(s(1)) && !queue.is_held());
    }

    #[test]
    fn at_the_end_the_place_is_given_up() {
        let mut queue = ControlQueue::default();
        queue.leave();
        assert_eq!(queue.next(true), None);
        queue.told(Some(true));
        queue.answered(QueueRequest::Request, place(1), s(0));
        assert_eq!(queue.next(false), Some((QueueRequest::Query, s(10))), "a stop may take our turn");
        assert_eq!(queue.next(true), Some((QueueRequest::Drop, s(0))));
        queue.answered(QueueRequest::Drop, None, s(0));
        assert!(queue.next(true).is_none() && !queue.is_in());
    }

    #[test]
    fn out_of_turn_a_refused_command_is_pointless_until_the_next_answer() {
        let mut queue = ControlQueue::default();
        assert!(!queue.refused_command() && !queue.is_deaf());
        queue.told(Some(true));
        queue.answered(QueueRequest::Request, place(2), s(0));
        assert!(!queue.is_deaf(), "it is worth a try");
        assert!(queue.refused_command() && queue.is_deaf());
        queue.answered(QueueRequest::Query, place(2), s(10));
        assert!(!queue.is_deaf());
        queue.refused_command();
        queue.failed(s(20));
        assert!(!queue.is_deaf() && queue.refused_command());
        queue.answered(QueueRequest::Request, place(1), s(25));
        assert!(!queue.refused_command() && !queue.is_deaf(), "that is for another reason");
    }

    #[test]
    fn after_an_outage_it_queues_anew() {
        let mut queue = ControlQueue::default();
        queue.forget();
        assert!(queue.lets_us());
        queue.told(Some(true));
        queue.answered(QueueRequest::Request, place(1), s(0));
        queue.forget();
        assert_eq!(queue.next(true), Some((QueueRequest::Request, s(0))));
    }

    #[test]
    fn a_queue_that_lets_nobody_in_is_in_others_hands_and_one_that_is_silent_is_not() {
        let mut queue = ControlQueue::default();
        assert!(queue.refused(s(0)));
        queue.turned_away(s(0));
        assert!(!queue.is_held(), "there may be none");
        queue.told(Some(true));
        queue.failed(s(1));
        assert!(!queue.is_held());
        queue.turned_away(s(6));
        assert!(queue.is_held() && !queue.lets_us());
        assert_eq!(
            queue.next(true),
            Some((QueueRequest::Request, Time::from_millis(6000) + ControlQueue::PAUSE))
        );
        queue.answered(QueueRequest::Request, place(1), s(11));
        assert!(!queue.is_held() && queue.lets_us());
        queue.leave();
        queue.turned_away(s(12));
        assert!(!queue.is_held(), "we are on our way out");
    }

    #[test]
    fn a_queue_that_was_switched_off_holds_nobody() {
        let mut queue = ControlQueue::default();
        queue.told(Some(true));
        queue.turned_away(s(0));
        queue.told(None);
        assert!(queue.is_held());
        queue.told(Some(false));
        assert!(!queue.is_held() && queue.lets_us() && queue.next(true).is_none());
    }
}
