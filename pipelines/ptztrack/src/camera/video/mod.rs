// SPDX-License-Identifier: MPL-2.0

//! The way to a camera's pictures. GStreamer's own sources tell user and password to anybody who asks for them in the camera's
//! place, and show them in their properties; so they are told neither. The camera is logged in to here, by the rules that PTZ
//! goes by: by Digest, or over verified TLS, and nowhere but at its own address.
//!
//! ```text
//! MJPEG:  camera ─ session::http::HttpClient ─ appsrc
//! RTSP:   camera ─ relay ─ 127.0.0.1 ─ rtspsrc
//! ```

mod http;
mod onvif;
mod rtsp;
mod rtsp_message;

use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use gst_app::AppSrc;
use session::Error;
use session::http::{ClientSettings, Credentials, Location, Secret};

use crate::config::{CameraSettings, Codec, Protocol, RTSP_PORT};

/// Without anything new for so long the way is no way any more.
const LONGEST_SILENCE: Duration = Duration::from_secs(1);
/// For the first: to log in over a long way, and for the camera to start an encoder.
const LONGEST_START: Duration = Duration::from_secs(4);

/// To ask a camera where its streams are, which takes some seven questions.
const LONGEST_ASKING: Duration = Duration::from_secs(7);

/// Why there are no pictures.
#[derive(Debug, Clone)]
pub struct Failure {
    pub reason: String,
    /// User and password are refused: to go on trying could lock the account.
    pub refused: bool,
}

/// What ended the way to a camera's pictures, where that is known.
pub type Ended = Arc<Mutex<Option<Failure>>>;

/// A way that is open.
#[derive(Debug)]
pub enum Video {
    /// The camera sends already: to whoever is handed over.
    Http(SyncSender<AppSrc>),
    /// `rtspsrc` finds the camera there.
    Rtsp(String),
}

impl Failure {
    pub fn new(reason: impl ToString) -> Self {
        Self { reason: reason.to_string(), refused: false }
    }
}

impl From<Error> for Failure {
    fn from(err: Error) -> Self {
        Self { reason: format!("{err}. {}", err.advice()), refused: err.is_final() }
    }
}

impl Video {
    /// Opens a way to the pictures of a camera. Waits no longer than it takes to log in; a name server that never answers keeps
    /// a thread, but nobody who waits for it.
    ///
    /// # Errors
    /// Why there is none.
    pub fn open(camera: &CameraSettings, ended: Ended) -> Result<Self, Failure> {
        let (report, opened) = sync_channel(1);
        let settings = client_settings(camera)?;
        let asked = camera.clone();
        thread::Builder::new()
            .name(format!("{}-video", camera.name))
            .spawn(move || {
                let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
                    Ok(runtime) => runtime,
                    Err(err) => return drop(report.try_send(Err(Failure::new(err)))),
                };
                runtime.block_on(async {
                    if asked.codec == Codec::Mjpeg {
                        return http::carry(settings, &target(&asked), &report).await;
                    }
                    let found = match asked.protocol {
                        Protocol::Vapix => Ok((asked.rtsp_server(RTSP_PORT), target(&asked))),
                        Protocol::Onvif => onvif::find(settings.clone(), &asked).await,
                    };
                    match found {
                        Ok((server, target)) => {
                            rtsp::carry(&settings, &server, &target, &report, &ended).await
                        }
                        // Who waited for it may have given up.
                        Err(failure) => drop(report.try_send(Err(failure))),
                    }
                });
                // A look-up of a name is not waited for.
                runtime.shutdown_background();
            })
            .map_err(Failure::new)?;
        let no_answer = |_| Err(Failure::new(Error::Timeout(LONGEST_START)));
        let asking = if camera.protocol == Protocol::Onvif { LONGEST_ASKING } else { Duration::ZERO };
        opened.recv_timeout(asking + LONGEST_START + LONGEST_SILENCE).unwrap_or_else(no_answer)
    }
}

fn client_settings(camera: &CameraSettings) -> Result<ClientSettings, Failure> {
    let (authentication, trust) = camera.security();
    let credentials = camera.credentials.as_ref();
    Ok(ClientSettings {
        location: Location::parse(&camera.address)?.0,
        channel: String::new(),
        credentials: credentials.map(|credentials| Credentials {
            user: credentials.user.clone(),
            password: Secret::new(credentials.password.reveal()),
        }),
        authentication,
        timeout: LONGEST_SILENCE,
        trust,
    })
}

/// Path and query of a camera's pictures by VAPIX.
pub fn target(camera: &CameraSettings) -> String {
    let size = camera.size.map(|(width, height)| format!("resolution={width}x{height}"));
    let rate = camera.rate.map(|rate| format!("fps={rate}"));
    let (path, first) = match camera.codec {
        Codec::Mjpeg => ("/axis-cgi/mjpg/video.cgi", "compression=30"),
        Codec::Mpeg4 => ("/axis-media/media.amp", "videocodec=mpeg4"),
        Codec::H264 => ("/axis-media/media.amp", "videocodec=h264"),
        Codec::H265 => ("/axis-media/media.amp", "videocodec=h265"),
    };
    let query: Vec<String> = [Some(first.to_owned()), size, rate].into_iter().flatten().collect();
    format!("{path}?{}", query.join("&"))
}
