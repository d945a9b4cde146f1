// SPDX-License-Identifier: MPL-2.0

//! What keeps no camera of the program `ptztrack` away for good, nor anybody who waits for it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use end_to_end::following::Network;
use end_to_end::{PATIENCE, Program, plugin_folder, scene, signal};
use virtual_camera::{Fault, VirtualCamera};

/// As one that is starting refuses everybody, and one that was attacked locks the account.
#[test]
fn a_camera_that_refuses_an_account_that_worked_is_tried_again() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let file = |folder: &Path| Program::entry("door", &network.url(), &folder.join("password"));
    let mut program = Program::start("locked", file, &[]);
    scene::wait_until_following(&camera);

    camera.set_fault(Fault::Locked);
    network.reset();
    let line = program.launch.wait_for_line("the camera refuses user");
    assert!(line.contains("tried again"), "{line}");
    program.wait_for("/cameras", |cameras| cameras.contains("no picture"));
    camera.set_fault(Fault::None);
    program.launch.wait_for_line("door: the picture is there");
    scene::wait_until_following(&camera);
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// As after a power cut: the camera boots with the machine, and refuses everybody for its first seconds. One that never worked is
/// given up at once, as it may be misspelt.
#[track_caller]
fn is_followed_after_both_were_restarted(test: &str, entry: &str, more: &[&str]) {
    let [camera, never] = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    never.set_fault(Fault::Locked);
    let state = end_to_end::scratch(&format!("state-{test}"));
    fs::create_dir_all(&state).unwrap();
    let environment = [("STATE_DIRECTORY", state.as_path())];
    let file = |folder: &Path| {
        let password = folder.join("password");
        [("door", &camera), ("never", &never)]
            .map(|(name, camera)| Program::entry(name, &camera.url(), &password) + entry)
            .concat()
    };
    let mut program = Program::start_in(test, file, more, &environment);
    program.launch.wait_for_line("never: error: given up: ");
    scene::wait_until_following(&camera);
    let kept = || {
        let files = fs::read_dir(&state).unwrap().map(|file| file.unwrap().path());
        let texts = files.filter_map(|file| fs::read_to_string(file).ok());
        texts.collect::<String>()
    };
    let begin = Instant::now();
    while !kept().contains(&camera.url()) {
        assert!(begin.elapsed() < PATIENCE, "not kept: {}", kept());
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(!kept().contains(scene::PASSWORD) && !kept().contains("never"), "{}", kept());
    program.launch.signal("KILL");
    program.launch.finish();
    scene::assert_left_at_rest(&camera);

    camera.set_fault(Fault::Locked);
    let mut program = Program::start_in(test, file, more, &environment);
    let line = program.launch.wait_for_line("it is tried again");
    assert!(line.contains("door: ") && line.contains("the camera refuses user"), "{line}");
    program.launch.rewind();
    program.launch.wait_for_line("never: error: given up: ");
    camera.set_fault(Fault::None);
    program.launch.wait_for_line("door: the picture is there");
    scene::wait_until_following(&camera);
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
    fs::remove_dir_all(state).unwrap();
}

#[test]
fn an_account_that_worked_before_a_restart_is_tried_again() {
    is_followed_after_both_were_restarted("both-restart", "", &[]);
}

#[test]
fn so_is_that_of_a_camera_with_a_process_of_its_own_in_a_share() {
    is_followed_after_both_were_restarted(
        "both-restart-process",
        "isolation = \"process\"\n",
        &["--shard", "0/1"],
    );
}

/// Somebody in a camera's place who, by RTSP, takes no user and password for right; and when whom he has refused went away.
fn locked() -> (SocketAddr, Receiver<Instant>) {
    const CHALLENGE: &[u8] =
        b"RTSP/1.0 401 Unauthorized\r\nCSeq: 1\r\nWWW-Authenticate: Digest realm=\"AXIS\", nonce=\"17\"\r\n\r\n";
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let (tells, refused) = channel();
    std::thread::spawn(move || {
        for mut client in listener.incoming().map_while(Result::ok) {
            let (mut bytes, mut said) = ([0; 4096], Vec::new());
            while let Ok(read @ 1..) = client.read(&mut bytes) {
                said.extend_from_slice(&bytes[..read]);
                // Who goes away before that is no matter.
                let _ = client.write_all(CHALLENGE);
            }
            if String::from_utf8_lossy(&said).contains("Authorization: Digest")
                && tells.send(Instant::now()).is_err()
            {
                return;
            }
        }
    });
    (address, refused)
}

/// The same by RTSP, while the camera lets us steer: after 10 s, then after 20 s, as whoever tries on and on keeps an account locked.
#[test]
fn video_by_rtsp_that_refuses_an_account_that_worked_is_tried_again_at_growing_pauses() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let file = |folder: &Path| {
        Program::entry("door", &network.url(), &folder.join("password"))
            + &format!("codec = \"h264\"\nrtsp = \"rtsp://{}\"\n", network.rtsp.address())
    };
    let mut program = Program::start("locked-rtsp", file, &[]);
    scene::wait_until_following(&camera);
    program.launch.wait_for_line("door: the picture is there");

    let (address, refused) = locked();
    network.rtsp.lead_to(address);
    let line = program.launch.wait_for_line("the camera refuses user");
    assert!(line.contains("tried again"), "{line}");
    let [first, second] = [(); 2].map(|()| refused.recv_timeout(PATIENCE).unwrap());
    network.rtsp.lead_to(camera.rtsp_address());
    program.launch.wait_for_line("door: the picture is there");
    // Whoever saw it late saw it too short: half of each is left for that.
    let pauses = [second - first, second.elapsed()];
    assert!(pauses[0] > Duration::from_secs(5) && pauses[1] > Duration::from_secs(15), "{pauses:?}");
    scene::wait_until_following(&camera);
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// The next process of a camera knows that its account has worked; and the watchdog, refused as well, stops the camera once it can.
#[test]
fn a_camera_that_refuses_everybody_as_its_process_crashes_is_stopped_and_tried_again() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let file = |folder: &Path| {
        Program::entry("door", &camera.url(), &folder.join("password")) + "isolation = \"process\"\n"
    };
    let mut program = Program::start("crashed", file, &[]);
    scene::wait_until_following(&camera);
    program.wait_for("/metrics", |metrics| metrics.contains("ptztrack_picture_up{camera=\"door\"} 1"));

    camera.set_fault(Fault::Locked);
    signal(program.process_of("door"), "ABRT");
    let line = program.launch.wait_for_line("the camera refuses user");
    assert!(line.contains("tried again"), "{line}");
    camera.set_fault(Fault::None);
    program.launch.wait_for_line("door: the picture is there");
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// The thread that asks for the name cannot be ended: whoever waits for it waits for as long as the name server likes.
#[test]
fn a_name_that_is_looked_up_for_ever_keeps_nobody_waiting() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let names = plugin_folder().join("examples/libsilent_names.so");
    // Where there is no such library the linker only warns.
    assert!(names.is_file(), "{}", names.display());
    let good = |folder: &Path| Program::entry("good", &network.url(), &folder.join("password"));
    let file = |folder: &Path| {
        good(folder) + &Program::entry("lost", "http://camera.silent", &folder.join("password"))
    };
    let mut program = Program::start_in("silent-name", file, &[], &[("LD_PRELOAD", &names)]);
    scene::wait_until_following(&camera);
    program.launch.wait_for_line("lost: error: ");

    // Neither who reads the file again, nor who asks whether all is well, nor another camera.
    fs::write(program.folder().join("cameras.toml"), good(program.folder())).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("read again");
    program.wait_for("/cameras", |cameras| !cameras.contains("lost"));
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    let before = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 10), "not steered");
    assert_eq!(network.http.video_requests(), 2, "it is touched");
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// A driver that never comes back, as far as the others can tell.
#[test]
fn a_camera_whose_own_process_hangs_is_given_another() {
    let [good, door] = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    let file = |folder: &Path| {
        let password = folder.join("password");
        Program::entry("good", &good.url(), &password)
            + &Program::entry("door", &door.url(), &password)
            + "isolation = \"process\"\n"
    };
    let mut program = Program::start("hangs", file, &[]);
    [&good, &door].into_iter().for_each(scene::wait_until_following);
    let process = program.process_of("door");
    let limits = fs::read_to_string(format!("/proc/{process}/limits")).unwrap();
    let memory = limits.lines().find(|line| line.starts_with("Max data size")).unwrap();
    assert!(memory.contains(" 2147483648 "), "{memory}");
    signal(process, "STOP");
    program.launch.wait_for_line("door: error: its process hangs; it is started again");
    program.launch.wait_for_line("door: the picture is there");
    assert_ne!(program.process_of("door"), process);
    scene::wait_until_following(&door);
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    program.end("TERM");
    [good, door].iter().for_each(scene::assert_left_at_rest);
}

