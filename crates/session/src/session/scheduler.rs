// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::{Actuation, Motion, Time};

use crate::{Command, Stop};

/// When to say what to the camera: the newest only, not too often, nothing twice, stops first and
/// until they are confirmed.
#[derive(Debug)]
pub struct Scheduler {
    /// An accepted move is repeated this often: somebody else's command may have come in between, or it ends by itself.
    keep_alive: Duration,
    accepted: Option<(Command, Time)>,
    last_attempt: Option<Time>,
    /// A move was sent that may have had an effect, and no stop was confirmed since.
    may_move: bool,
    stop_tried: bool,
    /// Somebody else moved the camera since, and whose move it is in now is being found out.
    contested: bool,
    /// A move went unanswered, and maybe stops after it: the camera may still act on it until then, even after a stop.
    doubt_until: Option<Time>,
    /// The words that end the last move, whatever the mode is by now.
    stop: Stop,
    /// How long the camera took to answer last.
    round_trip: Duration,
}

impl Scheduler {
    /// A camera that answers a command later than this is not expected to act on it any more.
    pub const DOUBT: Duration = Duration::from_secs(6);

    /// Nothing was said yet; accepted moves are to be repeated this often.
    pub fn new(keep_alive: Duration) -> Self {
        Self {
            keep_alive,
            accepted: None,
            last_attempt: None,
            may_move: false,
            stop_tried: false,
            contested: false,
            doubt_until: None,
            stop: Stop::PanTilt,
            round_trip: Duration::ZERO,
        }
    }

    /// When to send a stop; `None`: no need to, or not known yet.
    pub fn stop_due(&self, now: Time, interval: Duration, retry_at: Time) -> Option<Time> {
        if self.contested {
            return None;
        }
        if !self.may_move {
            return self.doubt_until.map(|until| until.max(retry_at));
        }
        Some(if self.stop_tried { self.next_slot(interval).max(retry_at) } else { now })
    }

    /// When to send this move.
    pub fn move_due(&self, command: &Command, interval: Duration, retry_at: Time) -> Time {
        let repeat = match self.accepted {
            Some((accepted, at)) if accepted == *command => at + self.keep_alive,
            _ => Time::ZERO,
        };
        repeat.max(self.next_slot(interval)).max(retry_at)
    }

    fn next_slot(&self, interval: Duration) -> Time {
        self.last_attempt.map_or(Time::ZERO, |last| last + interval)
    }

    /// A command is being sent.
    pub fn attempted(&mut self, command: &Command, now: Time) {
        self.last_attempt = Some(now);
        self.stop_tried = command.is_stop();
        let Command::Move { motion, .. } = command else { return };
        match motion {
            _ if motion.is_still() => {}
            Motion::Velocity { zoom: Some(_), .. } => self.stop = Stop::AllAxes,
            // A zoom goes on until it is told otherwise.
            Motion::Velocity { .. } if self.stop == Stop::AllAxes => {}
            Motion::Velocity { .. } => self.stop = Stop::PanTilt,
            _ => self.stop = Stop::Position,
        }
    }

    /// What ends the last move.
    pub fn stop(&self) -> Stop {
        self.stop
    }

    /// The camera is to be stopped by these words.
    pub fn stop_by(&mut self, stop: Stop) {
        self.stop = stop;
    }

    /// How long the camera took to answer last.
    pub fn round_trip(&self) -> Duration {
        self.round_trip
    }

    /// The camera answered what was sent then.
    pub fn answered(&mut self, sent: Time, now: Time) {
        self.round_trip = now - sent;
    }

    /// The camera said yes.
    pub fn accepted(&mut self, command: &Command, now: Time) {
        self.accepted = Some((*command, now));
        self.may_move = !command.is_stop();
        if self.doubt_until.is_some_and(|until| until <= now) {
            self.doubt_until = None;
        }
        let zoom_rests =
            matches!(command.actuation(), Actuation::Move(Motion::Velocity { zoom: Some(0.0), .. }));
        if zoom_rests && self.stop == Stop::AllAxes && !self.in_doubt() {
            self.stop = Stop::PanTilt;
        }
    }

