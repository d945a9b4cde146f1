// SPDX-License-Identifier: MPL-2.0

//! Lets cameras be followed by the program for a while, by two codecs, with recordings, a page that is looked at and a broker,
//! while everything happens to them and to it; and gives an account: every camera at rest, nothing grown, nothing lost. Otherwise the
//! exit status is 1.
//!
//! ```sh
//! make soak    # DURATION=600 seconds, SEED=1; leaves samples.csv, soak.png and account.md in target/soak
//! target/debug/soak --reconnects 40000 --cameras 12    # connections that end, and nothing else, so many of all cameras
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod account;
mod camera;
mod fault;
mod known;
mod sample;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use account::Account;
use camera::Camera;
use clap::Parser;
use end_to_end::{Broker, Watchdog};
use sample::Samples;

#[derive(Parser)]
struct Options {
    /// Seconds.
    #[arg(long, default_value_t = 600)]
    duration: u64,
    /// Instead: until so many connections have ended, of all cameras.
    #[arg(long, default_value_t = 0)]
    reconnects: u64,
    /// Each with a program of its own.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u64).range(1..))]
    cameras: u64,
    /// Another one is another course of events.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where samples, plot and account go.
    #[arg(long, default_value = "target/soak")]
    out: PathBuf,
}

/// A sample for each of so many parts of the time, or as often as this where nobody knows how long it will take.
const SAMPLES: u32 = 120;
const SAMPLE_EVERY: Duration = Duration::from_secs(5);
/// A person walks up and down for so long, once the time is over or where nobody knows: more than a night.
const LONGEST: Duration = Duration::from_secs(100_000);

fn main() -> ExitCode {
    let options = Options::parse();
    std::fs::create_dir_all(&options.out).unwrap();
    let duration = Duration::from_secs(options.duration);
    let (every, lasts) = match options.reconnects {
        0 => (duration / SAMPLES, duration + Duration::from_secs(600)),
        _ => (SAMPLE_EVERY, LONGEST),
    };
    let watchdog = Watchdog::new("soak");
    let broker = Broker::start();
    let start = |number: u64| Camera::start(number as usize, options.seed, lasts, &watchdog, &broker);
    let cameras: Vec<_> = (0..options.cameras).map(start).collect();
    let begin = Instant::now();
    let mut samples = Samples::default();
    let accounts: Vec<Account> = std::thread::scope(|scope| {
        let runs: Vec<_> = cameras
            .into_iter()
            .map(|camera| {
                let probe = camera.probe();
                let run = move || match options.reconnects {
                    0 => camera.run(|| begin.elapsed() >= duration),
                    reconnects => camera.reconnect(reconnects.div_ceil(options.cameras)),
                };
                (probe, scope.spawn(run))
            })
            .collect();
        // As long as all go on: what ends takes less and less.
        while !runs.iter().any(|(_, run)| run.is_finished())
            && (options.reconnects > 0 || begin.elapsed() < duration)
        {
            std::thread::sleep(every);
            runs.iter().for_each(|(probe, _)| samples.take(begin.elapsed(), probe));
        }
        runs.into_iter().map(|(_, run)| run.join().unwrap()).collect()
    });
    watchdog.wait_for("watchdogs that have nothing more to do", <[u32]>::is_empty);
    samples.write(&options.out);
    match account::tell(&accounts, &samples, &options.out) {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}
