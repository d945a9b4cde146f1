// SPDX-License-Identifier: MPL-2.0

use ptztrack_contract::{Homography, Rect, Region};

use super::travelling::moved;

/// Lets through what is there for several pictures in a row: sensor and coding noise comes and goes,
/// somebody who walks overlaps with where they were a picture before.
#[derive(Debug, Default)]
pub struct Persistence {
    /// Boxes of the last picture, each with the number of pictures it has been there.
    seen: Vec<(Rect, u32)>,
    /// Memory for those of the next one.
    now: Vec<(Rect, u32)>,
}

impl Persistence {
    /// Forgets what was there.
    pub fn restart(&mut self) {
        self.seen.clear();
    }

    /// What was there goes with the background, which has moved by `motion` (normalised) since the last picture: while the camera turns,
    /// who is narrow overlaps with nothing at the place of the picture where they were.
    pub fn carry(&mut self, motion: &Homography) {
        self.seen.iter_mut().for_each(|(bounds, _)| *bounds = moved(*bounds, motion));
    }

    /// Those of `regions` that have been there for `pictures` pictures, this one included.
    pub fn confirmed(&mut self, mut regions: Vec<Region>, pictures: u32) -> Vec<Region> {
        let age = |bounds: &Rect| {
            let overlapping = self.seen.iter().filter(|(before, _)| overlap(before, bounds));
            overlapping.map(|(_, age)| *age).max().unwrap_or(0).saturating_add(1)
        };
        self.now.clear();
        self.now.extend(regions.iter().map(|region| (region.bounds, age(&region.bounds))));
        std::mem::swap(&mut self.seen, &mut self.now);
        let mut ages = self.seen.iter().map(|(_, age)| *age);
        regions.retain(|_| ages.next().is_some_and(|age| age >= pictures));
        regions
    }
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Region {
        Region { bounds: Rect { x, y: 0.5, width: 0.1, height: 0.2 }, ..Region::default() }
    }

    #[test]
    fn one_that_moves_on_is_let_through_in_the_third_picture() {
        let mut persistence = Persistence::default();
        assert_eq!(persistence.confirmed(vec![at(0.1)], 3), []);
        assert_eq!(persistence.confirmed(vec![at(0.15)], 3), []);
        assert_eq!(persistence.confirmed(vec![at(0.2)], 3), [at(0.2)]);
    }

    #[test]
    fn one_that_walks_before_a_camera_that_turns_is_let_through() {
        let mut persistence = Persistence::default();
        let let_through = [0.1, 0.3, 0.5].map(|x| {
            persistence.carry(&Homography::translation(0.15, 0.0));
            persistence.confirmed(vec![at(x)], 3).len()
        });
        assert_eq!(let_through, [0, 0, 1]);
    }

    #[test]
    fn flashes_here_and_there_are_not() {
        let mut persistence = Persistence::default();
        for picture in 0..20 {
            let x = if picture % 2 == 0 { 0.1 } else { 0.6 };
            assert_eq!(persistence.confirmed(vec![at(x)], 2), []);
        }
    }

    #[test]
    fn a_picture_without_it_starts_anew() {
        let mut persistence = Persistence::default();
        persistence.confirmed(vec![at(0.1)], 2);
        persistence.confirmed(vec![], 2);
        assert_eq!(persistence.confirmed(vec![at(0.1)], 2), []);
        persistence.restart();
        assert_eq!(persistence.confirmed(vec![at(0.1)], 2), []);
    }

    #[test]
    fn one_picture_is_enough_where_one_is_asked_for() {
        assert_eq!(Persistence::default().confirmed(vec![at(0.1)], 1), [at(0.1)]);
        assert_eq!(Persistence::default().confirmed(vec![at(0.1)], 0), [at(0.1)]);
    }
}
