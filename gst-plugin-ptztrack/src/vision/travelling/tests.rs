// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::{Homography, Point, Rect};

use super::model::{Model, UNKNOWN};
use super::warp::Warp;
use super::{TravellingBackground, Way};
use crate::vision::picture::{Picture, Reduced};
use crate::vision::synthetic::{Canvas, texture};

const SIZE: (usize, usize) = (160, 120);
const STEP: Duration = Duration::from_millis(40);
const PERSON: (f64, f64, f64, f64) = (70.0, 30.0, 20.0, 60.0);

/// The world seen by a camera that has moved by (`x`, `y`) pixels.
fn seen(x: f64, y: f64, seed: u32) -> Canvas {
    Canvas::seen(SIZE, &Homography::translation(x, y), room).noisy(2.0, seed)
}

/// A light room of half the texture's contrast.
fn room(x: f64, y: f64) -> f64 {
    80.0 + 0.5 * texture(1, x, y)
}

fn with_person(mut picture: Canvas, (x, y, width, height): (f64, f64, f64, f64)) -> Canvas {
    picture.paint((x, y, width, height), |u, v| 20.0 + 0.2 * texture(5, u, v));
    picture
}

fn normalised((x, y, width, height): (f64, f64, f64, f64)) -> Rect {
    let size = (SIZE.0 as f64, SIZE.1 as f64);
    Rect { x: x / size.0, y: y / size.1, width: width / size.0, height: height / size.1 }
}

fn look(background: &mut TravellingBackground, picture: &Canvas, shift: Option<(f64, f64)>) {
    let mut reduced = Reduced::default();
    reduced.fill(&Picture { luma: picture.luma(), chroma: None }, SIZE);
    let motion = shift.map(|(x, y)| Homography::translation(x / SIZE.0 as f64, y / SIZE.1 as f64));
    background
        .update(&reduced, motion.as_ref(), if motion.is_none() { Way::Unknown } else { Way::Known }, STEP)
        .expect("OpenCV");
}

/// One that has seen the empty room for a second.
fn learned() -> TravellingBackground {
    let mut background = TravellingBackground::default();
    for seed in 0..25 {
        look(&mut background, &seen(0.0, 0.0, seed), Some((0.0, 0.0)));
    }
    background
}

/// A plain wall with dark things before it, `x` pixels to the left of where they were at first.
fn furnished(x: f64, seed: u32) -> Canvas {
    let wall = |x: f64, y: f64| if texture(3, x, y) > 175.0 { 40.0 } else { 120.0 };
    Canvas::seen(SIZE, &Homography::translation(-x, 0.0), wall).noisy(2.0, seed)
}

/// Which part of `picture` is foreground to one that has seen the furnished room for a second, where 6 pixels of a turn were measured.
fn changed_by(picture: &Canvas, way: Way) -> f64 {
    let mut background = TravellingBackground::default();
    (0..25).for_each(|seed| look(&mut background, &furnished(0.0, seed), Some((0.0, 0.0))));
    let mut reduced = Reduced::default();
    reduced.fill(&Picture { luma: picture.luma(), chroma: None }, SIZE);
    let measured = Homography::translation(-6.0 / SIZE.0 as f64, 0.0);
    background.update(&reduced, Some(&measured), way, STEP).expect("OpenCV");
    foreground(&background, ALL)
}

#[test]
fn a_picture_whose_way_was_lost_is_laid_where_it_fits() {
    let lost = furnished(36.0, 30);
    assert!(changed_by(&lost, Way::Lost) < 0.05, "30 pixels more");
    assert!(changed_by(&lost, Way::Known) > 0.1, "its motion is known");
}

#[test]
fn somebody_large_moves_no_picture() {
    let picture = with_person(furnished(6.0, 30), (100.0, 10.0, 40.0, 100.0));
    assert!((changed_by(&picture, Way::Lost) - changed_by(&picture, Way::Known)).abs() < 0.01);
    assert!(changed_by(&picture, Way::Lost) > 0.1);
}

