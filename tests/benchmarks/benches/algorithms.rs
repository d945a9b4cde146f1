// SPDX-License-Identifier: MPL-2.0

//! What looks at whole pictures, each by itself, from 640x480 to 3840x2160: time a picture. The tracker, which needs all that
//! comes before it, is measured as an element.

use divan::Bencher;
use gstptztrack::vision::{
    Background, CameraMotionEstimator, Chroma, ForegroundTest, Luma, Picture, Reduced, Samples, SceneModel,
    TravellingBackground, Way,
};
use ptztrack_benchmarks::{Camera, Footage};
use ptztrack_contract::CameraMotion;
use std::time::Duration;

const SIZES: [(usize, usize); 4] = [(640, 480), (1280, 720), (1920, 1080), (3840, 2160)];
/// Pictures that are shown again and again, there and back.
const PICTURES: u64 = 12;
/// Of the elements: pictures wider than this are reduced.
const ANALYSIS_WIDTH: usize = 400;
const PERIOD: Duration = Duration::from_millis(40);

fn main() {
    divan::main();
}

/// A film that never ends: the camera turns to and fro.
struct Film {
    size: (usize, usize),
    pictures: Vec<Vec<u8>>,
    next: usize,
}

impl Film {
    fn new(size: (usize, usize), camera: Camera) -> Self {
        let footage = Footage::new(size, camera, 1);
        let there = (0..PICTURES).map(|number| footage.picture(number));
        let mut pictures: Vec<_> = there.collect();
        let back: Vec<_> = pictures[1..pictures.len() - 1].iter().rev().cloned().collect();
        pictures.extend(back);
        Self { size, pictures, next: 0 }
    }

    fn show<T>(&mut self, look: impl FnOnce(&Picture) -> T) -> T {
        let (width, height) = self.size;
        let (luma, chroma) = self.pictures[self.next].split_at(width * height);
        self.next = (self.next + 1) % self.pictures.len();
        let (u, v) = chroma.split_at(chroma.len() / 2);
        let samples = |plane| Samples::new(plane, (width / 2, height / 2), width / 2, 0, 1);
        let chroma = samples(u).ok().zip(samples(v).ok()).map(|(u, v)| Chroma::Yuv([u, v]));
        look(&Picture { luma: Luma::packed(luma, width), chroma })
    }

    fn reduced_size(&self) -> (usize, usize) {
        let divisor = self.size.0.div_ceil(ANALYSIS_WIDTH);
        (self.size.0 / divisor, self.size.1 / divisor)
    }

    /// The next picture, reduced.
    fn reduce(&mut self, reduced: &mut Reduced) {
        let size = self.reduced_size();
        self.show(|picture| reduced.fill(picture, size));
    }
}

#[divan::bench(args = SIZES)]
fn reduce(bencher: Bencher, size: (usize, usize)) {
    let (mut film, mut reduced) = (Film::new(size, Camera::Still), Reduced::default());
    bencher.bench_local(|| film.reduce(&mut reduced));
}

#[divan::bench(args = SIZES)]
fn camera_motion(bencher: Bencher, size: (usize, usize)) {
    let (mut film, mut reduced) = (Film::new(size, Camera::Turning), Reduced::default());
    let mut motion = CameraMotionEstimator::default();
    bencher
        .with_inputs(|| {
            film.reduce(&mut reduced);
            std::mem::take(&mut reduced)
        })
        .bench_local_refs(|reduced| motion.update(&reduced.luma(), None, None, PERIOD).map(|_| ()));
}

fn travelling(bencher: Bencher, size: (usize, usize), camera: Camera) {
    let (mut film, mut reduced) = (Film::new(size, camera), Reduced::default());
    let (mut motion, mut background) = (CameraMotionEstimator::default(), TravellingBackground::default());
    bencher
        .with_inputs(|| {
            film.reduce(&mut reduced);
            let moved = motion.update(&reduced.luma(), None, None, PERIOD).ok().flatten();
            (std::mem::take(&mut reduced), moved)
        })
        .bench_local_refs(|(reduced, moved): &mut (Reduced, Option<CameraMotion>)| {
            background.update(reduced, moved.as_ref().map(|moved| &moved.homography), Way::Known, PERIOD).map(|_| ())
        });
}

#[divan::bench(args = SIZES)]
fn travelling_background_at_rest(bencher: Bencher, size: (usize, usize)) {
    travelling(bencher, size, Camera::Still);
}

#[divan::bench(args = SIZES)]
fn travelling_background_turning(bencher: Bencher, size: (usize, usize)) {
    travelling(bencher, size, Camera::Turning);
}

/// The three above, as the detector has them.
#[divan::bench(args = SIZES)]
fn scene_turning(bencher: Bencher, size: (usize, usize)) {
    let (mut film, mut scene) = (Film::new(size, Camera::Turning), SceneModel::default());
    bencher
        .bench_local(|| film.show(|picture| scene.update(picture, ANALYSIS_WIDTH, PERIOD, None).map(|_| ())));
}

/// The thesis' running mean, of every pixel.
#[divan::bench(args = SIZES)]
fn running_mean(bencher: Bencher, size: (usize, usize)) {
    let (mut film, mut background) = (Film::new(size, Camera::Still), Background::default());
    let test = ForegroundTest::Relative { threshold: 0.15 };
    let mut mask = vec![0; size.0 * size.1];
    bencher.bench_local(|| film.show(|picture| background.update(&picture.luma, 0.1, test, &mut mask)));
}
