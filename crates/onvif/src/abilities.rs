// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use serde::{Deserialize, Serialize};
use servo::{HardLimits, Motion, Range, SpeedUnit, TableRow};
use session::{Attributes, Parameters};

use crate::soap::{Element, number};

/// How long a move goes on by itself. Long enough to lose a renewal or two, short enough that a camera whose user died does
/// not turn far.
const WANTED_TIMEOUT: Duration = Duration::from_secs(2);

/// The zoom's travel as the servo counts it, and as most cameras do.
const TRAVEL: Range = Range { min: 0.0, max: 1.0 };

/// What a PTZ configuration takes, as far as the camera tells. What it does not tell is tried.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Abilities {
    /// Names and ranges of the spaces, by what they are for.
    spaces: Vec<Space>,
    /// How long a move goes on by itself.
    pub timeout: MoveTimeout,
}

/// How long moves are to go on by themselves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum MoveTimeout {
    /// So long.
    After(Duration),
    /// Until they are ended: the camera refuses to be told.
    Never,
}

impl Default for MoveTimeout {
    fn default() -> Self {
        Self::After(WANTED_TIMEOUT)
    }
}

/// A coordinate space.
#[derive(Debug, Clone, PartialEq)]
struct Space {
    /// What it is for, as `Spaces` has it: `ContinuousPanTiltVelocitySpace` and others.
    kind: &'static str,
    uri: String,
    x: Range,
    y: Option<Range>,
}

/// A velocity as the camera takes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Velocity {
    /// In `space`; `None` leaves both axes alone.
    pub pan_tilt: Option<(f64, f64)>,
    /// `None`: the generic one.
    pub space: Option<String>,
    /// -1 (out) to 1 (in); `None` leaves the zoom alone.
    pub zoom: Option<f64>,
}

const PAN_TILT_VELOCITY: &str = "ContinuousPanTiltVelocitySpace";
const ZOOM_VELOCITY: &str = "ContinuousZoomVelocitySpace";
const PAN_TILT_POSITION: &str = "AbsolutePanTiltPositionSpace";
const ZOOM_POSITION: &str = "AbsoluteZoomPositionSpace";

/// Reads `GetConfigurationOptionsResponse`.
pub fn parse_abilities(body: &Element) -> Abilities {
    let Some(options) = body.find(&["GetConfigurationOptionsResponse", "PTZConfigurationOptions"]) else {
        return Abilities::default();
    };
    let kinds = [PAN_TILT_VELOCITY, ZOOM_VELOCITY, PAN_TILT_POSITION, ZOOM_POSITION];
    let of_kind = |kind: &'static str| {
        let listed = options.child("Spaces").into_iter().flat_map(move |spaces| spaces.children(kind));
        listed.filter_map(move |space| {
            let uri = space.child("URI")?.text().to_owned();
            Some(Space { kind, uri, x: range(space, "XRange")?, y: range(space, "YRange") })
        })
    };
    let seconds = |name| duration(options.find(&["PTZTimeout", name])?.text());
    let timeout = match (seconds("Min"), seconds("Max")) {
        (Some(min), Some(max)) if min <= max => WANTED_TIMEOUT.clamp(min, max),
        _ => WANTED_TIMEOUT,
    };
    let timeout = if timeout.is_zero() { MoveTimeout::Never } else { MoveTimeout::After(timeout) };
    Abilities { spaces: kinds.into_iter().flat_map(of_kind).take(64).collect(), timeout }
}

fn range(space: &Element, name: &str) -> Option<Range> {
    let end = |end: &str| number(space.find(&[name, end])?.text());
    let range = Range { min: end("Min")?, max: end("Max")? };
    (range.min < range.max).then_some(range)
}

