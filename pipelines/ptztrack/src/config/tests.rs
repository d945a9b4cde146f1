// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use pipeline_supervisor::video::rtsp_host;

use super::*;
use session::http::{Authentication, Trust};

fn parse(text: &str) -> Result<Config, String> {
    gst::init().unwrap();
    Config::parse(text).map_err(|problems| problems.to_string())
}

#[test]
fn five_lines_are_enough() {
    let config =
        parse("[camera.door]\naddress = \"http://192.168.0.90/\"\nsize = \"640x480\"\nrate = 15\n").unwrap();
    let [door] = config.cameras.as_slice() else { panic!("{config:?}") };
    assert_eq!((door.name.as_str(), door.address.as_str()), ("door", "http://192.168.0.90"));
    assert_eq!((door.rtsp_server(554).as_str(), door.codec), ("rtsp://192.168.0.90:554", Codec::Mjpeg));
    assert_eq!((door.size, door.rate), (Some((640, 480)), Some(15)));
    assert_eq!(config.http, None);
}

#[test]
fn every_mistake_is_named_with_its_line_and_what_is_allowed() {
    let wrong = parse(
        "[http]\nlisten = \"everywhere\"\n[camera.door]\ncodec = \"vp9\"\nrate = 0\nsise = \"1x1\"\nuser = \"me\"\n\
         [camera.door.recording]\nfolder = \"/tmp\"\nsegment = \"10 apples\"\n",
    )
    .unwrap_err();
    let lines: Vec<&str> = wrong.lines().collect();
    for expected in [
        "line 2: `listen` must be an address and a port",
        "line 3: `address` is missing",
        "line 3: `user` needs one of `password-file`",
        "line 4: `codec` must be \"mjpeg\", \"mpeg4\", \"h264\" or \"h265\"",
        "line 5: `rate` must be pictures per second, a whole number from 1 to 60",
        "line 6: `sise` is not known here; there are: address, protocol, kind, rtsp, codec",
        "line 8: a recording needs `keep`",
        "line 10: `segment` must be a duration",
    ] {
        assert!(lines.iter().any(|line| line.starts_with(expected)), "{expected} is not in:\n{wrong}");
    }
    assert_eq!(lines.len(), 8, "{wrong}");
}

#[test]
fn what_is_no_toml_is_named_with_its_line() {
    let wrong = parse("[camera.door]\naddress = http://192.168.0.90\n").unwrap_err();
    assert!(wrong.starts_with("line 2: "), "{wrong}");
}

#[test]
fn a_password_does_not_belong_into_the_file() {
    let wrong =
        parse("[camera.a]\naddress = \"http://a\"\nuser = \"u\"\npassword = \"secret\"\n").unwrap_err();
    assert!(
        wrong.contains("line 4: a password does not belong in this file") && !wrong.contains("secret"),
        "{wrong}"
    );
}

#[test]
fn passwords_come_from_a_file_and_are_never_printed() {
    let file = std::env::temp_dir().join(format!("ptztrack-password-{}", std::process::id()));
    std::fs::write(&file, "xyzzy\n").unwrap();
    let text = format!("[camera.a]\naddress = \"http://a\"\nuser = \"u\"\npassword-file = {file:?}\n");
    let config = parse(&text);
    std::fs::remove_file(&file).unwrap();
    let config = config.unwrap();
    assert_eq!(config.cameras[0].credentials.as_ref().unwrap().password.reveal(), "xyzzy");
    assert!(!format!("{config:?}").contains("xyzzy"));
    // It may be there later: the other cameras do not wait for it.
    let wrong = parse(&text).unwrap().check_machine().unwrap_err();
    assert!(wrong.starts_with("camera `a`: no password: ") && wrong.contains("No such file"), "{wrong}");
}

/// A file that is not there.
fn missing() -> std::path::PathBuf {
    std::env::temp_dir().join(format!("ptztrack-missing-{}", std::process::id()))
}

