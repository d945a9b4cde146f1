//! The values of the properties, and what they mean to servo and client.

use std::fmt::Display;
use std::path::PathBuf;
use std::time::Duration;

use super::{Mode, Prediction, SpeedCurve};
use crate::servo::{Home, ServoSettings, SoftLimits};
use crate::vapix::{ClientSettings, Credentials, Location, Range, Secret, Trust};

/// One field for one property, in the property's unit. The servo's defaults are the servo's own.
#[derive(Debug, Clone)]
pub struct Settings {
    pub location: Option<Location>,
    pub camera: u32,
    pub user: Option<String>,
    pub password: Option<Secret>,
    pub timeout_ms: u32,
    pub insecure: bool,
    pub ca_file: Option<String>,
    pub mode: Mode,
    pub gain: f64,
    pub dead_zone: f64,
    pub max_speed_deg_s: f64,
    pub max_acceleration_deg_s2: f64,
    pub max_rate_hz: f64,
    pub latency_ms: u32,
    pub field_of_view_deg: f64,
    pub prediction: Prediction,
    pub stale_timeout_ms: u32,
    pub camera_speed_deg_s: f64,
    pub speed_curve: SpeedCurve,
    pub learn: bool,
    pub auto_zoom: bool,
    pub target_height: f64,
    pub pan_min_deg: f64,
    pub pan_max_deg: f64,
    pub tilt_min_deg: f64,
    pub tilt_max_deg: f64,
    pub zoom_min: u32,
    pub zoom_max: u32,
    /// As they were when they were last judged.
    kept_limits: SoftLimits,
    pub home: Option<Home>,
    pub home_timeout_ms: u32,
    pub home_at_start: bool,
    pub override_timeout_ms: u32,
    pub lockstep: bool,
}

impl Default for Settings {
    fn default() -> Self {
        let servo = ServoSettings::default();
        Self {
            location: None,
            camera: 1,
            user: None,
            password: None,
            timeout_ms: 1500,
            insecure: false,
            ca_file: None,
            mode: Mode::default(),
            gain: servo.gain,
            dead_zone: servo.dead_zone,
            max_speed_deg_s: servo.max_speed_deg_s,
            max_acceleration_deg_s2: servo.max_acceleration_deg_s2,
            max_rate_hz: servo.max_rate_hz,
            latency_ms: servo.latency.as_millis() as u32,
            field_of_view_deg: servo.fov_deg.unwrap_or(0.0),
            prediction: Prediction::default(),
            stale_timeout_ms: servo.stale_timeout.as_millis() as u32,
            camera_speed_deg_s: servo.camera_speed_deg_s,
            speed_curve: SpeedCurve::default(),
            learn: servo.learn,
            auto_zoom: servo.target_height.is_some(),
            target_height: 0.4,
            pan_min_deg: servo.limits.pan_deg.min,
            pan_max_deg: servo.limits.pan_deg.max,
            tilt_min_deg: servo.limits.tilt_deg.min,
            tilt_max_deg: servo.limits.tilt_deg.max,
            zoom_min: servo.limits.zoom_steps.min as u32,
            zoom_max: servo.limits.zoom_steps.max as u32,
            kept_limits: servo.limits,
            home: servo.home,
            home_timeout_ms: servo.home_timeout.as_millis() as u32,
            home_at_start: servo.home_at_start,
            override_timeout_ms: servo.override_timeout.as_millis() as u32,
            lockstep: false,
        }
    }
}

impl Settings {
    /// What the servo is to know.
    pub fn servo(&self) -> ServoSettings {
        ServoSettings {
            mode: self.mode.into(),
            gain: self.gain,
            dead_zone: self.dead_zone,
            max_speed_deg_s: self.max_speed_deg_s,
            max_acceleration_deg_s2: self.max_acceleration_deg_s2,
            max_rate_hz: self.max_rate_hz,
            latency: milliseconds(self.latency_ms),
            fov_deg: Some(self.field_of_view_deg).filter(|degrees| *degrees > 0.0),
            prediction: self.prediction.into(),
            stale_timeout: milliseconds(self.stale_timeout_ms),
            camera_speed_deg_s: self.camera_speed_deg_s,
            speed_curve: self.speed_curve.into(),
            learn: self.learn,
            limits: self.limits(),
            target_height: Some(self.target_height).filter(|_| self.auto_zoom),
            home: self.home.clone(),
            home_timeout: milliseconds(self.home_timeout_ms),
            home_at_start: self.home_at_start,
            override_timeout: milliseconds(self.override_timeout_ms),
        }
    }

