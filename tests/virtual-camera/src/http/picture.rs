// SPDX-License-Identifier: MPL-2.0

//! Single pictures, and what clients may ask of any picture.

use std::sync::Arc;

use axum::{
    extract::{RawQuery, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};

use super::Site;
use crate::{
    encode::{EncodeError, JpegEncoder},
    picture::Picture,
    vapix::parse_args,
    wish::{PictureError, Wish},
    world::FootageError,
};

impl IntoResponse for PictureError {
    fn into_response(self) -> Response {
        let status = match self {
            Self::Argument { .. } => StatusCode::BAD_REQUEST,
            Self::Footage(_) | Self::Encode(_) => StatusCode::INTERNAL_SERVER_ERROR,
        };
        (status, format!("{self}\n")).into_response()
    }
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
