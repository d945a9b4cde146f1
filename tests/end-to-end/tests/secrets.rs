// SPDX-License-Identifier: MPL-2.0

//! The password stays where it was put: not in a log at any level, not in a graph of the pipeline.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;

use end_to_end::{Broker, PATIENCE, Program, Running, plugin_folder, scene, scratch, tool};
use gst::prelude::*;
use virtual_camera::VirtualCamera;

#[test]
fn not_in_a_log_of_everything() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let log = std::env::temp_dir().join(format!("ptztrack-secrets-{}.log", std::process::id()));
    let status = tool(env!("CARGO_BIN_EXE_application"))
        .args(["follow", &camera.url(), scene::USER])
        .env("CAMERA_PASSWORD", scene::PASSWORD)
        .env("GST_DEBUG", "*:9")
        .env("GST_DEBUG_FILE", &log)
        .env("GST_DEBUG_NO_COLOR", "1")
        .status()
        .unwrap();
    let text = fs::read(&log).unwrap();
    fs::remove_file(&log).unwrap();
    assert!(status.success());
    assert!(camera.status().requests > 0, "the camera must have been asked to prove anything");
    let text = String::from_utf8_lossy(&text);
    assert!(text.contains("vapixptzsink"), "the log must be of our elements to prove anything");
    assert_eq!(text.lines().find(|line| line.contains(scene::PASSWORD)), None);
}

#[test]
fn not_in_a_graph_of_the_pipeline() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let running = Running::start(&format!("videotestsrc is-live=true ! {}", scene::servo(&camera)));
    assert!(camera.wait_for(PATIENCE, |status| status.requests > 0));
    let graph = running.pipeline().debug_to_dot_data(gst::DebugGraphDetails::all());
    assert!(graph.contains(scene::USER), "the graph must show properties to prove anything");
    assert!(!graph.contains(scene::PASSWORD));
}

/// Who knows the passwords of the program's own services.
const GUARD: &str = "guard";
/// These services, and what is only said to each of them.
const SERVICES: [(&str, &str); 3] =
    [("http", "sesame-page-17"), ("mqtt", "sesame-broker-23"), ("restream", "sesame-stream-42")];

/// Base64 of both, as Basic authentication has them.
fn in_clear(user: &str, password: &str) -> String {
    glib::base64_encode(format!("{user}:{password}").as_bytes()).to_string()
}

/// What the page says to who knows its password.
fn ask_page_as_guard(page: &str) -> String {
    let page = page.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(page).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let log_in = in_clear(GUARD, SERVICES[0].1);
    write!(
        stream,
        "GET /cameras HTTP/1.1\r\nHost: {page}\r\nAuthorization: Basic {log_in}\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

/// The texts of all files there whose names are like this.
fn texts_in(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let files = fs::read_dir(folder).unwrap().map(|file| file.unwrap());
    let wanted = files.filter(|file| is_wanted(file.file_name().to_str().unwrap()));
    wanted.map(|file| String::from_utf8_lossy(&fs::read(file.path()).unwrap()).into_owned()).collect()
}

/// Neither those of cameras, whichever way their video comes and whichever process has them, nor those of the services: not in what
/// GStreamer tells of everything it does, not in what the program says, and not in a graph of any pipeline.
#[test]
fn not_in_logs_and_graphs_of_the_program() {
    let broker = Broker::start();
    let [door, gate] = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    let graphs = plugin_folder().join("examples/libgraphs.so");
    // Where there is no such library the linker only warns.
    assert!(graphs.is_file(), "{}", graphs.display());
    let traces = scratch("traces");
    fs::create_dir_all(&traces).unwrap();
    let file = |folder: &Path| {
        let service = |(name, password): (&str, &str)| {
            let file = folder.join(name);
            fs::write(&file, password).unwrap();
            format!("[{name}]\nuser = \"{GUARD}\"\npassword-file = {file:?}\n")
        };
        let [http, mqtt, restream] = SERVICES.map(service);
        let password = folder.join("password");
        let gate_rtsp = gate.rtsp_url();
        Program::entry("door", &door.url(), &password)
            + &Program::entry("gate", &gate.url(), &password)
            + &format!("codec = \"h264\"\nrtsp = {gate_rtsp:?}\nisolation = \"process\"\n")
            + &format!("{http}{mqtt}host = \"127.0.0.1\"\nport = {}\n", broker.port)
            + &format!("{restream}listen = \"127.0.0.1:0\"\n")
    };
    let log = traces.join("%p.log");
    let environment = [
        ("GST_DEBUG", Path::new("*:6")),
        ("GST_DEBUG_FILE", &log),
        ("GST_DEBUG_DUMP_DOT_DIR", &traces),
        ("LD_PRELOAD", &graphs),
    ];
    let mut program = Program::start_in("secrets", file, &[], &environment);
    for said in [
        "door: the picture is there",
        "gate: the picture is there",
        "connected to the MQTT broker",
        "passes the cameras on at ",
    ] {
        program.launch.rewind();
        program.launch.wait_for_line(said);
    }
    let page = ask_page_as_guard(&program.url());
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("\"gate\""), "{page}");
    let said = program.end("TERM");
    let logs = texts_in(&traces, |name| name.ends_with(".log"));
    let graphs = texts_in(&traces, |name| name.ends_with(".dot"));
    fs::remove_dir_all(&traces).unwrap();
    // A graph calls an element that has a name by its type.
    for (what, texts, rtsp) in [("a log", &logs, "rtspsrc"), ("a graph", &graphs, "GstRTSPSrc")] {
        for of in ["multipartdemux", rtsp, "vapixptzsink"] {
            assert!(texts.iter().any(|text| text.contains(of)), "{what} must be of {of} to prove anything");
        }
    }
    let camera = (scene::USER, scene::PASSWORD);
    let users = SERVICES.map(|(_, password)| (GUARD, password)).into_iter().chain([camera]);
    let mut secrets: Vec<_> =
        users.flat_map(|(user, password)| [password.to_owned(), in_clear(user, password)]).collect();
    secrets.push("Authorization: Digest".to_owned());
    let mut lines = logs.iter().chain(&graphs).chain([&said]).flat_map(|text| text.lines());
    let tells = |line: &&str| secrets.iter().any(|secret| line.contains(secret));
    assert_eq!(lines.find(tells), None);
}

/// What is left of a process that has crashed may be read by others.
#[test]
fn not_in_a_core_dump_of_the_program() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let program =
        Program::start("core", |folder| Program::entry("door", &camera.url(), &folder.join("password")), &[]);
    let limits = fs::read_to_string(format!("/proc/{}/limits", program.launch.id())).unwrap();
    let core = limits.lines().find_map(|line| line.strip_prefix("Max core file size")).unwrap();
    // Of 1 byte nothing is kept, and nothing is given to a program that keeps them (core(5)).
    let limits: Vec<_> = core.split_whitespace().take(2).collect();
    assert_eq!(limits, ["1", "1"]);
    program.end("TERM");
}
