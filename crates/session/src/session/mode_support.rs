// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::{Mode, Motion, Time};

use crate::{Command, Error, Parameters, Stop};

/// Which modes a camera supports: by what it tells of itself, and by what it refuses.
#[derive(Debug)]
pub struct ModeSupport {
    /// How the camera is to be moved.
    wanted: Mode,
    /// How the camera is moved as far as anybody was told.
    told: Mode,
    /// Modes that its parameters deny.
    denied: Vec<Mode>,
    /// Modes whose words it refused, and when.
    refused: Vec<(Mode, Time)>,
    /// What may yet have been refused for another reason.
    doubt: Option<Doubt>,
}

#[derive(Debug)]
struct Doubt {
    mode: Mode,
    refusal: Error,
    since: Time,
    /// It was refused again, too soon to count.
    again: bool,
    /// The camera did something else that it was asked since.
    witnessed: bool,
}

/// What a refused command says of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// Nothing yet: it is to be asked something else, and then told again.
    Doubtful,
    /// It does not take the words of this mode, but perhaps those of another.
    OfMode(Mode),
    /// It was no command of a mode.
    Other,
}

impl ModeSupport {
    /// Nothing is known of the camera, which is to be moved like this.
    pub fn new(wanted: Mode) -> Self {
        Self { wanted, told: wanted, denied: Vec::new(), refused: Vec::new(), doubt: None }
    }

    /// This mode is wanted from here on.
    pub fn want(&mut self, mode: Mode) {
        if mode != self.wanted {
            self.forget_refusals();
            (self.wanted, self.told) = (mode, mode);
        }
    }

    /// The camera accepted a move towards the target by this mode; returns it where that is another than was told.
    pub fn changed(&mut self, mode: Mode) -> Option<Mode> {
        (std::mem::replace(&mut self.told, mode) != mode).then_some(mode)
    }

    /// The modes, best first.
    const ORDER: [Mode; 3] = [Mode::Velocity, Mode::Absolute, Mode::Centre];

    /// A refused mode is tried again after this: what else the reason was may be over.
    const TRY_AGAIN: Duration = Duration::from_secs(60);

    /// Refusals nearer to each other count once: a camera that starts, or is busy, refuses what it takes a moment later.
    const APART: Duration = Duration::from_secs(1);

    /// The mode to move it by: the wanted one, or the best of the others where that is not to be had. A camera that
    /// does not tell its position is not sent from one to another.
    pub fn choose(&self, tells_position: bool, now: Time) -> Mode {
        let wanted = self.wanted;
        let possible = |mode: &Mode| tells_position || *mode != Mode::Absolute || wanted == Mode::Absolute;
        let mut modes = std::iter::once(wanted).chain(Self::ORDER);
        modes.find(|mode| possible(mode) && !self.lacks(*mode, now)).unwrap_or(wanted)
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        let times = |mode| self.refused.iter().filter(|(refused, _)| *refused == mode).count();
        assert!(Self::ORDER.into_iter().all(|mode| times(mode) <= 1), "refused twice: {self:?}");
    }

    /// When a move is worth sending: after two refusals in a row not before a third would count.
    pub fn not_before(&self, command: &Command) -> Time {
        let doubt = self.doubt.as_ref().filter(|doubt| doubt.again && mode_of(command) == Some(doubt.mode));
        doubt.map_or(Time::ZERO, |doubt| doubt.since + Self::APART)
    }

    /// Whether it is known not to take the words of a mode.
    pub fn lacks(&self, mode: Mode, now: Time) -> bool {
        let refused = |(refused, at): &(Mode, Time)| *refused == mode && now < *at + Self::TRY_AGAIN;
        self.denied.contains(&mode) || self.refused.iter().any(refused)
    }

    /// The camera told its parameters. That it has no area zoom denies nothing: it may centre all the same.
    pub fn told(&mut self, parameters: &Parameters) {
        let flags = [(Mode::Velocity, parameters.continuous_pan), (Mode::Absolute, parameters.absolute_pan)];
        self.denied =
            flags.into_iter().filter(|(_, has)| *has == Some(false)).map(|(mode, _)| mode).collect();
    }

