// SPDX-License-Identifier: MPL-2.0

//! `ptz.cgi`: what a request asks for.

use std::str::FromStr;

use super::Args;
use crate::kinematics::Motion;

/// A request taken apart.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Request {
    pub motions: Vec<Motion>,
    /// Lens settings and the like: name and new value.
    pub adjustments: Vec<Adjustment>,
    pub preset: Option<Preset>,
    pub question: Option<Question>,
}

/// A change of something that does not move the picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Adjustment {
    /// `focus=500`
    To(&'static str, f64),
    /// `rfocus=-20`
    By(&'static str, f64),
    /// `autofocus=on`
    Switch(&'static str, bool),
}

/// Which preset to go to.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Preset {
    Named(String),
    Numbered(u32),
}

/// What the request wants to know.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Question {
    Driver,
    Help,
    About(String),
}

/// The steps and speeds that VAPIX counts in.
const STEPS: (f64, f64) = (1.0, 9999.0);
const STEP_CHANGE: (f64, f64) = (-9999.0, 9999.0);
const SPEEDS: (f64, f64) = (-100.0, 100.0);
const TURN: (f64, f64) = (-360.0, 360.0);

impl Request {
    /// Takes `args` apart, for a camera whose picture is `size` pixels unless the request says otherwise.
    pub fn parse(args: &Args, size: (u32, u32)) -> Result<Self, String> {
        let mut request = Self::default();
        let mut absolute = [None; 3];
        let mut relative = [None; 3];
        let mut unlimited = false;
        for (name, value) in args {
            match name.as_str() {
                "camera" => channel(value)?,
                "pan" => absolute[0] = Some(clamped(name, value, (-180.0, 180.0))?),
                "tilt" => absolute[1] = Some(clamped(name, value, (-180.0, 180.0))?),
                "zoom" => absolute[2] = Some(clamped(name, value, STEPS)?.trunc()),
                "rpan" => relative[0] = Some(number(name, value, TURN)?),
                "rtilt" => relative[1] = Some(number(name, value, TURN)?),
                "rzoom" => relative[2] = Some(number(name, value, STEP_CHANGE)?.trunc()),
                "continuouspantiltmove" => {
                    let [pan, tilt] = numbers(name, value, SPEEDS)?;
                    request.motions.push(Motion::PanTilt { pan, tilt });
                }
                "continuouszoommove" => request.motions.push(Motion::Zoom(number(name, value, SPEEDS)?)),
                "move" => request.named_move(value)?,
                // Ahead of the moves it is for, wherever it stands.
                "speed" => request.motions.insert(0, Motion::Speed(number(name, value, (1.0, 100.0))?)),
                "center" => {
                    let [x, y] = numbers(name, value, (0.0, f64::MAX))?;
                    request.motions.push(centre(args, size, x, y, 1.0)?);
                }
                "areazoom" => {
                    let [x, y, zoom] = numbers(name, value, (0.0, f64::MAX))?;
                    if zoom < 1.0 {
                        return Err(invalid(name, value));
                    }
                    request.motions.push(centre(args, size, x, y, zoom / 100.0)?);
                }
                "proportionalspeed" if value == "disabled" => unlimited = true,
                "proportionalspeed" => return Err(invalid(name, value)),
                "gotoserverpresetname" => request.preset = Some(Preset::Named(value.clone())),
                "gotoserverpresetno" | "gotodevicepreset" => {
                    request.preset = Some(Preset::Numbered(value.parse().map_err(|_| invalid(name, value))?));
                }
                "whoami" if value == "1" => request.question = Some(Question::Driver),
                "info" if value == "1" => request.question = Some(Question::Help),
                "whoami" | "info" => return Err(invalid(name, value)),
                "query" => request.question = Some(Question::About(value.clone())),
                _ => request.adjustments.extend(adjustment(name, value)?),
            }
        }
        request.add_positions(absolute, relative);
        request.motions.extend(unlimited.then_some(Motion::Unlimited));
        Ok(request)
    }