/// An XML Schema duration of at most a day, such as `PT1M2.5S`; years and months have no length.
fn duration(text: &str) -> Option<Duration> {
    let rest = text.strip_prefix('P')?;
    let (days, time) = rest.split_once('T').unwrap_or((rest, ""));
    let mut seconds = 0.0;
    for (part, units) in [
        (days, [('D', 86_400.0), ('H', f64::NAN), ('M', f64::NAN)]),
        (time, [('H', 3600.0), ('M', 60.0), ('S', 1.0)]),
    ] {
        for amount in part.split_inclusive(|c: char| c.is_ascii_alphabetic()) {
            let unit = amount.chars().next_back()?;
            let (_, factor) = units.into_iter().find(|(name, _)| *name == unit)?;
            seconds += number(amount.strip_suffix(unit)?)? * factor;
        }
    }
    (0.0..=86_400.0).contains(&seconds).then(|| Duration::from_secs_f64(seconds))
}

/// Speeds that are told in degrees per second.
fn is_degrees_per_second(uri: &str) -> bool {
    uri.ends_with("VelocitySpaceDegrees") || uri.ends_with("VelocityDegreesPerSecond")
}

/// Speeds that are told in fields of view per second.
fn is_fields_per_second(uri: &str) -> bool {
    uri.ends_with("VelocitySpaceFOV")
}

/// Positions that are told in degrees.
fn is_degrees(uri: &str) -> bool {
    uri.ends_with("SphericalPositionSpaceDegrees")
}

impl Abilities {
    /// Of a camera of which only this is known.
    pub fn with_timeout(timeout: MoveTimeout) -> Self {
        Self { timeout, ..Self::default() }
    }

    fn space(&self, kind: &str, is: impl Fn(&str) -> bool) -> Option<&Space> {
        self.spaces.iter().find(|space| space.kind == kind && is(&space.uri))
    }

    /// How far a space of velocities in a known unit reaches, in that unit, and its name.
    fn known_velocities(&self) -> Option<(f64, SpeedUnit, &str)> {
        let degrees = self.space(PAN_TILT_VELOCITY, is_degrees_per_second).map(|it| (it, SpeedUnit::Degrees));
        let fields = || Some((self.space(PAN_TILT_VELOCITY, is_fields_per_second)?, SpeedUnit::Fields));
        let (space, unit) = degrees.or_else(fields)?;
        let most = space.y.map_or(space.x.max, |y| y.max.min(space.x.max));
        (most > 0.0).then_some((most, unit, space.uri.as_str()))
    }

    /// A space of velocities turned out not to be taken: from now on there is none of this name.
    pub fn forget_space(&mut self, uri: &str) {
        self.spaces.retain(|space| space.uri != uri);
    }

    /// The velocity of these parts of the fastest. The camera's own is in proportion to the cube of the part: fine where it is slow.
    pub fn velocity(&self, (pan, tilt): (f64, f64), zoom: Option<f64>) -> Velocity {
        let (most, space) = self.known_velocities().map(|(most, _, space)| (most, space)).unzip();
        let most = most.unwrap_or(1.0);
        Velocity {
            pan_tilt: Some((pan.powi(3) * most, tilt.powi(3) * most)),
            space: space.map(ToOwned::to_owned),
            zoom,
        }
    }

    /// What parts of the fastest mean, where the camera takes velocities in a known unit.
    pub fn attributes(&self) -> Option<Attributes> {
        let (most, speed_unit, _) = self.known_velocities()?;
        let speeds = (1..=100).map(|hundredths| {
            let part = f64::from(hundredths) / 100.0;
            TableRow { setting: part, value: part.powi(3) * most }
        });
        Some(Attributes { speeds: speeds.collect(), speed_unit, ..Attributes::default() })
    }

    /// How it can be moved.
    pub fn parameters(&self) -> Parameters {
        Parameters {
            continuous_pan: Some(self.spaces.is_empty() || self.space(PAN_TILT_VELOCITY, |_| true).is_some()),
            continuous_zoom: Some(self.spaces.is_empty() || self.space(ZOOM_VELOCITY, |_| true).is_some()),
            absolute_pan: Some(self.limits().pan_deg.is_some()),
            ..Parameters::default()
        }
    }