/// All services, with their password there.
fn services(password: &Path) -> String {
    let who = format!("user = \"u\"\npassword-file = {password:?}\n");
    format!(
        "[http]\nlisten = \"0.0.0.0:9100\"\n{who}[mqtt]\nhost = \"broker\"\n{who}[restream]\nlisten = \"0.0.0.0:8554\"\n{who}\
         [camera.a]\naddress = \"http://a\"\n"
    )
}

#[test]
fn services_wait_for_what_they_cannot_read_and_the_check_names_it() {
    let config = parse(&services(&missing())).unwrap();
    assert_eq!(config.cameras.len(), 1);
    let tables: Vec<_> = config.waiting().into_iter().map(|(table, _)| table).collect();
    assert_eq!(tables, ["http", "mqtt", "restream"]);
    assert!(config.http.as_ref().unwrap().credentials.is_err(), "it would let everybody in");
    let wrong = config.check_machine().unwrap_err();
    for table in tables {
        let expected = format!("[{table}]: no password: {}: No such file", missing().display());
        assert!(wrong.lines().any(|line| line.starts_with(&expected)), "{expected} is not in:\n{wrong}");
    }
    // What is mistaken is so all the same.
    let wrong = parse(&services(&missing()).replace("host", "hots")).unwrap_err();
    assert!(wrong.contains("`host` is missing") && wrong.contains("`hots` is not known here"), "{wrong}");
}

#[test]
fn an_empty_password_lets_nobody_in() {
    let config = parse(&services(Path::new("/dev/null"))).unwrap();
    let empty = "no password: it is empty";
    assert_eq!(config.waiting(), [("http", empty), ("restream", empty)]);
}

#[test]
fn a_broker_waits_for_the_certificates_that_are_to_be_believed() {
    let file = missing();
    let text = format!(
        "[mqtt]\nhost = \"broker\"\ntls = true\nca-file = {file:?}\n[camera.a]\naddress = \"http://a\"\n"
    );
    let wrong = parse(&text).unwrap().check_machine().unwrap_err();
    assert!(wrong.starts_with("[mqtt]: ") && wrong.contains(file.to_str().unwrap()), "{wrong}");
}

#[test]
fn the_page_elsewhere_needs_the_same_password() {
    let elsewhere = Some("0.0.0.0:80".parse().unwrap());
    let config = parse(&services(&missing())).unwrap().with_page_at(elsewhere).unwrap();
    assert_eq!(config.waiting().len(), 3);
    assert_eq!(config.http.map(|http| http.listen), elsewhere);
    let camera = "[camera.a]\naddress = \"http://a\"\n";
    let wrong = parse(camera).unwrap().with_page_at(elsewhere).unwrap_err();
    assert!(wrong.starts_with("to listen on 0.0.0.0:80, beyond this machine"), "{wrong}");
}

#[test]
fn of_a_file_that_is_read_again_services_that_wait_count_and_others_stay() {
    let waits = parse(&services(&missing())).unwrap();
    let password = std::env::temp_dir().join(format!("ptztrack-again-{}", std::process::id()));
    std::fs::write(&password, "xyzzy\n").unwrap();
    let text = services(&password);
    let [runs, elsewhere] = [text.clone(), text.replace("\"broker\"", "\"other\"")].map(|text| parse(&text));
    std::fs::remove_file(&password).unwrap();
    let (runs, elsewhere) = (runs.unwrap(), elsewhere.unwrap());
    let bare = parse("[camera.a]\naddress = \"http://a\"\n").unwrap();
    let again = |read: &Config, current: &Config| Again::of(read.clone(), current);
    let nothing = |config: &Config| Again { config: config.clone(), needs_restart: false, lost: Vec::new() };

    assert_eq!(again(&waits, &waits), nothing(&waits));
    assert_eq!(again(&runs, &waits), nothing(&runs));
    assert_eq!(again(&bare, &waits), nothing(&bare));
    let Again { config, needs_restart, lost } = again(&waits, &runs);
    assert_eq!((config, needs_restart, lost.len()), (runs.clone(), false, 3));
    for (read, current) in [(&elsewhere, &runs), (&bare, &runs), (&runs, &bare), (&waits, &bare)] {
        let expected = Again { needs_restart: true, ..nothing(current) };
        assert_eq!(again(read, current), expected);
    }
}

