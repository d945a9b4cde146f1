// SPDX-License-Identifier: MPL-2.0

//! `ptztrack`: follows people with the cameras of a file, unattended. The pipelines are text, the elements are as they are.
//!
//! This is a program, and a library for who examines it only.

mod accounts_file;
mod ask_events;
mod camera;
mod cli;
mod config;
mod control_file;
mod discovery;
mod event;
mod fleet;
mod handover;
mod http;
mod log;
mod mqtt;
#[doc(hidden)]
pub mod parsers;
mod point;
mod report;
mod restream;
mod service;
mod services;
mod shard;
mod store;
mod waiting;

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{CommandFactory, Parser};
use cli::{Options, Task};
use config::{Config, NotLoaded, Store};
use log::Log;
use service::Origin;

/// The whole program.
pub fn main() -> ExitCode {
    #[cfg(target_env = "gnu")]
    limit_arenas();
    let options = Options::parse();
    match run(options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure { reason, status }) => {
            eprintln!("{reason}");
            status
        }
    }
}

/// `EX_CONFIG` of sysexits.h: starting again mends nothing, so the systemd unit does not.
const MISTAKEN_CONFIGURATION: u8 = 78;

/// Why the program ends, and its exit status.
struct Failure {
    reason: String,
    status: ExitCode,
}

impl From<String> for Failure {
    fn from(reason: String) -> Self {
        Self { reason, status: ExitCode::FAILURE }
    }
}

impl From<NotLoaded> for Failure {
    fn from(failure: NotLoaded) -> Self {
        match failure {
            NotLoaded::Mistaken(reason) => Self { reason, status: MISTAKEN_CONFIGURATION.into() },
            NotLoaded::Unreadable(reason) => reason.into(),
        }
    }
}

/// Has all threads take memory from two arenas. By default glibc makes up to eight for each core and spreads the threads of the
/// cameras over them: each grows for half an hour, until it has room for the most that its threads ever needed at once.
#[cfg(target_env = "gnu")]
fn limit_arenas() {
    // SAFETY: takes numbers only, and there is one thread yet.
    unsafe { libc::mallopt(libc::M_ARENA_MAX, 2) };
}

fn run(options: Options) -> Result<(), Failure> {
    gst::init().map_err(|err| err.to_string())?;
    let log = Arc::new(Log::new(options.log_format));
    match options.command {
        Task::Run { file, serving, shard, watchdogs } => {
            follow(Origin::File { path: file, shard, watchdogs, page: serving.http }, log)
        }
        Task::Follow(follow_one) => {
            let cameras = vec![runtime(1)?.block_on(follow_one.camera(&log))?];
            let store = Store { what: None, ..Store::default() };
            let config = Config {
                cameras,
                http: None,
                mqtt: Ok(None),
                hand_over: Vec::new(),
                store,
                zones: Vec::new(),
                restream: Ok(None),
            };
            let config = config.with_page_at(follow_one.serving.http)?;
            follow(Origin::CommandLine(Box::new(config)), log)
        }
        Task::Point(point) => {
            print!("{}", runtime(1)?.block_on(point.say())?);
            Ok(())
        }
        Task::Discover { wait } => Ok(runtime(1)?.block_on(discovery::discover(wait))?),
        Task::Check { file } => {
            let config = Config::load(&file)?;
            config.check_machine()?;
            println!("{} is valid; cameras: {}", file.display(), config.cameras.len());
            Ok(())
        }
        Task::Events(ask) => {
            let answer = ask.answer()?;
            // Whoever reads it may have seen enough.
            let _ = std::io::stdout().write_all(answer.as_bytes());
            Ok(())
        }
        Task::Camera { .. } => {
            let runtime = begin()?;
            let result = runtime.block_on(camera::process::child::run());
            runtime.shutdown_background();
            Ok(result.map_err(|err| err.to_string())?)
        }
        Task::Man { folder } => {
            Ok(clap_mangen::generate_to(Options::command(), folder).map_err(|err| err.to_string())?)
        }
        Task::ExampleConfig => {
            print!("{}", config::EXAMPLE);
            Ok(())
        }
    }
}

/// As many open files as the system lets us have: by default a process is content with 1024, at some twenty for each camera.
fn allow_descriptors() {
    let limit = rustix::process::getrlimit(rustix::process::Resource::Nofile);
    // Where it is refused, the default must do.
    let _ = rustix::process::setrlimit(
        rustix::process::Resource::Nofile,
        rustix::process::Rlimit { current: limit.maximum, ..limit },
    );
}

/// No core dump holds passwords: of 1 byte there is neither a file nor, as of 0 there may be, one that goes to a program
/// (core(5), `do_coredump` of Linux).
fn keep_secrets() {
    let none = rustix::process::Rlimit { current: Some(1), maximum: Some(1) };
    // Where it is refused, it is less than that already.
    let _ = rustix::process::setrlimit(rustix::process::Resource::Core, none);
}

fn follow(origin: Origin, log: Arc<Log>) -> Result<(), Failure> {
    let config = origin.read()?;
    let runtime = begin()?;
    let result = runtime.block_on(service::run(Arc::new(origin), config, log));
    // Whoever hangs is not waited for.
    runtime.shutdown_background();
    Ok(result?)
}

/// What a process needs that follows with cameras.
fn begin() -> Result<tokio::runtime::Runtime, Failure> {
    allow_descriptors();
    keep_secrets();
    // Libraries below GStreamer, GIO for one, count on somebody who runs the default main context.
    std::thread::Builder::new()
        .name("main-context".to_owned())
        .spawn(|| glib::MainLoop::new(None, false).run())
        .map_err(|err| err.to_string())?;
    Ok(runtime(2)?)
}

fn runtime(threads: usize) -> Result<tokio::runtime::Runtime, String> {
    let mut builder = tokio::runtime::Builder::new_multi_thread();
    builder.worker_threads(threads).enable_all().build().map_err(|err| err.to_string())
}
