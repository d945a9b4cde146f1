// SPDX-License-Identifier: MPL-2.0

//! What a stranger on the network, a disk, or a visitor of the page can do to the program `ptztrack`: nothing that matters.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::VecDeque;
use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use end_to_end::following::Network;
use end_to_end::{Broker, PATIENCE, Program, Running, Way, ask_page, certificate, scene};
use virtual_camera::{Auth, Settings, Tls, VirtualCamera};

/// Whoever answers in a camera's place, always the same; and what it has heard.
struct Stranger {
    address: std::net::SocketAddr,
    heard: Receiver<String>,
}

impl Stranger {
    fn answering(answer: impl Into<Vec<u8>>) -> Self {
        let answer = answer.into();
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
                        if client.write_all(&answer).is_err() {
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
    // Nor do they keep a place for long.
    let mut silent = TcpStream::connect(&page).unwrap();
    silent.set_read_timeout(Some(PATIENCE)).unwrap();
    silent.read_to_end(&mut Vec::new()).expect("it is sent away");
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// Visitors at once, at the most; far more than the page lets in, ...
const VISITORS: usize = 400;
/// ... of whom the next comes after so long.
const NEXT_VISITOR: Duration = Duration::from_millis(10);
/// What the page may take, and then what a camera needs that comes back.
const FEW_DESCRIPTORS: usize = 128 + 32;

/// Visitors who say nothing, and others for those who are sent away, until this is dropped.
fn visit(page: String) -> Sender<()> {
    let (stay, over) = channel::<()>();
    std::thread::spawn(move || {
        let mut visitors = VecDeque::new();
        while over.recv_timeout(NEXT_VISITOR) == Err(RecvTimeoutError::Timeout) {
            // Where there is no room, or no page any more, another tries.
            visitors.extend(TcpStream::connect(&page));
            if visitors.len() > VISITORS {
                visitors.pop_front();
            }
        }
    });
    stay
}

#[test]
fn visitors_who_say_nothing_leave_a_camera_what_it_needs_to_come_back_and_to_be_stopped() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let file = |folder: &Path| Program::entry("door", &network.url(), &folder.join("password"));
    let program = Program::start("few-descriptors", file, &[]);
    scene::wait_until_following(&camera);
    let process = program.launch.id();
    let descriptors = || fs::read_dir(format!("/proc/{process}/fd")).unwrap().count();
    let before = descriptors();
    let most = format!("--nofile={}", before + FEW_DESCRIPTORS);
    let limited = Command::new("prlimit").args(["--pid", &process.to_string(), &most]).status();
    assert!(limited.is_ok_and(|limited| limited.success()));
    let page = program.url().trim_start_matches("http://").trim_end_matches('/').to_owned();
    let visitors = visit(page);
    let begin = Instant::now();
    // Or there would be enough for everybody.
    while descriptors() < before + 120 {
        assert!(begin.elapsed() < PATIENCE, "the page is not full");
        std::thread::sleep(Duration::from_millis(20));
    }

    let requests = network.http.video_requests();
    network.reset();
    network.http.wait_for_picture(requests);
    let commands = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > commands + 20), "not steered");
    // Its connection is lost, too.
    network.reset();
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
    drop(visitors);
}

/// Whoever has been given a camera keeps it.
#[test]
fn a_camera_that_was_handed_over_stays_so_across_outages_a_changed_entry_and_a_restart() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let state = end_to_end::scratch("state");
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

/// For so long a camera is left to who has moved it.
const GIVEN_WAY: Duration = Duration::from_secs(20);
/// How often the stick that an operator holds says where to.
const HELD: Duration = Duration::from_millis(50);

/// An operator turns it to and fro until we give way, and has it look home again.
#[track_caller]
fn take_over(camera: &VirtualCamera, program: &mut Program) {
    let held = |to| [to; 20];
    let mut turns = [held("continuouspantiltmove=-40,0"), held("continuouspantiltmove=40,0")]
        .concat()
        .into_iter()
        .cycle();
    let (begin, before) = (Instant::now(), program.launch.seen().len());
    while !program.launch.seen()[before..].iter().any(|line| line.contains("door: camera taken-over")) {
        assert!(begin.elapsed() < PATIENCE, "not noticed: {:?}", program.launch.seen());
        assert!(turns.next().is_some_and(|turn| camera.operate(turn)));
        program.launch.read_for(HELD);
    }
    assert!(camera.operate("continuouspantiltmove=0,0") && camera.operate("move=home"));
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "it goes on");
}

