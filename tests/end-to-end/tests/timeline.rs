// SPDX-License-Identifier: MPL-2.0

//! The page that shows who was followed, in a browser.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "../../virtual-camera/tests/common/browser.rs"]
mod browser;

use std::fs;
use std::path::{Path, PathBuf};

use ::events::{Crop, Sighting, Step, Store};
use browser::Browser;
use end_to_end::{PATIENCE, Program, scene, scratch};
use serde_json::{Value, json};
use virtual_camera::VirtualCamera;

/// 10 January 2026, 20:00 UTC, in milliseconds.
const EVENING_MS: i64 = 1_768_075_200_000;

const RED: [u8; 3] = [190, 40, 40];
const BLUE: [u8; 3] = [40, 60, 190];

/// Somebody in a coat of this colour, at a camera so many minutes after the evening began, for as many seconds, from this pan on.
fn sighting(camera: &str, minutes: i64, coat: [u8; 3], pan_deg: f64) -> Sighting {
    let (width, height) = (60, 90);
    let colour = |n: u32| match (n % width, n / width) {
        (15..45, 15..40) => coat,
        (15..45, 40..80) => [60, 60, 60],
        _ => [150, 160, 150],
    };
    let rgb = (0..width * height).flat_map(colour).collect();
    let crop = Crop { width, height, rgb, person: [15, 15, 30, 65] };
    let from_ms = EVENING_MS + 60_000 * minutes;
    let step = |second: i64| Step {
        at_ms: from_ms + 1000 * second,
        pan_deg: pan_deg + second as f64 / 10.0,
        tilt_deg: -5.0,
    };
    Sighting {
        camera: camera.to_owned(),
        run_ms: 1,
        track: minutes.unsigned_abs(),
        from_ms,
        to_ms: from_ms + 1000 * minutes,
        path: (0..minutes).map(step).collect(),
        picture: crop.into_picture(1.0, false),
        recording: None,
    }
}

/// A program that has this to tell.
fn program(test: &str, sightings: Vec<Sighting>) -> (Program, PathBuf) {
    let folder = scratch(&format!("timeline-{test}"));
    let (mut store, _) = Store::open(&folder).unwrap();
    for sighting in &sightings {
        store.keep(sighting).unwrap();
    }
    let kept = folder.clone();
    let file = |own: &Path| {
        Program::entry("door", "http://127.0.0.1:1", &own.join("password"))
            + &format!("[events]\nfolder = {kept:?}\nkeep = \"10000d\"\n")
            + "[zone.gate]\ncamera = \"door\"\npan = [35, 50]\ntilt = [-10, 0]\n"
    };
    (Program::start(&format!("timeline-{test}"), file, &[]), folder)
}

/// Sees the evening's events, in the light, from a wide window.
fn look(browser: &mut Browser, program: &Program) {
    browser.open(&format!("{}events", program.url()));
    browser.call("Emulation.setTimezoneOverride", json!({"timezoneId": "UTC"}));
    browser.wait_for("document.querySelector('form')?.day?.value");
    set(browser, "day", "2026-01-10");
}

fn set(browser: &mut Browser, field: &str, value: &str) {
    browser.value(&format!("form.{field}.value = '{value}'; form.dispatchEvent(new Event('change'))"));
}

/// The page shows these events in this order.
#[track_caller]
fn shows(browser: &mut Browser, ids: &[i64]) {
    let ids = json!(ids.iter().map(|id| format!("event-{id}")).collect::<Vec<_>>());
    browser.wait_for(&format!(
        "JSON.stringify([...document.querySelectorAll('article')].map(article => article.id)) == '{ids}'"
    ));
}

