// SPDX-License-Identifier: MPL-2.0

//! Cameras are passed on by RTSP, with what is seen in them as ONVIF's metadata; nobody is followed the worse for it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use chrono::DateTime;
use end_to_end::{GstLaunch, PATIENCE, Program, Times, Viewer, certificate, scene, scratch};
use gst_rtsp_server::gio::TlsFileDatabase;
use gst_rtsp_server::prelude::*;
use serde_json::Value;
use virtual_camera::VirtualCamera;

/// Between two pictures of the camera.
const INTERVAL: Duration = Duration::from_nanos(1_000_000_000 / 15);

/// Who has set up no stream may stay for so long where there is room.
const LONGEST_VISIT: Duration = Duration::from_secs(30);

/// Ours has to send a stranger away before the server would do so by itself, after a minute.
const LONGEST_TUNNEL: Duration = Duration::from_secs(50);

/// A camera that is passed on, with more in its entry and in the server's.
#[track_caller]
fn start(test: &str, camera: &VirtualCamera, entry: &str, restream: &str) -> Program {
    let file = |folder: &Path| {
        let door = Program::entry("door", &camera.url(), &folder.join("password"));
        let rtsp = camera.rtsp_url();
        format!("{door}rtsp = \"{rtsp}\"\n{entry}\n[restream]\nlisten = \"127.0.0.1:0\"\n{restream}\n")
    };
    Program::start(test, file, &[])
}

/// Where it is, once there are pictures.
#[track_caller]
fn address(program: &mut Program) -> String {
    let line = program.launch.wait_for_line("passes the cameras on at ");
    program.wait_for("/metrics", |metrics| metrics.contains("ptztrack_picture_up{camera=\"door\"} 1"));
    line.rsplit(' ').next().unwrap().replace("NAME", "door")
}

/// Host and port of such an address.
fn server(url: &str) -> &str {
    url.trim_start_matches("rtsp://").trim_end_matches("/door")
}

/// The first line of the answer to such a request with more in its head, which is read to its end; empty where there is none.
#[track_caller]
fn answer_to(mut client: &TcpStream, request: &str, more: &str) -> String {
    client.set_read_timeout(Some(PATIENCE)).unwrap();
    client.write_all(format!("{request} RTSP/1.0\r\nCSeq: 1\r\n{more}\r\n").as_bytes()).unwrap();
    let (mut server, mut head) = (BufReader::new(client), String::new());
    while !head.ends_with("\r\n\r\n") && server.read_line(&mut head).unwrap() > 0 {}
    let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: "));
    let mut body = vec![0; length.map_or(0, |length| length.parse().unwrap())];
    server.read_exact(&mut body).unwrap();
    head.lines().next().unwrap_or_default().to_owned()
}

fn answer(client: &TcpStream, request: &str) -> String {
    answer_to(client, request, "")
}

/// Somebody who asks for nothing in particular, and for nothing more. Answered, so that they have a place before anybody else comes.
#[track_caller]
fn stranger(url: &str) -> TcpStream {
    let stranger = TcpStream::connect(server(url)).unwrap();
    assert_eq!(answer(&stranger, "OPTIONS *"), "RTSP/1.0 200 OK");
    stranger
}

/// That, and nothing else, is told to who was answered before.
#[track_caller]
fn is_sent_away(mut client: &TcpStream) -> bool {
    client.read(&mut [0]).unwrap() == 0
}

/// Whether it can be read, and what was said.
fn ffprobe(url: &str) -> (bool, String) {
    let mut command = Command::new("timeout");
    command.args(["60", "ffprobe", "-v", "error", "-rtsp_transport", "tcp", "-show_entries"]);
    let output =
        command.args(["stream=codec_type,codec_name,width", "-of", "csv=p=0", url]).output().unwrap();
    let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    (output.status.success(), said)
}

#[track_caller]
fn is_steered(camera: &VirtualCamera) {
    let before = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 20), "not steered");
}

