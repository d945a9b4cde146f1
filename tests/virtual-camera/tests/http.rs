//! VAPIX over real HTTP.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::{PATIENCE, client, get, settings};
use virtual_camera::VirtualCamera;

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