#[test]
fn the_timeline_shows_who_was_there_and_finds_and_deletes_them() {
    let sightings = vec![
        sighting("door", 5, RED, 10.0),
        sighting("door", 50, BLUE, 40.0),
        sighting("yard", 100, RED, -60.0),
        sighting("yard", 130, BLUE, -20.0),
    ];
    let (program, folder) = program("finds", sightings);
    let mut browser = Browser::start("chromium-timeline");
    look(&mut browser, &program);
    shows(&mut browser, &[4, 3, 2, 1]);
    browser
        .wait_for("[...document.querySelectorAll('article img')].every(image => image.naturalWidth == 60)");
    browser.save_picture("ptztrack-events.png");

    // By camera and hour; a click shows those alone.
    let cells = "[...document.querySelectorAll('#timeline tbody tr')].map(row => row.innerText.trim().split(/\\s+/).join(' ')).join()";
    browser.wait_for(&format!("{cells} == 'door 2,yard 1 1'"));
    browser.value("document.querySelector('#timeline button[title=\"door, 20:00\"]').click()");
    shows(&mut browser, &[2, 1]);
    browser.value("document.querySelector('[type=reset]').click()");
    shows(&mut browser, &[4, 3, 2, 1]);

    // By camera, time and zone.
    set(&mut browser, "camera", "yard");
    shows(&mut browser, &[4, 3]);
    set(&mut browser, "from", "22:00");
    shows(&mut browser, &[4]);
    browser.value("document.querySelector('[type=reset]').click()");
    for (side, degrees) in [("left", -70), ("right", 20), ("bottom", -10), ("top", 0)] {
        set(&mut browser, side, &degrees.to_string());
    }
    shows(&mut browser, &[4, 3, 1]);
    set(&mut browser, "bottom", "-4");
    browser.wait_for("document.querySelector('main').innerText == 'Nobody was followed then.'");
    browser.value("document.querySelector('[type=reset]').click()");

    // By the zone's name.
    shows(&mut browser, &[4, 3, 2, 1]);
    set(&mut browser, "zone", "gate");
    shows(&mut browser, &[2]);
    let csv = browser.value("document.querySelector('#csv').href");
    assert!(csv.as_str().is_some_and(|address| address.contains("zone=gate")), "{csv}");
    assert_eq!(
        program.ask("GET", "/events/list?zone=fence"),
        (404, "There is no zone of that name.\n".into())
    );
    browser.value("document.querySelector('[type=reset]').click()");

    // Who looks the same, wherever they were; themselves first.
    shows(&mut browser, &[4, 3, 2, 1]);
    browser.value("document.querySelector('#event-1 .same').click()");
    browser.wait_for("document.querySelectorAll('article').length == 4 && document.querySelector('h2').innerText == 'Who looks like that'");
    let alike = browser.value("[...document.querySelectorAll('article')].map(article => article.id)");
    assert!(
        ["event-1", "event-3"].iter().all(|id| alike.as_array().unwrap()[..2].contains(&json!(id))),
        "{alike}"
    );
    browser.value("document.querySelector('[type=reset]').click()");
    shows(&mut browser, &[4, 3, 2, 1]);

    // One click asks, another deletes.
    browser.value("document.querySelector('#event-3 .delete').click()");
    browser.value("document.querySelector('#event-3 .delete').click()");
    shows(&mut browser, &[4, 2, 1]);
    assert_eq!(program.ask("GET", "/events/3/picture").0, 404);
    program.end("TERM");
    fs::remove_dir_all(&folder).unwrap();
}

/// Whom a camera followed that is recorded, in files of two seconds, one of which is still written.
#[test]
fn whoever_was_recorded_is_played_and_kept_as_a_clip() {
    let mut browser = Browser::start("chromium-timeline-clip");
    let element = |codec: &str| if codec == "h264" { "video" } else { "img[alt=Recording]" };
    for (codec, plays, kind) in
        [("h264", "currentTime > 0.2", "video/mp4"), ("mjpeg", "naturalWidth == 320", "video/x-matroska")]
    {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let file = |own: &Path| {
            let (recordings, rtsp) = (own.join("recordings"), camera.rtsp_url());
            Program::entry("door", &camera.url(), &own.join("password"))
                + &format!("codec = \"{codec}\"\nrtsp = \"{rtsp}\"\n[camera.door.recording]\n")
                + &format!("folder = {recordings:?}\nsegment = \"2s\"\nkeep = \"1h\"\n")
        };
        let mut program = Program::start(&format!("timeline-{codec}"), file, &[]);
        scene::wait_until_following(&camera);
        let before = camera.status().commands;
        assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 30), "not steered");
        assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
        program.launch.wait_for_line(": event 1: target ");
        browser.open(&format!("{}events", program.url()));
        browser.wait_for("document.querySelector('form')?.day?.value");
        // It may be past midnight by now.
        let list: Value = serde_json::from_str(&program.ask("GET", "/events/list").1).unwrap();
        let event = list["events"].as_array().unwrap().iter().find(|event| event["id"] == 1).unwrap();
        let from = &event["from"];
        browser.value(&format!("form.day.value = dayOf(new Date({from})); refresh()"));
        browser.wait_for("document.querySelector('#event-1 .play')?.checkVisibility()");
        browser.wait_for("document.querySelector('#event-1 img').naturalWidth > 0");
        browser.value("document.querySelector('#event-1 .play').click()");
        browser.wait_for(&format!("document.querySelector('#event-1 {}')?.{plays}", element(codec)));
        browser.save_picture(&format!("ptztrack-events-{codec}.png"));
        let clip = browser.value(
            "fetch(document.querySelector('#event-1 .clip').href).then(async answer => \
             [answer.headers.get('content-type'), (await answer.blob()).size])",
        );
        assert!(clip[0] == kind && clip[1].as_u64().unwrap() > 10_000, "{clip}");
        // Where the recording is gone, that is said.
        fs::remove_dir_all(program.folder().join("recordings")).unwrap();
        assert_eq!(program.ask("GET", "/events/1/clip"), (404, "The recording is gone.\n".to_owned()));
        program.end("TERM");
        scene::assert_left_at_rest(&camera);
    }
}

