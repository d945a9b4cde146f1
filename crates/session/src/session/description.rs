// SPDX-License-Identifier: MPL-2.0

use std::fmt;

use servo::{Capabilities, HardLimits, Range, SpeedUnit, is_endless};

use crate::{Attributes, Parameters};

/// What the camera answered to the questions of [`Discovery`](super::discovery::Discovery), by answer.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Description {
    /// `query=limits`.
    pub limits: HardLimits,
    /// Its PTZ parameters.
    pub parameters: Parameters,
    /// `query=attributes`.
    pub attributes: Attributes,
    /// `query=speed`.
    pub move_speed: Option<f64>,
    /// It refused a move that was to be free of proportional speed.
    pub refuses_free_moves: bool,
}

impl Description {
    /// What that means to the model of the camera.
    pub fn capabilities(&self) -> Capabilities {
        Capabilities {
            limits: self.limits(),
            speeds: self.attributes.speeds.clone(),
            speed_unit: self.attributes.speed_unit,
            zooms: self.attributes.zooms.clone(),
            max_optical_magnification: self.attributes.max_optical_magnification,
            max_fields_s: self.max_fields_s(),
            continuous_zoom: self.parameters.continuous_zoom,
            move_speed: self.move_speed,
        }
    }

    /// How far it can look and zoom, by whichever of its answers.
    fn limits(&self) -> HardLimits {
        self.limits.or(self.parameters.limits)
    }

    /// Whether its moves can be made free of proportional speed, one by one (`proportionalspeed=disabled`).
    ///
    /// Firmware that tells its attributes knows the word; one that turns out not to is not asked again.
    fn takes_free_moves(&self) -> bool {
        self.attributes != Attributes::default() && !self.refuses_free_moves
    }

    /// Whether moves are to be free of proportional speed: not where it is off anyway.
    pub fn wants_free_moves(&self) -> bool {
        self.parameters.proportional_speed != Some(false) && self.takes_free_moves()
    }

    /// Proportional speed is on in every recorded dome.
    fn max_fields_s(&self) -> Option<f64> {
        let bounded = self.parameters.proportional_speed == Some(true) && !self.takes_free_moves();
        self.parameters.max_proportional_speed.filter(|_| bounded)
    }
}

/// In one line.
impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let limits = self.limits();
        let range = |range: Option<Range>, unit: &str| {
            range.map_or("not told".to_owned(), |range| format!("{} to {}{unit}", range.min, range.max))
        };
        let endless = if limits.pan_deg.is_some_and(is_endless) { ", endless" } else { "" };
        write!(f, "pan {}{endless}; tilt {}; ", range(limits.pan_deg, "°"), range(limits.tilt_deg, "°"))?;
        match self.capabilities().lens() {
            Some(lens) => write!(f, "zoom to {:.1}x; ", lens.magnification(1.0))?,
            None => f.write_str("zoom not told; ")?,
        }
        write!(f, "field of view {}; ", range(limits.field_angle_deg, "°"))?;
        match (self.attributes.speeds.last(), self.attributes.speed_unit) {
            (Some(fastest), SpeedUnit::Degrees) => write!(f, "speeds to {:.0}°/s; ", fastest.value)?,
            (Some(fastest), SpeedUnit::Fields) => {
                write!(f, "speeds to {:.1} fields of view/s; ", fastest.value)?;
            }
            (None, _) => f.write_str("speeds not told; ")?,
        }
        let proportional = match self.parameters.proportional_speed {
            Some(true) if self.takes_free_moves() => "proportional, left out",
            Some(true) => "proportional to the field of view",
            Some(false) => "not proportional",
            None => "not told whether proportional",
        };
        let queue = if self.parameters.control_queue == Some(true) { "a" } else { "no" };
        write!(f, "{proportional}; {queue} control queue")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servo::TableRow;

    #[test]
    fn it_is_told_in_one_line() {
        let nothing = "pan not told; tilt not told; zoom not told; field of view not told; speeds not told; \
                       not told whether proportional; no control queue";
        assert_eq!(Description::default().to_string(), nothing);
        let limits = HardLimits {
            pan_deg: Some(Range { min: -180.0, max: 180.0 }),
            tilt_deg: Some(Range { min: -20.0, max: 90.0 }),
            zoom: Some(Range { min: 0.0, max: 1.0 }),
            field_angle_deg: Some(Range { min: 3.2, max: 55.2 }),
        };
        let parameters =
            Parameters { proportional_speed: Some(true), control_queue: Some(true), ..Parameters::default() };
        let camera = Description { limits, parameters, ..Description::default() };
        let text = "pan -180 to 180°, endless; tilt -20 to 90°; zoom to 18.7x; field of view 3.2 to 55.2°; \
                    speeds not told; proportional to the field of view; a control queue";
        assert_eq!(camera.to_string(), text);
    }

    #[test]
    fn proportional_speed_bounds_where_it_cannot_be_left_out() {
        let mut camera = Description::default();
        assert_eq!(camera.capabilities().max_fields_s, None);
        camera.parameters.proportional_speed = Some(true);
        camera.parameters.max_proportional_speed = Some(2.0);
        assert_eq!(camera.capabilities().max_fields_s, Some(2.0));
        camera.attributes.speeds = vec![TableRow { setting: 1.0, value: 150.0 }];
        assert!(camera.wants_free_moves());
        assert_eq!(camera.capabilities().max_fields_s, None);
        camera.refuses_free_moves = true;
        assert_eq!(camera.capabilities().proportional_cap_deg_s(55.0), 110.0);
    }
}
