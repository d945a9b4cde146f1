// SPDX-License-Identifier: MPL-2.0

//! Numbers for the `stats` property.

use std::time::Duration;

use servo::{Estimates, Mode, is_endless};
use session::task::Statistics;
use session::{Status, ZoomStep};

/// The property's value for the sink of this name; `None`: there is no camera task.
pub fn stats(sink: &str, statistics: Option<&Statistics>) -> gst::Structure {
    match statistics {
        Some(statistics) => structure(sink, state(statistics), statistics),
        None => structure(sink, "stopped", &Statistics::default()),
    }
}

/// The gravest of what can be said.
fn state(statistics: &Statistics) -> &'static str {
    match statistics {
        Statistics { halted: true, .. } => "refused",
        Statistics { status: Status { connected: false, .. }, .. } => "disconnected",
        Statistics { status: Status { taken_over: true, .. }, .. } => "taken-over",
        Statistics { status: Status { moving: true, .. }, .. } => "moving",
        _ => "at-rest",
    }
}

fn structure(sink: &str, state: &str, statistics: &Statistics) -> gst::Structure {
    let status = &statistics.status;
    let limits = &status.limits;
    gst::Structure::builder(format!("application/x-{sink}-stats"))
        .field("state", state)
        .field("dead-man", statistics.dead_man.name())
        .field("commands-sent", statistics.sent)
        .field("commands-failed", statistics.failed)
        .field("commands-coalesced", statistics.coalesced)
        .field("round-trip", nanoseconds(statistics.round_trip))
        .field("round-trip-average", nanoseconds(statistics.round_trip_average))
        .field("pan-rate", status.rate.pan)
        .field("tilt-rate", status.rate.tilt)
        .field_if_some("mode", status.mode.map(Mode::name))
        .field_if_some("pan", status.position.pan_deg)
        .field_if_some("tilt", status.position.tilt_deg)
        .field_if_some("zoom", status.position.zoom.map(zoom_step))
        .field_if_some("camera-pan-min", limits.pan_deg.map(|pan| pan.min))
        .field_if_some("camera-pan-max", limits.pan_deg.map(|pan| pan.max))
        .field_if_some("camera-tilt-min", limits.tilt_deg.map(|tilt| tilt.min))
        .field_if_some("camera-tilt-max", limits.tilt_deg.map(|tilt| tilt.max))
        .field_if_some("camera-zoom-min", limits.zoom.map(|zoom| zoom_step(zoom.min)))
        .field_if_some("camera-zoom-max", limits.zoom.map(|zoom| zoom_step(zoom.max)))
        .field_if_some("camera-endless-pan", limits.pan_deg.map(is_endless))
        .field_if_some("field-of-view", status.fov_deg)
        .field_if_some("latency", statistics.estimates.map(|estimates| nanoseconds(estimates.delays.sum())))
        .field_if_some("speeds", statistics.estimates.map(|estimates| speeds(&estimates)))
        .field_if_some("last-error", statistics.last_error.as_deref())
        .build()
}

fn zoom_step(travel: f64) -> f64 {
    ZoomStep::at(travel).0
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
    fn the_state_is_the_gravest() {
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
