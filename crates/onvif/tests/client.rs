// SPDX-License-Identifier: MPL-2.0

//! The client and its watchdog, over real HTTP.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

use std::time::Duration;

use onvif::Client;
use servo::Motion;
use session::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};
use session::watchdog::{Lease, Standing, StopOrder, Watchdog, WatchdogAddress};
use session::{Client as _, Command, Error, Query, Request, Response, Stop};
use virtual_camera::{Auth, OnvifSettings, Quirk, Settings, VirtualCamera};

/// Only a failure takes this long.
const PATIENCE: Duration = Duration::from_secs(60);

const RIGHT: Request = Request::Command(Command::Move {
    motion: Motion::Velocity { pan: 0.4, tilt: 0.0, zoom: None },
    free: false,
});

const STOP: Request = Request::Command(Command::Stop(Stop::PanTilt));

fn camera(quirks: &[Quirk]) -> VirtualCamera {
    let onvif = Some(OnvifSettings::with(quirks));
    VirtualCamera::start(Settings { auth: Auth::Digest { qop: true }, onvif, ..Settings::default() }).unwrap()
}

fn client(camera: &VirtualCamera, password: &str) -> Client {
    let credentials = Credentials { user: "root".to_owned(), password: Secret::new(password) };
    Client::new(ClientSettings {
        location: Location::parse(&camera.onvif_url().unwrap()).unwrap().0,
        channel: String::new(),
        credentials: Some(credentials),
        authentication: Authentication::Auto,
        timeout: PATIENCE,
        trust: Trust::System,
    })
    .unwrap()
}

#[tokio::test]
async fn a_clock_that_is_wrong_keeps_nobody_out() {
    for quirk in [Quirk::ClockAhead, Quirk::ClockBehind] {
        let camera = camera(&[quirk]);
        let mut client = client(&camera, "pass");
        assert_eq!(client.exchange(&RIGHT).await, Ok(Response::Accepted));
        assert_eq!(camera.status().refused, 0);
    }
}

#[tokio::test]
async fn a_wrong_password_is_tried_twice_and_never_again() {
    let camera = camera(&[]);
    let mut client = client(&camera, "wrong");
    for _ in 0..3 {
        let answer = client.exchange(&RIGHT).await;
        assert_eq!(answer, Err(Error::BadCredentials { user: "root".to_owned() }));
        assert_eq!(camera.status().refused, 2);
    }
    assert_eq!(camera.commands().len(), 0);
    client.set_credentials(Some(Credentials { user: "root".to_owned(), password: Secret::new("pass") }));
    assert_eq!(client.exchange(&RIGHT).await, Ok(Response::Accepted));
}

#[tokio::test]
async fn a_camera_that_refuses_a_timeout_is_moved_without_and_somebody_is_told_once() {
    let camera = camera(&[Quirk::TimeoutRefused]);
    let mut client = client(&camera, "pass");
    // It may be busy the first times.
    for is_for_good in [false, false, true, false] {
        assert_eq!(client.exchange(&RIGHT).await, Ok(Response::Accepted));
        let warning = client.take_warning();
        assert_eq!(warning.is_some(), is_for_good);
        assert!(warning.is_none_or(|warning| warning.contains("moves with a time limit")));
    }
}

#[tokio::test]
async fn presets_are_gone_to_by_their_numbers() {
    let camera = camera(&[]);
    let mut client = client(&camera, "pass");
    let Ok(Response::Presets(presets)) = client.exchange(&Request::Query(Query::Presets)).await else {
        panic!()
    };
    let number = presets.number("Home").unwrap();
    let go = Request::Command(Command::Move { motion: Motion::Preset { number }, free: false });
    assert_eq!(client.exchange(&go).await, Ok(Response::Accepted));
    assert!(camera.commands().iter().any(|command| command.query.contains("GotoPreset")));
    let mut second = Client::in_place_of(client.identity()).unwrap();
    assert_eq!(
        second.exchange(&go).await,
        Ok(Response::Accepted),
        "by the number that was told to the first"
    );
}

/// As where the account is changed while somebody is followed.
#[tokio::test]
async fn who_goes_on_in_somebodys_place_asks_what_the_camera_can_do() {
    let camera = camera(&[]);
    let mut first = client(&camera, "pass");
    let limits = Request::Query(Query::Limits);
    let told = first.exchange(&limits).await.unwrap();
    let mut second = Client::in_place_of(first.identity()).unwrap();
    assert_eq!(second.exchange(&STOP).await, Ok(Response::Accepted));
    let before = camera.status().requests;
    assert_eq!(second.exchange(&limits).await, Ok(told));
    assert_eq!(camera.status().requests, before + 1, "it is asked once");
    let _ = second.exchange(&limits).await;
    assert_eq!(camera.status().requests, before + 1);
}

/// Each question takes a slow camera most of a second, while it turns.
#[tokio::test]
async fn who_stops_a_camera_in_somebodys_place_asks_nothing() {
    for quirk in [Quirk::ClockAhead, Quirk::SecondProfile, Quirk::StopMissing] {
        let camera = camera(&[quirk]);
        let mut first = client(&camera, "pass");
        assert_eq!(first.exchange(&RIGHT).await, Ok(Response::Accepted));
        if quirk == Quirk::StopMissing {
            // It was found to take no `Stop`.
            assert_eq!(first.exchange(&STOP).await, Ok(Response::Accepted));
            assert_eq!(first.exchange(&RIGHT).await, Ok(Response::Accepted));
        }
        let mut second = Client::in_place_of(first.identity()).unwrap();
        let before = camera.status().requests;
        assert_eq!(second.exchange(&STOP).await, Ok(Response::Accepted), "{quirk:?}");
        assert_eq!(camera.status().requests, before + 1, "{quirk:?}");
        assert!(camera.wait_for(PATIENCE, |status| !status.moving), "{quirk:?}");
    }
}

/// What the application cannot do any more, for a camera that heeds neither timeout nor `Stop`.
#[tokio::test]
async fn a_camera_whose_application_is_gone_is_stopped() {
    let camera = camera(&[Quirk::TimeoutIgnored, Quirk::StopMissing]);
    let mut client = client(&camera, "pass");
    let watchdog = Watchdog::new(WatchdogAddress::Program(env!("CARGO_BIN_EXE_onvif-watchdog").into()));
    let mut lease = Lease::new(watchdog.clone());
    let order = StopOrder { identity: client.identity(), words: Stop::PanTilt, in_doubt: false };
    lease.hold(order);
    lease.settled().await;
    assert!(matches!(lease.standing(), Some(Standing::Held)), "{:?}", lease.standing());
    assert_eq!(client.exchange(&RIGHT).await, Ok(Response::Accepted));
    assert!(camera.wait_for(PATIENCE, |status| status.moving));
    drop((lease, watchdog));
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}