    /// How far it can look, where it tells in degrees.
    pub fn limits(&self) -> HardLimits {
        let degrees = self.space(PAN_TILT_POSITION, is_degrees);
        HardLimits {
            pan_deg: degrees.map(|space| space.x),
            tilt_deg: degrees.and_then(|space| space.y),
            zoom: self.space(ZOOM_POSITION, |_| true).map(|_| TRAVEL),
            field_angle_deg: None,
        }
    }

    /// Degrees of a place of pan and tilt: told in degrees, or in a space of which the whole range is known in degrees too.
    pub fn degrees(&self, (x, y): (f64, f64), space: Option<&str>) -> Option<(f64, f64)> {
        if space.is_some_and(is_degrees) {
            return Some((x, y));
        }
        let degrees = self.space(PAN_TILT_POSITION, is_degrees)?;
        let told =
            self.space(PAN_TILT_POSITION, |uri| !is_degrees(uri) && space.is_none_or(|space| space == uri))?;
        Some((scaled(x, told.x, degrees.x), scaled(y, told.y?, degrees.y?)))
    }

    /// The part of the zoom's travel that a place of it is.
    pub fn travel(&self, x: f64) -> f64 {
        let range = self.space(ZOOM_POSITION, |_| true).map_or(TRAVEL, |space| space.x);
        TRAVEL.nearest(scaled(x, range, TRAVEL))
    }

    /// Where an absolute move goes to, and the name of the space; `None` where the camera does not take degrees.
    pub fn place(&self, motion: &Motion) -> Option<(f64, f64, &str, Option<f64>)> {
        let Motion::Absolute { pan_deg, tilt_deg, zoom, .. } = *motion else { return None };
        let space = self.space(PAN_TILT_POSITION, is_degrees)?;
        let zoom =
            zoom.and_then(|travel| Some(scaled(travel, TRAVEL, self.space(ZOOM_POSITION, |_| true)?.x)));
        Some((space.x.nearest(pan_deg), space.y?.nearest(tilt_deg), &space.uri, zoom))
    }
}

