// SPDX-License-Identifier: MPL-2.0

//! The pinhole: which pixel of the recording a pixel of the view sees.
//!
//! Axes of a camera: x to the right, y down, z forwards. A view at pan p and tilt t sees along its ray v what the
//! recording camera sees along R v with R = Ry(p) Rx(t). Both pictures being pinhole pictures from the same place, the
//! way from view pixel to recording pixel is the homography K_recording R K_view⁻¹, exactly, at any depth.

use crate::kinematics::{Limits, Pose};

/// A 3x3 matrix, row by row.
pub type Matrix = [[f64; 3]; 3];

/// A pinhole camera's picture: focal length and centre in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Pixels.
    pub focal: f64,
    /// Column of the optical axis.
    pub centre_x: f64,
    /// Row of the optical axis.
    pub centre_y: f64,
}

impl Pinhole {
    /// A picture of `width` x `height` pixels whose width covers `fov_deg`.
    pub fn new(width: u32, height: u32, fov_deg: f64) -> Self {
        Self {
            focal: f64::from(width) / 2.0 / (fov_deg / 2.0).to_radians().tan(),
            centre_x: (f64::from(width) - 1.0) / 2.0,
            centre_y: (f64::from(height) - 1.0) / 2.0,
        }
    }

    /// The same picture at half the resolution: a chroma plane of 4:2:0, sited between the pixels.
    pub fn halved(self) -> Self {
        Self {
            focal: self.focal / 2.0,
            centre_x: (self.centre_x - 0.5) / 2.0,
            centre_y: (self.centre_y - 0.5) / 2.0,
        }
    }

    fn to_pixel(self) -> Matrix {
        [[self.focal, 0.0, self.centre_x], [0.0, self.focal, self.centre_y], [0.0, 0.0, 1.0]]
    }

    fn to_ray(self) -> Matrix {
        let scale = 1.0 / self.focal;
        [[scale, 0.0, -self.centre_x * scale], [0.0, scale, -self.centre_y * scale], [0.0, 0.0, 1.0]]
    }
}

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let mut product = [[0.0; 3]; 3];
    for (row, target) in product.iter_mut().enumerate() {
        for (column, cell) in target.iter_mut().enumerate() {
            *cell = (0..3).map(|inner| a[row][inner] * b[inner][column]).sum();
        }
    }
    product
}

fn transpose(a: &Matrix) -> Matrix {
    let mut turned = [[0.0; 3]; 3];
    for (row, target) in turned.iter_mut().enumerate() {
        for (column, cell) in target.iter_mut().enumerate() {
            *cell = a[column][row];
        }
    }
    turned
}

/// From a ray of the view to the same ray of the recording.
pub(crate) fn rotation(pose: &Pose) -> Matrix {
    let (sin_p, cos_p) = pose.pan_deg.to_radians().sin_cos();
    let (sin_t, cos_t) = pose.tilt_deg.to_radians().sin_cos();
    let pan = [[cos_p, 0.0, sin_p], [0.0, 1.0, 0.0], [-sin_p, 0.0, cos_p]];
    let tilt = [[1.0, 0.0, 0.0], [0.0, cos_t, -sin_t], [0.0, sin_t, cos_t]];
    multiply(&pan, &tilt)
}

/// From a pixel of one view to the pixel of another view from the same place that shows the same.
pub fn between(from: (&Pose, &Pinhole), to: (&Pose, &Pinhole)) -> Matrix {
    let turned = multiply(&transpose(&rotation(to.0)), &rotation(from.0));
    multiply(&to.1.to_pixel(), &multiply(&turned, &from.1.to_ray()))
}

/// From a pixel of the view to the pixel of the recording, made at pan and tilt 0, that shows the same.
pub fn view_to_recording(pose: &Pose, view: &Pinhole, recording: &Pinhole) -> Matrix {
    between((pose, view), (&Pose::default(), recording))
}

/// Where a homography takes a point.
pub fn project(homography: &Matrix, x: f64, y: f64) -> (f64, f64) {
    let [u, v, w] = homogeneous(homography, x, y);
    (u / w, v / w)
}

/// Where a homography between two views takes a point; `None` where that is behind the other.
pub fn project_ahead(homography: &Matrix, x: f64, y: f64) -> Option<(f64, f64)> {
    // Rays have depth 1 in their own view, so that this is the depth in the other one.
    let [u, v, depth] = homogeneous(homography, x, y);
    (depth > 1e-6).then(|| (u / depth, v / depth))
}

fn homogeneous(homography: &Matrix, x: f64, y: f64) -> [f64; 3] {
    [0, 1, 2].map(|row| {
        let line = &homography[row];
        line[0] * x + line[1] * y + line[2]
    })
}

