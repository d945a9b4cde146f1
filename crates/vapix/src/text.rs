// SPDX-License-Identifier: MPL-2.0

//! The texts that `ptz.cgi` and `param.cgi` answer with.
//!
//! Read by key and never by place, as the set of keys varies with camera and firmware; lines end in
//! CRLF (`ptz.cgi`) or LF (`param.cgi`). Every field is optional.

use servo::{HardLimits, Position, Range};

use session::http::{excerpt, unexpected};
use session::{Error, Parameters};

use crate::steps::{part_of_fastest, travel};

/// A longer line is not read: the longest real one, a table of speeds, has a few hundred characters.
const MAX_LINE_BYTES: usize = 4096;

/// Lines that are read; a full parameter list has several hundred.
const MAX_FIELDS: usize = 4096;

/// Reads the answer to `query=position`.
///
/// # Errors
/// [`Error::Unexpected`] where it tells no part of a position.
pub fn parse_position(body: &str) -> Result<Position, Error> {
    let fields = Fields::of(body);
    let position = Position {
        pan_deg: fields.number("pan"),
        tilt_deg: fields.number("tilt"),
        zoom: fields.number("zoom").map(travel),
    };
    if position == Position::default() { Err(unexpected(body)) } else { Ok(position) }
}

/// Reads the answer to `query=limits`.
///
/// # Errors
/// [`Error::Unexpected`] where it tells no limit.
pub fn parse_limits(body: &str) -> Result<HardLimits, Error> {
    let limits = limits_of(&Fields::of(body), "");
    if limits == HardLimits::default() { Err(unexpected(body)) } else { Ok(limits) }
}

fn limits_of(fields: &Fields, prefix: &str) -> HardLimits {
    HardLimits {
        pan_deg: fields.range(prefix, "Pan"),
        tilt_deg: fields.range(prefix, "Tilt"),
        zoom: fields
            .range(prefix, "Zoom")
            .map(|steps| Range { min: travel(steps.min), max: travel(steps.max) }),
        // Told in tenths of a degree: 44..516 of a camera whose lens sees 4.4 to 51.6 degrees.
        field_angle_deg: fields
            .range(prefix, "FieldAngle")
            .map(|range| Range { min: range.min / 10.0, max: range.max / 10.0 })
            .filter(|range| range.min > 0.0 && range.max < 180.0),
    }
}

/// Reads the parameters of channel `camera` from the list.
///
/// # Errors
/// [`Error::Camera`] where the whole answer is an error line; [`Error::Unexpected`] where it holds no parameter.
pub fn parse_parameters(body: &str, camera: &str) -> Result<Parameters, Error> {
    let fields = Fields::of(body);
    if fields.0.is_empty() {
        let complaint = body.lines().find_map(|line| line.trim().strip_prefix("# Error"));
        return Err(complaint.map_or_else(
            || unexpected(body),
            |text| Error::Camera(excerpt(text.trim_start_matches(':').trim())),
        ));
    }
    let various = format!("PTZ.Various.V{camera}.");
    let support = format!("PTZ.Support.S{camera}.");
    Ok(Parameters {
        limits: limits_of(&fields, &format!("PTZ.Limit.L{camera}.")),
        proportional_speed: fields.flag(&format!("{various}ProportionalSpeedEnabled")),
        max_proportional_speed: fields
            .number(&format!("{various}MaxProportionalSpeed"))
            .map(|percent| percent / 100.0)
            .filter(|fields_of_view| *fields_of_view > 0.0),
        continuous_pan: fields.flag(&format!("{support}ContinuousPan")),
        // What it tells of its lens says as much.
        continuous_zoom: None,
        absolute_pan: fields.flag(&format!("{support}AbsolutePan")),
        control_queue: fields.flag(&format!("{various}CtlQueueing")),
    })
}

/// Reads the answer to `query=speed`, the step, 1 to 100, at which moves to a position are made, as a part of the fastest.
///
/// # Errors
/// [`Error::Unexpected`] where it tells no such step.
pub fn parse_move_speed(body: &str) -> Result<f64, Error> {
    let speed = Fields::of(body).number("speed").filter(|speed| (1.0..=100.0).contains(speed));
    // Truncated: "no assumption on rounding".
    speed.map(|speed| part_of_fastest(speed.trunc())).ok_or_else(|| unexpected(body))
}

