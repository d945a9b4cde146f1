// SPDX-License-Identifier: MPL-2.0

//! The program `ptztrack` as a user and as a service starts it, against virtual cameras.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "../../virtual-camera/tests/common/browser.rs"]
mod browser;

use std::collections::HashSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use browser::Browser;
use end_to_end::following::Network;
use end_to_end::{GstLaunch, PATIENCE, Program, Way, pictures_in, plugin_folder, scene, scratch, tool};
use gst::prelude::*;
use serde_json::{Value, json};
use virtual_camera::VirtualCamera;

fn camera() -> VirtualCamera {
    VirtualCamera::start(scene::walking_person()).unwrap()
}

#[track_caller]
fn follows(camera: &VirtualCamera) {
    scene::wait_until_following(camera);
}

fn ptztrack() -> Command {
    tool(plugin_folder().join("ptztrack").to_str().unwrap())
}

#[test]
fn one_camera_is_followed_without_a_file() {
    for codec in ["mjpeg", "h264", "mpeg4", "h265"] {
        let camera = camera();
        let mut command = ptztrack();
        command.args([
            "follow",
            &camera.url(),
            "--user",
            scene::USER,
            "--codec",
            codec,
            "--rtsp",
            &camera.rtsp_url(),
        ]);
        command.env("CAMERA_PASSWORD", scene::PASSWORD);
        let mut launch = GstLaunch::spawn(command);
        launch.wait_for_line("acquired");
        follows(&camera);
        launch.signal("TERM");
        let (status, output) = launch.finish();
        assert!(status.success() && output.contains("has stopped"), "{output}");
        scene::assert_left_at_rest(&camera);
    }
}

#[test]
fn a_camera_with_a_wrong_password_is_given_up_and_no_matter_to_the_others() {
    let (good, other) = (camera(), camera());
    let network = Network::before(&good);
    let other_url = other.url();
    let file = |folder: &Path| {
        fs::write(folder.join("other"), "wrong").unwrap();
        let good = Program::entry("good", &network.url(), &folder.join("password"));
        good + &Program::entry("other", &other_url, &folder.join("other"))
    };
    let mut program = Program::start("wrong-password", file, &["--log-format", "json"]);
    let line = program.launch.wait_for_line("given-up");
    let event: Value = serde_json::from_str(&line).unwrap();
    assert_eq!((&event["camera"], &event["level"]), (&json!("other"), &json!("error")), "{line}");
    follows(&good);
    program.wait_for("/metrics", |metrics| metrics.contains("ptztrack_picture_up{camera=\"good\"} 1.0"));

    // The file is read again, and only what changed is touched.
    let before = network.http.video_requests();
    fs::write(program.folder().join("other"), scene::PASSWORD).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("read-again");
    follows(&other);
    assert_eq!(network.http.video_requests(), before);

    // One with mistakes changes nothing.
    fs::write(program.folder().join("cameras.toml"), "[camera.good]\naddress = 7\n").unwrap();
    program.launch.signal("HUP");
    let line = program.launch.wait_for_line("not-read");
    assert!(line.contains("line 2: `address` must be text in quotes"), "{line}");
    assert_eq!(network.http.video_requests(), before);
    let said = program.end("TERM");
    assert!(!said.contains(scene::PASSWORD), "{said}");
    for camera in [&good, &other] {
        scene::assert_left_at_rest(camera);
    }
}

/// All plugins of this machine but for those of these elements, and where these would be.
fn plugins_without(elements: &[&str], folder: &Path) -> Vec<(PathBuf, PathBuf)> {
    end_to_end::init();
    let plugin = |element: &&str| gst::ElementFactory::find(element).unwrap().plugin().unwrap().filename();
    let missing: Vec<PathBuf> = elements.iter().map(|element| plugin(element).unwrap()).collect();
    let place = |plugin: &Path| folder.join(plugin.file_name().unwrap());
    fs::create_dir_all(folder).unwrap();
    for plugin in fs::read_dir(missing[0].parent().unwrap()).unwrap() {
        let plugin = plugin.unwrap().path();
        if !missing.contains(&plugin) && plugin.extension().is_some_and(|extension| extension == "so") {
            symlink(&plugin, place(&plugin)).unwrap();
        }
    }
    missing.into_iter().map(|plugin| (plugin.clone(), place(&plugin))).collect()
}

