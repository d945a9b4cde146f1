// SPDX-License-Identifier: MPL-2.0

//! Whether the camera knows what is in its pictures.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::settings;
use virtual_camera::{
    Bounds, Clock, Picture, Pose, Settings, SyntheticSettings, VirtualCamera, Waypoint, World,
};

const SIZE: (u32, u32) = (640, 480);

/// A camera with that pose and with somebody who stands there, or with nobody.
fn camera(home: Pose, person: Option<(f64, f64)>) -> VirtualCamera {
    let here = |(pan_deg, tilt_deg)| Waypoint { time: Duration::ZERO, pan_deg, tilt_deg };
    let path = person.map(here).into_iter().collect();
    let world = SyntheticSettings { path, stays: true, ..SyntheticSettings::default() };
    let settings =
        Settings { world: World::Synthetic(world), home: Some(home), clock: Clock::Stepped, ..settings() };
    VirtualCamera::start(settings).unwrap()
}

/// The box around everything that differs.
fn difference(a: &Picture, b: &Picture) -> Option<Bounds> {
    let (a, b) = (&a.planes[0], &b.planes[0]);
    let changed = (0..a.data.len()).filter(|&index| a.data[index].abs_diff(b.data[index]) > 12);
    let place = |index: usize| ((index % a.width) as f64, (index / a.width) as f64);
    Bounds::around(changed.map(place).flat_map(|(x, y)| [(x, y), (x + 1.0, y + 1.0)]))
}

#[test]
fn the_person_is_where_the_truth_says() {
    for (pan_deg, tilt_deg, zoom_step, person) in [
        (0.0, 0.0, 1.0, (0.0, 0.0)),
        (-8.0, 5.0, 1.0, (-12.0, 2.0)),
        (15.0, -6.0, 800.0, (12.0, -5.0)),
        // Only a part is inside.
        (0.0, 0.0, 1.0, (17.5, -2.0)),
    ] {
        let pose = Pose { pan_deg, tilt_deg, zoom_step };
        let (with, without) = (camera(pose, Some(person)), camera(pose, None));
        assert_eq!(with.home(), pose);
        let pictures = [&with, &without].map(|camera| camera.picture(Duration::ZERO, SIZE).unwrap());
        let truth = with.ground_truth(Duration::ZERO, SIZE);
        assert_eq!((truth.len(), without.ground_truth(Duration::ZERO, SIZE).len()), (1, 0));
        let (truth, seen) = (&truth[0], difference(&pictures[0], &pictures[1]).unwrap());
        let told = truth.bounds;
        let inside = |place: f64, length: u32| place.clamp(0.0, f64::from(length));
        for (told, seen) in [
            (inside(told.left, SIZE.0), seen.left),
            (inside(told.top, SIZE.1), seen.top),
            (inside(told.left + told.width, SIZE.0), seen.left + seen.width),
            (inside(told.top + told.height, SIZE.1), seen.top + seen.height),
        ] {
            // The world's pixels are twice as large as the view's, or more.
            assert!((told - seen).abs() < 5.0, "{pose:?}: {truth:?} but {seen:?}");
        }
        assert_eq!((truth.id, truth.unhidden, truth.position_m), (1, 1.0, None));
        assert_eq!((truth.visible, truth.visible), (truth.in_view, told.part_inside(SIZE)));
        assert_eq!(truth.in_view < 1.0, person.0 > 17.0);
        let direction = truth.direction_deg.unwrap();
        assert!(
            (direction.0 - person.0).abs() < 0.1 && (direction.1 - person.1).abs() < 0.1,
            "{direction:?}"
        );
        assert!(with.silhouette(Duration::ZERO, SIZE).is_none());
    }
}

#[test]
fn turning_there_brings_the_person_into_the_middle() {
    let pose = Pose { pan_deg: -4.0, tilt_deg: 3.0, zoom_step: 1.0 };
    let truth = camera(pose, Some((9.0, -2.0))).ground_truth(Duration::ZERO, SIZE);
    let (pan_deg, tilt_deg) = truth[0].direction_deg.unwrap();
    let there = Pose { pan_deg, tilt_deg, ..pose };
    let truth = camera(there, Some((9.0, -2.0))).ground_truth(Duration::ZERO, SIZE);
    let (x, y) = truth[0].centroid;
    assert!((x - 320.0).abs() < 1.0 && (y - 240.0).abs() < 1.0, "{x} {y}");
}
