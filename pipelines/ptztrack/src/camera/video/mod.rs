// SPDX-License-Identifier: MPL-2.0

//! The way to the pictures of a camera of the file.

mod onvif;

use std::time::Duration;

use pipeline_supervisor::video::{Ended, Failure, LONGEST_SILENCE, Video};
use session::http::{ClientSettings, Credentials, Location, Secret};

use crate::config::{CameraSettings, Codec, Protocol, RTSP_PORT};

/// To ask a camera where its streams are, which takes some seven questions.
const LONGEST_ASKING: Duration = Duration::from_secs(7);

/// Opens it.
///
/// # Errors
/// Why there is none.
pub fn open(camera: &CameraSettings, ended: Ended) -> Result<Video, Failure> {
    let settings = client_settings(camera)?;
    if camera.codec == Codec::Mjpeg {
        return Video::http(&camera.name, settings, target(camera));
    }
    let (asked, asks) = (camera.clone(), settings.clone());
    let find = move || async move {
        match asked.protocol {
            Protocol::Vapix => Ok((asked.rtsp_server(RTSP_PORT), target(&asked))),
            Protocol::Onvif => onvif::find(asks, &asked).await,
        }
    };
    let asking = if camera.protocol == Protocol::Onvif { LONGEST_ASKING } else { Duration::ZERO };
    Video::rtsp(&camera.name, settings, find, asking, ended)
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
