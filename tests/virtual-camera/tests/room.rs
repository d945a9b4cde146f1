// SPDX-License-Identifier: MPL-2.0

//! A camera in the made-up room.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::{PATIENCE, client, get};
use virtual_camera::{
    Action, Bounds, Clock, GroundTruth, Imaging, Kind, Lighting, Mask, Place, Pose, RoomSettings, Settings,
    Sighting, Video, VirtualCamera, World,
};

const SIZE: (u32, u32) = (320, 240);

fn room(test: u32, seed: u64, home: Option<Pose>) -> VirtualCamera {
    let world = World::Room(RoomSettings::test(test, seed).unwrap());
    let video = Video { size: Some(SIZE), delay: Duration::from_millis(40), ..Video::default() };
    VirtualCamera::start(Settings { world, video, home, clock: Clock::Stepped, ..Settings::default() })
        .unwrap()
}

/// The truth about a moment, which becomes the present.
fn truth_at(camera: &VirtualCamera, time: Duration) -> GroundTruth {
    camera.advance_to(time + camera.video_delay());
    let truth = camera.ground_truth(time, SIZE);
    assert_eq!(truth.len(), 1, "one person walks in a room");
    truth[0].clone()
}

fn box_of(mask: &Mask) -> Option<Bounds> {
    let lit = (0..mask.data.len()).filter(|&index| mask.data[index] != 0);
    let places = lit.map(|index| ((index % mask.width) as f64, (index / mask.width) as f64));
    Bounds::around(places.flat_map(|(x, y)| [(x, y), (x + 1.0, y + 1.0)]))
}

#[test]
fn the_person_comes_in_after_two_seconds_and_the_lens_is_the_rooms() {
    let camera = room(1, 1, None);
    assert_eq!(camera.home(), RoomSettings::test(1, 1).unwrap().home());
    let status = camera.status();
    assert!((status.horizontal_fov_deg - 55.0).abs() < 1e-9 && status.magnification == 1.0);
    assert_eq!(camera.frame_period(), Duration::from_millis(40));
    let times = (0..).map(|step| step * 10 * camera.frame_period());
    let entered = times.take(40).find(|&time| truth_at(&camera, time).visible > 0.9).unwrap();
    assert!(entered > Duration::from_secs(2), "{entered:?}");
    let narrowest = Pose { zoom_step: 9999.0, ..camera.home() };
    let fov = room(1, 1, Some(narrowest)).status().horizontal_fov_deg;
    assert!((fov - 3.0).abs() < 0.01, "{fov}");
}

#[test]
fn the_truth_leads_the_camera_to_the_person() {
    let test = 7;
    let time = Duration::from_secs(5);
    let camera = room(test, 1, None);
    let (pan_deg, tilt_deg) = truth_at(&camera, time).direction_deg.unwrap();
    // At the edge of a wide view perspective stretches a silhouette: who looks there sees more exactly where its middle is.
    let towards = Pose { pan_deg, tilt_deg, ..Pose::default() };
    let (pan_deg, tilt_deg) = camera.ground_truth_from(&towards, time, SIZE)[0].direction_deg.unwrap();
    for zoom_step in [1.0, 1500.0] {
        let camera = room(test, 1, Some(Pose { pan_deg, tilt_deg, zoom_step }));
        let truth = truth_at(&camera, time);
        let (x, y) = truth.centroid;
        // The middle of a silhouette moves a little as perspective stretches it otherwise.
        assert!((x - 160.0).abs() < 2.0 && (y - 120.0).abs() < 2.0, "{truth:?}");
        assert!(truth.bounds.contains(truth.centroid) && truth.position_m.is_some());
        let mask = camera.silhouette(time, SIZE).unwrap();
        assert_eq!((mask.width, mask.height), (320, 240));
        let seen = box_of(&mask).unwrap();
        // What is seen is a part of the body; where nothing hides it, nearly all of it.
        let grown = Bounds {
            left: truth.bounds.left - 1.0,
            top: truth.bounds.top - 1.0,
            width: truth.bounds.width + 2.0,
            height: truth.bounds.height + 2.0,
        };
        assert!(grown.contains((seen.left, seen.top)), "{seen:?} {truth:?}");
        assert!(grown.contains((seen.left + seen.width, seen.top + seen.height)), "{seen:?} {truth:?}");
        if truth.visible > 0.99 {
            assert!((seen.height - truth.bounds.height).abs() < 2.5, "{seen:?} {truth:?}");
        }
    }
}

