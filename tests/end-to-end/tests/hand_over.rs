// SPDX-License-Identifier: MPL-2.0

//! A camera that does not turn calls one that does.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "../../virtual-camera/tests/common/browser.rs"]
mod browser;

use std::fs;
use std::path::Path;
use std::time::Duration;

use browser::Browser;
use end_to_end::{Broker, PATIENCE, Program, plugin_folder, scene, tool};
use handover::{Direction, Map, Pair, Place};
use virtual_camera::{Moves, Pose, Settings, SyntheticSettings, VirtualCamera, Waypoint, World};

/// Somebody walks to and fro to the right of what the camera that turns sees at first.
fn somebody_aside(home: Pose) -> VirtualCamera {
    let turn =
        |(lap, pan_deg): (u64, f64)| Waypoint { time: Duration::from_secs(6 * lap), pan_deg, tilt_deg: -2.0 };
    let path = (0..60).map(|lap| turn((lap, if lap % 2 == 0 { 6.0 } else { 26.0 }))).collect();
    let settings = scene::nobody();
    let world = World::Synthetic(SyntheticSettings { path, ..Default::default() });
    VirtualCamera::start(Settings { world, home: Some(home), ..settings }).unwrap()
}

fn looking(pan_deg: f64) -> Pose {
    Pose { pan_deg, tilt_deg: 0.0, zoom_step: 1.0 }
}

/// What would have been learned: both look out of the same place.
fn known(fixed: &VirtualCamera, size: (u32, u32)) -> Map {
    let mut map = Map::default();
    for second in 3..30 {
        let time = Duration::from_millis(1000 * second + 137 * second % 1000);
        let Some(person) = fixed.ground_truth_from(&looking(16.0), time, size).into_iter().next() else {
            continue;
        };
        // Seen from straight ahead, the place in the picture is the direction.
        let middle = |pan_deg| fixed.ground_truth_from(&looking(pan_deg), time, size)[0].clone();
        let half = (36f64 / 2.0).to_radians().tan();
        let bounds = middle(0.0).bounds;
        let angle = |part: f64, half: f64| ((2.0 * part - 1.0) * half).atan().to_degrees();
        let (x, y) = (bounds.left + bounds.width / 2.0, bounds.top + bounds.height);
        let direction = Direction {
            pan_deg: angle(x / f64::from(size.0), half),
            tilt_deg: -angle(y / f64::from(size.1), half * 0.75),
        };
        let bounds = person.bounds;
        let feet = (bounds.left + bounds.width / 2.0, bounds.top + bounds.height);
        let place = Place::in_picture(feet.0 / f64::from(size.0), feet.1 / f64::from(size.1));
        map.learn(Pair { place, direction, height_deg: Some(9.0), person: 1 });
    }
    map
}

/// A file in which a camera that does not turn calls one that does.
fn yard_calls_door(yard: &VirtualCamera, door: &VirtualCamera, folder: &Path) -> String {
    let password = folder.join("password");
    let yard = Program::entry("yard", &yard.url(), &password) + "kind = \"fixed\"\n";
    let door = Program::entry("door", &door.url(), &password);
    format!("{yard}{door}[handover.yard]\ncalls = [\"door\"]\n")
}

#[test]
fn whom_a_fixed_camera_sees_another_turns_to_and_follows() {
    let (yard, door) = (somebody_aside(looking(16.0)), somebody_aside(looking(-20.0)));
    let map = known(&yard, yard.view_size()).to_json();
    let state = end_to_end::scratch("hand-over-state");
    fs::create_dir_all(&state).unwrap();
    fs::write(state.join("map.yard.door.json"), map).unwrap();
    let file = |folder: &Path| yard_calls_door(&yard, &door, folder);
    let environment = [("STATE_DIRECTORY", state.as_path())];
    let mut program = Program::start_in("hand-over", file, &[], &environment);
    let line = program.launch.wait_for_line("door: turns to target ");
    assert!(line.ends_with(" of yard"), "{line}");
    let line = program.launch.wait_for_line("door: target ");
    program.launch.rewind();
    program.launch.wait_for_line(" of yard");
    let cameras = program.wait_for("/cameras", |cameras| cameras.contains("of yard)"));
    assert!(cameras.contains("follows target"), "{line} {cameras}");
    assert!(door.status().pan_deg > 0.0, "{:?}", door.status());
    program.end("TERM");
    // Stopped in whichever words end what it did last: a turn to a place, or at a speed.
    assert!(scene::rests(&door, door.now()).is_some(), "left turning: {:?}", door.commands().last());
    // Nobody has a word for the one that does not turn.
    assert!(yard.commands().iter().all(|command| !command.query.contains("move=")), "{:?}", yard.commands());
    fs::remove_dir_all(&state).unwrap();
}

