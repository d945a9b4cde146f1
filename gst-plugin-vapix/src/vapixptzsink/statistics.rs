// SPDX-License-Identifier: MPL-2.0

//! Numbers for the `stats` property.

use std::time::Duration;

use servo::{Estimates, Mode, is_endless};
use vapix::wire::Command;

use super::camera_task::DeadManState;
use crate::control_loop::Status;

/// What was exchanged with the camera, and what it is known to do.
#[derive(Debug, Clone, Default)]
pub struct Statistics {
    pub status: Status,
    /// What the camera is taken for by now.
    pub estimates: Option<Estimates>,
    /// What ends the last move.
    pub stop: Option<Command>,
    /// The camera does not rest for good: it moves, or something unanswered may set it going.
    pub may_yet_move: bool,
    pub sent: u64,
    pub failed: u64,
    /// Pictures of the target that were overtaken by newer ones before they could be steered by.
    pub coalesced: u64,
    pub round_trip: Duration,
    pub round_trip_average: Duration,
    pub last_error: Option<String>,
    pub halted: bool,
    pub dead_man: DeadManState,
}

impl Statistics {
    /// A command was accepted after this time.
    pub fn succeeded(&mut self, round_trip: Duration) {
        self.sent += 1;
        self.round_trip = round_trip;
        // Over about the last eight.
        let average = if self.sent == 1 { round_trip } else { self.round_trip_average };
        self.round_trip_average = (average * 7 + round_trip) / 8;
    }

    /// The property's value while the camera task runs.
    pub fn to_structure(&self) -> gst::Structure {
        let state = match self {
            Self { halted: true, .. } => "refused",
            Self { status: Status { connected: false, .. }, .. } => "disconnected",
            Self { status: Status { taken_over: true, .. }, .. } => "taken-over",
            Self { status: Status { moving: true, .. }, .. } => "moving",
            _ => "at-rest",
        };
        self.with_state(state)
    }

    /// The property's value where there is no camera task.
    pub fn stopped() -> gst::Structure {
        Self::default().with_state("stopped")
    }

    fn with_state(&self, state: &str) -> gst::Structure {
        let status = &self.status;
        let limits = &status.limits;
        gst::Structure::builder("application/x-vapixptzsink-stats")
            .field("state", state)
            .field("dead-man", self.dead_man.name())
            .field("commands-sent", self.sent)
            .field("commands-failed", self.failed)
            .field("commands-coalesced", self.coalesced)
            .field("round-trip", nanoseconds(self.round_trip))
            .field("round-trip-average", nanoseconds(self.round_trip_average))
            .field("pan-rate", status.rate.pan)
            .field("tilt-rate", status.rate.tilt)
            .field_if_some("mode", status.mode.map(Mode::name))
            .field_if_some("pan", status.position.pan_deg)
            .field_if_some("tilt", status.position.tilt_deg)
            .field_if_some("zoom", status.position.zoom_steps)
            .field_if_some("camera-pan-min", limits.pan_deg.map(|pan| pan.min))
            .field_if_some("camera-pan-max", limits.pan_deg.map(|pan| pan.max))
            .field_if_some("camera-tilt-min", limits.tilt_deg.map(|tilt| tilt.min))
            .field_if_some("camera-tilt-max", limits.tilt_deg.map(|tilt| tilt.max))
            .field_if_some("camera-zoom-min", limits.zoom_steps.map(|zoom| zoom.min))
            .field_if_some("camera-zoom-max", limits.zoom_steps.map(|zoom| zoom.max))
            .field_if_some("camera-endless-pan", limits.pan_deg.map(is_endless))
            .field_if_some("field-of-view", status.fov_deg)
            .field_if_some("latency", self.estimates.map(|estimates| nanoseconds(estimates.delays.sum())))
            .field_if_some("speeds", self.estimates.map(|estimates| speeds(&estimates)))
            .field_if_some("last-error", self.last_error.as_deref())
            .build()
    }
}

/// Degrees per second of the speed steps 1 to 100.
fn speeds(estimates: &Estimates) -> gst::Array {
    gst::Array::new((1..=100).map(|step| estimates.map.deg_s(step)))
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_average_follows_the_round_trips() {
        let mut statistics = Statistics::default();
        statistics.succeeded(Duration::from_millis(80));
        assert_eq!(statistics.round_trip_average, Duration::from_millis(80));
        statistics.succeeded(Duration::from_millis(160));
        assert_eq!(statistics.round_trip_average, Duration::from_millis(90));
    }

    #[test]
    fn the_state_is_the_gravest() {
        gst::init().unwrap();
        let state =
            |statistics: &Statistics| statistics.to_structure().get::<String>("state").unwrap_or_default();
        let mut statistics = Statistics::default();
        assert_eq!(state(&statistics), "disconnected");
        statistics.status.connected = true;
        assert_eq!(state(&statistics), "at-rest");
        statistics.status.moving = true;
        assert_eq!(state(&statistics), "moving");
        statistics.status.taken_over = true;
        assert_eq!(state(&statistics), "taken-over");
        statistics.halted = true;
        assert_eq!(state(&statistics), "refused");
    }
}