fn only_plugins_of<'a>(folder: &'a Path, registry: &'a Path) -> [(&'static str, &'a Path); 2] {
    [("GST_PLUGIN_SYSTEM_PATH", folder), ("GST_REGISTRY", registry)]
}

#[test]
fn a_camera_that_lacks_an_element_is_given_up_and_no_matter_to_the_others() {
    let plugins = scratch("lacking");
    let missing = plugins_without(&["avdec_h264"], &plugins);
    let registry = plugins.join("registry.bin");
    let environment = only_plugins_of(&plugins, &registry);

    let (good, other) = (camera(), camera());
    let file = |folder: &Path| {
        let password = folder.join("password");
        let rtsp = other.rtsp_url();
        Program::entry("good", &good.url(), &password)
            + &Program::entry("other", &other.url(), &password)
            + &format!("codec = \"h264\"\nrtsp = \"{rtsp}\"\n")
    };
    let mut program = Program::start_in("lacking", file, &[], &environment);
    let line = program.launch.wait_for_line("other: error: given up: ");
    let lack = "GStreamer has no element avdec_h264; on Debian it is in the package gstreamer1.0-libav";
    assert!(line.contains(lack), "{line}");
    follows(&good);
    let cameras = program.folder().join("cameras.toml");
    let check = || ptztrack().arg("check").arg(&cameras).envs(environment).output().unwrap();
    let said = check();
    assert_eq!(said.status.code(), Some(1), "{said:?}");
    assert_eq!(String::from_utf8_lossy(&said.stderr), format!("camera `other`: {lack}\n"));

    // Once it is installed, the file is read again.
    missing.iter().for_each(|(plugin, place)| symlink(plugin, place).unwrap());
    assert!(check().status.success());
    program.launch.signal("HUP");
    program.launch.wait_for_line("other: the picture is there");
    follows(&other);
    program.end("TERM");
    fs::remove_dir_all(&plugins).unwrap();
    for camera in [&good, &other] {
        scene::assert_left_at_rest(camera);
    }
}

#[test]
fn a_recording_that_lacks_an_element_costs_nobody_who_is_followed() {
    let plugins = scratch("recording-lacks");
    let missing = plugins_without(&["h264parse", "x264enc"], &plugins);
    let registry = plugins.join("registry.bin");
    let environment = only_plugins_of(&plugins, &registry);

    let cameras = [("as-it-comes", camera(), "h264parse", "bad"), ("drawn-in", camera(), "x264enc", "ugly")];
    let recordings = scratch("recordings-that-lack");
    let file = |folder: &Path| {
        let entry = |(name, camera, ..): &(&str, VirtualCamera, _, _)| {
            let (rtsp, overlay) = (camera.rtsp_url(), *name == "drawn-in");
            Program::entry(name, &camera.url(), &folder.join("password"))
                + &format!("codec = \"h264\"\nrtsp = \"{rtsp}\"\n[camera.{name}.recording]\n")
                + &format!("folder = {recordings:?}\nkeep = \"1h\"\noverlay = {overlay}\n")
        };
        cameras.iter().map(entry).collect()
    };
    let mut program = Program::start_in("recording-lacks", file, &[], &environment);
    let mut lacks = String::new();
    for (name, camera, element, package) in &cameras {
        let lack = format!(
            "GStreamer has no element {element}; on Debian it is in the package gstreamer1.0-plugins-{package}"
        );
        program.launch.wait_for_line(&format!(
            "{name}: warning: nothing is recorded: {lack}; the camera keeps following; retrying"
        ));
        program.launch.rewind();
        follows(camera);
        lacks += &format!("camera `{name}`: {lack}\n");
    }
    let file = program.folder().join("cameras.toml");
    let said = ptztrack().arg("check").arg(&file).envs(environment).output().unwrap();
    assert_eq!(
        (said.status.code(), String::from_utf8_lossy(&said.stderr).as_ref()),
        (Some(1), lacks.as_str())
    );

    // Once they are installed and the file is read again, they are recorded without anybody's losing the picture.
    missing.iter().for_each(|(plugin, place)| symlink(plugin, place).unwrap());
    program.launch.signal("HUP");
    for (name, ..) in &cameras {
        program.launch.wait_for_line(&format!("{name}: it is recorded again"));
        program.launch.rewind();
    }
    assert_eq!(program.metric("ptztrack_pipelines_total") as usize, cameras.len());
    let said = program.end("TERM");
    assert_eq!(said.matches("nothing is recorded").count(), cameras.len(), "{said}");
    for (name, camera, ..) in &cameras {
        scene::assert_left_at_rest(camera);
        let files = fs::read_dir(&recordings).unwrap().map(|file| file.unwrap().path());
        let of_camera = |file: &PathBuf| file.file_name().unwrap().to_string_lossy().starts_with(name);
        let pictures: u32 = files.filter(of_camera).map(|file| pictures_in(&file).unwrap()).sum();
        assert!(pictures > 0, "{name}");
    }
    fs::remove_dir_all(&recordings).unwrap();
    fs::remove_dir_all(&plugins).unwrap();
}

