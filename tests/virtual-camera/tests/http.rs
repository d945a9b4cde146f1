// SPDX-License-Identifier: MPL-2.0

//! VAPIX over real HTTP.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::{PATIENCE, client, get, settings};
use digest_auth::{AuthContext, WwwAuthenticateHeader};
use virtual_camera::{
    Auth, Clock, Kinematics, Pose, Settings, SyntheticSettings, VirtualCamera, Waypoint, World,
};

#[tokio::test]
async fn a_continuous_move_runs_until_it_is_stopped() {
    let camera = VirtualCamera::start(settings()).unwrap();
    let client = client();
    assert!(!camera.status().moving);
    let moved = get(&client, &camera, "/axis-cgi/com/ptz.cgi?continuouspantiltmove=30,0&camera=1").await;
    assert_eq!(moved, (204, String::new()));
    assert!(camera.wait_for(PATIENCE, |status| status.pan_deg > 2.0 && status.pan_rate_deg_s > 5.0));
    let stopped = get(&client, &camera, "/axis-cgi/com/ptz.cgi?continuouspantiltmove=0,0").await;
    assert_eq!(stopped.0, 204);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    let queries: Vec<_> =
        camera.commands().into_iter().map(|command| (command.query, command.status)).collect();
    assert_eq!(
        queries,
        [("continuouspantiltmove=30,0&camera=1".into(), 204), ("continuouspantiltmove=0,0".into(), 204)]
    );
}

#[tokio::test]
async fn mjpeg_comes_in_parts_as_many_as_asked_for() {
    let camera = VirtualCamera::start(settings()).unwrap();
    let url = format!("{}/axis-cgi/mjpg/video.cgi?nbrofframes=5&resolution=320x240&fps=50", camera.url());
    let response = client().get(url).send().await.unwrap();
    assert_eq!(response.headers()["content-type"], "multipart/x-mixed-replace;boundary=myboundary");
    let body = response.bytes().await.unwrap();
    let mut rest = body.strip_prefix(b"--myboundary\r\n").unwrap();
    let mut parts = 0;
    while !rest.is_empty() {
        let end = rest.windows(4).position(|window| window == b"\r\n\r\n").unwrap();
        let head = std::str::from_utf8(&rest[..end]).unwrap();
        let length = head.strip_prefix("Content-Type: image/jpeg\r\nContent-Length: ").unwrap();
        let (jpeg, tail) = rest[end + 4..].split_at(length.parse().unwrap());
        assert_eq!((&jpeg[..2], &jpeg[jpeg.len() - 2..]), (&[0xff, 0xd8][..], &[0xff, 0xd9][..]));
        rest = tail.strip_prefix(b"\r\n--myboundary\r\n").unwrap();
        parts += 1;
    }
    assert_eq!(parts, 5);
    assert!(camera.wait_for(PATIENCE, |status| status.viewers == 0));
}

#[tokio::test]
async fn forms_and_queries_do_the_same() {
    let camera = VirtualCamera::start(settings()).unwrap();
    let url = format!("{}/axis-cgi/com/ptz.cgi", camera.url());
    let posted = client()
        .post(url)
        .header("Content-Type", "application/x-www-form-urlencoded")
        .body("camera=1&rpan=3&rtilt=-2")
        .send()
        .await
        .unwrap();
    assert_eq!(posted.status(), 204);
    assert!(camera.wait_for(PATIENCE, |status| status.pan_deg == 3.0 && status.tilt_deg == -2.0));
}

#[tokio::test]
async fn endless_pan_is_told_from_end_to_end_and_passes_there() {
    let kinematics = Kinematics { endless_pan: true, ..Kinematics::default() };
    let home = Some(Pose { pan_deg: 170.0, ..Pose::default() });
    let settings = Settings { kinematics, home, clock: Clock::Stepped, ..settings() };
    let camera = VirtualCamera::start(settings).unwrap();
    let client = client();
    let ask = async |path: &str| get(&client, &camera, path).await.1;
    let limits = ask("/axis-cgi/com/ptz.cgi?query=limits").await;
    assert!(limits.starts_with("MinPan=-180\r\nMaxPan=180\r\n"), "{limits}");
    let limits = ask("/axis-cgi/param.cgi?action=list&group=PTZ.Limit").await;
    assert!(limits.contains("MaxPan=180\n") && limits.contains("MinPan=-180\n"), "{limits}");
    ask("/axis-cgi/com/ptz.cgi?pan=-170").await;
    let mut seen = Vec::new();
    for step in 1..200 {
        camera.advance_to(Duration::from_millis(10) * step);
        seen.push(camera.status().pan_deg);
    }
    assert!(seen.iter().all(|pan| (170.0..=180.0).contains(&pan.abs())), "{seen:?}");
    assert!(ask("/axis-cgi/com/ptz.cgi?query=position").await.starts_with("pan=-170.0000\r\n"));
}

#[tokio::test]
async fn the_truth_about_a_picture_comes_as_json() {
    let here = Waypoint { time: Duration::ZERO, pan_deg: 3.0, tilt_deg: 0.0 };
    let world = SyntheticSettings { path: vec![here], stays: true, ..SyntheticSettings::default() };
    let settings = Settings { world: World::Synthetic(world), clock: Clock::Stepped, ..settings() };
    let camera = VirtualCamera::start(settings).unwrap();
    camera.advance_to(Duration::from_millis(500));
    let client = client();
    let picture = client.get(format!("{}/api/picture.jpg", camera.url())).send().await.unwrap();
    assert_eq!(picture.headers()["x-exposure"], "0.4");
    let (status, json) = get(&client, &camera, "/api/truth?at=0.4&resolution=320x240").await;
    let truth: serde_json::Value = serde_json::from_str(&json).unwrap();
    let known = camera.ground_truth(Duration::from_millis(400), (320, 240));
    assert_eq!(known.len(), 1);
    assert_eq!((status, &truth["size"]), (200, &serde_json::json!([320, 240])));
    assert!(json.contains(&serde_json::to_string(&known).unwrap()), "{json}");
    assert_eq!(truth["silhouette"], serde_json::json!([]));
    for nonsense in ["at=-1", "at=nan", "at=soon"] {
        assert_eq!(get(&client, &camera, &format!("/api/truth?{nonsense}")).await.0, 400, "{nonsense}");
    }
}

