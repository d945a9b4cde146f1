// SPDX-License-Identifier: MPL-2.0

//! The values of the properties, and what they mean to servo and client.

use std::path::PathBuf;
use std::time::Duration;

use servo::{Home, Range, ServoSettings, SoftLimits};
use session::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};
use session::{LoopSettings, SessionSettings, ZoomStep};

/// To what the camera is steered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Steering {
    /// After the target.
    #[default]
    Follow,
    /// Home, whoever is there.
    Home,
    /// To where `look-at` says, whoever is there.
    LookAt,
    /// Not at all.
    Off,
}

/// What the properties hold.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Where the camera is.
    pub location: Option<Location>,
    /// Which of its channels, as the protocol names them.
    pub channel: String,
    /// Who we are to it.
    pub user: Option<String>,
    /// And by which password.
    pub password: Option<Secret>,
    /// How that may be proved.
    pub authentication: Authentication,
    /// Longest wait for an answer.
    pub timeout: Duration,
    /// Whether any certificate is believed.
    pub insecure: bool,
    /// Whose certificates are believed; `None`: those the system trusts.
    pub ca_file: Option<String>,
    /// To what the camera is steered.
    pub steering: Steering,
    /// Where that is, of [`Steering::LookAt`].
    pub look_at: Option<Home>,
    /// Whether time is the stream's.
    pub lockstep: bool,
    /// Whether another process stops the camera where this one cannot.
    pub dead_man: bool,
    /// Where such a process listens; `None`: one is started.
    pub dead_man_socket: Option<String>,
    /// Whether the zoom keeps `target_height`.
    pub auto_zoom: bool,
    /// The target's height, as a part of the picture's.
    pub target_height: f64,
    /// All that the servo is to know but `target_height`, which is zoomed by only with `auto_zoom`.
    pub servo: ServoSettings,
    /// How the camera is spoken with.
    pub session: SessionSettings,
    /// The limits as they were when they were last judged.
    kept_limits: SoftLimits,
    /// What the environment variables of the sink begin with.
    environment: &'static str,
}

impl Settings {
    /// The defaults of a sink whose environment variables begin with this.
    pub fn new(environment: &'static str) -> Self {
        let servo = ServoSettings::default();
        Self {
            location: None,
            channel: String::new(),
            user: None,
            password: None,
            authentication: Authentication::default(),
            timeout: Duration::from_millis(1500),
            insecure: false,
            ca_file: None,
            steering: Steering::default(),
            look_at: None,
            lockstep: false,
            dead_man: true,
            dead_man_socket: None,
            auto_zoom: servo.target_height.is_some(),
            target_height: 0.4,
            kept_limits: servo.limits,
            environment,
            session: SessionSettings::default(),
            servo,
        }
    }

    /// What the control loop is to know.
    pub fn control(&self) -> LoopSettings {
        let mut servo = ServoSettings {
            target_height: self.auto_zoom.then_some(self.target_height),
            ..self.servo.clone()
        };
        match self.steering {
            Steering::Follow => {}
            Steering::Home => servo.home_timeout = Duration::ZERO,
            Steering::LookAt => {
                servo.home = self.look_at.clone();
                servo.home_timeout = Duration::ZERO;
            }
            Steering::Off => servo.home = None,
        }
        LoopSettings { servo, session: self.session }
    }

    /// Each pair of limits of which the lower is the higher becomes what it was when it was last judged; returns what
    /// was refused, in words. Not judged at each change: until both are set, a pair may well be crossed.
    pub fn judge_limits(&mut self) -> Vec<String> {
        let (kept, limits) = (self.kept_limits, &mut self.servo.limits);
        let refused = [
            uncross("pan", &mut limits.pan_deg, kept.pan_deg),
            uncross("tilt", &mut limits.tilt_deg, kept.tilt_deg),
            uncross_zoom(&mut limits.zoom, kept.zoom),
        ];
        self.kept_limits = *limits;
        refused.into_iter().flatten().collect()
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
            channel: self.channel.clone(),
            credentials: self.credentials(environment),
            authentication: self.authentication,
            timeout: self.timeout,
            trust,
        })
    }

    /// Who we are: as set, or as the environment says where neither user nor password is set.
    pub fn credentials(&self, environment: impl Fn(&str) -> Option<String>) -> Option<Credentials> {
        let (user, password) = match (&self.user, &self.password) {
            (None, None) => {
                let variable = |name| environment(&format!("{}_{name}", self.environment));
                (variable("USER"), variable("PASSWORD").map(Secret::new))
            }
            (user, password) => (user.clone(), password.clone()),
        };
        Some(Credentials { user: user?, password: password.unwrap_or_else(|| Secret::new("")) })
    }
}

/// The same of parts of the zoom's travel, in steps.
fn uncross_zoom(limits: &mut Range, kept: Range) -> Option<String> {
    let steps = |travel: Range| Range { min: ZoomStep::at(travel.min).0, max: ZoomStep::at(travel.max).0 };
    let refused = uncross("zoom", &mut steps(*limits), steps(kept))?;
    *limits = kept;
    Some(refused)
}

fn uncross(name: &str, limits: &mut Range, kept: Range) -> Option<String> {
    let Range { min, max } = *limits;
    if min <= max {
        return None;
    }
    *limits = kept;
    Some(format!("`{name}-min`={min} is beyond `{name}-max`={max}; they stay {} and {}", kept.min, kept.max))
}

/// The process' environment.
pub fn environment(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(name: &str) -> Option<String> {
        matches!(name, "VAPIX_USER" | "VAPIX_PASSWORD").then(|| format!("{name} value"))
    }

    #[test]
    fn the_environment_serves_where_nothing_is_set() {
        let mut settings = Settings::new("VAPIX");
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
        let mut settings = Settings {
            location: Some(location),
            ca_file: Some("ca.pem".to_owned()),
            ..Settings::new("VAPIX")
        };
        let trust = |settings: &Settings| settings.client(|_| None).unwrap().trust;
        assert_eq!(trust(&settings), Trust::Authority("ca.pem".into()));
        settings.insecure = true;
        assert_eq!(trust(&settings), Trust::Anyone);
        assert!(Settings::new("VAPIX").client(|_| None).is_none());
    }
}
