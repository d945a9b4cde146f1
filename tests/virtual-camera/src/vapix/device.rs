// SPDX-License-Identifier: MPL-2.0

//! The device behind the CGIs: head, lens, parameters, presets.

use std::{collections::BTreeMap, fmt::Write, time::Duration};

use super::{
    Args, CgiResponse, help,
    params::Params,
    ptz::{Adjustment, Preset, Question, Request},
    queue::Queue,
};
use crate::{
    kinematics::{Head, Limits, Motion, Pose, ZOOM_RANGE, within_a_turn},
    settings::{Moves, PtzApi, Settings},
};

/// Everything that requests change.
pub(crate) struct Device {
    pub head: Head,
    pub params: Params,
    /// The control queue, if it has one.
    pub queue: Option<Queue>,
    api: PtzApi,
    moves: Moves,
    limits: Limits,
    /// Their numbers count from 1.
    presets: Vec<(String, Pose)>,
    view_size: (u32, u32),
    /// Focus, iris and brightness in steps.
    lens: BTreeMap<&'static str, f64>,
    switches: BTreeMap<&'static str, bool>,
}

impl Device {
    pub fn new(settings: &Settings, head: Head, limits: Limits, view_size: (u32, u32)) -> Self {
        let home = ("Home".to_owned(), head.now().pose);
        Self {
            params: Params::new(settings, &head, limits, view_size),
            head,
            api: settings.ptz_api,
            moves: settings.moves,
            limits,
            presets: std::iter::once(home).chain(settings.presets.iter().cloned()).collect(),
            queue: settings.control_queue.map(Queue::new),
            view_size,
            lens: BTreeMap::from([("iris", 5748.0), ("focus", 4642.0), ("brightness", 4999.0)]),
            switches: BTreeMap::from([("autofocus", true), ("autoiris", true)]),
        }
    }

    /// Places to go to, `Home` first.
    pub fn presets(&self) -> &[(String, Pose)] {
        &self.presets
    }

    /// How far it turns, as it is told.
    pub fn turn_limits(&self) -> Limits {
        self.limits
    }

    /// `ptz.cgi` with `args`, arriving at `now`.
    pub fn ptz(&mut self, args: &Args, now: Duration) -> CgiResponse {
        match self.try_ptz(args, now) {
            Ok(answer) => answer,
            Err(message) => CgiResponse::error(message),
        }
    }

    fn try_ptz(&mut self, args: &Args, now: Duration) -> Result<CgiResponse, String> {
        let known = |arg: &&(String, String)| self.api == PtzApi::Extended || arg.0 != "proportionalspeed";
        let refused = |name: &str| self.api == PtzApi::Attributes && name == "proportionalspeed";
        if let Some((name, _)) = args.iter().find(|(name, _)| !self.moves.take(name) || refused(name)) {
            return Err(format!("{name}: not supported"));
        }
        let args = args.iter().filter(known).cloned().collect();
        let request = Request::parse(&args, self.view_size)?;
        let preset = request.preset.as_ref().map(|preset| self.preset(preset)).transpose()?;
        self.head.advance(now);
        for motion in request.motions.into_iter().chain(preset) {
            self.head.command(now, motion);
        }
        for adjustment in request.adjustments {
            self.adjust(adjustment);
        }
        let text = match request.question {
            None => return Ok(CgiResponse::Accepted),
            Some(Question::Driver) => "Sony_camblock\r\n".into(),
            Some(Question::Help) => help::commands(&self.moves),
            Some(Question::About(subject)) => self.tell(&subject)?,
        };
        Ok(CgiResponse::Text(text))
    }

    fn preset(&self, preset: &Preset) -> Result<Motion, String> {
        let found = match preset {
            Preset::Named(name) => self.presets.iter().find(|(known, _)| known == name),
            Preset::Numbered(number) => {
                (*number as usize).checked_sub(1).and_then(|index| self.presets.get(index))
            }
        };
        let (_, place) = found.ok_or_else(|| match preset {
            Preset::Named(name) => format!("gotoserverpresetname: no such preset: {name}"),
            Preset::Numbered(number) => format!("gotoserverpresetno: no such preset: {number}"),
        })?;
        Ok(Motion::Absolute {
            pan_deg: Some(place.pan_deg),
            tilt_deg: Some(place.tilt_deg),
            zoom_step: Some(place.zoom_step),
        })
    }