#[test]
fn others_play_the_picture_and_list_the_metadata_in_whatever_form_it_comes() {
    for (codec, name, depayloader) in [
        ("h264", "h264", "rtph264depay ! avdec_h264"),
        ("h265", "hevc", "rtph265depay ! avdec_h265"),
        ("mpeg4", "mpeg4", "rtpmp4vdepay ! avdec_mpeg4"),
        ("mjpeg", "mjpeg", "rtpjpegdepay ! jpegdec"),
    ] {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let mut program = start(&format!("plays-{codec}"), &camera, &format!("codec = \"{codec}\""), "");
        let url = address(&mut program);
        let (read, said) = ffprobe(&url);
        let lists = |stream: &str| said.lines().any(|line| line.contains(stream));
        assert!(read && lists(&format!("{name},video,320")) && lists("data"), "{codec}: {said}");
        let player = GstLaunch::start(
            &["-q"],
            &format!(
                "rtspsrc location={url} protocols=tcp ! {depayloader} ! video/x-raw,width=320,height=240 \
                 ! fakesink num-buffers=30"
            ),
        );
        let (status, said) = player.finish();
        assert!(status.success() && !said.contains("ERROR"), "{codec}: {said}");
        program.end("TERM");
    }
}

/// Both streams have the same clock, and by the sender's reports the same calendar. A report is as exact as the machine is idle while
/// it is made, every few seconds, so that one is enough.
#[test]
fn a_document_tells_of_the_picture_of_its_time() {
    for isolation in ["none", "process"] {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let entry = format!("codec = \"h264\"\nisolation = \"{isolation}\"");
        let mut program = start(&format!("times-{isolation}"), &camera, &entry, "");
        let viewer = Viewer::start(&address(&mut program), |_| {});
        let mut picture =
            std::iter::repeat_with(|| viewer.picture()).find(|times| times.taken.is_some()).unwrap();
        let near = |taken: Option<Duration>, told: Duration| {
            taken.is_some_and(|taken| taken.abs_diff(told) < INTERVAL / 2)
        };
        let begin = Instant::now();
        // From a picture to the document of it, by RTP.
        let apart = loop {
            assert!(begin.elapsed() < PATIENCE, "{isolation}: no document is of a picture: {picture:?}");
            let (text, times) = viewer.document();
            let told = told(&text);
            while picture.taken.unwrap() + INTERVAL / 2 < told {
                picture = viewer.picture();
            }
            if near(times.taken, told) && near(picture.taken, told) {
                break times.rtp.wrapping_sub(picture.rtp);
            }
        };
        for _ in 0..60 {
            let (_, times) = viewer.document();
            let ahead =
                |picture: Times| times.rtp.wrapping_sub(apart).wrapping_sub(picture.rtp).cast_signed();
            while ahead(picture) > 1 {
                picture = viewer.picture();
            }
            let off = ahead(picture);
            assert!(off.abs() <= 1, "{isolation}: {times:?} is {off} ticks off the picture {picture:?}");
        }
        program.end("TERM");
    }
}

/// When the picture was taken that a document tells of, since 1970.
fn told(document: &str) -> Duration {
    let time = document.split("UtcTime=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
    let time = DateTime::parse_from_rfc3339(time).unwrap();
    Duration::from_micros(time.timestamp_micros().try_into().unwrap())
}

/// Whoever watches goes on watching while that of the camera changes which does not concern its stream.
#[test]
fn cameras_come_and_go_with_the_file() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("sighup", &camera, "codec = \"h264\"", "");
    let url = address(&mut program);
    let viewer = Viewer::start(&url, |_| {});
    viewer.document();
    let file = program.folder().join("cameras.toml");
    let text = fs::read_to_string(&file).unwrap();
    let yard = text.split("[restream]").next().unwrap().replace("[camera.door]", "[camera.yard]");
    let calmer = text.replace("codec =", "exclude-zones = [\"0,0 0.1,0 0.1,0.1\"]\ncodec =");
    fs::write(&file, format!("{calmer}{yard}")).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("the configuration was read again");
    program.wait_for("/metrics", |metrics| metrics.contains("ptztrack_picture_up{camera=\"yard\"} 1"));
    assert!(ffprobe(&url.replace("/door", "/yard")).0);
    let before = told(&viewer.document().0);
    let since = Duration::from_secs(1);
    assert!(std::iter::repeat_with(|| viewer.document().0).any(|text| told(&text) > before + since));
    fs::write(&file, text.replace("[camera.door]", "[camera.gate]")).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("the configuration was read again");
    program.wait_for("/metrics", |metrics| metrics.contains("ptztrack_picture_up{camera=\"gate\"} 1"));
    let (read, said) = ffprobe(&url);
    assert!(!read && said.contains("404"), "{said}");
    program.end("TERM");
}