    /// It did not; `may_have_acted` where that does not mean that nothing happened.
    pub fn failed(&mut self, command: &Command, may_have_acted: bool, now: Time) {
        if may_have_acted {
            // What the camera does is unknown: the same command is worth sending again.
            self.accepted = None;
            self.may_move |= !command.is_stop();
            // A camera that hangs acts on all that it was sent once it wakes, in whatever order: its time to do so begins then.
            if !command.is_stop() || self.in_doubt() {
                self.doubt_until = Some(now + Self::DOUBT);
            }
        }
    }

    /// A move to a position has ended by itself; from here the same words mean another move.
    pub fn arrived(&mut self) {
        self.accepted = None;
        self.may_move = false;
    }

    /// Somebody else has moved the camera. Where it may be moving at our word too, what it does next tells whose move it
    /// is; but a zoom of ours goes on whatever pan and tilt do, and what looks like somebody else may be a move of ours that
    /// went unanswered. Where it has said yes to a stop and turns on, it is to be stopped, whoever moves it.
    pub fn contest(&mut self) {
        let turns_on = self.accepted.as_ref().is_some_and(|(command, _)| command.is_stop());
        self.contested = self.may_move && self.stop != Stop::AllAxes && !self.in_doubt() && !turns_on;
    }

    /// Whether that is being found out.
    pub fn is_contested(&self) -> bool {
        self.contested
    }

    /// It is found out. Where it is not ours, it has taken the place of ours, and a stop would end his.
    pub fn settle(&mut self, is_ours: bool) {
        self.contested = false;
        if !is_ours {
            self.arrived();
        }
    }

    /// It moves at the word of somebody who is not there any more.
    pub fn found_moving(&mut self, stop: Stop) {
        self.stop = stop;
        self.may_move = true;
        self.stop_tried = false;
    }

    /// It was told to stop, as somebody whom it does not obey: he who says it next may have to wait before.
    pub fn turns_on(&mut self) {
        (self.may_move, self.stop_tried) = (true, true);
    }

    /// It moves at the word of somebody who is not there any more, and not all that he said may have been acted on yet.
    pub fn inherited(&mut self, stop: Stop, now: Time) {
        self.found_moving(stop);
        self.doubt_until = Some(now + Self::DOUBT);
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        let moves = self.accepted.is_some_and(|(command, _)| !command.is_stop());
        assert!(self.may_move || !moves, "an accepted move is taken for rest: {self:?}");
    }

    /// Whether the camera may be moving on our behalf.
    pub fn may_move(&self) -> bool {
        self.may_move
    }

    /// Whether it may be moving, and nobody knows how: its last move went unanswered, or was somebody else's.
    pub fn is_unsure(&self) -> bool {
        self.may_move && self.accepted.is_none()
    }

