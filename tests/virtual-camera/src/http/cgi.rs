// SPDX-License-Identifier: MPL-2.0

//! `ptz.cgi`, `ptzqueue.cgi` and `param.cgi`, with the faults they can have.

use std::{future::pending, io, sync::Arc, time::Duration};

use axum::{
    body::{Body, Bytes, to_bytes},
    extract::{ConnectInfo, Request, State},
    http::{Method, StatusCode, header},
    response::{IntoResponse, Response},
};

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use super::{
    Site, auth,
    connection::{Connection, Ending},
};
use crate::{
    Fault,
    camera::Camera,
    vapix::{Args, CgiResponse, parse_args, queue::Queue},
};

/// More than any request needs.
const LONGEST_FORM: usize = 64 * 1024;

pub(super) async fn ptz(
    State(site): State<Arc<Site>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    answer(&site, &connection, request, Camera::queued_ptz, Camera::note_command).await
}

pub(super) async fn queue(
    State(site): State<Arc<Site>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    // Made after a camera without the program, where the queue is off.
    if site.camera.settings.control_queue.is_none() {
        return StatusCode::NOT_FOUND.into_response();
    }
    if let Some(refusal) = forbidden(&site) {
        return refusal;
    }
    answer(&site, &connection, request, Camera::queue, |_, _, _| {}).await
}

pub(super) async fn param(
    State(site): State<Arc<Site>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    if let Some(refusal) = forbidden(&site) {
        return refusal;
    }
    answer(&site, &connection, request, Camera::param, |_, _, _| {}).await
}

/// What says that the account is not good for this.
fn forbidden(site: &Site) -> Option<Response> {
    site.camera.settings.ptz_only.then(|| {
        site.camera.note_refused();
        site.guard.forbid(auth::time(&site.camera.fault.borrow()))
    })
}

async fn answer(
    site: &Site,
    connection: &Connection,
    request: Request,
    run: fn(&Camera, &Args, Option<&str>) -> CgiResponse,
    note: fn(&Camera, &str, u16),
) -> Response {
    let camera = &site.camera;
    let _counted = camera.request_begins();
    let fault = camera.fault.borrow().clone();
    let refusal = site.guard.refuse(&request, &fault);
    let cookie = cookie(&request);
    let query = match arguments(request).await {
        Ok(query) => query,
        Err(response) => return response,
    };
    match trouble(&fault, site.guard.wrong_logins()) {
        Trouble::None => {}
        Trouble::Response(response) => {
            note(camera, &query, response.status().as_u16());
            return response;
        }
        Trouble::Cut(ending) => {
            connection.end(ending);
            note(camera, &query, 0);
            return Response::new(Body::empty());
        }
        Trouble::Silence => {
            note(camera, &query, 0);
            pending::<()>().await;
        }
    }
    if let Some(refusal) = refusal {
        camera.note_refused();
        return refusal;
    }
    let response = {
        let _turn = site.turn.lock().await;
        if !camera.service_time().is_zero() {
            // Which takes a millisecond at least.
            tokio::time::sleep(camera.service_time()).await;
        }
        match run(camera, &parse_args(query.as_bytes()), cookie.as_deref()) {
            CgiResponse::Accepted => StatusCode::NO_CONTENT.into_response(),
            CgiResponse::Text(text) if fault == Fault::LineFeeds => plain(text.replace("\r\n", "\n")),
            CgiResponse::Text(text) => plain(text),
            CgiResponse::Introduced { cookie, text } => {
                ([(header::SET_COOKIE, cookie)], plain(text)).into_response()
            }
        }
    };
    note(camera, &query, response.status().as_u16());
    match fault {
        // Commands act at once; it is the answer that is late.
        Fault::Delay(delay) => tokio::time::sleep(delay).await,
        Fault::CloseAfterResponse => connection.end(Ending::Closed),
        _ => {}
    }
    response
}

fn plain(text: String) -> Response {
    ([(header::CONTENT_TYPE, "text/plain")], text).into_response()
}

/// This text again and again, each time after a pause, until the client has enough.
fn endless(text: Bytes, pause: Duration) -> Response {
    let (sender, receiver) = mpsc::channel(1);
    tokio::spawn(async move {
        while sender.send(Ok::<_, io::Error>(text.clone())).await.is_ok() {
            tokio::time::sleep(pause).await;
        }
    });
    let body = Body::from_stream(ReceiverStream::new(receiver));
    ([(header::CONTENT_TYPE, "text/plain")], body).into_response()
}

/// By what the control queue knows the client.
fn cookie(request: &Request) -> Option<String> {
    let cookies = request.headers().get(header::COOKIE)?.to_str().ok()?;
    let mut pairs = cookies.split(';').filter_map(|pair| pair.trim().split_once('='));
    pairs.find(|(name, _)| *name == Queue::COOKIE).map(|(_, id)| id.to_owned())
}

/// The query, or the form of a POST.
async fn arguments(request: Request) -> Result<String, Response> {
    let mut query = request.uri().query().unwrap_or_default().to_owned();
    if request.method() == Method::POST {
        let form = to_bytes(request.into_body(), LONGEST_FORM)
            .await
            .map_err(|error| (StatusCode::BAD_REQUEST, error.to_string()).into_response())?;
        if !query.is_empty() && !form.is_empty() {
            query.push('&');
        }
        query.push_str(&String::from_utf8_lossy(&form));
    }
    Ok(query)
}

/// What a fault does instead of answering.
pub(super) enum Trouble {
    None,
    Response(Response),
    Cut(Ending),
    Silence,
}

pub(super) fn trouble(fault: &Fault, wrong_logins: u64) -> Trouble {
    let status = |code: u16| StatusCode::from_u16(code).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    match fault {
        Fault::None | Fault::Delay(_) | Fault::CloseAfterResponse => Trouble::None,
        Fault::LineFeeds | Fault::ClockAhead(_) | Fault::Locked => Trouble::None,
        Fault::Refuse | Fault::Reboot | Fault::Reset => Trouble::Cut(Ending::Reset),
        Fault::Garbage(bytes) => Trouble::Cut(Ending::Garbage(bytes.clone())),
        Fault::Hang | Fault::BlackHole => Trouble::Silence,
        Fault::Status(code) => Trouble::Response(status(*code).into_response()),
        Fault::Redirect { status: code, location } => {
            Trouble::Response((status(*code), [(header::LOCATION, location.clone())]).into_response())
        }
        Fault::LockOut(after) if wrong_logins >= *after => {
            Trouble::Response(StatusCode::FORBIDDEN.into_response())
        }
        Fault::LockOut(_) => Trouble::None,
        Fault::EndlessBody => Trouble::Response(endless(Bytes::from_static(&[b'x'; 8192]), Duration::ZERO)),
        Fault::Drip(pause) => Trouble::Response(endless(Bytes::from_static(b"x"), *pause)),
        Fault::ErrorBody(text) => Trouble::Response(plain(text.clone())),
        Fault::EmptyOk => Trouble::Response(Response::new(Body::empty())),
    }
}