/// A value in one range as it is in another.
fn scaled(value: f64, from: Range, to: Range) -> f64 {
    to.min + (value - from.min) / (from.max - from.min) * (to.max - to.min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn abilities(spaces: &str, timeout: (&str, &str)) -> Abilities {
        let (min, max) = timeout;
        let xml = format!(
            "<Body><GetConfigurationOptionsResponse><PTZConfigurationOptions><Spaces>{spaces}</Spaces><PTZTimeout><Min>{min}</Min><Max>{max}</Max></PTZTimeout></PTZConfigurationOptions></GetConfigurationOptionsResponse></Body>"
        );
        parse_abilities(&Element::parse(&xml).unwrap())
    }

    fn space(kind: &str, uri: &str, (x0, x1): (f64, f64), (y0, y1): (f64, f64)) -> String {
        format!(
            "<{kind}><URI>http://www.onvif.org/ver10/tptz/PanTiltSpaces/{uri}</URI><XRange><Min>{x0}</Min><Max>{x1}</Max></XRange><YRange><Min>{y0}</Min><Max>{y1}</Max></YRange></{kind}>"
        )
    }

    #[test]
    fn the_timeout_is_the_nearest_that_the_camera_takes() {
        let s = Duration::from_secs;
        for (range, expected) in [
            (("PT1S", "PT10S"), MoveTimeout::After(s(2))),
            (("PT5S", "PT1M"), MoveTimeout::After(s(5))),
            (("PT0S", "PT1S"), MoveTimeout::After(s(1))),
            (("PT0S", "PT0S"), MoveTimeout::Never),
            (("", "soon"), MoveTimeout::After(s(2))),
        ] {
            assert_eq!(abilities("", range).timeout, expected, "{range:?}");
        }
    }

    #[test]
    fn durations_are_read() {
        for (text, seconds) in [("PT2S", 2.0), ("PT1M2.5S", 62.5), ("P0DT1H", 3600.0), ("P1D", 86_400.0)] {
            assert_eq!(duration(text), Some(Duration::from_secs_f64(seconds)), "{text}");
        }
        for text in ["", "2", "P1Y", "P1M", "PT-1S", "PTS", "P9999D", "PT1", "PTNaNS"] {
            assert_eq!(duration(text), None, "{text}");
        }
    }

    #[test]
    fn generic_velocities_are_the_cube_of_the_part() {
        let velocity = abilities("", ("PT1S", "PT10S")).velocity((-1.0, 0.5), Some(-0.3));
        assert_eq!(velocity, Velocity { pan_tilt: Some((-1.0, 0.125)), space: None, zoom: Some(-0.3) });
    }

    #[test]
    fn velocities_in_degrees_are_taken_where_they_are_offered() {
        let offered = space(PAN_TILT_VELOCITY, "VelocityGenericSpace", (-1.0, 1.0), (-1.0, 1.0))
            + &space(PAN_TILT_VELOCITY, "VelocitySpaceDegrees", (-120.0, 120.0), (-80.0, 80.0));
        let abilities = abilities(&offered, ("PT1S", "PT10S"));
        let velocity = abilities.velocity((1.0, -0.5), None);
        assert_eq!(velocity.pan_tilt, Some((80.0, -10.0)));
        assert!(velocity.space.unwrap().ends_with("VelocitySpaceDegrees"));
        assert_eq!(abilities.attributes().unwrap().speeds[99].value, 80.0);
        assert_eq!(abilities.parameters().continuous_zoom, Some(false), "of zoom it says nothing");
    }

    #[test]
    fn velocities_in_fields_of_view_are_taken_where_there_are_none_in_degrees() {
        let generic = space(PAN_TILT_VELOCITY, "VelocityGenericSpace", (-1.0, 1.0), (-1.0, 1.0));
        let fields = space(PAN_TILT_VELOCITY, "VelocitySpaceFOV", (-7.0, 7.0), (-5.0, 5.0));
        let degrees = space(PAN_TILT_VELOCITY, "VelocitySpaceDegrees", (-120.0, 120.0), (-80.0, 80.0));
        let unit = |spaces: &str| abilities(spaces, ("", "")).attributes().map(|told| told.speed_unit);
        assert_eq!(unit(&generic), None);
        assert_eq!(unit(&(generic.clone() + &fields + &degrees)), Some(SpeedUnit::Degrees));
        let mut some = abilities(&(generic + &fields), ("", ""));
        let told = some.attributes().unwrap();
        assert_eq!((told.speed_unit, told.speeds[99].value), (SpeedUnit::Fields, 5.0));
        let velocity = some.velocity((1.0, -0.5), None);
        assert_eq!(velocity.pan_tilt, Some((5.0, -0.625)));
        some.forget_space(&velocity.space.unwrap());
        assert_eq!(some.velocity((1.0, -0.5), None).pan_tilt, Some((1.0, -0.125)));
    }

    #[test]
    fn places_are_degrees_only_where_degrees_are_known() {
        let generic = space(PAN_TILT_POSITION, "PositionGenericSpace", (-1.0, 1.0), (-1.0, 1.0));
        let degrees =
            space(PAN_TILT_POSITION, "SphericalPositionSpaceDegrees", (-170.0, 170.0), (-20.0, 90.0));
        assert_eq!(abilities(&generic, ("", "")).degrees((0.5, 0.0), None), None);
        let both = abilities(&(generic + &degrees), ("", ""));
        assert_eq!(both.degrees((0.5, 0.0), None), Some((85.0, 35.0)));
        assert_eq!(both.degrees((30.0, 40.0), Some("x/SphericalPositionSpaceDegrees")), Some((30.0, 40.0)));
        assert_eq!(both.limits().pan_deg, Some(Range { min: -170.0, max: 170.0 }));
        assert_eq!((both.travel(0.0), both.travel(2.0)), (0.0, 1.0));
    }
}