#[tokio::test]
async fn snapshots_have_the_size_asked_for() {
    let camera = VirtualCamera::start(settings()).unwrap();
    let client = client();
    let size = get(&client, &camera, "/axis-cgi/imagesize.cgi?resolution=320x180&camera=1").await;
    assert_eq!(size, (200, "image width = 320\nimage height = 180\n".into()));
    let url = format!("{}/axis-cgi/jpg/image.cgi?resolution=320x180", camera.url());
    let response = client.get(url).send().await.unwrap();
    assert_eq!(response.headers()["content-type"], "image/jpeg");
    let jpeg = response.bytes().await.unwrap();
    // The frame header of a JPEG: marker, length, precision, height, width.
    let header = jpeg.windows(9).find(|window| window[..2] == [0xff, 0xc0]).unwrap();
    assert_eq!([header[5], header[6], header[7], header[8]], [0, 180, 1, 64]);
    assert_eq!(get(&client, &camera, "/axis-cgi/jpg/image.cgi?resolution=huge").await.0, 400);
}

#[tokio::test]
async fn digest_is_asked_for_and_a_nonce_is_good_for_many_requests_until_it_is_stale() {
    for qop in [true, false] {
        let camera = VirtualCamera::start(Settings { auth: Auth::Digest { qop }, ..settings() }).unwrap();
        let client = client();
        let target = "/axis-cgi/com/ptz.cgi?camera=1&continuouspantiltmove=-1,0";
        let url = format!("{}{target}", camera.url());
        let refused = client.get(&url).send().await.unwrap();
        assert_eq!(refused.status(), 401);
        let challenge = refused.headers()["www-authenticate"].to_str().unwrap().to_owned();
        let mut challenge = WwwAuthenticateHeader::parse(&challenge).unwrap();
        assert_eq!(challenge.qop.is_some(), qop);
        for _ in 0..3 {
            let answer = challenge.respond(&AuthContext::new("root", "pass", target)).unwrap().to_string();
            assert_eq!(client.get(&url).header("Authorization", answer).send().await.unwrap().status(), 204);
        }
        let wrong = challenge.respond(&AuthContext::new("root", "guess", target)).unwrap().to_string();
        assert_eq!(client.get(&url).header("Authorization", wrong).send().await.unwrap().status(), 401);
        assert_eq!((camera.status().refused, camera.commands().len()), (2, 3));
    }
}

#[tokio::test]
async fn a_stale_nonce_is_said_to_be_stale() {
    let settings = Settings { auth: Auth::Both, nonce_lifetime: Duration::ZERO, ..settings() };
    let camera = VirtualCamera::start(settings).unwrap();
    let client = client();
    let url = format!("{}/axis-cgi/param.cgi?action=list", camera.url());
    let refused = client.get(&url).send().await.unwrap();
    let challenges: Vec<_> = refused.headers().get_all("www-authenticate").iter().collect();
    assert_eq!(challenges.len(), 2);
    assert_eq!(challenges[1].to_str().unwrap(), "Basic realm=\"AXIS_ACCC8E012345\"");
    let mut challenge = WwwAuthenticateHeader::parse(challenges[0].to_str().unwrap()).unwrap();
    assert!(!challenge.stale);
    let context = AuthContext::new("root", "pass", "/axis-cgi/param.cgi?action=list");
    let answer = challenge.respond(&context).unwrap().to_string();
    let late = client.get(&url).header("Authorization", answer).send().await.unwrap();
    assert_eq!(late.status(), 401);
    let again = late.headers()["www-authenticate"].to_str().unwrap();
    assert!(WwwAuthenticateHeader::parse(again).unwrap().stale, "{again}");
    assert_eq!(client.get(&url).basic_auth("root", Some("pass")).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn requests_are_served_one_after_the_other() {
    let camera = VirtualCamera::start(Settings {
        service_time: Duration::from_millis(20),
        kinematics: Kinematics { command_delay: Duration::ZERO, ..Kinematics::default() },
        ..settings()
    })
    .unwrap();
    let client = client();
    let before = camera.status().time;
    let (first, second, third) = tokio::join!(
        get(&client, &camera, "/axis-cgi/com/ptz.cgi?query=speed"),
        get(&client, &camera, "/axis-cgi/com/ptz.cgi?query=mode"),
        get(&client, &camera, "/axis-cgi/param.cgi?action=list&group=Brand.Brand"),
    );
    assert_eq!(first.1, "speed=100\r\n");
    assert_eq!(second.1, "mode=normal\r\n");
    assert_eq!(third.1, "root.Brand.Brand=AXIS\n");
    assert!(camera.status().time - before >= Duration::from_millis(60));
    assert_eq!(camera.status().requests, 3);
}

#[tokio::test]
async fn what_is_not_there_is_404() {
    let camera = VirtualCamera::start(settings()).unwrap();
    assert_eq!(get(&client(), &camera, "/axis-cgi/apidiscovery.cgi").await.0, 404);
    assert_eq!(get(&client(), &camera, "/axis-cgi/com/ptzqueue.cgi?control=query").await.0, 404);
}
