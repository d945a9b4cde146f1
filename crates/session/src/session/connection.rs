// SPDX-License-Identifier: MPL-2.0

use std::mem;
use std::time::Duration;

use servo::Time;

use super::Forbidden;
use crate::Error;

/// What became of the connection to the camera.
#[derive(Debug, Clone, PartialEq)]
pub enum ConnectionChange {
    /// It answers (again).
    Connected,
    /// It does not answer.
    Disconnected(Error),
    /// It answers, and refuses.
    Refused(Error),
}

/// Judges the camera's answers: one report when a fault begins, one when it is over, and longer
/// pauses in between. Faults that come and go are not reported each time.
#[derive(Debug, Default)]
pub struct Connection {
    connected: bool,
    /// It did as it was told.
    obeyed: bool,
    fault: Option<Fault>,
    /// When which kind was last reported.
    told: Vec<(FaultKind, Time)>,
    pause: Duration,
    /// Has pauses of its own: what else fails in between neither ends nor shortens them.
    forbidden: Option<Forbidden>,
    retry_at: Time,
}

#[derive(Debug)]
struct Fault {
    kind: FaultKind,
    /// Met by a command: that queries are answered does not mend it.
    of_command: bool,
    /// The kinds of this fault already reported: a camera that reboots shows several, in any order.
    reported: Vec<FaultKind>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FaultKind {
    Silent,
    Refusing,
    /// Refusing, and to be asked rarely.
    Forbidden,
    /// Refusing, and to be asked nothing more.
    LockedOut,
}

impl FaultKind {
    /// `did_without`: the camera was well without a user.
    fn of(err: &Error, did_without: bool) -> Self {
        match err {
            // There is no account to be locked, and it may pass: one that restarts may ask everybody for a while.
            Error::CredentialsMissing if did_without => Self::Refusing,
            err if err.is_final() => Self::LockedOut,
            Error::NotPermitted { .. } => Self::Forbidden,
            err if err.is_refusal() => Self::Refusing,
            _ => Self::Silent,
        }
    }
}

impl Connection {
    /// A single lost packet costs one or two commands at the usual rate; doubled with each failure.
    const FIRST_PAUSE: Duration = Duration::from_millis(125);

    /// Short enough for control to be back within two seconds of the camera's return.
    pub const LONGEST_PAUSE: Duration = Duration::from_secs(1);

    /// A fault that comes again within this time is reported only if it lasts longer.
    const QUIET: Duration = Duration::from_secs(10);

    /// What holds at any time.
    pub fn check_invariants(&self) {
        assert!(self.pause <= Self::LONGEST_PAUSE, "{self:?}");
        let pauses = self.retry_at != Time::ZERO || self.forbidden.is_some();
        assert!(self.fault.is_some() || !pauses, "a pause without a fault: {self:?}");
    }

    /// Nothing may be sent before.
    pub fn retry_at(&self) -> Time {
        self.retry_at
    }

    /// Whether nothing may be sent until a setting changes.
    pub fn halted(&self) -> bool {
        self.fault.as_ref().is_some_and(|fault| fault.kind == FaultKind::LockedOut)
    }

    /// Whether the camera answers and does as it is told.
    pub fn connected(&self) -> bool {
        self.connected && self.fault.is_none()
    }

    /// Whether something is wrong.
    pub fn faulty(&self) -> bool {
        self.fault.is_some()
    }

    /// It moves at our word already.
    pub fn note_obeyed(&mut self) {
        self.obeyed = true;
    }

    /// Something was answered as it should be. `idle`: no command is waiting, so that a query may
    /// mend what a command met.
    pub fn succeeded(&mut self, of_command: bool, idle: bool) -> Option<ConnectionChange> {
        self.obeyed |= of_command;
        let mended = match &self.fault {
            Some(fault) => of_command || !fault.of_command || idle && self.is_silence_only(fault),
            None => !self.connected,
        };
        if !mended {
            return None;
        }
        let news = self.fault.as_ref().is_none_or(|fault| !fault.reported.is_empty());
        let told = mem::take(&mut self.told);
        *self = Self { connected: true, obeyed: self.obeyed, told, ..Self::default() };
        news.then_some(ConnectionChange::Connected)
    }

