// SPDX-License-Identifier: MPL-2.0

//! What a stranger on the network, a disk, or a visitor of the page can do to the program `ptztrack`: nothing that matters.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use end_to_end::following::Network;
use end_to_end::{PATIENCE, Program, Way, scene};
use virtual_camera::VirtualCamera;

/// Whoever answers in a camera's place, always the same; and what it has heard.
struct Stranger {
    address: std::net::SocketAddr,
    heard: Receiver<String>,
}

impl Stranger {
    fn answering(answer: String) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let address = listener.local_addr().unwrap();
        let (hears, heard) = channel();
        std::thread::spawn(move || {
            for mut client in listener.incoming().map_while(Result::ok) {
                let (answer, hears) = (answer.clone(), hears.clone());
                std::thread::spawn(move || {
                    let mut bytes = [0; 4096];
                    while let Ok(read @ 1..) = client.read(&mut bytes) {
                        let _ = hears.send(String::from_utf8_lossy(&bytes[..read]).into_owned());
                        if client.write_all(answer.as_bytes()).is_err() {
                            return;
                        }
                    }
                });
            }
        });
        Self { address, heard }
    }

    /// Everything, once it was asked for pictures so many times.
    #[track_caller]
    fn hears_requests_for_pictures(&self, times: usize) -> String {
        let (mut all, begin) = (String::new(), Instant::now());
        while all.matches("/axis-cgi/mjpg/").count() + all.matches("rtsp://").count() < times {
            assert!(begin.elapsed() < PATIENCE, "{all}");
            all += &self.heard.recv_timeout(PATIENCE).unwrap_or_default();
        }
        all
    }
}

/// Base64 of user and password, as Basic authentication has them.
fn in_clear() -> String {
    glib::base64_encode(format!("{}:{}", scene::USER, scene::PASSWORD).as_bytes()).to_string()
}

fn asks_for_basic(protocol: &str) -> String {
    format!(
        "{protocol} 401 Unauthorized\r\nCSeq: 1\r\nWWW-Authenticate: Basic realm=\"AXIS\"\r\nContent-Length: 0\r\n\r\n"
    )
}

#[test]
fn one_who_asks_for_the_password_in_clear_does_not_get_it_for_video_either() {
    for (codec, protocol) in [("mjpeg", "HTTP/1.1"), ("h264", "RTSP/1.0")] {
        let stranger = Stranger::answering(asks_for_basic(protocol));
        let file = |folder: &Path| {
            let address = stranger.address;
            Program::entry("door", &format!("http://{address}"), &folder.join("password"))
                + &format!("codec = \"{codec}\"\nrtsp = \"rtsp://{address}\"\n")
        };
        let mut program = Program::start(&format!("basic-{codec}"), file, &[]);
        program.launch.wait_for_line("Basic authentication, which shows the password");
        let heard = stranger.hears_requests_for_pictures(3);
        assert!(!heard.contains("Authorization") && !heard.contains(&in_clear()), "{heard}");
        program.end("TERM");
    }
}

#[test]
fn one_who_sends_elsewhere_is_not_followed() {
    for (codec, protocol, path) in [("mjpeg", "HTTP/1.1", "http"), ("h264", "RTSP/1.0", "rtsp")] {
        let elsewhere = Stranger::answering(asks_for_basic(protocol));
        let to = elsewhere.address;
        let stranger = Stranger::answering(format!(
            "{protocol} 302 Found\r\nCSeq: 1\r\nLocation: {path}://{to}/axis-cgi/mjpg/video.cgi\r\nContent-Length: 0\r\n\r\n"
        ));
        let file = |folder: &Path| {
            let address = stranger.address;
            Program::entry("door", &format!("http://{address}"), &folder.join("password"))
                + &format!("codec = \"{codec}\"\nrtsp = \"rtsp://{address}\"\n")
        };
        let mut program = Program::start(&format!("redirect-{codec}"), file, &[]);
        program.launch.wait_for_line("which is not its own HTTPS");
        stranger.hears_requests_for_pictures(3);
        program.end("TERM");
        assert_eq!(elsewhere.heard.try_iter().count(), 0, "somebody went there");
    }
}

