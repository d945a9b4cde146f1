// SPDX-License-Identifier: MPL-2.0

//! Which photograph, who walks in it, and how.

use std::{path::PathBuf, time::Duration};

use super::{place::PhotoPlace, way::Way};
use crate::{
    kinematics::Pose,
    seeded::Seeded,
    world::{Change, Lighting, Occlusion, Subject},
};

/// Why a photograph cannot be a world.
#[derive(Debug, thiserror::Error)]
pub enum PhotoError {
    /// No such file, or not one to read.
    #[error("cannot read {path}: {source}")]
    Unreadable {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Not a picture as it should be.
    #[error("cannot decode {path}: {reason}")]
    Undecodable {
        /// As given.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A list or a description that says nonsense.
    #[error("{path}: {reason}")]
    Nonsense {
        /// As given.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// Who walks in a panorama.
#[derive(Debug, Clone, PartialEq)]
pub enum PhotoPerson {
    /// Somebody cut out of film: a folder with `walker.csv` and the pictures it lists. They never show their back.
    Film(PathBuf),
    /// Somebody drawn as in the room, in the light of the panorama: of the seed's clothes and of this kind.
    Drawn(Subject),
}

/// A panorama, and somebody who walks in it.
#[derive(Debug, Clone, PartialEq)]
pub struct PhotoSettings {
    /// An equirectangular picture, JPEG or WebP, horizon in the middle row.
    pub panorama: PathBuf,
    /// Who walks.
    pub person: PhotoPerson,
    /// Where one can walk in it.
    pub place: PhotoPlace,
    /// Number of the way, from 1; see [`Self::WAYS`].
    pub way: u32,
    /// Of what else is left to chance.
    pub seed: u64,
    /// How much light there is.
    pub lighting: Lighting,
    /// What hides the person on the way.
    pub occlusion: Occlusion,
    /// Of walking.
    pub speed: Change,
    /// Of walking: along the lane, or there and back.
    pub direction: Change,
    /// Whether the strongest colour of the clothes on film is another one.
    pub other_clothes: bool,
    /// Whether the person walks the same way again after the end of it, for ever.
    pub repeats: bool,
}

impl PhotoSettings {
    /// How many ways there are in each panorama: a third each with nothing, something low and something high before the
    /// person, steady and at different speeds, there and there and back, bright and dim.
    pub const WAYS: u32 = 12;

    /// Way `number` through a panorama of somebody on film in the folder `walker`; `None` unless it is from 1 to [`Self::WAYS`].
    pub fn way(
        panorama: PathBuf,
        walker: PathBuf,
        place: PhotoPlace,
        number: u32,
        seed: u64,
    ) -> Option<Self> {
        let index = number.checked_sub(1).filter(|index| *index < Self::WAYS)? as usize;
        let change = |changed: bool| if changed { Change::Variable } else { Change::Fixed };
        let chance = |label: u64| Seeded::new(seed).fork(u64::from(number)).fork(label).bits() % 2 == 1;
        Some(Self {
            panorama,
            person: PhotoPerson::Film(walker),
            place,
            way: number,
            seed,
            occlusion: [Occlusion::None, Occlusion::Partial, Occlusion::Full][index % 3],
            speed: change(index / 3 % 2 == 1),
            direction: change(index / 6 == 1),
            lighting: if chance(1) { Lighting::Dim } else { Lighting::Optimal },
            other_clothes: chance(2),
            repeats: false,
        })
    }

    /// From the start of the world to the end of the person's way.
    pub fn duration(&self) -> Duration {
        Duration::from_secs_f64(Way::new(self).duration())
    }

    /// Where the camera looks at first: the person comes in at the side of the widest view.
    pub fn home(&self) -> Pose {
        Way::new(self).home()
    }
}
