// SPDX-License-Identifier: MPL-2.0

//! What a camera tells, without the envelope.

use chrono::NaiveDate;
use serde::{Deserialize, Serialize};
use servo::{Position, Presets};

use crate::abilities::Abilities;
use crate::soap::Element;

/// More profiles or presets than a camera has; some list 300 of the latter.
const MOST: usize = 1024;

/// Bytes of a token, a name or a path; what has more is none. They are said in each message, and to the watchdog.
const LONGEST: usize = 1024;

/// Paths of the services that matter here, on the camera's own host: the addresses that cameras tell are often not those by
/// which they are reached, and a password is for its own host only.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Services {
    /// Media.
    pub media: String,
    /// Media 2, which knows H.265.
    pub media2: Option<String>,
    /// PTZ, of a camera that turns.
    pub ptz: Option<String>,
}

/// A media profile that has a PTZ configuration.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Profile {
    /// By which it is asked for.
    pub token: String,
    /// As the camera's pages show it.
    pub name: String,
    /// Token of its PTZ configuration.
    pub configuration: String,
}

/// Reads `GetSystemDateAndTimeResponse`: seconds since 1970 by the camera's clock.
pub fn parse_date(body: &Element) -> Option<i64> {
    let told = body.find(&["GetSystemDateAndTimeResponse", "SystemDateAndTime"])?;
    let date_time = told.child("UTCDateTime").or(told.child("LocalDateTime"))?;
    let number = |path: [&str; 2]| date_time.find(&path)?.text().parse::<u32>().ok();
    let year = i32::try_from(number(["Date", "Year"])?).ok()?;
    let date = NaiveDate::from_ymd_opt(year, number(["Date", "Month"])?, number(["Date", "Day"])?)?;
    let time = date.and_hms_opt(
        number(["Time", "Hour"])?,
        number(["Time", "Minute"])?,
        number(["Time", "Second"])?,
    )?;
    Some(time.and_utc().timestamp())
}

/// Reads `GetServicesResponse` or `GetCapabilitiesResponse`; `None` of what has no video.
pub fn parse_services(body: &Element) -> Option<Services> {
    let services = body.child("GetServicesResponse");
    let listed = |namespace: &str| {
        let mut all = services?.children("Service");
        let found =
            all.find(|service| service.child("Namespace").is_some_and(|ns| ns.text() == namespace))?;
        path(found.child("XAddr")?.text())
    };
    let capabilities = body.find(&["GetCapabilitiesResponse", "Capabilities"]);
    let capability = |name: &str| path(capabilities?.find(&[name, "XAddr"])?.text());
    let ptz = listed("http://www.onvif.org/ver20/ptz/wsdl").or_else(|| capability("PTZ"));
    let media2 = listed("http://www.onvif.org/ver20/media/wsdl");
    let media = listed("http://www.onvif.org/ver10/media/wsdl").or_else(|| capability("Media"))?;
    Some(Services { media, media2, ptz })
}

/// Path and query of an address. HTTP knows no backslash: it would be sent as another path than is signed.
fn path(address: &str) -> Option<String> {
    let (_, rest) = address.split_once("://")?;
    let path = bounded(&rest[rest.find('/')?..])?;
    path.chars().all(|c| c.is_ascii_graphic() && c != '\\').then_some(path)
}

/// Of a length that something real has.
fn bounded(text: &str) -> Option<String> {
    (text.len() <= LONGEST).then(|| text.to_owned())
}

/// Reads `GetProfilesResponse`: the profiles that have a PTZ configuration.
pub fn parse_profiles(body: &Element) -> Vec<Profile> {
    let Some(response) = body.child("GetProfilesResponse") else { return Vec::new() };
    let profiles = response.children("Profiles").take(MOST).filter_map(|profile| {
        Some(Profile {
            token: bounded(profile.attribute("token")?)?,
            name: bounded(profile.child("Name").map_or("", Element::text))?,
            configuration: bounded(profile.child("PTZConfiguration")?.attribute("token")?)?,
        })
    });
    profiles.collect()
}

/// Reads `GetStatusResponse`; its `MoveStatus` is left aside, as some cameras never change it (frigate issue 7958).
pub fn parse_position(body: &Element, abilities: &Abilities) -> Option<Position> {
    let told = body.find(&["GetStatusResponse", "PTZStatus", "Position"])?;
    let degrees = told.child("PanTilt").and_then(|place| {
        let place = (place.number("x")?, place.number("y")?, place.attribute("space"));
        let degrees = abilities.degrees((place.0, place.1), place.2)?;
        (degrees.0.is_finite() && degrees.1.is_finite()).then_some(degrees)
    });
    let zoom = told.child("Zoom").and_then(|zoom| zoom.number("x")).map(|x| abilities.travel(x));
    let position =
        Position { pan_deg: degrees.map(|(pan, _)| pan), tilt_deg: degrees.map(|(_, tilt)| tilt), zoom };
    (position != Position::default()).then_some(position)
}

