// SPDX-License-Identifier: MPL-2.0

//! The live page and what it asks for. It is for people at this computer: no password.

use std::sync::Arc;

use axum::{
    extract::{RawQuery, State},
    http::{StatusCode, header},
    response::{Html, IntoResponse, Response},
};
use serde::Serialize;

use super::{Site, picture::jpeg};
use crate::{
    Limits, ReceivedCommand, Status,
    kinematics::Pose,
    vapix::{CgiResponse, parse_args},
    wish::{PictureError, Wish, argument},
};

/// Commands shown.
const COMMANDS: usize = 40;

pub(super) async fn page() -> Html<&'static str> {
    Html(include_str!("page.html"))
}

#[derive(Serialize)]
struct StatusReply {
    status: Status,
    limits: Limits,
    /// Corners of the view in the overview, from 0 to 1.
    outline: Vec<(f64, f64)>,
    commands: Vec<ReceivedCommand>,
}

/// Everything the page shows as JSON; `after` is the number of the last command known.
pub(super) async fn status(
    State(site): State<Arc<Site>>,
    RawQuery(query): RawQuery,
) -> Result<Response, PictureError> {
    let args = parse_args(query.unwrap_or_default().as_bytes());
    let after = argument(&args, "after", |text| text.parse().ok())?.unwrap_or(0);
    let mut commands = site.camera.commands_after(after);
    commands.drain(..commands.len().saturating_sub(COMMANDS));
    let status = site.camera.status();
    let pose = Pose { pan_deg: status.pan_deg, tilt_deg: status.tilt_deg, zoom_step: status.zoom_step };
    let report = StatusReply {
        outline: site.camera.world.outline(&pose),
        limits: site.camera.world.limits(),
        status,
        commands,
    };
    let json = serde_json::to_string(&report).unwrap_or_default();
    Ok(([(header::CONTENT_TYPE, "application/json")], json).into_response())
}

/// The newest picture. `X-Exposure` says when it was taken, in seconds, so that the truth about it can be asked for.
pub(super) async fn picture(State(site): State<Arc<Site>>) -> Result<Response, PictureError> {
    let camera = site.camera.clone();
    let wish = Wish::parse(&Vec::new(), &camera)?;
    let exposure = camera.newest_exposure();
    let mut response = jpeg(wish, move || camera.picture(exposure, wish.size)).await?;
    if let Ok(seconds) = exposure.as_secs_f64().to_string().parse() {
        response.headers_mut().insert("x-exposure", seconds);
    }
    Ok(response)
}

pub(super) async fn overview(State(site): State<Arc<Site>>) -> Result<Response, PictureError> {
    let camera = site.camera.clone();
    let wish = Wish::parse(&Vec::new(), &camera)?;
    jpeg(wish, move || Ok((*camera.world.overview(camera.newest_exposure())?).clone())).await
}

/// `ptz.cgi` for the page's buttons: neither password nor fault.
pub(super) async fn steer(State(site): State<Arc<Site>>, RawQuery(query): RawQuery) -> Response {
    let query = query.unwrap_or_default();
    let response = match site.camera.ptz(&parse_args(query.as_bytes())) {
        CgiResponse::Accepted => StatusCode::NO_CONTENT.into_response(),
        CgiResponse::Text(text) | CgiResponse::Introduced { text, .. } => text.into_response(),
    };
    site.camera.note_command(&query, response.status().as_u16());
    response
}
