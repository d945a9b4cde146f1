// SPDX-License-Identifier: MPL-2.0

//! Scenes of real people: in front of a camera that turns within a recording, or in the recording as it is.

use std::{collections::BTreeMap, path::Path, str::FromStr, sync::Arc, time::Duration};

use virtual_camera::{Clock, FootageSettings, People, Settings, Video, VirtualCamera, World};

use crate::{
    experiment::{Place, Scene, Target, exposure},
    people::{self, TruthError},
    record::Suite,
    still::{self, Recording},
    suite::photo::PhotosError,
};

/// Why there is nobody to follow in a recording.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The ground truth cannot be used.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// The photographs cannot be used.
    #[error(transparent)]
    Photos(#[from] PhotosError),
    /// The recording cannot be used.
    #[error(transparent)]
    Camera(#[from] virtual_camera::Error),
    /// That person is not there.
    #[error("person {0} is never wholly in view; `--person auto` takes who is")]
    Person(u32),
    /// Nobody is there.
    #[error("nobody is ever wholly in view")]
    Nobody,
}

/// Whom to follow in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whom {
    /// One person, by number.
    Person(u32),
    /// Who is there longest.
    Longest,
    /// Everybody who is there for five seconds or more, one after the other.
    All,
}

impl FromStr for Whom {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Longest),
            "all" => Ok(Self::All),
            number => number
                .parse()
                .map(Self::Person)
                .map_err(|_| format!("`{text}` is no number, nor auto or all")),
        }
    }
}

/// Who is there for less time is not asked for, seconds.
const LONG_S: f64 = 5.0;

/// Numbers of the first and last picture that a person is in.
type Stay = (u64, u64);

impl Scene {
    /// A camera that turns within the recording `file` and follows somebody of its MOTChallenge file `truth`, from where
    /// they are wholly in the first view to their last box: a scene for each of those asked for.
    ///
    /// # Errors
    /// Where one of the files cannot be used, or nobody is there.
    pub fn footage(file: &Path, truth: &Path, whom: Whom, size: (u32, u32)) -> Result<Vec<Self>, SceneError> {
        let people = people::read(truth)?;
        let footage =
            FootageSettings { looped: false, ground_truth: Some(truth.into()), ..FootageSettings::new(file) };
        let world = World::Footage(footage);
        let camera = VirtualCamera::start(Settings {
            world: world.clone(),
            video: Video { size: Some(size), ..Video::default() },
            clock: Clock::Stepped,
            ..Settings::default()
        })?;
        let (home, period) = (camera.home(), camera.frame_period());
        let in_view = |picture: u64| {
            let there = camera.ground_truth_from(&home, exposure(picture as u32, period), size);
            there.into_iter().filter(|one| one.bounds.part_inside(size) >= 1.0).map(|one| one.id).collect()
        };
        let chosen = choose(&stays(&people, in_view), whom, period)?;
        let scene = |(id, (_, last)): (u32, Stay)| Self {
            duration: exposure(last as u32, period),
            ..Self::of_recording(file, id, Place::world(world.clone()))
        };
        Ok(chosen.into_iter().map(scene).collect())
    }

    /// The recording `file` as it is, and somebody of `truth` in it to their last box: a scene for each of those asked for.
    /// Who is there long enough is counted at 25 pictures a second.
    ///
    /// # Errors
    /// Where the ground truth cannot be used, or the person is not there.
    pub fn recordings(file: &Path, truth: &Path, whom: Whom) -> Result<Vec<Self>, SceneError> {
        let people = Arc::new(people::read(truth)?);
        let everybody = |picture| people[&picture].iter().map(|one| one.id).collect();
        let chosen = choose(&stays(&people, everybody), whom, still::USUAL_PERIOD)?;
        let scene = |(id, (_, last)): (u32, Stay)| {
            let recording = Recording { file: file.into(), people: people.clone(), last };
            Self::of_recording(file, id, Place::Recording(recording))
        };
        Ok(chosen.into_iter().map(scene).collect())
    }

