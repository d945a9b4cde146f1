// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use super::Motion;
use crate::Time;
use crate::model::{Lens, PanTilt, Position, Presets, SoftLimits};

/// Where the camera waits for a target.
#[derive(Debug, Clone, PartialEq)]
pub enum Home {
    /// Where it looked when it was met.
    Start,
    /// A direction, and a zoom where one is given.
    Position(Position),
    /// One of the camera's own presets.
    Preset(String),
    /// A direction, seen as wide as this where it zooms: horizontal field of view in degrees.
    View {
        /// Where it is.
        direction: PanTilt,
        /// `None` leaves the zoom as it is.
        fov_deg: Option<f64>,
    },
}

impl Home {
    /// The same, with the zoom that shows a [`Home::View`] through this lens.
    pub fn through(self, lens: Option<&Lens>) -> Self {
        match self {
            Self::View { direction, fov_deg } => Self::Position(Position {
                pan_deg: Some(direction.pan),
                tilt_deg: Some(direction.tilt),
                zoom: lens.zip(fov_deg).and_then(|(lens, fov_deg)| lens.travel(fov_deg)),
            }),
            other => other,
        }
    }
}

/// Sends the camera home when nobody was seen for a while, once.
#[derive(Debug, Default)]
pub struct HomeReturn {
    home: Option<Home>,
    /// A direction beyond them is not gone to; a preset is the camera's own business.
    limits: SoftLimits,
    timeout: Duration,
    absence: Option<Absence>,
    /// Nothing was commanded since the camera was met.
    untouched: bool,
    at_start: bool,
    start: Option<Position>,
    /// The number of the preset.
    preset: Option<u32>,
    /// When to ask for it.
    presets_at: Time,
    /// It is there, or on its way, or cannot get there.
    settled: bool,
}

/// That nobody is there.
#[derive(Debug, Clone, Copy)]
struct Absence {
    /// When that was first seen.
    since: Time,
    /// When the next picture is due: without pictures it is not known that nobody is there.
    until: Time,
}

impl HomeReturn {
    /// Takes the settings. `at_start`: go there before the first target too, without waiting.
    pub fn new(home: Option<Home>, timeout: Duration, at_start: bool, limits: SoftLimits) -> Self {
        let settled = home == Some(Home::Start);
        Self { home, limits, timeout, at_start, settled, untouched: true, ..Self::default() }
    }

    /// Takes other settings.
    pub fn configure(&mut self, home: Option<&Home>, timeout: Duration, limits: SoftLimits) {
        (self.timeout, self.limits) = (timeout, limits);
        if home != self.home.as_ref() {
            let presets_at = Time::ZERO;
            let home = home.cloned();
            *self = Self { home, preset: None, presets_at, settled: false, at_start: false, ..*self };
        }
    }

    /// A picture came without a target; the next is awaited until `next`.
    pub fn alone(&mut self, now: Time, next: Time) {
        self.absence =
            Some(Absence { since: self.absence.map_or(now, |absence| absence.since), until: next });
    }

    /// Somebody is there, or it is not known whether anybody is.
    pub fn not_alone(&mut self) {
        self.absence = None;
    }

    /// The camera looks there; the first place is where it started.
    pub fn positioned(&mut self, position: Position) {
        if self.untouched {
            self.start.get_or_insert(position);
        }
    }

    /// The camera does something else at our word, or at somebody's.
    pub fn strayed(&mut self) {
        self.settled = false;
        self.untouched = false;
        self.at_start = false;
    }

    /// It may do something else at our word; where it started is still to be told.
    pub fn doubted(&mut self) {
        self.settled = false;
        self.at_start = false;
    }

    /// It has taken the command to go home. Where it was to go there no longer by then, it is on no way of ours.
    pub fn taken(&mut self) {
        self.strayed();
        self.settled = self.absence.is_some();
    }

    /// It will not go there.
    pub fn settled(&mut self) {
        self.strayed();
        self.settled = true;
    }

    /// It was stopped, perhaps on its way, and what was seen before is void.
    pub fn interrupt(&mut self) {
        self.absence = None;
        self.settled &= self.home == Some(Home::Start) && self.untouched;
    }

    /// Whether it is there, or on its way.
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    /// When the camera is to be asked for its presets, where it is.
    pub fn presets_due(&self) -> Option<Time> {
        let wanted = self.preset.is_none() && !self.settled && matches!(self.home, Some(Home::Preset(_)));
        wanted.then_some(self.presets_at)
    }

