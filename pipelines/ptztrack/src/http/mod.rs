// SPDX-License-Identifier: MPL-2.0

//! The page, what it asks for, `/metrics` and `/healthz`.

mod access;
mod events;
mod metrics;

use std::convert::Infallible;
use std::future::poll_fn;
use std::net::{IpAddr, SocketAddr};
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::time::Duration;

use access::Access;
pub use access::lets_in;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
pub use events::Events;
use futures_util::stream;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde::Deserialize;
use serde_json::json;
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;

use crate::camera::{Known, Look, Steering, Turn};
use crate::config::Http;
use crate::fleet::Fleet;
use crate::log::Log;
use ptztrack_contract::Point;
use ptztrack_contract::lock::lock;

/// Who asks for a picture waits for it this long.
const LONGEST_WAIT: Duration = Duration::from_secs(2);

/// Connections at once: some for each browser that looks at a wall of cameras.
const MOST_CONNECTIONS: usize = 128;
/// Who connects says what they want within this time, and again before each further request.
const LONGEST_HEAD: Duration = Duration::from_secs(10);
/// Who has not taken what was sent for so long is gone.
const LONGEST_STALL: Duration = Duration::from_secs(30);
/// After no connection could be taken.
const ACCEPT_AGAIN: Duration = Duration::from_millis(200);

/// What a picture shows in words, sent along with it: asked for by itself it may be what another one shows.
const STATE_HEADER: &str = "ptztrack-state";
/// Between two pictures of a stream.
const BOUNDARY: &str = "ptztrack-picture";

/// A connection of somebody.
#[derive(Debug, Clone)]
pub struct Visit {
    /// The address of this machine that was connected to.
    local: IpAddr,
    /// The one that it came from.
    peer: IpAddr,
    /// Something was asked that they may ask.
    welcome: Arc<AtomicBool>,
}

/// Where it is to be asked.
///
/// # Errors
/// Where the address cannot be had.
pub async fn listen(http: &Http) -> std::io::Result<TcpListener> {
    TcpListener::bind(http.listen).await
}

/// Serves until the process ends. Whoever connects before they have said who they are costs a little for a short time: no more
/// than so many at once, none that says nothing, none that takes nothing, so that cameras never lack a descriptor. Where there
/// are too many, the first of them makes room.
pub async fn serve(listener: TcpListener, http: &Http, fleet: Arc<Fleet>, events: Events, log: Arc<Log>) {
    let router = router(http, fleet, events, log);
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    let mut visits: Vec<(Visit, JoinHandle<()>)> = Vec::new();
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            // Out of descriptors, for instance: there may be some later.
            tokio::time::sleep(ACCEPT_AGAIN).await;
            continue;
        };
        visits.retain(|(_, connection)| !connection.is_finished());
        let is_stranger = |(visit, _): &(Visit, _)| !visit.welcome.load(Ordering::Relaxed);
        if places.available_permits() == 0
            && let Some(first) = visits.iter().position(is_stranger)
        {
            visits.remove(first).1.abort();
        }
        // It is never closed.
        let Ok(place) = places.clone().acquire_owned().await else { return };
        // By `[::]` whoever comes by IPv4 has an address of IPv6 as well.
        let address = |address: SocketAddr| address.ip().to_canonical();
        let local = stream.local_addr().map_or(IpAddr::from([0, 0, 0, 0]), address);
        let visit = Visit { local, peer: address(peer), welcome: Arc::default() };
        // Who takes nothing of what was sent is gone; where that cannot be asked for, the system has its own limit.
        let _ = SockRef::from(&stream).set_tcp_user_timeout(Some(LONGEST_STALL));
        let connection = answer(stream, router.clone(), visit.clone());
        let connection = tokio::spawn(async move {
            connection.await;
            drop(place);
        });
        visits.push((visit, connection));
    }
}

