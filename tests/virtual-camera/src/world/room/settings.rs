// SPDX-License-Identifier: MPL-2.0

//! What a room shows: the thesis' 72 tests and the seeds they are rerun with, and much else.

use std::time::Duration;

use super::{action::Action, event::Event, walker::Walk};
use crate::kinematics::Pose;

/// How long nobody is there where nobody comes, and where the camera looks then.
const NOBODY_THERE: Duration = Duration::from_secs(600);
const STRAIGHT_AHEAD: Pose = Pose { pan_deg: 0.0, tilt_deg: -13.0, zoom_step: 1.0 };

/// How much light there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lighting {
    /// All lamps are on.
    Optimal,
    /// A seventh of the light: the camera makes up for it with a longer exposure, and with gain by night.
    Dim,
    /// So little light that the picture stays dark whatever the camera does.
    Dark,
}

/// What stands between the camera and the person's way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Occlusion {
    /// Nothing.
    None,
    /// Furniture that hides the lower body for a part of the way.
    Partial,
    /// A pillar or a screen that hides the whole person for a second.
    Full,
}

/// Where the people are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Place {
    /// In a hall, with things along its walls.
    #[default]
    Hall,
    /// In a yard before a street, under the sky: one sees as far as to the houses 60 m away.
    Yard,
    /// The same under street lamps.
    NightYard,
    /// The same as an infrared camera with a lamp of its own sees it by night.
    InfraredYard,
}

impl Place {
    /// Every one, with its name for command lines and tables.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Hall, "hall"),
        (Self::Yard, "yard"),
        (Self::NightYard, "night-yard"),
        (Self::InfraredYard, "infrared-yard"),
    ];
}

/// Whether something stays as it is all the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// It does.
    Fixed,
    /// It changes on the way.
    Variable,
}

/// Who walks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// Tall, clothed nearly in the colour of the wall.
    A,
    /// Short and quick of step.
    B,
    /// Of middle height, in wide clothes.
    C,
}

/// The room and the person in it.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomSettings {
    /// Of the room, the clothes, the gait and the way; 1 is the reference world.
    pub seed: u64,
    /// Where all that is.
    pub place: Place,
    /// Where the camera hangs, in metres: to the right of where it does otherwise, above the floor, and ahead. Of furniture only the
    /// sides that are seen from there otherwise are drawn.
    pub stand: Option<[f64; 3]>,
    /// How much light there is.
    pub lighting: Lighting,
    /// What hides the person on the way.
    pub occlusion: Occlusion,
    /// Of walking: 1.4 m/s, or once up to 2.2 and once down to 0.8 m/s.
    pub speed: Change,
    /// Of walking: across the room, or almost across and back, so that the turn is half-way.
    pub direction: Change,
    /// Who walks.
    pub subject: Subject,
    /// What goes on instead of a test; of a test's settings light and subject count in any case.
    pub action: Action,
    /// How many more people there are: they walk along in a group, else they wander about before and behind the person.
    pub others: usize,
    /// Whether all people wear what the person to be followed wears.
    pub alike: bool,
    /// How many cars drive by on the street, out of doors: the first at once, the next some seconds later.
    pub vehicles: usize,
    /// How much people and vehicles differ from what is behind them, on the average, in grey levels of 219 as painted; as they do
    /// unless given. The floor below them is no darker then.
    pub faint: Option<f64>,
    /// How far the action has come when the world begins. Later than two seconds, the person is in the first view already.
    pub begins: Duration,
    /// What happens besides.
    pub events: Vec<Event>,
    /// Whether low sun lets people cast long shadows.
    pub shadows: bool,
    /// Whether the floor reflects people.
    pub reflections: bool,
    /// Whether the person walks the same way again after the end of it, for ever.
    pub repeats: bool,
}

impl Default for RoomSettings {
    /// Test 1 in the reference world.
    fn default() -> Self {
        Self {
            seed: 1,
            place: Place::Hall,
            stand: None,
            lighting: Lighting::Optimal,
            occlusion: Occlusion::None,
            speed: Change::Fixed,
            direction: Change::Fixed,
            subject: Subject::A,
            action: Action::Test,
            others: 0,
            alike: false,
            vehicles: 0,
            faint: None,
            begins: Duration::ZERO,
            events: Vec::new(),
            shadows: false,
            reflections: false,
            repeats: false,
        }
    }
}

