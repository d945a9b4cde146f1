// SPDX-License-Identifier: MPL-2.0

use super::*;
use crate::{
    geometry::Pinhole,
    kinematics::Pose,
    world::room::view::{CAMERA, add},
};

fn view(pan_deg: f64, tilt_deg: f64, fov_deg: f64) -> View {
    let pose = Pose { pan_deg, tilt_deg, ..Pose::default() };
    View::new(&pose, Pinhole::new(320, 240, fov_deg), (320, 240))
}

fn picture(scene: &Scene, view: &View) -> Canvas {
    let mut canvas = Canvas::grey(320, 240, 0);
    scene.draw_shell(view, &mut canvas);
    scene.draw_pieces(0.0, view, &mut canvas);
    canvas
}

fn scene(seed: u64, obstacles: &[(Obstacle, Solid)]) -> Scene {
    Scene::new(&plan(seed, obstacles, &[]))
}

fn plan(seed: u64, obstacles: &[(Obstacle, Solid)], events: &[Event]) -> Plan {
    let (obstacles, events) = (obstacles.to_vec(), events.to_vec());
    Plan { seed, place: Place::Hall, sun: [0.0, 1.0, 0.0], obstacles, events, trodden: Vec::new() }
}

fn spread(plane: &Plane) -> f64 {
    let mean = plane.data.iter().map(|&pixel| f64::from(pixel)).sum::<f64>() / plane.data.len() as f64;
    let sum: f64 = plane.data.iter().map(|&pixel| (f64::from(pixel) - mean).powi(2)).sum();
    (sum / plane.data.len() as f64).sqrt()
}

/// A room that is lit, and whose floor is free.
const DAY: u64 = 2;
const SCREEN: (Obstacle, Solid) =
    (Obstacle::Screen, Solid { base: [0.5, 0.0, 4.0], size: [1.6, 2.2, 0.3], yaw_deg: 0.0 });

#[test]
fn rooms_of_one_plan_share_their_scene() {
    let scene = Scene::of(plan(1, &[SCREEN], &[]));
    assert!(Arc::ptr_eq(&scene, &Scene::of(plan(1, &[SCREEN], &[]))));
    let others = [plan(2, &[SCREEN], &[]), plan(1, &[], &[]), plan(1, &[SCREEN], &[Event::Door])];
    assert!(others.into_iter().all(|other| !Arc::ptr_eq(&scene, &Scene::of(other))));
}

#[test]
fn a_seed_is_a_room() {
    let (room, again, other) = (scene(1, &[]), scene(1, &[]), scene(2, &[]));
    for pan in [-40.0, 0.0, 40.0] {
        let view = view(pan, -10.0, 55.0);
        assert_eq!(picture(&room, &view), picture(&again, &view));
        assert_ne!(picture(&room, &view), picture(&other, &view));
    }
}

#[test]
fn there_is_a_wall_everywhere() {
    let room = scene(DAY, &[SCREEN]);
    for (pan, tilt, fov) in [(0.0, 20.0, 55.0), (90.0, -80.0, 55.0), (180.0, -5.0, 40.0), (-133.0, 0.0, 3.0)]
    {
        let picture = picture(&room, &view(pan, tilt, fov));
        assert!(picture.planes[0].data.iter().all(|&pixel| pixel > 4), "a hole at {pan} {tilt} {fov}");
    }
}

#[test]
fn things_are_where_they_stand() {
    let (empty, screened) = (scene(DAY, &[]), scene(DAY, &[SCREEN]));
    let solid = SCREEN.1;
    for view in [view(5.0, -12.0, 40.0), view(-3.0, -20.0, 55.0), view(-5.0, -10.0, 25.0)] {
        let (before, after) = (picture(&empty, &view), picture(&screened, &view));
        let changed = |place: [f64; 3]| {
            let ((x, y), _) = view.pixel(solid.place(place[0], place[1], place[2])).unwrap();
            let at = y.round() as usize * 320 + x.round() as usize;
            before.planes[0].data[at].abs_diff(after.planes[0].data[at]) > 6
        };
        // Just inside of its left edge, and well outside where not even its shadow falls.
        assert!(changed([-0.97, 0.8, 1.0]) && changed([-0.97, 0.6, 1.0]));
        assert!(!changed([-1.7, 0.8, 1.0]) && !changed([-1.7, 0.9, 1.0]));
    }
}

#[test]
fn close_up_there_is_something_to_hold_on_to() {
    for seed in (1..5).filter(|seed| !Style::of(*seed).night) {
        let room = scene(seed, &[]);
        for (pan, tilt) in [(-20.0, -30.0), (12.0, -28.0), (0.0, -24.0)] {
            let spread = spread(&picture(&room, &view(pan, tilt, 3.0)).planes[0]);
            assert!(spread > 2.0, "seed {seed}, {pan} {tilt}: {spread}");
        }
    }
}