#[test]
fn an_address_is_a_camera_and_nothing_more() {
    for (address, right) in [
        ("http://10.0.0.1:8080", true),
        ("https://[2001:db8::1]:443", true),
        ("http://me:secret@10.0.0.1", false),
        ("http://10.0.0.1/axis-cgi", false),
        ("10.0.0.1", false),
        ("http://", false),
    ] {
        assert_eq!(CameraSettings::at("a", Protocol::Vapix, address).is_ok(), right, "{address}");
    }
    for (address, right) in
        [("http://10.0.0.1:8899/onvif/device", true), ("http:///onvif", false), ("http://me@a/onvif", false)]
    {
        assert_eq!(CameraSettings::at("a", Protocol::Onvif, address).is_ok(), right, "{address}");
    }
}

#[test]
fn the_page_is_for_this_machine_unless_it_has_a_password() {
    let camera = "[camera.a]\naddress = \"http://a\"\n";
    let wrong = parse(&format!("[http]\nlisten = \"0.0.0.0:9100\"\n{camera}")).unwrap_err();
    assert!(wrong.starts_with("line 1: to listen on 0.0.0.0:9100, beyond this machine"), "{wrong}");
    assert_eq!(
        parse(&format!("[http]\n{camera}")).unwrap().http.unwrap().listen.to_string(),
        "127.0.0.1:9100"
    );
}

#[test]
fn a_broker_has_a_host_and_topics_without_wildcards() {
    let camera = "[camera.a]\naddress = \"http://a\"\n";
    let mqtt = parse(&format!("[mqtt]\nhost = \"broker\"\n{camera}")).unwrap().mqtt.unwrap().unwrap();
    assert_eq!(
        (mqtt.port, mqtt.topic.as_str(), mqtt.discovery.as_deref()),
        (1883, "ptztrack", Some("homeassistant"))
    );
    let wrong = parse(&format!("[mqtt]\nport = 70000\ntopic = \"a/#\"\n{camera}")).unwrap_err();
    for expected in [
        "line 1: `host` is missing",
        "line 2: `port` must be a port, a whole number from 1 to 65535",
        "line 3: `topic` must be the beginning of a topic",
    ] {
        assert!(wrong.contains(expected), "{expected} is not in:\n{wrong}");
    }
}

#[test]
fn streams_are_passed_on_within_this_machine_unless_there_is_a_password() {
    let camera = "[camera.a]\naddress = \"http://a\"\n";
    let restream = parse(&format!("[restream]\n{camera}")).unwrap().restream.unwrap().unwrap();
    assert_eq!((restream.listen.to_string().as_str(), restream.tls), ("127.0.0.1:8554", None));
    let wrong = "[restream]\nlisten = \"[::]:8554\"\ncertificate-file = \"/etc/a.pem\"\n";
    let wrong = parse(&format!("{wrong}{camera}")).unwrap_err();
    for expected in [
        "line 1: TLS needs both `certificate-file` and `key-file`",
        "line 1: to listen on [::]:8554, beyond this machine, it needs `user` and `password-file` in [restream]",
    ] {
        assert!(wrong.contains(expected), "{expected} is not in:\n{wrong}");
    }
}

#[test]
fn a_certificate_that_is_of_no_use_is_named_beforehand() {
    let tls = "certificate-file = \"/dev/null\"\nkey-file = \"/dev/null\"\n";
    let config = parse(&format!("[restream]\n{tls}[camera.a]\naddress = \"http://a\"\n")).unwrap();
    let wrong = config.check_machine().unwrap_err();
    assert!(wrong.starts_with("[restream]: no TLS by /dev/null and /dev/null: "), "{wrong}");
}