/// By ONVIF's own schema.
#[test]
fn a_library_from_pypi_reads_who_is_where() {
    let clients = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients");
    let environment = Path::new(env!("CARGO_TARGET_TMPDIR")).join("onvif-metadata");
    let created = Command::new("python3").args(["-m", "venv"]).arg(&environment).status().unwrap();
    assert!(created.success(), "python3-venv is not installed: `make test` installs it");
    let python = environment.join("bin/python");
    install(&python, &clients.join("requirements.txt"));
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("schema", &camera, "codec = \"h264\"", "");
    let viewer = Viewer::start(&address(&mut program), |_| {});
    let shows_somebody = |text: &String| text.contains("ObjectId=\"1\"");
    let text = std::iter::repeat_with(|| viewer.document().0).find(shows_somebody).unwrap();
    let file = scratch("document.xml");
    fs::write(&file, &text).unwrap();
    let output = Command::new(python).arg(clients.join("read_metadata.py")).arg(&file).output().unwrap();
    assert!(output.status.success(), "{text}\n{output:?}");
    let read: Value = serde_json::from_slice(&output.stdout).unwrap();
    let seen = &read["tt:VideoAnalytics"][0]["tt:Frame"][0]["tt:Object"][0]["tt:Appearance"];
    let side = |name: &str| seen["tt:Shape"]["tt:BoundingBox"][name].as_f64().unwrap();
    assert!(side("@left") < side("@right") && side("@bottom") < side("@top"), "{read}");
    let class = &seen["tt:Class"]["tt:Type"][0];
    let likelihood = class["@Likelihood"].as_f64().unwrap();
    // People are not told from vehicles.
    assert!(class["$"] == "Object" && (0.0..=1.0).contains(&likelihood), "{read}");
    fs::remove_file(file).unwrap();
    program.end("TERM");
}

/// What is there already is not fetched again.
#[track_caller]
fn install(python: &Path, requirements: &Path) {
    let output = Command::new("timeout")
        .arg("240")
        .arg(python)
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries", "6"])
        .args(["--timeout", "15", "--requirement"])
        .arg(requirements)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{} could not be installed from PyPI, without which this test tells nothing: {}\n{}",
        requirements.display(),
        output.status,
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn who_does_not_know_the_password_sees_nothing() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let password = scratch("restream-password");
    fs::write(&password, "sesame-17").unwrap();
    let restream = format!("user = \"guard\"\npassword-file = {password:?}");
    let mut program = start("refuses", &camera, "codec = \"h264\"", &restream);
    let url = address(&mut program);
    let as_guard = |password: &str| ffprobe(&url.replace("rtsp://", &format!("rtsp://guard:{password}@")));
    for (read, said) in [ffprobe(&url), as_guard("wrong")] {
        assert!(!read && said.contains("401"), "{said}");
    }
    let (read, said) = as_guard("sesame-17");
    assert!(read && said.contains("h264"), "{said}");
    fs::remove_file(password).unwrap();
    let said = program.end("TERM");
    assert!(!said.contains("sesame"), "{said}");
}

#[test]
fn who_believes_its_certificate_sees_and_nobody_else_does() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let [shown, key] = ["camera.pem", "camera.key.pem"].map(certificate);
    let restream = format!("certificate-file = {shown:?}\nkey-file = {key:?}");
    let mut program = start("tls", &camera, "codec = \"h264\"", &restream);
    let url = address(&mut program);
    assert!(url.starts_with("rtsps://127.0.0.1:"), "{url}");
    let believing = |authority: &str| {
        let database = TlsFileDatabase::new(certificate(authority)).unwrap();
        Viewer::start(&url, |source| source.set_property("tls-database", &database))
    };
    let (text, _) = believing("authority.pem").document();
    assert!(text.contains("tt:MetadataStream"), "{text}");
    assert!(believing("self-signed.pem").error().contains("Failed\\ to\\ connect"));
    let (read, said) = ffprobe(&url.replace("rtsps://", "rtsp://"));
    assert!(!read, "in clear: {said}");
    program.end("TERM");
}

