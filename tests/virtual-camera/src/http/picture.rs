//! Single pictures, and what clients may ask of any picture.

use std::sync::Arc;

use axum::{
    extract::{RawQuery, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};

use super::Site;
use crate::{
    camera::Camera,
    encode::{EncodeError, JpegEncoder},
    picture::Picture,
    vapix::{Args, parse_args},
    world::FootageError,
};

/// Why a client gets no picture.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PictureError {
    #[error(transparent)]
    Footage(#[from] FootageError),
    #[error(transparent)]
    Encode(#[from] EncodeError),
    #[error("{name}: invalid value: {value}")]
    Argument { name: &'static str, value: String },
}

impl IntoResponse for PictureError {
    fn into_response(self) -> Response {
        let status = match self {
            Self::Argument { .. } => StatusCode::BAD_REQUEST,
            Self::Footage(_) | Self::Encode(_) => StatusCode::INTERNAL_SERVER_ERROR,
        };
        (status, format!("{self}\n")).into_response()
    }
}

/// What a client asked a picture or a stream to be like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wish {
    pub size: (u32, u32),
    pub frame_rate: f64,
    pub compression: u32,
}

impl Wish {
    /// The arguments `resolution`, `fps` (0 for as many as there are) and `compression`; the camera's own where absent.
    pub fn parse(args: &Args, camera: &Camera) -> Result<Self, PictureError> {
        let mut wish = Self {
            size: camera.world.view_size(),
            frame_rate: camera.frame_rate(),
            compression: camera.settings.video.compression,
        };
        if let Some(size) = argument(args, "resolution", parse_size)? {
            wish.size = size;
        }
        let frame_rate =
            argument(args, "fps", |text| text.parse().ok().filter(|fps| (0.0..=120.0).contains(fps)))?;
        if let Some(frame_rate) = frame_rate.filter(|&fps: &f64| fps > 0.0) {
            wish.frame_rate = frame_rate;
        }
        if let Some(compression) =
            argument(args, "compression", |text| text.parse().ok().filter(|&compression| compression <= 100))?
        {
            wish.compression = compression;
        }
        Ok(wish)
    }
}

/// The value of an argument; `None` where it is absent.
pub(super) fn argument<T>(
    args: &Args,
    name: &'static str,
    parse: impl Fn(&str) -> Option<T>,
) -> Result<Option<T>, PictureError> {
    let Some((_, value)) = args.iter().find(|arg| arg.0 == name) else {
        return Ok(None);
    };
    parse(value).map(Some).ok_or_else(|| PictureError::Argument { name, value: value.clone() })
}

/// `640x480`, even and of a size that encoders take.
fn parse_size(text: &str) -> Option<(u32, u32)> {
    let (width, height) = text.split_once('x')?;
    let length =
        |text: &str| text.parse().ok().filter(|length| (32..=4096).contains(length) && length % 2 == 0);
    Some((length(width)?, length(height)?))
}

pub(super) async fn snapshot(
    State(site): State<Arc<Site>>,
    RawQuery(query): RawQuery,
) -> Result<Response, PictureError> {
    let args = parse_args(query.unwrap_or_default().as_bytes());
    let wish = Wish::parse(&args, &site.camera)?;
    let camera = site.camera.clone();
    jpeg(wish, move || camera.picture(camera.newest_exposure(), wish.size)).await
}

/// A response with one JPEG. Drawing and encoding happen off the server's thread.
pub(super) async fn jpeg(
    wish: Wish,
    draw: impl FnOnce() -> Result<Picture, FootageError> + Send + 'static,
) -> Result<Response, PictureError> {
    let drawn = tokio::task::spawn_blocking(move || -> Result<Vec<u8>, PictureError> {
        let picture = draw()?;
        Ok(JpegEncoder::new(picture.size(), wish.compression)?.encode(&picture)?)
    });
    let jpeg = drawn.await.unwrap_or(Err(EncodeError::Nothing.into()))?;
    Ok(([(header::CONTENT_TYPE, "image/jpeg"), (header::CACHE_CONTROL, "no-store")], jpeg).into_response())
}

pub(super) async fn size(
    State(site): State<Arc<Site>>,
    RawQuery(query): RawQuery,
) -> Result<Response, PictureError> {
    let args = parse_args(query.unwrap_or_default().as_bytes());
    let (width, height) = Wish::parse(&args, &site.camera)?.size;
    let text = format!("image width = {width}\nimage height = {height}\n");
    Ok(([(header::CONTENT_TYPE, "text/plain")], text).into_response())
}