    /// They went unanswered: not before then again.
    pub fn ask_presets_at(&mut self, at: Time) {
        self.presets_at = at;
    }

    /// The camera told its presets; returns the name where it has none of that name.
    pub fn told_presets(&mut self, presets: &Presets) -> Option<String> {
        let Some(Home::Preset(name)) = &self.home else { return None };
        self.preset = presets.number(name);
        self.settled |= self.preset.is_none();
        self.preset.is_none().then(|| name.clone())
    }

    /// The move home, at this speed, if it is time for it.
    pub fn due(&self, now: Time, speed: f64) -> Option<Motion> {
        let wait = if self.at_start { Duration::ZERO } else { self.timeout };
        let alone = self.absence.is_some_and(|absence| absence.since + wait <= now && now <= absence.until);
        if self.settled || !alone { None } else { self.motion(speed) }
    }

    /// Whether this move, at that speed, leads home.
    pub fn leads(&self, motion: &Motion, speed: f64) -> bool {
        self.motion(speed).as_ref() == Some(motion)
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        assert!(!self.at_start || self.untouched, "it goes home for the start after a command");
        assert!(self.preset.is_none() || matches!(self.home, Some(Home::Preset(_))), "a preset of no name");
    }

    fn motion(&self, speed: f64) -> Option<Motion> {
        match self.home.as_ref()? {
            Home::Start => self.start.and_then(|start| self.go_to(start, speed)),
            Home::Position(position) => self.go_to(*position, speed),
            Home::Preset(_) => self.preset.map(|number| Motion::Preset { number }),
            Home::View { direction, .. } => {
                let (pan_deg, tilt_deg) = (Some(direction.pan), Some(direction.tilt));
                self.go_to(Position { pan_deg, tilt_deg, zoom: None }, speed)
            }
        }
    }

