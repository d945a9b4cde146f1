// SPDX-License-Identifier: MPL-2.0

use ptztrack_contract::{Point, Vector};

use super::{PanTilt, Range, TableRow};

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

    /// Where in the picture the middle will have been taken from, once the camera has turned by so much: the inverse of
    /// [`Self::error`].
    pub fn point(&self, turn: PanTilt) -> Point {
        let [right, up, ahead] = self.ray(turn);
        let width = 2.0 * self.half_width();
        Point { x: 0.5 + right / ahead / width, y: 0.5 - up / ahead * self.aspect / width }
    }

    /// The same of as much of the turn as stays within the picture: what lies beyond, or behind, has no place in it.
    pub fn point_within(&self, turn: PanTilt) -> Point {
        const HALVINGS: u32 = 40;
        // Beyond the zenith right and left would change places.
        let tilt = (self.tilt_deg + turn.tilt).clamp(-90.0, 90.0) - self.tilt_deg;
        let turn = PanTilt::new(turn.pan.clamp(-180.0, 180.0), tilt);
        if self.shows(turn) {
            return self.point(turn);
        }
        let (mut inside, mut outside) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let part = (inside + outside) / 2.0;
            *if self.shows(turn * part) { &mut inside } else { &mut outside } = part;
        }
        self.point(turn * inside)
    }

    /// Whether what will be in the middle after the turn is in the picture.
    fn shows(&self, turn: PanTilt) -> bool {
        let Point { x, y } = self.point(turn);
        self.ray(turn)[2] > 0.0 && (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y)
    }

    /// Where the middle after the turn is from the camera: to the right, up and ahead.
    fn ray(&self, turn: PanTilt) -> [f64; 3] {
        ray(self.tilt_deg, turn)
    }

    /// Degrees per second of a point that moves through the picture with `velocity` (frames per second).
    pub fn rate(&self, point: Point, velocity: Vector) -> PanTilt {
        // Short enough to be the derivative, long enough for the difference to be exact.
        const STEP_S: f64 = 1e-3;
        let ahead = Point { x: point.x + velocity.x * STEP_S, y: point.y + velocity.y * STEP_S };
        // Beyond the nadir pan may pass 180 degrees meanwhile.
        self.error(point).turn_to(self.error(ahead)) / STEP_S
    }

    /// How far each axis turns to move the picture by an angle, in degrees, at a target that is off by `error`.
    ///
    /// The steeper it is below (or above) the camera, the less is moved by pan; where it is no farther than that angle
    /// from the nadir, nobody can tell its pan, and no turn is enough.
    pub fn turns(&self, angle_deg: f64, error: PanTilt) -> PanTilt {
        let cos = (self.tilt_deg + error.tilt).to_radians().cos();
        let pan_deg = if cos > angle_deg.to_radians().sin() { angle_deg / cos } else { f64::INFINITY };
        PanTilt::new(pan_deg, angle_deg)
    }

    /// Half the picture's width at distance 1.
    fn half_width(&self) -> f64 {
        half_tangent(self.horizontal_fov_deg)
    }
}

/// A zoom lens: how much it magnifies at which part of its travel.
#[derive(Debug, Clone, PartialEq)]
pub struct Lens {
    /// Horizontal field of view zoomed out, degrees.
    wide_fov_deg: f64,
    magnifications: Magnifications,
}

/// How much a lens magnifies.
#[derive(Debug, Clone, PartialEq)]
enum Magnifications {
    /// By parts of the travel, growing; straight lines in between.
    Told(Vec<TableRow>),
    /// Nobody says by which part of the travel: what is counted is the logarithm of the magnification.
    Logarithm,
}

impl Lens {
    /// A lens that does not zoom, or not that anybody knew.
    pub fn fixed(fov_deg: f64) -> Self {
        Self::new(fov_deg, Vec::new())
    }

    /// A lens whose travel is counted by the logarithm of its magnification.
    pub fn by_magnification(wide_fov_deg: f64) -> Self {
        Self { wide_fov_deg, magnifications: Magnifications::Logarithm }
    }

    /// A lens with a table of its magnification by its travel, rows growing in both.
    pub fn new(wide_fov_deg: f64, magnifications: Vec<TableRow>) -> Self {
        Self { wide_fov_deg, magnifications: Magnifications::Told(magnifications) }
    }