#[test]
fn the_same_seed_is_the_same_room_to_the_byte_and_another_is_another() {
    let pictures = |test, seed| {
        let camera = room(test, seed, None);
        let period = camera.frame_period();
        let picture = |step: u32| {
            camera.advance_to(step * period + camera.video_delay());
            camera.picture(step * period, SIZE).unwrap()
        };
        [0, 1, 90].map(picture)
    };
    let first = pictures(1, 1);
    assert!(first == pictures(1, 1), "the same room differs");
    let differing = |a: &virtual_camera::Picture, b: &virtual_camera::Picture| {
        let pairs = a.planes[0].data.iter().zip(&b.planes[0].data);
        pairs.filter(|(a, b)| a.abs_diff(**b) > 25).count()
    };
    // Noise, and the little that it makes of two pictures of the same.
    assert!(first[0] != first[1] && differing(&first[0], &first[1]) < 320);
    assert!(differing(&first[0], &pictures(1, 2)[0]) > 3200);
}

#[tokio::test]
async fn the_live_page_has_all_it_shows() {
    let camera = room(4, 3, None);
    camera.advance_to(Duration::from_secs(4));
    assert!(camera.wait_for(PATIENCE, |status| status.footage_frame == 100));
    let client = client();
    let report: serde_json::Value =
        serde_json::from_str(&get(&client, &camera, "/api/status").await.1).unwrap();
    let outline = report["outline"].as_array().unwrap();
    assert_eq!(outline.len(), 4, "{report}");
    for corner in outline.iter().flat_map(|corner| corner.as_array().unwrap()) {
        assert!((0.0..=1.0).contains(&corner.as_f64().unwrap()), "{report}");
    }
    for picture in ["overview.jpg", "picture.jpg"] {
        let answer = client.get(format!("{}/api/{picture}", camera.url())).send().await.unwrap();
        assert_eq!(answer.status(), 200);
        assert!(answer.bytes().await.unwrap().len() > 3000, "{picture} is empty");
    }
    let truth = get(&client, &camera, "/api/truth").await.1;
    assert!(truth.contains("\"silhouette\":[[") && truth.contains("\"position_m\":["), "{truth}");
}

#[tokio::test]
async fn who_looks_away_sees_nobody_and_is_not_in_the_overview() {
    let camera = room(1, 1, Some(Pose { pan_deg: 165.0, ..Pose::default() }));
    let report = get(&client(), &camera, "/api/status").await.1;
    assert!(report.contains("\"outline\":[]") && report.contains("\"pan_deg\":165.0"), "{report}");
    assert_eq!(camera.ground_truth(Duration::ZERO, SIZE), []);
}

/// A camera that looks where somebody does something, the way of test 1 apart.
fn acting(action: Action, seed: u64) -> VirtualCamera {
    let world = World::Room(RoomSettings { action, ..RoomSettings::test(1, seed).unwrap() });
    let video = Video { size: Some(SIZE), ..Video::default() };
    VirtualCamera::start(Settings { world, video, clock: Clock::Stepped, ..Settings::default() }).unwrap()
}

/// Everybody at times so many milliseconds apart, in a picture that holds the whole way.
fn everybody(action: Action, seed: u64, step_ms: u64) -> Vec<Vec<GroundTruth>> {
    let camera = acting(action, seed);
    let room = RoomSettings { action, ..RoomSettings::test(1, seed).unwrap() };
    let ahead = Pose { tilt_deg: -12.0, ..Pose::default() };
    let times =
        (0..).map(|step| step * Duration::from_millis(step_ms)).take_while(|time| *time < room.duration());
    times.map(|time| camera.ground_truth_from(&ahead, time, SIZE)).collect()
}

