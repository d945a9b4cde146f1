// SPDX-License-Identifier: MPL-2.0

//! The table of properties: one entry gives specification, default, documentation, getter and setter.

use std::ops::RangeInclusive;
use std::time::Duration;

use glib::prelude::*;
use glib::{HasParamSpec, ParamSpec, Value};
use gst::prelude::*;

use ptztrack_contract::mistaken_unit;
use session::ZoomStep;
use session::http::{Authentication, Location, Secret};

use crate::Particulars;
use crate::home::{home_text, parse_home, parse_look_at};
use crate::settings::{Settings, Steering};

/// When a value that was set counts, and who must hear of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Takes {
    /// From the next READY to PAUSED on.
    AtStart,
    /// At once: the servo hears of it.
    AtOnce,
    /// At once, if no pair of limits is crossed.
    AsLimit,
    /// At once: the camera is spoken to as somebody else.
    AsCredentials,
    /// At once: the camera is stopped before it does something else.
    AsSteering,
}

/// One property.
pub struct Property {
    /// What GObject is to know of it.
    pub spec: ParamSpec,
    /// When a new value counts.
    pub takes: Takes,
    get: Get,
    set: Set,
}

type Get = Box<dyn Fn(&Settings) -> Value + Send + Sync>;
type Set = Box<dyn Fn(&mut Settings, &Value) -> Result<(), String> + Send + Sync>;

/// Where in the settings a value lies.
type Field<T> = fn(&mut Settings) -> &mut T;

impl Property {
    /// Its value.
    pub fn get(&self, settings: &Settings) -> Value {
        (self.get)(settings)
    }

    /// Sets it.
    ///
    /// # Errors
    /// Why it stays as it was, in words.
    pub fn set(&self, settings: &mut Settings, value: &Value) -> Result<(), String> {
        let name = self.spec.name();
        (self.set)(settings, value).map_err(|reason| format!("{reason}; `{name}` stays as it was"))
    }
}

/// What a sink's own properties and those of all sinks are made with.
pub struct Table<'a> {
    particulars: &'a Particulars,
    defaults: &'a Settings,
}

/// An enumeration of GObject's with the values of one of the servo's.
pub trait EnumOf<T>:
    HasParamSpec<ParamSpec = glib::ParamSpecEnum>
    + ToValue
    + StaticType
    + From<T>
    + Into<T>
    + glib::translate::FromGlib<i32>
    + glib::translate::IntoGlib<GlibType = i32>
    + for<'v> glib::value::FromValue<'v>
    + 'static
{
}

impl<T, G> EnumOf<T> for G where
    G: HasParamSpec<ParamSpec = glib::ParamSpecEnum>
        + ToValue
        + StaticType
        + From<T>
        + Into<T>
        + glib::translate::FromGlib<i32>
        + glib::translate::IntoGlib<GlibType = i32>
        + for<'v> glib::value::FromValue<'v>
        + 'static
{
}

impl<'a> Table<'a> {
    /// Of a sink with these particulars and defaults.
    pub fn new(particulars: &'a Particulars, defaults: &'a Settings) -> Self {
        Self { particulars, defaults }
    }

    /// All properties but `stats`, which cannot be set: `own` are those that say which camera it is, in the sink's own way.
    pub fn all<M, A, P, C, S>(&self, own: Vec<Property>) -> Vec<Property>
    where
        M: EnumOf<servo::Mode>,
        A: EnumOf<Authentication>,
        P: EnumOf<servo::Prediction>,
        C: EnumOf<servo::SpeedCurve>,
        S: EnumOf<Steering>,
    {
        let address = self.address();
        std::iter::once(address).chain(own).chain(self.shared::<M, A, P, C, S>()).collect()
    }

    fn address(&self) -> Property {
        let particulars = self.particulars;

        special(
            text(
                "location",
                Takes::AtStart,
                &format!(
                    "Address of the camera, for example {}; a user and a password in it are moved to the properties of that name",
                    particulars.example
                ),
            ),
            |s| s.location.as_ref().map(ToString::to_string).to_value(),
            set_location,
        )
    }

