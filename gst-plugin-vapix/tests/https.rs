// SPDX-License-Identifier: MPL-2.0

//! HTTPS, and the redirect to it: what the virtual camera does not speak, a scripted one answers.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod certificates;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use certificates::{certificate, server_config};
use rustls::{ServerConnection, StreamOwned};
use session::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};
use session::{Client as _, Command, Error, Request, Stop};
use vapix::Client;

/// Answers every request on a connection with the same bytes; the request lines and credentials go to `seen`.
fn serve(stream: impl Read + Write, answer: &str, seen: &std::sync::mpsc::Sender<String>) {
    let mut stream = BufReader::new(stream);
    loop {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            if !matches!(stream.read_line(&mut head), Ok(1..)) {
                return;
            }
        }
        if seen.send(head).is_err() || stream.get_mut().write_all(answer.as_bytes()).is_err() {
            return;
        }
        let _ = stream.get_mut().flush();
    }
}

/// A camera on a free port: with TLS, or without.
fn scripted(tls: bool, answer: String) -> (SocketAddr, Receiver<String>) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let (sender, seen) = channel();
    let config = tls.then(|| server_config("camera"));
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            match &config {
                Some(config) => {
                    let connection = ServerConnection::new(config.clone()).unwrap();
                    serve(StreamOwned::new(connection, stream), &answer, &sender);
                }
                None => serve(stream, &answer, &sender),
            }
        }
    });
    (address, seen)
}

fn client(location: &str, trust: Trust) -> Client {
    try_client(location, trust).unwrap()
}

fn try_client(location: &str, trust: Trust) -> Result<Client, Error> {
    let (location, _) = Location::parse(location).unwrap();
    let credentials = Credentials { user: "root".to_owned(), password: Secret::new("pass") };
    let timeout = Duration::from_secs(10);
    Client::new(ClientSettings {
        location,
        channel: "1".to_owned(),
        credentials: Some(credentials),
        authentication: Authentication::Auto,
        timeout,
        trust,
    })
}

fn halt(client: &mut Client) -> Result<(), Error> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(client.exchange(&Request::Command(Command::Stop(Stop::PanTilt)))).map(drop)
}

const ACCEPTED: &str = "HTTP/1.1 204 No Content\r\n\r\n";

/// With any certificate it may be anybody.
#[test]
fn the_password_is_sent_in_clear_to_whose_certificate_is_verified_only() {
    let basic =
        "HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: Basic realm=\"AXIS\"\r\nContent-Length: 0\r\n\r\n";
    for (trust, is_sent) in [(Trust::Authority(certificate("authority.pem")), true), (Trust::Anyone, false)] {
        let (address, seen) = scripted(true, basic.to_owned());
        let refused = halt(&mut client(&format!("https://{address}"), trust)).unwrap_err();
        assert_eq!(refused == Error::BasicRefused, !is_sent, "{refused}");
        assert_eq!(seen.try_iter().any(|head| head.contains("authorization: Basic")), is_sent);
    }
}

#[test]
fn a_certificate_is_believed_where_its_authority_is() {
    for trust in [Trust::Authority(certificate("authority.pem")), Trust::Anyone] {
        let (address, seen) = scripted(true, ACCEPTED.to_owned());
        assert_eq!(halt(&mut client(&format!("https://{address}"), trust)), Ok(()));
        assert!(
            seen.recv().unwrap().starts_with("GET /axis-cgi/com/ptz.cgi?camera=1&continuouspantiltmove=0,0 ")
        );
    }
}

#[test]
fn an_unknown_certificate_is_not_believed() {
    let (address, seen) = scripted(true, ACCEPTED.to_owned());
    let client = try_client(&format!("https://{address}"), Trust::System);
    // A machine without certificates of its own does not get as far as to connect.
    let err = client.and_then(|mut client| halt(&mut client)).unwrap_err();
    assert!(matches!(err, Error::Unreachable(_) | Error::Tls(_)), "{err:?}");
    assert!(seen.try_recv().is_err());
}

#[test]
fn the_cameras_own_https_is_followed() {
    let (secure, secure_seen) = scripted(true, ACCEPTED.to_owned());
    let redirect = format!(
        "HTTP/1.1 301 Moved Permanently\r\nLocation: https://{secure}/axis-cgi/com/ptz.cgi\r\nContent-Length: 0\r\n\r\n"
    );
    let (plain, plain_seen) = scripted(false, redirect);
    let mut client = client(&format!("http://{plain}"), Trust::Authority(certificate("authority.pem")));
    assert_eq!(halt(&mut client), Ok(()));
    assert_eq!(halt(&mut client), Ok(()));
    assert_eq!(plain_seen.try_iter().count(), 1, "HTTPS is remembered");
    assert!(secure_seen.recv().unwrap().contains("continuouspantiltmove=0,0"));
}

#[test]
fn a_redirect_elsewhere_gets_nothing() {
    let redirect =
        "HTTP/1.1 302 Found\r\nLocation: https://elsewhere.example/login?x=1\r\nContent-Length: 0\r\n\r\n";
    let (address, seen) = scripted(false, redirect.to_owned());
    let err = halt(&mut client(&format!("http://{address}"), Trust::System)).unwrap_err();
    assert_eq!(err, Error::Redirected("https://elsewhere.example/login".to_owned()));
    assert!(!seen.recv().unwrap().to_ascii_lowercase().contains("authorization"));
}

#[test]
fn an_endless_answer_is_cut_off() {
    let endless = format!("HTTP/1.1 200 OK\r\nContent-Length: 100000000\r\n\r\n{}", "x".repeat(200_000));
    let (address, _seen) = scripted(false, endless);
    let err = halt(&mut client(&format!("http://{address}"), Trust::System)).unwrap_err();
    assert!(matches!(err, Error::TooLong(_)), "{err:?}");
}
