// SPDX-License-Identifier: MPL-2.0

//! Outlines: closed polygons in pixels of the picture, of which every other crossing leads in.

use opencv::core::Point2f;

/// Where an outline crosses the row at `y`, in any order.
pub(super) fn crossings(outline: &[Point2f], y: f32) -> impl Iterator<Item = f32> {
    let ends = outline.iter().zip(outline.iter().cycle().skip(1));
    // An end that lies in the row belongs to one of its two edges.
    let crossing = ends.filter(move |(from, to)| (from.y <= y) != (to.y <= y));
    crossing.map(move |(from, to)| from.x + (y - from.y) / (to.y - from.y) * (to.x - from.x))
}

/// Whether a place with these crossings in its row is inside.
pub(super) fn is_inside(crossings: impl Iterator<Item = f32>, x: f32) -> bool {
    crossings.filter(|crossing| *crossing <= x).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Legs apart.
    const LEGS: [Point2f; 7] = [
        Point2f { x: 0.0, y: 0.0 },
        Point2f { x: 40.0, y: 0.0 },
        Point2f { x: 40.0, y: 100.0 },
        Point2f { x: 30.0, y: 100.0 },
        Point2f { x: 20.0, y: 50.0 },
        Point2f { x: 10.0, y: 100.0 },
        Point2f { x: 0.0, y: 100.0 },
    ];

    fn shows(x: f32, y: f32) -> bool {
        is_inside(crossings(&LEGS, y), x)
    }

    #[test]
    fn what_is_between_the_legs_is_outside() {
        assert!(shows(5.0, 90.0) && shows(35.0, 90.0) && shows(20.0, 20.0));
        assert!(!shows(20.0, 90.0) && !shows(-1.0, 50.0) && !shows(41.0, 50.0) && !shows(20.0, 101.0));
        assert!(!is_inside(crossings(&[], 50.0), 20.0), "of nothing");
    }

    proptest! {
        #[test]
        fn it_crosses_each_row_an_even_number_of_times(
            points in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0), 0..20), y in -60.0_f32..60.0,
        ) {
            let points: Vec<_> = points.into_iter().map(|(x, y)| Point2f::new(x, y)).collect();
            prop_assert_eq!(crossings(&points, y).count() % 2, 0);
            prop_assert!(crossings(&points, y).all(|x| (-50.1..50.1).contains(&x)));
        }
    }
}
