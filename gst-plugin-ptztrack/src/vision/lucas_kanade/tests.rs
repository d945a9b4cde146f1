// SPDX-License-Identifier: MPL-2.0

use opencv::core::{Mat, Point2f};
use opencv::prelude::*;
use proptest::prelude::*;
use ptztrack_contract::Homography;

use super::*;
use crate::vision::Luma;
use crate::vision::synthetic::{Canvas, texture};

const SIZE: (usize, usize) = (200, 150);
const PRECISION: Precision = Precision { steps: 20, step: 0.01 };
const HALVINGS: usize = 3;

fn picture(shift: (f64, f64), seed: u32) -> Canvas {
    let motion = Homography::translation(shift.0, shift.1);
    Canvas::seen(SIZE, &motion, |x, y| texture(1, x, y)).noisy(1.0, seed)
}

fn pyramid(luma: &Luma, side: usize) -> Pyramid {
    let mut pyramid = Pyramid::default();
    let size = (luma.width(), luma.height());
    pyramid.fill(size, side, HALVINGS, |y, row| row.copy_from_slice(luma.row(y)));
    pyramid
}

/// Points all over the picture, at its edges too.
fn places() -> Vec<Point2f> {
    let place = |n: usize| Point2f::new(2.3 + 15.1 * (n % 14) as f32, 1.7 + 14.6 * (n / 14) as f32);
    (0..140).map(place).collect()
}

fn followed(from: &Canvas, to: &Canvas, side: usize) -> Vec<Option<Found>> {
    let (from, to) = (pyramid(&from.luma(), side), pyramid(&to.luma(), side));
    let mut template = Template::default();
    let follow = |place: Point2f| {
        template.take(&from, place, side, HALVINGS);
        template.follow(&to, place, PRECISION)
    };
    places().into_iter().map(follow).collect()
}

fn apart(a: Point2f, b: Point2f) -> f32 {
    (a.x - b.x).hypot(a.y - b.y)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// What is in view in both pictures is found where it went.
    #[test]
    fn points_are_found_where_they_went(
        dx in -9.0..9.0, dy in -9.0..9.0, side in (4_usize..13).prop_map(|half| 2 * half + 1), seed in any::<u32>(),
    ) {
        let (from, to) = (picture((0.0, 0.0), seed), picture((dx, dy), seed ^ 1));
        let went = |place: Point2f| place + Point2f::new(dx as f32, dy as f32);
        let half = side as f32 / 2.0 + 2.0;
        let is_inside = |place: Point2f| {
            (half..SIZE.0 as f32 - half).contains(&place.x) && (half..SIZE.1 as f32 - half).contains(&place.y)
        };
        let pairs = places().into_iter().zip(followed(&from, &to, side));
        let inside: Vec<_> = pairs.filter(|(place, _)| is_inside(*place) && is_inside(went(*place))).collect();
        prop_assert!(inside.len() > 30, "{}", inside.len());
        let right = |(place, found): &&(Point2f, Option<Found>)| {
            found.is_some_and(|found| apart(found.place, went(*place)) < 0.15 && found.residual < 4.0)
        };
        let count = inside.iter().filter(right).count();
        prop_assert!(count * 100 >= inside.len() * 90, "{count} of {}", inside.len());
    }
}

#[test]
fn halvings_are_those_of_opencv() {
    let canvas = picture((0.0, 0.0), 3);
    for (width, height) in [(200, 150), (97, 61), (6, 5)] {
        let luma = canvas.luma().crop(1, 1, width, height);
        let mut pyramid = Pyramid::default();
        pyramid.fill((luma.width(), luma.height()), 1, 1, |y, row| row.copy_from_slice(luma.row(y)));
        let halved = luma
            .with_mat(|mat| {
                let mut half = Mat::default();
                opencv::imgproc::pyr_down_def(mat, &mut half).map(|()| half)
            })
            .expect("OpenCV");
        let bytes = halved.data_bytes().expect("packed");
        let [_, half] = pyramid.levels() else { panic!("{width}x{height}") };
        let rows: Vec<u8> =
            (0..half.height).flat_map(|y| half.from(0, y as isize)[..half.width].to_vec()).collect();
        assert_eq!(rows, bytes, "{width}x{height}");
    }
}

#[test]
fn a_blank_wall_and_places_outside_tell_nothing() {
    let wall = Canvas::seen(SIZE, &Homography::IDENTITY, |_, _| 120.0);
    let mut template = Template::default();
    let blank = pyramid(&wall.luma(), 13);
    template.take(&blank, Point2f::new(100.0, 75.0), 13, HALVINGS);
    assert_eq!(template.follow(&blank, Point2f::new(100.0, 75.0), PRECISION), None);
    let seen = pyramid(&picture((0.0, 0.0), 1).luma(), 13);
    for place in [-40.0, 1e9, f32::NAN, f32::INFINITY] {
        let place = Point2f::new(place, 75.0);
        template.take(&seen, place, 13, HALVINGS);
        assert_eq!(template.follow(&seen, place, PRECISION), None, "{place:?}");
        template.take(&seen, Point2f::new(100.0, 75.0), 13, HALVINGS);
        assert_eq!(template.follow(&seen, place, PRECISION), None, "{place:?}");
    }
    assert_eq!(template.follow(&Pyramid::default(), Point2f::new(100.0, 75.0), PRECISION), None);
}
