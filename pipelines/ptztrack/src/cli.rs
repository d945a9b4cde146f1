// SPDX-License-Identifier: MPL-2.0

//! The command line.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use crate::config::{CameraSettings, Codec, Credentials, Secret};
use crate::log::Format;
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
        /// Socket of a `vapix-watchdog --listen` that stops the cameras if this process dies; else one is started
        #[arg(long, value_name = "SOCKET")]
        watchdog: Option<String>,
    },
    /// Follow with one camera, without a file
    Follow(Box<Follow>),
    /// Read a file and name every mistake in it, with its line, and what this machine has not got for a camera
    Check {
        /// The file
        file: PathBuf,
    },
    /// Print a file with everything in it, commented
    ExampleConfig,
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
    /// The camera, for example http://192.168.0.90
    address: String,
    /// Account with the right to control PTZ; its password is in the environment variable CAMERA_PASSWORD or in a file
    #[arg(long)]
    user: Option<String>,
    /// File with the password
    #[arg(long, value_name = "FILE", requires = "user")]
    password_file: Option<PathBuf>,
    /// How pictures come
    #[arg(long, value_enum, default_value = "mjpeg")]
    codec: Codec,
    /// The camera's RTSP server, for example rtsp://192.168.0.90:554
    #[arg(long, value_name = "ADDRESS")]
    rtsp: Option<String>,
    /// Size of the picture, for example 640x480
    #[arg(long, value_parser = |text: &str| crate::config::size(text).ok_or("width and height in pixels, as 640x480"))]
    size: Option<(u32, u32)>,
    /// Pictures per second
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=60))]
    rate: Option<u32>,
    /// Show the picture in a window
    #[arg(long)]
    show: bool,
    #[command(flatten)]
    pub serving: Serving,
}

impl Follow {
    /// The camera that was meant.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn camera(&self) -> Result<CameraSettings, String> {
        let camera = CameraSettings::at("camera", &self.address)?;
        let rtsp = self.rtsp.as_deref().map_or(camera.rtsp, |rtsp| rtsp.trim_end_matches('/').to_owned());
        let credentials =
            self.user.as_ref().map(|user| self.password().map(|password| (user, password))).transpose()?;
        let camera = CameraSettings {
            rtsp,
            codec: self.codec,
            size: self.size,
            rate: self.rate,
            show: self.show,
            credentials: credentials.map(|(user, password)| Credentials { user: user.clone(), password }),
            ..camera
        };
        camera.lacks().map_or(Ok(camera), Err)
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
