// SPDX-License-Identifier: MPL-2.0

//! Who was followed: the timeline, and what it asks for.

use std::convert::Infallible;
use std::path::PathBuf;
use std::sync::Arc;

use axum::Router;
use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use events::{Area, Entry, Error, Filter, Reader, Sighting, Store};
use futures_util::{StreamExt, stream};
use serde::{Deserialize, Serialize};
use tokio::sync::Semaphore;

use super::html;
use crate::camera::recording::{self, Clip, Form, NoClip, Purpose};
use crate::config::{Config, Zone};
use crate::log::Log;
use crate::{report, store};

/// No answer has more events.
const MOST: usize = 10_000;
/// So many look into the store at once.
static PLACES: Semaphore = Semaphore::const_new(16);
/// So many who look most like somebody are shown.
const ALIKE: usize = 30;

/// What can be asked for.
#[derive(Debug, Default)]
pub struct Events {
    /// The folder that events are kept in; `None` where they are not.
    folder: Option<PathBuf>,
    zones: Vec<Zone>,
    log: Arc<Log>,
}

type Asked = State<Arc<Events>>;

impl Events {
    pub fn of(config: &Config, log: Arc<Log>) -> Self {
        Self { folder: config.store.kept_in(), zones: config.zones.clone(), log }
    }
}

pub fn routes<S>(events: Events) -> Router<S> {
    Router::new()
        .route("/events", get(async || html(include_str!("events.html"))))
        .route("/events/list", get(list))
        .route("/events/events.csv", get(csv))
        .route("/events/{id}/picture", get(picture))
        .route("/events/{id}/video", get(async |asked, id| recorded(asked, id, Purpose::Play).await))
        .route("/events/{id}/clip", get(async |asked, id| recorded(asked, id, Purpose::Keep).await))
        .route("/events/{id}/delete", post(delete))
        .with_state(Arc::new(events))
}

/// Those that were found, and how much each looks like the one that was named.
type Found = Vec<(Entry, Option<f64>)>;

/// Which events somebody wants to see.
#[derive(Debug, Deserialize)]
struct Wanted {
    /// Milliseconds since 1970.
    since: Option<i64>,
    until: Option<i64>,
    camera: Option<String>,
    /// By its name; else as follows.
    zone: Option<String>,
    /// Degrees; all four, or none.
    left: Option<f64>,
    right: Option<f64>,
    bottom: Option<f64>,
    top: Option<f64>,
    /// Those who look like that one.
    like: Option<i64>,
}

impl Wanted {
    /// `None` where there is no such zone.
    fn filter(&self, zones: &[Zone]) -> Option<Filter> {
        let area = || Some(Area { pan_deg: (self.left?, self.right?), tilt_deg: (self.bottom?, self.top?) });
        let filter = Filter {
            since_ms: self.since,
            until_ms: self.until,
            camera: self.camera.clone(),
            area: area(),
            most: Some(MOST),
        };
        Zone::narrow(zones, self.zone.as_deref(), filter)
    }

    /// With how much each looks like the one that was named; without one the latest are the first.
    fn find(&self, filter: &Filter, reader: &Reader) -> Result<Found, Error> {
        let entries = reader.without_paths(filter)?;
        let Some(id) = self.like else { return Ok(entries.into_iter().map(|entry| (entry, None)).collect()) };
        let looks = reader.sighting(id)?.and_then(|entry| entry.looks).unwrap_or_default();
        let likeness = |entry: Entry| {
            let likeness = entry.looks.as_ref()?.likeness(&looks);
            Some((entry, Some(likeness)))
        };
        let mut alike: Vec<_> = entries.into_iter().filter_map(likeness).collect();
        alike.sort_by(|(_, a), (_, b)| f64::total_cmp(&b.unwrap_or_default(), &a.unwrap_or_default()));
        alike.truncate(ALIKE);
        Ok(alike)
    }
}

async fn list(asked: Asked, Query(wanted): Query<Wanted>) -> Response {
    let zones: Vec<_> = asked.zones.iter().map(|zone| zone.name.clone()).collect();
    let list = move |found: Found, reader: &Reader| {
        let events = found.iter().map(|(entry, likeness)| Told::of(entry, *likeness)).collect();
        let list = List { cameras: reader.cameras()?, zones, events };
        // It has nothing that JSON does not have.
        Ok(serde_json::to_string(&list).unwrap_or_default())
    };
    find(asked, wanted, list).await.map_or_else(|refusal| refusal, |text| answer("application/json", text))
}

/// What the page is told.
#[derive(Debug, Serialize)]
struct List<'a> {
    cameras: Vec<String>,
    zones: Vec<String>,
    events: Vec<Told<'a>>,
}

/// And of one of them.
#[derive(Debug, Serialize)]
struct Told<'a> {
    id: i64,
    camera: &'a str,
    from: i64,
    to: i64,
    way: f64,
    picture: bool,
    recorded: bool,
    likeness: Option<f64>,
}

impl<'a> Told<'a> {
    fn of(entry: &'a Entry, likeness: Option<f64>) -> Self {
        let sighting = &entry.sighting;
        Self {
            id: entry.id,
            camera: &sighting.camera,
            from: sighting.from_ms,
            to: sighting.to_ms,
            way: entry.way_deg,
            picture: entry.has_picture,
            recorded: sighting.recording.is_some(),
            likeness,
        }
    }
}