#[test]
fn a_camera_that_reboots_is_told_of_once_and_comes_back() {
    let camera = camera();
    let network = Network::before(&camera);
    let file = |folder: &Path| Program::entry("door", &network.url(), &folder.join("password"));
    let mut program = Program::start("reboot", file, &[]);
    let is_well_and_follows = |cameras: &str| {
        let cameras: Value = serde_json::from_str(cameras).unwrap();
        cameras[0]["well"] == json!(true) && cameras[0]["target"] != Value::Null
    };
    program.wait_for("/cameras", is_well_and_follows);
    network.set(Way::Refused);
    network.reset();
    program.launch.wait_for_line("tried again until it is back");
    // It is tried about twice a second.
    program.wait_for("/metrics", |metrics| count(metrics, "ptztrack_failures_total{camera=\"door\"}") > 9.0);
    let cameras: Value = serde_json::from_str(&program.ask("GET", "/cameras").1).unwrap();
    assert_eq!((&cameras[0]["target"], &cameras[0]["well"]), (&Value::Null, &json!(false)), "{cameras}");
    network.set(Way::Open);
    program.wait_for("/cameras", is_well_and_follows);
    follows(&camera);
    let said = program.end("INT");
    // Each reason once.
    let reasons = said.lines().filter(|line| line.contains("it is tried again until it is back"));
    let reasons: Vec<_> = reasons.filter_map(|line| line.split_once(' ')).map(|(_, reason)| reason).collect();
    let different: HashSet<_> = reasons.iter().collect();
    assert!(!reasons.is_empty() && reasons.len() == different.len(), "{said}");
}

/// A camera whose power is on, but that accepts no connection any more, as one that hangs.
#[test]
fn a_camera_that_hangs_costs_nothing_but_time() {
    let hanging = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::STREAM, None).unwrap();
    hanging.bind(&std::net::SocketAddr::from(([127, 0, 0, 1], 0)).into()).unwrap();
    hanging.listen(0).unwrap();
    let address = hanging.local_addr().unwrap().as_socket().unwrap();
    // Nobody accepts these, and no more fit.
    let moment = std::time::Duration::from_millis(300);
    let waiting: Vec<_> =
        (0..4).map_while(|_| std::net::TcpStream::connect_timeout(&address, moment).ok()).collect();
    assert!(!waiting.is_empty());
    let file = |folder: &Path| Program::entry("door", &format!("http://{address}"), &folder.join("password"));
    let mut program = Program::start("hangs", file, &[]);
    let line = program.launch.wait_for_line("tried again until it is back");
    assert!(line.contains(&format!("http://{address}: ")), "{line}");
    let failures = "ptztrack_failures_total{camera=\"door\"}";
    let descriptors = || fs::read_dir(format!("/proc/{}/fd", program.launch.id())).unwrap().count();
    program.wait_for("/metrics", |metrics| count(metrics, failures) > 3.0);
    let before = descriptors();
    program.wait_for("/metrics", |metrics| count(metrics, failures) > 9.0);
    let after = descriptors();
    // One may be open at that moment.
    assert!(after <= before + 2, "{before} descriptors, then {after}");
    program.end("TERM");
}