#[test]
fn a_camera_that_takes_no_moves_to_a_position_is_called_no_more() {
    let yard = somebody_aside(looking(16.0));
    let moves = Moves { absolute: false, ..Moves::default() };
    let door =
        VirtualCamera::start(Settings { moves, home: Some(looking(-20.0)), ..scene::nobody() }).unwrap();
    let state = end_to_end::scratch("hand-over-refused");
    fs::create_dir_all(&state).unwrap();
    fs::write(state.join("map.yard.door.json"), known(&yard, yard.view_size()).to_json()).unwrap();
    let file = |folder: &Path| yard_calls_door(&yard, &door, folder);
    let environment = [("STATE_DIRECTORY", state.as_path())];
    let mut program = Program::start_in("hand-over-refused", file, &[], &environment);
    program.launch.wait_for_line("door: warning: refuses to turn to where another camera sees somebody");
    program.wait_for("/cameras", |cameras| !cameras.contains("turns to whom another one sees"));
    assert_eq!(door.status().pan_deg, -20.0);
    program.end("TERM");
    fs::remove_dir_all(&state).unwrap();
}

/// Two processes and a broker: each turns the camera that it has.
#[test]
fn whom_a_camera_of_one_process_sees_the_camera_of_another_one_turns_to() {
    let (hall, door) = (somebody_aside(looking(16.0)), somebody_aside(looking(-20.0)));
    let broker = Broker::start();
    let states = [0, 1].map(|shard| end_to_end::scratch(&format!("hand-over-shard-{shard}")));
    states.iter().for_each(|state| fs::create_dir_all(state).unwrap());
    let file = |folder: &Path| {
        let password = folder.join("password");
        let hall = Program::entry("hall", &hall.url(), &password) + "kind = \"fixed\"\n";
        let door = Program::entry("door", &door.url(), &password);
        let mqtt = format!("[mqtt]\nhost = \"127.0.0.1\"\nport = {}\n", broker.port);
        format!("{hall}{door}[handover.hall]\ncalls = [\"door\"]\n{mqtt}")
    };
    fs::write(states[1].join("map.hall.door.json"), known(&hall, hall.view_size()).to_json()).unwrap();
    let [of_hall, mut of_door] = [0, 1].map(|shard: usize| {
        let environment = [("STATE_DIRECTORY", states[shard].as_path())];
        Program::start_in(&format!("shard-{shard}"), file, &["--shard", &format!("{shard}/2")], &environment)
    });
    let line = of_door.launch.wait_for_line("door: turns to target ");
    assert!(line.ends_with(" of hall"), "{line}");
    of_door.wait_for("/cameras", |cameras| cameras.contains("of hall)") && !cameras.contains("\"hall\""));
    assert!(door.status().pan_deg > 0.0, "{:?}", door.status());
    // Another process knows its own cameras only.
    let said = of_hall.end("TERM");
    assert!(!said.contains("door: "), "{said}");
    of_door.end("TERM");
    assert!(scene::rests(&door, door.now()).is_some(), "left turning: {:?}", door.commands().last());
    states.iter().for_each(|state| fs::remove_dir_all(state).unwrap());
}

