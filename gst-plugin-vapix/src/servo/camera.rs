use std::fmt;

use super::{Lens, PanTilt, SpeedMap, is_endless};
use crate::vapix::{Attributes, Limits, Parameters, Position, Range};

/// Field of view of a camera that does not tell: a common dome's, zoomed out.
const ASSUMED_FOV_DEG: f64 = 55.0;

/// Steps of optical zoom; beyond them cameras magnify digitally.
const OPTICAL_STEPS: Range = Range { min: 1.0, max: 9999.0 };

/// What the camera said of itself; every part is optional.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CameraModel {
    /// How far it can look, from `query=limits`.
    pub limits: Limits,
    /// Its PTZ parameters.
    pub parameters: Parameters,
    /// What its steps mean.
    pub attributes: Attributes,
    /// The speed step of its moves to a position.
    pub move_speed: Option<u8>,
    /// Where it last said it looks.
    pub position: Position,
    /// It refused a move that was to be free of proportional speed.
    pub refuses_free_moves: bool,
}

impl CameraModel {
    /// How far it can look and zoom, by whichever of its answers.
    pub fn limits(&self) -> Limits {
        self.limits.or(self.parameters.limits)
    }

    /// Its lens; `None` where it told neither field of view nor zoom.
    pub fn lens(&self) -> Option<Lens> {
        let limits = self.limits();
        let angle = limits.field_angle_deg;
        let wide_deg = angle.map_or(ASSUMED_FOV_DEG, |angle| angle.max);
        if self.attributes.zooms.len() > 1 {
            return Some(Lens::new(wide_deg, self.attributes.zooms.clone()));
        }
        let most = angle.map(|angle| Lens::magnification_between(angle.max, angle.min));
        let most = self.attributes.max_optical_magnification.or(most)?;
        let steps = limits.zoom_steps.unwrap_or(OPTICAL_STEPS);
        // Beyond the optical steps it magnifies on, but by how much nobody says.
        let max = steps.max.min(OPTICAL_STEPS.max).max(steps.min + 1.0);
        Some(Lens::linear(wide_deg, Range { max, ..steps }, most))
    }

    /// Its lens, with another field of view zoomed out where one is set; one that does not zoom where it did not tell.
    pub fn lens_or_fixed(&self, wide_fov_deg: Option<f64>) -> Lens {
        match (self.lens(), wide_fov_deg) {
            (Some(lens), Some(wide_deg)) => lens.with_wide_fov(wide_deg),
            (Some(lens), None) => lens,
            (None, wide_deg) => Lens::fixed(wide_deg.unwrap_or(ASSUMED_FOV_DEG)),
        }
    }

    /// Horizontal field of view in degrees at the zoom it last told. `wide_fov_deg`: that of the lens zoomed out, where
    /// it is set; else what the camera told, or what is common.
    pub fn fov_deg(&self, wide_fov_deg: Option<f64>) -> f64 {
        self.lens_or_fixed(wide_fov_deg).fov_deg(self.position.zoom_steps.unwrap_or(OPTICAL_STEPS.min))
    }

    /// The same, zoomed out.
    pub fn fov_zoomed_out_deg(&self, wide_fov_deg: Option<f64>) -> f64 {
        self.lens_or_fixed(wide_fov_deg).fov_deg(OPTICAL_STEPS.min)
    }

    /// Whether it told its field of view.
    pub fn tells_fov(&self) -> bool {
        self.limits().field_angle_deg.is_some()
    }