fn count(metrics: &str, name: &str) -> f64 {
    let line = metrics.lines().find_map(|line| line.strip_prefix(name)).unwrap_or("0");
    line.trim().parse().unwrap()
}

#[test]
fn a_pipeline_that_gives_no_picture_is_built_anew() {
    let file = |_: &Path| {
        "[camera.door]\naddress = \"http://127.0.0.1:1\"\npipeline = \"appsrc is-live=true ! bgavgdetect ! fakesink\"\n"
            .to_owned()
    };
    let mut program = Program::start("silent", file, &[]);
    program.launch.wait_for_line("door: warning: no picture for 10 s: the pipeline is built anew");
    program
        .wait_for("/metrics", |metrics| count(metrics, "ptztrack_pipelines_total{camera=\"door\"}") == 2.0);
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    program.end("TERM");
}

#[test]
fn metrics_and_page_are_for_who_asks_by_the_right_name() {
    let camera = camera();
    let file = |folder: &Path| Program::entry("door", &camera.url(), &folder.join("password"));
    let program = Program::start("metrics", file, &[]);
    follows(&camera);
    let metrics = program.wait_for("/metrics", |metrics| {
        count(metrics, "ptztrack_commands_total{camera=\"door\"}") > 0.0
            && metrics.contains("ptztrack_camera_state{camera=\"door\",state=\"moving\"} 1")
    });
    for name in [
        "ptztrack_pictures_total{camera=\"door\"}",
        "ptztrack_element_seconds_total{camera=\"door\",element=\"lkfeaturetrack\"}",
        "ptztrack_command_round_trip_seconds{camera=\"door\"}",
    ] {
        assert!(count(&metrics, name) > 0.0, "{name} in:\n{metrics}");
    }
    assert!(metrics.trim_end().ends_with("# EOF"), "{metrics}");
    assert_eq!(program.ask_as("evil.example", "GET", "/metrics").0, 421);
    assert_eq!(program.ask_as("evil.example", "POST", "/cameras/door/release").0, 421);
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    assert_eq!(program.ask("POST", "/cameras/nobody/release").0, 404);
    assert_eq!(program.ask("POST", "/cameras/door/select?x=7&y=0").0, 400);
    program.end("TERM");
}

