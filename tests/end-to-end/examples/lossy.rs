// SPDX-License-Identifier: MPL-2.0

//! Follows over networks that lose, delay and hold back what they carry, and prints a table in Markdown of how long who is followed is out
//! of view, or off the middle of it with nobody steering the camera, how fast that turned, and what the user is told:
//!
//! ```sh
//! cargo build --workspace --lib --bins && sudo -E cargo run --example lossy [NETWORK]
//! ```
//! A pipeline loses packets where UDP hands them over, and has what goes by TCP come late from a proxy, video and control alike. The program
//! `ptztrack run` has video and control by a cable that loses packets of both directions, which takes root, iproute2 and iptables.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::mem;
use std::path::Path;
use std::sync::Mutex;
use std::thread;
use std::time::Duration;

use end_to_end::following::Network;
use end_to_end::{Cable, Chance, Front, InView, Program, Running, Way, complaints_in, scene};
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
        "| network | in view | out of view for at most | not steered for at most | turns at most | what the user is told |\n\
         |---|---|---|---|---|---|"
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
    let codecs = [("mjpeg", "MJPEG by HTTP"), ("h264", "H.264 by RTSP")];
    let by_program = [1, 10, 50].into_iter().flat_map(|lost| codecs.map(|codec| (lost, codec)));
    for (number, (lost, (codec, by))) in (0..).zip(by_program) {
        let share = lost as f64 / PACKETS as f64;
        let network = format!("{} % of packets lost, `ptztrack run`, {by}", share * 100.0);
        if is_wanted(&network) {
            let not_run = |reason| {
                format!("| {network} | not run: {reason}. It takes root, iproute2 and iptables | | | | |")
            };
            println!("{}", by_cable(&network, number, share, codec).unwrap_or_else(not_run));
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
    let seen = InView::watch(&camera, WATCHED);
    println!("{}", row(network, seen, &told(&mut running, &mut [0; 2])));
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

/// The program, which has everything by a cable that loses this share of all packets.
///
/// # Errors
/// Why there is no such cable here.
fn by_cable(network: &str, number: u8, share: f64, codec: &str) -> Result<String, String> {
    let cable = Cable::lay(number)?;
    cable.lose(share)?;
    let camera = VirtualCamera::start(scene::far_person()).unwrap();
    let ways = Network::at(cable.camera_side(), &camera);
    let file = |folder: &Path| {
        let video = format!("codec = {codec:?}\nrtsp = \"rtsp://{}\"\n", ways.rtsp.address());
        Program::entry("door", &ways.url(), &folder.join("password")) + &video
    };
    let test = format!("lossy-{number}");
    let program = Program::start_as(&test, file, &[], |command| cable.at_the_end(&command));
    scene::wait_until_following(&camera);
    let seen = InView::watch(&camera, WATCHED);
    Ok(row(network, seen, &complaints_in(&program.end("TERM"))))
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
    let mut known = [0; 2];
    println!("{}", row(what, worse, &told(&mut running, &mut known)));
    if lasts < WATCHED {
        let after = InView::watch(&camera, WATCHED);
        println!("{}", row("after that", after, &told(&mut running, &mut known)));
    }
}

/// The warnings and infos of a pipeline after so many of each, which those count then, too.
fn told(running: &mut Running, known: &mut [usize; 2]) -> Vec<String> {
    let all = [running.complaints(), running.infos().to_vec()];
    let new = |(all, known): (&Vec<String>, &mut usize)| all[mem::replace(known, all.len())..].to_vec();
    all.iter().zip(known).flat_map(new).collect()
}

fn row(what: &str, seen: InView, told: &[String]) -> String {
    format!(
        "| {what} | {:.1} % | {:.1} s | {:.1} s | {:.0}°/s | {} |",
        100.0 * seen.share,
        seen.longest_out.as_secs_f64(),
        seen.longest_unsteered.as_secs_f64(),
        seen.fastest_deg_s,
        told.join("; ")
    )
}
