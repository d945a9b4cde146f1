// SPDX-License-Identifier: MPL-2.0

//! Our client before a server that others wrote, with WSDL and log-in of its own: the crate `onvif-server`.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

use std::future::pending;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use async_trait::async_trait;
use axum::body::to_bytes;
use axum::extract::Request as HttpRequest;
use axum::http::{StatusCode, header};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response as Answer};
use onvif::{Client, Encoding};
use onvif_server::generated::{DeviceInfo, PTZPreset, PTZStatusResult};
use onvif_server::{DeviceService, MediaService, OnvifError, OnvifServer, PTZService};
use servo::Motion;
use session::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};
use session::{Client as _, Command, Error, Query, Request, Response, Stop};

const PATIENCE: Duration = Duration::from_secs(60);

const LONGEST_MESSAGE: usize = 64 * 1024;

/// Whoever would be answered so is not answered.
const SILENCE: StatusCode = StatusCode::REQUEST_TIMEOUT;

/// What a camera was told.
#[derive(Clone, Default)]
struct Camera(Arc<Mutex<Vec<String>>>);

impl Camera {
    fn note(&self, told: String) -> Result<(), OnvifError> {
        self.0.lock().unwrap().push(told);
        Ok(())
    }

    fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap())
    }
}

#[async_trait]
impl DeviceService for Camera {
    async fn get_device_information(&self) -> Result<DeviceInfo, OnvifError> {
        Err(OnvifError::ActionNotSupported)
    }
}

#[async_trait]
impl MediaService for Camera {
    async fn get_stream_uri(&self, profile: &str) -> Result<String, OnvifError> {
        Ok(format!("rtsp://10.0.0.1:8554/{profile}"))
    }
}

#[async_trait]
impl PTZService for Camera {
    async fn continuous_move(&self, _: &str, pan: f32, tilt: f32, zoom: f32) -> Result<(), OnvifError> {
        self.note(format!("move {pan} {tilt} {zoom}"))
    }

    async fn stop(&self, _: &str, pan_tilt: bool, zoom: bool) -> Result<(), OnvifError> {
        self.note(format!("stop {pan_tilt} {zoom}"))
    }

    async fn get_status(&self, _: &str) -> Result<PTZStatusResult, OnvifError> {
        Ok(PTZStatusResult { pan_tilt_moving: false, zoom_moving: false })
    }

    async fn get_presets(&self, _: &str) -> Result<Vec<PTZPreset>, OnvifError> {
        Ok(vec![PTZPreset { token: "7".to_owned(), name: "Door & gate".to_owned() }])
    }

    async fn goto_preset(&self, _: &str, preset: &str) -> Result<(), OnvifError> {
        self.note(format!("preset {preset}"))
    }
}

async fn served(camera: Camera) -> String {
    served_with(camera, |_| None).await
}

/// Asks for Digest.
fn challenge() -> Answer {
    let challenge = r#"Digest realm="camera", nonce="1", qop="auth""#;
    (StatusCode::UNAUTHORIZED, [(header::WWW_AUTHENTICATE, challenge)]).into_response()
}

/// Where `instead` has an answer to a message, whoever sends it gets that.
async fn served_with(
    camera: Camera,
    instead: impl Fn(&str) -> Option<Answer> + Clone + Send + Sync + 'static,
) -> String {
    let server = OnvifServer::builder()
        .auth("admin", "secret")
        .device_service(camera.clone())
        .media_service(camera.clone())
        .ptz_service(camera);
    let listener = tokio::net::TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let address = listener.local_addr().unwrap();
    let router = server.port(address.port()).build().unwrap().into_router().unwrap();
    let router = router.layer(from_fn(move |request: HttpRequest, next: Next| {
        let instead = instead.clone();
        async move {
            let (head, body) = request.into_parts();
            let body = to_bytes(body, LONGEST_MESSAGE).await.unwrap();
            match instead(&String::from_utf8_lossy(&body)) {
                Some(answer) if answer.status() == SILENCE => pending().await,
                Some(answer) => answer,
                None => next.run(HttpRequest::from_parts(head, body.into())).await,
            }
        }
    }));
    tokio::spawn(async move { axum::serve(listener, router).await });
    format!("http://{address}")
}

