// SPDX-License-Identifier: MPL-2.0

//! How many people a region shows, by the heads of its outline (after Haritaoglu et al., "Hydra", ICPR 1999): two who walk side by
//! side are one region, with a dip between their heads.

use opencv::core::{Point2f, Rect2f};

use crate::vision::tracker::geometry::{ASPECT, centre};

/// Columns in which the outline is looked at.
const COLUMNS: usize = 32;
/// A region narrower than this beside its height shows one body.
const TWO_BODIES: f32 = 0.55;
/// Two heads are at least this far apart, in heights of the region, ...
const APART: f32 = 0.22;
/// ... the outline dips between them by this much at least, ...
const DIP: f32 = 0.1;
/// ... and the lower of them is no lower than this: what is lower are arms and bags.
const LOWEST: f32 = 0.4;

/// A click is into the middle of somebody. Farther beside the middle of what is seen than this, in breadths of a body, it means one of
/// several.
const BESIDE: f32 = 0.1;

/// The box of whom a click at `point` means in a region: of all that it shows, or of the one body around that place. What is broader
/// than it is high is a vehicle.
pub(in super::super) fn body_at(point: Point2f, region: Rect2f) -> Rect2f {
    let breadth = ASPECT * region.height;
    let beside = (point.x - centre(region).x).abs();
    if region.width > region.height || beside < BESIDE * breadth {
        return region;
    }
    Rect2f::new(point.x - breadth / 2.0, region.y, breadth, region.height)
}

/// The upper and the lower end of an outline in each column.
struct Profile {
    bounds: Rect2f,
    top: [f32; COLUMNS],
    bottom: [f32; COLUMNS],
}

/// Leaves the box of each person whom a region shows in `people`; where its outline is not known that is all of it.
pub(in super::super) fn people(
    bounds: Rect2f,
    contour: impl Iterator<Item = Point2f> + Clone,
    people: &mut Vec<Rect2f>,
) {
    people.clear();
    if bounds.width >= TWO_BODIES * bounds.height
        && let Some(profile) = Profile::of(bounds, contour)
    {
        profile.split(0..COLUMNS, people);
    } else {
        people.push(bounds);
    }
}

impl Profile {
    /// Of a closed polygon; `None` where it leaves a column out.
    fn of(bounds: Rect2f, contour: impl Iterator<Item = Point2f> + Clone) -> Option<Self> {
        let mut profile =
            Self { bounds, top: [f32::INFINITY; COLUMNS], bottom: [f32::NEG_INFINITY; COLUMNS] };
        let ends = contour.clone().skip(1).chain(contour.clone().take(1));
        for (from, to) in contour.zip(ends) {
            profile.draw(from, to);
        }
        profile.top.iter().all(|top| top.is_finite()).then_some(profile)
    }

    fn draw(&mut self, from: Point2f, to: Point2f) {
        let column = |x: f32| {
            ((x - self.bounds.x) / self.bounds.width * COLUMNS as f32).clamp(0.0, COLUMNS as f32 - 1.0)
        };
        let (first, last) = (column(from.x.min(to.x)) as usize, column(from.x.max(to.x)) as usize);
        for index in first..=last {
            let middle = self.bounds.x + (index as f32 + 0.5) * self.bounds.width / COLUMNS as f32;
            let along =
                if to.x == from.x { 0.0 } else { ((middle - from.x) / (to.x - from.x)).clamp(0.0, 1.0) };
            let y = from.y + along * (to.y - from.y);
            self.top[index] = self.top[index].min(y);
            self.bottom[index] = self.bottom[index].max(y);
        }
    }

    /// Cuts some columns at the deepest dip between two heads, as long as there is one.
    fn split(&self, columns: std::ops::Range<usize>, people: &mut Vec<Rect2f>) {
        let part = self.part(columns.clone());
        match self.deepest_dip(columns.clone(), part) {
            Some(cut) => {
                self.split(columns.start..cut, people);
                self.split(cut..columns.end, people);
            }
            None => people.push(part),
        }
    }

