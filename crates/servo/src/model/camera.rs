// SPDX-License-Identifier: MPL-2.0

use super::{CommandHistory, HardLimits, Lens, PanTilt, Position, Range, SpeedMap, TableRow};

/// Field of view of a camera that does not tell: a common dome's, zoomed out.
const ASSUMED_FOV_DEG: f64 = 55.0;

/// The travel of the optical zoom; beyond it cameras magnify digitally.
const OPTICAL: Range = Range { min: 0.0, max: 1.0 };

/// A lens that travels less than that does not zoom.
const SHORTEST_TRAVEL: f64 = 1e-4;

/// What the camera told of itself; every part is optional.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Capabilities {
    /// How far it can look and zoom.
    pub limits: HardLimits,
    /// What parts of the fastest are per second, growing ...
    pub speeds: Vec<TableRow>,
    /// ... in this unit.
    pub speed_unit: SpeedUnit,
    /// Magnification by the zoom's travel, growing.
    pub zooms: Vec<TableRow>,
    /// Magnification at the end of the optical zoom.
    pub max_optical_magnification: Option<f64>,
    /// Fields of view per second that no speed exceeds, where speeds are proportional to the field of view.
    pub max_fields_s: Option<f64>,
    /// Whether it can zoom at a speed.
    pub continuous_zoom: Option<bool>,
    /// The speed of its moves to a position, as a part of the fastest.
    pub move_speed: Option<f64>,
}

/// In what speeds are told.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SpeedUnit {
    /// Degrees per second.
    #[default]
    Degrees,
    /// Horizontal fields of view per second: the narrower the view, the slower.
    Fields,
}

/// The camera as it is known.
#[derive(Debug)]
pub struct CameraModel {
    /// What it told of itself.
    pub capabilities: Capabilities,
    /// Where it last said it looks.
    pub position: Position,
    /// What it was told.
    pub history: CommandHistory,
    /// How fast it is, as it is known by now.
    pub speed_map: SpeedMap,
}

impl CameraModel {
    /// How fast its motors are assumed to accelerate, degrees per second squared; no camera reports it. Without a ramp the time
    /// to reach a rate is taken for latency, the more the quicker a target is sought: 220 ms were learned where 160 are true.
    /// The slowest heads that are simulated do 400; with 800 those that reach a rate at once are led past the target.
    const ACCELERATION_DEG_S2: f64 = 1000.0;

    /// A camera that told nothing yet, and is taken to be that fast.
    pub fn new(speed_map: SpeedMap) -> Self {
        let (capabilities, position) = (Capabilities::default(), Position::default());
        let history = CommandHistory::accelerating(Self::ACCELERATION_DEG_S2);
        Self { capabilities, position, history, speed_map }
    }

    /// Where it looks, where it told both angles.
    pub fn pan_tilt(&self) -> Option<PanTilt> {
        self.position.pan_tilt()
    }

    /// Horizontal field of view in degrees at the zoom it last told. `wide_fov_deg`: that of the lens zoomed out, where
    /// it is set; else what the camera told, or what is common.
    pub fn fov_deg(&self, wide_fov_deg: Option<f64>) -> f64 {
        let lens = self.capabilities.lens_or_fixed(wide_fov_deg);
        lens.fov_deg(self.position.zoom.unwrap_or(OPTICAL.min))
    }
}

impl Capabilities {
    /// Its lens; `None` where it told neither field of view nor zoom.
    pub fn lens(&self) -> Option<Lens> {
        let angle = self.limits.field_angle_deg;
        let wide_deg = angle.map_or(ASSUMED_FOV_DEG, |angle| angle.max);
        if self.zooms.len() > 1 {
            return Some(Lens::new(wide_deg, self.zooms.clone()));
        }
        let most = angle.map(|angle| Lens::magnification_between(angle.max, angle.min));
        let most = self.max_optical_magnification.or(most)?;
        let travel = self.limits.zoom.unwrap_or(OPTICAL);
        // Beyond the optical zoom it magnifies on, but by how much nobody says.
        let max = travel.max.min(OPTICAL.max).max(travel.min + SHORTEST_TRAVEL);
        Some(Lens::linear(wide_deg, Range { max, ..travel }, most))
    }