#[test]
fn a_screen_hides_who_is_behind_it_and_nobody_else() {
    let room = scene(1, &[SCREEN]);
    let view = view(5.0, -20.0, 55.0);
    let left = |feet: [f64; 3]| {
        let mut mask = Plane::filled(320, 240, 0);
        let mut figure = Vec::new();
        for (right, up) in [(-0.2, 0.1), (0.2, 0.1), (-0.2, 1.7), (0.2, 1.7)] {
            let ((x, y), _) = view.pixel(add(feet, [right, up, 0.0])).unwrap();
            figure.push((x.round() as usize, y.round() as usize));
        }
        for &(x, y) in &figure {
            mask.data[y * 320 + x] = 255;
        }
        room.hide(feet, 0.0, &view, &mut mask);
        figure.iter().filter(|&&(x, y)| mask.data[y * 320 + x] == 255).count()
    };
    // Behind it on the line of sight through its middle, beside it, and in front of it.
    assert_eq!(left([0.75, 0.0, 6.0]), 0);
    assert_eq!(left([3.0, 0.0, 6.0]), 4);
    assert_eq!(left([0.4, 0.0, 3.3]), 4);
    // At its edge, one half of them is seen.
    let edge = (0.5 - 0.8) / 3.85 * 6.0;
    assert_eq!(left([edge, 0.0, 6.0]), 2);
}

#[test]
fn the_camera_is_inside_of_the_room_and_of_nothing_else() {
    for seed in 1..20 {
        let hall = Hall::new(Style::of(seed), &mut Seeded::new(seed).fork(2));
        for (out, distance) in hall.planes() {
            let inside = out[0] * CAMERA[0] + out[1] * CAMERA[1] + out[2] * CAMERA[2] - distance;
            assert!(inside > 0.5, "seed {seed}");
        }
    }
}

#[test]
fn what_fills_a_room_hides_nobody_on_the_way() {
    for seed in (1..10).filter(|seed| Style::of(*seed).full) {
        let room = scene(seed, &[]);
        for (x, z) in [(-7.5, 5.0), (-3.0, 5.0), (0.0, 5.1), (4.0, 6.0), (7.5, 6.9)] {
            let feet = [x, 0.0, z];
            let view = view(f64::atan2(x, z).to_degrees(), -16.0, 30.0);
            let mut mask = Plane::filled(320, 240, 255);
            room.hide(feet, 0.0, &view, &mut mask);
            for height in [0.05, 0.5, 1.8] {
                let ((column, row), _) = view.pixel(add(feet, [0.0, height, 0.0])).unwrap();
                assert_eq!(mask.data[row as usize * 320 + column as usize], 255, "seed {seed}: {feet:?}");
            }
        }
    }
}

#[test]
fn half_of_the_rooms_are_full_and_by_night_only_lamps_stand_out() {
    let bright = |seed: u64| {
        let picture = picture(&scene(seed, &[]), &view(0.0, -10.0, 55.0));
        let count = |least: u8| picture.planes[0].data.iter().filter(|pixel| **pixel >= least).count();
        (count(if Style::of(seed).night { 150 } else { 90 }), count(200))
    };
    let mut things = [0, 0];
    for seed in 1..11 {
        let style = Style::of(seed);
        things[usize::from(style.full)] += scene(seed, &[]).pieces.len();
        let (lit, glowing) = bright(seed);
        if style.night {
            assert!(lit < 320 * 240 / 20 && glowing > 20, "seed {seed}: {lit} {glowing}");
        } else {
            assert!(lit > 320 * 240 / 5, "seed {seed}: {lit}");
        }
    } // As many of the ones as of the others.
    assert!(things[1] > 3 * things[0] / 2, "{things:?}");
}

#[test]
fn what_moves_moves_and_nothing_else_does() {
    let picture = |scene: &Scene, time: f64| {
        let (view, mut canvas) = (view(0.0, -10.0, 55.0), Canvas::grey(320, 240, 0));
        scene.draw_shell(&view, &mut canvas);
        scene.draw_pieces(time, &view, &mut canvas);
        canvas
    };
    let still = scene(1, &[]);
    assert_eq!(picture(&still, 0.0), picture(&still, 60.0));
    for event in [Event::Door, Event::Film, Event::Draught] {
        let scene = Scene::new(&plan(1, &[], &[event]));
        let pictures: Vec<_> = (0..300).map(|second| picture(&scene, f64::from(second) * 0.7)).collect();
        assert!(pictures.windows(2).any(|pair| pair[0] != pair[1]), "{event:?}");
        assert_eq!(pictures[7], picture(&scene, 7.0 * 0.7), "{event:?}");
        let changed = |a: &Canvas, b: &Canvas| {
            a.planes[0].data.iter().zip(&b.planes[0].data).filter(|(a, b)| a.abs_diff(**b) > 20).count()
        };
        let most = pictures.iter().map(|other| changed(&pictures[0], other)).max().unwrap();
        assert!((100..12_000).contains(&most), "{event:?} {most}");
    }
}