    fn shared<M, A, P, C, S>(&self) -> Vec<Property>
    where
        M: EnumOf<servo::Mode>,
        A: EnumOf<Authentication>,
        P: EnumOf<servo::Prediction>,
        C: EnumOf<servo::SpeedCurve>,
        S: EnumOf<Steering>,
    {
        use Takes::{AsCredentials, AsLimit, AsSteering, AtOnce, AtStart};
        let (t, particulars, environment) = (self, self.particulars, self.particulars.environment);
        vec![
            special(
                text("user", AsCredentials, &format!("User, who needs the right to control PTZ (if user and password are unset: the environment variable {environment}_USER)")),
                |s| s.user.to_value(),
                |s, value| { s.user = string(value); Ok(()) },
            ),
            special(
                (glib::ParamSpecString::builder("password").blurb(&format!("Password, write-only (if user and password are unset: the environment variable {environment}_PASSWORD)")).write_only().mutable_playing().build(), AsCredentials),
                |_| None::<String>.to_value(),
                |s, value| { s.password = string(value).map(Secret::new); Ok(()) },
            ),
            t.choice::<A, _>("auth", AtStart, "How to authenticate to the camera", |s| &mut s.authentication),
            t.duration("timeout", AtStart, "Longest wait for an answer from the camera, in nanoseconds, from 0.1 s to 60 s", millis(100)..=millis(60_000), |s| &mut s.timeout),
            t.switch("insecure", AtStart, "With https, accept any certificate: anybody on the network path can then take over the camera", |s| &mut s.insecure),
            special(
                text("ca-file", AtStart, "With https, accept only certificates signed by an authority in this PEM file (unset: those the system trusts)"),
                |s| s.ca_file.to_value(),
                |s, value| { s.ca_file = string(value); Ok(()) },
            ),
            t.choice::<M, _>("mode", AtOnce, "How the camera is moved", |s| &mut s.servo.mode),
            t.choice::<S, _>("steering", AsSteering, "What the camera is steered to; `off` stops it and leaves it to others", |s| &mut s.steering),
            t.number("gain", AtOnce, "Degrees per second for each degree off the middle, in 1/s; in mode=velocity, a new target is sought at up to twice this", 0.0..=20.0, |s| &mut s.servo.gain),
            t.number("dead-zone", AtOnce, "Offset from the middle that does not start a move, as a fraction of the picture's width; in mode=velocity, while the camera pans, a third of it for tilt", 0.0..=0.5, |s| &mut s.servo.dead_zone),
            t.number("max-speed", AtOnce, "Highest speed of pan and tilt, in degrees per second", 0.1..=1000.0, |s| &mut s.servo.max_speed_deg_s),
            t.number("max-acceleration", AtOnce, "Greatest change of pan and tilt speed, in degrees per second per second; a stop is immediate", 1.0..=10_000.0, |s| &mut s.servo.max_acceleration_deg_s2),
            t.number("max-rate", AtOnce, "Commands per second at most; a stop is sent immediately", 0.1..=50.0, |s| &mut s.session.max_rate_hz),
            t.duration("latency", AtOnce, "Delay from sending a command until a picture that shows its effect arrives, in nanoseconds, up to 5 s", Duration::ZERO..=millis(5000), |s| &mut s.servo.latency),
            t.optional_number("field-of-view", AtOnce, "Horizontal field of view when zoomed out, in degrees (0: as the camera reports)", 0.0..=179.0, |s| &mut s.servo.fov_deg),
            t.switch("invert-pan", AtOnce, "Panning right moves the view left, for example because the camera hangs upside down", |s| &mut s.servo.mounting.invert_pan),
            t.switch("invert-tilt", AtOnce, "Tilting up moves the view down, for example because the camera hangs upside down", |s| &mut s.servo.mounting.invert_tilt),
            t.one_of("rotation", AtOnce, "Clockwise rotation of the arriving picture relative to the pan axis, in degrees: 0, 90, 180 or 270", &[0, 90, 180, 270], |s| &mut s.servo.mounting.rotation_deg),
            t.choice::<P, _>("prediction", AtOnce, "How the target's motion is extrapolated", |s| &mut s.servo.prediction),
            t.duration("stale-timeout", AtOnce, "The camera is stopped when the target has not been seen for this long, unless it left the picture (`search-time`), in nanoseconds, from 50 ms to 60 s", millis(50)..=millis(60_000), |s| &mut s.servo.stale_timeout),
            t.duration("search-time", AtOnce, "In mode=velocity: how long the camera keeps turning after a target that left the picture, counted from when it was last seen, in nanoseconds, up to 10 s (0: it stops at once)", Duration::ZERO..=millis(10_000), |s| &mut s.servo.search_time),
            t.number("camera-speed", AtOnce, "Speed at speed step 100, in degrees per second, of a camera that does not report its speeds", 1.0..=1000.0, |s| &mut s.servo.camera_speed_deg_s),
            t.choice::<C, _>("speed-curve", AtOnce, "How speed grows with the speed step for a camera that does not report its speeds", |s| &mut s.servo.speed_curve),
            t.switch("learn", AtOnce, "Learn latency, field of view and speed map while following, starting from the values that are set or reported", |s| &mut s.servo.learn),
            t.switch("auto-zoom", AtOnce, "Zoom to keep the target at `target-height`, and zoom out when it is not seen well", |s| &mut s.auto_zoom),
            t.number("target-height", AtOnce, "Height at which `auto-zoom` keeps the target, as a fraction of the picture's height", 0.05..=0.9, |s| &mut s.target_height),
            t.number("pan-min", AsLimit, "The camera turns no farther left than this, in degrees (-180 and 180 together: no limit)", -180.0..=180.0, |s| &mut s.servo.limits.pan_deg.min),
            t.number("pan-max", AsLimit, "The camera turns no farther right than this, in degrees (-180 and 180 together: no limit)", -180.0..=180.0, |s| &mut s.servo.limits.pan_deg.max),
            t.number("tilt-min", AsLimit, "The camera tilts no farther down than this, in degrees", -180.0..=180.0, |s| &mut s.servo.limits.tilt_deg.min),
            t.number("tilt-max", AsLimit, "The camera tilts no farther up than this, in degrees", -180.0..=180.0, |s| &mut s.servo.limits.tilt_deg.max),
            t.zoom_steps("zoom-min", AsLimit, "`auto-zoom` zooms out no farther than this, in steps of the optical zoom", |s| &mut s.servo.limits.zoom.min),
            t.zoom_steps("zoom-max", AsLimit, "`auto-zoom` zooms in no farther than this, in steps of the optical zoom", |s| &mut s.servo.limits.zoom.max),
            special(
                text("home", AtOnce, "Where the camera waits for a target: pan,tilt or pan,tilt,zoom in degrees and zoom steps, start (where it looked when it connected), or the name of a preset (unset: it stays where the last target was)"),
                |s| s.servo.home.as_ref().map(home_text).to_value(),
                |s, value| { s.servo.home = string(value).filter(|text| !text.is_empty()).map(|text| parse_home(&text)).transpose()?; Ok(()) },
            ),
            special(
                text("look-at", AtOnce, "Where `steering=look-at` turns the camera: pan,tilt or pan,tilt,field of view, in degrees"),
                |s| s.look_at.as_ref().map(home_text).to_value(),
                |s, value| { s.look_at = string(value).filter(|text| !text.is_empty()).map(|text| parse_look_at(&text)).transpose()?; Ok(()) },
            ),
            t.duration("home-timeout", AtOnce, "The camera goes home when there has been no target for this long, in nanoseconds, up to a day", Duration::ZERO..=millis(86_400_000), |s| &mut s.servo.home_timeout),
            t.switch("home-at-start", AtStart, "Go home on start-up too, without waiting for `home-timeout`", |s| &mut s.servo.home_at_start),
            t.duration("override-timeout", AtOnce, "After somebody else has moved the camera, steering resumes once it has not been moved for this long, in nanoseconds, up to a day (0: never give way)", Duration::ZERO..=millis(86_400_000), |s| &mut s.session.override_timeout),
            t.switch("dead-man", AtStart, "Have another process stop the camera if this one dies or hangs while the camera moves; not with `lockstep`", |s| &mut s.dead_man),
            special(
                text("dead-man-socket", AtStart, &format!("Socket of a running `{} --listen` to use as that process (unset: one is started)", particulars.watchdog)),
                |s| s.dead_man_socket.to_value(),
                |s, value| { s.dead_man_socket = string(value).filter(|socket| !socket.is_empty()); Ok(()) },
            ),
            t.switch("lockstep", AtStart, "Use the stream's time, and let each buffer wait for the camera's answers: for simulated cameras", |s| &mut s.lockstep),
        ]
    }