    /// The box around some columns.
    fn part(&self, columns: std::ops::Range<usize>) -> Rect2f {
        let pitch = self.bounds.width / COLUMNS as f32;
        let top = self.top[columns.clone()].iter().copied().fold(f32::INFINITY, f32::min);
        let bottom = self.bottom[columns.clone()].iter().copied().fold(f32::NEG_INFINITY, f32::max);
        Rect2f::new(
            self.bounds.x + columns.start as f32 * pitch,
            top,
            columns.len() as f32 * pitch,
            bottom - top,
        )
    }

    /// The column in which the outline dips deepest between two heads.
    fn deepest_dip(&self, columns: std::ops::Range<usize>, part: Rect2f) -> Option<usize> {
        let pitch = self.bounds.width / COLUMNS as f32;
        let highest = |columns: std::ops::Range<usize>| {
            let tops = columns.map(|column| (column, self.top[column]));
            tops.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let dips = columns.clone().filter_map(|cut| {
            let (left, left_top) = highest(columns.start..cut)?;
            let (right, right_top) = highest(cut + 1..columns.end)?;
            let lower = left_top.max(right_top);
            let depth = self.top[cut] - lower;
            let is_dip = (right - left) as f32 * pitch >= APART * part.height
                && depth >= DIP * part.height
                && lower - part.y <= LOWEST * part.height;
            is_dip.then_some((cut, depth))
        });
        dips.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(cut, _)| cut)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(contour: &[(f32, f32)]) -> Vec<Rect2f> {
        let points = contour.iter().map(|(x, y)| Point2f::new(*x, *y));
        let (left, right) = points.clone().fold((f32::MAX, 0.0_f32), |(l, r), p| (l.min(p.x), r.max(p.x)));
        let (top, bottom) = points.clone().fold((f32::MAX, 0.0_f32), |(t, b), p| (t.min(p.y), b.max(p.y)));
        let mut boxes = Vec::new();
        people(Rect2f::new(left, top, right - left, bottom - top), points, &mut boxes);
        boxes
    }

    #[test]
    fn two_heads_are_two_people() {
        let two = found(&[
            (0.0, 100.0),
            (0.0, 20.0),
            (14.0, 18.0),
            (16.0, 0.0),
            (26.0, 0.0),
            (28.0, 18.0),
            (40.0, 24.0),
            (54.0, 22.0),
            (56.0, 6.0),
            (66.0, 6.0),
            (68.0, 22.0),
            (80.0, 26.0),
            (80.0, 98.0),
            (42.0, 98.0),
            (40.0, 60.0),
            (38.0, 100.0),
        ]);
        assert_eq!(two.len(), 2, "{two:?}");
        assert!((two[0].br().x - 40.0).abs() < 8.0 && (two[1].y - 6.0).abs() < 1.0, "{two:?}");
    }

    #[test]
    fn arms_are_nobody_and_a_box_is_one() {
        let arms = [
            (0.0, 46.0),
            (30.0, 22.0),
            (34.0, 0.0),
            (46.0, 0.0),
            (50.0, 22.0),
            (80.0, 46.0),
            (60.0, 50.0),
            (60.0, 100.0),
            (20.0, 100.0),
            (20.0, 50.0),
        ];
        assert_eq!(found(&arms).len(), 1);
        assert_eq!(found(&[(0.0, 0.0), (160.0, 0.0), (160.0, 100.0), (0.0, 100.0)]).len(), 1, "a van");
        assert_eq!(found(&[]).len(), 1);
    }

    #[test]
    fn a_click_beside_the_middle_means_one_of_several() {
        let region = Rect2f::new(0.0, 0.0, 80.0, 100.0);
        let body = |x| body_at(Point2f::new(x, 50.0), region);
        assert_eq!(body(42.0), region);
        assert_eq!(body(20.0), Rect2f::new(0.0, 0.0, 40.0, 100.0));
        assert_eq!(body(65.0), Rect2f::new(45.0, 0.0, 40.0, 100.0));
        let car = Rect2f::new(0.0, 0.0, 150.0, 100.0);
        assert_eq!(body_at(Point2f::new(20.0, 50.0), car), car);
    }
}