#[test]
fn a_recording_is_kept_for_so_long_or_so_much() {
    let recording =
        "[camera.a]\naddress = \"http://a\"\n[camera.a.recording]\nfolder = \"/r\"\nkeep-bytes = \"2GB\"\n";
    let recording = parse(recording).unwrap().cameras[0].recording.clone().unwrap();
    assert_eq!(recording.keep_bytes, Some(2_000_000_000));
    assert_eq!((recording.keep, recording.segment), (None, Duration::from_secs(600)));
}

#[test]
fn pictures_are_as_safe_as_control() {
    let camera = |text: &str| parse(&format!("[camera.a]\n{text}")).unwrap().cameras[0].clone();
    let (plain, secure) = (camera("address = \"http://a\""), camera("address = \"https://a:8443\""));
    assert_eq!(
        (plain.rtsp_server(554).as_str(), secure.rtsp_server(554).as_str()),
        ("rtsp://a:554", "rtsps://a:322")
    );
    assert_eq!(plain.security(), (Authentication::Auto, Trust::System));
    let told = camera("address = \"https://a\"\nauth = \"basic\"\nca-file = \"/ca.pem\"");
    assert_eq!(told.security(), (Authentication::Basic, Trust::Authority("/ca.pem".into())));
    let of_servo = camera("address = \"https://a\"\n[camera.a.vapixptzsink]\ninsecure = true");
    assert_eq!(of_servo.security(), (Authentication::Auto, Trust::Anyone));
    for (address, parts) in [
        ("rtsp://a", Some(("a", 554, false))),
        ("rtsps://[2001:db8::1]", Some(("[2001:db8::1]", 322, true))),
        ("rtsps://a:7", Some(("a", 7, true))),
        ("rtsp://a/path", None),
        ("http://a", None),
        ("rtsp://", None),
    ] {
        assert_eq!(
            rtsp_host(address),
            parts.map(|(host, port, tls)| (host.to_owned(), port, tls)),
            "{address}"
        );
    }
}

#[test]
fn cameras_by_onvif_have_no_mjpeg() {
    let camera =
        |more: &str| parse(&format!("[camera.a]\naddress = \"http://a\"\nprotocol = \"onvif\"\n{more}"));
    let config = camera("[camera.a.onvifptzsink]\nauth = \"basic\"\n").unwrap();
    let camera_a = &config.cameras[0];
    assert_eq!((camera_a.protocol, camera_a.codec), (Protocol::Onvif, Codec::H264));
    assert_eq!(camera_a.security().0, Authentication::Basic);
    assert_eq!(camera_a.rtsp_server(8554), "rtsp://a:8554");
    let wrong = camera("codec = \"mjpeg\"\nrate = 5\n").unwrap_err();
    assert!(wrong.contains("`codec` must be \"h264\"") && wrong.contains("`rate` is set on"), "{wrong}");
}

#[test]
fn a_source_that_tells_anybody_the_password_is_refused() {
    std::fs::write(std::env::temp_dir().join("ptztrack-soup-password"), "x").unwrap();
    let text = |more: &str, source: &str| {
        format!(
            "[camera.a]\naddress = \"http://a\"\nuser = \"u\"\npassword-file = {:?}\n{more}pipeline = \"{source} name=source ! fakesink\"\n",
            std::env::temp_dir().join("ptztrack-soup-password")
        )
    };
    let wrong = parse(&text("", "souphttpsrc")).unwrap_err();
    assert!(wrong.contains("`souphttpsrc` sends the password in clear"), "{wrong}");
    parse(&text("auth = \"basic\"\n", "souphttpsrc")).unwrap();
    parse(&text("", "appsrc")).unwrap();
}

/// A pipeline is tried by GStreamer itself.
#[test]
fn a_pipeline_of_ones_own_must_be_one() {
    let wrong =
        parse("[camera.a]\naddress = \"http://a\"\npipeline = \"fakesrc ! nosuchthing\"\n").unwrap_err();
    assert!(wrong.starts_with("line 3: `pipeline`: no element \"nosuchthing\""), "{wrong}");
    parse("[camera.a]\naddress = \"http://a\"\npipeline = \"fakesrc ! fakesink\"\n").unwrap();
}

