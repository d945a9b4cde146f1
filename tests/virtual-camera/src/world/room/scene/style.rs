// SPDX-License-Identifier: MPL-2.0

//! What kind of room a seed is.

use super::paint::{Colour, hue};
use crate::seeded::Seeded;

/// Stream of chance.
const STYLE: u64 = 0x57e1;
/// One room in so many has no light but its lamps.
const NIGHTS: u64 = 5;

/// What a room is like before anything is put into it.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Style {
    /// Whether it is full of things, from wall to wall; else walls are mostly bare and the floor is free.
    pub full: bool,
    /// Whether only a few lamps give light, so that little else is seen.
    pub night: bool,
    /// Colour of its plain walls.
    pub wall: Colour,
}

impl Style {
    /// Of two rooms one is full, of five one is dim, by number of the seed, so that a few seeds have some of each.
    pub fn of(seed: u64) -> Self {
        let before = seed.wrapping_sub(1);
        let drawn = |group: u64| Seeded::new(before / group).fork(STYLE).fork(group);
        let mut chance = Seeded::new(seed).fork(STYLE);
        Self {
            full: before % 2 == drawn(2).bits() % 2,
            night: before % NIGHTS == drawn(NIGHTS).bits() % NIGHTS,
            wall: wall_colour(&mut chance),
        }
    }
}

/// A colour for walls.
pub(super) fn wall_colour(seeded: &mut Seeded) -> Colour {
    hue(seeded.unit(), seeded.range(0.02, 0.18), seeded.range(0.55, 0.9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_rooms_are_full_and_a_few_dim() {
        let count = |seeds: std::ops::Range<u64>, holds: fn(&Style) -> bool| {
            seeds.map(Style::of).filter(holds).count()
        };
        for first in [1, 11, 51] {
            let seeds = first..first + 10;
            assert_eq!(count(seeds.clone(), |style| style.full), 5);
            assert_eq!(count(seeds, |style| style.night), 2);
        }
        let both = count(1..101, |style| style.full && style.night);
        assert!((5..16).contains(&both), "the one does not decide the other: {both}");
    }
}
