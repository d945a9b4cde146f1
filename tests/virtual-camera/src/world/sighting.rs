// SPDX-License-Identifier: MPL-2.0

//! The truth about somebody: measured on a picture of their shape alone.

use super::room::view::{Vector, View};
use crate::{
    geometry::{Pinhole, aim},
    kinematics::Pose,
    picture::Plane,
    truth::{Bounds, GroundTruth, Kind, Mask, Sighting, Silhouette},
};

/// A body is measured in no more pixels than this across and down: one seen larger is measured as if it were smaller.
const MEASURED: f64 = 400.0;

/// Somebody whose feet are at `place` and whose body takes `bounds` in a view along a pose, inside of it or not, that is
/// `size` large. `shapes` gives, for a view of any part of the image plane, what shows of all of the body and of what
/// nothing hides.
pub(super) fn sight(
    id: u32,
    place: Vector,
    bounds: Bounds,
    (pose, view): (&Pose, &View),
    size: (u32, u32),
    shapes: impl FnOnce(&View) -> [Plane; 2],
) -> Sighting {
    let Bounds { left, top, width, height } = bounds;
    // A picture of the body alone, with a pixel around it.
    let scale = (MEASURED / width.max(height)).min(1.0);
    let pinhole = Pinhole {
        focal: view.pinhole.focal * scale,
        centre_x: (view.pinhole.centre_x + 0.5 - left) * scale + 0.5,
        centre_y: (view.pinhole.centre_y + 0.5 - top) * scale + 0.5,
    };
    let length = |length: f64| (length * scale).ceil() as usize + 2;
    let [whole, unhidden] = shapes(&view.through(pinhole, (length(width), length(height))));
    let at = |column: f64, row: f64| ((column - 0.5) / scale + left, (row - 0.5) / scale + top);
    let all = Weight::of(&whole, |_, _| true);
    let inside = |column: usize, row: usize| {
        let (x, y) = at(column as f64, row as f64);
        (0.0..f64::from(size.0)).contains(&x) && (0.0..f64::from(size.1)).contains(&y)
    };
    let share = |weight: Weight| if all.sum > 0.0 { weight.sum / all.sum } else { 0.0 };
    let centroid =
        if all.sum > 0.0 { at(all.columns / all.sum, all.rows / all.sum) } else { bounds.centre() };
    let ray = |place: f64, centre: f64| (place - 0.5 - centre) / view.pinhole.focal;
    let (x, y) = (ray(centroid.0, view.pinhole.centre_x), ray(centroid.1, view.pinhole.centre_y));
    let truth = GroundTruth {
        id,
        bounds,
        centroid,
        visible: share(Weight::of(&unhidden, inside)),
        unhidden: share(Weight::of(&unhidden, |_, _| true)),
        in_view: share(Weight::of(&whole, inside)),
        position_m: Some(place),
        direction_deg: Some(aim(pose, x, y)),
    };
    let pixel = 1.0 / scale;
    let [whole, visible] = [whole, unhidden].map(mask);
    let mut silhouette = Silhouette::new((left - pixel, top - pixel), (pixel, pixel), whole, visible);
    silhouette.cut_to(size);
    Sighting { truth, silhouette, kind: Kind::Person, hidden_by: Vec::new() }
}

/// Which pixels are more than half covered.
pub(super) fn mask(Plane { width, height, mut data }: Plane) -> Mask {
    for pixel in &mut data {
        *pixel = if *pixel > 127 { 255 } else { 0 };
    }
    Mask { width, height, data }
}

/// How much of a mask is set, and where.
struct Weight {
    sum: f64,
    columns: f64,
    rows: f64,
}

impl Weight {
    /// Of the pixels (column, row) that are to be counted.
    fn of(mask: &Plane, counted: impl Fn(usize, usize) -> bool) -> Self {
        let mut weight = Self { sum: 0.0, columns: 0.0, rows: 0.0 };
        for (row, line) in mask.data.chunks_exact(mask.width.max(1)).enumerate() {
            for (column, &value) in line.iter().enumerate() {
                if value > 0 && counted(column, row) {
                    let value = f64::from(value);
                    weight.sum += value;
                    weight.columns += value * column as f64;
                    weight.rows += value * row as f64;
                }
            }
        }
        weight
    }
}
