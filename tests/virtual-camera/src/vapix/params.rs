// SPDX-License-Identifier: MPL-2.0

//! `param.cgi`: the camera's parameters.

use super::{Args, CgiResponse, device::field_angles};
use crate::{
    kinematics::{Head, Limits, ProportionalSpeed, ZOOM_RANGE},
    settings::{Auth, Moves, Settings},
};

/// The parameter tree, in the order in which it is listed.
pub(crate) struct Params(Vec<(String, String)>);

impl Params {
    pub fn new(settings: &Settings, head: &Head, limits: Limits, size: (u32, u32)) -> Self {
        let mut params = Self(Vec::new());
        params.add_device(settings, size);
        params.add_ptz(settings, head, limits);
        params
    }

    fn add(&mut self, group: &str, entries: &[(&str, String)]) {
        self.0.extend(entries.iter().map(|(name, value)| (format!("root.{group}.{name}"), value.clone())));
    }

    fn add_words(&mut self, group: &str, entries: &[(&str, &str)]) {
        self.0
            .extend(entries.iter().map(|(name, value)| (format!("root.{group}.{name}"), value.to_string())));
    }

    fn add_device(&mut self, settings: &Settings, size: (u32, u32)) {
        self.add_words(
            "Brand",
            &[
                ("Brand", "AXIS"),
                ("ProdFullName", "AXIS Q6034-E PTZ Dome Network Camera"),
                ("ProdNbr", "Q6034-E"),
                ("ProdShortName", "AXIS Q6034-E"),
                ("ProdType", "PTZ Dome Network Camera"),
                ("ProdVariant", ""),
                ("WebURL", "http://www.axis.com"),
            ],
        );
        self.add(
            "Image.I0",
            &[
                ("Enabled", "yes".into()),
                ("Appearance.Resolution", format!("{}x{}", size.0, size.1)),
                ("Appearance.Compression", settings.video.compression.to_string()),
                ("Stream.FPS", "0".into()),
            ],
        );
        let policy = match settings.auth {
            Auth::None | Auth::Basic => "basic",
            Auth::Digest { .. } => "digest",
            Auth::Both => "basic_digest",
        };
        self.add_words("Network", &[("HTTP.AuthenticationPolicy", policy), ("RTSP.Enabled", "yes")]);
        self.add_words(
            "Properties",
            &[
                ("API.HTTP.Version", "3"),
                ("API.RTSP.Version", "2.01"),
                ("Firmware.Version", "5.41.4"),
                ("Image.Format", "jpeg,mjpeg,h264,mpeg4"),
                ("Image.NbrOfViews", "1"),
                ("Image.Resolution", "1280x720,768x576,640x480,640x360,320x240,320x180"),
                ("PTZ.PTZ", "yes"),
                ("PTZ.DigitalPTZ", "no"),
                ("PTZ.DriverManagement", "no"),
            ],
        );
        self.add("Properties", &[("System.SerialNumber", settings.serial.clone())]);
    }

