//! Scenes of real people: in front of a camera that turns within a recording, or in the recording as it is.

use std::{collections::BTreeMap, path::Path, sync::Arc, time::Duration};

use virtual_camera::{Clock, FootageSettings, People, Settings, Video, VirtualCamera, World};

use crate::{
    experiment::{Place, Scene, Target, exposure},
    people::{self, TruthError},
    record::Suite,
    still::Recording,
};

/// Why there is nobody to follow in a recording.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The ground truth cannot be used.
    #[error(transparent)]
    Truth(#[from] TruthError),
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

/// Numbers of the first and last picture that a person is in.
type Stay = (u64, u64);

impl Scene {
    /// A camera that turns within the recording `file` and follows `person` of its MOTChallenge file `truth`, from where
    /// they are wholly in the first view to their last box; without a number who stays longest.
    ///
    /// # Errors
    /// Where one of the files cannot be used, or nobody is there.
    pub fn footage(
        file: &Path,
        truth: &Path,
        person: Option<u32>,
        size: (u32, u32),
    ) -> Result<Self, SceneError> {
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
        let (id, (_, last)) = choose(&stays(&people, in_view), person)?;
        let place = Place::world(world);
        Ok(Self { duration: exposure(last as u32, period), ..Self::of_recording(file, id, place) })
    }

    /// The recording `file` as it is, and `person` of `truth` in it to their last box; without a number who stays longest.
    ///
    /// # Errors
    /// Where the ground truth cannot be used, or the person is not there.
    pub fn recording(file: &Path, truth: &Path, person: Option<u32>) -> Result<Self, SceneError> {
        let people = people::read(truth)?;
        let everybody = |picture| people[&picture].iter().map(|one| one.id).collect();
        let (id, (_, last)) = choose(&stays(&people, everybody), person)?;
        let place = Place::Recording(Recording { file: file.into(), people: Arc::new(people), last });
        Ok(Self::of_recording(file, id, place))
    }

    fn of_recording(file: &Path, person: u32, place: Place) -> Self {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        Self {
            suite: Suite::Recording,
            test: None,
            title: format!("{name}, person {person}"),
            path: name.into(),
            place,
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

/// The one asked for, or else who stays longest; of several the one with the lowest number.
fn choose(stays: &BTreeMap<u32, Stay>, person: Option<u32>) -> Result<(u32, Stay), SceneError> {
    match person {
        Some(id) => stays.get(&id).map(|stay| (id, *stay)).ok_or(SceneError::Person(id)),
        None => stays
            .iter()
            .map(|(id, stay)| (*id, *stay))
            .min_by_key(|(_, (first, last))| std::cmp::Reverse(last - first))
            .ok_or(SceneError::Nobody),
    }
}

#[cfg(test)]
mod tests {
    use virtual_camera::{Bounds, Person};

    use super::*;

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
        assert_eq!(choose(&everybody, None).unwrap(), (1, (0, 5)));
        assert_eq!(choose(&everybody, Some(2)).unwrap(), (2, (1, 3)));
        assert!(matches!(choose(&everybody, Some(7)), Err(SceneError::Person(7))));
        // Person 1 comes into view only at the end; of the others both stay as long.
        let late =
            stays(&people, |picture| all(picture).into_iter().filter(|id| *id > 1 || picture > 4).collect());
        assert_eq!(choose(&late, None).unwrap(), (2, (1, 3)));
        assert!(matches!(choose(&BTreeMap::new(), None), Err(SceneError::Nobody)));
    }
}
