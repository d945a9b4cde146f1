use super::{Lens, PanTilt, SpeedCurve, SpeedMap};
use crate::vapix::{Limits, Parameters, Position, Range};

/// Field of view of a camera that does not tell: a common dome's, zoomed out.
const ASSUMED_FOV_DEG: f64 = 55.0;

/// Last step of optical zoom; beyond it cameras magnify digitally.
const LAST_OPTICAL_STEP: f64 = 9999.0;

/// What the camera said of itself.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CameraModel {
    /// How far it can look.
    pub limits: Limits,
    /// Its PTZ parameters.
    pub parameters: Parameters,
    /// Where it last said it looks.
    pub position: Position,
}

impl CameraModel {
    /// Horizontal field of view in degrees at the present zoom, where the camera told it.
    pub fn told_fov_deg(&self) -> Option<f64> {
        let limits = self.limits.or(self.parameters.limits);
        let angle = limits.field_angle_deg?;
        let zoom = limits.zoom_steps.unwrap_or(Range { min: 1.0, max: LAST_OPTICAL_STEP });
        let lens = Lens {
            wide_fov_deg: angle.max,
            tele_fov_deg: angle.min,
            wide_step: zoom.min,
            tele_step: zoom.max.min(LAST_OPTICAL_STEP).max(zoom.min + 1.0),
        };
        Some(lens.fov_deg(self.position.zoom_steps.unwrap_or(lens.wide_step)))
    }

    /// Horizontal field of view in degrees: as told, or assumed.
    pub fn fov_deg(&self) -> f64 {
        self.told_fov_deg().unwrap_or(ASSUMED_FOV_DEG)
    }

    /// Speed steps of this camera at a field of view.
    ///
    /// With proportional speed (on in every recorded dome) no step exceeds `MaxProportionalSpeed`
    /// fields of view per second.
    pub fn speed_map(&self, full_deg_s: f64, curve: SpeedCurve, fov_deg: f64) -> SpeedMap {
        let cap_deg_s = match (self.parameters.proportional_speed, self.parameters.max_proportional_speed) {
            (Some(true), Some(fields_of_view)) => fields_of_view * fov_deg,
            _ => f64::INFINITY,
        };
        SpeedMap { full_deg_s, curve, cap_deg_s }
    }

    /// Where it looks, where it told both angles.
    pub fn pan_tilt(&self) -> Option<PanTilt> {
        Some(PanTilt::new(self.position.pan_deg?, self.position.tilt_deg?))
    }
}

/// Keeps the camera from being driven against its ends, and knows when it has got there.
#[derive(Debug, Default)]
pub struct LimitGuard {
    at_limit: bool,
}

impl LimitGuard {
    /// This near to its end an axis counts as there.
    const NEAR_DEG: f64 = 0.1;

    /// A range this wide is no end: the camera turns round and round.
    const ENDLESS_DEG: f64 = 359.0;

    /// `rate` without the part that would drive an axis on beyond its end.
    pub fn apply(&mut self, rate: PanTilt, camera: &CameraModel) -> PanTilt {
        let limits = camera.limits.or(camera.parameters.limits);
        let pan_limits = limits.pan_deg.filter(|range| range.max - range.min < Self::ENDLESS_DEG);
        let pan = held(rate.pan, camera.position.pan_deg, pan_limits);
        let tilt = held(rate.tilt, camera.position.tilt_deg, limits.tilt_deg);
        self.at_limit = pan.is_some() || tilt.is_some();
        PanTilt::new(pan.unwrap_or(rate.pan), tilt.unwrap_or(rate.tilt))
    }

    /// Whether the last rate was held back.
    pub fn at_limit(&self) -> bool {
        self.at_limit
    }
}

/// The rate that is left of one that drives outwards at an end; `None` where it is free.
fn held(rate: f64, position: Option<f64>, limits: Option<Range>) -> Option<f64> {
    let (position, limits) = (position?, limits?);
    let outwards = (rate > 0.0 && position >= limits.max - LimitGuard::NEAR_DEG)
        || (rate < 0.0 && position <= limits.min + LimitGuard::NEAR_DEG);
    outwards.then_some(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(pan: f64, min: f64, max: f64) -> CameraModel {
        CameraModel {
            limits: Limits { pan_deg: Some(Range { min, max }), ..Limits::default() },
            position: Position { pan_deg: Some(pan), tilt_deg: Some(0.0), zoom_steps: None },
            ..CameraModel::default()
        }
    }

    #[test]
    fn at_its_end_an_axis_only_moves_back() {
        let mut guard = LimitGuard::default();
        let (right, left) = (PanTilt::new(10.0, 3.0), PanTilt::new(-10.0, 3.0));
        assert_eq!(guard.apply(right, &camera(169.95, -170.0, 170.0)), PanTilt::new(0.0, 3.0));
        assert!(guard.at_limit());
        assert_eq!(guard.apply(left, &camera(169.95, -170.0, 170.0)), left);
        assert!(!guard.at_limit());
    }

    #[test]
    fn endless_pan_has_no_end() {
        let mut guard = LimitGuard::default();
        let right = PanTilt::new(10.0, 0.0);
        assert_eq!(guard.apply(right, &camera(180.0, -180.0, 180.0)), right);
        assert_eq!(guard.apply(right, &CameraModel::default()), right);
    }

    #[test]
    fn field_of_view_follows_the_zoom() {
        let limits = Limits { field_angle_deg: Some(Range { min: 3.2, max: 55.2 }), ..Limits::default() };
        let mut camera = CameraModel { limits, ..CameraModel::default() };
        assert!((camera.fov_deg() - 55.2).abs() < 1e-9);
        camera.position.zoom_steps = Some(9999.0);
        assert!((camera.fov_deg() - 3.2).abs() < 1e-9);
        assert_eq!(CameraModel::default().told_fov_deg(), None);
    }

    #[test]
    fn proportional_speed_bounds_the_map() {
        let mut camera = CameraModel::default();
        assert_eq!(camera.speed_map(450.0, SpeedCurve::Cubic, 55.0).deg_s(100), 450.0);
        camera.parameters.proportional_speed = Some(true);
        camera.parameters.max_proportional_speed = Some(2.0);
        assert_eq!(camera.speed_map(450.0, SpeedCurve::Cubic, 55.0).deg_s(100), 110.0);
    }
}
