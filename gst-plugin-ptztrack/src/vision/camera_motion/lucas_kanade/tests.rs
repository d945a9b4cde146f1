// SPDX-License-Identifier: MPL-2.0

use opencv::core::{Mat, Point2f, Size, TermCriteria, TermCriteria_COUNT, TermCriteria_EPS, Vector};
use opencv::prelude::*;
use opencv::video;
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
    pyramid.fill(luma, side, HALVINGS);
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
        template.take(&from, place, side);
        template.follow(&to, place, PRECISION)
    };
    places().into_iter().map(follow).collect()
}

/// The same by OpenCV.
fn by_opencv(from: &Canvas, to: &Canvas, side: usize) -> Vec<Option<Found>> {
    let starts: Vector<Point2f> = places().into_iter().collect();
    let (mut ends, mut status, mut residuals) = (Vector::new(), Vector::<u8>::new(), Vector::<f32>::new());
    let whole = |canvas: &Canvas| canvas.luma().with_mat(|mat| mat.try_clone()).expect("a picture");
    video::calc_optical_flow_pyr_lk(
        &whole(from),
        &whole(to),
        &starts,
        &mut ends,
        &mut status,
        &mut residuals,
        Size::new(side as i32, side as i32),
        HALVINGS as i32,
        TermCriteria {
            typ: TermCriteria_COUNT | TermCriteria_EPS,
            max_count: PRECISION.steps as i32,
            epsilon: f64::from(PRECISION.step),
        },
        0,
        1e-4,
    )
    .expect("OpenCV");
    let found = ends.iter().zip(status.iter().zip(residuals.iter()));
    found.map(|(place, (found, residual))| (found != 0).then_some(Found { place, residual })).collect()
}

fn apart(a: Point2f, b: Point2f) -> f32 {
    (a.x - b.x).hypot(a.y - b.y)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Where OpenCV finds a point well, it is found at the same place, and as well.
    #[test]
    fn points_are_found_where_opencv_finds_them(
        dx in -9.0..9.0, dy in -9.0..9.0, side in (4_usize..13).prop_map(|half| 2 * half + 1), seed in any::<u32>(),
    ) {
        let (from, to) = (picture((0.0, 0.0), seed), picture((dx, dy), seed ^ 1));
        // Of the gradient in the last pixels OpenCV knows less.
        let is_inside = |place: &Point2f| place.x < SIZE.0 as f32 - 2.0 && place.y < SIZE.1 as f32 - 2.0;
        let inside: Vec<bool> = places().iter().map(is_inside).collect();
        let pairs = followed(&from, &to, side).into_iter().zip(by_opencv(&from, &to, side));
        let pairs = pairs.zip(inside).filter_map(|(pair, inside)| inside.then_some(pair));
        let well: Vec<_> = pairs.filter(|(_, theirs)| theirs.is_some_and(|found| found.residual < 3.0)).collect();
        prop_assert!(well.len() > 80, "{}", well.len());
        let same = |(ours, theirs): &&(Option<Found>, Option<Found>)| {
            ours.zip(*theirs).is_some_and(|(ours, theirs)| {
                apart(ours.place, theirs.place) < 0.05 && (ours.residual - theirs.residual).abs() < 0.1
            })
        };
        let agreeing = well.iter().filter(same).count();
        prop_assert!(agreeing * 100 >= well.len() * 95, "{agreeing} of {}", well.len());
    }
}

#[test]
fn halvings_are_those_of_opencv() {
    let canvas = picture((0.0, 0.0), 3);
    for (width, height) in [(200, 150), (97, 61), (6, 5)] {
        let luma = canvas.luma().crop(1, 1, width, height);
        let mut pyramid = Pyramid::default();
        pyramid.fill(&luma, 1, 1);
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
    template.take(&blank, Point2f::new(100.0, 75.0), 13);
    assert_eq!(template.follow(&blank, Point2f::new(100.0, 75.0), PRECISION), None);
    let seen = pyramid(&picture((0.0, 0.0), 1).luma(), 13);
    for place in [-40.0, 1e9, f32::NAN, f32::INFINITY] {
        let place = Point2f::new(place, 75.0);
        template.take(&seen, place, 13);
        assert_eq!(template.follow(&seen, place, PRECISION), None, "{place:?}");
        template.take(&seen, Point2f::new(100.0, 75.0), 13);
        assert_eq!(template.follow(&seen, place, PRECISION), None, "{place:?}");
    }
    assert_eq!(template.follow(&Pyramid::default(), Point2f::new(100.0, 75.0), PRECISION), None);
}
