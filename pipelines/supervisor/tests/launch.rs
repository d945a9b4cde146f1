// SPDX-License-Identifier: MPL-2.0

//! `ptztrack-launch` as a user starts it.
#![allow(clippy::unwrap_used)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};

/// Requests that a camera does not answer before it does.
const UNANSWERED: usize = 3;

fn launch(location: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_ptztrack-launch"))
        .args(["souphttpsrc", "is-live=true", "retries=0", &format!("location={location}")])
        // A source that is told to end waits for a sink that does not play yet.
        .args(["!", "queue", "!", "fakesink"])
        .env_remove("http_proxy")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Each of its requests would be worth a line.
#[test]
fn a_camera_that_does_not_answer_is_told_of_once_and_so_is_its_picture() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let location = format!("http://{}/video", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let mut requests = 0;
        let mut kept = Vec::new();
        for mut client in listener.incoming().map_while(Result::ok) {
            // Whoever only looks whether somebody is there says nothing.
            requests += usize::from(client.read(&mut [0; 4096]).is_ok_and(|read| read > 0));
            if requests > UNANSWERED {
                client.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\npicture").unwrap();
                kept.push(client);
            }
        }
    });
    let mut launch = launch(&location);
    let mut said = BufReader::new(launch.stderr.take().unwrap()).lines().map(Result::unwrap);
    let told = said.next().unwrap();
    assert!(told.starts_with(&format!("ERROR: {location}: ")), "{told}");
    assert!(told.ends_with("; it is tried again until it is back"), "{told}");
    assert_eq!(said.next().unwrap(), "INFO: the picture is there");
    let ends = Command::new("kill").args(["-s", "TERM", &launch.id().to_string()]).status().unwrap();
    assert!(ends.success() && launch.wait().unwrap().success());
    assert_eq!(said.next(), None);
}

#[test]
fn what_is_no_address_ends_it_at_once() {
    let output = launch("127.0.0.1:1").wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("`127.0.0.1:1` names no host") && said.contains("Not restarted"), "{said}");
    assert_eq!(output.status.code(), Some(1));
}