/// Dark, and on a phone.
#[test]
fn the_timeline_fits_a_phone() {
    let sightings = (1..40).map(|n| sighting("door", n * 5, [RED, BLUE][n as usize % 2], 0.0)).collect();
    let (program, folder) = program("phone", sightings);
    let mut browser = Browser::start("chromium-timeline-phone");
    let phone = json!({"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": true});
    look(&mut browser, &program);
    let dark = json!({"features": [{"name": "prefers-color-scheme", "value": "dark"}]});
    browser.call("Emulation.setEmulatedMedia", dark);
    browser.call("Emulation.setDeviceMetricsOverride", phone);
    browser.value("refresh()");
    browser.wait_for("document.querySelectorAll('article').length == 39");
    // The first hour with somebody in it is in sight, right of the cameras' names.
    let in_sight = "(({left, right}) => document.querySelector('tbody th').getBoundingClientRect().right <= left && right <= innerWidth)\
         (document.querySelector('td:has(button)').getBoundingClientRect())";
    assert_eq!(browser.value(in_sight), true);
    browser.wait_for(
        "[...document.querySelectorAll('article img')].slice(0, 4).every(image => image.naturalWidth == 60)",
    );
    browser.save_picture("ptztrack-events-phone.png");
    // Nothing but the table of hours is wider than the window.
    assert_eq!(browser.value("document.documentElement.scrollWidth"), 390);
    program.end("TERM");
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn events_are_told_and_deleted_by_the_rules_of_the_page() {
    let (program, folder) = program("rules", vec![sighting("door", 5, RED, 10.0)]);
    let (status, csv) = program.ask("GET", "/events/events.csv?camera=door");
    assert!(status == 200 && csv.starts_with("id,camera,") && csv.lines().count() == 2, "{csv}");
    assert_eq!(program.ask("GET", "/events/events.csv?camera=yard").1.lines().count(), 1);
    let (_, list) = program.ask("GET", "/events/list?camera=%27%20OR%201%3D1%20--");
    let list: Value = serde_json::from_str(&list).unwrap();
    assert_eq!((&list["cameras"], &list["events"]), (&json!(["door"]), &json!([])));
    for (method, path, status) in [
        ("GET", "/events/list?since=yesterday", 400),
        ("GET", "/events/..%2f..%2fetc%2fpasswd/picture", 400),
        ("GET", "/events/1/delete", 405),
        ("POST", "/events/7/delete", 404),
        // Of whom there is no recording.
        ("GET", "/events/1/video", 404),
        ("GET", "/events/1/clip", 404),
    ] {
        assert_eq!(program.ask(method, path).0, status, "{method} {path}");
    }
    for (method, path) in
        [("GET", "/events/list"), ("GET", "/events/1/picture"), ("POST", "/events/1/delete")]
    {
        assert_eq!(program.ask_as("evil.example", method, path).0, 421, "{method} {path}");
    }
    assert_eq!(program.ask("POST", "/events/1/delete").0, 204);
    assert_eq!(program.ask("GET", "/events/1/picture").0, 404);
    program.end("TERM");
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn where_no_events_are_kept_the_page_says_so() {
    let file = |own: &Path| {
        Program::entry("door", "http://127.0.0.1:1", &own.join("password")) + "[events]\nstore = \"off\"\n"
    };
    let program = Program::start("timeline-off", file, &[]);
    let mut browser = Browser::start("chromium-timeline-off");
    browser.open(&format!("{}events", program.url()));
    browser.wait_for("document.querySelector('#trouble')?.innerText.includes('No events are kept')");
    assert_eq!(program.ask("POST", "/events/1/delete").0, 404);
    program.end("TERM");
}