/// A recording that cannot be written is said to be so once, and somebody is followed all the while.
#[test]
fn a_recording_that_fails_costs_nobody_their_camera() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let file = |folder: &Path| {
        // A file, where a folder is to be.
        fs::write(folder.join("full"), "").unwrap();
        let recording = folder.join("full").join("recordings");
        Program::entry("door", &network.url(), &folder.join("password"))
            + &format!("[camera.door.recording]\nfolder = {recording:?}\nkeep = \"1h\"\n")
    };
    let mut program = Program::start("unwritable", file, &[]);
    program.launch.wait_for_line("door: warning: nothing is recorded: ");
    scene::wait_until_following(&camera);
    let before = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 20), "not steered");
    assert_eq!(network.http.video_requests(), 2, "a pipeline is built anew");
    let said = program.end("TERM");
    assert_eq!(said.matches("nothing is recorded").count(), 1, "{said}");
    scene::assert_left_at_rest(&camera);
}

/// Whoever connects and says nothing.
#[test]
fn visitors_who_say_nothing_take_no_descriptors_from_cameras() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let file = |folder: &Path| Program::entry("door", &camera.url(), &folder.join("password"));
    let program = Program::start("visitors", file, &[]);
    scene::wait_until_following(&camera);
    let page = program.url().trim_start_matches("http://").trim_end_matches('/').to_owned();
    let descriptors = || fs::read_dir(format!("/proc/{}/fd", program.launch.id())).unwrap().count();
    let before = descriptors();
    let visitors: Vec<_> = (0..400).map_while(|_| TcpStream::connect(&page).ok()).collect();
    assert!(visitors.len() > 200, "{}", visitors.len());
    // They are sent away, and others have their turn.
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    assert!(descriptors() < before + 150, "{before}, then {}", descriptors());
    drop(visitors);
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// Whoever has been given a camera keeps it.
#[test]
fn a_camera_that_was_handed_over_stays_so_across_outages_a_changed_entry_and_a_restart() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let state = end_to_end::plugin_folder().join(format!("state-{}", std::process::id()));
    fs::create_dir_all(&state).unwrap();
    let environment = [("STATE_DIRECTORY", state.as_path())];
    let file = |folder: &Path| Program::entry("door", &network.url(), &folder.join("password"));
    let mut program = Program::start_in("handed-over", file, &[], &environment);
    scene::wait_until_following(&camera);
    assert_eq!(program.ask("POST", "/cameras/door/hand-over").0, 204);
    scene::assert_left_at_rest(&camera);
    let words = |program: &Program| program.wait_for("/cameras", |cameras| cameras.contains("handed over"));
    let moves = || camera.commands().iter().filter(|command| command.query.contains("move")).count();
    let before = moves();

    network.set(Way::Refused);
    program.launch.wait_for_line("tried again until it is back");
    network.set(Way::Open);
    program.launch.wait_for_line("door: the picture is there");
    words(&program);

    let cameras = program.folder().join("cameras.toml");
    let text = fs::read_to_string(&cameras).unwrap();
    fs::write(&cameras, text.replace("320x240", "352x288")).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("door: the picture is there");
    words(&program);
    // It was kept by the time somebody may crash.
    let begin = Instant::now();
    while !fs::read_to_string(state.join("control.json")).is_ok_and(|text| text.contains("handed-over")) {
        assert!(begin.elapsed() < PATIENCE, "not kept");
        std::thread::sleep(Duration::from_millis(50));
    }
    program.launch.signal("KILL");
    program.launch.finish();

    let mut program = Program::start_in("handed-over", file, &[], &environment);
    program.launch.wait_for_line("door: the picture is there");
    words(&program);
    assert_eq!(moves(), before, "it was moved: {:?}", camera.commands());
    assert_eq!(program.ask("POST", "/cameras/door/take-back").0, 204);
    scene::wait_until_following(&camera);
    program.end("TERM");
    fs::remove_dir_all(state).unwrap();
    scene::assert_left_at_rest(&camera);
}

/// The others are followed with, and it is as soon as there is a password.
#[test]
fn a_password_that_cannot_be_read_keeps_no_other_camera_down() {
    let [good, other] = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    let file = |folder: &Path| {
        Program::entry("good", &good.url(), &folder.join("password"))
            + &Program::entry("other", &other.url(), &folder.join("later"))
    };
    let mut program = Program::start("later", file, &[]);
    program.launch.wait_for_line("other: error: no password: ");
    scene::wait_until_following(&good);
    fs::write(program.folder().join("later"), scene::PASSWORD).unwrap();
    scene::wait_until_following(&other);
    program.end("TERM");
    [good, other].iter().for_each(scene::assert_left_at_rest);
}