#[test]
fn the_example_is_right() {
    parse(EXAMPLE).unwrap();
}

#[test]
fn a_zone_is_a_part_of_what_a_camera_sees() {
    let camera = "[camera.door]\naddress = \"http://a\"\n";
    let zone = |more: &str| parse(&format!("{camera}[zone.steps]\n{more}\n"));
    let config = zone("camera = \"door\"\npan = [170, -170.5]\ntilt = [-30, -5]").unwrap();
    let [steps] = config.zones.as_slice() else { panic!("{config:?}") };
    assert_eq!((steps.name.as_str(), steps.camera.as_str()), ("steps", "door"));
    assert_eq!((steps.area.pan_deg, steps.area.tilt_deg), ((170.0, -170.5), (-30.0, -5.0)));
    for (more, reason) in [
        ("camera = \"gate\"\npan = [0, 1]\ntilt = [0, 1]", "line 3: zone `steps`: there is no camera `gate`"),
        ("camera = \"door\"\ntilt = [0, 1]", "line 3: `pan` is missing: two angles in degrees"),
        ("camera = \"door\"\npan = [0, 1, 2]\ntilt = [0, 1]", "line 5: `pan` must be two angles in degrees"),
        ("camera = \"door\"\npan = [0, nan]\ntilt = [0, 1]", "line 5: `pan` must be two angles in degrees"),
        (
            "camera = \"door\"\npan = [0, 1]\ntilt = [1, 0]",
            "line 3: zone `steps`: `tilt` goes from the bottom",
        ),
    ] {
        let wrong = zone(more).unwrap_err();
        assert!(wrong.starts_with(reason), "{wrong}");
    }
}

#[test]
fn a_share_hands_over_to_others_where_one_of_two_cameras_is_not_in_it() {
    let cameras = "[camera.yard]\naddress = \"http://a\"\n[camera.door]\naddress = \"http://b\"\n[camera.hall]\naddress = \"http://c\"\n";
    let config = parse(&format!("{cameras}[handover.yard]\ncalls = [\"door\"]\n")).unwrap();
    for (share, does) in
        [(&["yard", "door"][..], false), (&["yard"], true), (&["door", "hall"], true), (&["hall"], false)]
    {
        let mut config = config.clone();
        config.cameras.retain(|camera| share.contains(&camera.name.as_str()));
        assert_eq!(config.hands_over_to_others(), does, "{share:?}");
    }
}

#[test]
fn cameras_that_hand_over_are_cameras_and_those_that_are_called_turn() {
    let cameras = "[camera.yard]\naddress = \"http://a\"\nkind = \"fixed\"\n[camera.door]\naddress = \"http://b\"\n[camera.hall]\naddress = \"http://c\"\n";
    let text = "[handover.yard]\ncalls = [\"door\"]\nprecedence = 3\n";
    let config = parse(&format!("{cameras}{text}")).unwrap();
    let [wish] = config.hand_over.as_slice() else { panic!("{config:?}") };
    assert_eq!(
        (wish.from.as_str(), wish.calls.as_slice(), wish.precedence),
        ("yard", &["door".to_owned()][..], 3)
    );
    let in_processes = cameras.replace("address", "isolation = \"process\"\naddress");
    let telling = |cameras: &str| {
        let config = parse(&format!("{cameras}{text}")).unwrap();
        config.cameras.into_iter().filter(|camera| camera.hands_over).map(|c| c.name).collect::<Vec<_>>()
    };
    assert_eq!(telling(&in_processes), ["door", "yard"]);
    assert!(telling(cameras).is_empty(), "they begin anew for nothing");
    for (table, reason) in [
        ("[handover.gate]\ncalls = [\"door\"]", "line 8: handover: there is no camera `gate`"),
        ("[handover.yard]\ncalls = [\"gate\"]", "line 8: handover: there is no camera `gate`"),
        ("[handover.yard]\ncalls = [\"yard\"]", "line 8: handover: `yard` is fixed, so it cannot be called"),
        ("[handover.door]\ncalls = [\"door\"]", "line 8: handover: `door` cannot call itself"),
        (
            "[handover.door]\ncalls = [\"hall\"]\nzones = [\"0,0 1,0 1,1\"]",
            "line 8: handover: `door` turns, so no zone",
        ),
        ("[handover.yard]\ncalls = [\"door\"]\ntogether = 1", "line 10: `together` must be true or false"),
        (
            "[handover.yard]\ncalls = [\"door\", \"door\"]",
            "line 8: handover: `yard` cannot call `door` twice",
        ),
        ("[handover.yard]\nzones = []", "line 8: `calls` is missing"),
        (
            "[handover.yard]\ncalls = [\"door\"]\nzones = [\"0,0\"]",
            "line 10: `zones` must be a list of polygons",
        ),
        (
            "[handover.yard]\ncalls = [\"door\"]\nprecedence = -1",
            "line 10: `precedence` must be a whole number",
        ),
    ] {
        let wrong = parse(&format!("{cameras}{table}\n")).unwrap_err();
        assert!(wrong.starts_with(reason), "{wrong}");
    }
}

