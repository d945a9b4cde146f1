// SPDX-License-Identifier: MPL-2.0

//! The command line.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use onvif::VideoStream;
use pipeline_supervisor::video::rtsp_host;

use crate::ask_events::AskEvents;
use crate::config::{CameraSettings, Codec, Credentials, Protocol, Secret, Watchdogs};
use crate::discovery::{Found, ask};
use crate::event::{Event, Level};
use crate::log::{Format, Log};
use crate::point::Point;
use crate::shard::Shard;

/// Follows people with pan-tilt-zoom network cameras by itself.
///
/// Each camera is a pipeline of its own, which comes back by itself where its picture is lost. SIGTERM and SIGINT end with every
/// camera at rest.
#[derive(Debug, Parser)]
#[command(name = "ptztrack", version)]
pub struct Options {
    #[command(subcommand)]
    pub command: Task,
    /// How what happens is written to standard error
    #[arg(long, global = true, value_enum, default_value = "text")]
    pub log_format: Format,
}

#[derive(Debug, Subcommand)]
pub enum Task {
    /// Follow with all cameras of a file; SIGHUP reads it again and touches only what changed
    Run {
        /// The file; `ptztrack example-config` prints one with everything in it
        file: PathBuf,
        #[command(flatten)]
        serving: Serving,
        /// Only this process' share of the cameras: 0/10 to 9/10 for ten processes that read the same file
        #[arg(long, value_name = "NUMBER/OF")]
        shard: Option<Shard>,
        #[command(flatten)]
        watchdogs: Watchdogs,
    },
    /// List the cameras of this network segment: name, address, what they are spoken to by, and whether they turn
    Discover {
        /// How long to wait for answers, in seconds
        #[arg(long, value_name = "SECONDS", default_value = "3", value_parser = seconds)]
        wait: Duration,
    },
    /// Tell a running ptztrack that the middle of a camera's picture shows this place of another one's, for it to learn
    Point(Point),
    /// Follow with one camera, without a file
    Follow(Box<Follow>),
    /// Read a file and name every mistake in it, with its line, and what this machine lacks for a camera
    Check {
        /// The file
        file: PathBuf,
    },
    /// List who was followed, when and where, the latest last
    Events(AskEvents),
    /// Print a file with everything in it, commented
    ExampleConfig,
    /// Be the process of one camera, for a `ptztrack` that is on the other side of standard input
    #[command(hide = true)]
    Camera {
        /// Its name, for lists of processes
        name: String,
    },
    /// Write the manual pages into a folder
    #[command(hide = true)]
    Man {
        /// The folder
        folder: PathBuf,
    },
}

#[derive(Debug, Args)]
pub struct Serving {
    /// Serve the page, /metrics and /healthz there, instead of what the file says
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub http: Option<SocketAddr>,
}

#[derive(Debug, Args)]
pub struct Follow {
    /// The camera: a host name or an address, for example 192.168.0.90 or https://192.168.0.90
    address: String,
    /// Protocol; if not given, VAPIX is tried, then ONVIF
    #[arg(long, value_enum)]
    protocol: Option<Protocol>,
    /// Account with the right to control PTZ; its password is in the environment variable CAMERA_PASSWORD or in a file
    #[arg(long)]
    user: Option<String>,
    /// File with the password
    #[arg(long, value_name = "FILE", requires = "user")]
    password_file: Option<PathBuf>,
    /// How pictures come [default: by VAPIX mjpeg; by ONVIF that of the best-suited stream]
    #[arg(long, value_enum)]
    codec: Option<Codec>,
    /// The camera's RTSP server, for example rtsp://192.168.0.90:554
    #[arg(long, value_name = "ADDRESS")]
    rtsp: Option<String>,
    /// Size of the picture, for example 640x480; by ONVIF the stream is taken that comes nearest
    #[arg(long, value_parser = |text: &str| crate::config::size(text).ok_or("width and height in pixels, as 640x480"))]
    size: Option<(u32, u32)>,
    /// Pictures per second; with ONVIF it is set on the camera's own pages
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=60))]
    rate: Option<u32>,
    /// Show the picture in a window
    #[arg(long)]
    show: bool,
    #[command(flatten)]
    pub serving: Serving,
}

impl Follow {
    /// The camera that was meant, as it answers.
    ///
    /// # Errors
    /// What is wrong with it.
    pub async fn camera(&self, log: &Log) -> Result<CameraSettings, String> {
        self.check(log)?;
        let credentials =
            self.user.as_ref().map(|user| self.password().map(|password| (user, password))).transpose()?;
        let credentials = credentials.map(|(user, password)| Credentials { user: user.clone(), password });
        let found = ask(&self.address, self.protocol, credentials.as_ref()).await?;
        let Found { protocol, address, streams } = found;
        let best = VideoStream::best(&streams, self.codec.and_then(Codec::encoding), self.size);
        let codec = match (self.codec, best) {
            (Some(codec), _) => codec,
            (None, Some(best)) => Codec::of(best.encoding).unwrap_or(Codec::usual(protocol)),
            (None, None) => Codec::usual(protocol),
        };
        codec.check(protocol)?;
        if protocol == Protocol::Onvif && self.rate.is_some() {
            return Err("with ONVIF the rate is set on the camera's own pages: leave out --rate".to_owned());
        }
        let stream = best.map_or_else(String::new, |best| format!(", its stream is {best}"));
        log.info("found", format!("{address} speaks {}{stream}", protocol.name()));
        let camera = CameraSettings {
            rtsp: self.rtsp.as_deref().map(|rtsp| rtsp.trim_end_matches('/').to_owned()),
            codec,
            size: self.size,
            rate: self.rate,
            show: self.show,
            credentials,
            ..CameraSettings::at("camera", protocol, &address)?
        };
        camera.lacks().map_or(Ok(camera), Err)
    }

    /// What can be wrong before anybody is asked.
    fn check(&self, log: &Log) -> Result<(), String> {
        if self.rtsp.as_deref().is_some_and(|rtsp| rtsp_host(rtsp).is_none()) {
            return Err("--rtsp needs an address such as rtsp://192.168.0.90:554".to_owned());
        }
        // Some sinks for windows crash without one, and a few need none.
        if self.show && ["DISPLAY", "WAYLAND_DISPLAY"].iter().all(|name| std::env::var_os(name).is_none()) {
            let detail = "neither DISPLAY nor WAYLAND_DISPLAY is set: if this ends here, leave out --show, or look at the page by \
                          --http 127.0.0.1:9100";
            log.tell(&Event::new(Level::Warning, None, "no-display", detail));
        }
        Ok(())
    }

    fn password(&self) -> Result<Secret, String> {
        match &self.password_file {
            Some(file) => Secret::from_file(file),
            None => std::env::var("CAMERA_PASSWORD").map(Secret::new).map_err(|_| {
                "--user needs a password: in the environment variable CAMERA_PASSWORD, or --password-file"
                    .to_owned()
            }),
        }
    }
}

fn seconds(text: &str) -> Result<Duration, &'static str> {
    let seconds = text.parse().ok().filter(|seconds| (0.1..=60.0).contains(seconds));
    seconds.map(Duration::from_secs_f64).ok_or("a number from 0.1 to 60")
}