    /// One of these numbers, which grow.
    fn one_of(
        &self,
        name: &'static str,
        takes: Takes,
        blurb: &str,
        values: &'static [u32],
        field: Field<u32>,
    ) -> Property {
        let builder = glib::ParamSpecUInt::builder(name).maximum(values.last().copied().unwrap_or(0));
        let spec = mutable(builder.default_value(self.default_of(field)).blurb(blurb), takes).build();
        converted(
            (spec, takes),
            field,
            |value| value,
            move |value| {
                if values.contains(&value) {
                    Ok(value)
                } else {
                    Err(format!("`{name}`={value} is not one of {values:?}"))
                }
            },
        )
    }

    fn number(
        &self,
        name: &str,
        takes: Takes,
        blurb: &str,
        range: RangeInclusive<f64>,
        field: Field<f64>,
    ) -> Property {
        let builder = glib::ParamSpecDouble::builder(name).minimum(*range.start()).maximum(*range.end());
        let spec = mutable(builder.default_value(self.default_of(field)).blurb(blurb), takes).build();
        plain(spec, takes, field)
    }

    /// A number for which 0 says that nothing is set.
    fn optional_number(
        &self,
        name: &str,
        takes: Takes,
        blurb: &str,
        range: RangeInclusive<f64>,
        field: Field<Option<f64>>,
    ) -> Property {
        let builder = glib::ParamSpecDouble::builder(name).minimum(*range.start()).maximum(*range.end());
        let spec =
            mutable(builder.default_value(self.default_of(field).unwrap_or(0.0)).blurb(blurb), takes).build();
        converted(
            (spec, takes),
            field,
            |value| value.unwrap_or(0.0),
            |value| Ok(Some(value).filter(|value| *value > 0.0)),
        )
    }

