// SPDX-License-Identifier: MPL-2.0

//! The camera's ONVIF face, as a client sees it that knows SOAP only. Names of the ONVIF PTZ device test specification stand
//! beside what answers them.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use virtual_camera::{
    Auth, Kinematics, OnvifSettings, ProportionalSpeed, Quirk, Settings, SpeedMap, VirtualCamera,
};

const PATIENCE: Duration = Duration::from_secs(60);

fn camera(auth: Auth, quirks: &[Quirk]) -> VirtualCamera {
    let proportional_speed = ProportionalSpeed { enabled: false, ..Kinematics::default().proportional_speed };
    let speed_map = SpeedMap::Linear { max_deg_s: 20.0 };
    let kinematics = Kinematics { speed_map, proportional_speed, ..Kinematics::default() };
    let onvif = Some(OnvifSettings::with(quirks));
    VirtualCamera::start(Settings { auth, onvif, kinematics, ..Settings::default() }).unwrap()
}

/// Status line and body of the answer.
fn ask(camera: &VirtualCamera, service: &str, body: &str) -> String {
    let message = format!(
        "<s:Envelope xmlns:s='http://www.w3.org/2003/05/soap-envelope' xmlns:t='http://www.onvif.org/ver20/ptz/wsdl' xmlns:tt='http://www.onvif.org/ver10/schema'><s:Body>{body}</s:Body></s:Envelope>"
    );
    let mut stream = TcpStream::connect(camera.http_address()).unwrap();
    write!(
        stream,
        "POST /onvif/{service} HTTP/1.1\r\nHost: camera\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{message}",
        message.len()
    )
    .unwrap();
    let mut answer = String::new();
    // A camera that closes the connection may do so by a reset.
    let _ = stream.read_to_string(&mut answer);
    answer
}

fn move_right(camera: &VirtualCamera, timeout: &str) -> String {
    let body = format!(
        "<t:ContinuousMove><t:ProfileToken>profile_1</t:ProfileToken><t:Velocity><tt:PanTilt x='0.5' y='0'/></t:Velocity>{timeout}</t:ContinuousMove>"
    );
    ask(camera, "ptz_service", &body)
}

const STOP: &str = "<t:Stop><t:ProfileToken>profile_1</t:ProfileToken></t:Stop>";

fn options(camera: &VirtualCamera) -> String {
    let body = "<t:GetConfigurationOptions><t:ConfigurationToken>ptz_1</t:ConfigurationToken></t:GetConfigurationOptions>";
    ask(camera, "ptz_service", body)
}

/// PTZ-2-1-3
#[test]
fn it_tells_its_spaces_and_how_long_moves_may_last() {
    let options = options(&camera(Auth::None, &[]));
    assert!(options.contains("<tt:Spaces><tt:"), "{options}");
    assert!(options.contains("<tt:Min>PT1S</tt:Min><tt:Max>PT10M</tt:Max></tt:PTZTimeout>"), "{options}");
}

/// PTZ-7-3-3 and PTZ-7-3-4
#[test]
fn it_moves_at_both_ends_of_the_generic_velocities() {
    for (space, axis) in [("PanTiltSpaces", "PanTilt x='{}' y='{}'"), ("ZoomSpaces", "Zoom x='{}'")] {
        let camera = camera(Auth::None, &[]);
        let uri = format!("http://www.onvif.org/ver10/tptz/{space}/VelocityGenericSpace");
        assert!(options(&camera).contains(&uri), "{uri}");
        for end in ["1", "-1"] {
            let axis = axis.replace("{}", end);
            let body = format!(
                "<t:ContinuousMove><t:ProfileToken>profile_1</t:ProfileToken><t:Velocity><tt:{axis} space='{uri}'/></t:Velocity></t:ContinuousMove>"
            );
            let answer = ask(&camera, "ptz_service", &body);
            assert!(answer.contains("ContinuousMoveResponse"), "{axis}: {answer}");
            assert!(camera.wait_for(PATIENCE, |status| status.moving), "{axis}");
        }
    }
}

/// PTZ-8-1-1
#[test]
fn it_tells_what_its_ptz_service_is_capable_of() {
    let answer = ask(&camera(Auth::None, &[]), "ptz_service", "<t:GetServiceCapabilities/>");
    assert!(answer.contains("MoveStatus=\"true\" StatusPosition=\"true\""), "{answer}");
}

/// PTZ-3-1-4
#[test]
fn a_move_with_a_timeout_ends_by_itself() {
    let camera = camera(Auth::None, &[]);
    assert!(move_right(&camera, "<t:Timeout>PT1S</t:Timeout>").contains("ContinuousMoveResponse"));
    assert!(camera.wait_for(PATIENCE, |status| status.pan_rate_deg_s > 0.0));
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

/// PTZ-3-1-5
#[test]
fn a_move_without_one_ends_by_stop() {
    let camera = camera(Auth::None, &[]);
    move_right(&camera, "");
    assert!(camera.wait_for(PATIENCE, |status| status.pan_deg > 1.0));
    assert!(ask(&camera, "ptz_service", STOP).contains("StopResponse"));
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    let status =
        ask(&camera, "ptz_service", "<t:GetStatus><t:ProfileToken>profile_1</t:ProfileToken></t:GetStatus>");
    assert!(status.contains(">IDLE<"), "{status}");
}

#[test]
fn who_says_nothing_of_themselves_learns_the_time_only() {
    let camera = camera(Auth::Digest { qop: true }, &[]);
    let body = "<d:GetSystemDateAndTime xmlns:d='http://www.onvif.org/ver10/device/wsdl'/>";
    assert!(ask(&camera, "device_service", body).contains("UTCDateTime"));
    assert!(move_right(&camera, "").starts_with("HTTP/1.1 401"));
    assert_eq!(camera.commands().len(), 0);
}

#[test]
fn quirks_are_what_they_say() {
    let refused = |quirk| move_right(&camera(Auth::None, &[quirk]), "<t:Timeout>PT20S</t:Timeout>");
    assert!(refused(Quirk::TimeoutRefused).contains("TimeoutNotSupported"));
    assert!(refused(Quirk::TimeoutTen).contains("TimeoutNotSupported"));
    assert!(refused(Quirk::Prefixes).contains("ns3:ContinuousMoveResponse"));
    let stopped = |quirk| ask(&camera(Auth::None, &[quirk]), "ptz_service", STOP);
    assert!(stopped(Quirk::StopMissing).contains("ActionNotSupported"));
    assert_eq!(stopped(Quirk::StopCloses), "");
}

/// `UPDATE_QUIRKS=1 cargo test -p virtual-camera --test onvif` writes the table anew.
#[test]
fn the_documentation_lists_the_quirks() {
    const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/onvif.md");
    let (begin, end) = ("<!-- quirks -->\n", "<!-- end of quirks -->\n");
    let text = std::fs::read_to_string(FILE).unwrap();
    let (before, rest) = text.split_once(begin).unwrap();
    let (_, after) = rest.split_once(end).unwrap();
    let wanted = format!("{before}{begin}{}{end}{after}", virtual_camera::quirk_table());
    if std::env::var_os("UPDATE_QUIRKS").is_some() {
        std::fs::write(FILE, &wanted).unwrap();
    }
    assert_eq!(std::fs::read_to_string(FILE).unwrap(), wanted);
}
