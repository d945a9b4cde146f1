// SPDX-License-Identifier: MPL-2.0

//! What is answered to whom.

use std::fmt::Write;
use std::time::Duration;

use roxmltree::Node;

use super::message::{child, number};
use super::{DEVICE_SERVICE, MEDIA_SERVICE, MEDIA2_SERVICE, OnvifSettings, PTZ_SERVICE, Quirk};
use crate::camera::Camera;
use crate::kinematics::{Limits, Motion, ZOOM_RANGE};

const PTZ_NAMESPACE: &str = "http://www.onvif.org/ver20/ptz/wsdl";
const GENERIC_POSITION: &str = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/PositionGenericSpace";
const DEGREES: &str = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/SphericalPositionSpaceDegrees";
const DEGREES_S: &str = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/VelocitySpaceDegrees";
const FIELDS_S: &str = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/VelocitySpaceFOV";
const ZOOM_POSITION: &str = "http://www.onvif.org/ver10/tptz/ZoomSpaces/PositionGenericSpace";

/// Why something is not done.
pub(crate) enum Refusal {
    /// A fault of this code and reason.
    Fault(&'static str, String),
    /// The connection is closed.
    Closed,
    /// The move was made, and the answer is no HTTP.
    Garbled,
}

type Answer = Result<String, Refusal>;

fn refused(code: &'static str, reason: impl Into<String>) -> Answer {
    Err(Refusal::Fault(code, reason.into()))
}

/// The body of the answer to what a message asks; `host` is what the client calls the camera.
pub(crate) fn answer(camera: &Camera, onvif: &OnvifSettings, request: Node, host: &str) -> Answer {
    let name = request.tag_name().name();
    let known_profile = || {
        let token = child(request, "ProfileToken").and_then(|token| token.text()).unwrap_or_default();
        match token.trim() {
            token if has_ptz(onvif, token) => Ok(()),
            "profile_1" | "profile_2" | "profile_3" => {
                Err(Refusal::Fault("NoPTZProfile", "no PTZ in this profile".into()))
            }
            _ => Err(Refusal::Fault("NoProfile", "no such profile".into())),
        }
    };
    match name {
        "GetSystemDateAndTime" => Ok(date_and_time(onvif)),
        "GetServices" if onvif.has(Quirk::NoServices) => refused("ActionNotSupported", "GetServices"),
        "GetServices" => Ok(services(host)),
        "GetCapabilities" => Ok(capabilities(host)),
        "GetDeviceInformation" => Ok(
            "<tds:GetDeviceInformationResponse><tds:Manufacturer>ptztrack</tds:Manufacturer><tds:Model>virtual camera</tds:Model><tds:FirmwareVersion>1</tds:FirmwareVersion><tds:SerialNumber>1</tds:SerialNumber><tds:HardwareId>1</tds:HardwareId></tds:GetDeviceInformationResponse>".into(),
        ),
        "GetProfiles" if is_media2(request) => Ok(profiles2(camera, onvif)),
        "GetProfiles" => Ok(profiles(camera, onvif)),
        "GetStreamUri" => stream_uri(camera, request, host),
        "GetConfigurationOptions" if onvif.has(Quirk::NoOptions) => {
            Ok("<tptz:GetConfigurationOptionsResponse><tptz:PTZConfigurationOptions><tt:Spaces/></tptz:PTZConfigurationOptions></tptz:GetConfigurationOptionsResponse>".into())
        }
        "GetConfigurationOptions" => Ok(options(onvif, &camera.limits())),
        "GetServiceCapabilities" if request.tag_name().namespace() == Some(PTZ_NAMESPACE) => {
            Ok("<tptz:GetServiceCapabilitiesResponse><tptz:Capabilities EFlip=\"false\" Reverse=\"false\" MoveStatus=\"true\" StatusPosition=\"true\"/></tptz:GetServiceCapabilitiesResponse>".into())
        }
        "GetStatus" => known_profile().map(|()| status(camera, onvif)),
        "GetPresets" => known_profile().map(|()| presets(camera)),
        "ContinuousMove" => known_profile().and_then(|()| continuous_move(camera, onvif, request)),
        "Stop" => known_profile().and_then(|()| stop(camera, onvif, request)),
        "AbsoluteMove" => known_profile().and_then(|()| absolute_move(camera, request)),
        "RelativeMove" if onvif.has(Quirk::RelativeIdle) => Ok("<tptz:RelativeMoveResponse/>".into()),
        "GotoPreset" => known_profile().and_then(|()| goto_preset(camera, request)),
        _ => refused("ActionNotSupported", format!("{name} is not supported")),
    }
}

/// The camera's clock.
pub(crate) fn clock(onvif: &OnvifSettings) -> chrono::DateTime<chrono::Utc> {
    let hour = chrono::TimeDelta::hours(1);
    let now = chrono::Utc::now();
    match () {
        () if onvif.has(Quirk::ClockAhead) => now + hour,
        () if onvif.has(Quirk::ClockBehind) => now - hour,
        () => now,
    }
}

fn date_and_time(onvif: &OnvifSettings) -> String {
    let time = clock(onvif).format(
        "<tt:Time><tt:Hour>%-H</tt:Hour><tt:Minute>%-M</tt:Minute><tt:Second>%-S</tt:Second></tt:Time><tt:Date><tt:Year>%Y</tt:Year><tt:Month>%-m</tt:Month><tt:Day>%-d</tt:Day></tt:Date>",
    );
    format!(
        "<tds:GetSystemDateAndTimeResponse><tds:SystemDateAndTime><tt:DateTimeType>NTP</tt:DateTimeType><tt:DaylightSavings>false</tt:DaylightSavings><tt:UTCDateTime>{time}</tt:UTCDateTime></tds:SystemDateAndTime></tds:GetSystemDateAndTimeResponse>"
    )
}

fn services(host: &str) -> String {
    let all = [
        ("http://www.onvif.org/ver10/device/wsdl", DEVICE_SERVICE),
        ("http://www.onvif.org/ver10/media/wsdl", MEDIA_SERVICE),
        ("http://www.onvif.org/ver20/media/wsdl", MEDIA2_SERVICE),
        (PTZ_NAMESPACE, PTZ_SERVICE),
    ];
    let mut text = String::new();
    for (namespace, path) in all {
        let _ = write!(
            text,
            "<tds:Service><tds:Namespace>{namespace}</tds:Namespace><tds:XAddr>http://{host}{path}</tds:XAddr><tds:Version><tt:Major>2</tt:Major><tt:Minor>60</tt:Minor></tds:Version></tds:Service>"
        );
    }
    format!("<tds:GetServicesResponse>{text}</tds:GetServicesResponse>")
}

fn capabilities(host: &str) -> String {
    format!(
        "<tds:GetCapabilitiesResponse><tds:Capabilities><tt:Device><tt:XAddr>http://{host}{DEVICE_SERVICE}</tt:XAddr></tt:Device><tt:Media><tt:XAddr>http://{host}{MEDIA_SERVICE}</tt:XAddr><tt:StreamingCapabilities/></tt:Media><tt:PTZ><tt:XAddr>http://{host}{PTZ_SERVICE}</tt:XAddr></tt:PTZ></tds:Capabilities></tds:GetCapabilitiesResponse>"
    )
}

/// The streams of its profiles: how each is encoded, by `videocodec` of VAPIX, and its width and height.
fn streams(camera: &Camera) -> [(&'static str, &'static str, (u32, u32)); 3] {
    let (width, height) = camera.view_size();
    let half = (width / 4 * 2, height / 4 * 2);
    [("profile_1", "h264", (width, height)), ("profile_2", "mpeg4", half), ("profile_3", "h265", half)]
}

fn encoder(name: &str, encoding: &str, (width, height): (u32, u32)) -> String {
    format!(
        "<{name} token=\"{encoding}\"><tt:Name>{encoding}</tt:Name><tt:UseCount>1</tt:UseCount><tt:Encoding>{encoding}</tt:Encoding><tt:Resolution><tt:Width>{width}</tt:Width><tt:Height>{height}</tt:Height></tt:Resolution><tt:Quality>5</tt:Quality>"
    )
}

fn is_media2(request: Node) -> bool {
    request.tag_name().namespace() == Some("http://www.onvif.org/ver20/media/wsdl")
}

/// What a PTZ configuration consists of.
const PTZ_CONFIGURATION: &str =
    "<tt:Name>ptz</tt:Name><tt:UseCount>1</tt:UseCount><tt:NodeToken>node_1</tt:NodeToken>";

fn has_ptz(onvif: &OnvifSettings, token: &str) -> bool {
    token == if onvif.has(Quirk::SecondProfile) { "profile_2" } else { "profile_1" }
}

/// By Media 2, which knows H.265.
fn profiles2(camera: &Camera, onvif: &OnvifSettings) -> String {
    let profiles = streams(camera).map(|(token, codec, size)| {
        let encoding = match codec {
            "h264" => "H264",
            "h265" => "H265",
            _ => "MPV4-ES",
        };
        let encoder = encoder("tr2:VideoEncoder", encoding, size);
        let ptz = if has_ptz(onvif, token) {
            format!("<tr2:PTZ token=\"ptz_1\">{PTZ_CONFIGURATION}</tr2:PTZ>")
        } else {
            String::new()
        };
        format!(
            "<tr2:Profiles token=\"{token}\" fixed=\"true\"><tr2:Name>{token}</tr2:Name><tr2:Configurations>{encoder}</tr2:VideoEncoder>{ptz}</tr2:Configurations></tr2:Profiles>"
        )
    });
    format!("<tr2:GetProfilesResponse>{}</tr2:GetProfilesResponse>", profiles.concat())
}

fn stream_uri(camera: &Camera, request: Node, host: &str) -> Answer {
    let token = child(request, "ProfileToken").and_then(|token| token.text()).unwrap_or_default().trim();
    let Some((_, codec, (width, height))) = streams(camera).into_iter().find(|(name, ..)| *name == token)
    else {
        return refused("NoProfile", "no such profile");
    };
    let host = host.rsplit_once(':').map_or(host, |(host, _)| host);
    let port = camera.rtsp_port();
    let uri = format!(
        "rtsp://{host}:{port}/axis-media/media.amp?videocodec={codec}&amp;resolution={width}x{height}"
    );
    Ok(if is_media2(request) {
        format!("<tr2:GetStreamUriResponse><tr2:Uri>{uri}</tr2:Uri></tr2:GetStreamUriResponse>")
    } else {
        format!(
            "<trt:GetStreamUriResponse><trt:MediaUri><tt:Uri>{uri}</tt:Uri><tt:InvalidAfterConnect>false</tt:InvalidAfterConnect><tt:InvalidAfterReboot>false</tt:InvalidAfterReboot><tt:Timeout>PT0S</tt:Timeout></trt:MediaUri></trt:GetStreamUriResponse>"
        )
    })
}

fn profiles(camera: &Camera, onvif: &OnvifSettings) -> String {
    let streams = streams(camera);
    let ptz = format!("<tt:PTZConfiguration token=\"ptz_1\">{PTZ_CONFIGURATION}</tt:PTZConfiguration>");
    let profile = |number: u32, encoding: &str, size: (u32, u32)| {
        let ptz = if has_ptz(onvif, &format!("profile_{number}")) { ptz.as_str() } else { "" };
        let encoder = encoder("tt:VideoEncoderConfiguration", encoding, size);
        format!(
            "<trt:Profiles token=\"profile_{number}\" fixed=\"true\"><tt:Name>Profile {number}</tt:Name>{encoder}<tt:Multicast><tt:Address><tt:Type>IPv4</tt:Type><tt:IPv4Address>0.0.0.0</tt:IPv4Address></tt:Address><tt:Port>0</tt:Port><tt:TTL>1</tt:TTL><tt:AutoStart>false</tt:AutoStart></tt:Multicast><tt:SessionTimeout>PT60S</tt:SessionTimeout></tt:VideoEncoderConfiguration>{ptz}</trt:Profiles>"
        )
    };
    let (first, second) = (profile(1, "H264", streams[0].2), profile(2, "MPEG4", streams[1].2));
    format!("<trt:GetProfilesResponse>{first}{second}</trt:GetProfilesResponse>")
}

fn options(onvif: &OnvifSettings, limits: &Limits) -> String {
    let range = |name: &str, (min, max): (f64, f64)| {
        format!("<tt:{name}><tt:Min>{min}</tt:Min><tt:Max>{max}</tt:Max></tt:{name}>")
    };
    let one = (-1.0, 1.0);
    let plane = |kind: &str, uri: &str, x, y| {
        format!("<tt:{kind}><tt:URI>{uri}</tt:URI>{}{}</tt:{kind}>", range("XRange", x), range("YRange", y))
    };
    let line = |kind: &str, uri: &str, x| {
        format!("<tt:{kind}><tt:URI>{uri}</tt:URI>{}</tt:{kind}>", range("XRange", x))
    };
    let mut spaces = plane("AbsolutePanTiltPositionSpace", GENERIC_POSITION, one, one);
    if onvif.degrees {
        spaces += &plane("AbsolutePanTiltPositionSpace", DEGREES, limits.pan_deg, limits.tilt_deg);
    }
    spaces += &line("AbsoluteZoomPositionSpace", ZOOM_POSITION, (0.0, 1.0));
    if onvif.has(Quirk::RelativeIdle) {
        let uri = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/TranslationSpaceFov";
        spaces += &plane("RelativePanTiltTranslationSpace", uri, one, one);
    }
    let uri = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/VelocityGenericSpace";
    spaces += &plane("ContinuousPanTiltVelocitySpace", uri, one, one);
    if let Some(most) = onvif.degrees_s {
        spaces += &plane("ContinuousPanTiltVelocitySpace", DEGREES_S, (-most, most), (-most, most));
    }
    if let Some(most) = onvif.fields_s {
        spaces += &plane("ContinuousPanTiltVelocitySpace", FIELDS_S, (-most, most), (-most, most));
    }
    spaces += &line(
        "ContinuousZoomVelocitySpace",
        "http://www.onvif.org/ver10/tptz/ZoomSpaces/VelocityGenericSpace",
        one,
    );
    let longest = if onvif.has(Quirk::TimeoutTen) { "PT10S" } else { "PT10M" };
    format!(
        "<tptz:GetConfigurationOptionsResponse><tptz:PTZConfigurationOptions><tt:Spaces>{spaces}</tt:Spaces><tt:PTZTimeout><tt:Min>PT1S</tt:Min><tt:Max>{longest}</tt:Max></tt:PTZTimeout></tptz:PTZConfigurationOptions></tptz:GetConfigurationOptionsResponse>"
    )
}

fn status(camera: &Camera, onvif: &OnvifSettings) -> String {
    let status = camera.status();
    let limits = camera.limits();
    let scaled = |value: f64, (min, max): (f64, f64)| -1.0 + 2.0 * (value - min) / (max - min);
    let (x, y) = (scaled(status.pan_deg, limits.pan_deg), scaled(status.tilt_deg, limits.tilt_deg));
    let zoom = (status.zoom_step - ZOOM_RANGE.0) / (ZOOM_RANGE.1 - ZOOM_RANGE.0);
    let moves = if status.moving && !onvif.has(Quirk::StatusIdle) { "MOVING" } else { "IDLE" };
    let now = clock(onvif).format("%Y-%m-%dT%H:%M:%SZ");
    format!(
        "<tptz:GetStatusResponse><tptz:PTZStatus><tt:Position><tt:PanTilt x=\"{x:.5}\" y=\"{y:.5}\" space=\"{GENERIC_POSITION}\"/><tt:Zoom x=\"{zoom:.5}\" space=\"{ZOOM_POSITION}\"/></tt:Position><tt:MoveStatus><tt:PanTilt>{moves}</tt:PanTilt><tt:Zoom>{moves}</tt:Zoom></tt:MoveStatus><tt:UtcTime>{now}</tt:UtcTime></tptz:PTZStatus></tptz:GetStatusResponse>"
    )
}

fn presets(camera: &Camera) -> String {
    let mut text = String::new();
    for (number, (name, _)) in (1..).zip(camera.presets()) {
        let _ =
            write!(text, "<tptz:Preset token=\"preset_{number}\"><tt:Name>{name}</tt:Name></tptz:Preset>");
    }
    format!("<tptz:GetPresetsResponse>{text}</tptz:GetPresetsResponse>")
}

fn continuous_move(camera: &Camera, onvif: &OnvifSettings, request: Node) -> Answer {
    let timeout = match child(request, "Timeout").and_then(|timeout| timeout.text()) {
        None => None,
        Some(_) if onvif.has(Quirk::TimeoutRefused) => {
            return refused("TimeoutNotSupported", "no timeout is supported");
        }
        Some(text) => match seconds(text.trim()) {
            Some(seconds) if !onvif.has(Quirk::TimeoutTen) || (1.0..=10.0).contains(&seconds) => {
                Some(seconds)
            }
            _ => return refused("TimeoutNotSupported", "1 to 10 s"),
        },
    };
    let Some(velocity) = child(request, "Velocity") else { return refused("InvalidVelocity", "no velocity") };
    let stepped = |speed: f64| {
        let steps = 7.0;
        if onvif.has(Quirk::SevenSpeeds) { (speed * steps).round() / steps } else { speed }
    };
    let sign = |quirk| if onvif.has(quirk) { -1.0 } else { 1.0 };
    let mut motions = Vec::new();
    if let Some(axes) = child(velocity, "PanTilt") {
        let (Some(x), Some(y)) = (number(axes, "x"), number(axes, "y")) else {
            return refused("InvalidVelocity", "pan and tilt");
        };
        let space = axes.attribute("space");
        let fastest = match space {
            Some(DEGREES_S) => onvif.degrees_s,
            Some(FIELDS_S) => onvif.fields_s,
            _ => None,
        };
        if fastest.is_some() && onvif.refuses_units {
            return refused("SpaceNotSupported", "generic velocities only");
        }
        let optics = camera.world.optics();
        let narrowed = match space {
            Some(FIELDS_S) => optics.fov_deg(camera.status().zoom_step) / optics.fov_deg(ZOOM_RANGE.0),
            _ => 1.0,
        };
        let fastest = fastest.unwrap_or(1.0);
        let (x, y) = (x / fastest * narrowed, y / fastest * narrowed);
        if x.abs() > 1.0 || y.abs() > 1.0 {
            return refused("InvalidVelocity", "beyond -1 to 1");
        }
        let (x, y) = if onvif.has(Quirk::AxesExchanged) { (y, x) } else { (x, y) };
        let (x, y) = (x * sign(Quirk::PanMirrored), y * sign(Quirk::TiltMirrored));
        motions.push(Motion::PanTilt { pan: stepped(x) * 100.0, tilt: stepped(y) * 100.0 });
    }
    let zoom = child(velocity, "Zoom").and_then(|zoom| number(zoom, "x"));
    let lens = |zoom: f64| match sign(Quirk::ZoomReversed) * zoom.clamp(-1.0, 1.0) {
        zoom if zoom != 0.0 && onvif.has(Quirk::ZoomOneSpeed) => Quirk::ONE_SPEED.copysign(zoom),
        zoom => zoom,
    };
    motions.extend(zoom.map(|zoom| Motion::Zoom(lens(zoom) * 100.0)));
    let lasts = timeout.filter(|_| !onvif.has(Quirk::TimeoutIgnored)).map(Duration::from_secs_f64);
    camera.drive(&motions, lasts);
    if onvif.has(Quirk::ZoomBreaks) && zoom.is_some_and(|zoom| zoom != 0.0) {
        return Err(Refusal::Garbled);
    }
    Ok("<tptz:ContinuousMoveResponse/>".into())
}

fn stop(camera: &Camera, onvif: &OnvifSettings, request: Node) -> Answer {
    if onvif.has(Quirk::StopMissing) {
        return refused("ActionNotSupported", "Stop is not supported");
    }
    if onvif.has(Quirk::StopCloses) {
        return Err(Refusal::Closed);
    }
    if !onvif.has(Quirk::StopIgnored) {
        let flag =
            |name: &str| child(request, name).and_then(|flag| flag.text()).map(|text| text.trim() == "true");
        let zoom = flag("Zoom").unwrap_or(!onvif.has(Quirk::StopPanTilt));
        let stops = [(flag("PanTilt").unwrap_or(true), Motion::Stop), (zoom, Motion::Zoom(0.0))];
        let motions: Vec<_> = stops.into_iter().filter(|(wanted, _)| *wanted).map(|(_, stop)| stop).collect();
        camera.drive(&motions, None);
    }
    Ok("<tptz:StopResponse/>".into())
}

fn absolute_move(camera: &Camera, request: Node) -> Answer {
    let Some(position) = child(request, "Position") else { return refused("InvalidPosition", "no position") };
    let limits = camera.limits();
    let within = |value: f64, (min, max): (f64, f64)| min + (value + 1.0) / 2.0 * (max - min);
    let place = child(position, "PanTilt").and_then(|axes| {
        let (x, y) = (number(axes, "x")?, number(axes, "y")?);
        let degrees = axes.attribute("space") == Some(DEGREES);
        Some(if degrees { (x, y) } else { (within(x, limits.pan_deg), within(y, limits.tilt_deg)) })
    });
    let zoom = child(position, "Zoom").and_then(|zoom| number(zoom, "x"));
    let motion = Motion::Absolute {
        pan_deg: place.map(|(pan, _)| pan),
        tilt_deg: place.map(|(_, tilt)| tilt),
        zoom_step: zoom.map(|zoom| ZOOM_RANGE.0 + zoom * (ZOOM_RANGE.1 - ZOOM_RANGE.0)),
    };
    camera.drive(&[motion], None);
    Ok("<tptz:AbsoluteMoveResponse/>".into())
}

fn goto_preset(camera: &Camera, request: Node) -> Answer {
    let token = child(request, "PresetToken").and_then(|token| token.text()).unwrap_or_default();
    let number = token.trim().strip_prefix("preset_").and_then(|number| number.parse::<usize>().ok());
    let presets = camera.presets();
    let Some((_, pose)) = number.and_then(|number| presets.get(number.checked_sub(1)?)) else {
        return refused("NoToken", "no such preset");
    };
    let motion = Motion::Absolute {
        pan_deg: Some(pose.pan_deg),
        tilt_deg: Some(pose.tilt_deg),
        zoom_step: Some(pose.zoom_step),
    };
    camera.drive(&[motion], None);
    Ok("<tptz:GotoPresetResponse/>".into())
}

/// Seconds and minutes are enough here.
fn seconds(duration: &str) -> Option<f64> {
    let rest = duration.strip_prefix("PT")?;
    let (minutes, rest) =
        rest.split_once('M').map_or((0.0, rest), |(m, rest)| (m.parse().unwrap_or(f64::NAN), rest));
    let seconds = rest.strip_suffix('S').map_or(Some(0.0), |seconds| seconds.parse::<f64>().ok())?;
    Some(minutes * 60.0 + seconds).filter(|seconds| (0.0..=86_400.0).contains(seconds))
}