    fn add_ptz(&mut self, settings: &Settings, head: &Head, limits: Limits) {
        self.add_words(
            "PTZ",
            &[
                ("BoaProtPTZOperator", "password"),
                ("CameraDefault", "1"),
                ("NbrOfCameras", "1"),
                ("NbrOfSerPorts", "0"),
                ("CamPorts.Cam1Port", "1"),
                ("ImageSource.I0.PTZEnabled", "true"),
                ("Preset.P0.HomePosition", "1"),
                ("Preset.P0.ImageSource", "0"),
                ("Preset.P0.Name", ""),
                ("Preset.P0.Position.P1.Name", "Home"),
            ],
        );
        self.add_limits(head, limits);
        let Moves { continuous, absolute, centre, .. } =
            if settings.moves.told { settings.moves } else { Moves::default() };
        let abilities = [
            ("AbsoluteBrightness", false),
            ("AbsoluteFocus", true),
            ("AbsoluteIris", true),
            ("AbsolutePan", absolute),
            ("AbsoluteTilt", absolute),
            ("AbsoluteZoom", absolute),
            ("ActionNotification", true),
            ("AreaZoom", centre),
            ("AutoFocus", true),
            ("AutoIrCutFilter", true),
            ("AutoIris", true),
            ("Auxiliary", false),
            ("BackLight", true),
            ("ContinuousBrightness", false),
            ("ContinuousFocus", true),
            ("ContinuousIris", true),
            ("ContinuousPan", continuous),
            ("ContinuousTilt", continuous),
            ("ContinuousZoom", continuous),
            ("DevicePreset", false),
            ("DigitalZoom", false),
            ("GenericHTTP", false),
            ("IrCutFilter", true),
            ("JoyStickEmulation", false),
            ("LensOffset", false),
            ("OSDMenu", false),
            ("ProportionalSpeed", true),
            ("RelativeBrightness", false),
            ("RelativeFocus", true),
            ("RelativeIris", true),
            ("RelativePan", absolute),
            ("RelativeTilt", absolute),
            ("RelativeZoom", absolute),
            ("ServerPreset", true),
            ("SpeedCtl", true),
        ];
        self.add("PTZ.Support.S1", &abilities.map(|(name, able): (_, bool)| (name, able.to_string())));
        self.add_words(
            "PTZ.UserAdv.U1",
            &[
                ("AutoFlip", "false"),
                ("DeviceStatus", "cam=ok,pan=ok,tilt=ok"),
                ("ImageFreeze", "off"),
                ("LastTestDate", ""),
                ("MovePrediction", "false"),
                ("MoveSpeed", "100"),
                ("WhiteBalanceOnePushModeEnabled", "true"),
            ],
        );
        let proportional = settings.kinematics.proportional_speed;
        self.add(
            "PTZ.Various.V1",
            &[
                ("AutoFocus", "true".into()),
                ("AutoIris", "true".into()),
                ("BackLight", "false".into()),
                ("CtlQueueing", settings.control_queue.is_some().to_string()),
                ("CtlQueueLimit", "20".into()),
                ("CtlQueuePollTime", settings.control_queue.map_or(20, |poll| poll.as_secs()).to_string()),
                ("HomePresetSet", "true".into()),
                ("IrCutFilter", "auto".into()),
                ("Locked", "false".into()),
                ("MaxProportionalSpeed", format!("{:.0}", proportional.max_fields_s * 100.0)),
                ("PanEnabled", "true".into()),
                ("ProportionalSpeedEnabled", proportional.enabled.to_string()),
                ("ReturnToOverview", "0".into()),
                ("SpeedCtlEnabled", "true".into()),
                ("TiltEnabled", "true".into()),
                ("ZoomEnabled", "true".into()),
            ],
        );
    }

    fn add_limits(&mut self, head: &Head, limits: Limits) {
        let (wide, narrow) = field_angles(head);
        self.add(
            "PTZ.Limit.L1",
            &[
                ("MaxFieldAngle", wide.to_string()),
                ("MaxFocus", "9999".into()),
                ("MaxIris", "9999".into()),
                ("MaxPan", limits.pan_deg.1.to_string()),
                ("MaxTilt", limits.tilt_deg.1.to_string()),
                ("MaxZoom", ZOOM_RANGE.1.to_string()),
                ("MinFieldAngle", narrow.to_string()),
                ("MinFocus", "770".into()),
                ("MinIris", "1".into()),
                ("MinPan", limits.pan_deg.0.to_string()),
                ("MinTilt", limits.tilt_deg.0.to_string()),
                ("MinZoom", ZOOM_RANGE.0.to_string()),
            ],
        );
    }

    /// `action=list` or `action=update`.
    pub fn answer(&mut self, args: &Args) -> CgiResponse {
        let value = |name: &str| args.iter().find(|arg| arg.0 == name).map(|arg| arg.1.as_str());
        match value("action") {
            Some("list") => CgiResponse::Text(self.list(value("group"))),
            Some("update") => CgiResponse::Text(self.update(args)),
            Some(action) => CgiResponse::Text(format!("# Error: Unknown action '{action}'\n")),
            None => CgiResponse::Text("# Error: Missing argument 'action'\n".into()),
        }
    }

    fn list(&self, groups: Option<&str>) -> String {
        let Some(groups) = groups.filter(|groups| !groups.is_empty()) else {
            return self.lines("root");
        };
        groups.split(',').map(|group| self.lines(group)).collect()
    }

