// SPDX-License-Identifier: MPL-2.0

//! Where a camera has its streams, by ONVIF.

use ::onvif::{Client, VideoStream};
use session::Client as _;
use session::http::ClientSettings;

use pipeline_supervisor::video::Failure;

use crate::config::CameraSettings;

/// Address of the RTSP server, and path and query of the stream of the codec that is set, nearest to the size that is.
///
/// # Errors
/// Why there is none.
pub async fn find(settings: ClientSettings, camera: &CameraSettings) -> Result<(String, String), Failure> {
    let mut client = Client::new(settings)?;
    let streams = client.streams().await?;
    let best =
        camera.codec.encoding().and_then(|encoding| VideoStream::best(&streams, Some(encoding), camera.size));
    let Some(best) = best else {
        let there: Vec<_> = streams.iter().map(ToString::to_string).collect();
        return Err(Failure::new(format!(
            "the camera has no stream of the `codec` that is set; it has {}",
            if there.is_empty() { "none".to_owned() } else { there.join(", ") }
        )));
    };
    let address = client.stream_address(best).await?;
    Ok((camera.rtsp_server(address.port), address.target))
}