    /// The speed map it told, as it is without proportional speed.
    pub fn told_speeds(&self) -> Option<SpeedMap> {
        SpeedMap::through(&self.attributes.speeds)
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

    /// The most degrees per second that proportional speed (on in every recorded dome) leaves at a field of view.
    pub fn proportional_cap_deg_s(&self, fov_deg: f64) -> f64 {
        match (self.parameters.proportional_speed, self.parameters.max_proportional_speed) {
            (Some(true), Some(fields_of_view)) if !self.takes_free_moves() => fields_of_view * fov_deg,
            _ => f64::INFINITY,
        }
    }

    /// Where it looks, where it told both angles.
    pub fn pan_tilt(&self) -> Option<PanTilt> {
        Some(PanTilt::new(self.position.pan_deg?, self.position.tilt_deg?))
    }
}

/// What it told, in one line.
impl fmt::Display for CameraModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let limits = self.limits();
        let range = |range: Option<Range>, unit: &str| {
            range.map_or("not told".to_owned(), |range| format!("{} to {}{unit}", range.min, range.max))
        };
        let endless = if limits.pan_deg.is_some_and(is_endless) { ", endless" } else { "" };
        write!(f, "pan {}{endless}; tilt {}; ", range(limits.pan_deg, "°"), range(limits.tilt_deg, "°"))?;
        write!(f, "zoom {}; ", range(limits.zoom_steps, ""))?;
        write!(f, "field of view {}; ", range(limits.field_angle_deg, "°"))?;
        match self.told_speeds() {
            Some(map) => write!(f, "speeds to {:.0}°/s; ", map.deg_s(100))?,
            None => f.write_str("speeds not told; ")?,
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
    use crate::vapix::StepMeaning;

    #[test]
    fn it_is_told_in_one_line() {
        let nothing = "pan not told; tilt not told; zoom not told; field of view not told; speeds not told; \
                       not told whether proportional; no control queue";
        assert_eq!(CameraModel::default().to_string(), nothing);
        let limits = Limits {
            pan_deg: Some(Range { min: -180.0, max: 180.0 }),
            tilt_deg: Some(Range { min: -20.0, max: 90.0 }),
            zoom_steps: Some(OPTICAL_STEPS),
            field_angle_deg: Some(Range { min: 3.2, max: 55.2 }),
        };
        let parameters =
            Parameters { proportional_speed: Some(true), control_queue: Some(true), ..Parameters::default() };
        let camera = CameraModel { limits, parameters, ..CameraModel::default() };
        let text = "pan -180 to 180°, endless; tilt -20 to 90°; zoom 1 to 9999; field of view 3.2 to 55.2°; \
                    speeds not told; proportional to the field of view; a control queue";
        assert_eq!(camera.to_string(), text);
    }

    #[test]
    fn field_of_view_follows_the_zoom() {
        let limits = Limits { field_angle_deg: Some(Range { min: 3.2, max: 55.2 }), ..Limits::default() };
        let mut camera = CameraModel { limits, ..CameraModel::default() };
        assert!((camera.fov_deg(None) - 55.2).abs() < 1e-9);
        camera.position.zoom_steps = Some(9999.0);
        assert!((camera.fov_deg(None) - 3.2).abs() < 1e-9);
        // Set by hand: the widest, from which the lens narrows as it does.
        let magnification = Lens::magnification_between(40.0, camera.fov_deg(Some(40.0)));
        assert!((magnification - Lens::magnification_between(55.2, 3.2)).abs() < 1e-9);
        assert!((CameraModel::default().fov_deg(None) - ASSUMED_FOV_DEG).abs() < 1e-9);
        assert!((CameraModel::default().fov_deg(Some(40.0)) - 40.0).abs() < 1e-9);
        assert!(!CameraModel::default().tells_fov());
    }

    #[test]
    fn a_told_magnification_outweighs_the_field_angles() {
        let attributes = Attributes { max_optical_magnification: Some(10.0), ..Attributes::default() };
        let mut camera = CameraModel { attributes, ..CameraModel::default() };
        camera.position.zoom_steps = Some(9999.0);
        assert!((camera.lens().unwrap().magnification(9999.0) - 10.0).abs() < 1e-9);
        camera.attributes.zooms =
            vec![StepMeaning { step: 1.0, value: 1.0 }, StepMeaning { step: 9999.0, value: 3.0 }];
        assert!((camera.lens().unwrap().magnification(9999.0) - 3.0).abs() < 1e-9);
    }

    #[test]
    fn proportional_speed_caps_where_it_cannot_be_left_out() {
        let mut camera = CameraModel::default();
        assert_eq!(camera.proportional_cap_deg_s(55.0), f64::INFINITY);
        camera.parameters.proportional_speed = Some(true);
        camera.parameters.max_proportional_speed = Some(2.0);
        assert_eq!(camera.proportional_cap_deg_s(55.0), 110.0);
        camera.attributes.speeds = vec![StepMeaning { step: 100.0, value: 150.0 }];
        assert!(camera.takes_free_moves());
        assert_eq!(camera.proportional_cap_deg_s(55.0), f64::INFINITY);
        camera.refuses_free_moves = true;
        assert_eq!(camera.proportional_cap_deg_s(55.0), 110.0);
    }
}