/// Neither who watches has to go nor who comes last. Once they are gone there is room again.
#[test]
fn those_who_are_too_many_are_sent_away_and_nobody_is_followed_the_worse_for_it() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("crowd", &camera, "codec = \"h264\"", "");
    let url = address(&mut program);
    let viewer = Viewer::start(&url, |_| {});
    viewer.document();
    let crowd: Vec<TcpStream> = (0..200).map(|_| stranger(&url)).collect();
    assert!(is_sent_away(&crowd[0]));
    assert_eq!(answer(&crowd[199], "OPTIONS *"), "RTSP/1.0 200 OK");
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    assert!(std::iter::repeat_with(|| viewer.document().0).any(|text| told(&text) > since));
    is_steered(&camera);
    drop(crowd);
    let begin = Instant::now();
    while !ffprobe(&url).0 {
        assert!(begin.elapsed() < PATIENCE, "there is no room any more");
    }
    program.end("TERM");
}

/// They need not have gone by themselves.
#[test]
fn as_many_as_there_may_be_who_say_nothing_keep_nobody_out() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("silent", &camera, "codec = \"h264\"", "");
    let url = address(&mut program);
    let begin = Instant::now();
    // One or two more than there may be.
    let silent: Vec<TcpStream> = (0..130).map(|_| stranger(&url)).collect();
    let viewer = TcpStream::connect(server(&url)).unwrap();
    assert_eq!(answer(&viewer, &format!("DESCRIBE {url}")), "RTSP/1.0 200 OK");
    assert!(is_sent_away(&silent[0]));
    assert!(begin.elapsed() < LONGEST_VISIT / 2, "{:?}", begin.elapsed());
    program.end("TERM");
}

/// By UDP, anybody on the network could fill the memory with reports, and pictures would go in clear.
#[test]
fn pictures_go_by_the_connection_itself_and_no_other_way() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("udp", &camera, "codec = \"h264\"", "");
    let url = address(&mut program);
    let client = TcpStream::connect(server(&url)).unwrap();
    assert_eq!(
        answer_to(&client, &format!("DESCRIBE {url}"), "Accept: application/sdp\r\n"),
        "RTSP/1.0 200 OK"
    );
    for (transport, status) in [
        ("RTP/AVP;unicast;client_port=5000-5001", "461"),
        ("RTP/AVP;multicast", "461"),
        ("RTP/AVP/TCP;unicast;interleaved=0-1", "200"),
    ] {
        let setup = format!("SETUP {url}/stream=0");
        let answer = answer_to(&client, &setup, &format!("Transport: {transport}\r\n"));
        assert_eq!(answer.split(' ').nth(1), Some(status), "{transport}");
    }
    drop(client);
    program.end("TERM");
}

/// What is asked for before the log-in is short, and takes no place for long.
#[test]
fn a_stranger_fills_neither_the_memory_nor_the_places() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("stranger", &camera, "codec = \"h264\"", "");
    let url = address(&mut program);
    let visit = |request: &str| {
        let mut stranger = TcpStream::connect(server(&url)).unwrap();
        stranger.set_read_timeout(Some(PATIENCE)).unwrap();
        stranger.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stranger.read_to_string(&mut answer).expect("it is sent away");
        answer
    };
    let announced = "OPTIONS * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 4000000000\r\n\r\n";
    assert!(visit(announced).starts_with("RTSP/1.0 413 "));
    assert!(visit("OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\n").starts_with("RTSP/1.0 200 "));
    let (read, said) = ffprobe(&url);
    assert!(read, "{said}");
    program.end("TERM");
}

