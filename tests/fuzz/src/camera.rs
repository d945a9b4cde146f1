// SPDX-License-Identifier: MPL-2.0

//! What cameras say.

use futures_util::FutureExt;
use onvif::{Abilities, Answer, parse_abilities};
use pipeline_supervisor::video::rtsp_host;
use pipeline_supervisor::video::rtsp_message::Item;
use servo::TableRow;
use session::http::{CompleteResponse, Credentials, Location, Secret, answer_to_challenge, answer_to_cookie};
use vapix::{
    parse_attributes, parse_limits, parse_move_speed, parse_parameters, parse_position, parse_presets,
    parse_queue_place,
};

use super::text;

pub fn challenge(bytes: &[u8]) -> bool {
    let credentials = Credentials { user: "root".to_owned(), password: Secret::new("pass") };
    answer_to_challenge(text(bytes).trim_end(), credentials, "/axis-cgi/com/ptz.cgi?query=position").is_ok()
}

pub fn position(bytes: &[u8]) -> bool {
    let Ok(position) = parse_position(&text(bytes)) else { return false };
    let told = [position.pan_deg, position.tilt_deg, position.zoom];
    assert!(told.into_iter().flatten().all(f64::is_finite), "{position:?}");
    true
}

pub fn limits(bytes: &[u8]) -> bool {
    let Ok(limits) = parse_limits(&text(bytes)) else { return false };
    let told = [limits.pan_deg, limits.tilt_deg, limits.zoom, limits.field_angle_deg];
    assert!(told.into_iter().flatten().all(|range| range.min < range.max), "{limits:?}");
    true
}

pub fn attributes(bytes: &[u8]) -> bool {
    let Ok(attributes) = parse_attributes(&text(bytes)) else { return false };
    for table in [&attributes.speeds, &attributes.zooms] {
        let grows = |pair: &[_]| matches!(pair, [a, b] if grow(a, b));
        assert!(table.windows(2).all(grows), "{table:?}");
    }
    true
}

fn grow(a: &TableRow, b: &TableRow) -> bool {
    a.setting < b.setting && a.value <= b.value
}

pub fn move_speed(bytes: &[u8]) -> bool {
    parse_move_speed(&text(bytes)).inspect(|speed| assert!(*speed > 0.0 && *speed <= 1.0)).is_ok()
}

pub fn parameters(bytes: &[u8]) -> bool {
    parse_parameters(&text(bytes), "1").is_ok()
}

pub fn queue(bytes: &[u8]) -> bool {
    let Ok(place) = parse_queue_place(&text(bytes)) else { return false };
    assert!((5..=3600).contains(&place.poll_every.as_secs()), "{place:?}");
    true
}

pub fn presets(bytes: &[u8]) -> bool {
    let Ok(presets) = parse_presets(&text(bytes)) else { return false };
    assert!(presets.0.iter().all(|(_, name)| presets.number(name).is_some()), "{presets:?}");
    true
}

/// One that comes back to us in a header must stay one.
pub fn cookies(bytes: &[u8]) -> bool {
    let Some(cookie) = answer_to_cookie(text(bytes).trim_end()) else { return false };
    assert!(cookie.find('=').is_some_and(|end| end > 0) && !cookie.contains(';'), "{cookie}");
    true
}

/// Any answer of ONVIF's may come in place of any other.
pub fn onvif(bytes: &[u8]) -> bool {
    let answer = CompleteResponse { status: 200, body: text(bytes).into_owned() };
    let Ok(Answer::Body(body)) = onvif::read_answer(&answer) else { return false };
    let abilities = parse_abilities(&body);
    let told = onvif::parse_position(&body, &abilities);
    let position = told.unwrap_or_default();
    let places = [position.pan_deg, position.tilt_deg, position.zoom];
    assert!(places.into_iter().flatten().all(f64::is_finite), "{position:?}");
    abilities != Abilities::default()
        || told.is_some()
        || onvif::parse_date(&body).is_some()
        || onvif::parse_services(&body).is_some()
        || !onvif::parse_profiles(&body).is_empty()
        || !onvif::parse_streams(&body).is_empty()
        || onvif::parse_stream_address(&body).is_some()
        || onvif::parse_presets(&body).is_some()
        || !onvif::parse_announcements(&text(bytes)).is_empty()
}

/// An address holds no user and no password, and is the same once it was written down.
pub fn location(bytes: &[u8]) -> bool {
    let Ok((location, _)) = Location::parse(&text(bytes)) else { return false };
    let (again, info) = Location::parse(&location.to_string()).expect("an address that was written down");
    assert_eq!(again, location);
    assert!(info.user.is_none() && info.password.is_none(), "{location}");
    true
}

/// A packet or a message of RTSP is the same once it was passed on.
pub fn rtsp(bytes: &[u8]) -> bool {
    let mut wire = bytes;
    let mut understood = false;
    // Bytes in memory are there at once.
    while let Some(Ok(Some(item))) = Item::read(&mut wire).now_or_never() {
        let passed_on = item.to_bytes();
        let again = Item::read(&mut &passed_on[..]).now_or_never();
        assert!(again.is_some_and(|again| {
            again.is_ok_and(|again| again.is_some_and(|again| again.to_bytes() == passed_on))
        }));
        if let Item::Message(message) = &item {
            let _ = (message.status(), message.request().map(|(_, address)| rtsp_host(address)));
        }
        understood = true;
    }
    understood
}

/// What a stream announces before it is decoded.
pub fn picture(bytes: &[u8]) -> bool {
    ptztrack::parsers::picture(bytes)
}