    /// The camera refused a command with words. Where one refusal comes on another, some time later, and it did
    /// something else in between, it is the command that it does not take.
    pub fn refused(&mut self, command: &Command, refusal: &Error, now: Time) -> Refusal {
        let Some(mode) = mode_of(command) else { return Refusal::Other };
        if self.lacks(mode, now) {
            // Known; until it is tried again.
            return Refusal::OfMode(mode);
        }
        match self.doubt.take() {
            Some(doubt) if doubt.mode == mode && doubt.witnessed => {
                if now < doubt.since + Self::APART {
                    self.doubt = Some(Doubt { again: true, ..doubt });
                    return Refusal::Doubtful;
                }
                self.refused.retain(|(other, _)| *other != mode);
                self.refused.push((mode, now));
                Refusal::OfMode(mode)
            }
            _ => {
                let refusal = refusal.clone();
                self.doubt = Some(Doubt { mode, refusal, since: now, again: false, witnessed: false });
                Refusal::Doubtful
            }
        }
    }

    /// The camera did what it was asked.
    pub fn obeyed(&mut self) {
        if let Some(doubt) = &mut self.doubt {
            doubt.witnessed = true;
        }
    }

    /// A command of a mode was accepted: no doubt about that one.
    pub fn accepted(&mut self, command: &Command) {
        if self.doubt.as_ref().is_some_and(|doubt| mode_of(command) == Some(doubt.mode)) {
            self.doubt = None;
        }
    }

    /// The camera failed to do something else as well: returns the refusal that was in doubt, which is no more than
    /// a part of that.
    pub fn failed(&mut self) -> Option<Error> {
        self.doubt.take_if(|doubt| !doubt.witnessed).map(|doubt| doubt.refusal)
    }

    /// Another camera may be there, or another mode is wanted: what was refused is worth trying.
    pub fn forget_refusals(&mut self) {
        (self.refused, self.doubt) = (Vec::new(), None);
    }
}

