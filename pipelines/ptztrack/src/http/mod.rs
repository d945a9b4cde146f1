// SPDX-License-Identifier: MPL-2.0

//! The page, what it asks for, `/metrics` and `/healthz`.

mod access;
mod metrics;

use std::convert::Infallible;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use access::Access;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::connect_info::Connected;
use axum::extract::{Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use axum::serve::IncomingStream;
use futures_util::stream;
use serde::Deserialize;
use serde_json::json;
use tokio::net::TcpListener;

use crate::camera::{Known, Look, Steering};
use crate::config::Http;
use crate::fleet::Fleet;
use ptztrack_contract::lock::lock;

/// Who asks for a picture waits for it this long.
const LONGEST_WAIT: Duration = Duration::from_secs(2);

/// Between two pictures of a stream.
const BOUNDARY: &str = "ptztrack-picture";

/// The address of this machine that was connected to.
#[derive(Debug, Clone, Copy)]
pub struct Local(IpAddr);

impl Connected<IncomingStream<'_, TcpListener>> for Local {
    fn connect_info(stream: IncomingStream<'_, TcpListener>) -> Self {
        Self(stream.io().local_addr().map_or(IpAddr::from([0, 0, 0, 0]), |address| address.ip()))
    }
}

/// Serves until the process ends; the address is where.
///
/// # Errors
/// Where the address cannot be had.
pub async fn serve(http: &Http, fleet: Arc<Fleet>) -> std::io::Result<SocketAddr> {
    let listener = TcpListener::bind(http.listen).await?;
    let address = listener.local_addr()?;
    let service = router(http, fleet).into_make_service_with_connect_info::<Local>();
    tokio::spawn(async { axum::serve(listener, service).await });
    Ok(address)
}

fn router(http: &Http, fleet: Arc<Fleet>) -> Router {
    let access = Arc::new(Access::new(http));
    Router::new()
        .route("/", get(|| async { Html(include_str!("page.html")) }))
        .route("/metrics", get(metrics::answer))
        .route("/cameras", get(cameras))
        .route("/cameras/{name}/picture", get(picture))
        .route("/cameras/{name}/video", get(video))
        .route("/cameras/{name}/{order}", post(order))
        .layer(axum::middleware::from_fn_with_state(access, access::check))
        // Asked for by whoever starts programs anew, under any name; it tells nothing of the cameras' pictures.
        .route("/healthz", get(healthz))
        .with_state(fleet)
}

/// Well while every camera's thread does its work: whether the cameras are there is another matter, and no new start of this
/// program brings one back.
async fn healthz(State(fleet): State<Arc<Fleet>>) -> Response {
    let stuck = fleet.stuck();
    if stuck.is_empty() {
        "ok\n".into_response()
    } else {
        (StatusCode::SERVICE_UNAVAILABLE, format!("stuck: {}\n", stuck.join(", "))).into_response()
    }
}

/// For the page.
async fn cameras(State(fleet): State<Arc<Fleet>>) -> Response {
    let cameras: Vec<_> = fleet.known().iter().map(|known| describe(known)).collect();
    let json = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    (json, json!(cameras).to_string()).into_response()
}

fn describe(known: &Known) -> serde_json::Value {
    let (home, hand_over) = known.abilities();
    let state = lock(&known.state).clone();
    json!({
        "name": known.name,
        "words": known.in_words(),
        "well": state.picture && !state.given_up,
        "target": state.target_id,
        "handed_over": *lock(&known.steering) == Steering::HandedOver,
        "can_go_home": home,
        "can_hand_over": hand_over,
    })
}

/// The next picture.
async fn picture(State(fleet): State<Arc<Fleet>>, Path(name): Path<String>) -> Response {
    let Some(known) = fleet.of(&name) else { return StatusCode::NOT_FOUND.into_response() };
    let mut look = known.look();
    match tokio::time::timeout(LONGEST_WAIT, look.next()).await {
        Ok(Some(jpeg)) => ([(header::CONTENT_TYPE, "image/jpeg"), (header::CACHE_CONTROL, "no-store")], jpeg)
            .into_response(),
        _ => (StatusCode::SERVICE_UNAVAILABLE, "no picture\n").into_response(),
    }
}

/// All from now on, as MJPEG.
async fn video(State(fleet): State<Arc<Fleet>>, Path(name): Path<String>) -> Response {
    let Some(known) = fleet.of(&name) else { return StatusCode::NOT_FOUND.into_response() };
    let parts = stream::unfold(known.look(), |mut look: Look| async {
        let jpeg = look.next().await?;
        Some((Ok::<_, Infallible>(part(&jpeg)), look))
    });
    let kind = format!("multipart/x-mixed-replace; boundary={BOUNDARY}");
    ([(header::CONTENT_TYPE, kind)], Body::from_stream(parts)).into_response()
}

fn part(jpeg: &Bytes) -> Bytes {
    let head = format!("--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len());
    [head.as_bytes(), jpeg, b"\r\n"].concat().into()
}

/// A place in the picture, 0 to 1.
#[derive(Debug, Deserialize)]
struct Place {
    x: Option<f64>,
    y: Option<f64>,
}

/// What somebody wants of a camera.
async fn order(
    State(fleet): State<Arc<Fleet>>,
    Path((name, order)): Path<(String, String)>,
    Query(place): Query<Place>,
) -> Response {
    let Some(known) = fleet.of(&name) else { return StatusCode::NOT_FOUND.into_response() };
    let within = |at: Option<f64>| at.filter(|at| (0.0..=1.0).contains(at));
    match (order.as_str(), within(place.x), within(place.y)) {
        ("select", Some(x), Some(y)) => known.select(x, y),
        ("select", ..) => return (StatusCode::BAD_REQUEST, "x and y are from 0 to 1\n").into_response(),
        ("release", ..) => known.release(),
        ("hand-over", ..) => known.steer(Steering::HandedOver),
        ("take-back", ..) => known.steer(Steering::Follow),
        ("home", ..) => known.go_home(),
        _ => return StatusCode::NOT_FOUND.into_response(),
    }
    StatusCode::NO_CONTENT.into_response()
}