    /// Magnification grows linearly with the travel, as in the one table that is documented, up to `max`.
    pub fn linear(wide_fov_deg: f64, travel: Range, max: f64) -> Self {
        let row = |setting, value| TableRow { setting, value };
        Self::new(wide_fov_deg, vec![row(travel.min, 1.0), row(travel.max, max)])
    }

    /// How much narrower one field of view is than another, both in degrees, as a magnification.
    pub fn magnification_between(wide_deg: f64, narrow_deg: f64) -> f64 {
        half_tangent(wide_deg) / half_tangent(narrow_deg)
    }

    /// The same lens with another field of view zoomed out.
    pub fn with_wide_fov(self, wide_fov_deg: f64) -> Self {
        Self { wide_fov_deg, ..self }
    }

    /// Horizontal field of view in degrees at a part of the travel.
    pub fn fov_deg(&self, travel: f64) -> f64 {
        magnified(self.wide_fov_deg, self.magnification(travel))
    }

    /// Magnification at a part of the travel.
    pub fn magnification(&self, travel: f64) -> f64 {
        match &self.magnifications {
            Magnifications::Told(rows) => {
                interpolate(rows, travel, |row| (row.setting, row.value)).unwrap_or(1.0)
            }
            Magnifications::Logarithm => travel.exp(),
        }
    }

    /// The part of the travel that magnifies so much more than another; `None` where it does not zoom.
    pub fn travel_magnified(&self, travel: f64, factor: f64) -> Option<f64> {
        self.travel(magnified(self.fov_deg(travel), factor))
    }

    /// The part of the travel with a horizontal field of view nearest to this, in degrees; `None` where it does not zoom.
    pub fn travel(&self, fov_deg: f64) -> Option<f64> {
        let wanted = Self::magnification_between(self.wide_fov_deg, fov_deg);
        match &self.magnifications {
            Magnifications::Told(rows) => interpolate(rows, wanted, |row| (row.value, row.setting)),
            Magnifications::Logarithm => Some(wanted.ln()),
        }
    }
}

/// Where what a camera tilted by `tilt_deg` would look at after a turn is from it: to the right, up and ahead.
fn ray(tilt_deg: f64, turn: PanTilt) -> [f64; 3] {
    let (pan, elevation) = (turn.pan.to_radians(), (tilt_deg + turn.tilt).to_radians());
    let (right, high, far) = (pan.sin() * elevation.cos(), elevation.sin(), pan.cos() * elevation.cos());
    let (sin, cos) = tilt_deg.to_radians().sin_cos();
    [right, high * cos - far * sin, far * cos + high * sin]
}

/// By how many degrees that is above the middle of the picture, before the turn.
pub fn rise_deg(tilt_deg: f64, turn: PanTilt) -> f64 {
    let [right, up, ahead] = ray(tilt_deg, turn);
    up.atan2(right.hypot(ahead)).to_degrees()
}

/// The field of view in degrees of a picture magnified so much.
pub fn magnified(fov_deg: f64, magnification: f64) -> f64 {
    2.0 * (half_tangent(fov_deg) / magnification).atan().to_degrees()
}

fn half_tangent(fov_deg: f64) -> f64 {
    (fov_deg / 2.0).to_radians().tan()
}

