// SPDX-License-Identifier: MPL-2.0

//! How the camera misbehaves when told to, seen from the wire.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::{
    io::{ErrorKind, Read, Write},
    net::TcpStream,
    time::{Duration, Instant},
};

use common::{PATIENCE, settings};
use virtual_camera::{Fault, VirtualCamera};

const STOP: &str = "GET /axis-cgi/com/ptz.cgi?continuouspantiltmove=0,0 HTTP/1.1\r\nHost: camera\r\n\r\n";

fn connect(camera: &VirtualCamera) -> TcpStream {
    let stream = TcpStream::connect(camera.http_address()).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream
}

/// Sends a stop on a connection; gives what comes back up to the end of the headers or of the connection.
fn ask(stream: &mut TcpStream) -> std::io::Result<Vec<u8>> {
    stream.write_all(STOP.as_bytes())?;
    let mut answer = Vec::new();
    let mut byte = [0];
    while !answer.ends_with(b"\r\n\r\n") && stream.read(&mut byte)? == 1 {
        answer.push(byte[0]);
    }
    Ok(answer)
}

fn camera_with(fault: Fault) -> VirtualCamera {
    let camera = VirtualCamera::start(settings()).unwrap();
    camera.set_fault(fault);
    camera
}

#[test]
fn refused_connections_come_back_on_the_same_port() {
    let camera = VirtualCamera::start(settings()).unwrap();
    let mut kept = connect(&camera);
    assert!(ask(&mut kept).unwrap().starts_with(b"HTTP/1.1 204 "));
    camera.set_fault(Fault::Refuse);
    assert!(ask(&mut kept).is_err(), "an open connection is reset");
    let deadline = Instant::now() + PATIENCE;
    while TcpStream::connect(camera.http_address()).is_ok() {
        assert!(Instant::now() < deadline, "it still listens");
    }
    camera.set_fault(Fault::None);
    let mut stream = loop {
        match TcpStream::connect(camera.http_address()) {
            Ok(stream) => break stream,
            Err(_) => assert!(Instant::now() < deadline, "it never listens again"),
        }
    };
    assert!(ask(&mut stream).unwrap().starts_with(b"HTTP/1.1 204 "));
}

#[test]
fn a_reset_is_a_reset() {
    let camera = camera_with(Fault::Reset);
    let error = ask(&mut connect(&camera)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::ConnectionReset);
    assert_eq!(camera.commands()[0].status, 0);
}

#[test]
fn garbage_comes_as_it_is_and_ends() {
    let garbage = b"\x00\xff no HTTP at all \r\n".to_vec();
    let camera = camera_with(Fault::Garbage(garbage.clone()));
    assert_eq!(ask(&mut connect(&camera)).unwrap(), garbage);
}

#[test]
fn wrong_answers_do_nothing() {
    for (fault, status, body) in [
        (Fault::Status(503), 503, ""),
        (Fault::ErrorBody("Error: camera is busy\r\n".into()), 200, "Error: camera is busy\r\n"),
        (Fault::EmptyOk, 200, ""),
    ] {
        let camera = camera_with(fault.clone());
        let mut stream = connect(&camera);
        let request =
            "GET /axis-cgi/com/ptz.cgi?rpan=5 HTTP/1.1\r\nHost: camera\r\nConnection: close\r\n\r\n";
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{fault:?}: {answer}");
        assert_eq!(answer.split_once("\r\n\r\n").unwrap().1, body, "{fault:?}");
        assert!(!camera.status().moving);
        assert_eq!(camera.commands()[0].status, status);
    }
}

#[test]
fn a_hanging_request_never_ends_and_others_go_on() {
    let camera = camera_with(Fault::Hang);
    let mut hanging = connect(&camera);
    hanging.write_all(STOP.as_bytes()).unwrap();
    assert!(camera.wait_for(PATIENCE, |status| status.commands == 1));
    camera.set_fault(Fault::None);
    assert!(ask(&mut connect(&camera)).unwrap().starts_with(b"HTTP/1.1 204 "));
    hanging.set_nonblocking(true).unwrap();
    assert_eq!(hanging.read(&mut [0]).unwrap_err().kind(), ErrorKind::WouldBlock);
    assert_eq!(camera.status().most_in_flight, 2);
}