    /// Whether nobody was refused in it.
    fn is_silence_only(&self, fault: &Fault) -> bool {
        fault.kind == FaultKind::Silent && self.forbidden.is_none()
    }

    /// Something failed. Reports the first failure of each kind in a row only, and none that was just told.
    pub fn failed(&mut self, err: &Error, of_command: bool, now: Time) -> Option<ConnectionChange> {
        // Who has waited in vain has paused already; else silence would last longer than the camera's.
        let waited = if let Error::Timeout(waited) = err { *waited } else { Duration::ZERO };
        // That it lets anybody ask does not say that it lets anybody move it.
        let kind = FaultKind::of(err, self.obeyed || !of_command && self.connected);
        if of_command && !self.fault.as_ref().is_some_and(|fault| fault.of_command) {
            // What a question met is not held against the first stop.
            (self.forbidden, self.retry_at) = (None, Time::ZERO);
        }
        self.pause = (self.pause * 2).clamp(Self::FIRST_PAUSE, Self::LONGEST_PAUSE);
        let pause = match kind {
            FaultKind::Forbidden => Forbidden::again(&mut self.forbidden, err, self.pause),
            _ => self.pause.saturating_sub(waited),
        };
        self.retry_at = self.retry_at.max(now + pause);
        let fault = self.fault.get_or_insert_with(|| Fault { kind, of_command, reported: Vec::new() });
        fault.kind = kind;
        fault.of_command |= of_command;
        let just_told = self.told.iter().any(|(told, at)| *told == kind && now < *at + Self::QUIET);
        if just_told || fault.reported.contains(&kind) {
            return None;
        }
        fault.reported.push(kind);
        self.told.retain(|(told, _)| *told != kind);
        self.told.push((kind, now));
        Some(match kind {
            FaultKind::Silent => ConnectionChange::Disconnected(err.clone()),
            FaultKind::Refusing | FaultKind::Forbidden | FaultKind::LockedOut => {
                ConnectionChange::Refused(err.clone())
            }
        })
    }

    /// What whoever speaks next as the same user is to know: how he was refused, and how long he is to wait yet.
    pub fn forbidden(&self, now: Time) -> Option<(Forbidden, Duration)> {
        self.forbidden.clone().map(|forbidden| (forbidden, self.retry_at - now))
    }