/// Where people were learned before a plain wall and have gone, they alone tell of a place: it is where they were.
#[test]
fn who_walks_before_a_plain_wall_moves_no_picture() {
    for people in [&[(20.0, 25.0)][..], &[(20.0, 45.0)]] {
        let seen = |off: f64, seed: u32| {
            people.iter().fold(
                Canvas::seen(SIZE, &Homography::IDENTITY, |_, _| 120.0).noisy(2.0, seed),
                |wall, (x, width)| with_person(wall, (x + off, 30.0, *width, 60.0)),
            )
        };
        let told = |way: Way| {
            let mut background = TravellingBackground::default();
            (0..25).for_each(|seed| look(&mut background, &seen(0.0, seed), Some((0.0, 0.0))));
            let mut reduced = Reduced::default();
            reduced.fill(&Picture { luma: seen(24.0, 30).luma(), chroma: None }, SIZE);
            background.update(&reduced, Some(&Homography::IDENTITY), way, STEP).expect("OpenCV");
            foreground(&background, ALL)
        };
        assert_eq!(told(Way::Lost), told(Way::Known), "{people:?}");
        assert!(told(Way::Lost) > 0.05, "{people:?}");
    }
}

/// Which part of a box is more likely foreground than not.
fn foreground(background: &TravellingBackground, (x, y, width, height): (f64, f64, f64, f64)) -> f64 {
    let likelihood = background.foreground().expect("seen");
    let part = likelihood.crop(x as usize, y as usize, width as usize, height as usize);
    let count = (0..part.height()).flat_map(|y| part.row(y)).filter(|value| **value > 128).count();
    count as f64 / (part.width() * part.height()) as f64
}

const ALL: (f64, f64, f64, f64) = (0.0, 0.0, 160.0, 120.0);

#[test]
fn an_empty_room_at_rest_is_background() {
    let mut background = learned();
    look(&mut background, &seen(0.0, 0.0, 99), Some((0.0, 0.0)));
    assert!(foreground(&background, ALL) < 0.005, "{}", foreground(&background, ALL));
}

#[test]
fn somebody_is_foreground_and_leaves_no_trail() {
    let mut background = learned();
    for step in 0..20 {
        let person = (20.0 + 4.0 * f64::from(step), 30.0, 20.0, 60.0);
        look(&mut background, &with_person(seen(0.0, 0.0, step), person), Some((0.0, 0.0)));
        assert!(foreground(&background, person) > 0.85, "{step}");
        assert!(foreground(&background, ALL) < 1.1 * 20.0 * 60.0 / (160.0 * 120.0), "{step}");
    }
}

#[test]
fn a_turning_camera_tells_somebody_from_the_room() {
    let mut background = learned();
    // They stay where they are in the picture: the camera follows.
    for step in 1..40 {
        let at = -3.3 * f64::from(step);
        look(&mut background, &with_person(seen(at, 0.0, step as u32), PERSON), Some((-3.3, 0.0)));
        let person = foreground(&background, PERSON);
        let beside = foreground(&background, (0.0, 0.0, 60.0, 120.0));
        assert!(person > 0.6 && beside < 0.03, "{step}: {person} {beside}");
    }
}

#[test]
fn who_was_foreground_is_so_on_a_canvas_that_was_laid_anew() {
    let size = (96, 64);
    let mut model = Model::new(size);
    model.likelihood.fill(0);
    model.likelihood[30 * size.0 + 50] = 200;
    let mut warp = Warp::default();
    warp.prepare(size, size, &Homography::translation(10.0, 0.0));
    model.carry(&warp).expect("OpenCV");
    let likelihood = [40, 50, 90].map(|x| model.likelihood[30 * size.0 + x]);
    assert_eq!(likelihood, [200, 0, UNKNOWN]);
}

/// A floor of tiles, which is the hardest to lay a picture on.
fn tiles(x: f64, y: f64) -> f64 {
    let (across, down) = ((x / 9.0 + y / 31.0).sin(), (y / 8.0 - x / 27.0).sin());
    100.0 + 40.0 * (6.0 * across * down).clamp(-1.0, 1.0)
}

