// SPDX-License-Identifier: MPL-2.0

use super::*;
use crate::{
    geometry::Pinhole,
    kinematics::Pose,
    picture::Plane,
    world::room::{
        light::{Light, Strength},
        settings::{Change, Lighting, Occlusion, Subject},
        view::{CAMERA, Vector, dot, subtract},
    },
};

const FRAME: f64 = 0.04;

fn tests(seed: u64) -> impl Iterator<Item = RoomSettings> {
    (1..=72).map(move |number| RoomSettings::test(number, seed).unwrap())
}

fn walker(number: u32, seed: u64) -> Walker {
    Walker::of_test(&RoomSettings::test(number, seed).unwrap())
}

fn looking(pose: &Pose, fov_deg: f64, size: (u32, u32)) -> View {
    View::new(pose, Pinhole::new(size.0, size.1, fov_deg), size)
}

/// A view with the person in the middle.
fn towards(place: Vector, fov_deg: f64, size: (u32, u32)) -> View {
    let away = place[0].hypot(place[2]);
    let pose = Pose {
        pan_deg: place[0].atan2(place[2]).to_degrees(),
        tilt_deg: (0.9 - CAMERA[1]).atan2(away).to_degrees(),
        ..Pose::default()
    };
    looking(&pose, fov_deg, size)
}

fn frames(walker: &Walker) -> impl Iterator<Item = f64> {
    let count = (walker.walk().duration() / FRAME) as u32;
    (0..count).map(|frame| f64::from(frame) * FRAME)
}

/// The person as they stand at a time, before what the canvas shows.
fn draw(walker: &Walker, time: f64, view: &View, canvas: &mut Canvas) {
    let layer = walker.layer(time, 0.0, &std::array::from_fn(|_| view.clone()), &lamps()).unwrap();
    let (width, height) = layer.view(view).size;
    layer.over(canvas, Plane::filled(width, height, 255), (0.0, 0.0));
}

fn lamps() -> Light {
    Light { lamps: vec![[-3.0, 3.2, 4.0], [3.0, 3.2, 4.0]], ..Light::even(Strength::DAY) }
}

#[test]
fn light_and_occlusion_change_nothing_else() {
    for plain in (1..=72).step_by(5).filter_map(|number| RoomSettings::test(number, 3)) {
        let twin = RoomSettings { lighting: Lighting::Optimal, occlusion: Occlusion::None, ..plain.clone() };
        let (plain, twin) = (Walker::of_test(&plain), Walker::of_test(&twin));
        for time in [0.0, 3.3, 6.1, 9.7] {
            assert_eq!(plain.walk().at(time), twin.walk().at(time));
            assert_eq!(plain.pose_at(time).place, twin.pose_at(time).place);
        }
    }
    assert_ne!(
        walker(1, 3).walk().at(4.0),
        walker(2, 3).walk().at(4.0),
        "each subject has a way of their own"
    );
}

#[test]
fn speed_and_acceleration_stay_human() {
    for settings in tests(1) {
        let walk = Walk::of_test(&settings);
        let step = 0.02;
        let place = |time: f64| {
            let now = walk.at(time);
            [now.x, 0.0, now.z]
        };
        let velocity = |time: f64| scale(subtract(place(time + step), place(time)), 1.0 / step);
        for count in 0..(walk.duration() / step) as u32 - 3 {
            let time = f64::from(count) * step;
            let now = velocity(time);
            let speed = dot(now, now).sqrt();
            assert!(speed < 2.21, "{settings:?} {time} {speed}");
            let change = subtract(velocity(time + step), now);
            let acceleration = dot(change, change).sqrt() / step;
            let turns = settings.direction == Change::Variable;
            let bound = if time < 2.0 {
                1.85
            } else if turns {
                3.2
            } else {
                1.05
            };
            assert!(acceleration < bound, "{settings:?} {time} {acceleration}");
        }
    }
}

