// SPDX-License-Identifier: MPL-2.0

//! The virtual camera as a program.

mod cli;
mod log;

use std::{io::Write, process::ExitCode, time::Duration};

use clap::Parser;
use virtual_camera::{Settings, VirtualCamera};

use cli::Options;
use log::Log;

fn main() -> ExitCode {
    match run(Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("virtual-camera: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: Options) -> Result<(), Box<dyn std::error::Error>> {
    let log_file = options.log.clone();
    let camera = VirtualCamera::start(Settings::try_from(options)?)?;
    let mut log = log_file.map(|path| Log::create(&path, &camera)).transpose()?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let mut signals = Signals::new()?;
        // Whoever reads this may send a signal at once.
        println!("ready http={} rtsp={}", camera.url(), camera.rtsp_url());
        std::io::stdout().flush()?;
        loop {
            let tick = async {
                match &log {
                    Some(_) => tokio::time::sleep(Duration::from_millis(20)).await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                () = signals.next() => break,
                () = tick => {}
            }
            write(&mut log, &camera)?;
        }
        // Also what happened since the last look.
        write(&mut log, &camera)
    })?;
    Ok(())
}

fn write(log: &mut Option<Log>, camera: &VirtualCamera) -> std::io::Result<()> {
    log.as_mut().map_or(Ok(()), |log| log.write(camera))
}

/// What tells the program to end.
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
}

impl Signals {
    fn new() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self { interrupt: signal(SignalKind::interrupt())?, terminate: signal(SignalKind::terminate())? })
    }

    async fn next(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
        }
    }
}