fn client(address: &str, password: &str) -> Client {
    client_within(address, password, PATIENCE)
}

fn client_within(address: &str, password: &str, timeout: Duration) -> Client {
    Client::new(ClientSettings {
        location: Location::parse(address).unwrap().0,
        channel: String::new(),
        credentials: Some(Credentials { user: "admin".to_owned(), password: Secret::new(password) }),
        authentication: Authentication::Auto,
        timeout,
        trust: Trust::System,
    })
    .unwrap()
}

fn right() -> Request {
    let motion = Motion::Velocity { pan: 0.5, tilt: 0.0, zoom: None };
    Request::Command(Command::Move { motion, free: false })
}

#[tokio::test]
async fn it_logs_in_moves_stops_and_finds_streams_and_presets() {
    let camera = Camera::default();
    let address = served(camera.clone()).await;
    let mut client = client(&address, "secret");
    assert!(client.has_ptz().await.unwrap());
    let streams = client.streams().await.unwrap();
    assert_eq!((streams[0].encoding, streams[0].size), (Encoding::H264, (1920, 1080)));
    let found = client.stream_address(&streams[0]).await.unwrap();
    assert_eq!((found.port, found.target), (8554, format!("/{}", streams[0].profile)));

    // Half of full speed, of which a velocity is the cube; and the stop that ends it.
    let right =
        Command::Move { motion: Motion::Velocity { pan: 0.5, tilt: -1.0, zoom: Some(0.2) }, free: false };
    for command in [right, Command::Stop(Stop::AllAxes)] {
        assert_eq!(client.exchange(&Request::Command(command)).await, Ok(Response::Accepted));
    }
    assert_eq!(camera.take(), ["move 0.125 -1 0.2", "stop true true"]);

    let presets = client.exchange(&Request::Query(Query::Presets)).await;
    let Ok(Response::Presets(presets)) = presets else { panic!("{presets:?}") };
    let go = Command::Move {
        motion: Motion::Preset { number: presets.number("Door & gate").unwrap() },
        free: false,
    };
    assert_eq!(client.exchange(&Request::Command(go)).await, Ok(Response::Accepted));
    assert_eq!(camera.take(), ["preset 7"]);
}

#[tokio::test]
async fn a_wrong_password_moves_nothing_and_is_not_tried_for_ever() {
    let camera = Camera::default();
    let address = served(camera.clone()).await;
    let mut client = client(&address, "wrong");
    let rest = Request::Command(Command::Stop(Stop::AllAxes));
    for _ in 0..2 {
        assert_eq!(client.exchange(&rest).await, Err(Error::BadCredentials { user: "admin".to_owned() }));
    }
    assert_eq!(camera.take(), [""; 0]);
}

/// Where that were for good, the camera would go on turning.
#[tokio::test]
async fn who_was_let_in_by_a_token_is_let_in_again_after_a_momentary_refusal() {
    let (camera, refusals) = (Camera::default(), Arc::new(AtomicUsize::new(0)));
    let left = refusals.clone();
    let one_less = |left: usize| left.checked_sub(1);
    let refuses = move |_: &str| left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, one_less).ok();
    let instead = move |message: &str| refuses(message).map(|_| challenge());
    let address = served_with(camera.clone(), instead).await;
    let mut client = client(&address, "secret");
    let right = right();
    assert_eq!(client.exchange(&right).await, Ok(Response::Accepted));
    // Refused by its token and by HTTP; and where that is so for longer, as it asks for the time.
    let forbidden = Err(Error::NotPermitted { user: "admin".to_owned() });
    for (refused, answer) in [(2, Ok(Response::Accepted)), (4, forbidden)] {
        refusals.store(refused, Ordering::SeqCst);
        assert_eq!(client.exchange(&right).await, answer);
        assert_eq!(refusals.load(Ordering::SeqCst), 0);
        assert_eq!(client.exchange(&right).await, Ok(Response::Accepted));
    }
}