#[test]
fn fixed_speed_is_the_same_all_the_way() {
    for settings in tests(2) {
        let walk = Walk::of_test(&settings);
        let speeds: Vec<f64> = (0..100)
            .map(|part| walk.at(2.0 + (walk.duration() - 2.0) * f64::from(part) / 100.0).speed)
            .collect();
        let (low, high) = speeds.iter().fold((9.0f64, 0.0f64), |(l, h), s| (l.min(*s), h.max(*s)));
        let turns = settings.direction == Change::Variable;
        if settings.speed == Change::Variable {
            assert!((high - 2.2).abs() < 0.02 && low < 0.82, "{settings:?} {low} {high}");
        } else {
            assert!((high - 1.4).abs() < 1e-9 && (turns || (low - 1.4).abs() < 1e-9), "{settings:?}");
        }
    }
}

#[test]
fn turning_round_takes_its_time_and_ends_the_other_way() {
    for settings in tests(1) {
        let walk = Walk::of_test(&settings);
        let (first, last) = (walk.at(0.0).heading, walk.at(walk.duration()).heading);
        let turning = (0..2000).filter(|&step| walk.at(f64::from(step) * 0.01).turning.abs() > 0.1).count()
            as f64
            * 0.01;
        if settings.direction == Change::Variable {
            assert!(((last - first).abs() - std::f64::consts::PI).abs() < 0.01, "{settings:?}");
            assert!((0.8..1.5).contains(&turning), "{settings:?} {turning}");
        } else {
            assert_eq!((last, turning), (first, 0.0));
        }
    }
}

#[test]
fn the_way_sweeps_more_than_a_quarter_circle_inside_the_hall() {
    for settings in (1..4).flat_map(tests) {
        let walk = Walk::of_test(&settings);
        assert!((9.0..18.0).contains(&walk.duration()), "{} {settings:?}", walk.duration());
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for step in 0..(walk.duration() * 25.0) as u32 {
            let now = walk.at(f64::from(step) * FRAME);
            assert!((5.0..7.0).contains(&now.z) && now.x.abs() < 8.0, "{settings:?} {now:?}");
            let pan = now.x.atan2(now.z).to_degrees();
            (low, high) = (low.min(pan), high.max(pan));
        }
        assert!(high - low > 90.0, "{settings:?} {low} {high}");
    }
}

#[test]
fn the_person_comes_in_at_different_heights_of_the_picture() {
    let middle = |settings: &RoomSettings| {
        let (now, view) = (Walk::new(settings).unwrap().at(2.4), looking(&settings.home(), 55.0, (640, 480)));
        view.pixel([now.x, 0.9, now.z]).unwrap().0.1
    };
    let middles: Vec<f64> = (1..8).flat_map(tests).step_by(5).map(|settings| middle(&settings)).collect();
    let (above, below) = (middles.iter().filter(|y| **y < 200.0), middles.iter().filter(|y| **y > 280.0));
    assert!(above.count() * 6 > middles.len() && below.count() * 6 > middles.len(), "{middles:?}");
}

#[test]
fn the_person_comes_into_the_first_view_at_two_seconds() {
    for settings in tests(1).step_by(11) {
        let walker = Walker::of_test(&settings);
        let view = looking(&settings.home(), 55.0, (640, 480));
        let part = |time: f64| {
            let [left, top, right, bottom] = walker.bounds(time, &view).unwrap();
            assert!(top > 0.0 && bottom < 480.0, "{settings:?}");
            ((right.min(640.0) - left.max(0.0)) / (right - left)).max(0.0)
        };
        let first = (0..200).map(|frame| f64::from(frame) * FRAME).find(|&time| part(time) > 0.0).unwrap();
        let whole = (0..200).map(|frame| f64::from(frame) * FRAME).find(|&time| part(time) > 0.999).unwrap();
        assert!((1.6..2.4).contains(&first), "{settings:?} {first}");
        assert!(whole > first && whole < first + 1.0, "{settings:?} {whole}");
        let [left, _, right, _] = walker.bounds(0.0, &view).unwrap();
        let beside = 640.0 * 3.0 / 55.0;
        assert!(right < -beside || left > 640.0 + beside, "{settings:?} {left} {right}");
    }
}

