// SPDX-License-Identifier: MPL-2.0

//! RTSP with the stock `rtspsrc`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::{PATIENCE, settings};
use gst::prelude::*;
use virtual_camera::{Auth, Settings, VirtualCamera};

/// Plays a URL until `count` pictures have come; gives their size.
fn play(url: &str, credentials: Option<(&str, &str)>, count: usize) -> Result<(u32, u32), String> {
    gst::init().unwrap();
    let pipeline = gst::parse::launch(
        "rtspsrc name=source latency=0 protocols=tcp ! decodebin ! videoconvert ! appsink name=sink sync=false",
    )
    .unwrap()
    .downcast::<gst::Pipeline>()
    .unwrap();
    let source = pipeline.by_name("source").unwrap();
    source.set_property("location", url);
    if let Some((user, password)) = credentials {
        source.set_property("user-id", user);
        source.set_property("user-pw", password);
    }
    let sink = pipeline.by_name("sink").and_downcast::<gst_app::AppSink>().unwrap();
    let bus = pipeline.bus().unwrap();
    let (sender, frames) = std::sync::mpsc::channel();
    let counted = sender.clone();
    sink.set_callbacks(
        gst_app::AppSinkCallbacks::builder()
            .new_sample(move |sink| {
                let sample = sink.pull_sample().map_err(|_| gst::FlowError::Eos)?;
                let info = gst_video::VideoInfo::from_caps(sample.caps().unwrap()).unwrap();
                let _ = counted.send(Ok((info.width(), info.height())));
                Ok(gst::FlowSuccess::Ok)
            })
            .build(),
    );
    bus.set_sync_handler(move |_, message| {
        if let gst::MessageView::Error(error) = message.view() {
            let _ = sender.send(Err(error.error().to_string()));
        }
        gst::BusSyncReply::Drop
    });
    pipeline.set_state(gst::State::Playing).unwrap();
    let mut last = Err("nothing".to_string());
    for _ in 0..count {
        last = frames
            .recv_timeout(PATIENCE)
            .map_err(|_| "no picture in time".to_string())
            .and_then(|frame| frame);
        if last.is_err() {
            break;
        }
    }
    pipeline.set_state(gst::State::Null).unwrap();
    last
}

#[test]
fn every_codec_plays_in_the_size_asked_for() {
    let camera = VirtualCamera::start(settings()).unwrap();
    for codec in ["mpeg4", "jpeg", "h264"] {
        let url = format!(
            "{}/axis-media/media.amp?videocodec={codec}&resolution=320x240&fps=20",
            camera.rtsp_url()
        );
        assert_eq!(play(&url, None, 5), Ok((320, 240)), "{codec}");
        assert!(camera.wait_for(PATIENCE, |status| status.viewers == 0), "{codec}");
    }
    assert_eq!(play(&format!("{}/mpeg4/media.amp", camera.rtsp_url()), None, 3), Ok((160, 120)));
}

#[test]
fn nonsense_is_refused() {
    let camera = VirtualCamera::start(settings()).unwrap();
    for path in
        ["/axis-media/media.amp?videocodec=mpeg2", "/axis-media/media.amp?resolution=huge", "/elsewhere"]
    {
        assert!(play(&format!("{}{path}", camera.rtsp_url()), None, 1).is_err(), "{path}");
    }
}

#[test]
fn the_password_is_asked_for() {
    for auth in [Auth::Basic, Auth::Digest { qop: true }, Auth::Both] {
        let camera = VirtualCamera::start(Settings { auth, ..settings() }).unwrap();
        let url = format!("{}/axis-media/media.amp?videocodec=jpeg", camera.rtsp_url());
        assert_eq!(play(&url, Some(("root", "pass")), 1), Ok((160, 120)), "{auth:?}");
        assert!(play(&url, Some(("root", "guess")), 1).is_err(), "{auth:?}");
        assert!(play(&url, None, 1).is_err(), "{auth:?}");
    }
}

#[test]
fn dropping_the_camera_closes_its_ports_and_ends_its_clients() {
    let camera = VirtualCamera::start(settings()).unwrap();
    let addresses = [camera.url().replace("http://", ""), camera.rtsp_url().replace("rtsp://", "")];
    gst::init().unwrap();
    let url = format!("{}/axis-media/media.amp?videocodec=mpeg4", camera.rtsp_url());
    let pipeline = gst::parse::launch(&format!("rtspsrc location={url} ! fakesink")).unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    assert!(camera.wait_for(PATIENCE, |status| status.viewers == 1));
    drop(camera);
    for address in addresses {
        assert!(std::net::TcpStream::connect(&address).is_err(), "{address} still listens");
    }
    pipeline.set_state(gst::State::Null).unwrap();
}
