// SPDX-License-Identifier: MPL-2.0

//! What a lens and a sensor that is read row by row do to the picture of a pinhole.

use crate::{
    geometry::{self, Matrix, Pinhole},
    kinematics::Pose,
    picture::{Picture, Plane},
    truth::{Bounds, Mask, Sighting, Silhouette},
    world::warp,
};

/// Where each pixel of a picture is in that of a pinhole at the moment at which its first row is exposed.
///
/// Distortion after Brown (1966), radial and of the third order: what is seen so far from the middle is farther from it in the
/// pinhole's picture, up to the corners, which stay where they are, so that no pixel shows what the pinhole does not.
pub(crate) struct Lens {
    pinhole: Pinhole,
    size: (u32, u32),
    /// Of the square of the distance from the middle, in focal lengths.
    distortion: f64,
    /// By row: from where the camera looks then to where it looked at first.
    rows: Vec<Matrix>,
}

impl Lens {
    /// For a view of `size` through `pinhole`. `distortion` is the part by which what is one focal length from the middle is
    /// drawn in; `seen` says where the camera looks when a part of the rows, 0 to 1, is read.
    pub fn new(pinhole: Pinhole, size: (u32, u32), distortion: f64, seen: impl Fn(f64) -> Pose) -> Self {
        let first = seen(0.0);
        let row = |row: u32| {
            let now = seen(f64::from(row) / f64::from(size.1));
            geometry::between((&now, &pinhole), (&first, &pinhole))
        };
        Self { pinhole, size, distortion, rows: (0..size.1).map(row).collect() }
    }

    /// Where a pixel is in the pinhole's picture.
    fn source(&self, x: f64, y: f64) -> (f64, f64) {
        let Pinhole { focal, centre_x, centre_y } = self.pinhole;
        let squared = |x: f64, y: f64| (x * x + y * y) / (focal * focal);
        let (right, down) = (x - centre_x, y - centre_y);
        let scale = (1.0 + self.distortion * squared(right, down))
            / (1.0 + self.distortion * squared(centre_x + 0.5, centre_y + 0.5));
        let row = (y.max(0.0) as usize).min(self.rows.len() - 1);
        geometry::project(&self.rows[row], centre_x + right * scale, centre_y + down * scale)
    }

    /// The pixel that shows what is somewhere in the pinhole's picture.
    fn target(&self, x: f64, y: f64) -> (f64, f64) {
        let nearer = |at: (f64, f64), _| {
            let (found_x, found_y) = self.source(at.0, at.1);
            (at.0 + x - found_x, at.1 + y - found_y)
        };
        (0..8).fold((x, y), nearer)
    }

    /// The picture through the lens, of that of a pinhole.
    pub fn look(&self, picture: &Picture) -> Picture {
        let mut seen = Picture::grey(self.size.0, self.size.1, 0);
        let [luma, chroma @ ..] = &mut seen.planes;
        warp(&picture.planes[0], luma, |x, y| self.source(x, y));
        for (plane, source) in chroma.iter_mut().zip(&picture.planes[1..]) {
            // Chroma pixels lie between four of luma.
            warp(source, plane, |x, y| {
                let (x, y) = self.source(2.0 * x + 0.5, 2.0 * y + 0.5);
                ((x - 0.5) / 2.0, (y - 0.5) / 2.0)
            });
        }
        seen
    }

    /// A mask of the whole view through the lens.
    pub fn mask(&self, mask: &Mask) -> Mask {
        let plane = Plane { width: mask.width, height: mask.height, data: mask.data.clone() };
        let mut seen = Plane::filled(mask.width, mask.height, 0);
        warp(&plane, &mut seen, |x, y| self.source(x, y));
        seen.data.iter_mut().for_each(|pixel| *pixel = if *pixel > 127 { 255 } else { 0 });
        Mask { width: seen.width, height: seen.height, data: seen.data }
    }

