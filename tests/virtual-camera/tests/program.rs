// SPDX-License-Identifier: MPL-2.0

//! The program as a user starts it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    path::Path,
    process::{Child, Command, Stdio},
};

fn start(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_virtual-camera"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn says_where_it_serves_logs_and_ends_on_signals() {
    for signal in ["INT", "TERM"] {
        let log = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("program-{signal}.csv"));
        let mut camera = start(&[
            "--http-port",
            "0",
            "--rtsp-port",
            "0",
            "--auth",
            "none",
            "--size",
            "160x120",
            "--log",
            log.to_str().unwrap(),
        ]);
        let mut ready = String::new();
        BufReader::new(camera.stdout.take().unwrap()).read_line(&mut ready).unwrap();
        let words: Vec<&str> = ready.split_whitespace().collect();
        assert_eq!(words[0], "ready");
        let address = words[1].strip_prefix("http=http://").unwrap();
        assert!(words[2].starts_with("rtsp=rtsp://127.0.0.1:"), "{ready}");

        let mut connection = TcpStream::connect(address).unwrap();
        let request =
            "GET /axis-cgi/com/ptz.cgi?rpan=3 HTTP/1.1\r\nHost: camera\r\nConnection: close\r\n\r\n";
        connection.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        connection.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 204 "), "{answer}");

        let killed = Command::new("kill").args(["-s", signal, &camera.id().to_string()]).status().unwrap();
        assert!(killed.success());
        assert!(camera.wait().unwrap().success(), "{signal}");
        let csv = std::fs::read_to_string(log).unwrap();
        assert!(csv.starts_with("time,pan_deg,tilt_deg,zoom_step,"), "{csv}");
        assert!(csv.lines().any(|line| line.ends_with(",204,\"rpan=3\"")), "{csv}");
    }
}

#[test]
fn says_what_is_wrong() {
    let output = start(&["--footage", "/no/such/file.avi", "--http-port", "0", "--rtsp-port", "0"])
        .wait_with_output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.starts_with("virtual-camera: cannot read the footage /no/such/file.avi: "), "{text}");
}
