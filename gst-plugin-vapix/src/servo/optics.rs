use ptztrack_contract::{Point, Vector};

use super::PanTilt;

/// What the camera sees at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Horizontal field of view, degrees.
    pub horizontal_fov_deg: f64,
    /// Width by height of the picture as displayed.
    pub aspect: f64,
    /// Where the camera looks, degrees above the horizon.
    pub tilt_deg: f64,
}

impl View {
    /// Vertical field of view in degrees: pixels are square on the sensor plane.
    pub fn vertical_fov_deg(&self) -> f64 {
        2.0 * (self.half_width() / self.aspect).atan().to_degrees()
    }

    /// How far the camera must turn to bring `point` to the middle of the picture.
    ///
    /// The ray through the point of a pinhole camera is turned up by the tilt, and read as pan and
    /// elevation; near the middle this is atan of the offset, with pan divided by cos(tilt).
    pub fn error(&self, point: Point) -> PanTilt {
        let right = (point.x - 0.5) * 2.0 * self.half_width();
        let up = (0.5 - point.y) * 2.0 * self.half_width() / self.aspect;
        let (sin, cos) = self.tilt_deg.to_radians().sin_cos();
        let (ahead, above) = (cos - up * sin, sin + up * cos);
        PanTilt {
            pan: right.atan2(ahead).to_degrees(),
            tilt: above.atan2(right.hypot(ahead)).to_degrees() - self.tilt_deg,
        }
    }

    /// Degrees per second of a point that moves through the picture with `velocity` (frames per second).
    pub fn rate(&self, point: Point, velocity: Vector) -> PanTilt {
        // Short enough to be the derivative, long enough for the difference to be exact.
        const STEP_S: f64 = 1e-3;
        let ahead = Point { x: point.x + velocity.x * STEP_S, y: point.y + velocity.y * STEP_S };
        (self.error(ahead) - self.error(point)) / STEP_S
    }

    /// Half the picture's width at distance 1.
    fn half_width(&self) -> f64 {
        (self.horizontal_fov_deg / 2.0).to_radians().tan()
    }
}

/// A zoom lens: magnification grows linearly with the zoom step (Axis' example: step 3868 is 2x, 7736 is 3x).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Horizontal field of view zoomed out, degrees.
    pub wide_fov_deg: f64,
    /// Horizontal field of view zoomed in, degrees.
    pub tele_fov_deg: f64,
    /// Step zoomed out.
    pub wide_step: f64,
    /// Step zoomed in.
    pub tele_step: f64,
}

impl Lens {
    /// Horizontal field of view in degrees at a zoom step.
    pub fn fov_deg(&self, step: f64) -> f64 {
        let wide = (self.wide_fov_deg / 2.0).to_radians().tan();
        let tele = (self.tele_fov_deg / 2.0).to_radians().tan();
        let share = ((step - self.wide_step) / (self.tele_step - self.wide_step)).clamp(0.0, 1.0);
        let magnification = 1.0 + share * (wide / tele - 1.0);
        2.0 * (wide / magnification).atan().to_degrees()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LEVEL: View = View { horizontal_fov_deg: 60.0, aspect: 16.0 / 9.0, tilt_deg: 0.0 };

    fn near(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() < tolerance, "{found} instead of {expected}");
    }

    #[test]
    fn edges_are_half_the_field_of_view_away() {
        let right = LEVEL.error(Point { x: 1.0, y: 0.5 });
        near(right.pan, 30.0, 1e-9);
        near(right.tilt, 0.0, 1e-9);
        let top = LEVEL.error(Point { x: 0.5, y: 0.0 });
        near(top.tilt, LEVEL.vertical_fov_deg() / 2.0, 1e-9);
        near(LEVEL.vertical_fov_deg(), 35.98, 0.01);
    }

    #[test]
    fn looking_down_pan_grows_by_one_over_cosine() {
        let down = View { tilt_deg: -60.0, ..LEVEL };
        let point = Point { x: 0.501, y: 0.5 };
        near(down.error(point).pan / LEVEL.error(point).pan, 2.0, 1e-3);
    }

    #[test]
    fn image_velocity_becomes_degrees_per_second() {
        // In the middle a frame is 2 tan(30 deg) wide.
        let rate = LEVEL.rate(Point { x: 0.5, y: 0.5 }, Vector { x: 0.1, y: 0.1 });
        near(rate.pan, (0.2 * 30f64.to_radians().tan()).to_degrees(), 1e-3);
        near(rate.tilt, -(0.2 * 30f64.to_radians().tan() * 9.0 / 16.0).to_degrees(), 1e-3);
    }

    #[test]
    fn magnification_is_linear_in_the_step() {
        let lens = Lens { wide_fov_deg: 55.2, tele_fov_deg: 3.2, wide_step: 1.0, tele_step: 9999.0 };
        near(lens.fov_deg(1.0), 55.2, 1e-9);
        near(lens.fov_deg(9999.0), 3.2, 1e-9);
        near(lens.fov_deg(20_000.0), 3.2, 1e-9);
        let wide = 27.6f64.to_radians().tan();
        let middle = (lens.fov_deg(5000.0) / 2.0).to_radians().tan();
        near(wide / middle, (1.0 + wide / 1.6f64.to_radians().tan()) / 2.0, 1e-9);
    }

    proptest! {
        /// Turned by the error, the camera sees the point in the middle.
        #[test]
        fn the_error_points_at_the_target(x in 0.0..1.0f64, y in 0.0..1.0f64, tilt in -89.0..89.0f64) {
            let view = View { tilt_deg: tilt, ..LEVEL };
            let error = view.error(Point { x, y });
            let (right, up) = ((x - 0.5) * 2.0 * view.half_width(), (0.5 - y) * 2.0 * view.half_width() / view.aspect);
            let (sin, cos) = tilt.to_radians().sin_cos();
            let ray = [right, sin + up * cos, cos - up * sin];
            let (pan, elevation) = (error.pan.to_radians(), (tilt + error.tilt).to_radians());
            let axis = [pan.sin() * elevation.cos(), elevation.sin(), pan.cos() * elevation.cos()];
            let dot: f64 = ray.iter().zip(axis).map(|(a, b)| a * b).sum();
            let length = ray.iter().map(|a| a * a).sum::<f64>().sqrt();
            prop_assert!((dot / length - 1.0).abs() < 1e-9);
        }
    }
}