    fn tell_presets(&self, with_data: bool) -> String {
        let mut text = String::from("Preset Positions for camera 1\r\n");
        for (number, (name, place)) in (1..).zip(&self.presets) {
            let _ = write!(text, "presetposno{number}={name}\r\n");
            if with_data {
                let Pose { pan_deg, tilt_deg, zoom_step } = place;
                let _ = write!(
                    text,
                    "presetposno{number}.data=tilt={tilt_deg:.6}:pan={pan_deg:.6}:zoom={zoom_step:.6}\r\n"
                );
            }
        }
        text
    }

    fn adjust(&mut self, adjustment: Adjustment) {
        match adjustment {
            Adjustment::To(name, value) => *self.lens.entry(name).or_default() = value,
            Adjustment::By(name, value) => {
                let step = self.lens.entry(name).or_default();
                *step = (*step + value).clamp(ZOOM_RANGE.0, ZOOM_RANGE.1);
            }
            Adjustment::Switch(name, on) => *self.switches.entry(name).or_default() = on,
        }
    }

    fn tell(&self, subject: &str) -> Result<String, String> {
        Ok(match subject {
            "position" => self.position(),
            "limits" => self.limits(),
            "speed" => format!("speed={}\r\n", self.head.move_speed()),
            "mode" => "mode=normal\r\n".into(),
            "presetposall" | "presetposcam" => self.tell_presets(false),
            "presetposcamdata" => self.tell_presets(true),
            "auxiliary" => "Available auxiliary commands for camera 1\r\n".into(),
            "attributes" if self.api != PtzApi::Classic => self.attributes(),
            _ => return Err(format!("query: unknown value: {subject}")),
        })
    }

    fn position(&self) -> String {
        let pose = self.head.now().pose;
        let mut text = String::new();
        let step = |name: &str| self.lens.get(name).copied().unwrap_or_default();
        let switch = |name: &str| if self.switches.get(name) == Some(&true) { "on" } else { "off" };
        for (name, value) in [
            ("pan", format!("{:.4}", within_a_turn(pose.pan_deg))),
            ("tilt", format!("{:.4}", pose.tilt_deg)),
            ("zoom", format!("{:.0}", pose.zoom_step)),
            ("iris", format!("{:.0}", step("iris"))),
            ("focus", format!("{:.0}", step("focus"))),
            ("brightness", format!("{:.0}", step("brightness"))),
            ("autofocus", switch("autofocus").into()),
            ("autoiris", switch("autoiris").into()),
        ] {
            let _ = write!(text, "{name}={value}\r\n");
        }
        text
    }

    fn limits(&self) -> String {
        let (wide, narrow) = field_angles(&self.head);
        let mut text = String::new();
        for (name, low, high) in [
            ("Pan", self.limits.pan_deg.0, self.limits.pan_deg.1),
            ("Tilt", self.limits.tilt_deg.0, self.limits.tilt_deg.1),
            ("Zoom", ZOOM_RANGE.0, ZOOM_RANGE.1),
            ("Iris", 1.0, 9999.0),
            ("Focus", 770.0, 9999.0),
            ("FieldAngle", f64::from(narrow), f64::from(wide)),
            ("Brightness", 1.0, 9999.0),
        ] {
            let _ = write!(text, "Min{name}={low}\r\nMax{name}={high}\r\n");
        }
        text
    }

    /// Degrees per second of some speed steps, as newer firmware tells them.
    fn attributes(&self) -> String {
        let map = &self.head.kinematics().speed_map;
        let speeds: Vec<String> = [1, 9, 14, 24, 40, 58, 80, 100]
            .iter()
            .map(|&step| format!("value={step} | speed={:.2}", map.deg_s(f64::from(step))))
            .collect();
        let magnification = self.head.optics().max_magnification;
        format!(
            "Attributes for camera 1\r\nspeeds={}\r\nmaxOpticalZoomMag={magnification}\r\n",
            speeds.join(",")
        )
    }

