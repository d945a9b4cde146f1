// SPDX-License-Identifier: MPL-2.0

//! `home` and `look-at` as properties have them.

use servo::{Home, PanTilt, Position};
use session::ZoomStep;

/// Reads `start`, `pan,tilt` or `pan,tilt,zoom` in degrees and zoom steps, or the name of a preset.
///
/// # Errors
/// What is wrong with it, in words.
pub fn parse_home(text: &str) -> Result<Home, String> {
    if text == "start" {
        return Ok(Home::Start);
    }
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        // A preset may be called 7; a direction has two parts.
        None | Some([_]) => Ok(Home::Preset(text.to_owned())),
        Some([pan, tilt]) => position(*pan, *tilt, None),
        Some([pan, tilt, zoom]) => position(*pan, *tilt, Some(ZoomStep(*zoom))),
        Some(_) => Err(format!("`{text}` has more parts than pan,tilt,zoom")),
    }
}

/// Reads `pan,tilt` or `pan,tilt,field of view`, all in degrees.
///
/// # Errors
/// What is wrong with it, in words.
pub fn parse_look_at(text: &str) -> Result<Home, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let (direction, fov_deg) = match numbers.as_deref() {
        Some([pan, tilt]) => (PanTilt::new(*pan, *tilt), None),
        Some([pan, tilt, fov_deg]) => (PanTilt::new(*pan, *tilt), Some(*fov_deg)),
        _ => return Err(format!("`{text}` is neither pan,tilt nor pan,tilt,field of view in degrees")),
    };
    let sees = fov_deg.is_none_or(|fov_deg| fov_deg > 0.0 && fov_deg < 180.0);
    if !direction.is_finite() || direction.largest() > 180.0 || !sees {
        return Err(
            "pan and tilt must be from -180 to 180 degrees, the field of view from 0 to 180".to_owned()
        );
    }
    Ok(Home::View { direction, fov_deg })
}

fn position(pan: f64, tilt: f64, step: Option<ZoomStep>) -> Result<Home, String> {
    let turns = [pan, tilt].iter().all(|angle| (-180.0..=180.0).contains(angle));
    let zooms = step.is_none_or(|step| (ZoomStep::FIRST..=ZoomStep::LAST).contains(&step));
    if !turns || !zooms {
        return Err("pan and tilt must be from -180 to 180 degrees, zoom from 1 to 9999 steps".to_owned());
    }
    Ok(Home::Position(Position {
        pan_deg: Some(pan),
        tilt_deg: Some(tilt),
        zoom: step.map(ZoomStep::travel),
    }))
}

/// What [`parse_home`] and [`parse_look_at`] read.
pub fn home_text(home: &Home) -> String {
    match home {
        Home::Start => "start".to_owned(),
        Home::Position(position) => {
            let zoom =
                position.zoom.map_or_else(String::new, |travel| format!(",{}", ZoomStep::at(travel).0));
            format!("{},{}{zoom}", position.pan_deg.unwrap_or(0.0), position.tilt_deg.unwrap_or(0.0))
        }
        Home::Preset(name) => name.clone(),
        Home::View { direction, fov_deg } => {
            let fov = fov_deg.map_or_else(String::new, |fov_deg| format!(",{fov_deg}"));
            format!("{},{}{fov}", direction.pan, direction.tilt)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(pan: f64, tilt: f64, zoom: Option<f64>) -> Position {
        Position { pan_deg: Some(pan), tilt_deg: Some(tilt), zoom }
    }

    #[test]
    fn homes_are_read() {
        assert_eq!(parse_home("start"), Ok(Home::Start));
        assert_eq!(parse_home("-12.5, 3"), Ok(Home::Position(at(-12.5, 3.0, None))));
        assert_eq!(parse_home("10,-5,9999"), Ok(Home::Position(at(10.0, -5.0, Some(1.0)))));
        for name in ["Gate", "7", "Gate, left", "north,south"] {
            assert_eq!(parse_home(name), Ok(Home::Preset(name.to_owned())), "{name}");
        }
        for wrong in ["200,0", "0,-190", "0,0,0", "0,0,20000", "NaN,1", "1,2,3,4"] {
            assert!(parse_home(wrong).is_err(), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn a_home_is_told_as_it_was_set(pan in -180.0..180.0f64, tilt in -180.0..180.0f64, zoom in prop::option::of(1u32..=9999)) {
            let text = format!("{pan},{tilt}") + &zoom.map_or_else(String::new, |step| format!(",{step}"));
            prop_assert_eq!(home_text(&parse_home(&text).unwrap()), text);
        }

        #[test]
        fn a_view_is_told_as_it_was_set(pan in -180.0..180.0f64, tilt in -180.0..180.0f64, fov in prop::option::of(1u32..=179)) {
            let text = format!("{pan},{tilt}") + &fov.map_or_else(String::new, |fov| format!(",{fov}"));
            prop_assert_eq!(home_text(&parse_look_at(&text).unwrap()), text);
        }

        #[test]
        fn any_text_is_a_home_or_refused(text in ".{0,40}") {
            let _ = (parse_home(&text), parse_look_at(&text));
        }
    }
}