#[test]
fn standing_feet_do_not_slip_and_none_goes_through_the_floor() {
    for number in [1, 20, 39, 55] {
        let walker = walker(number, 1);
        let toe = |time: f64, side: usize| {
            let leg = walker.pose_at(time).legs[side];
            let ball = [0.0, -walker.build.ankle_height, walker.build.ball];
            let heel = [0.0, -walker.build.ankle_height, walker.build.heel];
            [ball, heel].map(|place| leg.foot.place(leg.ankle, place))
        };
        for time in frames(&walker) {
            let mut standing = 0;
            for side in 0..2 {
                let (now, next) = (toe(time, side), toe(time + 0.01, side));
                assert!(now.iter().all(|place| place[1] > -1e-6), "{number} {time} {now:?}");
                let slips = |index: usize| {
                    let way = subtract(next[index], now[index]);
                    now[index][1] < 1e-6 && next[index][1] < 1e-6 && way[0].hypot(way[2]) > 1e-4
                };
                assert!(!slips(0) && !slips(1), "{number} {time} {side}");
                standing += usize::from(now.iter().any(|place| place[1] < 1e-6));
            }
            assert!(standing > 0, "flies at {time}");
        }
    }
}

#[test]
fn bones_keep_their_length_and_knees_bend_forwards() {
    for number in [1, 38, 57] {
        let walker = walker(number, 3);
        for time in frames(&walker) {
            let pose = walker.pose_at(time);
            for leg in pose.legs {
                let length = |a: Vector, b: Vector| dot(subtract(a, b), subtract(a, b)).sqrt();
                assert!((length(leg.hip, leg.knee) - walker.build.thigh).abs() < 1e-3, "{time}");
                assert!((length(leg.knee, leg.ankle) - walker.build.shank).abs() < 0.02, "{time}");
                let middle = scale(add(leg.hip, leg.ankle), 0.5);
                assert!(dot(subtract(leg.knee, middle), pose.hips.ahead) > -0.08, "{time}");
            }
        }
    }
}

#[test]
fn a_silhouette_is_as_high_as_the_person_is() {
    for (number, subject) in [(1, Subject::A), (2, Subject::B), (3, Subject::C)] {
        assert_eq!(RoomSettings::test(number, 1).unwrap().subject, subject);
        let walker = walker(number, 1);
        let pose = walker.pose_at(6.0);
        let view = towards(pose.place, 40.0, (640, 480));
        let mut mask = Plane::filled(640, 480, 0);
        walker.silhouette(6.0, &view, &mut mask);
        let rows: Vec<usize> =
            (0..480).filter(|row| mask.data[row * 640..(row + 1) * 640].contains(&255)).collect();
        let up = |height: f64| view.pixel(add(pose.place, [0.0, height, 0.0])).unwrap().0.1;
        let (drawn, expected) = (rows.len() as f64, up(0.0) - up(walker.build.height));
        assert!((drawn / expected - 1.0).abs() < 0.08, "{subject:?} {drawn} {expected}");
        let [_, top, _, bottom] = walker.bounds(6.0, &view).unwrap();
        assert!((top - rows[0] as f64).abs() < 1.5 && (bottom - top - drawn).abs() < 2.0);
    }
    let heights = [1, 2, 3].map(|number| walker(number, 1).build.height);
    assert!(heights[1] < heights[2] && heights[2] < heights[0], "{heights:?}");
}

#[test]
fn what_is_drawn_is_the_silhouette() {
    let walker = walker(3, 1);
    let pose = walker.pose_at(6.3);
    let view = towards(pose.place, 30.0, (320, 240));
    let mut mask = Plane::filled(320, 240, 0);
    walker.silhouette(6.3, &view, &mut mask);
    let mut canvas = Canvas::grey(320, 240, 255);
    draw(&walker, 6.3, &view, &mut canvas);
    let differ =
        mask.data.iter().zip(&canvas.planes[0].data).filter(|(m, y)| (**m == 255) != (**y < 225)).count();
    let body = mask.data.iter().filter(|pixel| **pixel == 255).count();
    // At the edge a pixel may be half covered.
    assert!(body > 2000 && differ * 8 < body, "{differ} of {body}");
    walker.draw_shadow(6.3, &view, &mut canvas);
}

