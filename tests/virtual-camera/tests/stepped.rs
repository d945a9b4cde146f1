// SPDX-License-Identifier: MPL-2.0

//! A camera whose time goes on only when it is told.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::{Duration, Instant};

use common::{PATIENCE, client, get, settings};
use gst::prelude::*;
use virtual_camera::{Clock, Kinematics, Settings, Status, VirtualCamera};

const PERIOD: Duration = Duration::from_millis(40);
const SIZE: (u32, u32) = (160, 120);

fn stepped() -> Settings {
    Settings {
        clock: Clock::Stepped,
        // Nobody would step on before the answer is there.
        service_time: Duration::from_secs(3600),
        ..settings()
    }
}

async fn turn(camera: &VirtualCamera, pan: i32) {
    let path = format!("/axis-cgi/com/ptz.cgi?continuouspantiltmove={pan},0");
    assert_eq!(get(&client(), camera, &path).await.0, 204);
}

#[tokio::test]
async fn nothing_moves_until_it_is_told_and_commands_act_after_their_delay() {
    let camera = VirtualCamera::start(stepped()).unwrap();
    turn(&camera, 30).await;
    let before = camera.status();
    assert_eq!((before.time, before.pan_deg, before.footage_frame), (Duration::ZERO, 0.0, 0));
    assert_eq!(camera.commands()[0].time, Duration::ZERO);
    // Real time passes while the answer to another request is awaited; the camera's does not.
    assert_eq!(get(&client(), &camera, "/axis-cgi/com/ptz.cgi?query=position").await.0, 200);
    assert_eq!(camera.status().time, Duration::ZERO);

    let delay = Kinematics::default().command_delay;
    camera.advance_to(delay);
    assert_eq!((camera.status().pan_deg, camera.status().moving), (0.0, true));
    camera.advance_to(delay + 2 * PERIOD);
    let after = camera.status();
    assert!(after.pan_deg > 0.0);
    assert_eq!((after.time, after.footage_frame), (delay + 2 * PERIOD, 7));

    // There is no way back.
    camera.advance_to(PERIOD);
    assert_eq!(camera.status(), Status { requests: after.requests, ..after });
}

#[tokio::test]
async fn the_same_steps_give_the_same_pictures_and_the_same_truth() {
    let mut runs = Vec::new();
    for _ in 0..2 {
        let camera = VirtualCamera::start(stepped()).unwrap();
        assert_eq!(camera.frame_period(), PERIOD);
        let mut run = Vec::new();
        for step in 0..120u32 {
            let exposure = step * PERIOD;
            camera.advance_to(exposure + camera.video_delay());
            if step % 25 == 10 {
                turn(&camera, if step % 50 == 10 { 20 } else { -35 }).await;
            }
            let picture = camera.picture(exposure, SIZE).unwrap();
            run.push((picture, camera.ground_truth(exposure, SIZE), camera.pose_at(exposure)));
        }
        runs.push(run);
    }
    assert!(runs[0] == runs[1], "the runs differ");
    let run = &runs[0];
    assert!(
        run.iter().any(|(_, truth, _)| truth.is_empty()) && run.iter().any(|(_, truth, _)| !truth.is_empty())
    );
    assert!(run.iter().any(|(_, _, pose)| pose.pan_deg > 1.0));
    assert!(run.windows(2).any(|pair| pair[0].0 != pair[1].0));
}

#[tokio::test]
async fn a_stream_sends_one_picture_a_step() {
    let camera = VirtualCamera::start(stepped()).unwrap();
    let url = format!("{}/axis-cgi/mjpg/video.cgi", camera.url());
    let mut response = client().get(url).send().await.unwrap();
    assert!(camera.wait_for(PATIENCE, |status| status.viewers == 1));
    let delay = camera.video_delay();
    for step in 0..5 {
        // Streams take their pictures in the middle of the period.
        camera.advance_to(step * PERIOD + PERIOD / 2 + delay);
        let mut received = Vec::new();
        while !received.ends_with(b"\r\n--myboundary\r\n") {
            received.extend_from_slice(&response.chunk().await.unwrap().unwrap());
        }
        let pictures = received.windows(24).filter(|window| window == b"Content-Type: image/jpeg").count();
        assert_eq!(pictures, 1, "at step {step}");
    }
}

/// Plays `url` and gives a channel on which every picture is told of.
fn play(url: &str) -> (gst::Pipeline, std::sync::mpsc::Receiver<()>) {
    gst::init().unwrap();
    let launch = format!(
        "rtspsrc protocols=tcp latency=0 location={url} ! rtpjpegdepay ! appsink name=sink sync=false"
    );
    let pipeline = gst::parse::launch(&launch).unwrap().downcast::<gst::Pipeline>().unwrap();
    let sink = pipeline.by_name("sink").and_downcast::<gst_app::AppSink>().unwrap();
    let (sender, pictures) = std::sync::mpsc::channel();
    let tell = move |sink: &gst_app::AppSink| {
        sink.pull_sample().map_err(|_| gst::FlowError::Eos)?;
        let _ = sender.send(());
        Ok(gst::FlowSuccess::Ok)
    };
    sink.set_callbacks(gst_app::AppSinkCallbacks::builder().new_sample(tell).build());
    pipeline.set_state(gst::State::Playing).unwrap();
    (pipeline, pictures)
}

#[test]
fn rtsp_goes_on_with_the_steps() {
    let camera = VirtualCamera::start(stepped()).unwrap();
    let url = format!("{}/axis-media/media.amp?videocodec=jpeg", camera.rtsp_url());
    let (pipeline, pictures) = play(&url);
    let deadline = Instant::now() + PATIENCE;
    let (mut time, mut seen) = (Duration::ZERO, 0);
    while seen < 10 {
        assert!(Instant::now() < deadline, "{seen} pictures");
        time += PERIOD;
        camera.advance_to(time);
        seen += usize::from(pictures.recv_timeout(Duration::from_millis(20)).is_ok());
    }
    pipeline.set_state(gst::State::Null).unwrap();
}

#[test]
fn a_camera_that_nobody_steps_any_more_ends_all_the_same() {
    let camera = VirtualCamera::start(stepped()).unwrap();
    let url = format!("{}/axis-media/media.amp?videocodec=jpeg", camera.rtsp_url());
    let (pipeline, _) = play(&url);
    // The session being set up waits for its first picture.
    assert!(camera.wait_for(PATIENCE, |status| status.viewers == 1));
    drop(camera);
    pipeline.set_state(gst::State::Null).unwrap();
}