/// Nobody moves it for so long from then on, and somebody does later.
#[track_caller]
fn is_left_alone(camera: &VirtualCamera, (since, commands): (Duration, u64)) {
    let first = scene::wait_for_move(camera, commands);
    assert!(first.time >= since + GIVEN_WAY, "taken back too soon after {since:?}: {first:?}");
}

/// Whoever moves a camera himself has it for as long as he would have had without all that.
#[test]
fn a_camera_that_an_operator_has_taken_is_left_to_him_across_outages_a_changed_entry_and_a_crash() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let state = end_to_end::scratch("operators-state");
    fs::create_dir_all(&state).unwrap();
    let environment = [("STATE_DIRECTORY", state.as_path())];
    let file = |folder: &Path| {
        let seconds = GIVEN_WAY.as_secs();
        Program::entry("door", &network.url(), &folder.join("password"))
            + &format!("[camera.door.vapixptzsink]\noverride-timeout = \"{seconds}s\"\n")
    };
    let mut program = Program::start_in("operator", file, &[], &environment);
    // Before it is lost to us: nobody can take it back sooner.
    let now = || (camera.now(), camera.status().commands);
    scene::wait_until_following(&camera);

    take_over(&camera, &mut program);
    let since = now();
    network.set(Way::Refused);
    program.launch.wait_for_line("tried again until it is back");
    network.set(Way::Open);
    program.launch.wait_for_line("door: the picture is there");
    is_left_alone(&camera, since);

    take_over(&camera, &mut program);
    let since = now();
    let cameras = program.folder().join("cameras.toml");
    let text = fs::read_to_string(&cameras).unwrap();
    fs::write(&cameras, text.replace("320x240", "352x288")).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("door: the picture is there");
    is_left_alone(&camera, since);

    take_over(&camera, &mut program);
    let begin = Instant::now();
    while !fs::read_to_string(state.join("control.json")).is_ok_and(|text| text.contains("operator")) {
        assert!(begin.elapsed() < PATIENCE, "not kept");
        std::thread::sleep(Duration::from_millis(50));
    }
    let since = now();
    program.launch.signal("KILL");
    program.launch.finish();
    let program = Program::start_in("operator", file, &[], &environment);
    is_left_alone(&camera, since);
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

/// Page, broker and RTSP server wait for theirs, and let nobody in without it; the camera is followed with all the while.
#[test]
fn a_password_of_a_service_that_cannot_be_read_keeps_no_camera_down() {
    let broker = Broker::start();
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let file = |folder: &Path| {
        let who = format!("user = \"guard\"\npassword-file = {:?}\n", folder.join("later"));
        Program::entry("door", &camera.url(), &folder.join("password"))
            + &format!("[http]\n{who}[restream]\nlisten = \"127.0.0.1:0\"\n{who}")
            + &format!("[mqtt]\nhost = \"127.0.0.1\"\nport = {}\n{who}", broker.port)
    };
    let mut program = Program::start("services-later", file, &[]);
    let later = program.folder().join("later");
    for service in ["http", "mqtt", "restream"] {
        program.launch.rewind();
        let missing =
            format!("warning: [{service}] is not started: no password: {}: No such", later.display());
        program.launch.wait_for_line(&missing);
    }
    scene::wait_until_following(&camera);
    assert_eq!(program.ask("GET", "/healthz").0, 200);
    assert_eq!(program.ask("GET", "/cameras").0, 503);
    // Nor does reading it again start any, or say the same once more.
    program.launch.signal("HUP");
    program.launch.wait_for_line("the configuration was read again");
    let before = camera.status().commands;

    fs::write(&later, scene::PASSWORD).unwrap();
    let line = program.launch.wait_for_line("page, /metrics and /healthz at http://");
    let page = line.split("http://").nth(1).unwrap().trim_end_matches('/');
    assert_eq!(ask_page(page, page, "GET", "/cameras").0, 401);
    for started in ["connected to the MQTT broker", "passes the cameras on at rtsp://"] {
        program.launch.rewind();
        program.launch.wait_for_line(started);
    }
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 20), "not steered");

    // One that runs keeps what it has.
    fs::remove_file(&later).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("warning: [http] goes on with what it has: no password: ");
    assert_eq!(ask_page(page, page, "GET", "/cameras").0, 401);
    let said = program.end("TERM");
    assert_eq!(said.matches("is not started").count(), 3, "{said}");
    assert_eq!(said.matches("door: the picture is there").count(), 1, "{said}");
    assert!(!said.contains("restart-needed") && !said.contains("need a restart to take effect"), "{said}");
    scene::assert_left_at_rest(&camera);
}

