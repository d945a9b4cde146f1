// SPDX-License-Identifier: MPL-2.0

//! How often a request is sent.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use servo::Motion;
use session::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};
use session::{Client as _, Command, Error, Request, Stop};
use vapix::Client;

const RIGHT: Command =
    Command::Move { motion: Motion::Velocity { pan: 0.4, tilt: 0.0, zoom: None }, free: false };
const CENTRE: Command = Command::Move {
    motion: Motion::Centre { x: 1, y: 2, width: 640, height: 480, magnify: None },
    free: false,
};

type Asked = Arc<Mutex<Vec<String>>>;

/// A camera that says yes, but closes the connection instead after the requests that are `silent`, by their number from 1;
/// and after so many requests in any case. What it was asked is in the list.
fn camera(requests: usize, silent: fn(usize) -> bool) -> (Client, Asked) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let asked = Asked::default();
    let list = asked.clone();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let (stream, list) = (stream.unwrap(), list.clone());
            std::thread::spawn(move || serve(stream, requests, silent, &list));
        }
    });
    (client(address), asked)
}

fn client(address: SocketAddr) -> Client {
    Client::new(settings(address)).unwrap()
}

fn settings(address: SocketAddr) -> ClientSettings {
    ClientSettings {
        location: Location::parse(&format!("http://{address}")).unwrap().0,
        channel: "1".to_owned(),
        credentials: None,
        authentication: Authentication::Auto,
        timeout: Duration::from_secs(60),
        trust: Trust::System,
    }
}

fn serve(mut stream: TcpStream, requests: usize, silent: fn(usize) -> bool, asked: &Mutex<Vec<String>>) {
    let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
    for _ in 0..requests {
        let Some(Ok(request)) = lines.next() else { return };
        while lines.next().is_some_and(|line| line.is_ok_and(|line| !line.is_empty())) {}
        let number = {
            let mut asked = asked.lock().unwrap();
            asked.push(request);
            asked.len()
        };
        if silent(number) {
            return;
        }
        stream.write_all(b"HTTP/1.1 204 No Content\r\n\r\n").unwrap();
    }
}

fn send(client: &mut Client, commands: &[Command]) -> Vec<Result<(), Error>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let mut answers = Vec::new();
        for command in commands {
            answers.push(client.exchange(&Request::Command(*command)).await.map(drop));
        }
        answers
    })
}

fn count(asked: &Mutex<Vec<String>>, word: &str) -> usize {
    asked.lock().unwrap().iter().filter(|request| request.contains(word)).count()
}

#[test]
fn what_may_be_repeated_is_sent_again_where_the_connection_breaks() {
    let (mut client, asked) = camera(10, |number| number == 2);
    assert_eq!(send(&mut client, &[RIGHT, RIGHT]), [Ok(()), Ok(())]);
    assert_eq!(count(&asked, "continuouspantiltmove"), 3);
}

/// It may have arrived, and would lead on from where it led.
#[test]
fn centring_is_never_sent_twice() {
    let zoomed = Command::Move {
        motion: Motion::Centre { x: 1, y: 2, width: 640, height: 480, magnify: Some(1.5) },
        free: false,
    };
    for (command, words) in [(CENTRE, "center="), (zoomed, "areazoom=")] {
        let (mut client, asked) = camera(10, |number| number == 2);
        let answers = send(&mut client, &[RIGHT, command]);
        assert!(matches!(answers.as_slice(), [Ok(()), Err(Error::Broken(_))]), "{answers:?}");
        assert_eq!(count(&asked, words), 1);
    }
}

/// As cameras close a connection that was idle for long.
#[test]
fn centring_does_not_meet_a_closed_connection() {
    let (mut client, asked) = camera(1, |_| false);
    assert_eq!(send(&mut client, &[CENTRE, RIGHT, CENTRE, CENTRE]), [Ok(()), Ok(()), Ok(()), Ok(())]);
    assert_eq!(count(&asked, "center"), 3);
}

/// A camera that answers once, takes the next move without a word and is not there any more.
fn camera_that_goes() -> Client {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let client = client(listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        // From now on nobody is listening.
        drop(listener);
        serve(stream, 2, |number| number > 1, &Mutex::default());
    });
    client
}

#[test]
fn a_move_that_may_have_reached_the_camera_is_not_forgotten_where_it_cannot_be_sent_again() {
    let sent = send(&mut camera_that_goes(), &[RIGHT, RIGHT]);
    assert!(sent[0].is_ok());
    assert!(sent[1].as_ref().is_err_and(Error::may_have_acted), "{sent:?}");
}

/// One that lets each answer wait, which is a challenge that makes the last one stale.
fn camera_that_challenges_on_and_on(pause: Duration) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let lines = BufReader::new(stream.try_clone().unwrap()).lines().map_while(Result::ok);
        for (number, _) in lines.filter(String::is_empty).enumerate() {
            std::thread::sleep(pause);
            let challenge = format!("Digest realm=\"camera\", nonce=\"{number}\", qop=\"auth\", stale=true");
            let answer = format!("HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: {challenge}\r\n");
            // The client may be gone.
            let _ = stream.write_all(format!("{answer}Content-Length: 0\r\n\r\n").as_bytes());
        }
    });
    address
}

/// Each answer comes in time, all of them together do not.
#[test]
fn all_attempts_together_take_no_longer_than_one_answer_may() {
    let pause = Duration::from_millis(300);
    let credentials = Credentials { user: "root".into(), password: Secret::new("pass") };
    let address = camera_that_challenges_on_and_on(pause);
    let mut client = Client::new(ClientSettings {
        credentials: Some(credentials),
        timeout: 2 * pause,
        ..settings(address)
    })
    .unwrap();
    assert_eq!(send(&mut client, &[RIGHT]), [Err(Error::Timeout(2 * pause))]);
}

/// A camera may forget what it was told by who hangs up before it has answered.
#[test]
fn a_stop_that_is_not_answered_is_not_hung_up_on() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let timeout = Duration::from_millis(300);
    let mut client =
        Client::new(ClientSettings { timeout, ..settings(listener.local_addr().unwrap()) }).unwrap();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let mut tell = |command| {
        let answer = runtime.block_on(client.exchange(&Request::Command(command)));
        assert_eq!(answer, Err(Error::Timeout(timeout)));
        listener.accept().unwrap().0
    };
    let mut stop = tell(Command::Stop(Stop::PanTilt));
    // Until it is hung up on, and so would be what was told before it.
    let _ = std::io::copy(&mut tell(RIGHT), &mut std::io::sink());
    stop.set_nonblocking(true).unwrap();
    let read = std::io::copy(&mut stop, &mut std::io::sink());
    assert_eq!(read.map_err(|err| err.kind()), Err(ErrorKind::WouldBlock));
}
