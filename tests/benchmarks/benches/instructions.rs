// SPDX-License-Identifier: MPL-2.0

//! Instructions that each element takes, which vary less than time does: `make bench-check` compares them with
//! `tests/benchmarks/instructions.csv`.

#![allow(missing_docs, reason = "what the macros make has none")]

use gungraun::{Callgrind, LibraryBenchmarkConfig, library_benchmark, library_benchmark_group, main};
use ptztrack_benchmarks::{Camera, Stage, Stages};

const SIZE: (usize, usize) = (1280, 720);
/// Pictures that are counted together: what is done every few pictures is among them.
const PICTURES: usize = 12;

/// A crowd.
const CROWD: u64 = 8;

/// Elements that follow one of so many people, and what reaches `stage` next.
fn warmed_up(stage: Stage, camera: Camera, people: u64) -> (Stages, Stage, Vec<gst::Buffer>) {
    let mut stages = Stages::warmed_up(SIZE, camera, people);
    let pictures = (0..PICTURES).map(|_| stages.next_before(stage)).collect();
    (stages, stage, pictures)
}

#[library_benchmark(setup = warmed_up)]
#[bench::detect_still(Stage::Detect, Camera::Still, 1)]
#[bench::detect_turning(Stage::Detect, Camera::Turning, 1)]
#[bench::track_still(Stage::Track, Camera::Still, 1)]
#[bench::track_turning(Stage::Track, Camera::Turning, 1)]
#[bench::overlay_still(Stage::Overlay, Camera::Still, 1)]
#[bench::overlay_turning(Stage::Overlay, Camera::Turning, 1)]
#[bench::detect_crowd_still(Stage::Detect, Camera::Still, CROWD)]
#[bench::detect_crowd_turning(Stage::Detect, Camera::Turning, CROWD)]
#[bench::track_crowd_still(Stage::Track, Camera::Still, CROWD)]
#[bench::track_crowd_turning(Stage::Track, Camera::Turning, CROWD)]
#[bench::overlay_crowd_still(Stage::Overlay, Camera::Still, CROWD)]
#[bench::overlay_crowd_turning(Stage::Overlay, Camera::Turning, CROWD)]
fn pass((mut stages, stage, pictures): (Stages, Stage, Vec<gst::Buffer>)) -> Stages {
    for picture in pictures {
        stages.pass(stage, picture);
    }
    stages
}

library_benchmark_group!(name = elements, benchmarks = pass);

main!(
    config = LibraryBenchmarkConfig::default()
        .tool(Callgrind::with_args(["--cache-sim=no"]))
        // Which instructions a processor has decides what OpenCV and glibc do: the same ones everywhere. No plugin is needed but
        // ours, which is linked in.
        .envs([
            ("OPENCV_CPU_DISABLE", "AVX512_SKX,AVX2,AVX,FP16"),
            ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX512F,-AVX2,-AVX"),
            ("GST_REGISTRY_DISABLE", "yes"),
        ]),
    library_benchmark_groups = elements
);