/// Whoever answers in a camera's place claims a picture of gigabytes, progressive: a decoder takes the memory for it at once.
#[test]
fn a_picture_that_claims_to_be_huge_takes_nothing_from_anybody() {
    let mut jpeg = vec![0xff, 0xd8, 0xff, 0xc2, 0, 17, 8, 0x75, 0x30, 0x75, 0x30];
    jpeg.extend([3, 1, 0x22, 0, 2, 0x11, 0, 3, 0x11, 0, 0xff, 0xda, 0, 12, 3, 1, 0, 2, 0, 3, 0, 0, 0, 0]);
    jpeg.resize(4096, 0);
    let head = "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n";
    let part = "--b\r\nContent-Type: image/jpeg\r\n\r\n";
    let answer =
        [head.as_bytes(), part.as_bytes(), &jpeg, b"\r\n", part.as_bytes(), &jpeg, b"\r\n--b\r\n"].concat();
    let stranger = Stranger::answering(answer);
    let address = stranger.address;
    let file = |folder: &Path| Program::entry("door", &format!("http://{address}"), &folder.join("password"));
    let mut program = Program::start("huge", file, &[]);
    program.launch.wait_for_line("door: error: a picture of 30000x30000 is announced");
    let peak = peak(&program);
    assert!(peak < 500_000, "{peak} kB");
    program.end("TERM");
}

/// The most memory that it has taken yet, in kB.
#[track_caller]
fn peak(program: &Program) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", program.launch.id())).unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    peak.trim_end_matches("kB").trim().parse().unwrap()
}

/// A picture, as a camera sends it.
#[track_caller]
fn jpeg() -> Vec<u8> {
    use gst::prelude::*;
    let running = Running::start(
        "videotestsrc num-buffers=1 ! video/x-raw,width=320,height=240 ! jpegenc ! appsink name=out sync=false",
    );
    let sink = running.element("out").downcast::<gst_app::AppSink>().unwrap();
    let sample = sink.try_pull_sample(gst::ClockTime::try_from(PATIENCE).unwrap()).unwrap();
    sample.buffer().unwrap().map_readable().unwrap().to_vec()
}

/// Parts that are no pictures, before each picture; ...
const OTHER_PARTS: usize = 1000;
/// ... which comes so long after the one before.
const NEXT_PICTURE: Duration = Duration::from_millis(40);

/// Sends pictures to who asks for them, and between them parts of media types that there never were; tells of each picture.
fn send_other_types(mut client: TcpStream, jpeg: &[u8], tells: &Sender<()>) -> std::io::Result<()> {
    let mut asked = [0; 4096];
    let read = client.read(&mut asked)?;
    if !String::from_utf8_lossy(&asked[..read]).contains("/mjpg/") {
        return client.write_all(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
    }
    client.write_all(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n")?;
    let head = format!("--b\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len());
    for first in (0usize..).step_by(OTHER_PARTS) {
        let other =
            |number: usize| format!("--b\r\nContent-Type: text/x-{number}\r\nContent-Length: 1\r\n\r\nx\r\n");
        let others: String = (first..first + OTHER_PARTS).map(other).collect();
        client.write_all(&[others.as_bytes(), head.as_bytes(), jpeg, b"\r\n"].concat())?;
        let _ = tells.send(());
        std::thread::sleep(NEXT_PICTURE);
    }
    Ok(())
}

/// GStreamer makes an output for each media type that comes, and keeps it.
#[test]
fn parts_of_ever_other_media_types_take_nothing_and_the_pictures_between_them_are_seen() {
    let jpeg = jpeg();
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let (tells, told) = channel();
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            let (jpeg, tells) = (jpeg.clone(), tells.clone());
            std::thread::spawn(move || send_other_types(client, &jpeg, &tells));
        }
    });
    let file = |folder: &Path| Program::entry("door", &format!("http://{address}"), &folder.join("password"));
    let program = Program::start("media-types", file, &[]);
    let is_up = |metrics: &str| metrics.contains("ptztrack_picture_up{camera=\"door\"} 1");
    program.wait_for("/metrics", is_up);
    let before = peak(&program);
    // What was sent until then does not count.
    told.try_iter().for_each(drop);
    for _ in 0..100 {
        told.recv_timeout(PATIENCE).expect("nothing is taken any more");
    }
    program.wait_for("/metrics", is_up);
    let taken = peak(&program).saturating_sub(before);
    assert!(taken < 60_000, "{taken} kB");
    let said = program.end("TERM");
    assert_eq!(said.matches("door: the picture is there").count(), 1, "{said}");
}

