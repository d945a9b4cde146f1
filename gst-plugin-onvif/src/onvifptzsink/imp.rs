// SPDX-License-Identifier: MPL-2.0

use std::sync::LazyLock;

use glib::prelude::*;
use gst::subclass::prelude::*;
use gst_base::subclass::prelude::*;
use sink::{Core, Particulars, Property, PtzSink, Settings, Table, Takes, special, string, text};

use super::{Authentication, Mode, Prediction, SpeedCurve, Steering};

static CAT: LazyLock<gst::DebugCategory> = LazyLock::new(|| {
    gst::DebugCategory::new("onvifptzsink", gst::DebugColorFlags::empty(), Some("ONVIF PTZ servo"))
});

const PARTICULARS: Particulars = Particulars {
    name: "onvifptzsink",
    environment: "ONVIF",
    watchdog: "onvif-watchdog",
    example: "http://192.168.0.90/onvif/device_service",
};

/// Degrees per second at full velocity that is assumed of a camera that does not tell: those of most makes do 50 to 240.
const FULL_SPEED_DEG_S: f64 = 100.0;

static TABLE: LazyLock<Vec<Property>> = LazyLock::new(|| {
    let defaults = defaults();
    let table = Table::new(&PARTICULARS, &defaults);
    table.all::<Mode, Authentication, Prediction, SpeedCurve, Steering>(vec![profile()])
});

/// The element.
#[derive(Debug)]
pub struct OnvifPtzSink {
    core: Core,
}

impl Default for OnvifPtzSink {
    fn default() -> Self {
        Self { core: Core::new(defaults()) }
    }
}

impl PtzSink for OnvifPtzSink {
    type Client = onvif::Client;

    const PARTICULARS: Particulars = PARTICULARS;

    fn core(&self) -> &Core {
        &self.core
    }

    fn table() -> &'static [Property] {
        &TABLE
    }

    fn category() -> gst::DebugCategory {
        *CAT
    }
}

sink::ptz_sink!(
    OnvifPtzSink,
    "GstOnvifPtzSink",
    super::OnvifPtzSink,
    "ONVIF PTZ servo",
    "Steers a pan-tilt-zoom camera of any make after the tracked target"
);

fn defaults() -> Settings {
    let mut settings = Settings::new(PARTICULARS.environment);
    settings.servo.camera_speed_deg_s = FULL_SPEED_DEG_S;
    settings.servo.learn_axes = true;
    settings.servo.learn_zoom = true;
    settings
}

fn profile() -> Property {
    special(
        text(
            "profile",
            Takes::AtStart,
            "Token or name of the media profile whose PTZ configuration is used (unset: the first that has one)",
        ),
        |settings| Some(&settings.channel).filter(|channel| !channel.is_empty()).to_value(),
        |settings, value| {
            settings.channel = string(value).unwrap_or_default();
            Ok(())
        },
    )
}