#[test]
fn two_who_cross_hide_one_another_once() {
    for (action, seed) in [(Action::Cross, 1), (Action::CrossAlike, 2)] {
        let moments = everybody(action, seed, 60);
        assert!(moments.iter().all(|people| people.iter().all(|one| [1, 2].contains(&one.id))));
        let both = moments.iter().filter(|people| people.len() == 2).count();
        assert!(both * 2 > moments.len(), "{both}");
        let hidden = |people: &[GroundTruth]| people.iter().any(|one| one.unhidden < 0.6);
        let times = moments.windows(2).filter(|pair| !hidden(&pair[0]) && hidden(&pair[1])).count();
        assert_eq!(times, 1, "{action:?} {seed}");
        // They change sides.
        let side = |people: &[GroundTruth]| {
            let x = |id| people.iter().find(|one| one.id == id).map(|one| one.centroid.0);
            x(1).zip(x(2)).map(|(one, other)| one < other)
        };
        let sides: Vec<bool> = moments.iter().filter_map(|people| side(people)).collect();
        assert_ne!(sides.first(), sides.last());
    }
}

#[test]
fn two_who_part_are_close_at_first_and_far_apart_in_the_end() {
    for seed in 1..3 {
        let apart: Vec<f64> = everybody(Action::Part, seed, 400)
            .iter()
            .filter_map(|people| {
                let [one, other] = &people[..] else { return None };
                let (a, b) = (one.position_m?, other.position_m?);
                Some((a[0] - b[0]).hypot(a[2] - b[2]))
            })
            .collect();
        assert!(apart[0] < 1.0 && *apart.last().unwrap() > 3.0, "{apart:?}");
    }
}

#[test]
fn nobody_is_nobody_and_somebody_alone_is_one() {
    for action in [Action::StopAndGo, Action::Sit, Action::Approach, Action::Run] {
        let moments = everybody(action, 2, 1000);
        assert!(moments.iter().all(|people| people.len() <= 1), "{action:?}");
        assert!((8..44).contains(&moments.len()), "{action:?} {}", moments.len());
    }
    let camera = acting(Action::Nobody, 1);
    for second in [0, 60, 599] {
        let (time, home) = (Duration::from_secs(second), camera.home());
        assert!(camera.ground_truth_from(&home, time, SIZE).is_empty());
    }
    assert_eq!(RoomSettings { action: Action::Nobody, ..RoomSettings::default() }.duration().as_secs(), 600);
}

fn camera_in(room: RoomSettings) -> VirtualCamera {
    let video = Video { size: Some(SIZE), ..Video::default() };
    let world = World::Room(room);
    VirtualCamera::start(Settings { world, video, clock: Clock::Stepped, ..Settings::default() }).unwrap()
}

/// Everybody half a second apart, as a camera sees them that looks along `pose` and nobody moves.
fn sightings(camera: &VirtualCamera, seconds: u64) -> Vec<Vec<Sighting>> {
    let times = (0..2 * seconds).map(|half| Duration::from_millis(500 * half));
    times
        .map(|time| {
            camera.advance_to(time + camera.video_delay());
            camera.people(time, SIZE)
        })
        .collect()
}

#[test]
fn a_group_comes_in_together_and_its_truth_says_who_hides_whom() {
    for others in [2, 7] {
        let room = RoomSettings { action: Action::Group, others, ..RoomSettings::test(2, 3).unwrap() };
        let moments = sightings(&camera_in(room), 9);
        let in_view = |people: &Vec<Sighting>| people.iter().filter(|one| one.truth.in_view > 0.9).count();
        assert!(moments.iter().any(|people| in_view(people) > others), "{others}");
        let all: Vec<&Sighting> = moments.iter().flatten().collect();
        assert!(all.iter().all(|one| one.kind == Kind::Person && one.truth.id <= others as u32 + 1));
        let hidden: Vec<_> = all.iter().filter(|one| !one.hidden_by.is_empty()).collect();
        assert!(hidden.len() * 4 > all.len(), "{} of {}", hidden.len(), all.len());
        assert!(hidden.iter().all(|one| one.truth.unhidden < 1.0 && !one.hidden_by.contains(&one.truth.id)));
    }
}

