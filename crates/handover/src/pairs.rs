// SPDX-License-Identifier: MPL-2.0

use std::collections::{BTreeMap, VecDeque};

use serde::{Deserialize, Serialize};

use crate::geometry::{Direction, Place};

/// Somebody whom both cameras see.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// Their feet as the camera that calls sees them.
    pub place: Place,
    /// Where the camera that is called sees these.
    pub direction: Direction,
    /// Degrees from head to feet for the latter; not known of somebody who is seen in part, or of a place only.
    pub height_deg: Option<f64>,
    /// Number of the person, as long as they are followed.
    pub person: u64,
}

impl Pair {
    /// Whether everything about it is a number that can be one.
    pub fn is_sound(&self) -> bool {
        let Direction { pan_deg, tilt_deg } = self.direction;
        let height = self.height_deg.is_none_or(|height| height > 0.0 && height < 180.0);
        self.place.is_finite() && pan_deg.is_finite() && tilt_deg.abs() <= 90.0 && height
    }
}

/// The newest pairs of every part of what the calling camera sees.
#[derive(Debug, Clone, Default)]
pub struct Pairs {
    cells: BTreeMap<[i32; 3], VecDeque<Pair>>,
    count: usize,
}

impl Pairs {
    /// A cell is as long as this part of a radian.
    const CELL: f64 = 1.0 / 16.0;
    /// So many pairs of a cell are kept: a few people.
    const OF_CELL: usize = 6;
    /// And so many altogether: half the view of a camera that turns.
    pub const MOST: usize = 768;

    pub fn add(&mut self, pair: Pair) {
        let ray = pair.place.ray();
        let key = [ray.x, ray.y, ray.z].map(|part| (part / Self::CELL).floor() as i32);
        let cell = self.cells.entry(key).or_default();
        cell.push_back(pair);
        self.count += 1;
        if cell.len() > Self::OF_CELL {
            cell.pop_front();
            self.count -= 1;
        } else if self.count > Self::MOST {
            self.thin();
        }
    }

    /// Takes the oldest from the fullest cell.
    fn thin(&mut self) {
        if let Some(cell) = self.cells.values_mut().max_by_key(|cell| cell.len()) {
            cell.pop_front();
            self.count -= 1;
        }
    }

    pub fn len(&self) -> usize {
        self.count
    }

    pub fn iter(&self) -> impl Iterator<Item = &Pair> {
        self.cells.values().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(x: f64, person: u64) -> Pair {
        Pair { place: Place::in_picture(x, 0.5), direction: Direction::default(), height_deg: None, person }
    }

    #[test]
    fn the_newest_of_a_place_stay() {
        let mut pairs = Pairs::default();
        (0..1000).for_each(|person| pairs.add(pair(0.51, person)));
        let people: Vec<u64> = pairs.iter().map(|pair| pair.person).collect();
        assert_eq!(people, (994..1000).collect::<Vec<_>>());
    }

    #[test]
    fn there_are_never_more_than_so_many() {
        let mut pairs = Pairs::default();
        for n in 0..20_000u32 {
            let direction =
                Direction { pan_deg: f64::from(n) * 137.508 % 360.0, tilt_deg: f64::from(n % 160) - 80.0 };
            pairs.add(Pair { place: Place::towards(direction), ..pair(0.5, 0) });
            assert!(pairs.len() <= Pairs::MOST);
        }
        assert_eq!(pairs.len(), pairs.iter().count());
        assert_eq!(pairs.len(), Pairs::MOST);
    }
}