#[test]
fn the_page_shows_every_camera_and_steers_it() {
    let mut browser = Browser::start("chromium-program");
    let door = camera();
    let hall = VirtualCamera::start(scene::standing_person()).unwrap();
    let file = |folder: &Path| {
        let password = folder.join("password");
        let home = "[camera.door.vapixptzsink]\nhome = \"10,4\"\nhome-timeout = \"1h\"\n";
        Program::entry("door", &door.url(), &password)
            + home
            + &Program::entry("hall", &hall.url(), &password)
            + &Program::entry("away", "http://127.0.0.1:1", &password)
    };
    let mut program = Program::start("page", file, &[]);
    browser.open(&program.url());
    let of = |name: &str| format!("document.querySelector('[data-name={name}]')");
    for name in ["door", "hall"] {
        browser.wait_for(&format!("{}?.querySelector('img').naturalWidth == 320", of(name)));
    }
    browser.wait_for(&format!("{}.innerText.includes('follows target')", of("door")));
    browser.wait_for(&format!("{}.innerText.includes('looks for somebody, the camera rests')", of("hall")));
    browser.wait_for("document.querySelector('#troubled').innerText == 'Trouble with away'");
    browser.save_picture("ptztrack-page.png");
    // One click makes one large, another small again.
    let size = format!("{}.querySelector('.size')", of("hall"));
    let width =
        |browser: &mut Browser| browser.value(&format!("{}.clientWidth", of("hall"))).as_f64().unwrap();
    let small = width(&mut browser);
    browser.value(&format!("{size}.click()"));
    browser.save_picture("ptztrack-page-large.png");
    assert!(width(&mut browser) > 1.9 * small, "{small}");
    browser.value(&format!("{size}.click()"));
    assert!((width(&mut browser) - small).abs() < 1.0, "{small}");
    let click = |browser: &mut Browser, what: &str| {
        let button = format!("{}.querySelector('[data-order={what}]')", of("door"));
        browser.wait_for(&format!("!{button}.hidden"));
        browser.value(&format!("{button}.click()"));
    };

    // Handed over, the camera is left alone; taken back, it follows again.
    click(&mut browser, "hand-over");
    browser.wait_for(&format!("{}.innerText.includes('handed over')", of("door")));
    scene::assert_left_at_rest(&door);
    click(&mut browser, "take-back");
    follows(&door);

    let sent = door.status().commands;
    click(&mut browser, "home");
    // Higher than anybody is, yet whoever walks by is in view from head to foot.
    let off =
        |status: &virtual_camera::Status| (status.pan_deg - 10.0).abs().max((status.tilt_deg - 4.0).abs());
    let is_home = door.wait_for(PATIENCE, |status| off(status) < 0.5);
    let next: Vec<_> = door.commands_after(sent).into_iter().take(20).collect();
    assert!(is_home, "{:?}\n{next:#?}\n{}", door.status(), program.launch.said());
    assert!(door.wait_for(PATIENCE, |status| off(status) > 3.0), "it does not follow again");

    // A click at somebody who stands still makes him the target; a button lets him go.
    browser.wait_for(&format!("{}.querySelector('[data-order=release]').hidden", of("hall")));
    let image = format!("{}.querySelector('img')", of("hall"));
    let at = format!(
        "{{ const r = {image}.getBoundingClientRect(); {image}.dispatchEvent(new MouseEvent('click', \
         {{ clientX: r.x + r.width / 2, clientY: r.y + r.height / 2, bubbles: true }})); }}"
    );
    browser.value(&at);
    browser.wait_for(&format!("{}.innerText.includes('follows target')", of("hall")));
    browser.value(&format!("{}.querySelector('[data-order=release]').click()", of("hall")));
    browser.wait_for(&format!("{}.innerText.includes('looks for somebody')", of("hall")));
    program.end("TERM");
    scene::assert_left_at_rest(&door);
}

/// By touch; who turns it is an operator, for as long as the camera is left to one.
#[test]
fn a_camera_is_turned_by_hand_on_the_page() {
    let mut browser = Browser::start("chromium-by-hand");
    for isolation in ["none", "process"] {
        let camera = VirtualCamera::start(scene::nobody()).unwrap();
        let file = |folder: &Path| {
            let more = format!(
                "isolation = \"{isolation}\"\n[camera.door.vapixptzsink]\noverride-timeout = \"3s\"\n"
            );
            Program::entry("door", &camera.url(), &folder.join("password")) + &more
        };
        let program = Program::start(&format!("by-hand-{isolation}"), file, &[]);
        browser.open(&program.url());
        browser.wait_for("document.querySelector('.turn')?.checkVisibility()");
        let before = camera.status();
        browser.call("Emulation.setTouchEmulationEnabled", json!({"enabled": true}));
        let right = "document.querySelector('[data-turn=\"x=0.2\"]').getBoundingClientRect()";
        let place = browser.value(&format!(
            "(() => {{ document.querySelector('.turn').scrollIntoView(); const r = {right}; return {{ x: r.x + r.width / 2, y: r.y + r.height / 2 }}; }})()"
        ));
        browser.call("Input.dispatchTouchEvent", json!({"type": "touchStart", "touchPoints": [place]}));
        browser.call("Input.dispatchTouchEvent", json!({"type": "touchEnd", "touchPoints": []}));
        browser
            .wait_for("document.querySelector('article').innerText.includes('an operator has the camera')");
        let turned = |status: &virtual_camera::Status| status.pan_deg > before.pan_deg + 3.0;
        assert!(camera.wait_for(PATIENCE, turned), "{:?}", camera.status());
        browser.save_picture("ptztrack-page-by-hand.png");
        browser
            .wait_for("!document.querySelector('article').innerText.includes('an operator has the camera')");
        assert_eq!(program.ask("POST", "/cameras/door/turn?x=7").0, 400);
        assert_eq!(program.ask("POST", "/cameras/door/turn?zoom=0.5").0, 204);
        assert!(
            camera.wait_for(PATIENCE, |status| status.magnification > 1.1 * before.magnification),
            "{:?}",
            camera.status()
        );
        program.end("TERM");
        assert!(
            scene::rests(&camera, camera.now()).is_some(),
            "left turning: {:?}",
            camera.commands().last()
        );
    }
}