/// Nor does one who writes without end, whether that is ever a request or not; and who sends them away leaves no thread behind that
/// goes on reading.
#[test]
fn who_writes_without_end_is_sent_away_and_leaves_nothing_behind() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("endless", &camera, "codec = \"h264\"", "");
    let url = address(&mut program);
    assert!(ffprobe(&url).0);
    let threads = || fs::read_dir(format!("/proc/{}/task", program.launch.id())).unwrap().count();
    let before = threads();
    let line = "A".repeat(64 * 1024);
    let header = format!("Accept: {}\r\n", "a,".repeat(1500)).repeat(20);
    for (begin, piece) in [("", &line), ("", &line), ("OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n", &header)] {
        let mut stranger = TcpStream::connect(server(&url)).unwrap();
        let mut hears = stranger.try_clone().unwrap();
        let (begin, piece) = (begin.to_owned(), piece.clone());
        let writes = thread::spawn(move || {
            let _ = stranger.write_all(begin.as_bytes());
            while stranger.write_all(piece.as_bytes()).is_ok() {}
        });
        hears.set_read_timeout(Some(PATIENCE)).unwrap();
        let heard = hears.read(&mut [0; 64]).map_err(|err| err.kind());
        assert!(matches!(heard, Ok(0) | Err(ErrorKind::ConnectionReset)), "not sent away: {heard:?}");
        let _ = hears.shutdown(Shutdown::Both);
        writes.join().unwrap();
    }
    let begin = Instant::now();
    while threads() > before {
        assert!(begin.elapsed() < PATIENCE, "somebody still reads: {} threads, {before} before", threads());
    }
    let (read, said) = ffprobe(&url);
    assert!(read, "{said}");
    program.end("TERM");
}

/// Both requests of a tunnel through HTTP are heard; that which comes second goes on with the client of the first.
#[test]
fn a_tunnel_without_a_stream_has_its_place_no_longer_than_others_whichever_request_comes_first() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = start("tunnel", &camera, "codec = \"h264\"", "");
    let url = address(&mut program);
    let begin = Instant::now();
    let request = |method: &str, cookie: &str| {
        let mut stranger = TcpStream::connect(server(&url)).unwrap();
        stranger.set_read_timeout(Some(PATIENCE)).unwrap();
        let head = format!("{method} /door HTTP/1.0\r\nx-sessioncookie: {cookie}\r\n\r\n");
        stranger.write_all(head.as_bytes()).unwrap();
        // So that it is heard before the other.
        thread::sleep(Duration::from_millis(500));
        stranger
    };
    let tunnels = [["POST", "GET"], ["GET", "POST"]]
        .map(|methods| methods.map(|method| (method, request(method, methods[0]))));
    for (method, mut stranger) in tunnels.into_iter().flatten() {
        let mut answer = String::new();
        stranger.read_to_string(&mut answer).unwrap_or_else(|err| panic!("{method} is not sent away: {err}"));
        assert!(begin.elapsed() < LONGEST_TUNNEL, "{method} is sent away after {:?}", begin.elapsed());
    }
    let (read, said) = ffprobe(&url);
    assert!(read, "{said}");
    program.end("TERM");
}

/// It is tried again until the port is free.
#[test]
fn a_port_that_is_taken_is_said_once_and_nobody_is_followed_the_worse_for_it() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let file = |folder: &Path| {
        let door = Program::entry("door", &camera.url(), &folder.join("password"));
        format!("{door}[restream]\nlisten = \"{address}\"\n")
    };
    let mut program = Program::start("port-taken", file, &[]);
    program.launch.wait_for_line(&format!("nothing is passed on at {address}: "));
    is_steered(&camera);
    drop(taken);
    program.launch.wait_for_line(&format!("passes the cameras on at rtsp://{address}/NAME"));
    let said = program.end("TERM");
    assert_eq!(said.matches("nothing is passed on").count(), 1, "{said}");
}

#[test]
fn a_certificate_that_is_none_is_said_once_and_nobody_is_followed_the_worse_for_it() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let (shown, key) = (scratch("certificate.pem"), scratch("certificate.key.pem"));
    fs::write(&shown, "").unwrap();
    let restream = format!("certificate-file = {shown:?}\nkey-file = {key:?}");
    let mut program = start("no-certificate", &camera, "", &restream);
    let line = program.launch.wait_for_line("nothing is passed on at 127.0.0.1:0: no TLS by ");
    assert!(line.ends_with("it is tried again"), "{line}");
    is_steered(&camera);
    fs::copy(certificate("camera.key.pem"), &key).unwrap();
    fs::copy(certificate("camera.pem"), &shown).unwrap();
    program.launch.wait_for_line("passes the cameras on at rtsps://127.0.0.1:");
    [shown, key].iter().for_each(|file| fs::remove_file(file).unwrap());
    let said = program.end("TERM");
    assert_eq!(said.matches("nothing is passed on").count(), 1, "{said}");
}