    fn add_positions(&mut self, absolute: [Option<f64>; 3], relative: [Option<f64>; 3]) {
        let [pan_deg, tilt_deg, zoom_step] = absolute;
        if absolute.iter().any(Option::is_some) {
            self.motions.push(Motion::Absolute { pan_deg, tilt_deg, zoom_step });
        }
        if relative.iter().any(Option::is_some) {
            let [pan_deg, tilt_deg, zoom_step] = relative.map(Option::unwrap_or_default);
            self.motions.push(Motion::Relative { pan_deg, tilt_deg, zoom_step });
        }
    }

    fn named_move(&mut self, name: &str) -> Result<(), String> {
        let (pan, tilt) = match name {
            "home" => {
                self.preset = Some(Preset::Named("Home".into()));
                return Ok(());
            }
            "stop" => {
                self.motions.push(Motion::Stop);
                return Ok(());
            }
            "up" => (0.0, 1.0),
            "down" => (0.0, -1.0),
            "left" => (-1.0, 0.0),
            "right" => (1.0, 0.0),
            "upleft" => (-1.0, 1.0),
            "upright" => (1.0, 1.0),
            "downleft" => (-1.0, -1.0),
            "downright" => (1.0, -1.0),
            _ => return Err(invalid("move", name)),
        };
        self.motions.push(Motion::Nudge { pan, tilt });
        Ok(())
    }
}

fn channel(value: &str) -> Result<(), String> {
    match value {
        "1" | "all" => Ok(()),
        _ => Err(format!("camera: no such camera: {value}")),
    }
}

fn invalid(name: &str, value: &str) -> String {
    format!("{name}: invalid value: {value}")
}

fn number(name: &str, value: &str, range: (f64, f64)) -> Result<f64, String> {
    match f64::from_str(value) {
        Ok(number) if number >= range.0 && number <= range.1 => Ok(number),
        _ => Err(invalid(name, value)),
    }
}

/// Positions out of range are not refused: the camera goes as far as it can (VAPIX, PTZ.Limit).
fn clamped(name: &str, value: &str, range: (f64, f64)) -> Result<f64, String> {
    number(name, value, (f64::MIN, f64::MAX)).map(|number| number.clamp(range.0, range.1))
}

fn numbers<const N: usize>(name: &str, value: &str, range: (f64, f64)) -> Result<[f64; N], String> {
    let parsed: Result<Vec<f64>, String> = value.split(',').map(|part| number(name, part, range)).collect();
    parsed?.try_into().map_err(|_| invalid(name, value))
}

fn centre(args: &Args, size: (u32, u32), x: f64, y: f64, magnify: f64) -> Result<Motion, String> {
    let length = |name: &str, default: u32| {
        args.iter()
            .find(|arg| arg.0 == name)
            .map_or(Ok(f64::from(default)), |arg| number(name, &arg.1, (1.0, 100_000.0)))
    };
    let (width, height) = (length("imagewidth", size.0)?, length("imageheight", size.1)?);
    // The client's picture may be stretched; its height counts in parts of the height, then in picture widths.
    let tall = f64::from(size.1) / f64::from(size.0);
    Ok(Motion::Centre { x: x / width - 0.5, y: (y / height - 0.5) * tall, magnify })
}

fn adjustment(name: &str, value: &str) -> Result<Option<Adjustment>, String> {
    let adjustment = match name {
        "focus" => Adjustment::To("focus", number(name, value, STEPS)?),
        "iris" => Adjustment::To("iris", number(name, value, STEPS)?),
        "brightness" => Adjustment::To("brightness", number(name, value, STEPS)?),
        "rfocus" => Adjustment::By("focus", number(name, value, STEP_CHANGE)?),
        "riris" => Adjustment::By("iris", number(name, value, STEP_CHANGE)?),
        "rbrightness" => Adjustment::By("brightness", number(name, value, STEP_CHANGE)?),
        "autofocus" => Adjustment::Switch("autofocus", on_off(name, value)?),
        "autoiris" => Adjustment::Switch("autoiris", on_off(name, value)?),
        "backlight" => Adjustment::Switch("backlight", on_off(name, value)?),
        "ircutfilter" if value == "auto" => Adjustment::Switch("ircutfilter", true),
        "ircutfilter" => Adjustment::Switch("ircutfilter", on_off(name, value)?),
        "continuousfocusmove" | "continuousirismove" | "continuousbrightnessmove" => {
            number(name, value, SPEEDS)?;
            return Ok(None);
        }
        // Clients send time stamps, `html=no` and more: what is not known is no error.
        _ => return Ok(None),
    };
    Ok(Some(adjustment))
}