/// A decoder that crashes, as far as the system can tell.
#[test]
fn a_camera_with_a_process_of_its_own_dies_alone_and_comes_back() {
    let [good, door] = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    let network = Network::before(&good);
    let file = |folder: &Path| {
        let password = folder.join("password");
        Program::entry("good", &network.url(), &password)
            + &Program::entry("door", &door.url(), &password)
            + "isolation = \"process\"\n"
    };
    let mut program = Program::start("isolated", file, &[]);
    [&good, &door].into_iter().for_each(scene::wait_until_following);
    let process = program.process_of("door");
    let requests = network.http.video_requests();
    end_to_end::signal(process, "ABRT");
    let line = program.launch.wait_for_line("door: error: its process ended: signal: 6");
    assert!(line.contains("it is started again"), "{line}");
    program.launch.wait_for_line("door: the picture is there");
    assert_ne!(program.process_of("door"), process);
    scene::wait_until_following(&door);
    assert_eq!(network.http.video_requests(), requests, "the other one is touched");

    // It is shown and steered as any other.
    program.wait_for("/metrics", |metrics| metrics.contains("ptztrack_picture_up{camera=\"door\"} 1.0"));
    program.wait_for("/metrics", |metrics| {
        metrics.contains("ptztrack_camera_state{camera=\"door\",state=\"moving\"} 1.0")
    });
    assert_eq!(program.ask("GET", "/cameras/door/picture").0, 200);
    assert_eq!(program.ask("POST", "/cameras/door/hand-over").0, 204);
    scene::assert_left_at_rest(&door);
    let last = program.process_of("door");
    end_to_end::signal(last, "KILL");
    program.launch.wait_for_line("door: the picture is there");
    program.wait_for("/cameras", |cameras| cameras.contains("the camera is handed over"));
    assert_eq!(program.ask("POST", "/cameras/door/take-back").0, 204);
    scene::wait_until_following(&door);
    let last = program.process_of("door");
    let said = program.end("TERM");
    assert!(!Path::new(&format!("/proc/{last}")).exists(), "{said}");
    assert!(said.contains("door: has stopped"), "{said}");
    [good, door].iter().for_each(scene::assert_left_at_rest);
}

/// What the camera shows.
fn tls() -> Tls {
    Tls { certificate: certificate("camera.pem"), key: certificate("camera.key.pem") }
}

/// The password goes in clear over TLS, to whom we believe; who shows another certificate gets nothing.
#[test]
fn pictures_and_commands_go_over_verified_tls() {
    for (codec, auth) in [("mjpeg", Auth::Basic), ("h264", Auth::Digest { qop: true })] {
        let settings = Settings { tls: Some(tls()), auth, ..scene::walking_person() };
        let camera = VirtualCamera::start(settings).unwrap();
        let [https, rtsps] = camera.tls_urls().unwrap();
        let file = |authority: &str| {
            let more =
                format!("codec = {codec:?}\nrtsp = {rtsps:?}\nca-file = {:?}\n", certificate(authority));
            let https = https.clone();
            move |folder: &Path| Program::entry("door", &https, &folder.join("password")) + &more
        };
        let mut program = Program::start(&format!("distrusts-{codec}"), file("self-signed.pem"), &[]);
        program.launch.wait_for_line("door: error: ");
        program.end("TERM");
        assert_eq!(camera.status().requests, 0);

        let program = Program::start(&format!("tls-{codec}"), file("authority.pem"), &[]);
        scene::wait_until_following(&camera);
        program.end("TERM");
        scene::assert_left_at_rest(&camera);
    }
}

/// Whoever shows any certificate is believed, and may be anybody: they get the password in clear where that is allowed only.
#[test]
fn one_who_is_believed_unverified_does_not_get_the_password_in_clear() {
    for codec in ["mjpeg", "h264"] {
        let settings = Settings { tls: Some(tls()), auth: Auth::Basic, ..scene::walking_person() };
        let stranger = VirtualCamera::start(settings).unwrap();
        let [https, rtsps] = stranger.tls_urls().unwrap();
        let file = |auth: &'static str| {
            let more = format!("codec = {codec:?}\nrtsp = {rtsps:?}\ninsecure = true\n{auth}");
            let https = https.clone();
            move |folder: &Path| Program::entry("door", &https, &folder.join("password")) + &more
        };
        let mut program = Program::start(&format!("unverified-{codec}"), file(""), &[]);
        program.launch.wait_for_line("Basic authentication, which shows the password");
        let said = program.end("TERM");
        assert!(!said.contains("door: the picture is there"), "{said}");
        assert_eq!(stranger.status().commands, 0);

        let program = Program::start(&format!("allowed-{codec}"), file("auth = \"basic\"\n"), &[]);
        scene::wait_until_following(&stranger);
        program.end("TERM");
        scene::assert_left_at_rest(&stranger);
    }
}
