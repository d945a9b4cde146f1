// SPDX-License-Identifier: MPL-2.0

//! Lets four cameras be followed for a while, by two codecs, while everything happens to them and to those who follow; and
//! gives an account: every camera at rest, nothing grown, nothing lost. Otherwise the exit status is 1.
//!
//! ```sh
//! make soak    # DURATION=600 seconds, SEED=1; leaves samples.csv, soak.png and account.md in target/soak
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod account;
mod camera;
mod fault;
mod known;
mod sample;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use account::Account;
use camera::Camera;
use clap::Parser;
use end_to_end::Watchdog;
use sample::Samples;

#[derive(Parser)]
struct Options {
    /// Seconds.
    #[arg(long, default_value_t = 600)]
    duration: u64,
    /// Another one is another course of events.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where samples, plot and account go.
    #[arg(long, default_value = "target/soak")]
    out: PathBuf,
}

/// Samples in all.
const SAMPLES: u32 = 120;

fn main() -> ExitCode {
    let options = Options::parse();
    std::fs::create_dir_all(&options.out).unwrap();
    let duration = Duration::from_secs(options.duration);
    let watchdog = Watchdog::new("soak");
    let cameras: Vec<_> =
        (0..4).map(|number| Camera::start(number, options.seed, duration, &watchdog)).collect();
    let over = AtomicBool::new(false);
    let mut samples = Samples::default();
    let accounts: Vec<Account> = std::thread::scope(|scope| {
        let runs: Vec<_> = cameras
            .into_iter()
            .map(|camera| {
                let probe = camera.probe();
                let over = &over;
                (probe, scope.spawn(move || camera.run(over)))
            })
            .collect();
        let begin = Instant::now();
        for at in 1..=SAMPLES {
            let due = duration * at / SAMPLES;
            std::thread::sleep(due.saturating_sub(begin.elapsed()));
            runs.iter().for_each(|(probe, _)| samples.take(begin.elapsed(), probe));
        }
        over.store(true, Ordering::Relaxed);
        runs.into_iter().map(|(_, run)| run.join().unwrap()).collect()
    });
    watchdog.wait_for("watchdogs that have nothing more to do", <[u32]>::is_empty);
    samples.write(&options.out);
    match account::tell(&accounts, &samples, &options.out) {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}