    /// Steps of the optical zoom, whole ones.
    fn zoom_steps(&self, name: &str, takes: Takes, blurb: &str, field: Field<f64>) -> Property {
        let step = |travel: f64| u32::from(ZoomStep::at(travel).whole());
        let (first, last) = (ZoomStep::FIRST.whole().into(), ZoomStep::LAST.whole().into());
        let builder = glib::ParamSpecUInt::builder(name).minimum(first).maximum(last);
        let spec = mutable(builder.default_value(step(self.default_of(field))).blurb(blurb), takes).build();
        converted((spec, takes), field, step, |step: u32| Ok(ZoomStep(f64::from(step)).travel()))
    }

    fn switch(&self, name: &str, takes: Takes, blurb: &str, field: Field<bool>) -> Property {
        let builder =
            glib::ParamSpecBoolean::builder(name).default_value(self.default_of(field)).blurb(blurb);
        plain(mutable(builder, takes).build(), takes, field)
    }

    /// One of the values that an enumeration of GObject's shares with one of the servo's.
    fn choice<G: EnumOf<T>, T: Copy + 'static>(
        &self,
        name: &str,
        takes: Takes,
        blurb: &str,
        field: Field<T>,
    ) -> Property {
        let builder = glib::ParamSpecEnum::builder_with_default(name, G::from(self.default_of(field)));
        let spec = mutable(builder.blurb(blurb), takes).build();
        converted((spec, takes), field, G::from, |value: G| Ok(value.into()))
    }

    /// Nanoseconds. GObject would bring a value below the least one there in silence, so that is refused here.
    fn duration(
        &self,
        name: &'static str,
        takes: Takes,
        blurb: &str,
        range: RangeInclusive<Duration>,
        field: Field<Duration>,
    ) -> Property {
        let builder = glib::ParamSpecUInt64::builder(name).maximum(nanoseconds(*range.end()));
        let spec =
            mutable(builder.default_value(nanoseconds(self.default_of(field))).blurb(blurb), takes).build();
        converted((spec, takes), field, nanoseconds, move |value: u64| {
            if let Some(mistake) = mistaken_unit(name, value) {
                return Err(mistake);
            }
            let (least, most, duration) = (range.start(), range.end(), Duration::from_nanos(value));
            if range.contains(&duration) {
                Ok(duration)
            } else {
                Err(format!("`{name}`={value} ns is not between {least:?} and {most:?}"))
            }
        })
    }

    fn default_of<T: Copy>(&self, field: Field<T>) -> T {
        *field(&mut self.defaults.clone())
    }
}

