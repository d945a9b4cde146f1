// SPDX-License-Identifier: MPL-2.0

use std::sync::LazyLock;

use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_base::subclass::prelude::*;
use sink::{Core, Particulars, Property, PtzSink, Settings, Table, Takes, mutable, special};

use super::{Authentication, Mode, Prediction, SpeedCurve, Steering};

static CAT: LazyLock<gst::DebugCategory> = LazyLock::new(|| {
    gst::DebugCategory::new("vapixptzsink", gst::DebugColorFlags::empty(), Some("VAPIX PTZ servo"))
});

const PARTICULARS: Particulars = Particulars {
    name: "vapixptzsink",
    environment: "VAPIX",
    watchdog: "vapix-watchdog",
    example: "http://192.168.0.90",
};

static TABLE: LazyLock<Vec<Property>> = LazyLock::new(|| {
    let defaults = defaults();
    let table = Table::new(&PARTICULARS, &defaults);
    table.all::<Mode, Authentication, Prediction, SpeedCurve, Steering>(vec![camera()])
});

/// The element.
pub struct VapixPtzSink {
    core: Core,
}

impl Default for VapixPtzSink {
    fn default() -> Self {
        Self { core: Core::new(defaults()) }
    }
}

impl PtzSink for VapixPtzSink {
    type Client = vapix::Client;

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
    VapixPtzSink,
    "GstVapixPtzSink",
    super::VapixPtzSink,
    "VAPIX PTZ servo",
    "Steers an Axis pan-tilt-zoom camera after the tracked target"
);

fn defaults() -> Settings {
    let mut settings = Settings::new(PARTICULARS.environment);
    settings.channel = "1".to_owned();
    settings
}

fn camera() -> Property {
    let builder = glib::ParamSpecUInt::builder("camera").minimum(1).maximum(64).default_value(1);
    let spec = mutable(builder.blurb("Video channel of the camera"), Takes::AtStart).build();
    special(
        (spec, Takes::AtStart),
        |settings| settings.channel.parse::<u32>().unwrap_or(1).to_value(),
        |settings, value| {
            let channel = value.get::<u32>().map_err(|err| err.to_string())?;
            settings.channel = channel.to_string();
            Ok(())
        },
    )
}
