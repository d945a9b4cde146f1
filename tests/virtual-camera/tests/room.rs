// SPDX-License-Identifier: MPL-2.0

//! A camera in the made-up room.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::{PATIENCE, client, get};
use virtual_camera::{
    Action, Bounds, Clock, GroundTruth, Mask, Pose, RoomSettings, Settings, Video, VirtualCamera, World,
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
    for seed in 1..3 {
        for action in [Action::Cross, Action::CrossAlike] {
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
}

#[test]
fn two_who_part_are_close_at_first_and_far_apart_in_the_end() {
    for seed in 1..4 {
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
        let moments = everybody(action, 2, 200);
        assert!(moments.iter().all(|people| people.len() <= 1), "{action:?}");
        assert!((40..220).contains(&moments.len()), "{action:?} {}", moments.len());
    }
    let camera = acting(Action::Nobody, 1);
    for second in [0, 60, 599] {
        let (time, home) = (Duration::from_secs(second), camera.home());
        assert!(camera.ground_truth_from(&home, time, SIZE).is_empty());
    }
    assert_eq!(RoomSettings { action: Action::Nobody, ..RoomSettings::default() }.duration().as_secs(), 600);
}
