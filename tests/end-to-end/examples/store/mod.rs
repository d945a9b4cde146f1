// SPDX-License-Identifier: MPL-2.0

//! A store of many events, and a page that is asked for them.

use std::path::Path;
use std::time::Instant;

use end_to_end::Program;
use events::{Crop, Sighting, Step, Store};

pub const EVENTS: i64 = 10_000;
/// Which so many cameras have seen.
pub const CAMERAS: i64 = 20;

/// How long the page took to tell of all events, in milliseconds, of how many it told, and how long its answer is.
pub fn asked(program: &Program, query: &str) -> (u128, usize, usize) {
    let begin = Instant::now();
    let (status, list) = program.ask("GET", &format!("/events/list{query}"));
    let took_ms = begin.elapsed().as_millis();
    assert_eq!(status, 200, "{list:.200}");
    (took_ms, list.matches("\"id\":").count(), list.len())
}

/// Each of a minute, with a picture.
pub fn fill(folder: &Path) {
    let (mut store, _) = Store::open(folder).unwrap();
    let picture = |n: i64| {
        let (width, height) = (160, 240);
        let rgb = (0..width * height * 3).map(|at| (i64::from(at) * (n + 7) / 97 % 251) as u8).collect();
        Crop { width, height, rgb, person: [40, 40, 80, 160] }.into_picture(1.0, false)
    };
    let pictures: Vec<_> = (0..50).map(picture).collect();
    for n in 0..EVENTS {
        let from_ms = 1_768_000_000_000 + n * 30_000;
        let step = |second: i64| Step {
            at_ms: from_ms + second * 1000,
            pan_deg: (second % 90) as f64,
            tilt_deg: -5.0,
        };
        let sighting = Sighting {
            camera: name(n % CAMERAS),
            run_ms: 0,
            track: n.unsigned_abs(),
            from_ms,
            to_ms: from_ms + 60_000,
            path: (0..60).map(step).collect(),
            picture: pictures[n as usize % pictures.len()].clone(),
            recording: None,
        };
        store.keep(&sighting).unwrap();
    }
}

/// What a camera is called.
pub fn name(number: i64) -> String {
    format!("camera-{number}")
}