    fn of_recording(file: &Path, person: u32, place: Place) -> Self {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        Self {
            suite: Suite::Recording,
            test: None,
            title: format!("{name}, person {person}"),
            path: name.into(),
            place,
            begin: Duration::ZERO,
            lead: Duration::ZERO,
            duration: Duration::MAX,
            target: Target::Person(person),
        }
    }
}

/// Of each person the first picture for which `there` tells of them, and the last that they have a box in.
fn stays(people: &People, there: impl Fn(u64) -> Vec<u32>) -> BTreeMap<u32, Stay> {
    let mut stays = BTreeMap::<u32, Stay>::new();
    for (&picture, boxes) in people {
        for id in there(picture) {
            stays.entry(id).or_insert((picture, picture));
        }
        for person in boxes {
            stays.entry(person.id).and_modify(|(_, last)| *last = picture);
        }
    }
    stays
}

/// Those asked for; of several who stay longest the one with the lowest number. Pictures are `period` apart.
fn choose(stays: &BTreeMap<u32, Stay>, whom: Whom, period: Duration) -> Result<Vec<(u32, Stay)>, SceneError> {
    let all = stays.iter().map(|(id, stay)| (*id, *stay));
    let length = |(_, (first, last)): &(u32, Stay)| last - first;
    let chosen: Vec<_> = match whom {
        Whom::Person(id) => vec![(id, *stays.get(&id).ok_or(SceneError::Person(id))?)],
        Whom::Longest => all.min_by_key(|one| std::cmp::Reverse(length(one))).into_iter().collect(),
        Whom::All => all.filter(|one| length(one) as f64 * period.as_secs_f64() >= LONG_S).collect(),
    };
    if chosen.is_empty() { Err(SceneError::Nobody) } else { Ok(chosen) }
}

#[cfg(test)]
mod tests {
    use virtual_camera::{Bounds, Person};

    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn people(boxes: &[(u64, u32)]) -> People {
        let mut people = People::new();
        for (picture, id) in boxes {
            let bounds = Bounds { left: 0.0, top: 0.0, width: 9.0, height: 20.0 };
            people.entry(*picture).or_default().push(Person { id: *id, bounds, unhidden: 1.0 });
        }
        people
    }

    #[test]
    fn who_stays_longest_after_having_come_into_view_is_chosen() {
        let people = people(&[(0, 1), (1, 1), (1, 2), (2, 2), (2, 3), (3, 2), (3, 3), (4, 3), (5, 1)]);
        let all = |picture| people[&picture].iter().map(|one| one.id).collect::<Vec<_>>();
        let everybody = stays(&people, all);
        assert_eq!(everybody, BTreeMap::from([(1, (0, 5)), (2, (1, 3)), (3, (2, 4))]));
        assert_eq!(choose(&everybody, Whom::Longest, SECOND).unwrap(), [(1, (0, 5))]);
        assert_eq!(choose(&everybody, Whom::Person(2), SECOND).unwrap(), [(2, (1, 3))]);
        assert!(matches!(choose(&everybody, Whom::Person(7), SECOND), Err(SceneError::Person(7))));
        assert_eq!(choose(&everybody, Whom::All, SECOND).unwrap(), [(1, (0, 5))], "five seconds at least");
        assert_eq!(choose(&everybody, Whom::All, 3 * SECOND).unwrap().len(), 3);
        // Person 1 comes into view only at the end; of the others both stay as long.
        let late =
            stays(&people, |picture| all(picture).into_iter().filter(|id| *id > 1 || picture > 4).collect());
        assert_eq!(choose(&late, Whom::Longest, SECOND).unwrap(), [(2, (1, 3))]);
        assert!(matches!(choose(&BTreeMap::new(), Whom::Longest, SECOND), Err(SceneError::Nobody)));
    }
}
