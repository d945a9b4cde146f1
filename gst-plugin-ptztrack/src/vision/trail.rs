// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;

use ptztrack_contract::Point;

/// Points kept at most, however high the frame rate.
const CAPACITY: usize = 512;

/// Where one target was lately.
#[derive(Debug, Default)]
pub struct Trail {
    target: u64,
    points: VecDeque<(f64, Point)>,
}

impl Trail {
    /// Adds that target number `target` was at `point` at `seconds`. A new target, or a time that went
    /// backwards, starts a new trail.
    pub fn push(&mut self, target: u64, seconds: f64, point: Point) {
        if target != self.target || self.points.back().is_some_and(|&(last, _)| last > seconds) {
            self.points.clear();
            self.target = target;
        }
        if self.points.len() == CAPACITY {
            self.points.pop_front();
        }
        self.points.push_back((seconds, point));
    }

    /// Forgets what is older than `duration` seconds at `now`, and what would be yet to come, as time went backwards.
    pub fn expire(&mut self, now: f64, duration: f64) {
        while self.points.front().is_some_and(|&(seconds, _)| now - seconds > duration) {
            self.points.pop_front();
        }
        while self.points.back().is_some_and(|&(seconds, _)| seconds > now) {
            self.points.pop_back();
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// The points, oldest first.
    pub fn points(&self) -> impl ExactSizeIterator<Item = Point> {
        self.points.iter().map(|&(_, point)| point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trail() -> Trail {
        let mut trail = Trail::default();
        for second in 0..5 {
            trail.push(1, f64::from(second), Point { x: f64::from(second) / 10.0, y: 0.5 });
        }
        trail
    }

    #[test]
    fn keeps_what_is_young_enough_in_order() {
        let mut trail = trail();
        trail.expire(4.5, 2.0);
        let xs: Vec<_> = trail.points().map(|point| point.x).collect();
        assert_eq!(xs, [0.3, 0.4]);
    }

    #[test]
    fn forgets_what_is_yet_to_come() {
        let mut trail = trail();
        trail.expire(2.0, 10.0);
        let xs: Vec<_> = trail.points().map(|point| point.x).collect();
        assert_eq!(xs, [0.0, 0.1, 0.2]);
        trail.expire(-1.0, 10.0);
        assert_eq!(trail.points().len(), 0);
    }

    #[test]
    fn new_target_and_jump_back_start_anew() {
        let mut other = trail();
        other.push(2, 5.0, Point::default());
        assert_eq!(other.points().len(), 1);
        let mut back = trail();
        back.push(1, 3.0, Point::default());
        assert_eq!(back.points().len(), 1);
    }

    #[test]
    fn never_grows_without_end() {
        let mut trail = trail();
        for index in 0..10_000 {
            trail.push(1, 10.0 + f64::from(index), Point::default());
        }
        assert_eq!(trail.points().len(), CAPACITY);
    }
}