impl RoomSettings {
    /// Test `number` of the thesis' table 5.2, from 1 to 72; `None` for any other.
    pub fn test(number: u32, seed: u64) -> Option<Self> {
        let index = number.checked_sub(1).filter(|index| *index < 72)? as usize;
        let change = |changed: usize| [Change::Fixed, Change::Variable][changed % 2];
        Some(Self {
            seed,
            subject: [Subject::A, Subject::B, Subject::C][index % 3],
            lighting: [Lighting::Optimal, Lighting::Dim][index / 3 % 2],
            occlusion: [Occlusion::None, Occlusion::Partial, Occlusion::Full][index / 6 % 3],
            speed: change(index / 18),
            direction: change(index / 36),
            ..Self::default()
        })
    }

    /// The number of the test of this kind.
    pub fn number(&self) -> u32 {
        let (direction, speed) = (self.direction as u32, self.speed as u32);
        // The tests know no darkness.
        let dim = u32::from(self.lighting != Lighting::Optimal);
        let (occlusion, subject) = (self.occlusion as u32, self.subject as u32);
        1 + 36 * direction + 18 * speed + 6 * occlusion + 3 * dim + subject
    }

    /// The number of the way that is walked: tests that differ by light and occlusion alone share one, so that
    /// nothing else differs between them (thesis 5.1).
    pub fn way(&self) -> u64 {
        let plain = Self { lighting: Lighting::Optimal, occlusion: Occlusion::None, ..self.clone() };
        match self.action {
            Action::Test => u64::from(plain.number()),
            action => action.way(),
        }
    }

    /// From the start of the world, empty for two seconds, to the end of the person's way.
    pub fn duration(&self) -> Duration {
        let whole = Walk::new(self).map_or(NOBODY_THERE, |walk| Duration::from_secs_f64(walk.duration()));
        whole.saturating_sub(self.begins)
    }

    /// Where the camera looks at first: the person comes in at the side of the widest view, or is in it.
    pub fn home(&self) -> Pose {
        Walk::new(self).map_or(STRAIGHT_AHEAD, |walk| walk.home(self.begins.as_secs_f64()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tests_are_in_the_order_of_the_thesis() {
        use self::{Change::*, Lighting::*, Subject::*};
        let of = |number| {
            let test = RoomSettings::test(number, 1).unwrap();
            (test.lighting, test.occlusion, test.speed, test.direction, test.subject)
        };
        assert_eq!(of(1), (Optimal, Occlusion::None, Fixed, Fixed, A));
        assert_eq!(of(6), (Dim, Occlusion::None, Fixed, Fixed, C));
        assert_eq!(of(8), (Optimal, Occlusion::Partial, Fixed, Fixed, B));
        assert_eq!(of(16), (Dim, Occlusion::Full, Fixed, Fixed, A));
        assert_eq!(of(19), (Optimal, Occlusion::None, Variable, Fixed, A));
        assert_eq!(of(37), (Optimal, Occlusion::None, Fixed, Variable, A));
        assert_eq!(of(72), (Dim, Occlusion::Full, Variable, Variable, C));
        assert_eq!(RoomSettings::test(0, 1), None);
        assert_eq!(RoomSettings::test(73, 1), None);
    }

    #[test]
    fn every_test_is_another() {
        let tests: Vec<_> = (1..=72).map(|number| RoomSettings::test(number, 1).unwrap()).collect();
        for (index, test) in tests.iter().enumerate() {
            assert!(!tests[..index].contains(test), "{test:?}");
        }
        let count = |holds: &dyn Fn(&RoomSettings) -> bool| tests.iter().filter(|test| holds(test)).count();
        assert_eq!(count(&|test| test.occlusion == Occlusion::Full), 24);
        assert_eq!(count(&|test| test.lighting == Lighting::Dim), 36);
        assert_eq!(count(&|test| test.subject == Subject::C), 24);
        assert_eq!(count(&|test| test.direction == Change::Variable), 36);
    }
}