/// The mode that a command belongs to.
fn mode_of(command: &Command) -> Option<Mode> {
    match command {
        Command::Stop(Stop::PanTilt | Stop::AllAxes) => Some(Mode::Velocity),
        Command::Stop(Stop::Position) => None,
        Command::Move { motion, .. } => match motion {
            Motion::Velocity { .. } => Some(Mode::Velocity),
            Motion::Absolute { .. } => Some(Mode::Absolute),
            Motion::Centre { .. } => Some(Mode::Centre),
            Motion::Preset { .. } => None,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOVE: Command = moving(Motion::Velocity { pan: 0.01, tilt: 0.0, zoom: None });
    const STEP: Command = moving(Motion::Absolute { pan_deg: 1.0, tilt_deg: 0.0, speed: 1.0, zoom: None });
    const PIXEL: Command = moving(Motion::Centre { x: 1, y: 1, width: 640, height: 480, magnify: None });
    const SOON: Time = Time::from_millis(1000);

    const fn moving(motion: Motion) -> Command {
        Command::Move { motion, free: false }
    }

    fn refuse(modes: &mut ModeSupport, command: &Command) -> Refusal {
        refuse_at(modes, command, SOON)
    }

    fn refuse_at(modes: &mut ModeSupport, command: &Command, at: Time) -> Refusal {
        modes.refused(command, &Error::Camera("unknown".to_owned()), at)
    }

    /// Refused for good.
    fn refuse_twice(modes: &mut ModeSupport, command: &Command) -> Refusal {
        assert_eq!(refuse_at(modes, command, SOON - ModeSupport::APART), Refusal::Doubtful);
        modes.obeyed();
        refuse(modes, command)
    }

    /// What is chosen where this is wanted.
    fn choose(modes: &mut ModeSupport, wanted: Mode, tells_position: bool, now: Time) -> Mode {
        modes.wanted = wanted;
        modes.choose(tells_position, now)
    }

    #[test]
    fn refusals_at_nearly_the_same_time_are_one() {
        let mut modes = ModeSupport::new(Mode::Velocity);
        assert_eq!(refuse(&mut modes, &MOVE), Refusal::Doubtful);
        modes.obeyed();
        assert_eq!(modes.not_before(&MOVE), Time::ZERO, "at once, in case it was a moment's");
        assert_eq!(refuse_at(&mut modes, &MOVE, SOON + ModeSupport::APART / 2), Refusal::Doubtful);
        modes.obeyed();
        assert!(!modes.lacks(Mode::Velocity, SOON + ModeSupport::APART / 2));
        assert_eq!(modes.not_before(&MOVE), SOON + ModeSupport::APART);
        assert_eq!(modes.not_before(&STEP), Time::ZERO);
        assert_eq!(refuse_at(&mut modes, &MOVE, SOON + ModeSupport::APART), Refusal::OfMode(Mode::Velocity));
        let mut modes = ModeSupport::new(Mode::Velocity);
        refuse(&mut modes, &MOVE);
        modes.accepted(&MOVE);
        assert_eq!(modes.not_before(&MOVE), Time::ZERO);
    }

    #[test]
    fn a_camera_that_says_nothing_is_moved_as_wanted() {
        for mode in ModeSupport::ORDER {
            assert_eq!(choose(&mut ModeSupport::new(Mode::Velocity), mode, false, SOON), mode);
        }
    }

    #[test]
    fn what_its_parameters_deny_is_not_tried() {
        let mut modes = ModeSupport::new(Mode::Velocity);
        modes.told(&Parameters { continuous_pan: Some(false), ..Parameters::default() });
        assert_eq!(choose(&mut modes, Mode::Velocity, true, SOON), Mode::Absolute);
        assert_eq!(choose(&mut modes, Mode::Velocity, false, SOON), Mode::Centre);
        assert_eq!(choose(&mut modes, Mode::Centre, true, SOON), Mode::Centre);
        modes.told(&Parameters { absolute_pan: Some(false), ..Parameters::default() });
        assert_eq!(choose(&mut modes, Mode::Absolute, true, SOON), Mode::Velocity);
    }

    #[test]
    fn a_refusal_counts_when_the_camera_is_otherwise_well() {
        let mut modes = ModeSupport::new(Mode::Velocity);
        assert_eq!(refuse(&mut modes, &MOVE), Refusal::Doubtful);
        assert!(modes.failed().is_some() && modes.failed().is_none());
        assert_eq!(refuse(&mut modes, &MOVE), Refusal::Doubtful);
        modes.obeyed();
        modes.accepted(&MOVE);
        assert_eq!(refuse_twice(&mut modes, &MOVE), Refusal::OfMode(Mode::Velocity));
        assert_eq!(choose(&mut modes, Mode::Velocity, true, SOON), Mode::Absolute);
        assert_eq!(refuse_twice(&mut modes, &STEP), Refusal::OfMode(Mode::Absolute));
        assert_eq!(choose(&mut modes, Mode::Velocity, true, SOON), Mode::Centre);
        assert_eq!(choose(&mut modes, Mode::Velocity, true, SOON + ModeSupport::TRY_AGAIN), Mode::Velocity);
        modes.forget_refusals();
        assert_eq!(choose(&mut modes, Mode::Velocity, true, SOON), Mode::Velocity);
    }

    #[test]
    fn of_a_camera_that_takes_nothing_the_wanted_mode_is_left() {
        let mut modes = ModeSupport::new(Mode::Velocity);
        for command in [MOVE, STEP, PIXEL] {
            refuse_twice(&mut modes, &command);
        }
        assert_eq!(choose(&mut modes, Mode::Absolute, true, SOON), Mode::Absolute);
        assert!(modes.lacks(Mode::Absolute, SOON));
        assert_eq!(refuse(&mut modes, &STEP), Refusal::OfMode(Mode::Absolute), "no doubt of that any more");
        assert_eq!(refuse(&mut modes, &Command::Stop(Stop::Position)), Refusal::Other);
    }
}
