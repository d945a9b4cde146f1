// SPDX-License-Identifier: MPL-2.0

//! Follows over networks that lose, delay and hold back what they carry, and prints a table in Markdown of how long who is followed is out
//! of view, how fast the camera turned, and what the user is told:
//!
//! ```sh
//! cargo build --workspace --lib --bins && cargo run --example lossy [NETWORK]
//! ```
//! Packets are lost where UDP hands them over; what goes by TCP is late in a proxy, video and control alike.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::sync::Mutex;
use std::thread;
use std::time::Duration;

use end_to_end::{Chance, Front, InView, Running, Way, scene};
use gst::prelude::*;
use virtual_camera::VirtualCamera;

/// Somebody is followed for so long over each network.
const WATCHED: Duration = Duration::from_secs(60);
/// It gets worse after so long.
const BEFORE: Duration = Duration::from_secs(5);
/// Of so many packets.
const PACKETS: u64 = 1000;

fn main() {
    println!(
        "| network | in view | out of view for at most | turns at most | what the user is told |\n|---|---|---|---|---|"
    );
    let only = std::env::args().nth(1).unwrap_or_default();
    let is_wanted = |network: &str| network.contains(&only);
    for lost in [0, 1, 10, 50] {
        let share = lost as f64 / PACKETS as f64 * 100.0;
        let network = format!("{share} % of packets lost, UDP");
        if is_wanted(&network) {
            by_udp(&network, lost);
        }
    }
    let ms = Duration::from_millis;
    let late = [
        ("200 ms of jitter", Way::Late(ms(0), ms(200)), WATCHED),
        ("2 s of bufferbloat for 10 s, then none", Way::Late(ms(2000), ms(0)), Duration::from_secs(10)),
    ];
    for (network, way, lasts) in late.into_iter().filter(|(network, ..)| is_wanted(network)) {
        by_tcp(network, way, lasts);
    }
}

/// H.264 by RTSP over UDP, of which so many packets in a thousand are lost.
fn by_udp(network: &str, lost: u64) {
    let camera = VirtualCamera::start(scene::far_person()).unwrap();
    let source = scene::rtsp(&camera, "h264").replace("latency=0", "latency=0 protocols=udp");
    let follow = format!("{source} ! bgavgdetect ! lkfeaturetrack ! {}", scene::servo(&camera));
    let mut running = Running::parse(&follow);
    running.pipeline().connect_deep_element_added(move |_, _, element| {
        if element.factory().is_some_and(|factory| factory.name() == "udpsrc") {
            lose(element, lost);
        }
    });
    running.pipeline().set_state(gst::State::Playing).unwrap();
    scene::wait_until_following(&camera);
    print(network, &camera, &mut running, WATCHED);
}

/// Loses packets by chance.
fn lose(socket: &gst::Element, lost: u64) {
    let chance = Mutex::new(Chance::new(1));
    let pad = socket.static_pad("src").unwrap();
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
        let drawn = chance.lock().unwrap().within((0, PACKETS));
        if drawn < lost { gst::PadProbeReturn::Drop } else { gst::PadProbeReturn::Ok }
    });
}

/// MJPEG and control by HTTP, over a network that is like this for so long and free again.
fn by_tcp(what: &str, way: Way, lasts: Duration) {
    let camera = VirtualCamera::start(scene::far_person()).unwrap();
    let front = Front::new(camera.http_address());
    let follow =
        scene::follow(&camera).replace(&camera.http_address().to_string(), &front.address().to_string());
    let mut running = Running::start(&follow);
    scene::wait_until_following(&camera);
    thread::sleep(BEFORE);
    front.set(way);
    let worse = InView::watch(&camera, lasts);
    front.set(Way::Open);
    println!("{}", row(what, worse, &mut running));
    if lasts < WATCHED {
        print("after that", &camera, &mut running, WATCHED);
    }
}

fn print(what: &str, camera: &VirtualCamera, running: &mut Running, time: Duration) {
    println!("{}", row(what, InView::watch(camera, time), running));
}

fn row(what: &str, seen: InView, running: &mut Running) -> String {
    let told = [running.complaints(), running.infos().to_vec()].concat();
    format!(
        "| {what} | {:.1} % | {:.1} s | {:.0}°/s | {} |",
        100.0 * seen.share,
        seen.longest_out.as_secs_f64(),
        seen.fastest_deg_s,
        told.join("; ")
    )
}