    /// `param.cgi` with `args`.
    pub fn param(&mut self, args: &Args) -> CgiResponse {
        let answer = self.params.answer(args);
        let proportional = &mut self.head.kinematics_mut().proportional_speed;
        self.params.apply_to(proportional);
        answer
    }
}

/// Widest and narrowest horizontal field of view in tenths of a degree, as `PTZ.Limit` has them.
pub(super) fn field_angles(head: &Head) -> (u32, u32) {
    let tenths = |zoom_step| (head.optics().fov_deg(zoom_step) * 10.0).round() as u32;
    (tenths(ZOOM_RANGE.0), tenths(ZOOM_RANGE.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        kinematics::{Kinematics, Optics, SpeedMap},
        vapix::parse_args,
    };

    fn device(api: PtzApi) -> Device {
        device_with(api, Kinematics::default())
    }

    fn device_with(api: PtzApi, kinematics: Kinematics) -> Device {
        let settings = Settings { ptz_api: api, ..Settings::default() };
        let limits = Limits { pan_deg: (-20.5, 20.5), tilt_deg: (-9.25, 9.25) };
        let optics = Optics { wide_fov_deg: 55.2, max_magnification: 18.0 };
        let head = Head::new(kinematics, optics, limits, Pose::default(), Duration::from_secs(1));
        Device::new(&settings, head, limits, (640, 480))
    }

    fn ask(device: &mut Device, query: &str, seconds: u64) -> CgiResponse {
        device.ptz(&parse_args(query.as_bytes()), Duration::from_secs(seconds))
    }

    fn text(answer: CgiResponse) -> String {
        match answer {
            CgiResponse::Text(text) => text,
            answer => panic!("no text: {answer:?}"),
        }
    }

    #[test]
    fn positions_are_clamped_and_told() {
        let mut device = device(PtzApi::Classic);
        assert_eq!(
            ask(&mut device, "pan=150&tilt=-4.5&zoom=100&focus=900&autofocus=off", 1),
            CgiResponse::Accepted
        );
        assert_eq!(
            text(ask(&mut device, "query=position", 9)),
            "pan=20.5000\r\ntilt=-4.5000\r\nzoom=100\r\niris=5748\r\nfocus=900\r\n\
             brightness=4999\r\nautofocus=off\r\nautoiris=on\r\n"
        );
        assert_eq!(ask(&mut device, "gotoserverpresetname=Home", 9), CgiResponse::Accepted);
        assert!(
            text(ask(&mut device, "query=position", 20))
                .starts_with("pan=0.0000\r\ntilt=0.0000\r\nzoom=1\r\n")
        );
    }

    #[test]
    fn limits_are_told() {
        let text = text(ask(&mut device(PtzApi::Classic), "query=limits&camera=1", 0));
        assert!(text.starts_with("MinPan=-20.5\r\nMaxPan=20.5\r\nMinTilt=-9.25\r\nMaxTilt=9.25\r\nMinZoom=1\r\nMaxZoom=9999\r\n"), "{text}");
        assert!(text.contains("MinFieldAngle=33\r\nMaxFieldAngle=552\r\n"), "{text}");
    }

    #[test]
    fn words_that_it_has_not_are_refused_and_not_told_of() {
        let moves = Moves { absolute: true, ..Moves::NONE };
        let mut device = device(PtzApi::Classic);
        device.moves = moves;
        for (query, taken) in [
            ("continuouspantiltmove=5,0", false),
            ("continuouszoommove=5", false),
            ("center=5,5", false),
            ("areazoom=5,5,200", false),
            ("pan=5&tilt=1&speed=50", true),
            ("move=stop", true),
        ] {
            assert_eq!(ask(&mut device, query, 1) == CgiResponse::Accepted, taken, "{query}");
        }
        let list = text(ask(&mut device, "info=1", 1));
        assert!(
            list.contains("pan=[") && !list.contains("center=") && !list.contains("continuouspan"),
            "{list}"
        );
        assert!(!list.contains("imagewidth") && list.contains("continuousfocus"), "{list}");
    }

    #[test]
    fn attributes_come_with_newer_firmware_only() {
        let query = "query=attributes&camera=1&format=text";
        assert_eq!(
            ask(&mut device(PtzApi::Classic), query, 0),
            CgiResponse::Text("Error:query: unknown value: attributes\r\n".into())
        );
        let text = text(ask(&mut device(PtzApi::Extended), query, 0));
        assert!(text.contains("value=1 | speed=0.05,"), "{text}");
        assert!(text.contains("value=100 | speed=450.00\r\n"), "{text}");
    }

    #[test]
    fn proportional_speed_is_left_out_where_the_firmware_knows_the_word() {
        for (api, expected) in [(PtzApi::Classic, 110.4), (PtzApi::Extended, 225.0)] {
            let mut device = device_with(
                api,
                Kinematics {
                    speed_map: SpeedMap::Linear { max_deg_s: 450.0 },
                    acceleration_deg_s2: 1e6,
                    ..Kinematics::default()
                },
            );
            let query = "continuouspantiltmove=0,50&proportionalspeed=disabled";
            assert_eq!(ask(&mut device, query, 1), CgiResponse::Accepted);
            device.head.advance(Duration::from_millis(1064));
            assert!((device.head.now().tilt_rate_deg_s - expected).abs() < 1e-6, "{:?}", device.head.now());
        }
    }

    #[test]
    fn what_is_no_dome_tells_attributes_and_refuses_the_word() {
        let mut device = device(PtzApi::Attributes);
        let query = "continuouspantiltmove=0,50&proportionalspeed=disabled";
        assert_eq!(
            ask(&mut device, query, 1),
            CgiResponse::Text("Error:proportionalspeed: not supported\r\n".into())
        );
        assert!(device.head.is_at_rest());
        assert!(text(ask(&mut device, "query=attributes", 1)).contains("speeds="));
    }

    #[test]
    fn presets_go_by_name_and_by_number() {
        let gate = Pose { pan_deg: 8.0, tilt_deg: -3.0, zoom_step: 500.0 };
        let mut device = device(PtzApi::Classic);
        device.presets.push(("Gate".into(), gate));
        let list = text(ask(&mut device, "query=presetposcam", 0));
        assert_eq!(list, "Preset Positions for camera 1\r\npresetposno1=Home\r\npresetposno2=Gate\r\n");
        for (query, pan) in
            [("gotoserverpresetno=2", 8.0), ("move=home", 0.0), ("gotoserverpresetname=Gate", 8.0)]
        {
            let now = device.head.now().time.as_secs();
            assert_eq!(ask(&mut device, query, now + 1), CgiResponse::Accepted);
            device.head.advance(Duration::from_secs(now + 20));
            assert_eq!(device.head.now().pose.pan_deg, pan, "{query}");
        }
        assert!(text(ask(&mut device, "gotoserverpresetno=3", 90)).starts_with("Error:"));
        assert!(text(ask(&mut device, "gotoserverpresetno=0", 90)).starts_with("Error:"));
    }

    #[test]
    fn errors_are_texts_and_change_nothing() {
        let mut device = device(PtzApi::Classic);
        for query in ["query=foo", "gotoserverpresetname=Nowhere&pan=5", "pan=5&tilt=x", "camera=2&pan=5"] {
            assert!(text(ask(&mut device, query, 1)).starts_with("Error:"), "{query}");
        }
        assert!(device.head.is_at_rest());
    }

    #[test]
    fn questions_of_all_kinds_are_answered() {
        let mut device = device(PtzApi::Classic);
        for (query, beginning) in [
            ("whoami=1", "Sony_camblock\r\n"),
            ("info=1", "Available commands\r\n:\r\n{camera=[n]}\r\n"),
            ("query=speed", "speed=100\r\n"),
            ("query=mode", "mode=normal\r\n"),
            ("query=presetposall", "Preset Positions for camera 1\r\npresetposno1=Home\r\n"),
        ] {
            assert!(text(ask(&mut device, query, 1)).starts_with(beginning), "{query}");
        }
    }

    #[test]
    fn proportional_speed_is_switched_by_parameter() {
        let mut device = device(PtzApi::Classic);
        let update = "action=update&PTZ.Various.V1.ProportionalSpeedEnabled=false";
        assert_eq!(device.param(&parse_args(update.as_bytes())), CgiResponse::Text("OK\n".into()));
        assert!(!device.head.kinematics().proportional_speed.enabled);
    }
}