#[test]
fn the_cameras_own_stream_is_recorded_as_it_comes() {
    let camera = camera();
    let file = |folder: &Path| {
        let recording = folder.join("recordings");
        let more = format!("codec = \"h264\"\nrtsp = \"{}\"\n", camera.rtsp_url());
        let recording =
            format!("[camera.door.recording]\nfolder = {recording:?}\nsegment = \"2s\"\nkeep = \"1h\"\n");
        Program::entry("door", &camera.url(), &folder.join("password")) + &more + &recording
    };
    let program = Program::start("recording", file, &[]);
    let folder = program.folder().join("recordings");
    let files = || fs::read_dir(&folder).map_or(0, Iterator::count);
    let begin = std::time::Instant::now();
    while files() < 3 {
        assert!(begin.elapsed() < PATIENCE, "only {} files", files());
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    let kept = scratch("kept");
    fs::rename(&folder, &kept).unwrap();
    program.end("TERM");
    let mut names: Vec<_> = fs::read_dir(&kept).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.sort();
    let probe = pictures_in(&names[0]);
    fs::remove_dir_all(&kept).unwrap();
    assert!(probe.as_ref().is_ok_and(|frames| *frames > 5), "{probe:?}");
}

#[test]
fn mistakes_are_named_and_the_example_is_right() {
    let example = ptztrack().arg("example-config").output().unwrap();
    let file = scratch("example.toml");
    fs::write(&file, &example.stdout).unwrap();
    let right = ptztrack().arg("check").arg(&file).output().unwrap();
    assert!(right.status.success(), "{right:?}");
    fs::write(
        &file,
        "[camera.door]\naddress = \"http://door\"\nzones = [\"0,0 1,1\"]\n[camera.door.vapixptzsink]\ngain = 99\n\
         home-timeout = \"soon\"\nmode = \"fast\"\npassword = \"x\"\nlatency = \"500ms\"\n",
    )
    .unwrap();
    let wrong = ptztrack().arg("check").arg(&file).output().unwrap();
    let run = ptztrack().arg("run").arg(&file).output().unwrap();
    fs::remove_file(&file).unwrap();
    let said = String::from_utf8_lossy(&wrong.stderr);
    assert_eq!(wrong.status.code(), Some(78), "{said}");
    assert_eq!((run.status.code(), run.stderr.as_slice()), (Some(78), wrong.stderr.as_slice()));
    for expected in [
        "line 3: `zones` cannot be 0,0 1,1: ",
        "line 5: `gain` must be a number from 0 to 20",
        "line 6: `home-timeout` must be a duration such as \"2s\"",
        "line 7: `mode` must be one of ",
        "line 8: `password` is no property that can be set here; there are: ",
    ] {
        assert!(said.contains(expected), "{expected} is not in:\n{said}");
    }
    assert!(!said.contains("latency` must") && !said.contains("line 9"), "{said}");
}