    /// Each pair of limits of which the lower is the higher becomes what it was when it was last judged; returns what
    /// was refused, in words. Not judged at each change: until both are set, a pair may well be crossed.
    pub fn judge_limits(&mut self) -> Vec<String> {
        let SoftLimits { pan_deg, tilt_deg, zoom_steps } = self.kept_limits;
        let refused = [
            uncross("pan", (&mut self.pan_min_deg, &mut self.pan_max_deg), (pan_deg.min, pan_deg.max)),
            uncross("tilt", (&mut self.tilt_min_deg, &mut self.tilt_max_deg), (tilt_deg.min, tilt_deg.max)),
            uncross(
                "zoom",
                (&mut self.zoom_min, &mut self.zoom_max),
                (zoom_steps.min as u32, zoom_steps.max as u32),
            ),
        ];
        self.kept_limits = self.limits();
        refused.into_iter().flatten().collect()
    }

    fn limits(&self) -> SoftLimits {
        SoftLimits {
            pan_deg: Range { min: self.pan_min_deg, max: self.pan_max_deg },
            tilt_deg: Range { min: self.tilt_min_deg, max: self.tilt_max_deg },
            zoom_steps: Range { min: self.zoom_min.into(), max: self.zoom_max.into() },
        }
    }

    /// What the client is to know; `None` without a location.
    pub fn client(&self, environment: impl Fn(&str) -> Option<String>) -> Option<ClientSettings> {
        let trust = match &self.ca_file {
            _ if self.insecure => Trust::Anyone,
            Some(path) => Trust::Authority(PathBuf::from(path)),
            None => Trust::System,
        };
        Some(ClientSettings {
            location: self.location.clone()?,
            camera: self.camera,
            credentials: self.credentials(environment),
            timeout: milliseconds(self.timeout_ms),
            trust,
        })
    }

    /// Who we are: as set, or as the environment says where neither user nor password is set.
    pub fn credentials(&self, environment: impl Fn(&str) -> Option<String>) -> Option<Credentials> {
        let (user, password) = match (&self.user, &self.password) {
            (None, None) => (environment("VAPIX_USER"), environment("VAPIX_PASSWORD").map(Secret::new)),
            (user, password) => (user.clone(), password.clone()),
        };
        Some(Credentials { user: user?, password: password.unwrap_or_else(|| Secret::new("")) })
    }
}

fn uncross<T: PartialOrd + Display + Copy>(
    name: &str,
    (min, max): (&mut T, &mut T),
    kept: (T, T),
) -> Option<String> {
    if *min <= *max {
        return None;
    }
    let refused = format!("`{name}-min`={min} is beyond `{name}-max`={max}");
    (*min, *max) = kept;
    Some(format!("{refused}; they stay {min} and {max}"))
}

/// The process' environment.
pub fn environment(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

fn milliseconds(milliseconds: u32) -> Duration {
    Duration::from_millis(milliseconds.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(name: &str) -> Option<String> {
        matches!(name, "VAPIX_USER" | "VAPIX_PASSWORD").then(|| format!("{name} value"))
    }

    #[test]
    fn the_environment_serves_where_nothing_is_set() {
        let mut settings = Settings::default();
        assert_eq!(settings.credentials(|_| None), None);
        let expected = Credentials {
            user: "VAPIX_USER value".to_owned(),
            password: Secret::new("VAPIX_PASSWORD value"),
        };
        assert_eq!(settings.credentials(environment), Some(expected));
        settings.user = Some("root".to_owned());
        let expected = Credentials { user: "root".to_owned(), password: Secret::new("") };
        assert_eq!(settings.credentials(environment), Some(expected));
    }

    #[test]
    fn insecure_outweighs_an_authority() {
        let (location, _) = Location::parse("https://camera").unwrap();
        let mut settings =
            Settings { location: Some(location), ca_file: Some("ca.pem".to_owned()), ..Settings::default() };
        let trust = |settings: &Settings| settings.client(|_| None).unwrap().trust;
        assert_eq!(trust(&settings), Trust::Authority("ca.pem".into()));
        settings.insecure = true;
        assert_eq!(trust(&settings), Trust::Anyone);
        assert!(Settings::default().client(|_| None).is_none());
    }
}
