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
    answer(&site, &connection, request, Camera::ptz, Camera::note_command).await
}

pub(super) async fn param(
    State(site): State<Arc<Site>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    answer(&site, &connection, request, Camera::param, |_, _, _| {}).await
}

async fn answer(
    site: &Site,
    connection: &Connection,
    request: Request,
    run: fn(&Camera, &Args) -> Answer,
    note: fn(&Camera, &str, u16),
) -> Response {
    let camera = &site.camera;
    let _counted = camera.request_begins();
    let refusal = site.guard.refuse(&request);
    let query = match arguments(request).await {
        Ok(query) => query,
        Err(response) => return response,
    };
    let fault = camera.fault.borrow().clone();
    match trouble(&fault) {
        Trouble::None => {}
        Trouble::Answer(response) => {
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
        tokio::time::sleep(camera.service_time()).await;
        match run(camera, &parse_args(query.as_bytes())) {
            Answer::Accepted => StatusCode::NO_CONTENT.into_response(),
            Answer::Text(text) => plain(text),
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
enum Trouble {
    None,
    Answer(Response),
    Cut(Ending),
    Silence,
}

fn trouble(fault: &Fault) -> Trouble {
    match fault {
        Fault::None | Fault::Delay(_) | Fault::CloseAfterResponse => Trouble::None,
        Fault::Refuse | Fault::Reset => Trouble::Cut(Ending::Reset),
        Fault::Garbage(bytes) => Trouble::Cut(Ending::Garbage(bytes.clone())),
        Fault::Hang => Trouble::Silence,
        Fault::Status(code) => {
            let status = StatusCode::from_u16(*code).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
            Trouble::Answer(status.into_response())
        }
        Fault::ErrorBody(text) => Trouble::Answer(plain(text.clone())),
        Fault::EmptyOk => Trouble::Answer(Response::new(Body::empty())),
    }
}
