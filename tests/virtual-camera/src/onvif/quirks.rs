// SPDX-License-Identifier: MPL-2.0

//! How cameras were seen to differ from the specification.

use std::{fmt::Write, time::Duration};

/// One list makes the switches and their table.
macro_rules! quirks {
    ($($(#[doc = $what:literal])+ $name:ident = $switch:literal, $seen:literal;)+) => {
        /// A way in which some camera was seen to differ from the specification.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
        pub enum Quirk {
            $($(#[doc = $what])+ #[value(name = $switch)] $name,)+
        }

        impl Quirk {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$name),+];

            /// As the command line has it.
            pub fn switch(self) -> &'static str {
                match self { $(Self::$name => $switch),+ }
            }

            /// What the camera does.
            pub fn what(self) -> &'static str {
                match self { $(Self::$name => concat!($($what),+)),+ }
            }

            /// Where it was seen.
            pub fn seen(self) -> &'static str {
                match self { $(Self::$name => $seen),+ }
            }
        }
    };
}

quirks! {
    /// `MoveStatus` is always `IDLE`
    StatusIdle = "status-idle", "Hikvision, several models: frigate issue 7958";
    /// `GetStatus` is answered after 30 s
    StatusLate = "status-late", "supposed: onvif/testspecs issue 132 asks that it be answered at once";
    /// A `Timeout` is refused
    TimeoutRefused = "timeout-refused", "Bosch: Jazea/Onvif.Core issue 30";
    /// A `Timeout` is taken and has no effect
    TimeoutIgnored = "timeout-ignored", "ONVIF_ICAMERA JM800S5_AF: scrypted pull request 2124";
    /// Only a `Timeout` of 1 to 10 s is taken
    TimeoutTen = "timeout-ten", "Dahua: frigate issue 9056";
    /// `Stop` is refused
    StopMissing = "stop-missing", "boifun, cloudedge: Home Assistant core pull request 163173";
    /// `Stop` is taken and has no effect
    StopIgnored = "stop-ignored", "TP-Link Tapo: go2rtc issue 1666";
    /// `Stop` has the connection closed
    StopCloses = "stop-closes", "Cohu: iris pull request 177";
    /// `Stop` without elements stops pan and tilt only
    StopPanTilt = "stop-pan-tilt", "supposed: no report is at hand";
    /// Relative moves are announced and not done
    RelativeIdle = "relative-idle", "Uniview: frigate, list of cameras";
    /// Tokens are refused whose time is more than 5 s off, and the clock is 1 h ahead
    ClockAhead = "clock-ahead", "Axis: onvif-rs issue 79";
    /// The same, with the clock 1 h behind
    ClockBehind = "clock-behind", "OpenIPC: majestic-webui issue 292";
    /// A move that zooms is answered by what is no HTTP
    ZoomBreaks = "zoom-breaks", "TP-Link TL-IPC652P-A4: onvifsim";
    /// Zooming goes the other way
    ZoomReversed = "zoom-reversed", "supposed: no report is at hand";
    /// The lens has one speed
    ZoomOneSpeed = "zoom-one-speed", "node-red-contrib-onvif-nodes issue 7";
    /// The connection is closed in place of a fault
    FaultCloses = "fault-closes", "Xiongmai: onvif-tt, expected failures";
    /// Commands are acted on, and answered, 100 to 800 ms late
    Late = "late", "onvifsim, facts; python-onvif issue 63";
    /// Velocities are made one of seven
    SevenSpeeds = "seven-speeds", "obs-face-tracker issue 126; Home Assistant core issue 131492";
    /// Namespaces have other prefixes
    Prefixes = "prefixes", "any SOAP library chooses its own";
    /// Panning goes the other way
    PanMirrored = "pan-mirrored", "Hikvision DS-2DF5220S: obs-ptz pull request 94";
    /// Tilting goes the other way
    TiltMirrored = "tilt-mirrored", "thingino issue 237";
    /// Pan tilts, and tilt pans
    AxesExchanged = "axes-exchanged", "supposed: no report is at hand";
    /// Neither spaces nor timeouts are told
    NoOptions = "no-options", "TP-Link: onvifsim";
    /// Only the second profile has PTZ
    SecondProfile = "second-profile", "onvifsim, C1";
    /// `GetServices` is refused
    NoServices = "no-services", "supposed: devices older than this message";
}

impl Quirk {
    /// All that one camera can have at once: of those that exclude each other, or hide another, there is one.
    pub fn together() -> Vec<Self> {
        let apart = [
            Self::TimeoutRefused,
            Self::TimeoutTen,
            Self::ClockBehind,
            Self::StopMissing,
            Self::StopCloses,
            Self::StopPanTilt,
            Self::StatusIdle,
            Self::ZoomBreaks,
        ];
        Self::ALL.iter().copied().filter(|quirk| !apart.contains(quirk)).collect()
    }

    /// The speed of [`Self::ZoomOneSpeed`], as a part of the fastest.
    pub(crate) const ONE_SPEED: f64 = 0.3;
    /// [`Self::Late`] is at least so late, ...
    pub(crate) const LEAST_LATE: Duration = Duration::from_millis(100);
    /// ... and up to so much later.
    pub(crate) const MORE_LATE: Duration = Duration::from_millis(700);
}

/// A table of them in Markdown, as the documentation has it.
pub fn quirk_table() -> String {
    let mut table = String::from("| switch | what the camera does | where it was seen |\n|---|---|---|\n");
    for quirk in Quirk::ALL {
        let _ = writeln!(table, "| `{}` |{} | {} |", quirk.switch(), quirk.what(), quirk.seen());
    }
    table
}