    fn go_to(&self, position: Position, speed: f64) -> Option<Motion> {
        let place = self.limits.nearest(PanTilt::new(position.pan_deg?, position.tilt_deg?));
        let zoom = position.zoom.map(|zoom| self.limits.zoom.nearest(zoom).clamp(0.0, 1.0));
        Some(Motion::Absolute { pan_deg: place.pan, tilt_deg: place.tilt, speed, zoom })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Range;

    fn s<T: From<Duration>>(s: u64) -> T {
        Duration::from_secs(s).into()
    }

    fn at(pan: f64, tilt: f64, zoom: Option<f64>) -> Position {
        Position { pan_deg: Some(pan), tilt_deg: Some(tilt), zoom }
    }

    fn going(home: Option<Home>, timeout: Duration, at_start: bool) -> HomeReturn {
        HomeReturn::new(home, timeout, at_start, SoftLimits::default())
    }

    fn alone(home_return: &mut HomeReturn, from: u64, to: u64) -> Vec<(u64, Motion)> {
        (from..to)
            .filter_map(|second| {
                home_return.alone(s(second), s(second + 1));
                let command = home_return.due(s(second), Motion::FULL_SPEED)?;
                home_return.settled();
                Some((second, command))
            })
            .collect()
    }

    #[test]
    fn it_goes_home_once_when_nobody_was_seen_for_a_while() {
        let home = Home::Position(at(5.0, 1.0, Some(0.2)));
        let mut home_return = going(Some(home), s(10), false);
        let there = Motion::Absolute { pan_deg: 5.0, tilt_deg: 1.0, speed: 1.0, zoom: Some(0.2) };
        assert_eq!(alone(&mut home_return, 3, 60), [(13, there)]);
        home_return.not_alone();
        home_return.strayed();
        assert_eq!(home_return.due(s(61), Motion::FULL_SPEED), None);
        assert_eq!(alone(&mut home_return, 70, 100), [(80, there)]);
        home_return.strayed();
        assert_eq!(alone(&mut home_return, 100, 110), [(100, there)], "somebody else took it away");
    }

    #[test]
    fn without_pictures_nobody_knows_that_nobody_is_there() {
        let mut home_return = going(Some(Home::Position(at(5.0, 1.0, None))), s(10), false);
        home_return.alone(s(0), s(1));
        assert_eq!(home_return.due(s(20), Motion::FULL_SPEED), None);
    }

    #[test]
    fn at_the_start_it_does_not_wait() {
        let mut home_return = going(Some(Home::Position(at(5.0, 1.0, None))), s(10), true);
        assert_eq!(alone(&mut home_return, 0, 30).len(), 1);
        let mut home_return = going(Some(Home::Position(at(5.0, 1.0, None))), s(10), true);
        home_return.strayed();
        assert_eq!(alone(&mut home_return, 0, 30)[0].0, 10, "there was a target first");
    }

    #[test]
    fn where_it_started_is_where_it_was_before_our_first_command() {
        let mut home_return = going(Some(Home::Start), s(10), true);
        home_return.positioned(at(7.0, -2.0, Some(0.0)));
        assert_eq!(alone(&mut home_return, 0, 30), [], "it is there");
        home_return.positioned(at(7.5, -2.0, Some(0.0)));
        home_return.strayed();
        home_return.positioned(at(90.0, 0.0, Some(0.05)));
        let start = Motion::Absolute { pan_deg: 7.0, tilt_deg: -2.0, speed: 1.0, zoom: Some(0.0) };
        home_return.not_alone();
        assert_eq!(alone(&mut home_return, 40, 80), [(50, start)]);
    }

    #[test]
    fn a_home_beyond_the_limits_is_gone_to_as_far_as_they_allow() {
        let within = |min, max| Range { min, max };
        let limits = SoftLimits {
            pan_deg: within(-30.0, 60.0),
            tilt_deg: within(-20.0, 5.0),
            zoom: within(0.01, 0.2),
        };
        let there = Motion::Absolute { pan_deg: 60.0, tilt_deg: -20.0, speed: 1.0, zoom: Some(0.2) };
        let beyond = Home::Position(at(100.0, -60.0, Some(1.0)));
        let mut home_return = HomeReturn::new(Some(beyond.clone()), s(0), false, limits);
        assert_eq!(alone(&mut home_return, 3, 5), [(3, there)]);
        let mut home_return = going(Some(beyond.clone()), s(0), false);
        home_return.configure(Some(&beyond), s(0), limits);
        assert_eq!(alone(&mut home_return, 3, 5), [(3, there)]);
    }

    #[test]
    fn a_view_is_as_wide_as_the_lens_allows() {
        let lens = Lens::linear(60.0, Range { min: 0.0, max: 1.0 }, 20.0);
        let view = |fov_deg| Home::View { direction: PanTilt::new(5.0, 1.0), fov_deg };
        for (fov_deg, zoom) in [(None, None), (Some(60.0), Some(0.0)), (Some(0.1), Some(1.0))] {
            assert_eq!(view(fov_deg).through(Some(&lens)), Home::Position(at(5.0, 1.0, zoom)));
        }
        let home = view(Some(30.0));
        assert_eq!(home.clone().through(None), Home::Position(at(5.0, 1.0, None)));
        let there = Motion::Absolute { pan_deg: 5.0, tilt_deg: 1.0, speed: 1.0, zoom: None };
        assert_eq!(alone(&mut going(Some(home), s(0), false), 3, 5), [(3, there)]);
    }

    #[test]
    fn a_preset_goes_by_its_number() {
        let mut home_return = going(Some(Home::Preset("Gate".to_owned())), s(10), false);
        assert_eq!(home_return.presets_due(), Some(s(0)));
        assert_eq!(alone(&mut home_return, 0, 30), []);
        assert_eq!(
            home_return.told_presets(&Presets(vec![(1, "Home".to_owned()), (4, "Gate".to_owned())])),
            None
        );
        assert_eq!(home_return.presets_due(), None);
        assert_eq!(alone(&mut home_return, 30, 60), [(30, Motion::Preset { number: 4 })]);
    }

    #[test]
    fn a_preset_that_is_none_is_told_once() {
        let mut home_return = going(Some(Home::Preset("Gate".to_owned())), s(10), false);
        assert_eq!(home_return.told_presets(&Presets::default()), Some("Gate".to_owned()));
        assert_eq!(home_return.presets_due(), None);
        assert_eq!(alone(&mut home_return, 0, 30), []);
        home_return.configure(Some(&Home::Position(at(0.0, 0.0, None))), s(10), SoftLimits::default());
        assert_eq!(alone(&mut home_return, 30, 60).len(), 1);
    }
}