async fn csv(asked: Asked, Query(wanted): Query<Wanted>) -> Response {
    let csv = |found: Found, _: &Reader| {
        let entries: Vec<_> = found.into_iter().map(|(entry, _)| entry).collect();
        Ok(report::csv(&entries))
    };
    let name = [(header::CONTENT_DISPOSITION, "attachment; filename=\"events.csv\"")];
    match find(asked, wanted, csv).await {
        Ok(text) => (name, answer("text/csv; charset=utf-8", text)).into_response(),
        Err(refusal) => refusal,
    }
}

async fn picture(asked: Asked, Path(id): Path<i64>) -> Response {
    match read(asked, move |reader| reader.picture(id)).await {
        Ok(Some(jpeg)) => answer("image/jpeg", jpeg),
        Ok(None) => StatusCode::NOT_FOUND.into_response(),
        Err(refusal) => refusal,
    }
}

/// What the recording shows of somebody.
async fn recorded(asked: Asked, Path(id): Path<i64>, purpose: Purpose) -> Response {
    let find = move |reader: &Reader| {
        let sighting = reader.sighting(id)?.map(|entry| entry.sighting);
        let pieces = |sighting: &Sighting| {
            let from = sighting.recording.as_ref()?;
            Some(recording::pieces(from, sighting.to_ms - sighting.from_ms))
        };
        Ok(sighting.and_then(|sighting| Some((pieces(&sighting)?, sighting.camera))))
    };
    let (pieces, camera) = match read(asked, find).await {
        Ok(Some(found)) => found,
        Ok(None) => return (StatusCode::NOT_FOUND, "It was not recorded.\n").into_response(),
        Err(refusal) => return refusal,
    };
    let clip = match recording::cut(pieces, purpose).await {
        Ok(clip) => clip,
        Err(NoClip::Gone) => return (StatusCode::NOT_FOUND, "The recording is gone.\n").into_response(),
        Err(NoClip::Busy) => {
            return (StatusCode::SERVICE_UNAVAILABLE, "Too many clips are being made: try again.\n")
                .into_response();
        }
    };
    let (kind, extension) = match clip.form {
        Form::Pictures => (super::multipart(), "mjpeg"),
        Form::Mp4 => ("video/mp4".to_owned(), "mp4"),
        Form::Matroska => ("video/x-matroska".to_owned(), "mkv"),
    };
    let place = match purpose {
        Purpose::Play => "inline".to_owned(),
        Purpose::Keep => format!("attachment; filename=\"{camera}-{id}.{extension}\""),
    };
    let head = [(header::CONTENT_TYPE, kind), (header::CONTENT_DISPOSITION, place)];
    (head, [(header::CACHE_CONTROL, "no-store")], body(clip)).into_response()
}

fn body(clip: Clip) -> Body {
    let whole = move |part| if clip.form == Form::Pictures { super::part(&part) } else { part };
    let parts = stream::unfold(clip.parts, async |mut parts| Some((parts.recv().await?, parts)));
    Body::from_stream(parts.map(move |part| Ok::<_, Infallible>(whole(part))))
}

async fn delete(asked: Asked, Path(id): Path<i64>) -> Response {
    let log = asked.log.clone();
    let delete = move |folder: PathBuf| {
        let (mut store, aside) = Store::open(&folder)?;
        aside.iter().for_each(|aside| store::tell_moved(&log, aside));
        store.delete(id)
    };
    match with(asked, delete).await {
        Ok(true) => StatusCode::NO_CONTENT.into_response(),
        Ok(false) => StatusCode::NOT_FOUND.into_response(),
        Err(refusal) => refusal,
    }
}

/// Nobody keeps what is told of people.
fn answer(kind: &'static str, body: impl Into<Body>) -> Response {
    ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-store")], body.into()).into_response()
}

/// What was found of what somebody wants to see.
async fn find(
    asked: Asked,
    wanted: Wanted,
    say: impl FnOnce(Found, &Reader) -> Result<String, Error> + Send + 'static,
) -> Result<String, Response> {
    let Some(filter) = wanted.filter(&asked.zones) else {
        return Err((StatusCode::NOT_FOUND, "There is no zone of that name.\n").into_response());
    };
    read(asked, move |reader| say(wanted.find(&filter, reader)?, reader)).await
}

async fn read<T: Send + 'static>(
    asked: Asked,
    what: impl FnOnce(&Reader) -> Result<T, Error> + Send + 'static,
) -> Result<T, Response> {
    with(asked, move |folder| what(&Reader::open(&folder)?)).await
}

/// In a thread of its own, as a disk may be slow.
async fn with<T: Send + 'static>(
    asked: Asked,
    what: impl FnOnce(PathBuf) -> Result<T, Error> + Send + 'static,
) -> Result<T, Response> {
    let Some(folder) = asked.folder.clone() else {
        let reason = "No events are kept: `store` in [events] is \"off\".\n";
        return Err((StatusCode::NOT_FOUND, reason).into_response());
    };
    // Where the disk hangs, others wait, and not every thread that there can be.
    let Ok(place) = PLACES.acquire().await else {
        return Err(StatusCode::INTERNAL_SERVER_ERROR.into_response());
    };
    let read = move || {
        let _place = place;
        what(folder)
    };
    match tokio::task::spawn_blocking(read).await {
        Ok(Ok(found)) => Ok(found),
        Ok(Err(err)) => Err((StatusCode::SERVICE_UNAVAILABLE, format!("{err}\n")).into_response()),
        Err(_) => Err(StatusCode::INTERNAL_SERVER_ERROR.into_response()),
    }
}