#[test]
fn a_delayed_answer_is_late_but_the_command_acts_at_once() {
    let camera = camera_with(Fault::Delay(Duration::from_secs(3600)));
    let mut stream = connect(&camera);
    let request = "GET /axis-cgi/com/ptz.cgi?rpan=5 HTTP/1.1\r\nHost: camera\r\n\r\n";
    stream.write_all(request.as_bytes()).unwrap();
    assert!(camera.wait_for(PATIENCE, |status| status.pan_deg == 5.0));
    stream.set_nonblocking(true).unwrap();
    assert_eq!(stream.read(&mut [0]).unwrap_err().kind(), ErrorKind::WouldBlock);
    camera.set_fault(Fault::Delay(Duration::ZERO));
    assert!(ask(&mut connect(&camera)).unwrap().starts_with(b"HTTP/1.1 204 "));
}

#[test]
fn a_connection_can_close_after_its_answer_without_a_word() {
    let camera = camera_with(Fault::CloseAfterResponse);
    let mut stream = connect(&camera);
    let answer = String::from_utf8(ask(&mut stream).unwrap()).unwrap();
    assert!(answer.starts_with("HTTP/1.1 204 "), "{answer}");
    assert!(!answer.to_lowercase().contains("connection: close"), "{answer}");
    assert_eq!(stream.read(&mut [0]).unwrap(), 0);
}

#[test]
fn video_goes_on_whatever_happens() {
    for fault in [Fault::Hang, Fault::Reset, Fault::Refuse, Fault::Delay(Duration::from_secs(3600))] {
        let camera = VirtualCamera::start(settings()).unwrap();
        let mut video = connect(&camera);
        video.write_all(b"GET /mjpg/video.mjpg HTTP/1.1\r\nHost: camera\r\n\r\n").unwrap();
        assert!(camera.wait_for(PATIENCE, |status| status.viewers == 1));
        camera.set_fault(fault.clone());
        let mut received = Vec::new();
        let mut chunk = [0; 4096];
        while received.windows(26).filter(|window| window == b"Content-Type: image/jpeg\r\n").count() < 10 {
            let count = video.read(&mut chunk).unwrap();
            assert_ne!(count, 0, "{fault:?}: the stream ended");
            received.extend_from_slice(&chunk[..count]);
        }
    }
}

/// The answer to a stop, with its first body bytes.
fn answer_and_body(camera: &VirtualCamera, bytes: usize) -> String {
    let mut stream = connect(camera);
    let mut answer = ask(&mut stream).unwrap();
    let mut body = vec![0; bytes];
    stream.read_exact(&mut body).unwrap();
    answer.extend(body);
    String::from_utf8(answer).unwrap()
}

#[test]
fn a_black_hole_lets_no_connection_come_about() {
    let camera = VirtualCamera::start(settings()).unwrap();
    let mut kept = connect(&camera);
    assert!(ask(&mut kept).unwrap().starts_with(b"HTTP/1.1 204 "));
    camera.set_fault(Fault::BlackHole);
    let deadline = Instant::now() + PATIENCE;
    loop {
        let attempt = TcpStream::connect_timeout(&camera.http_address(), Duration::from_millis(100));
        match attempt.map_err(|error| error.kind()) {
            Err(ErrorKind::TimedOut) => break,
            _ => assert!(Instant::now() < deadline, "it still answers"),
        }
    }
    kept.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    let error = ask(&mut kept).unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut), "{error}");
    camera.set_fault(Fault::None);
    let mut stream = loop {
        match TcpStream::connect(camera.http_address()) {
            Ok(stream) => break stream,
            Err(_) => assert!(Instant::now() < deadline, "it never listens again"),
        }
    };
    assert!(ask(&mut stream).unwrap().starts_with(b"HTTP/1.1 204 "));
}

#[test]
fn a_redirect_names_its_goal() {
    let location = "https://elsewhere.example/".to_owned();
    let camera = camera_with(Fault::Redirect { status: 307, location });
    let answer = String::from_utf8(ask(&mut connect(&camera)).unwrap()).unwrap();
    assert!(answer.starts_with("HTTP/1.1 307 "), "{answer}");
    assert!(answer.contains("location: https://elsewhere.example/\r\n"), "{answer}");
}

#[test]
fn endless_answers_go_on() {
    for fault in [Fault::EndlessBody, Fault::Drip(Duration::from_millis(1))] {
        let bytes = if fault == Fault::EndlessBody { 1_000_000 } else { 10 };
        let answer = answer_and_body(&camera_with(fault), bytes);
        assert!(answer.starts_with("HTTP/1.1 200 ") && answer.len() > bytes, "{}", answer.len());
    }
}