/// A user and a password in an address go where they belong.
fn set_location(settings: &mut Settings, value: &Value) -> Result<(), String> {
    let text = string(value).filter(|text| !text.is_empty());
    let parsed = text.map(|text| Location::parse(&text)).transpose().map_err(|err| err.to_string())?;
    let Some((location, info)) = parsed else {
        settings.location = None;
        return Ok(());
    };
    settings.location = Some(location);
    settings.user = info.user.or(settings.user.take());
    settings.password = info.password.or(settings.password.take());
    Ok(())
}

/// A text that may be unset.
pub fn text(name: &str, takes: Takes, blurb: &str) -> (ParamSpec, Takes) {
    (mutable(glib::ParamSpecString::builder(name).blurb(blurb), takes).build(), takes)
}

/// With a getter and a setter of its own.
pub fn special(
    (spec, takes): (ParamSpec, Takes),
    get: impl Fn(&Settings) -> Value + Send + Sync + 'static,
    set: impl Fn(&mut Settings, &Value) -> Result<(), String> + Send + Sync + 'static,
) -> Property {
    Property { spec, takes, get: Box::new(get), set: Box::new(set) }
}

/// As it lies in the settings.
fn plain<T>(spec: ParamSpec, takes: Takes, field: Field<T>) -> Property
where
    T: Copy + ToValue + for<'v> glib::value::FromValue<'v> + 'static,
{
    converted((spec, takes), field, |value| value, Ok)
}

/// Otherwise than it lies in the settings.
fn converted<T, V>(
    spec: (ParamSpec, Takes),
    field: Field<T>,
    from: impl Fn(T) -> V + Send + Sync + 'static,
    to: impl Fn(V) -> Result<T, String> + Send + Sync + 'static,
) -> Property
where
    T: Copy + 'static,
    V: ToValue + for<'v> glib::value::FromValue<'v> + 'static,
{
    special(
        spec,
        move |settings| from(*field(&mut settings.clone())).to_value(),
        move |settings, value| {
            let value = value.get::<V>().map_err(|err| err.to_string())?;
            *field(settings) = to(value)?;
            Ok(())
        },
    )
}

/// With the time at which a new value counts.
pub fn mutable<'a, B: ParamSpecBuilderExt<'a>>(builder: B, takes: Takes) -> B {
    if takes == Takes::AtStart { builder.mutable_ready() } else { builder.mutable_playing() }
}

/// The text of a value, where there is one.
pub fn string(value: &Value) -> Option<String> {
    value.get().ok().flatten()
}

fn millis(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