    fn lines(&self, group: &str) -> String {
        let wanted = full_name(group.trim_end_matches(['*', '.']));
        let belongs = |name: &str| {
            name.strip_prefix(&wanted).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let found = self.0.iter().filter(|(name, _)| belongs(name));
        let lines: String = found.map(|(name, value)| format!("{name}={value}\n")).collect();
        if lines.is_empty() {
            return format!("# Error: Error -1 getting param in group '{group}'\n");
        }
        lines
    }

    fn update(&mut self, args: &Args) -> String {
        let control = ["action", "usergroup", "camera", "timestamp", "html"];
        let mut errors = String::new();
        for (name, value) in args.iter().filter(|arg| !control.contains(&arg.0.as_str())) {
            let wanted = full_name(name);
            match self.0.iter_mut().find(|param| param.0 == wanted) {
                Some(param) if fits(&param.1, value) => param.1 = value.clone(),
                _ => errors += &format!("# Error: Error setting '{wanted}' to '{value}'!\n"),
            }
        }
        if errors.is_empty() { "OK\n".into() } else { errors }
    }

    /// Takes over what was updated.
    pub fn apply_to(&self, proportional: &mut ProportionalSpeed) {
        let value = |name: &str| {
            let name = format!("root.PTZ.Various.V1.{name}");
            self.0.iter().find(|param| param.0 == name).map(|param| param.1.as_str())
        };
        if let Some(enabled) = value("ProportionalSpeedEnabled") {
            proportional.enabled = enabled == "true";
        }
        if let Some(percent) = value("MaxProportionalSpeed").and_then(|value| value.parse::<f64>().ok()) {
            proportional.max_fields_s = percent / 100.0;
        }
    }
}

fn full_name(name: &str) -> String {
    if name == "root" || name.starts_with("root.") { name.into() } else { format!("root.{name}") }
}

/// Whether a value may replace another: truth values and numbers stay such.
fn fits(old: &str, new: &str) -> bool {
    match old {
        "true" | "false" => matches!(new, "true" | "false"),
        _ => old.parse::<f64>().is_err() || new.parse::<f64>().is_ok_and(f64::is_finite),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        kinematics::{Kinematics, Optics, Pose},
        vapix::parse_args,
    };
    use std::time::Duration;

    fn params() -> Params {
        let limits = Limits { pan_deg: (-20.5, 20.5), tilt_deg: (-9.25, 9.25) };
        let optics = Optics { wide_fov_deg: 55.2, max_magnification: 18.0 };
        let head = Head::new(Kinematics::default(), optics, limits, Pose::default(), Duration::ZERO);
        Params::new(&Settings::default(), &head, limits, (640, 480))
    }

    fn ask(params: &mut Params, query: &str) -> String {
        match params.answer(&parse_args(query.as_bytes())) {
            CgiResponse::Text(text) => text,
            answer => panic!("no text: {answer:?}"),
        }
    }

    #[test]
    fn groups_are_listed_with_or_without_root_one_or_many() {
        let mut params = params();
        let limits = ask(&mut params, "action=list&group=PTZ.Limit");
        assert!(limits.contains("root.PTZ.Limit.L1.MaxPan=20.5\n"), "{limits}");
        assert!(limits.lines().all(|line| line.starts_with("root.PTZ.Limit.")));
        assert_eq!(limits, ask(&mut params, "action=list&group=root.PTZ.Limit.L1"));
        assert_eq!(
            ask(&mut params, "action=list&group=root.Brand.ProdNbr%2Croot.Properties.Firmware"),
            "root.Brand.ProdNbr=Q6034-E\nroot.Properties.Firmware.Version=5.41.4\n"
        );
        assert!(ask(&mut params, "action=list").lines().count() > 80);
    }

    #[test]
    fn a_missing_group_is_an_error_line_between_the_others() {
        assert_eq!(
            ask(&mut params(), "action=list&group=Nonsense,Brand.Brand"),
            "# Error: Error -1 getting param in group 'Nonsense'\nroot.Brand.Brand=AXIS\n"
        );
    }

    #[test]
    fn updates_are_kept_if_they_fit() {
        let mut params = params();
        assert_eq!(ask(&mut params, "action=update&PTZ.Various.V1.MaxProportionalSpeed=150"), "OK\n");
        let mut proportional = Kinematics::default().proportional_speed;
        params.apply_to(&mut proportional);
        assert_eq!(proportional.max_fields_s, 1.5);
        for query in ["PTZ.Various.V1.ProportionalSpeedEnabled=perhaps", "No.Such=1"] {
            let text = ask(&mut params, &format!("action=update&{query}"));
            assert!(text.starts_with("# Error: Error setting 'root."), "{text}");
        }
        assert!(ask(&mut params, "action=dance").starts_with("# Error"));
    }
}