#[test]
fn what_a_camera_looks_at_can_be_said_by_hand() {
    let [yard, door] = [0, 1].map(|_| VirtualCamera::start(scene::nobody()).unwrap());
    let file = |folder: &Path| yard_calls_door(&yard, &door, folder);
    let mut program = Program::start("point", file, &[]);
    program.launch.wait_for_line("door: the picture is there");
    let page = program.url().replace("http://", "").replace('/', "");
    let point = |to: &str, from: &str, place: &str| {
        let mut command = tool(plugin_folder().join("ptztrack").to_str().unwrap());
        let output = command.args(["point", to, from, place, "--http", &page]).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let (status, said) = point("door", "yard", "0.4,0.7");
    assert!(status == Some(0) && said == "sees 0.40,0.70 of yard at 0.50,0.50, as told by hand\n", "{said}");
    program.launch.wait_for_line("door: sees 0.40,0.70 of yard at 0.50,0.50, as told by hand");
    let (status, said) = point("yard", "door", "0.4,0.7");
    assert!(status == Some(1) && said.contains("door does not call it: [handover.door] says"), "{said}");
    program.launch.wait_for_line("yard: warning: door does not call it");
    let (status, said) = point("door", "gate", "0.4,0.7");
    assert!(status == Some(1) && said.contains("there is no camera `door` or no camera `gate`"), "{said}");
    assert_eq!(point("door", "yard", "4,7").0, Some(2));
    program.end("TERM");
    let (status, said) = point("door", "yard", "0.4,0.7");
    assert!(status == Some(1) && said.contains("no ptztrack has its page at"), "{said}");
}

/// A click in the picture of the one that calls, then one in that of the other.
#[test]
fn a_place_is_clicked_in_both_pictures() {
    let [yard, door] = [0, 1].map(|_| VirtualCamera::start(scene::nobody()).unwrap());
    let file = |folder: &Path| yard_calls_door(&yard, &door, folder);
    let mut program = Program::start("point-page", file, &[]);
    let mut browser = Browser::start("chromium-point");
    browser.open(&program.url());
    let of = |name: &str, part: &str| {
        format!("document.querySelector('[data-name={name}]')?.querySelector('{part}')")
    };
    for name in ["door", "yard"] {
        browser.wait_for(&format!("{}?.naturalWidth == 320", of(name, "img")));
    }
    let click = |browser: &mut Browser, name: &str, x: f64, y: f64| {
        let image = of(name, "img");
        browser.value(&format!(
            "{{ const r = {image}.getBoundingClientRect(); {image}.dispatchEvent(new MouseEvent('click', \
             {{ clientX: r.x + r.width * {x}, clientY: r.y + r.height * {y}, bubbles: true }})); }}"
        ));
    };
    browser.wait_for(&format!("{}.checkVisibility()", of("yard", ".pair")));
    let offered = browser.value(&format!("{}.checkVisibility()", of("door", ".pair")));
    assert_eq!(offered, false, "it calls nobody");
    browser.value(&format!("{}.click()", of("yard", ".pair")));
    click(&mut browser, "yard", 0.25, 0.75);
    browser.wait_for("pairing.innerText == 'Click the same place in the picture of door.'");
    browser.save_picture("ptztrack-page-pair.png");
    click(&mut browser, "door", 0.75, 0.5);
    browser.wait_for(
        "/^door sees 0.2\\d,0.7\\d of yard at 0.7\\d,0.\\d+, as told by hand/.test(pairing.innerText)",
    );
    program.launch.wait_for_line("as told by hand");
    program.end("TERM");
}

/// Two that turn look out of the same place at the same person; how the one's directions are the other one's is known.
#[test]
fn of_two_cameras_that_turn_one_follows_somebody_unless_both_are_to() {
    let mut map = Map::default();
    for n in 0..160 {
        let direction =
            Direction { pan_deg: f64::from(n % 16) * 3.0 - 20.0, tilt_deg: f64::from(n / 16) * 1.5 - 14.0 };
        map.learn(Pair { place: Place::towards(direction), direction, height_deg: Some(9.0), person: 1 });
    }
    for together in [false, true] {
        let (gate, door) = (somebody_aside(looking(10.0)), somebody_aside(looking(14.0)));
        let state = end_to_end::scratch(&format!("hand-over-two-{together}"));
        fs::create_dir_all(&state).unwrap();
        fs::write(state.join("map.gate.door.json"), map.to_json()).unwrap();
        let file = |folder: &Path| {
            let password = folder.join("password");
            let gate = Program::entry("gate", &gate.url(), &password);
            let door = Program::entry("door", &door.url(), &password);
            format!("{gate}{door}[handover.gate]\ncalls = [\"door\"]\ntogether = {together}\n")
        };
        let environment = [("STATE_DIRECTORY", state.as_path())];
        let mut program = Program::start_in(&format!("two-{together}"), file, &[], &environment);
        let both = |cameras: &str| !cameras.contains("\"target\":null");
        if together {
            program.wait_for("/cameras", both);
        } else {
            program.launch.wait_for_line("to another camera that follows them");
            program.wait_for("/cameras", |cameras| !both(cameras));
        }
        let output = program.end("TERM");
        assert_eq!(output.contains("to another camera"), !together, "{output}");
        fs::remove_dir_all(&state).unwrap();
    }
}