/// Reads `GetPresetsResponse`: the tokens, and the presets numbered by their place among them, from 1.
pub fn parse_presets(body: &Element) -> Option<(Vec<String>, Presets)> {
    let response = body.child("GetPresetsResponse")?;
    let (mut tokens, mut named) = (Vec::new(), Vec::new());
    for preset in response.children("Preset").take(MOST) {
        let Some(token) = preset.attribute("token") else { continue };
        tokens.push(token.to_owned());
        let name = preset.child("Name").map_or(token, Element::text);
        // At most `MOST`.
        named.push((tokens.len() as u32, name.to_owned()));
    }
    Some((tokens, Presets(named)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(inner: &str) -> Element {
        Element::parse(&format!("<Body>{inner}</Body>")).unwrap()
    }

    #[test]
    fn the_cameras_time_is_read() {
        let told = |kind: &str| {
            body(&format!(
                "<GetSystemDateAndTimeResponse><SystemDateAndTime><{kind}><Time><Hour>7</Hour><Minute>50</Minute><Second>45</Second></Time><Date><Year>2010</Year><Month>9</Month><Day>16</Day></Date></{kind}></SystemDateAndTime></GetSystemDateAndTimeResponse>"
            ))
        };
        assert_eq!(parse_date(&told("UTCDateTime")), Some(1_284_623_445));
        assert_eq!(parse_date(&told("LocalDateTime")), Some(1_284_623_445));
        assert_eq!(parse_date(&told("Other")), None);
    }

    #[test]
    fn services_are_on_the_cameras_own_host() {
        let list = body(
            "<GetServicesResponse><Service><Namespace>http://www.onvif.org/ver20/media/wsdl</Namespace><XAddr>http://10.0.0.1/onvif/media2</XAddr></Service><Service><Namespace>http://www.onvif.org/ver10/media/wsdl</Namespace><XAddr>http://10.0.0.1:8080/onvif/media?a=b</XAddr></Service><Service><Namespace>http://www.onvif.org/ver20/ptz/wsdl</Namespace><XAddr>http://10.0.0.1/onvif/ptz</XAddr></Service></GetServicesResponse>",
        );
        let expected = Services {
            media: "/onvif/media?a=b".to_owned(),
            media2: Some("/onvif/media2".to_owned()),
            ptz: Some("/onvif/ptz".to_owned()),
        };
        assert_eq!(parse_services(&list), Some(expected.clone()));
        let old = body(
            "<GetCapabilitiesResponse><Capabilities><Media><XAddr>http://h/onvif/media?a=b</XAddr></Media><PTZ><XAddr>http://h/onvif/ptz</XAddr></PTZ></Capabilities></GetCapabilitiesResponse>",
        );
        assert_eq!(parse_services(&old), Some(Services { media2: None, ..expected }));
        assert_eq!(parse_services(&body("<GetCapabilitiesResponse/>")), None);
    }

    #[test]
    fn only_a_profile_with_ptz_is_one() {
        let list = body(
            "<GetProfilesResponse><Profiles token='main'><Name>Main</Name></Profiles><Profiles token='sub'><Name>Sub</Name><PTZConfiguration token='ptz0'/></Profiles></GetProfilesResponse>",
        );
        let expected =
            Profile { token: "sub".to_owned(), name: "Sub".to_owned(), configuration: "ptz0".to_owned() };
        assert_eq!(parse_profiles(&list), [expected]);
    }

    #[test]
    fn a_path_is_one_that_can_be_sent() {
        assert_eq!(
            path("http://h//elsewhere/p").as_deref(),
            Some("//elsewhere/p"),
            "on the camera's own host"
        );
        assert_eq!(path("http://h/\\elsewhere/p"), None);
        assert_eq!(
            path(&format!("http://h/{}", "p".repeat(LONGEST - 1))).map(|path| path.len()),
            Some(LONGEST)
        );
        assert_eq!(path(&format!("http://h/{}", "p".repeat(LONGEST))), None);
    }

    /// The watchdog of all cameras is told of it.
    #[test]
    fn a_profile_with_words_without_end_is_none() {
        let long = "&quot;".repeat(40_000);
        let profile = |token: &str, name: &str, configuration: &str| {
            parse_profiles(&body(&format!(
                "<GetProfilesResponse><Profiles token='{token}'><Name>{name}</Name><PTZConfiguration token='{configuration}'/></Profiles></GetProfilesResponse>"
            )))
        };
        assert_eq!(profile("a", "b", "c").len(), 1);
        assert_eq!(profile(&long, "b", "c"), []);
        assert_eq!(profile("a", &long, "c"), []);
        assert_eq!(profile("a", "b", &long), []);
    }

    #[test]
    fn presets_are_numbered() {
        let list = body(
            "<GetPresetsResponse><Preset token='x7'><Name>Door</Name></Preset><Preset token='x9'/></GetPresetsResponse>",
        );
        let (tokens, presets) = parse_presets(&list).unwrap();
        assert_eq!(tokens, ["x7", "x9"]);
        assert_eq!((presets.number("Door"), presets.number("x9")), (Some(1), Some(2)));
    }
}