/// The tiled floor by a camera that turns for so many pictures and follows somebody as tiled, but so many grey levels lighter; it is measured
/// wrong by a tenth of a pixel and more each time. How much of them is foreground, and of the floor beside them.
fn seen_before_tiles(levels: f64) -> (f64, f64) {
    let mut background = TravellingBackground::default();
    let seen = |at: f64, seed: u32| {
        let mut picture = Canvas::seen(SIZE, &Homography::translation(at, 0.0), tiles);
        picture.paint(PERSON, |u, v| tiles(PERSON.0 + u - at, PERSON.1 + v) + levels);
        picture.noisy(1.25, seed)
    };
    let empty = |seed| Canvas::seen(SIZE, &Homography::IDENTITY, tiles).noisy(1.25, seed);
    (0..50).for_each(|seed| look(&mut background, &empty(seed), Some((0.0, 0.0))));
    let turn = -2.3;
    let (mut person, mut beside) = (0.0, 0.0);
    for step in 1..=30_u32 {
        background.protect(Some(normalised(PERSON)));
        look(&mut background, &seen(turn * f64::from(step), 100 + step), Some((turn + 0.12, 0.08)));
        if step > 20 {
            person += foreground(&background, PERSON) / 10.0;
            beside += foreground(&background, (0.0, 0.0, 60.0, 120.0)) / 10.0;
        }
    }
    (person, beside)
}

#[test]
fn errors_of_a_measured_motion_do_not_add_up() {
    let (person, beside) = seen_before_tiles(0.0);
    assert!(person < 0.05 && beside < 0.02, "{person} {beside}");
}

#[test]
fn who_is_as_faint_as_noise_is_foreground_before_a_tiled_floor_while_the_camera_turns() {
    let (person, beside) = seen_before_tiles(5.0);
    assert!(person > 0.6 && beside < 0.02, "{person} {beside}");
}

#[test]
fn a_new_border_is_unknown_and_then_known() {
    let mut background = learned();
    look(&mut background, &seen(-10.0, 0.0, 1), Some((-10.0, 0.0)));
    let border = |background: &TravellingBackground| {
        let likelihood = background.foreground().expect("seen");
        likelihood.row(60)[154..158].iter().map(|value| u32::from(*value)).sum::<u32>() / 4
    };
    assert!((100..=140).contains(&border(&background)), "{}", border(&background));
    for seed in 2..10 {
        look(&mut background, &seen(-10.0, 0.0, seed), Some((0.0, 0.0)));
    }
    assert!(border(&background) < 60, "{}", border(&background));
}

#[test]
fn what_stands_becomes_background_unless_it_is_protected() {
    let stands = |protected: bool| {
        let mut background = learned();
        for seed in 0..250 {
            background.protect(protected.then_some(normalised(PERSON)));
            look(&mut background, &with_person(seen(0.0, 0.0, seed), PERSON), Some((0.0, 0.0)));
        }
        foreground(&background, (74.0, 34.0, 12.0, 52.0))
    };
    assert!(stands(false) < 0.1);
    assert!(stands(true) > 0.8);
}

#[test]
fn lights_switched_off_are_no_motion() {
    let mut background = learned();
    let dark = |seed| Canvas::seen(SIZE, &Homography::IDENTITY, |x, y| 0.4 * room(x, y)).noisy(2.0, seed);
    for seed in 0..10 {
        look(&mut background, &dark(seed), Some((0.0, 0.0)));
        assert!(foreground(&background, ALL) < 0.02);
    }
}

#[test]
fn somebody_is_seen_while_lights_are_switched_and_the_rest_stays_known() {
    let mut background = learned();
    for (step, light) in [0.6, 0.6, 1.2, 0.8].into_iter().enumerate() {
        let lit =
            Canvas::seen(SIZE, &Homography::IDENTITY, |x, y| light * room(x, y)).noisy(2.0, step as u32);
        look(&mut background, &with_person(lit, PERSON), Some((0.0, 0.0)));
        let (person, beside) =
            (foreground(&background, PERSON), foreground(&background, (0.0, 0.0, 60.0, 120.0)));
        assert!(person > 0.7 && beside < 0.03, "{light}: {person} {beside}");
        let known = background.foreground().expect("seen").row(60)[10];
        assert!(known < 128, "{light}: {known}");
    }
}

#[test]
fn an_unknown_motion_is_rest_where_the_picture_says_so_and_a_new_world_where_not() {
    let mut background = learned();
    look(&mut background, &with_person(seen(0.0, 0.0, 50), PERSON), None);
    assert!(foreground(&background, PERSON) > 0.85);
    let elsewhere = Canvas::seen(SIZE, &Homography::IDENTITY, |x, y| 0.5 * texture(77, x, y));
    look(&mut background, &elsewhere, None);
    assert!(background.foreground().expect("seen").bytes().iter().all(|value| *value == 128));
}