    /// Its lens, with another field of view zoomed out where one is set; one that does not zoom where it did not tell.
    pub fn lens_or_fixed(&self, wide_fov_deg: Option<f64>) -> Lens {
        match (self.lens(), wide_fov_deg) {
            (Some(lens), Some(wide_deg)) => lens.with_wide_fov(wide_deg),
            (Some(lens), None) => lens,
            (None, wide_deg) => Lens::fixed(wide_deg.unwrap_or(ASSUMED_FOV_DEG)),
        }
    }

    /// The lens of a camera that tells nothing of it, by what a picture shows: zoomed out as it was met.
    pub fn lens_by_picture(wide_fov_deg: Option<f64>) -> Lens {
        Lens::by_magnification(wide_fov_deg.unwrap_or(ASSUMED_FOV_DEG))
    }

    /// Horizontal field of view in degrees, zoomed out.
    pub fn fov_zoomed_out_deg(&self, wide_fov_deg: Option<f64>) -> f64 {
        self.lens_or_fixed(wide_fov_deg).fov_deg(OPTICAL.min)
    }

    /// Whether it told its field of view.
    pub fn tells_fov(&self) -> bool {
        self.limits.field_angle_deg.is_some()
    }

    /// The speed map it told, as it is without proportional speed, at a field of view.
    pub fn told_speeds(&self, fov_deg: f64) -> Option<SpeedMap> {
        let unit_deg = match self.speed_unit {
            SpeedUnit::Degrees => 1.0,
            SpeedUnit::Fields => fov_deg,
        };
        let speeds: Vec<_> =
            self.speeds.iter().map(|row| TableRow { value: row.value * unit_deg, ..*row }).collect();
        SpeedMap::through(&speeds)
    }

    /// The most degrees per second that proportional speed leaves at a field of view.
    pub fn proportional_cap_deg_s(&self, fov_deg: f64) -> f64 {
        self.max_fields_s.map_or(f64::INFINITY, |fields_of_view| fields_of_view * fov_deg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::SpeedCurve;

    fn camera(capabilities: Capabilities) -> CameraModel {
        CameraModel { capabilities, ..CameraModel::new(SpeedMap::new(450.0, SpeedCurve::Cubic)) }
    }

    #[test]
    fn field_of_view_follows_the_zoom() {
        let limits =
            HardLimits { field_angle_deg: Some(Range { min: 3.2, max: 55.2 }), ..HardLimits::default() };
        let mut told = camera(Capabilities { limits, ..Capabilities::default() });
        assert!((told.fov_deg(None) - 55.2).abs() < 1e-9);
        told.position.zoom = Some(1.0);
        assert!((told.fov_deg(None) - 3.2).abs() < 1e-9);
        // Set by hand: the widest, from which the lens narrows as it does.
        let magnification = Lens::magnification_between(40.0, told.fov_deg(Some(40.0)));
        assert!((magnification - Lens::magnification_between(55.2, 3.2)).abs() < 1e-9);
        let silent = camera(Capabilities::default());
        assert!((silent.fov_deg(None) - ASSUMED_FOV_DEG).abs() < 1e-9);
        assert!((silent.fov_deg(Some(40.0)) - 40.0).abs() < 1e-9);
        assert!(!silent.capabilities.tells_fov());
    }

    #[test]
    fn a_told_magnification_outweighs_the_field_angles() {
        let mut told = Capabilities { max_optical_magnification: Some(10.0), ..Capabilities::default() };
        assert!((told.lens().unwrap().magnification(1.0) - 10.0).abs() < 1e-9);
        told.zooms = vec![TableRow { setting: 0.0, value: 1.0 }, TableRow { setting: 1.0, value: 3.0 }];
        assert!((told.lens().unwrap().magnification(1.0) - 3.0).abs() < 1e-9);
    }
}