/// Some let anybody ask, and judge a password by HTTP where they are to move: that questions were answered says nothing of it.
#[tokio::test]
async fn a_password_that_is_judged_for_moves_only_is_not_tried_for_ever() {
    let (camera, tries) = (Camera::default(), Arc::new(AtomicUsize::new(0)));
    let tried = tries.clone();
    let instead = move |message: &str| {
        let judged = message.contains("ContinuousMove");
        tried.fetch_add(judged.into(), Ordering::SeqCst);
        judged.then(challenge)
    };
    let mut client = client(&served_with(camera.clone(), instead).await, "secret");
    let presets = client.exchange(&Request::Query(Query::Presets)).await;
    assert!(matches!(presets, Ok(Response::Presets(_))), "{presets:?}");
    for _ in 0..2 {
        let answer = client.exchange(&right()).await;
        assert_eq!(answer, Err(Error::BadCredentials { user: "admin".to_owned() }));
        assert_eq!(tries.load(Ordering::SeqCst), 2, "without a signature, and with one");
    }
    assert_eq!(camera.take(), [""; 0]);
}

/// A move that may have been carried out is not taken for one that was refused, or nobody would stop it.
#[tokio::test]
async fn what_becomes_of_a_move_without_a_timeout_is_told_where_one_with_it_was_refused() {
    for (status, may_have_acted) in
        [(StatusCode::INTERNAL_SERVER_ERROR, true), (StatusCode::NOT_FOUND, false)]
    {
        let fault = r#"<e:Envelope xmlns:e="http://www.w3.org/2003/05/soap-envelope"><e:Body><e:Fault><e:Reason>
            <e:Text>no such timeout</e:Text></e:Reason></e:Fault></e:Body></e:Envelope>"#;
        let instead =
            move |message: &str| match (message.contains("ContinuousMove"), message.contains("Timeout")) {
                (false, _) => None,
                (true, true) => Some((StatusCode::BAD_REQUEST, fault).into_response()),
                (true, false) => Some(status.into_response()),
            };
        let camera = Camera::default();
        let mut client = client(&served_with(camera.clone(), instead).await, "secret");
        let failed = client.exchange(&right()).await.unwrap_err();
        assert_eq!(failed.may_have_acted(), may_have_acted, "{failed}");
        if !may_have_acted {
            assert_eq!(failed, Error::Camera("no such timeout".to_owned()));
        }
    }
}

/// Who does not answer at all is asked for its position when it is back; who is late with that alone is not asked any more.
#[tokio::test]
async fn only_a_camera_that_is_there_is_late_with_its_position() {
    for (silent, asked_again) in [("Envelope", true), ("GetStatus", false)] {
        let (is_silent, asked) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        let (silence, asking) = (is_silent.clone(), asked.clone());
        let instead = move |message: &str| {
            asking.fetch_add(usize::from(message.contains("GetStatus")), Ordering::Relaxed);
            (silence.load(Ordering::Relaxed) && message.contains(silent)).then(|| SILENCE.into_response())
        };
        let address = served_with(Camera::default(), instead).await;
        let mut client = client_within(&address, "secret", Duration::from_millis(1200));
        let position = Request::Query(Query::Position);
        let _ = client.exchange(&position).await;
        is_silent.store(true, Ordering::Relaxed);
        for _ in 0..2 {
            client.exchange(&position).await.unwrap_err();
        }
        is_silent.store(false, Ordering::Relaxed);
        let before = asked.load(Ordering::Relaxed);
        let _ = client.exchange(&position).await;
        assert_eq!(asked.load(Ordering::Relaxed) > before, asked_again, "{silent}");
    }
}