    /// Whether it may yet act on a move that went unanswered, even where it is at rest.
    pub fn in_doubt(&self) -> bool {
        self.doubt_until.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: Duration = Duration::from_millis(100);
    const RIGHT: Command = turning(0.1, None);
    const LEFT: Command = turning(-0.1, None);
    const HALT: Command = Command::Stop(Stop::PanTilt);

    const fn turning(pan: f64, zoom: Option<f64>) -> Command {
        Command::Move { motion: Motion::Velocity { pan, tilt: 0.0, zoom }, free: false }
    }

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    fn accept(scheduler: &mut Scheduler, command: Command, at: Time) {
        scheduler.attempted(&command, at);
        scheduler.accepted(&command, at);
    }

    #[test]
    fn a_camera_never_moved_needs_no_stop() {
        assert_eq!(Scheduler::new(Duration::from_secs(2)).stop_due(ms(5), INTERVAL, ms(0)), None);
    }

    #[test]
    fn moves_keep_their_distance_and_stops_do_not() {
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        assert!(scheduler.move_due(&RIGHT, INTERVAL, ms(0)) <= ms(1000));
        accept(&mut scheduler, RIGHT, ms(1000));
        assert_eq!(scheduler.move_due(&LEFT, INTERVAL, ms(0)), ms(1100));
        assert_eq!(scheduler.stop_due(ms(1001), INTERVAL, ms(0)), Some(ms(1001)));
    }

    #[test]
    fn a_move_is_not_repeated_before_its_keep_alive() {
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        accept(&mut scheduler, RIGHT, ms(1000));
        assert_eq!(scheduler.move_due(&RIGHT, INTERVAL, ms(0)), ms(3000));
    }

    #[test]
    fn a_stop_is_repeated_until_the_camera_says_yes() {
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        accept(&mut scheduler, RIGHT, ms(0));
        scheduler.attempted(&HALT, ms(500));
        scheduler.failed(&HALT, true, ms(600));
        assert_eq!(scheduler.stop_due(ms(600), INTERVAL, ms(725)), Some(ms(725)));
        accept(&mut scheduler, HALT, ms(725));
        assert_eq!(scheduler.stop_due(ms(800), INTERVAL, ms(0)), None);
        assert!(!scheduler.may_move());
    }

    #[test]
    fn a_refused_move_needs_no_stop() {
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        scheduler.attempted(&RIGHT, ms(0));
        scheduler.failed(&RIGHT, false, ms(10));
        assert_eq!(scheduler.stop_due(ms(10), INTERVAL, ms(0)), None);
    }

    #[test]
    fn only_a_move_of_ours_is_stopped() {
        for is_ours in [true, false] {
            let mut scheduler = Scheduler::new(Duration::from_secs(2));
            accept(&mut scheduler, RIGHT, ms(0));
            scheduler.contest();
            assert_eq!(scheduler.stop_due(ms(100), INTERVAL, ms(0)), None);
            scheduler.settle(is_ours);
            assert_eq!(scheduler.stop_due(ms(600), INTERVAL, ms(0)).is_some(), is_ours);
            assert_eq!(scheduler.may_move(), is_ours);
        }
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        accept(&mut scheduler, turning(0.01, Some(0.09)), ms(0));
        scheduler.contest();
        assert!(!scheduler.is_contested(), "a zoom is ended in any case");
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        scheduler.attempted(&RIGHT, ms(0));
        scheduler.failed(&RIGHT, true, ms(0));
        scheduler.contest();
        assert!(!scheduler.is_contested(), "an unanswered move may be what turns it");
        assert!(scheduler.stop_due(ms(100), INTERVAL, ms(0)).is_some());
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        accept(&mut scheduler, HALT, ms(0));
        scheduler.found_moving(Stop::PanTilt);
        scheduler.contest();
        assert!(!scheduler.is_contested(), "it turns on after its yes");
    }

    #[test]
    fn after_an_unanswered_move_the_stop_is_said_twice() {
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        scheduler.attempted(&RIGHT, ms(0));
        scheduler.failed(&RIGHT, true, ms(2000));
        accept(&mut scheduler, HALT, ms(2100));
        assert_eq!(scheduler.stop_due(ms(2100), INTERVAL, ms(0)), Some(ms(8000)));
        accept(&mut scheduler, HALT, ms(8000));
        assert_eq!(scheduler.stop_due(ms(8000), INTERVAL, ms(0)), None);
    }

    #[test]
    fn a_camera_that_hangs_for_long_is_stopped_again_after_it_wakes() {
        let mut scheduler = Scheduler::new(Duration::from_secs(2));
        scheduler.attempted(&RIGHT, ms(0));
        scheduler.failed(&RIGHT, true, ms(2000));
        for second in (4..56).step_by(2) {
            scheduler.attempted(&HALT, ms(1000 * second));
            scheduler.failed(&HALT, true, ms(1000 * second + 2000));
        }
        accept(&mut scheduler, HALT, ms(57_000));
        assert!(scheduler.in_doubt(), "the old move may come after the stop");
        assert_eq!(scheduler.stop_due(ms(57_000), INTERVAL, ms(0)), Some(ms(62_000)));
        accept(&mut scheduler, HALT, ms(62_000));
        assert!(!scheduler.in_doubt() && scheduler.stop_due(ms(62_000), INTERVAL, ms(0)).is_none());
    }
}