#[test]
fn who_moves_is_blurred_along_their_way_and_nobody_else() {
    let walker = walker(1, 1);
    let view = towards(walker.pose_at(6.0).place, 30.0, (320, 240));
    let canvas = |duration: f64| {
        let mut canvas = Canvas::grey(320, 240, 255);
        let layer = walker.layer(6.0, duration, &std::array::from_fn(|_| view.clone()), &lamps()).unwrap();
        let (width, height) = layer.view(&view).size;
        layer.over(&mut canvas, Plane::filled(width, height, 255), (0.0, 0.0));
        canvas
    };
    // How sharply brightness changes from column to column, and from row to row.
    let contrast = |canvas: &Canvas, step: usize| -> u64 {
        let data = &canvas.planes[0].data;
        data.iter().zip(&data[step..]).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum()
    };
    let (short, long) = (canvas(0.001), canvas(0.03));
    let part = |step: usize| contrast(&long, step) as f64 / contrast(&short, step) as f64;
    assert!(part(1) < 0.8 && part(1) < part(320), "{} {}", part(1), part(320));
}

#[test]
fn the_obstacle_spans_the_time_wanted() {
    for settings in [14, 16, 31, 50, 69].map(|number| RoomSettings::test(number, 1).unwrap()) {
        let walker = Walker::of_test(&settings);
        let (_, solid) = obstruction::obstacle(&walker, &settings).unwrap();
        let front = solid.base[0].hypot(solid.base[2]) - solid.size[2] / 2.0;
        let half = (solid.size[0] / 2.0 / front).atan();
        let hidden = frames(&walker).filter(|&time| {
            let now = walker.walk().at(time);
            assert!(front + solid.size[2] < now.x.hypot(now.z) - 0.5, "walks through it");
            let (left, right) = obstruction::azimuths(&walker, time);
            let middle = -solid.yaw_deg.to_radians();
            left >= middle - half && right <= middle + half
        });
        let hidden: Vec<f64> = hidden.collect();
        let once: Vec<f64> = hidden.iter().copied().filter(|time| time - hidden[0] < 2.5).collect();
        assert!((24..=28).contains(&once.len()), "{settings:?} {}", once.len());
        // Wholly in view for two seconds before.
        assert!(once[0] > walker.walk().entry() + 2.6, "{settings:?} {}", once[0]);
        let again = hidden.len() > once.len();
        assert_eq!(again, settings.direction == Change::Variable, "{settings:?} {hidden:?}");
    }
    assert!([1, 7, 13, 20].into_iter().all(|number| {
        let settings = RoomSettings::test(number, 2).unwrap();
        obstruction::obstacle(&Walker::of_test(&settings), &settings).is_some()
            == (settings.occlusion != Occlusion::None)
    }));
}

#[test]
fn the_same_seed_is_the_same_person_and_another_is_another() {
    let picture = |number: u32, seed: u64| {
        let walker = walker(number, seed);
        let pose = walker.pose_at(6.0);
        let mut canvas = Canvas::grey(160, 120, 128);
        draw(&walker, 6.0, &towards(pose.place, 30.0, (160, 120)), &mut canvas);
        canvas
    };
    assert_eq!(picture(2, 4), picture(2, 4));
    assert_ne!(picture(2, 4), picture(2, 5));
    let cloth = |number: u32, seed| format!("{:?}", walker(number, seed).build);
    // Who somebody is does not depend on the test, but on the subject.
    assert_eq!(cloth(2, 4), cloth(5, 4));
    assert_ne!(cloth(2, 4), cloth(3, 4));
}

#[test]
fn who_is_alike_wears_what_the_person_wears_and_is_no_twin() {
    let differ = RoomSettings { others: 2, ..RoomSettings::test(2, 3).unwrap() };
    let alike = RoomSettings { alike: true, ..differ.clone() };
    let person = Walker::of_test(&alike);
    let shirt = |walker: &Walker| walker.outfit.cloths[clothes::SHIRT].level(1000.0).0.to_vec();
    for (number, role) in (1..).zip(&cast::others(&differ, 1)) {
        let [differ, alike] = [&differ, &alike].map(|settings| Walker::in_role(settings, number, role));
        assert!(shirt(&differ) != shirt(&person));
        assert!(shirt(&alike) == shirt(&person));
        assert_ne!(format!("{:?}", alike.build), format!("{:?}", person.build));
        assert_eq!(alike.walk().at(4.0), differ.walk().at(4.0));
    }
}

#[test]
fn repeating_begins_again() {
    let settings = RoomSettings { repeats: true, ..RoomSettings::default() };
    let walker = Walker::of_test(&settings);
    let duration = walker.walk().duration();
    assert_eq!(walker.pose_at(3.0).place, walker.pose_at(3.0 + duration).place);
}