#[test]
fn others_wander_about_from_the_beginning_while_the_person_does_what_they_always_do() {
    let plain = RoomSettings::test(2, 4).unwrap();
    let busy = sightings(&camera_in(RoomSettings { others: 6, ..plain.clone() }), 6);
    let alone = sightings(&camera_in(plain), 6);
    for (busy, alone) in busy.iter().zip(&alone) {
        let person =
            |people: &[Sighting]| people.iter().find(|one| one.truth.id == 1).map(|one| one.truth.bounds);
        assert_eq!(person(busy), person(alone));
        assert!(busy.len() >= 3 && alone.len() <= 1);
    }
    let places: std::collections::BTreeSet<_> =
        busy.iter().flatten().map(|one| (one.truth.id, one.truth.position_m.unwrap()[0] as i64)).collect();
    assert!(places.len() > 14, "they move: {places:?}");
}

#[test]
fn who_is_near_fills_the_picture() {
    let room = RoomSettings { action: Action::Near, ..RoomSettings::test(1, 2).unwrap() };
    let duration = room.duration().as_millis() as u64;
    let camera = camera_in(room);
    let down = Pose { tilt_deg: -35.0, ..Pose::default() };
    let heights = (0..duration / 100).map(|step| {
        let seen = camera.ground_truth_from(&down, Duration::from_millis(100 * step), SIZE);
        seen.first().filter(|one| one.in_view > 0.5).map_or(0.0, |one| one.bounds.height)
    });
    let highest = heights.fold(0.0, f64::max);
    assert!(highest > 0.75 * f64::from(SIZE.1), "{highest}");
}

#[test]
fn who_reaches_into_the_view_is_hands_at_first_and_walks_in_then() {
    let room = RoomSettings { action: Action::Reach, ..RoomSettings::test(1, 2).unwrap() };
    let (home, camera) = (room.home(), camera_in(room));
    let parts: Vec<f64> = (10..80)
        .map(|step| camera.ground_truth_from(&home, Duration::from_millis(100 * step), SIZE)[0].visible)
        .collect();
    let hands = parts.iter().filter(|part| (0.005..0.2).contains(*part)).count();
    assert!((8..40).contains(&hands) && parts.iter().any(|part| *part > 0.95), "{parts:?}");
}

#[test]
fn who_is_faint_is_a_few_grey_levels_from_the_wall() {
    let (time, room) = (Duration::from_secs(5), RoomSettings::test(2, 3).unwrap());
    let cameras = [0.0, 4.0].map(|faint| camera_in(RoomSettings { faint: Some(faint), ..room.clone() }));
    let [nobody, somebody] = cameras.each_ref().map(|camera| {
        camera.advance_to(time + camera.video_delay());
        camera.picture(time, SIZE).unwrap()
    });
    let shape = cameras[0].people(time, SIZE).remove(0).silhouette;
    let luma = nobody.planes[0].data.iter().zip(&somebody.planes[0].data).enumerate();
    let inside = luma.filter(|(index, _)| {
        let (column, row) = (index % SIZE.0 as usize, index / SIZE.0 as usize);
        shape.shows((column as f64 + 0.5, row as f64 + 0.5))
    });
    let differences: Vec<f64> = inside.map(|(_, (one, other))| f64::from(one.abs_diff(*other))).collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    assert!(differences.len() > 500 && (2.0..7.0).contains(&mean), "{mean} of {}", differences.len());
}

#[test]
fn a_world_may_begin_with_the_person_in_view_and_the_camera_turning() {
    let room = RoomSettings { begins: Duration::from_secs(5), ..RoomSettings::test(1, 1).unwrap() };
    let whole = RoomSettings::test(1, 1).unwrap().duration();
    assert_eq!(room.duration(), whole - Duration::from_secs(5));
    let settings = Settings {
        world: World::Room(room),
        turning: (30.0, 0.0),
        clock: Clock::Stepped,
        ..Settings::default()
    };
    let camera = VirtualCamera::start(settings).unwrap();
    assert!(camera.ground_truth(Duration::ZERO, SIZE)[0].in_view > 0.99);
    let status = camera.status();
    assert!(status.moving && status.pan_rate_deg_s > 5.0, "{status:?}");
    camera.advance_to(Duration::from_secs(1));
    assert!((camera.status().pan_deg - camera.home().pan_deg - status.pan_rate_deg_s).abs() < 0.1);
}