/// The text of an `Error:` answer, on one line; `None` where it is no error.
pub(super) fn complaint(body: &str) -> Option<String> {
    body.trim_start().strip_prefix("Error:").map(excerpt)
}

/// The `key=value` lines of a text.
pub(super) struct Fields<'a>(Vec<(&'a str, &'a str)>);

impl<'a> Fields<'a> {
    pub fn of(body: &'a str) -> Self {
        let lines = body.lines().filter(|line| line.len() <= MAX_LINE_BYTES);
        let fields = lines.filter_map(|line| {
            let (key, value) = line.trim().split_once('=')?;
            let key = key.trim();
            // Older firmware lists `root.PTZ...`, newer may leave `root.` out.
            Some((key.strip_prefix("root.").unwrap_or(key), value.trim()))
        });
        Self(fields.take(MAX_FIELDS).collect())
    }

    pub fn iter(&self) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.0.iter().copied()
    }

    pub fn text(&self, key: &str) -> Option<&'a str> {
        self.0.iter().find(|(known, _)| known.eq_ignore_ascii_case(key)).map(|(_, value)| *value)
    }

    pub fn number(&self, key: &str) -> Option<f64> {
        self.text(key)?.parse::<f64>().ok().filter(|number| number.is_finite())
    }

    fn flag(&self, key: &str) -> Option<bool> {
        match self.text(key)?.to_ascii_lowercase().as_str() {
            "true" | "yes" | "on" => Some(true),
            "false" | "no" | "off" => Some(false),
            _ => None,
        }
    }

    fn range(&self, prefix: &str, name: &str) -> Option<Range> {
        let min = self.number(&format!("{prefix}Min{name}"))?;
        let max = self.number(&format!("{prefix}Max{name}"))?;
        (min < max).then_some(Range { min, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn positions_of_two_kinds_of_camera() {
        let first = "pan=51.2891\r\ntilt=46.1914\r\nzoom=1\r\niris=6427\r\nfocus=8265\r\nbrightness=4999\r\n\
                     autofocus=off\r\nautoiris=on\r\n";
        let expected = Position { pan_deg: Some(51.2891), tilt_deg: Some(46.1914), zoom: Some(0.0) };
        assert_eq!(parse_position(first).unwrap(), expected);
        let second = "autofocus=on\ntilt=-45.03\npan=-0.01\n";
        let expected = Position { pan_deg: Some(-0.01), tilt_deg: Some(-45.03), zoom: None };
        assert_eq!(parse_position(second).unwrap(), expected);
    }

    #[test]
    fn limits_with_field_angle_in_tenths() {
        let body = "MinPan=-170\r\nMaxPan=170\r\nMinTilt=-20\r\nMaxTilt=90\r\nMinZoom=1\r\nMaxZoom=9999\r\n\
                    MinFieldAngle=22\r\nMaxFieldAngle=623\r\n";
        let limits = parse_limits(body).unwrap();
        assert_eq!(limits.pan_deg, Some(Range { min: -170.0, max: 170.0 }));
        assert_eq!(limits.tilt_deg, Some(Range { min: -20.0, max: 90.0 }));
        assert_eq!(limits.field_angle_deg, Some(Range { min: 2.2, max: 62.3 }));
    }

    #[test]
    fn parameters_of_a_p5512() {
        let body = "root.PTZ.Limit.L1.MinPan=-180\nroot.PTZ.Limit.L1.MaxPan=180\n\
                    root.PTZ.Limit.L1.MinFieldAngle=44\nroot.PTZ.Limit.L1.MaxFieldAngle=516\n\
                    root.PTZ.Support.S1.ContinuousPan=true\nroot.PTZ.Support.S1.AbsolutePan=true\n\
                    root.PTZ.Various.V1.ProportionalSpeedEnabled=true\n\
                    root.PTZ.Various.V1.MaxProportionalSpeed=200\n";
        let parameters = parse_parameters(body, "1").unwrap();
        assert_eq!(parameters.limits.field_angle_deg, Some(Range { min: 4.4, max: 51.6 }));
        assert_eq!(parameters.proportional_speed, Some(true));
        assert_eq!(parameters.max_proportional_speed, Some(2.0));
        assert_eq!(parameters.continuous_pan, Some(true));
        assert_eq!(parse_parameters(&body.replace("root.", ""), "1").unwrap(), parameters);
        assert_eq!(parse_parameters(body, "2").unwrap(), Parameters::default());
    }

    #[test]
    fn a_missing_parameter_group_is_the_cameras_complaint() {
        let body = "# Error: Error -1 getting param in group 'PTZ'\n";
        let expected = Error::Camera("Error -1 getting param in group 'PTZ'".to_owned());
        assert_eq!(parse_parameters(body, "1"), Err(expected));
    }

    #[test]
    fn complaints_are_put_on_one_line() {
        assert_eq!(
            complaint("Error:query: unknown value: foo").as_deref(),
            Some("query: unknown value: foo")
        );
        assert_eq!(complaint("Error:\r\nno\r\nsuch thing\x07\r\n").as_deref(), Some("no such thing"));
        assert_eq!(complaint("pan=1"), None);
    }

    #[test]
    fn numbers_that_are_none_are_left_out() {
        assert!(parse_position("pan=NaN\ntilt=inf\nzoom=\n").is_err());
        assert!(parse_position("").is_err());
        assert!(parse_limits("MinPan=10\nMaxPan=-10\n").is_err());
        assert!(parse_limits("MinFieldAngle=0\nMaxFieldAngle=4000\n").is_err());
    }

    #[test]
    fn a_move_speed_is_a_step() {
        assert_eq!(parse_move_speed("speed=100\r\n"), Ok(1.0));
        for body in ["", "speed=0", "speed=101", "speed=x", "speed=NaN", "mode=normal"] {
            assert!(parse_move_speed(body).is_err(), "{body}");
        }
    }

    #[test]
    fn lines_and_lists_without_end_are_cut() {
        let body =
            format!("pan=1\ntilt={}\n{}zoom=5\n", "1".repeat(MAX_LINE_BYTES), "x=1\n".repeat(MAX_FIELDS));
        let expected = Position { pan_deg: Some(1.0), tilt_deg: None, zoom: None };
        assert_eq!(parse_position(&body).unwrap(), expected);
    }

    proptest! {
        #[test]
        fn limits_are_read_back(min in -180..0i32, max in 1..180i32, narrow in 1..100u32, wide in 101..1700u32) {
            let body = format!(
                "MinPan={min}\r\nMaxPan={max}\r\nMinFieldAngle={narrow}\r\nMaxFieldAngle={wide}\r\n"
            );
            let limits = parse_limits(&body).unwrap();
            prop_assert_eq!(limits.pan_deg, Some(Range { min: min.into(), max: max.into() }));
            let field = limits.field_angle_deg.unwrap();
            prop_assert!((field.min * 10.0 - f64::from(narrow)).abs() < 1e-9);
            prop_assert!((field.max * 10.0 - f64::from(wide)).abs() < 1e-9);
        }

        #[test]
        fn any_text_is_read_or_refused(body in "(?s).{0,512}") {
            let _ = (parse_position(&body), parse_limits(&body), parse_parameters(&body, "1"));
            let _ = parse_move_speed(&body);
            if let Some(text) = complaint(&body) {
                prop_assert!(text.chars().count() <= 160);
            }
        }

        #[test]
        fn a_position_is_read_back(pan in -180.0..180.0f64, tilt in -90.0..90.0f64, zoom in 1.0..9999.0f64) {
            let body = format!("zoom={zoom}\r\n\r\ntilt = {tilt}\r\nnoise\r\npan={pan}");
            let expected = Position { pan_deg: Some(pan), tilt_deg: Some(tilt), zoom: Some(travel(zoom)) };
            prop_assert_eq!(parse_position(&body).unwrap(), expected);
        }
    }
}
