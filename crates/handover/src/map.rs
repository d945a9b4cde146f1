// SPDX-License-Identifier: MPL-2.0

use serde::{Deserialize, Serialize};

use crate::geometry::{Direction, Place, Ray, angle};
use crate::homography::Homography;
use crate::local;
use crate::moved::MovedDetector;
use crate::pairs::{Pair, Pairs};
use crate::robust;

/// Where a camera has to look to see somebody.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Their feet.
    pub feet: Direction,
    /// Degrees from feet to head, where that is known.
    pub height_deg: Option<f64>,
    /// Standard deviation of the direction on either axis, in degrees.
    pub doubt_deg: f64,
}

impl Aim {
    /// The middle of the person.
    pub fn middle(&self) -> Direction {
        let up = self.height_deg.unwrap_or(0.0) / 2.0;
        Direction { tilt_deg: (self.feet.tilt_deg + up).min(90.0), ..self.feet }
    }
}

/// What became of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Learned {
    /// The map goes by it, too.
    Taken,
    /// It contradicts what is well known: somebody was confused with somebody else.
    Contradicts,
    /// One of the cameras was moved, and all that was learned is void.
    Moved,
}

/// From where one camera sees somebody to where another has to look.
#[derive(Debug, Clone, Default)]
pub struct Map {
    pairs: Pairs,
    homography: Option<Homography>,
    /// All pairs that were taken, kept or not.
    taken: usize,
    /// Pairs since the homography was last made.
    unused: usize,
    moved: MovedDetector,
}

/// Why a map cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NotRead {
    /// It is of another version of this program.
    Version(u64),
    /// It is no map.
    Nonsense(String),
}

impl std::fmt::Display for NotRead {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Version(version) => write!(f, "it is of version {version}, not {VERSION}"),
            Self::Nonsense(reason) => f.write_str(reason),
        }
    }
}

impl std::error::Error for NotRead {}

const VERSION: u64 = 1;

#[derive(Deserialize)]
struct Header {
    version: u64,
}

#[derive(Serialize, Deserialize)]
struct Kept {
    version: u64,
    pairs: Vec<Pair>,
}

impl Map {
    /// A pair so many times as far off as can be expected contradicts.
    const CONTRADICTS: f64 = 4.0;
    /// What is doubted by more than this contradicts nobody: three times what is in doubt about anybody's feet.
    const WELL_KNOWN_DEG: f64 = 3.0;
    /// Whoever sees the feet of somebody sees those of others beside them: a step away, ten metres from the camera.
    const NEAR_DEG: f64 = 3.0;
    /// Half a minute of somebody's walk, at five pairs a second.
    const ENOUGH: usize = 150;
    /// The homography is made anew when there is this part more to go by.
    const MORE: f64 = 0.1;

    /// Takes a pair.
    pub fn learn(&mut self, pair: Pair) -> Learned {
        if !pair.is_sound() {
            return Learned::Contradicts;
        }
        let known = self.aim(pair.place).filter(|aim| aim.doubt_deg < Self::WELL_KNOWN_DEG);
        if let Some(aim) = known {
            let contradicts = aim.feet.angle_to_deg(pair.direction) > Self::CONTRADICTS * aim.doubt_deg;
            if self.moved.see(pair.person, contradicts) {
                *self = Self::default();
                return Learned::Moved;
            }
            if contradicts {
                return Learned::Contradicts;
            }
        }
        self.pairs.add(pair);
        self.taken += 1;
        self.unused += 1;
        if self.unused as f64 > Self::MORE * self.pairs.len() as f64 {
            self.refine();
        }
        Learned::Taken
    }

    fn refine(&mut self) {
        let seen: Vec<_> = self.pairs.iter().map(|pair| (pair.place.ray(), pair.direction.ray())).collect();
        self.homography = Homography::fit(&seen);
        self.unused = 0;
    }

    /// Where to look for somebody whose feet are there; `None` before anything is known.
    pub fn aim(&self, place: Place) -> Option<Aim> {
        let place = place.is_finite().then(|| place.ray())?;
        let local = local::guess(&place, self.pairs.iter())?;
        let by_neighbours = (local.ray, local.doubt);
        let (ray, doubt) =
            self.by_homography(&place).map_or(by_neighbours, |plane| surer(plane, by_neighbours));
        Some(Aim {
            feet: Direction::of(&ray),
            height_deg: local.log_height.map(f64::exp),
            doubt_deg: doubt.to_degrees(),
        })
    }

    /// The homography's answer, with a doubt that says how far it fits thereabouts, too.
    fn by_homography(&self, place: &Ray) -> Option<(Ray, f64)> {
        let homography = self.homography.as_ref()?;
        let (ray, doubt) = homography.map(place);
        let mut near: Vec<(f64, f64)> = self
            .pairs
            .iter()
            .map(|pair| {
                let from = pair.place.ray();
                (angle(&from, place), angle(&homography.map(&from).0, &pair.direction.ray()))
            })
            .collect();
        near.sort_by(|one, other| one.0.total_cmp(&other.0));
        near.truncate(near.len() / 4 + 4);
        let misfit = robust::scale(near.into_iter().map(|(_, residual)| residual));
        Some((ray, doubt.hypot(misfit)))
    }

    /// Whether enough was learned to be right elsewhere than where somebody was just seen, too: before, it is surer of itself than it
    /// can be.
    pub fn knows_enough(&self) -> bool {
        self.taken >= Self::ENOUGH
    }

    /// Whether the camera that calls has seen somebody there, in that direction from the one that is called.
    pub fn covers(&self, direction: Direction) -> bool {
        self.pairs.iter().any(|pair| pair.direction.angle_to_deg(direction) < Self::NEAR_DEG)
    }

    /// How many pairs it goes by.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether nothing is known yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All that was learned, as text.
    pub fn to_json(&self) -> String {
        let kept = Kept { version: VERSION, pairs: self.pairs.iter().copied().collect() };
        // Numbers in a list cannot fail to be written.
        serde_json::to_string(&kept).unwrap_or_default()
    }

    /// Reads such a text.
    ///
    /// # Errors
    /// Where it is none, or of another version.
    pub fn from_json(text: &str) -> Result<Self, NotRead> {
        let nonsense = |err: serde_json::Error| NotRead::Nonsense(err.to_string());
        let Header { version } = serde_json::from_str(text).map_err(nonsense)?;
        if version != VERSION {
            return Err(NotRead::Version(version));
        }
        let kept: Kept = serde_json::from_str(text).map_err(nonsense)?;
        let mut map = Self::default();
        kept.pairs.into_iter().filter(Pair::is_sound).for_each(|pair| map.pairs.add(pair));
        map.taken = map.pairs.len();
        map.refine();
        Ok(map)
    }
}

/// The surer of two answers. The more they differ, the more either is to be doubted, unless the other one knows little.
fn surer(one: (Ray, f64), other: (Ray, f64)) -> (Ray, f64) {
    let (best, rest) = if one.1 < other.1 { (one, other) } else { (other, one) };
    let share = best.1 / best.1.hypot(rest.1);
    (best.0, best.1.hypot(share * angle(&best.0, &rest.0)))
}