fn on_off(name: &str, value: &str) -> Result<bool, String> {
    match value {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(invalid(name, value)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vapix::parse_args;
    use proptest::prelude::*;

    fn parse(query: &str) -> Result<Request, String> {
        Request::parse(&parse_args(query.as_bytes()), (640, 480))
    }

    fn motions(query: &str) -> Vec<Motion> {
        parse(query).unwrap().motions
    }

    #[test]
    fn moves_of_all_kinds() {
        assert_eq!(
            motions("continuouspantiltmove=-49,0&camera=1"),
            [Motion::PanTilt { pan: -49.0, tilt: 0.0 }]
        );
        assert_eq!(
            motions("continuouspantiltmove=1.5,-2.5&continuouszoommove=10&timestamp=17&html=no"),
            [Motion::PanTilt { pan: 1.5, tilt: -2.5 }, Motion::Zoom(10.0)]
        );
        assert_eq!(
            motions("pan=10.5&tilt=-3&zoom=12.9&speed=30"),
            [
                Motion::Speed(30.0),
                Motion::Absolute { pan_deg: Some(10.5), tilt_deg: Some(-3.0), zoom_step: Some(12.0) }
            ]
        );
        assert_eq!(
            motions("rpan=-5&rzoom=100"),
            [Motion::Relative { pan_deg: -5.0, tilt_deg: 0.0, zoom_step: 100.0 }]
        );
        assert_eq!(motions("move=upleft"), [Motion::Nudge { pan: -1.0, tilt: 1.0 }]);
        assert_eq!(motions("move=stop"), [Motion::Stop]);
        assert_eq!(parse("move=home").unwrap().preset, Some(Preset::Named("Home".into())));
    }

    #[test]
    fn centring_counts_in_the_clients_pixels() {
        assert_eq!(motions("center=320,240"), [Motion::Centre { x: 0.0, y: 0.0, magnify: 1.0 }]);
        assert_eq!(
            motions("center=0,100&imagewidth=200&imageheight=100"),
            [Motion::Centre { x: -0.5, y: 0.375, magnify: 1.0 }]
        );
        assert_eq!(motions("areazoom=640,240,300"), [Motion::Centre { x: 0.5, y: 0.0, magnify: 3.0 }]);
    }

    #[test]
    fn positions_out_of_range_are_clamped_not_refused() {
        assert_eq!(
            motions("pan=250&zoom=20000"),
            [Motion::Absolute { pan_deg: Some(180.0), tilt_deg: None, zoom_step: Some(9999.0) }]
        );
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        for (query, message) in [
            ("pan=north", "pan: invalid value: north"),
            ("pan=nan", "pan: invalid value: nan"),
            ("continuouspantiltmove=5", "continuouspantiltmove: invalid value: 5"),
            ("continuouspantiltmove=5,", "continuouspantiltmove: invalid value: "),
            ("continuouspantiltmove=500,0", "continuouspantiltmove: invalid value: 500"),
            ("move=sideways", "move: invalid value: sideways"),
            ("camera=2", "camera: no such camera: 2"),
            ("autofocus=maybe", "autofocus: invalid value: maybe"),
            ("areazoom=1,1,0", "areazoom: invalid value: 1,1,0"),
            ("speed=0", "speed: invalid value: 0"),
            ("center=1,1&imagewidth=0", "imagewidth: invalid value: 0"),
        ] {
            assert_eq!(parse(query), Err(message.into()), "{query}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_request_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let _ = Request::parse(&parse_args(&bytes), (640, 480));
        }
    }
}