/// The value at `x` of straight lines between the rows, which grow; the first and last hold beyond. `None` of no row.
fn interpolate(rows: &[TableRow], x: f64, axes: impl Fn(&TableRow) -> (f64, f64)) -> Option<f64> {
    let above = rows.partition_point(|row| axes(row).0 < x);
    match (above.checked_sub(1).and_then(|below| rows.get(below)), rows.get(above)) {
        (Some(low), Some(high)) => {
            let ((x0, y0), (x1, y1)) = (axes(low), axes(high));
            Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0))
        }
        (Some(row), None) | (None, Some(row)) => Some(axes(row).1),
        (None, None) => None,
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
    fn steeply_below_pan_moves_little_and_at_the_nadir_nothing() {
        let down = |tilt_deg: f64| View { tilt_deg, ..LEVEL }.turns(1.5, PanTilt::new(40.0, -5.0));
        near(down(5.0).pan, 1.5, 1e-9);
        near(down(-55.0).pan, 3.0, 1e-9);
        assert_eq!((down(-55.0).tilt, down(-84.0).pan), (1.5, f64::INFINITY));
        near(rise_deg(-80.0, PanTilt::new(0.0, -5.0)), -5.0, 1e-9);
        near(rise_deg(-80.0, PanTilt::new(180.0, 0.0)), -20.0, 1e-9);
    }

    #[test]
    fn image_velocity_becomes_degrees_per_second() {
        // In the middle a frame is 2 tan(30 deg) wide.
        let rate = LEVEL.rate(Point { x: 0.5, y: 0.5 }, Vector { x: 0.1, y: 0.1 });
        near(rate.pan, (0.2 * 30f64.to_radians().tan()).to_degrees(), 1e-3);
        near(rate.tilt, -(0.2 * 30f64.to_radians().tan() * 9.0 / 16.0).to_degrees(), 1e-3);
        // From the one side of the camera's back to the other, beyond the nadir.
        let beyond = View { tilt_deg: -80.0, ..LEVEL };
        let rate = beyond.rate(Point { x: 0.499_95, y: 0.99 }, Vector { x: 0.1, y: 0.0 });
        assert!(rate.pan.abs() < 90.0, "{rate:?}");
    }

    #[test]
    fn magnification_is_linear_in_the_travel() {
        let max = Lens::magnification_between(55.2, 3.2);
        let lens = Lens::linear(55.2, Range { min: 0.0, max: 1.0 }, max);
        near(lens.fov_deg(0.0), 55.2, 1e-9);
        near(lens.fov_deg(1.0), 3.2, 1e-9);
        near(lens.fov_deg(2.0), 3.2, 1e-9);
        near(lens.magnification(0.5), (1.0 + max) / 2.0, 1e-9);
        near(lens.travel(lens.fov_deg(0.1234)).unwrap(), 0.1234, 1e-9);
        near(
            lens.magnification(lens.travel_magnified(0.1, 1.5).unwrap()),
            1.5 * lens.magnification(0.1),
            1e-9,
        );
        assert_eq!((lens.travel(90.0), lens.travel(0.1)), (Some(0.0), Some(1.0)));
    }

    #[test]
    fn a_lens_has_its_own_table_or_none() {
        let row = |setting, value| TableRow { setting, value };
        let lens = Lens::new(60.0, vec![row(0.0, 1.0), row(0.5, 2.0), row(1.0, 12.0)]);
        near(lens.magnification(0.5), 2.0, 1e-9);
        near(lens.magnification(0.75), 7.0, 1e-9);
        near(lens.clone().with_wide_fov(40.0).fov_deg(0.0), 40.0, 1e-9);
        assert_eq!((Lens::fixed(50.0).fov_deg(0.777), Lens::fixed(50.0).travel(20.0)), (50.0, None));
    }

    proptest! {
        #[test]
        fn the_point_of_an_error_is_where_it_was(x in 0.0..1.0f64, y in 0.0..1.0f64, tilt in -60.0..60.0f64) {
            let view = View { tilt_deg: tilt, ..LEVEL };
            let point = view.point(view.error(Point { x, y }));
            prop_assert!((point.x - x).abs() < 1e-9 && (point.y - y).abs() < 1e-9, "{point:?}");
        }

        /// However far the camera is to turn, the place named is in the picture, and on that side.
        #[test]
        fn a_turn_beyond_the_picture_is_its_edge(
            pan in -200.0..200.0f64, up in -200.0..200.0f64, tilt in -89.0..89.0f64,
        ) {
            let view = View { tilt_deg: tilt, ..LEVEL };
            let Point { x, y } = view.point_within(PanTilt::new(pan, up));
            prop_assert!((0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y), "{x}, {y}");
            prop_assert!((x - 0.5) * pan >= 0.0, "{x}");
            let level = view.point_within(PanTilt::new(0.0, up));
            prop_assert!((0.5 - level.y) * up >= 0.0 && (level.x - 0.5).abs() < 1e-9, "{level:?}");
            let farther = LEVEL.point_within(PanTilt::new(40f64.copysign(pan) + pan, 0.0));
            prop_assert!((farther.x - if pan < 0.0 { 0.0 } else { 1.0 }).abs() < 1e-6, "{farther:?}");
        }

        #[test]
        fn a_turn_within_the_picture_is_not_shortened(x in 0.001..0.999f64, y in 0.001..0.999f64, tilt in -60.0..60.0f64) {
            let view = View { tilt_deg: tilt, ..LEVEL };
            let turn = view.error(Point { x, y });
            prop_assert_eq!(view.point_within(turn), view.point(turn));
        }

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