    /// Whoever spoke before as the same user was refused so, and is to wait so long.
    pub fn inherit(
        &mut self,
        (forbidden, wait): (Forbidden, Duration),
        now: Time,
    ) -> Option<ConnectionChange> {
        let change = self.failed(&forbidden.error, true, now);
        (self.forbidden, self.retry_at) = (Some(forbidden), now + wait);
        change
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken() -> Error {
        Error::Broken("reset".to_owned())
    }

    fn refused() -> Error {
        Error::Camera("no".to_owned())
    }

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    #[test]
    fn a_fault_is_reported_once_and_so_is_its_end() {
        let mut connection = Connection::default();
        assert_eq!(connection.succeeded(false, true), Some(ConnectionChange::Connected));
        assert_eq!(connection.succeeded(false, true), None);
        assert_eq!(connection.failed(&broken(), true, ms(0)), Some(ConnectionChange::Disconnected(broken())));
        assert_eq!(connection.failed(&Error::Timeout(ms(1)), true, ms(1)), None);
        assert!(!connection.connected());
        assert_eq!(connection.succeeded(true, false), Some(ConnectionChange::Connected));
        let later = ms(60_000);
        assert_eq!(connection.failed(&broken(), true, later), Some(ConnectionChange::Disconnected(broken())));
    }

    #[test]
    fn a_link_that_comes_and_goes_is_no_flood_and_no_secret() {
        let mut connection = Connection::default();
        let mut reports = 0;
        for second in 0..30 {
            reports += usize::from(connection.failed(&broken(), true, ms(second * 1000)).is_some());
            assert!(!connection.connected());
            reports += usize::from(connection.succeeded(true, false).is_some());
            assert!(connection.connected());
        }
        assert_eq!(reports, 6, "three times lost and found");
        assert_eq!(connection.failed(&broken(), true, ms(29_500)), None);
        assert!(connection.failed(&broken(), true, ms(30_500)).is_some(), "it lasts");
    }

    #[test]
    fn pauses_grow_to_a_second() {
        let mut connection = Connection::default();
        let mut pauses = Vec::new();
        for _ in 0..6 {
            connection.failed(&broken(), true, ms(0));
            pauses.push(connection.retry_at().since_zero().as_millis());
        }
        assert_eq!(pauses, [125, 250, 500, 1000, 1000, 1000]);
        connection.succeeded(true, false);
        assert_eq!(connection.retry_at(), Time::ZERO);
    }

    #[test]
    fn a_wait_in_vain_was_pause_enough() {
        let mut connection = Connection::default();
        for _ in 0..6 {
            connection.failed(&Error::Timeout(ms(2000)), true, ms(5000));
            assert_eq!(connection.retry_at(), ms(5000));
        }
        connection.failed(&Error::Timeout(ms(100)), true, ms(5000));
        assert_eq!(connection.retry_at(), ms(5900));
    }

    #[test]
    fn what_is_not_permitted_is_tried_once_more_and_then_rarely() {
        let mut connection = Connection::default();
        connection.succeeded(false, true);
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        assert_eq!(
            connection.failed(&forbidden, true, ms(0)),
            Some(ConnectionChange::Refused(forbidden.clone()))
        );
        assert_eq!(connection.retry_at(), Connection::FIRST_PAUSE.into());
        let mut time: Time = Connection::FIRST_PAUSE.into();
        for pause_s in [10, 20, 40, 60, 60] {
            assert_eq!(connection.failed(&forbidden, true, time), None);
            assert_eq!(connection.retry_at() - time, Duration::from_secs(pause_s));
            time = connection.retry_at();
        }
        assert!(!connection.halted());
        assert_eq!(connection.succeeded(true, false), Some(ConnectionChange::Connected));
        assert_eq!(connection.retry_at(), Time::ZERO);
    }

    #[test]
    fn a_question_that_is_not_permitted_does_not_keep_the_first_stop_waiting() {
        let mut connection = Connection::default();
        connection.succeeded(true, true);
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        connection.failed(&forbidden, false, ms(0));
        connection.failed(&forbidden, true, ms(50));
        assert!(connection.retry_at() <= ms::<Time>(50) + 2 * Connection::FIRST_PAUSE);
        connection.failed(&forbidden, true, ms(100));
        assert_eq!(connection.retry_at(), ms::<Time>(100) + Forbidden::PAUSE);
        let mut connection = Connection::default();
        connection.succeeded(true, true);
        connection.failed(&forbidden, false, ms(0));
        connection.failed(&forbidden, false, ms(125));
        assert_eq!(
            connection.retry_at(),
            ms::<Time>(125) + Forbidden::PAUSE,
            "it is not asked so soon again"
        );
        connection.failed(&forbidden, true, ms(200));
        assert!(connection.retry_at() <= ms::<Time>(200) + Connection::LONGEST_PAUSE);
    }

    /// As of a camera that reboots, or a network that comes and goes, while the account is locked.
    #[test]
    fn outages_in_between_do_not_have_what_is_not_permitted_tried_more_often() {
        let mut connection = Connection::default();
        connection.succeeded(true, false);
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        let (mut now, mut refused_at) = (ms(0), Vec::new());
        for _ in 0..5 {
            refused_at.push(now);
            connection.failed(&forbidden, true, now);
            // Said all the same, as the first stop of a move is.
            connection.failed(&broken(), true, now + ms(100));
            connection.failed(&Error::Timeout(ms(200)), true, now + ms(300));
            now = connection.retry_at();
            connection.failed(&broken(), true, now);
            now = connection.retry_at();
        }
        let pauses = refused_at.windows(2).map(|pair| pair[1] - pair[0]);
        for (pause, least_s) in pauses.zip([0, 10, 20, 40]) {
            assert!(pause >= Duration::from_secs(least_s), "{refused_at:?}");
        }
    }

    #[test]
    fn a_question_answered_after_an_outage_does_not_have_what_is_not_permitted_tried_sooner() {
        let mut connection = Connection::default();
        connection.succeeded(true, false);
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        connection.failed(&forbidden, true, ms(0));
        connection.failed(&forbidden, true, ms(200));
        connection.failed(&broken(), true, ms(300));
        let retry_at = connection.retry_at();
        connection.succeeded(false, true);
        assert_eq!(connection.retry_at(), retry_at);
        assert!(retry_at >= ms::<Time>(200) + Forbidden::PAUSE);
    }

    #[test]
    fn who_is_refused_as_who_spoke_before_waits_as_long_and_says_so() {
        let mut before = Connection::default();
        before.succeeded(true, false);
        let forbidden = Error::NotPermitted { user: "root".to_owned() };
        assert_eq!(before.forbidden(ms(0)), None);
        before.failed(&forbidden, true, ms(0));
        before.failed(&forbidden, true, ms(200));
        let (handed_on, wait) = before.forbidden(ms(4200)).unwrap();
        assert_eq!(wait, ms(6000));
        let (_, wait_by_then) = before.forbidden(ms(10_200)).unwrap();
        assert_eq!(wait_by_then, Duration::ZERO, "he might ask again, and was refused all the same");
        let mut connection = Connection::default();
        let change = connection.inherit((handed_on, wait), ms(100));
        assert_eq!(change, Some(ConnectionChange::Refused(forbidden.clone())));
        assert_eq!(connection.retry_at(), ms(6100));
        connection.check_invariants();
        assert_eq!(connection.failed(&forbidden, true, ms(6100)), None, "that is known");
        assert_eq!(connection.retry_at(), ms(26_100), "he is not let off with a short pause");
        assert_eq!(connection.succeeded(true, false), Some(ConnectionChange::Connected));
    }

    #[test]
    fn answered_queries_do_not_mend_a_refused_command() {
        let mut connection = Connection::default();
        connection.failed(&refused(), true, ms(0));
        assert_eq!(connection.succeeded(false, true), None);
        assert_eq!(connection.failed(&refused(), true, ms(1)), None);
        assert_eq!(connection.succeeded(true, false), Some(ConnectionChange::Connected));
    }

    #[test]
    fn with_nothing_to_command_a_query_shows_that_the_camera_is_back() {
        let mut connection = Connection::default();
        connection.failed(&broken(), true, ms(0));
        assert_eq!(connection.succeeded(false, false), None);
        assert_eq!(connection.succeeded(false, true), Some(ConnectionChange::Connected));
    }

    #[test]
    fn a_missing_user_halts_only_where_the_camera_never_did_without() {
        let missing = Error::CredentialsMissing;
        let mut connection = Connection::default();
        connection.failed(&missing, false, ms(0));
        assert!(connection.halted());

        let mut connection = Connection::default();
        connection.succeeded(false, true);
        connection.failed(&missing, false, ms(0));
        assert!(!connection.halted());
        assert_eq!(connection.retry_at(), Connection::FIRST_PAUSE.into());
        connection.failed(&missing, true, ms(200));
        assert!(connection.halted(), "it was never moved");

        let mut connection = Connection::default();
        connection.succeeded(true, false);
        for time in [0, 125, 375, 875, 1875, 2875] {
            connection.failed(&missing, true, ms(time));
            assert!(!connection.halted());
        }
        assert_eq!(connection.retry_at(), ms(3875), "after growing pauses, and never after a minute");
        assert_eq!(connection.succeeded(true, false), Some(ConnectionChange::Connected));
    }

    #[test]
    fn wrong_credentials_halt_and_are_reported_beside_an_outage() {
        let mut connection = Connection::default();
        connection.failed(&broken(), false, ms(0));
        let wrong = Error::BadCredentials { user: "root".to_owned() };
        assert_eq!(connection.failed(&wrong, false, ms(1)), Some(ConnectionChange::Refused(wrong)));
        assert!(connection.halted());
    }
}
