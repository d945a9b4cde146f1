// SPDX-License-Identifier: MPL-2.0

//! MJPEG: one JPEG after the other in a response that never ends.

use std::{io::Write, sync::Arc, time::Duration};

use axum::{
    body::{Body, Bytes},
    extract::{RawQuery, State},
    http::header,
    response::{IntoResponse, Response},
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use super::Site;
use crate::{
    camera::Camera,
    encode::JpegEncoder,
    pace::Pace,
    vapix::parse_args,
    wish::{PictureError, Wish, argument},
};

/// Pictures under way to a slow client; further ones are dropped, as the camera does.
const QUEUED: usize = 2;

/// What ends a stream early.
struct End {
    after: Option<Duration>,
    pictures: Option<u64>,
}

pub(super) async fn video(
    State(site): State<Arc<Site>>,
    RawQuery(query): RawQuery,
) -> Result<Response, PictureError> {
    let args = parse_args(query.unwrap_or_default().as_bytes());
    let wish = Wish::parse(&args, &site.camera)?;
    let count = |name| argument(&args, name, |text| text.parse::<u64>().ok()).map(|n| n.filter(|&n| n > 0));
    let end = End { after: count("duration")?.map(Duration::from_secs), pictures: count("nbrofframes")? };
    let encoder = JpegEncoder::new(wish.size, wish.compression)?;
    let (sender, receiver) = mpsc::channel(QUEUED);
    let camera = site.camera.clone();
    site.streams
        .spawn("camera-mjpeg", move || stream(&camera, wish, &end, &encoder, &sender))
        .map_err(|_| PictureError::Encode(crate::EncodeError::Nothing))?;
    let body = Body::from_stream(ReceiverStream::new(receiver));
    let headers = [
        (header::CONTENT_TYPE, "multipart/x-mixed-replace;boundary=myboundary"),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    Ok((headers, body).into_response())
}

type Part = Result<Bytes, std::io::Error>;

fn stream(camera: &Arc<Camera>, wish: Wish, end: &End, encoder: &JpegEncoder, client: &mpsc::Sender<Part>) {
    let _viewer = camera.viewer_begins();
    let mut pace = Pace::new(wish.frame_rate, camera.newest_exposure());
    let first = pace.next_exposure();
    let (mut sent, mut last) = (0, None);
    loop {
        let exposure = pace.next_exposure();
        let over = end.after.is_some_and(|after| exposure.saturating_sub(first) > after)
            || end.pictures.is_some_and(|pictures| sent >= pictures);
        if over || client.is_closed() || !camera.wait_until(camera.arrival(exposure)) {
            return;
        }
        let picture = camera
            .sent_picture(exposure, wish.size, &mut last)
            .ok()
            .and_then(|picture| encoder.encode(&picture).ok());
        let Some(jpeg) = picture else {
            return;
        };
        match client.try_send(Ok(part(&jpeg, sent == 0).into())) {
            Ok(()) => sent += 1,
            Err(mpsc::error::TrySendError::Full(_)) => {}
            Err(mpsc::error::TrySendError::Closed(_)) => return,
        }
        pace.advance(camera.oldest_pending());
    }
}

/// One part with the boundary that follows it, so that the client knows at once that it is complete.
fn part(jpeg: &[u8], first: bool) -> Vec<u8> {
    let mut part = Vec::with_capacity(jpeg.len() + 100);
    if first {
        part.extend_from_slice(b"--myboundary\r\n");
    }
    // Writing to memory cannot fail.
    let _ = write!(part, "Content-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len());
    part.extend_from_slice(jpeg);
    part.extend_from_slice(b"\r\n--myboundary\r\n");
    part
}