/// Pan and tilt in degrees that bring the ray (`x`, `y`, 1) of a view into its centre.
pub fn aim(pose: &Pose, x: f64, y: f64) -> (f64, f64) {
    let [right, down, ahead] = rotation(pose).map(|line| line[0] * x + line[1] * y + line[2]);
    let pan = right.atan2(ahead);
    let tilt = (-down).atan2(right.hypot(ahead));
    (pan.to_degrees(), tilt.to_degrees())
}

/// How far to the side the edge of a view reaches, in radians of pan, for what lies at a height of `above` the horizon:
/// the view is tilted by `tilt` and half as wide as `half`, all in radians.
pub(crate) fn edge_of_view(half: f64, tilt: f64, above: f64) -> f64 {
    let half = half.tan();
    let (across, down) = (half * tilt.cos(), half * above.tan() * tilt.sin());
    across.atan() + (down / across.hypot(1.0)).asin()
}

/// How far a view may turn in a recording so that all of it stays inside, for every pan with every tilt.
///
/// Fields of view horizontally in degrees, aspect ratios as height over width. The corners decide: with half sizes a, b of the
/// view and A, B of the recording (tangents) and limits P and T, P = atan A − atan(a / (cos T − b sin T)), and the
/// upper corner at (P, T) must stay below B. The largest T for which both hold leaves no room unused at the corner.
pub fn limits_inside(
    view_fov_deg: f64,
    view_aspect: f64,
    recording_fov_deg: f64,
    recording_aspect: f64,
) -> Limits {
    let half = |fov_deg: f64| (fov_deg / 2.0).to_radians().tan();
    let (a, a_recording) = (half(view_fov_deg), half(recording_fov_deg));
    let (b, b_recording) = (a * view_aspect, a_recording * recording_aspect);
    let pan_at = |tilt: f64| a_recording.atan() - (a / (tilt.cos() - b * tilt.sin())).atan();
    let fits = |tilt: f64| {
        let pan = pan_at(tilt);
        let ahead = (tilt.cos() - b * tilt.sin()) * pan.cos() - a * pan.sin();
        pan >= 0.0 && (b * tilt.cos() + tilt.sin()) / ahead <= b_recording
    };
    let (mut low, mut high) = (0.0, b_recording.atan());
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if fits(middle) { low = middle } else { high = middle }
    }
    // A hundredth of a degree less: the reported limits are rounded.
    let rounded = |angle: f64| (angle.to_degrees() * 100.0 - 1.0).floor().max(0.0) / 100.0;
    let (pan, tilt) = (rounded(pan_at(low)), rounded(low));
    Limits { pan_deg: (-pan, pan), tilt_deg: (-tilt, tilt) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pose(pan_deg: f64, tilt_deg: f64) -> Pose {
        Pose { pan_deg, tilt_deg, ..Pose::default() }
    }

    fn near(found: (f64, f64), expected: (f64, f64)) {
        let error = (found.0 - expected.0).hypot(found.1 - expected.1);
        assert!(error < 1e-6, "{found:?} instead of {expected:?}");
    }

    #[test]
    fn looking_ahead_is_a_mere_scaling() {
        let (view, recording) = (Pinhole::new(640, 480, 30.0), Pinhole::new(640, 480, 30.0));
        let homography = view_to_recording(&pose(0.0, 0.0), &view, &recording);
        near(project(&homography, 0.0, 0.0), (0.0, 0.0));
        near(project(&homography, 17.0, 403.0), (17.0, 403.0));
    }

    #[test]
    fn the_view_centre_is_where_the_angles_say() {
        let (view, recording) = (Pinhole::new(320, 240, 20.0), Pinhole::new(768, 576, 60.0));
        let right = view_to_recording(&pose(10.0, 0.0), &view, &recording);
        near(project(&right, 159.5, 119.5), (383.5 + recording.focal * 10f64.to_radians().tan(), 287.5));
        let up = view_to_recording(&pose(0.0, 5.0), &view, &recording);
        near(project(&up, 159.5, 119.5), (383.5, 287.5 - recording.focal * 5f64.to_radians().tan()));
    }

    #[test]
    fn the_edge_of_a_tilted_view_is_where_it_shows_things() {
        let view = Pinhole { focal: 1.0, centre_x: 0.0, centre_y: 0.0 };
        for (tilt, above) in [(0.0f64, 0.0f64), (-20.0, -20.0), (-15.0, -5.0), (10.0, -12.0)] {
            let pan = edge_of_view(0.5, tilt.to_radians(), above.to_radians());
            let ahead = between((&pose(pan.to_degrees(), above), &view), (&pose(0.0, tilt), &view));
            assert!((project(&ahead, 0.0, 0.0).0 - 0.5f64.tan()).abs() < 1e-9, "{tilt} {above}");
        }
    }

    #[test]
    fn what_is_behind_a_view_is_nowhere_in_it() {
        let (view, recording) = (Pinhole::new(320, 240, 20.0), Pinhole::new(768, 576, 60.0));
        let turned = between((&Pose::default(), &recording), (&pose(70.0, 0.0), &view));
        assert_eq!(project_ahead(&turned, 383.5, 287.5), Some(project(&turned, 383.5, 287.5)));
        assert_eq!(project_ahead(&turned, 0.0, 287.5), None);
    }

    #[test]
    fn chroma_sees_what_luma_sees() {
        let (view, recording) = (Pinhole::new(320, 240, 20.0), Pinhole::new(768, 576, 60.0));
        let luma = view_to_recording(&pose(7.0, -3.0), &view, &recording);
        let chroma = view_to_recording(&pose(7.0, -3.0), &view.halved(), &recording.halved());
        // Chroma pixel c lies between luma pixels 2c and 2c + 1.
        let (x, y) = project(&chroma, 30.0, 50.0);
        near(project(&luma, 60.5, 100.5), (2.0 * x + 0.5, 2.0 * y + 0.5));
    }

    proptest! {
        #[test]
        fn there_and_back_again(pan in -20.0f64..20.0, tilt in -10.0f64..10.0, x in 0.0f64..639.0, y in 0.0f64..479.0) {
            let (view, recording) = (Pinhole::new(640, 480, 25.0), Pinhole::new(768, 576, 60.0));
            let there = view_to_recording(&pose(pan, tilt), &view, &recording);
            let back = between((&Pose::default(), &recording), (&pose(pan, tilt), &view));
            let (u, v) = project(&there, x, y);
            let (x2, y2) = project(&back, u, v);
            prop_assert!((x - x2).abs() < 1e-6 && (y - y2).abs() < 1e-6);
        }

        #[test]
        fn aiming_brings_a_pixel_to_the_centre(pan in -60.0f64..60.0, tilt in -30.0f64..30.0, x in -0.5f64..0.5, y in -0.4f64..0.4) {
            let (right, up) = aim(&pose(pan, tilt), x, y);
            let view = Pinhole { focal: 1.0, centre_x: 0.0, centre_y: 0.0 };
            let world = view_to_recording(&pose(pan, tilt), &view, &view);
            let aimed = view_to_recording(&pose(right, up), &view, &view);
            let (u, v) = project(&world, x, y);
            let (u2, v2) = project(&aimed, 0.0, 0.0);
            prop_assert!((u - u2).abs() < 1e-6 && (v - v2).abs() < 1e-6);
        }

        #[test]
        fn every_allowed_view_is_inside_the_recording(
            share in 0.2f64..0.8, recording_fov in 30.0f64..90.0, zoom in 1.0f64..18.0,
            pan_part in -1.0f64..=1.0, tilt_part in -1.0f64..=1.0,
            aspects in prop::sample::select(vec![(640u32, 480u32, 768u32, 576u32), (640, 360, 1920, 1080), (640, 480, 1280, 720), (640, 360, 320, 240)]),
        ) {
            let (width, height, recording_width, recording_height) = aspects;
            let wide = 2.0 * (share * (recording_fov / 2.0).to_radians().tan()).atan();
            let narrow = 2.0 * ((wide / 2.0).tan() / zoom).atan();
            let ratio = |w: u32, h: u32| f64::from(h) / f64::from(w);
            prop_assume!(share * ratio(width, height) <= ratio(recording_width, recording_height));
            let limits = limits_inside(wide.to_degrees(), ratio(width, height), recording_fov, ratio(recording_width, recording_height));
            prop_assert!(limits.pan_deg.1 >= 0.0 && limits.tilt_deg.1 >= 0.0);
            let view = Pinhole::new(width, height, narrow.to_degrees());
            let recording = Pinhole::new(recording_width, recording_height, recording_fov);
            let looking = pose(pan_part * limits.pan_deg.1, tilt_part * limits.tilt_deg.1);
            let homography = view_to_recording(&looking, &view, &recording);
            let (right, bottom) = (f64::from(width) - 0.5, f64::from(height) - 0.5);
            for (x, y) in [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)] {
                let (u, v) = project(&homography, x, y);
                prop_assert!(u >= -0.5 && u <= f64::from(recording_width) - 0.5, "x {u}");
                prop_assert!(v >= -0.5 && v <= f64::from(recording_height) - 0.5, "y {v}");
            }
        }
    }

    #[test]
    fn the_limits_leave_no_room_unused() {
        let limits = limits_inside(29.1, 0.75, 60.0, 0.75);
        assert!(limits.pan_deg.1 > 14.0 && limits.tilt_deg.1 > 9.0, "{limits:?}");
        let recording = Pinhole::new(768, 576, 60.0);
        let view = Pinhole::new(640, 480, 29.1);
        let corner = view_to_recording(&pose(limits.pan_deg.1, limits.tilt_deg.1), &view, &recording);
        let (x, y) = project(&corner, 639.5, -0.5);
        assert!(x > 764.0 && y < 3.0, "{x}, {y}");
    }
}
