// SPDX-License-Identifier: MPL-2.0

//! The camera's ONVIF face: as much of Profile S as moving it takes, with the quirks of real cameras.

mod discovery;
mod message;
mod quirks;
mod services;

pub use quirks::{Quirk, quirk_table};

pub(crate) use discovery::Discovery;
pub(crate) use message::{Message, envelope, fault};
pub(crate) use services::{Refusal, answer, clock};

use crate::kinematics::Kinematics;

/// Path of the device service, which the specification fixes.
pub(crate) const DEVICE_SERVICE: &str = "/onvif/device_service";
pub(crate) const MEDIA_SERVICE: &str = "/onvif/media_service";
pub(crate) const MEDIA2_SERVICE: &str = "/onvif/media2_service";
pub(crate) const PTZ_SERVICE: &str = "/onvif/ptz_service";

/// How a camera speaks ONVIF.
#[derive(Debug, Clone, Default)]
pub struct OnvifSettings {
    /// In what it differs from the specification.
    pub quirks: Vec<Quirk>,
    /// Whether it tells its position in degrees too.
    pub degrees: bool,
    /// How many degrees a second it calls its fastest where it takes velocities in these too, rightly or not.
    pub degrees_s: Option<f64>,
    /// The same in fields of view a second: the narrower the view, the slower. At its widest it is as fast as in other units.
    pub fields_s: Option<f64>,
    /// Whether it refuses velocities in any of these units, though it says that it takes them.
    pub refuses_units: bool,
    /// Whether it speaks no VAPIX.
    pub alone: bool,
    /// Whether it answers who asks on the loopback interface which cameras there are (WS-Discovery).
    pub discoverable: bool,
}

impl OnvifSettings {
    /// With these quirks.
    pub fn with(quirks: &[Quirk]) -> Self {
        Self { quirks: quirks.to_vec(), ..Self::default() }
    }

    /// How the head of such a camera moves where its time is stepped.
    pub(crate) fn stepped(&self, kinematics: &Kinematics) -> Kinematics {
        let mut kinematics = kinematics.clone();
        if self.has(Quirk::Late) {
            kinematics.command_delay += Quirk::LEAST_LATE;
            kinematics.command_jitter += Quirk::MORE_LATE;
        }
        kinematics
    }

    pub(crate) fn has(&self, quirk: Quirk) -> bool {
        self.quirks.contains(&quirk)
    }
}