#[test]
fn every_room_is_bright_enough_to_see_unless_it_is_to_be_dark() {
    // Rooms of a seed are painted once as long as one of them is there.
    let room = |seed, lighting| camera_in(RoomSettings { lighting, ..RoomSettings::test(1, seed).unwrap() });
    let mean = |camera: &VirtualCamera| {
        let picture = camera.picture(Duration::ZERO, SIZE).unwrap();
        let luma = &picture.planes[0].data;
        luma.iter().map(|value| f64::from(*value)).sum::<f64>() / luma.len() as f64
    };
    // By night and by day.
    let night = [Lighting::Optimal, Lighting::Dim].map(|lighting| room(3, lighting));
    let day = [Lighting::Optimal, Lighting::Dark].map(|lighting| room(7, lighting));
    assert!((60.0..110.0).contains(&mean(&night[0])) && (60.0..110.0).contains(&mean(&day[0])));
    assert!((50.0..110.0).contains(&mean(&night[1])) && mean(&day[1]) < 45.0);
}

fn yard(action: Action) -> RoomSettings {
    RoomSettings { place: Place::Yard, action, ..RoomSettings::test(1, 3).unwrap() }
}

#[test]
fn who_is_far_away_in_the_yard_is_20_to_40_pixels_high() {
    let room = yard(Action::Far);
    let seconds = room.duration().as_secs().min(20);
    let camera = camera_in(room);
    let heights: Vec<f64> = (1..seconds)
        .filter_map(|second| {
            let seen = camera.ground_truth_from(&camera.home(), Duration::from_secs(second), (640, 480));
            seen.first().filter(|one| one.visible > 0.6).map(|one| one.bounds.height)
        })
        .collect();
    assert!(heights.len() > 5 && heights.iter().all(|height| (18.0..42.0).contains(height)), "{heights:?}");
}

#[test]
fn a_car_is_a_vehicle_and_drives_along_the_street() {
    let room = RoomSettings { vehicles: 1, ..yard(Action::Drive) };
    let camera = camera_in(room);
    let ahead = Pose { tilt_deg: -8.0, ..Pose::default() };
    let times = (0..30).map(|half| Duration::from_millis(500 * half));
    let places: Vec<_> = times.map(|time| camera.ground_truth_from(&ahead, time, SIZE)).collect();
    let of = |id| places.iter().flatten().filter(move |one| one.id == id);
    // Ahead, where perspective stretches nothing.
    let ahead = of(1).filter(|one| (110.0..210.0).contains(&one.centroid.0));
    let shapes: Vec<f64> = ahead.map(|one| one.bounds.width / one.bounds.height).collect();
    assert!(!shapes.is_empty() && shapes.iter().all(|shape| (1.8..4.0).contains(shape)), "{shapes:?}");
    let metres: Vec<f64> = of(1).filter_map(|one| one.position_m).map(|place| place[0]).collect();
    let (least, most) = metres.iter().fold((99.0f64, -99.0f64), |(l, m), x| (l.min(*x), m.max(*x)));
    assert!(most - least > 5.0 && of(2).count() > 0, "{metres:?}");
    camera.advance_to(Duration::from_secs(2));
    assert!(camera.people(Duration::from_secs(2), SIZE).iter().all(|one| one.kind == Kind::Vehicle));
}

#[test]
fn the_truth_through_a_real_lens_is_where_its_picture_shows_the_person() {
    let imaging = Imaging { distortion: 0.12, lens_offset_m: 0.08, ..Imaging::default() };
    let room = RoomSettings { begins: Duration::from_secs(5), ..RoomSettings::test(2, 3).unwrap() };
    let video = Video { size: Some(SIZE), ..Video::default() };
    let world = World::Room(room);
    let camera = VirtualCamera::start(Settings {
        world,
        video,
        imaging,
        clock: Clock::Stepped,
        ..Settings::default()
    });
    let camera = camera.unwrap();
    let truth = truth_at(&camera, Duration::ZERO);
    let seen = box_of(&camera.silhouette(Duration::ZERO, SIZE).unwrap()).unwrap();
    let near = |one: f64, other: f64| (one - other).abs() < 2.5;
    assert!(near(seen.left, truth.bounds.left) && near(seen.top, truth.bounds.top), "{seen:?} {truth:?}");
    assert!(
        near(seen.width, truth.bounds.width) && near(seen.height, truth.bounds.height),
        "{seen:?} {truth:?}"
    );
}
