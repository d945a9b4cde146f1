// SPDX-License-Identifier: MPL-2.0

//! Each element by itself, from 640x480 to 3840x2160: time a picture.

use std::cell::RefCell;

use divan::Bencher;
use ptztrack_benchmarks::{Camera, Stage, Stages};

const SIZES: [(usize, usize); 4] = [(640, 480), (1280, 720), (1920, 1080), (3840, 2160)];
const CAMERAS: [Camera; 2] = [Camera::Still, Camera::Turning];

fn main() {
    divan::main();
}

fn measure(bencher: Bencher, stage: Stage, size: (usize, usize), camera: Camera) {
    let stages = RefCell::new(Stages::warmed_up(size, camera, 1));
    bencher
        .with_inputs(|| stages.borrow_mut().next_before(stage))
        .bench_local_values(|picture| stages.borrow_mut().pass(stage, picture));
}

fn arguments() -> impl Iterator<Item = String> {
    SIZES.iter().flat_map(|size| CAMERAS.map(|camera| format!("{}x{} {camera:?}", size.0, size.1)))
}

fn read(argument: &str) -> ((usize, usize), Camera) {
    let found = SIZES.iter().flat_map(|size| CAMERAS.map(|camera| (*size, camera)));
    let mut named = found.zip(arguments());
    named.find(|(_, name)| name == argument).map_or((SIZES[0], Camera::Still), |(found, _)| found)
}

#[divan::bench(args = arguments(), sample_count = 60, sample_size = 1)]
fn bgavgdetect(bencher: Bencher, argument: &str) {
    let (size, camera) = read(argument);
    measure(bencher, Stage::Detect, size, camera);
}

#[divan::bench(args = arguments(), sample_count = 60, sample_size = 1)]
fn lkfeaturetrack(bencher: Bencher, argument: &str) {
    let (size, camera) = read(argument);
    measure(bencher, Stage::Track, size, camera);
}

#[divan::bench(args = arguments(), sample_count = 60, sample_size = 1)]
fn ptzoverlay(bencher: Bencher, argument: &str) {
    let (size, camera) = read(argument);
    measure(bencher, Stage::Overlay, size, camera);
}