#[test]
fn who_is_kept_changes_at_a_restart_and_touches_no_camera() {
    let cameras = "[camera.a]\naddress = \"http://a\"\n";
    let current = parse(cameras).unwrap();
    let read = parse(&format!("{cameras}[events]\npixelate-faces = true\n")).unwrap();
    let again = Again::of(read, &current);
    assert!(again.needs_restart);
    assert_eq!(again.config.cameras, current.cameras);
}

#[test]
fn a_table_that_would_have_no_effect_is_a_mistake() {
    let camera = |more: &str| parse(&format!("[camera.a]\naddress = \"http://a\"\n{more}"));
    let other = "protocol = \"onvif\"\n[camera.a.vapixptzsink]\ntilt-max = 5\n";
    let wrong = camera(other).unwrap_err();
    assert_eq!(
        wrong,
        "line 4: [camera.a.vapixptzsink] has no effect: the camera speaks ONVIF, so write onvifptzsink"
    );
    camera(&other.replace("vapix", "onvif")).unwrap();
    // In a pipeline of one's own there may be anything.
    camera(&format!("pipeline = \"fakesrc name=source ! fakesink\"\n{other}")).unwrap();
}

#[test]
fn a_range_goes_from_the_lower_end_to_the_upper() {
    let sink =
        |text: &str| parse(&format!("[camera.a]\naddress = \"http://a\"\n[camera.a.vapixptzsink]\n{text}"));
    let wrong = sink("pan-min = 10\npan-max = -10\n").unwrap_err();
    assert!(wrong.contains("`pan-min` is 10 and `pan-max` -10"), "{wrong}");
    sink("pan-min = -10\npan-max = 10\n").unwrap();
}

#[test]
fn a_duration_that_cannot_be_is_answered_with_its_unit_and_its_end() {
    let set = |element: &str, text: &str| {
        let text = format!("[camera.a]\naddress = \"http://a\"\n[camera.a.{element}]\n{text}\n");
        parse(&text).unwrap_err()
    };
    let wrong = set("vapixptzsink", "search-time = 3");
    assert!(wrong.contains("`search-time` cannot be 3 nanoseconds (write \"3s\" for seconds)"), "{wrong}");
    let wrong = set("lkfeaturetrack", "stationary-timeout = \"999d\"");
    assert!(wrong.contains("\"7d\", at most 86400s"), "{wrong}");
}

#[test]
fn a_wrong_address_is_told_in_its_own_line() {
    let wrong = parse("[camera.a]\ncodec = \"mjpeg\"\naddress = \"192.168.0.90\"\n").unwrap_err();
    assert!(wrong.starts_with("line 3: `192.168.0.90` is not an address"), "{wrong}");
}
