// SPDX-License-Identifier: MPL-2.0

//! The services of ONVIF over HTTP, with the faults they can have.

use std::{future::pending, sync::Arc, time::Duration};

use axum::{
    body::{Body, to_bytes},
    extract::{ConnectInfo, Request, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use roxmltree::Document;

use super::{
    Site,
    cgi::{Trouble, trouble},
    connection::{Connection, Ending},
};
use crate::{
    Auth, Clock, Fault,
    onvif::{self, Message, OnvifSettings, Quirk, Refusal},
    seeded::Seeded,
};

/// More than any message needs.
const LONGEST_MESSAGE: usize = 64 * 1024;

/// What anybody may ask (ONVIF Core, 5.12.2: access class `PRE_AUTH`).
const OPEN_TO_ALL: [&str; 3] = ["GetSystemDateAndTime", "GetServices", "GetCapabilities"];

/// Tokens of a time that is more off are refused.
const TOKEN_WINDOW_S: i64 = 5;

/// How late a camera is that does not tell its status.
const STATUS_LATE: Duration = Duration::from_secs(30);

pub(super) async fn service(
    State(site): State<Arc<Site>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    let camera = &site.camera;
    let Some(settings) = &camera.settings.onvif else { return StatusCode::NOT_FOUND.into_response() };
    let _counted = camera.request_begins();
    let fault = camera.fault.borrow().clone();
    let host = request
        .headers()
        .get(header::HOST)
        .and_then(|host| host.to_str().ok())
        .unwrap_or("camera")
        .to_owned();
    let has_authorization = request.headers().contains_key(header::AUTHORIZATION);
    // Looked at only where there is no token.
    let (parts, body) = request.into_parts();
    let Ok(body) = to_bytes(body, LONGEST_MESSAGE).await else {
        return StatusCode::BAD_REQUEST.into_response();
    };
    let text = String::from_utf8_lossy(&body).into_owned();
    let Ok(document) = Document::parse(&text) else { return StatusCode::BAD_REQUEST.into_response() };
    let Some(message) = Message::of(&document) else { return StatusCode::BAD_REQUEST.into_response() };
    let name = message.body.tag_name().name().to_owned();
    match trouble(&fault, site.guard.wrong_logins()) {
        Trouble::None => {}
        Trouble::Response(response) => return response,
        Trouble::Cut(ending) => {
            connection.end(ending);
            return Response::new(Body::empty());
        }
        Trouble::Silence => pending::<()>().await,
    }
    if camera.settings.auth != Auth::None && !OPEN_TO_ALL.contains(&name.as_str()) {
        let known = message.token.as_ref().filter(|_| !has_authorization);
        if let Some(token) = known {
            let strict = settings.has(Quirk::ClockAhead) || settings.has(Quirk::ClockBehind);
            let in_time = !strict || token.off_by_s(onvif::clock(settings)) <= TOKEN_WINDOW_S;
            let right = token.user == camera.settings.user && token.knows(&camera.settings.password);
            if !right || !in_time || fault == Fault::Locked {
                camera.note_refused();
                return refuse(settings, "NotAuthorized", "the sender is not authorized", &connection);
            }
        } else if let Some(refusal) = site.guard.refuse(&Request::from_parts(parts, Body::empty()), &fault) {
            camera.note_refused();
            return refusal;
        }
    }
    if name == "GetStatus" && settings.has(Quirk::StatusLate) {
        tokio::time::sleep(STATUS_LATE).await;
    }
    // In stepped time its head is late instead: nobody steps while an answer is waited for.
    if settings.has(Quirk::Late) && camera.settings.clock == Clock::Real {
        let late = Seeded::new(camera.now().as_nanos() as u64).unit();
        tokio::time::sleep(Quirk::LEAST_LATE + Quirk::MORE_LATE.mul_f64(late)).await;
    }
    let answer = onvif::answer(camera, settings, message.body, &host);
    let status = match &answer {
        Ok(_) => 200,
        Err(Refusal::Fault(..)) => 400,
        Err(Refusal::Closed | Refusal::Garbled) => 0,
    };
    if matches!(name.as_str(), "ContinuousMove" | "Stop" | "AbsoluteMove" | "GotoPreset" | "RelativeMove") {
        camera.note_command(&summary(&name, &message), status);
    }
    match answer {
        Ok(body) => soap(StatusCode::OK, &onvif::envelope(&body, settings.has(Quirk::Prefixes))),
        Err(Refusal::Fault(code, reason)) => refuse(settings, code, &reason, &connection),
        Err(Refusal::Closed) => {
            connection.end(Ending::Reset);
            Response::new(Body::empty())
        }
        Err(Refusal::Garbled) => {
            connection.end(Ending::Garbage(b"HTTP/1.1500 Internal\n\n".to_vec()));
            Response::new(Body::empty())
        }
    }
}

/// Name of a move and what it is about, on one line.
fn summary(name: &str, message: &Message) -> String {
    let parts = message.body.descendants().filter(|node| node.is_element()).skip(1).filter_map(|node| {
        let attributes = ["x", "y", "space"].iter().filter_map(|name| node.attribute(*name));
        // Of a space its own name.
        let attributes: Vec<_> = attributes.filter_map(|text| text.rsplit('/').next()).collect();
        let said = if attributes.is_empty() { node.text()?.trim().to_owned() } else { attributes.join(",") };
        let name = node.tag_name().name();
        (!said.is_empty() && name != "ProfileToken").then(|| format!(" {name}={said}"))
    });
    std::iter::once(name.to_owned()).chain(parts).collect()
}

fn refuse(settings: &OnvifSettings, code: &str, reason: &str, connection: &Connection) -> Response {
    if settings.has(Quirk::FaultCloses) {
        connection.end(Ending::Reset);
        return Response::new(Body::empty());
    }
    soap(
        StatusCode::BAD_REQUEST,
        &onvif::envelope(&onvif::fault(code, reason), settings.has(Quirk::Prefixes)),
    )
}

fn soap(status: StatusCode, body: &str) -> Response {
    (status, [(header::CONTENT_TYPE, "application/soap+xml; charset=utf-8")], body.to_owned()).into_response()
}