/// Takes 50 MB more five times a second, without writing there, and gives none back.
const LEAK: &str = "fakesrc sizetype=fixed sizemax=50000000 ! identity sleep-time=200000 \
    ! queue max-size-buffers=0 max-size-bytes=0 max-size-time=0 min-threshold-buffers=100000 ! fakesink async=false";

/// In its own process that ends at 2 GiB, and not where the machine does.
#[test]
fn a_camera_that_leaks_memory_loses_its_own_process_and_no_other_camera() {
    let [good, door] = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    let network = Network::before(&good);
    let file = |folder: &Path| {
        let password = folder.join("password");
        let pipeline = format!(
            "appsrc name=source is-live=true do-timestamp=true format=time ! multipartdemux ! jpegdec \
             ! queue leaky=downstream max-size-buffers=1 ! bgavgdetect ! lkfeaturetrack ! vapixptzsink {LEAK}"
        );
        Program::entry("good", &network.url(), &password)
            + &Program::entry("door", &door.url(), &password)
            + &format!("isolation = \"process\"\npipeline = {pipeline:?}\n")
    };
    let mut program = Program::start("leaks", file, &[]);
    let process = program.process_of("door");
    scene::wait_until_following(&good);
    let (requests, commands) = (network.http.video_requests(), good.status().commands);
    let line = program.launch.wait_for_line("door: error: its process ended: signal: ");
    assert!(line.contains("it is started again"), "{line}");
    program.launch.wait_for_line("door: the picture is there");
    assert_ne!(program.process_of("door"), process);
    assert_eq!(network.http.video_requests(), requests, "the other one is touched");
    assert!(good.wait_for(PATIENCE, |status| status.commands > commands + 20), "not steered");
    program.end("TERM");
    [good, door].iter().for_each(scene::assert_left_at_rest);
}
