// SPDX-License-Identifier: MPL-2.0

//! What it costs that each camera has a process of its own: has one program follow with one camera and with several, without `isolation`
//! and with it, and prints a table in Markdown of the memory and the processor time that it takes with its cameras' processes.
//!
//! ```sh
//! cargo build --release --workspace --lib --bins && cargo run --release --example isolation
//! ```
//!
//! Memory is the proportional set size (PSS): what several processes share, as their libraries, is divided among them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use end_to_end::{Program, Usage, scene};
use virtual_camera::VirtualCamera;

#[derive(Parser)]
struct Options {
    /// Compared with one.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..))]
    cameras: u32,
    /// Seconds that are measured of each, after as many as everything takes to begin.
    #[arg(long, default_value_t = 120)]
    duration: u64,
    /// Of their pictures, which are drawn on the same machine: a second.
    #[arg(long, default_value_t = 5.0)]
    frame_rate: f64,
}

/// Until pictures come of all cameras, somebody is followed, and memory has grown as far as it does.
const BEGIN: Duration = Duration::from_secs(30);

/// Of a program and all its cameras' processes.
struct Cost {
    memory_mb: f64,
    cores: f64,
    pictures: f64,
}

fn main() {
    let options = Options::parse();
    let several = options.cameras;
    println!(
        "| `isolation`, {} pictures a second of 320x240 | memory with one camera, MB | with {several} | for each one more | processor, \
         cores a camera | ms a picture |\n|---|---:|---:|---:|---:|---:|",
        options.frame_rate
    );
    for isolation in ["none", "process"] {
        let [one, all] = [1, several].map(|cameras| measure(isolation, cameras, &options));
        println!(
            "| `{isolation}` | {:.0} | {:.0} | {:.1} | {:.3} | {:.2} |",
            one.memory_mb,
            all.memory_mb,
            (all.memory_mb - one.memory_mb) / f64::from(several - 1),
            all.cores / f64::from(several),
            1000.0 * all.cores * options.duration as f64 / all.pictures,
        );
    }
}

fn measure(isolation: &str, cameras: u32, options: &Options) -> Cost {
    let duration = Duration::from_secs(options.duration);
    let camera = |_| VirtualCamera::start(scene::walking_person_at(options.frame_rate, duration)).unwrap();
    let cameras: Vec<_> = (0..cameras).map(camera).collect();
    let program = Program::start("isolation", |own| file(&cameras, isolation, own), &[]);
    let own = match isolation {
        "process" => cameras.len(),
        _ => 0,
    };
    let mut processes = vec![program.launch.id()];
    processes.extend((0..own).map(|number| program.process_of(&name(number))));
    thread::sleep(BEGIN);
    let begin = Instant::now();
    let pictures = program.metric("ptztrack_pictures_total");
    let usage = |process: &u32, before: Option<&Usage>| Usage::of(*process, begin.elapsed(), before).unwrap();
    let before: Vec<_> = processes.iter().map(|process| usage(process, None)).collect();
    thread::sleep(duration);
    let pictures = program.metric("ptztrack_pictures_total") - pictures;
    let after = processes.iter().zip(&before).map(|(process, before)| usage(process, Some(before)));
    let cores = after.map(|usage| usage.cores).sum();
    let memory_mb = processes.iter().map(|process| proportional_mb(*process)).sum();
    program.end("TERM");
    Cost { memory_mb, cores, pictures }
}

fn name(number: usize) -> String {
    format!("camera-{number}")
}

fn file(cameras: &[VirtualCamera], isolation: &str, own: &Path) -> String {
    let entry = |(number, camera): (usize, &VirtualCamera)| {
        Program::entry(&name(number), &camera.url(), &own.join("password"))
            + &format!("isolation = \"{isolation}\"\n")
    };
    cameras.iter().enumerate().map(entry).collect()
}

/// What a process has of the memory (proc_pid_smaps(5)).
fn proportional_mb(process: u32) -> f64 {
    let rollup = fs::read_to_string(format!("/proc/{process}/smaps_rollup")).unwrap();
    let pss = rollup.lines().find_map(|line| line.strip_prefix("Pss:")).unwrap();
    pss.split_whitespace().next().unwrap().parse::<f64>().unwrap() / 1024.0
}
