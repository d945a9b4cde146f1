// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::ServoSettings;

/// Everything that can be set about the control loop.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoopSettings {
    /// How the camera is steered.
    pub servo: ServoSettings,
    /// How it is spoken with.
    pub session: SessionSettings,
}

/// What can be set about the session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionSettings {
    /// Commands per second at most; a stop does not wait for its turn.
    pub max_rate_hz: f64,
    /// An operator who moves the camera keeps it until it was not moved for this long; zero: he is not looked for.
    pub override_timeout: Duration,
}

impl Default for SessionSettings {
    fn default() -> Self {
        Self { max_rate_hz: 10.0, override_timeout: Duration::from_secs(10) }
    }
}

impl SessionSettings {
    /// From one command to the next, at least.
    pub fn min_interval(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.max_rate_hz)
    }
}

impl From<ServoSettings> for LoopSettings {
    fn from(servo: ServoSettings) -> Self {
        Self { servo, ..Self::default() }
    }
}
