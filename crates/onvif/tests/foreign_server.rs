// SPDX-License-Identifier: MPL-2.0

//! Our client before a server that others wrote, with WSDL and log-in of its own: the crate `onvif-server`.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use async_trait::async_trait;
use axum::extract::Request as HttpRequest;
use axum::http::{StatusCode, header};
use axum::middleware::{Next, from_fn};
use axum::response::IntoResponse;
use onvif::{Client, Encoding};
use onvif_server::generated::{DeviceInfo, PTZPreset, PTZStatusResult};
use onvif_server::{DeviceService, MediaService, OnvifError, OnvifServer, PTZService};
use servo::Motion;
use session::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};
use session::{Client as _, Command, Error, Query, Request, Response, Stop};

const PATIENCE: Duration = Duration::from_secs(60);

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
    served_with(camera, Arc::default()).await
}

/// So many requests are refused in between, whoever asks, and Digest asked for: as of a camera that restarts.
async fn served_with(camera: Camera, refusals: Arc<AtomicUsize>) -> String {
    let server = OnvifServer::builder()
        .auth("admin", "secret")
        .device_service(camera.clone())
        .media_service(camera.clone())
        .ptz_service(camera);
    let listener = tokio::net::TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let address = listener.local_addr().unwrap();
    let router = server.port(address.port()).build().unwrap().into_router().unwrap();
    let router = router.layer(from_fn(move |request: HttpRequest, next: Next| {
        let one_less = |left: usize| left.checked_sub(1);
        let refuses = refusals.fetch_update(Ordering::SeqCst, Ordering::SeqCst, one_less).is_ok();
        async move {
            if refuses {
                let challenge = r#"Digest realm="camera", nonce="1", qop="auth""#;
                (StatusCode::UNAUTHORIZED, [(header::WWW_AUTHENTICATE, challenge)]).into_response()
            } else {
                next.run(request).await
            }
        }
    }));
    tokio::spawn(async move { axum::serve(listener, router).await });
    format!("http://{address}")
}

fn client(address: &str, password: &str) -> Client {
    Client::new(ClientSettings {
        location: Location::parse(address).unwrap().0,
        channel: String::new(),
        credentials: Some(Credentials { user: "admin".to_owned(), password: Secret::new(password) }),
        authentication: Authentication::Auto,
        timeout: PATIENCE,
        trust: Trust::System,
    })
    .unwrap()
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
    let address = served_with(camera.clone(), refusals.clone()).await;
    let mut client = client(&address, "secret");
    let right = Request::Command(Command::Move {
        motion: Motion::Velocity { pan: 0.5, tilt: 0.0, zoom: None },
        free: false,
    });
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