#[test]
fn another_view_of_little_contrast_is_a_new_world_too() {
    let wall =
        |seed| Canvas::seen(SIZE, &Homography::IDENTITY, move |x, y| 80.0 + 0.12 * texture(seed, x, y));
    let mut background = TravellingBackground::default();
    for seed in 0..25 {
        look(&mut background, &wall(1).noisy(2.0, seed), Some((0.0, 0.0)));
    }
    look(&mut background, &wall(77).noisy(2.0, 30), None);
    assert!(background.foreground().expect("seen").bytes().iter().all(|value| *value == 128));
}

#[test]
fn what_somebody_left_becomes_background_at_once_where_nobody_is() {
    let mut background = TravellingBackground::default();
    for seed in 0..25 {
        look(&mut background, &with_person(seen(0.0, 0.0, seed), PERSON), Some((0.0, 0.0)));
    }
    let bounds = normalised(PERSON);
    for seed in 25..40 {
        background.protect(Some(bounds));
        look(&mut background, &seen(0.0, 0.0, seed), Some((0.0, 0.0)));
    }
    assert!(foreground(&background, PERSON) > 0.7, "a ghost");
    let (right, bottom) = (bounds.x + bounds.width, bounds.y + bounds.height);
    let contour = [(bounds.x, bounds.y), (bounds.x, bottom), (right, bottom), (right, bounds.y)];
    background.adopt(&contour.map(|(x, y)| Point { x, y })).expect("adopted");
    look(&mut background, &seen(0.0, 0.0, 41), Some((0.0, 0.0)));
    assert!(foreground(&background, PERSON) < 0.15, "{}", foreground(&background, PERSON));
}

#[test]
fn who_stands_before_a_new_border_is_not_its_background() {
    let left_behind = |protected: bool| {
        let mut background = learned();
        let person = (148.0, 30.0, 12.0, 60.0);
        for step in 1..=6_u32 {
            background.protect(protected.then_some(normalised(person)));
            let at = -4.0 * f64::from(step);
            look(&mut background, &with_person(seen(at, 0.0, step), person), Some((-4.0, 0.0)));
        }
        look(&mut background, &seen(-24.0, 0.0, 7), Some((0.0, 0.0)));
        foreground(&background, person)
    };
    assert!(left_behind(false) > 0.3, "{}", left_behind(false));
    assert!(left_behind(true) < 0.1, "{}", left_behind(true));
}

#[test]
fn a_burned_in_clock_is_no_mover_and_the_target_stays_one() {
    const CLOCK: (f64, f64, f64, f64) = (8.0, 8.0, 30.0, 9.0);
    let mut background = learned();
    let mut turned = |steps: std::ops::Range<u32>| {
        for step in steps {
            let at = -3.3 * f64::from(step);
            let mut picture = with_person(seen(at, 0.0, step), PERSON);
            picture.paint(CLOCK, |u, _| if (u as u32).is_multiple_of(4) { 240.0 } else { 20.0 });
            background.protect(Some(normalised(PERSON)));
            look(&mut background, &picture, Some((-3.3, 0.0)));
        }
        (foreground(&background, CLOCK), foreground(&background, PERSON))
    };
    let (clock, person) = turned(1..20);
    assert!(clock > 0.4 && person > 0.6, "{clock} {person}");
    let (clock, person) = turned(20..70);
    assert!(clock < 0.05 && person > 0.6, "{clock} {person}");
}

/// Left, top, width, height in pixels.
type Bounds = (f64, f64, f64, f64);

/// A plain wall of that lightness, with people before it who differ by so many grey levels, in the noise of little light (2.5 grey
/// levels) that is left in a picture reduced by two.
fn plain(lightness: f64, people: &[(Bounds, f64)], seed: u32) -> Canvas {
    let mut picture = Canvas::seen(SIZE, &Homography::translation(0.0, 0.0), |_, _| lightness);
    for &(bounds, off) in people {
        picture.paint(bounds, |_, _| lightness + off);
    }
    picture.noisy(1.25, seed)
}

/// One that has seen the empty wall for two seconds.
fn learned_plain() -> TravellingBackground {
    let mut background = TravellingBackground::default();
    for seed in 0..50 {
        look(&mut background, &plain(100.0, &[], seed), Some((0.0, 0.0)));
    }
    background
}