    /// Somebody as they are seen through the lens, `person` being as a pinhole sees them.
    pub fn sighting(&self, person: Sighting) -> Sighting {
        // Edges of pixels are at whole numbers in the truth, centres are here.
        let moved = |(x, y): (f64, f64)| {
            let (x, y) = self.target(x - 0.5, y - 0.5);
            (x + 0.5, y + 0.5)
        };
        let back = |(x, y): (f64, f64)| {
            let (x, y) = self.source(x - 0.5, y - 0.5);
            (x + 0.5, y + 0.5)
        };
        let Sighting { mut truth, silhouette, kind, hidden_by } = person;
        let Some(bounds) = Bounds::around(silhouette.extremes(&truth.bounds).map(moved)) else {
            return Sighting { truth, silhouette, kind, hidden_by };
        };
        let mut silhouette: Silhouette = silhouette.redrawn(&bounds, back);
        silhouette.cut_to(self.size);
        let whole =
            Bounds { left: 0.0, top: 0.0, width: f64::from(self.size.0), height: f64::from(self.size.1) };
        truth.in_view = silhouette.part_in(&whole);
        truth.visible = silhouette.part_visible().min(truth.unhidden);
        truth.centroid = moved(truth.centroid);
        truth.bounds = bounds;
        Sighting { truth, silhouette, kind, hidden_by }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: (u32, u32) = (160, 120);

    fn lens(distortion: f64, turning_deg: f64) -> Lens {
        let pinhole = Pinhole::new(SIZE.0, SIZE.1, 55.0);
        Lens::new(pinhole, SIZE, distortion, |share| Pose { pan_deg: turning_deg * share, ..Pose::default() })
    }

    fn stripes() -> Picture {
        let mut picture = Picture::grey(SIZE.0, SIZE.1, 50);
        let luma = &mut picture.planes[0];
        (0..luma.data.len()).filter(|index| index % 160 == 80).for_each(|index| luma.data[index] = 250);
        picture
    }

    #[test]
    fn a_camera_at_rest_with_a_perfect_lens_sees_as_a_pinhole_does() {
        let (seen, there) = (lens(0.0, 0.0).look(&stripes()), stripes());
        let pairs =
            seen.planes.iter().zip(&there.planes).flat_map(|(seen, there)| seen.data.iter().zip(&there.data));
        assert!(pairs.into_iter().all(|(seen, there)| seen.abs_diff(*there) <= 1));
    }

    #[test]
    fn a_turning_camera_sees_upright_lines_aslant() {
        let seen = lens(0.0, 1.0).look(&stripes());
        let brightest = |row: usize| {
            let line = &seen.planes[0].data[row * 160..][..160];
            (0..160).max_by_key(|column| line[*column]).unwrap_or_default()
        };
        // It turns to the right by a degree: what it sees goes to the left by nearly three pixels.
        assert_eq!(brightest(0), 80);
        assert!((77..=78).contains(&brightest(119)), "{}", brightest(119));
    }

    #[test]
    fn distortion_keeps_the_corners_and_makes_the_middle_larger() {
        let lens = lens(0.1, 0.0);
        let (x, y) = lens.source(-0.5, -0.5);
        assert!((x + 0.5).hypot(y + 0.5) < 1e-9);
        let (x, _) = lens.source(119.5, 59.5);
        assert!((117.5..119.4).contains(&x), "{x}");
    }

    #[test]
    fn the_truth_is_where_the_picture_is() {
        let lens = lens(0.12, 0.8);
        let mut picture = Picture::grey(SIZE.0, SIZE.1, 50);
        let bounds = Bounds { left: 110.0, top: 70.0, width: 20.0, height: 30.0 };
        for (row, column) in (70..100).flat_map(|row| (110..130).map(move |column| (row, column))) {
            picture.planes[0].data[row * 160 + column] = 250;
        }
        let truth = crate::truth::GroundTruth {
            id: 1,
            bounds,
            centroid: bounds.centre(),
            visible: 1.0,
            unhidden: 1.0,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        };
        let person = lens.sighting(Sighting::of_box(truth, SIZE));
        let seen = lens.look(&picture);
        let lit = (0..160 * 120).filter(|index| seen.planes[0].data[*index] > 150);
        let places = lit.map(|index| ((index % 160) as f64, (index / 160) as f64));
        let found = Bounds::around(places.flat_map(|(x, y)| [(x, y), (x + 1.0, y + 1.0)])).unwrap();
        let Bounds { left, top, width, height } = person.truth.bounds;
        assert!((left - found.left).abs() < 1.6 && (top - found.top).abs() < 1.6, "{person:?} {found:?}");
        assert!(
            (width - found.width).abs() < 2.5 && (height - found.height).abs() < 2.5,
            "{person:?} {found:?}"
        );
        assert!(person.truth.in_view > 0.99 && person.truth.visible > 0.99);
        assert!(person.silhouette.contains(found.centre()));
    }

    proptest! {
        #[test]
        fn there_and_back_is_the_same_place(x in 0.0f64..160.0, y in 0.0f64..119.0, distortion in 0.0f64..0.2) {
            let lens = lens(distortion, 0.7);
            let (u, v) = lens.source(x, y);
            let (back_x, back_y) = lens.target(u, v);
            prop_assert!((back_x - x).hypot(back_y - y) < 0.05, "{back_x} {back_y}");
        }
    }
}
