// SPDX-License-Identifier: MPL-2.0

//! What the program tells an MQTT broker, the one of Debian.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;

use end_to_end::{Broker, PATIENCE, Program, certificate, scene, signal};
use serde_json::{Value, json};
use virtual_camera::VirtualCamera;

/// Ours, before this camera and this broker.
fn program(broker: &Broker, test: &str, camera: &VirtualCamera) -> Program {
    let file = |folder: &Path| {
        let camera = Program::entry("door", &camera.url(), &folder.join("password"));
        format!("{camera}[mqtt]\nhost = \"127.0.0.1\"\nport = {}\n", broker.port)
    };
    let mut program = Program::start(test, file, &[]);
    program.launch.wait_for_line("connected to the MQTT broker 127.0.0.1");
    program
}

/// The payload in a line of [`Broker::listen`].
fn payload(line: &str) -> Value {
    serde_json::from_str(line.split_once(' ').unwrap().1).unwrap()
}

#[test]
fn events_states_and_discovery_reach_a_broker() {
    let broker = Broker::start();
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut events = broker.listen("ptztrack/camera/door/event");
    let program = program(&broker, "mqtt", &camera);
    let mut states = broker.listen("ptztrack/camera/door/state");
    let state = payload(&states.wait_for_line("\"following\":\"ON\""));
    assert_eq!(state["picture"], "ON", "{state}");
    assert!(state["words"].as_str().is_some_and(|words| words.contains("target")), "{state}");
    let event = payload(&events.wait_for_line("target-acquired"));
    assert_eq!((&event["camera"], &event["level"]), (&json!("door"), &json!("info")), "{event}");

    // Whoever comes later is told what there is, too.
    let config = broker.listen("homeassistant/#").wait_for_line("ptztrack_door/following/config");
    assert_eq!(payload(&config)["state_topic"], "ptztrack/camera/door/state");
    let mut availability = broker.listen("ptztrack/availability");
    availability.wait_for_line("ptztrack/availability online");
    let said = program.end("TERM");
    availability.wait_for_line("ptztrack/availability offline");
    assert!(!said.contains("no connection to the MQTT broker"), "{said}");
    assert!(!said.contains(scene::PASSWORD), "{said}");
}

/// The broker keeps none of them.
#[test]
fn the_picture_of_who_was_followed_reaches_a_broker_and_does_not_stay() {
    let broker = Broker::start();
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut events = broker.listen("ptztrack/camera/door/event");
    let mut pictures = broker.listen_to_sizes("ptztrack/camera/door/picture");
    let program = program(&broker, "mqtt-picture", &camera);
    scene::wait_until_following(&camera);
    let before = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 20), "not steered");
    assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
    let event = payload(&events.wait_for_line("event-kept"));
    assert_eq!(event["picture"], "events/1/picture", "{event}");
    let size = pictures.wait_for_line("door/picture ");
    assert!(size.rsplit(' ').next().unwrap().parse::<u64>().unwrap() > 1000, "{size}");
    let mut config = broker.listen("homeassistant/image/#");
    assert_eq!(payload(&config.wait_for_line("last/config"))["image_topic"], "ptztrack/camera/door/picture");
    program.end("TERM");
    // What is kept comes first.
    let mut kept = broker.listen("ptztrack/#");
    kept.wait_for_line("ptztrack/availability offline");
    assert!(!kept.seen().iter().any(|line| line.contains("/picture")), "{:?}", kept.seen());
}

#[test]
fn a_broker_hears_that_the_program_has_died() {
    let broker = Broker::start();
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let program = program(&broker, "mqtt-dies", &camera);
    let mut availability = broker.listen("ptztrack/availability");
    availability.wait_for_line("ptztrack/availability online");
    signal(program.launch.id(), "KILL");
    availability.wait_for_line("ptztrack/availability offline");
}

#[test]
fn a_camera_that_is_gone_from_the_file_is_gone_from_the_broker() {
    let broker = Broker::start();
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let mut program = program(&broker, "mqtt-removed", &camera);
    let mut states = broker.listen("ptztrack/camera/door/state");
    states.wait_for_line("\"picture\":\"ON\"");
    let file = program.folder().join("cameras.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("camera.door", "camera.hall")).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("hall: the picture is there");
    // Empty is how a broker is told to forget.
    states.wait_for_line("ptztrack/camera/door/state (null)");
    broker.listen("ptztrack/camera/hall/state").wait_for_line("\"picture\":\"ON\"");
    program.end("TERM");
}

/// One whose certificate is believed is told, and nobody else.
#[test]
fn a_broker_is_spoken_to_over_tls() {
    let [shown, key] = ["camera.pem", "camera.key.pem"].map(certificate);
    let broker = Broker::start_with(&format!("certfile {}\nkeyfile {}\n", shown.display(), key.display()));
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    for (authority, said) in [
        ("authority.pem", "connected to the MQTT broker 127.0.0.1"),
        ("self-signed.pem", "no connection to the MQTT broker 127.0.0.1"),
    ] {
        let file = |folder: &Path| {
            let door = Program::entry("door", &camera.url(), &folder.join("password"));
            let (port, authority) = (broker.port, certificate(authority));
            format!(
                "{door}[mqtt]\nhost = \"127.0.0.1\"\nport = {port}\ntls = true\nca-file = {authority:?}\n"
            )
        };
        let mut program = Program::start(&format!("mqtt-{authority}"), file, &[]);
        program.launch.wait_for_line(said);
        program.end("TERM");
    }
}
