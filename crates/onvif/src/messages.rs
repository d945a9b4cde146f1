// SPDX-License-Identifier: MPL-2.0

//! What a camera is told, without the envelope.

use std::fmt::Write;
use std::time::Duration;

use crate::abilities::Velocity;
use crate::soap::escaped;

pub const GET_SYSTEM_DATE_AND_TIME: &str = "<tds:GetSystemDateAndTime/>";
pub const GET_SERVICES: &str =
    "<tds:GetServices><tds:IncludeCapability>false</tds:IncludeCapability></tds:GetServices>";
pub const GET_CAPABILITIES: &str =
    "<tds:GetCapabilities><tds:Category>All</tds:Category></tds:GetCapabilities>";
pub const GET_PROFILES: &str = "<trt:GetProfiles/>";
pub const GET_PROFILES_2: &str = "<tr2:GetProfiles><tr2:Type>VideoEncoder</tr2:Type></tr2:GetProfiles>";

/// Where the stream of a profile is, by the service Media.
pub fn get_stream_uri(profile: &str) -> String {
    format!(
        "<trt:GetStreamUri><trt:StreamSetup><tt:Stream>RTP-Unicast</tt:Stream><tt:Transport><tt:Protocol>RTSP</tt:Protocol></tt:Transport></trt:StreamSetup><trt:ProfileToken>{}</trt:ProfileToken></trt:GetStreamUri>",
        escaped(profile)
    )
}

/// The same, by the service Media 2.
pub fn get_stream_uri_2(profile: &str) -> String {
    format!(
        "<tr2:GetStreamUri><tr2:Protocol>RTSP</tr2:Protocol><tr2:ProfileToken>{}</tr2:ProfileToken></tr2:GetStreamUri>",
        escaped(profile)
    )
}

/// Which spaces, limits and timeouts a PTZ configuration has.
pub fn get_configuration_options(configuration: &str) -> String {
    format!(
        "<tptz:GetConfigurationOptions><tptz:ConfigurationToken>{}</tptz:ConfigurationToken></tptz:GetConfigurationOptions>",
        escaped(configuration)
    )
}

/// Where the camera looks.
pub fn get_status(profile: &str) -> String {
    format!("<tptz:GetStatus>{}</tptz:GetStatus>", profile_token(profile))
}

/// Which presets it has.
pub fn get_presets(profile: &str) -> String {
    format!("<tptz:GetPresets>{}</tptz:GetPresets>", profile_token(profile))
}

/// Move at this velocity, for so long; an axis that is left out is left alone.
pub fn continuous_move(profile: &str, velocity: &Velocity, timeout: Option<Duration>) -> String {
    let mut axes = String::new();
    if let Some((x, y)) = velocity.pan_tilt {
        let space = velocity
            .space
            .as_deref()
            .map_or_else(String::new, |space| format!(" space=\"{}\"", escaped(space)));
        let _ = write!(axes, "<tt:PanTilt x=\"{x:.6}\" y=\"{y:.6}\"{space}/>");
    }
    if let Some(zoom) = velocity.zoom {
        let _ = write!(axes, "<tt:Zoom x=\"{zoom:.6}\"/>");
    }
    let timeout = timeout.map_or_else(String::new, |timeout| {
        format!("<tptz:Timeout>PT{}S</tptz:Timeout>", timeout.as_secs_f64())
    });
    format!(
        "<tptz:ContinuousMove>{}<tptz:Velocity>{axes}</tptz:Velocity>{timeout}</tptz:ContinuousMove>",
        profile_token(profile)
    )
}

/// Stop all axes, by name: without the names some cameras stop pan and tilt only.
pub fn stop(profile: &str) -> String {
    format!(
        "<tptz:Stop>{}<tptz:PanTilt>true</tptz:PanTilt><tptz:Zoom>true</tptz:Zoom></tptz:Stop>",
        profile_token(profile)
    )
}

/// Look there; `space` is that of pan and tilt.
pub fn absolute_move(profile: &str, (x, y): (f64, f64), space: Option<&str>, zoom: Option<f64>) -> String {
    let space = space.map_or_else(String::new, |space| format!(" space=\"{}\"", escaped(space)));
    let zoom = zoom.map_or_else(String::new, |zoom| format!("<tt:Zoom x=\"{zoom:.6}\"/>"));
    format!(
        "<tptz:AbsoluteMove>{}<tptz:Position><tt:PanTilt x=\"{x:.6}\" y=\"{y:.6}\"{space}/>{zoom}</tptz:Position></tptz:AbsoluteMove>",
        profile_token(profile)
    )
}

/// Go to a preset.
pub fn goto_preset(profile: &str, preset: &str) -> String {
    format!(
        "<tptz:GotoPreset>{}<tptz:PresetToken>{}</tptz:PresetToken></tptz:GotoPreset>",
        profile_token(profile),
        escaped(preset)
    )
}

fn profile_token(profile: &str) -> String {
    format!("<tptz:ProfileToken>{}</tptz:ProfileToken>", escaped(profile))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_that_is_left_alone_is_left_out() {
        let velocity = Velocity { pan_tilt: Some((-0.5, 0.0)), space: None, zoom: None };
        let message = continuous_move("p", &velocity, Some(Duration::from_secs(2)));
        assert!(message.contains(r#"<tt:PanTilt x="-0.500000" y="0.000000"/>"#), "{message}");
        assert!(
            !message.contains("Zoom") && message.contains("<tptz:Timeout>PT2S</tptz:Timeout>"),
            "{message}"
        );
        let zoom = Velocity { pan_tilt: None, space: None, zoom: Some(1.0) };
        let message = continuous_move("p", &zoom, None);
        assert!(!message.contains("PanTilt") && !message.contains("Timeout"), "{message}");
    }

    #[test]
    fn tokens_are_escaped() {
        assert!(get_status("a<b").contains("a&lt;b"));
    }
}