#[test]
fn somebody_fainter_than_the_noise_is_foreground() {
    let mut background = learned_plain();
    for step in 0..20 {
        let person = (20.0 + 4.0 * f64::from(step), 30.0, 20.0, 60.0);
        look(&mut background, &plain(100.0, &[(person, 4.0)], 100 + step), Some((0.0, 0.0)));
        let (inside, all) = (foreground(&background, person), foreground(&background, ALL));
        assert!(inside > 0.85 && all < 1.4 * 20.0 * 60.0 / (160.0 * 120.0), "{step}: {inside} {all}");
    }
}

/// A coat of fine checks, lighter and darker than the wall by as much, of which cells of pixels tell nothing: how much of it is foreground,
/// where that box is the target's.
fn seen_of_checks(target: Option<Bounds>) -> f64 {
    let mut background = learned_plain();
    let mut picture = plain(100.0, &[], 100);
    let is_light = |u: f64, v: f64| (u as usize + v as usize).is_multiple_of(2);
    picture.paint(PERSON, |u, v| if is_light(u, v) { 118.0 } else { 82.0 });
    background.protect(target.map(normalised));
    look(&mut background, &picture, Some((0.0, 0.0)));
    foreground(&background, PERSON)
}

#[test]
fn where_the_target_is_less_is_enough_for_foreground() {
    let (anywhere, expected) = (seen_of_checks(None), seen_of_checks(Some(PERSON)));
    assert!(anywhere < 0.3 && expected > 0.7, "{anywhere} {expected}");
    assert_eq!(seen_of_checks(Some((0.0, 0.0, 20.0, 20.0))), anywhere, "elsewhere");
}

#[test]
fn where_the_target_was_an_empty_room_is_background_and_the_unknown_stays_so() {
    let mut background = learned();
    background.protect(Some(normalised(ALL)));
    look(&mut background, &seen(-10.0, 0.0, 99), Some((-10.0, 0.0)));
    assert!(foreground(&background, (0.0, 0.0, 140.0, 120.0)) < 0.01);
    assert!(foreground(&background, (152.0, 0.0, 6.0, 120.0)) < 0.01);
}

#[test]
fn light_that_changes_by_little_is_nobody() {
    let mut background = learned_plain();
    for seed in 100..110 {
        look(&mut background, &plain(103.0, &[], seed), Some((0.0, 0.0)));
        assert!(foreground(&background, ALL) < 0.005, "{}", foreground(&background, ALL));
    }
}

#[test]
fn a_faint_shadow_beside_somebody_is_no_part_of_them() {
    let mut background = learned_plain();
    let shadow = (70.0, 80.0, 50.0, 10.0);
    look(&mut background, &plain(100.0, &[(PERSON, 60.0), (shadow, -5.0)], 99), Some((0.0, 0.0)));
    assert!(foreground(&background, PERSON) > 0.75, "{}", foreground(&background, PERSON));
    let beyond = foreground(&background, (96.0, 80.0, 24.0, 10.0));
    assert!(beyond < 0.05, "{beyond}");
}

#[test]
fn where_light_has_changed_the_background_changes_but_for_what_is_protected() {
    let (left, right) = ((10.0, 30.0, 40.0, 60.0), (110.0, 30.0, 40.0, 60.0));
    let mut background = learned();
    let mut lit = seen(0.0, 0.0, 77);
    for (x, y, width, height) in [left, right] {
        for row in y as usize..(y + height) as usize {
            for pixel in &mut lit.pixels[row * SIZE.0..][x as usize..(x + width) as usize] {
                *pixel /= 2;
            }
        }
    }
    background.protect(Some(normalised(right)));
    look(&mut background, &lit, Some((0.0, 0.0)));
    let inner = |(x, y, width, height): (f64, f64, f64, f64)| (x + 8.0, y + 8.0, width - 16.0, height - 16.0);
    let (before, held) = (foreground(&background, inner(left)), foreground(&background, inner(right)));
    assert!(before > 0.6 && held > 0.6, "{before} {held}");
    for bounds in [left, right] {
        let Rect { x, y, width, height } = normalised(bounds);
        let corners = [(x, y), (x, y + height), (x + width, y + height), (x + width, y)];
        background.relight(&corners.map(|(x, y)| Point { x, y })).unwrap();
    }
    look(&mut background, &lit, Some((0.0, 0.0)));
    let (now, held) = (foreground(&background, inner(left)), foreground(&background, inner(right)));
    assert!(now < 0.1 && held > 0.6, "{now} {held}");
}
