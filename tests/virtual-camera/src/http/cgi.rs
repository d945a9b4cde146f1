//! `ptz.cgi` and `param.cgi`, with the faults they can have.

use std::{future::pending, sync::Arc};

use axum::{
    body::{Body, to_bytes},
    extract::{ConnectInfo, Request, State},
    http::{Method, StatusCode, header},
    response::{IntoResponse, Response},
};

use super::{
    Site,
    connection::{Connection, Ending},
};
use crate::{
    Fault,
    camera::Camera,
    vapix::{Answer, Args, parse_args},
};

/// More than any request needs.
const LONGEST_FORM: usize = 64 * 1024;

pub(super) async fn ptz(
    State(site): State<Arc<Site>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    let _counted = site.camera.request_begins();
    let (response, query) = answer(&site, &connection, request, Camera::ptz).await;
    if let Some(query) = query {
        site.camera.note_command(&query, response.status().as_u16());
    }
    late(&site).await;
    response
}

pub(super) async fn param(
    State(site): State<Arc<Site>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    let _counted = site.camera.request_begins();
    let (response, _) = answer(&site, &connection, request, Camera::param).await;
    late(&site).await;
    response
}

/// The answer, and the arguments as they came unless the client had to be refused.
async fn answer(
    site: &Site,
    connection: &Connection,
    request: Request,
    run: fn(&Camera, &Args) -> Answer,
) -> (Response, Option<String>) {
    let refusal = site.guard.refuse(&request);
    let query = match arguments(request).await {
        Ok(query) => query,
        Err(response) => return (response, None),
    };
    let fault = site.camera.fault.borrow().clone();
    if let Some(response) = faulty(fault, connection).await {
        return (response, Some(query));
    }
    if let Some(refusal) = refusal {
        site.camera.note_refused();
        return (refusal, None);
    }
    let _turn = site.turn.lock().await;
    tokio::time::sleep(site.camera.settings.service_time).await;
    let response = match run(&site.camera, &parse_args(query.as_bytes())) {
        Answer::Accepted => StatusCode::NO_CONTENT.into_response(),
        Answer::Text(text) => ([(header::CONTENT_TYPE, "text/plain")], text).into_response(),
    };
    (response, Some(query))
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

/// What comes instead of the right answer, if anything.
async fn faulty(fault: Fault, connection: &Connection) -> Option<Response> {
    match fault {
        Fault::None | Fault::Delay(_) => return None,
        Fault::CloseAfterResponse => {
            connection.end(Ending::Closed);
            return None;
        }
        Fault::Refuse | Fault::Reset => connection.end(Ending::Reset),
        Fault::Garbage(bytes) => connection.end(Ending::Garbage(bytes)),
        Fault::Hang => pending().await,
        Fault::Status(code) => {
            return Some(
                StatusCode::from_u16(code).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR).into_response(),
            );
        }
        Fault::ErrorBody(text) => {
            return Some(([(header::CONTENT_TYPE, "text/plain")], text).into_response());
        }
        Fault::EmptyOk => {}
    }
    Some(Response::new(Body::empty()))
}

/// Commands act at once; it is the answer that is late.
async fn late(site: &Site) {
    let fault = site.camera.fault.borrow().clone();
    if let Fault::Delay(delay) = fault {
        tokio::time::sleep(delay).await;
    }
}