/// Whoever is connected, until they go.
async fn answer(stream: impl AsyncRead + AsyncWrite + Unpin, router: Router, visit: Visit) {
    let routes = TowerToHyperService::new(router);
    // Told with each request: a layer of the router's is laid around every route anew for whoever connects.
    let service = service_fn(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(visit.clone());
        routes.call(request)
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(LONGEST_HEAD)
        .serve_connection(TokioIo::new(stream), service);
    // How it ended is a matter of who connected.
    let _ = connection.await;
}

/// Page and metrics without cameras have less.
const LONGEST_ANSWER: usize = 1024 * 1024;

/// A page without cameras or password, and what it is answered on. To make them takes longer than most answers.
struct Empty {
    router: Router,
    runtime: tokio::runtime::Runtime,
}

thread_local! {
    static EMPTY: Option<Empty> = Empty::new().ok();
}

impl Empty {
    fn new() -> std::io::Result<Self> {
        Self::of(Fleet::new(Arc::new(Log::unwritten())))
    }

    /// With these cameras.
    fn of(fleet: Fleet) -> std::io::Result<Self> {
        let http = Http { listen: Http::LISTEN, hosts: Vec::new(), credentials: Ok(None) };
        let router = router(&http, Arc::new(fleet), Events::default(), Arc::default());
        Ok(Self { router, runtime: tokio::runtime::Builder::new_current_thread().enable_time().build()? })
    }

    fn answer_to(&self, said: &[u8], visit: Visit) -> Vec<u8> {
        let (theirs, mut ours) = tokio::io::duplex(said.len() + LONGEST_ANSWER);
        self.runtime.block_on(async {
            let mut connection = pin!(answer(theirs, self.router.clone(), visit));
            // Nothing in memory fails to be written or read.
            let _ = ours.write_all(said).await;
            // All is answered that can be, before it is heard that there is no more.
            let ended = poll_fn(|context| Poll::Ready(connection.as_mut().poll(context).is_ready())).await;
            let _ = ours.shutdown().await;
            if !ended {
                connection.await;
            }
            let mut answered = Vec::new();
            let _ = ours.read_to_end(&mut answered).await;
            answered
        })
    }
}

/// All that is answered to somebody who says this and no more, on a page without cameras or password.
pub fn answer_to(said: &[u8]) -> Vec<u8> {
    let local = Http::LISTEN.ip();
    let visit = Visit { local, peer: local, welcome: Arc::default() };
    EMPTY.with(|empty| empty.as_ref().map_or_else(Vec::new, |empty| empty.answer_to(said, visit)))
}

fn router(http: &Http, fleet: Arc<Fleet>, events: Events, log: Arc<Log>) -> Router {
    let access = Arc::new(Access::new(http, log));
    Router::new()
        .route("/", get(async || html(include_str!("page.html"))))
        .route("/metrics", get(metrics::answer))
        .route("/cameras", get(cameras))
        .route("/cameras/{name}/picture", get(picture))
        .route("/cameras/{name}/video", get(video))
        .route("/cameras/{name}/{order}", post(order))
        .merge(events::routes(events))
        .layer(axum::middleware::from_fn_with_state(access, access::check))
        // Asked for by whoever starts programs anew, under any name; it tells nothing of the cameras' pictures.
        .route("/healthz", get(healthz))
        .with_state(fleet)
}

/// A page that is in none of somebody else, who could have a click mean what it does not seem to.
fn html(page: &'static str) -> impl IntoResponse {
    ([(header::CONTENT_SECURITY_POLICY, "frame-ancestors 'none'")], Html(page))
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
    let (abilities, handed_over) = (known.abilities(), known.is_handed_over());
    let state = lock(&known.state).clone();
    json!({
        "name": known.name,
        "words": known.in_words(),
        "well": state.picture && !state.given_up,
        "target": state.target_id,
        "calls": *lock(&known.calls),
        "handed_over": handed_over,
        "can_go_home": abilities.home && !handed_over,
        "can_hand_over": abilities.hand_over,
        "can_turn": abilities.turn && !handed_over,
    })
}

/// The next picture, and what it shows in words.
async fn picture(State(fleet): State<Arc<Fleet>>, Path(name): Path<String>) -> Response {
    let Some(known) = fleet.of(&name) else { return StatusCode::NOT_FOUND.into_response() };
    let mut look = known.look();
    match tokio::time::timeout(LONGEST_WAIT, look.next()).await {
        Ok(Some(shown)) => {
            let head = [(header::CONTENT_TYPE, "image/jpeg"), (header::CACHE_CONTROL, "no-store")];
            (head, [(STATE_HEADER, known.words_of(&shown))], shown.jpeg).into_response()
        }
        _ => (StatusCode::SERVICE_UNAVAILABLE, "no picture\n").into_response(),
    }
}

/// All from now on, as MJPEG.
async fn video(State(fleet): State<Arc<Fleet>>, Path(name): Path<String>) -> Response {
    let Some(known) = fleet.of(&name) else { return StatusCode::NOT_FOUND.into_response() };
    let parts = stream::unfold(known.look(), |mut look: Look| async {
        let shown = look.next().await?;
        Some((Ok::<_, Infallible>(part(&shown.jpeg)), look))
    });
    ([(header::CONTENT_TYPE, multipart())], Body::from_stream(parts)).into_response()
}

/// Of a stream of pictures.
fn multipart() -> String {
    format!("multipart/x-mixed-replace; boundary={BOUNDARY}")
}

fn part(jpeg: &Bytes) -> Bytes {
    let head = format!("--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len());
    [head.as_bytes(), jpeg, b"\r\n"].concat().into()
}

/// A place in the picture, 0 to 1; of a turn, parts of the picture to the right and up, -1 to 1.
#[derive(Debug, Deserialize)]
struct Place {
    x: Option<f64>,
    y: Option<f64>,
    /// In the picture of another camera ...
    from: Option<String>,
    /// ... and in that of this one; else in the middle of it.
    here_x: Option<f64>,
    here_y: Option<f64>,
    /// Nearer, or further away: -1 to 1.
    zoom: Option<f64>,
}

/// A place in the pictures of two cameras, and whether that can be.
async fn point(known: &Known, from: String, there: Point, here: Point) -> Response {
    match tokio::time::timeout(LONGEST_WAIT, known.point(from, there, here)).await {
        Ok(Ok(Ok(said))) => format!("{said}\n").into_response(),
        Ok(Ok(Err(reason))) => (StatusCode::CONFLICT, format!("{reason}\n")).into_response(),
        _ => (StatusCode::CONFLICT, "no camera calls another: [handover] in the file says who does\n")
            .into_response(),
    }
}

/// Whoever has been given a camera keeps it until it is taken back.
fn handed_over() -> Response {
    (StatusCode::CONFLICT, "the camera is handed over: take it back first\n").into_response()
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
        ("point", Some(x), Some(y)) => {
            let here = [place.here_x, place.here_y].map(|at| within(at).unwrap_or(0.5));
            let Some(from) = place.from.filter(|from| fleet.of(from).is_some()) else {
                return StatusCode::NOT_FOUND.into_response();
            };
            return point(&known, from, Point { x, y }, Point { x: here[0], y: here[1] }).await;
        }
        ("point", ..) => return (StatusCode::BAD_REQUEST, "x and y are from 0 to 1\n").into_response(),
        ("turn", ..) => match [place.x, place.y, place.zoom].map(Option::unwrap_or_default) {
            turn if !turn.iter().all(|part| (-1.0..=1.0).contains(part)) => {
                return (StatusCode::BAD_REQUEST, "x, y and zoom are from -1 to 1\n").into_response();
            }
            _ if !known.abilities().turn => {
                return (StatusCode::CONFLICT, "the camera does not report where it looks\n").into_response();
            }
            [right, up, zoom] if !known.turn(Turn { right, up, zoom }) => return handed_over(),
            _ => {}
        },
        ("release", ..) => known.release(),
        ("hand-over", ..) => known.steer(Steering::HandedOver),
        ("take-back", ..) => known.steer(Steering::Follow),
        ("home", ..) if !known.go_home() => return handed_over(),
        ("home", ..) => {}
        _ => return StatusCode::NOT_FOUND.into_response(),
    }
    StatusCode::NO_CONTENT.into_response()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::told::Told;

    fn answer(request: &str) -> String {
        let said = format!("{request} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        String::from_utf8(answer_to(said.as_bytes())).unwrap()
    }

    #[test]
    fn no_page_is_in_a_frame_of_somebody_else() {
        for page in ["GET /", "GET /events"] {
            let answer = answer(page);
            assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
            assert!(answer.contains("\r\ncontent-security-policy: frame-ancestors 'none'\r\n"), "{answer}");
        }
    }

    #[test]
    fn a_camera_that_is_handed_over_neither_goes_home_nor_turns_until_it_is_taken_back() {
        let fleet = Fleet::at_rest("door");
        let known = fleet.of("door").unwrap();
        let told = Told::run(&known);
        let page = Empty::of(fleet).unwrap();
        let ask = |request: &str| {
            let local = Http::LISTEN.ip();
            let visit = Visit { local, peer: local, welcome: Arc::default() };
            let said = format!("{request} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
            String::from_utf8(page.answer_to(said.as_bytes(), visit)).unwrap()
        };
        let order = |order: &str| ask(&format!("POST /cameras/door/{order}"));
        assert!(ask("GET /cameras").contains(r#""can_go_home":true,"can_hand_over":true,"can_turn":true"#));
        assert!(order("hand-over").starts_with("HTTP/1.1 204 "));
        for wanted in ["home", "turn?x=0.5"] {
            let answer = order(wanted);
            assert!(answer.starts_with("HTTP/1.1 409 ") && answer.contains("handed over"), "{answer}");
        }
        assert_eq!(told.steering(), [Steering::HandedOver]);
        assert!(known.is_handed_over());
        let cameras = ask("GET /cameras");
        assert!(
            cameras.contains(r#""can_go_home":false,"can_hand_over":true,"can_turn":false"#),
            "{cameras}"
        );
        assert!(order("take-back").starts_with("HTTP/1.1 204 "));
        assert!(order("home").starts_with("HTTP/1.1 204 "));
        assert!(matches!(*lock(&known.steering), Steering::GoHome(_)));
    }

    #[test]
    fn every_request_of_a_visit_may_ask_by_the_address_that_was_connected_to() {
        let local = IpAddr::from([192, 0, 2, 1]);
        let visit = Visit { local, peer: local, welcome: Arc::default() };
        let request = "GET /cameras HTTP/1.1\r\nHost: 192.0.2.1\r\n\r\n".repeat(2);
        let answered = Empty::new().unwrap().answer_to(request.as_bytes(), visit.clone());
        let answered = String::from_utf8(answered).unwrap();
        assert_eq!(answered.matches("HTTP/1.1 200 OK\r\n").count(), 2, "{answered}");
        assert!(visit.welcome.load(Ordering::Relaxed));
    }
}
