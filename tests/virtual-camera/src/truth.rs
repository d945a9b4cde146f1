//! What is really to be seen in a picture, for those who judge what was found in it.

use serde::Serialize;

/// A box in pixels of the view: the edges of its pixels are at whole numbers, 0 to the width. It may lie outside.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bounds {
    /// Left edge.
    pub left: f64,
    /// Top edge.
    pub top: f64,
    /// Pixels.
    pub width: f64,
    /// Pixels.
    pub height: f64,
}

impl Bounds {
    /// The smallest box around points; `None` of none.
    pub fn around(points: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let mut points = points.into_iter();
        let (x, y) = points.next()?;
        let edges = points.fold([x, y, x, y], |[left, top, right, bottom], (x, y)| {
            [left.min(x), top.min(y), right.max(x), bottom.max(y)]
        });
        let [left, top, right, bottom] = edges;
        Some(Self { left, top, width: right - left, height: bottom - top })
    }

    /// Its middle.
    pub fn centre(&self) -> (f64, f64) {
        (self.left + self.width / 2.0, self.top + self.height / 2.0)
    }

    /// Whether a place lies in it, its edges included.
    pub fn contains(&self, (x, y): (f64, f64)) -> bool {
        (self.left..=self.left + self.width).contains(&x) && (self.top..=self.top + self.height).contains(&y)
    }

    /// What part of it, 0 to 1, is inside a picture of that size.
    pub fn part_inside(&self, size: (u32, u32)) -> f64 {
        let part = |start: f64, length: f64, end: u32| {
            let inside = (start + length).min(f64::from(end)) - start.max(0.0);
            if length > 0.0 { (inside / length).clamp(0.0, 1.0) } else { 0.0 }
        };
        part(self.left, self.width, size.0) * part(self.top, self.height, size.1)
    }
}

/// One person as they are in a picture of the view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroundTruth {
    /// Number of the person.
    pub id: u32,
    /// Of the whole body, hidden parts included.
    pub bounds: Bounds,
    /// Of the whole body's silhouette, in pixels; of the box where no silhouette is known.
    pub centroid: (f64, f64),
    /// Part of the silhouette, 0 to 1, that is inside the view and hidden by nothing.
    pub visible: f64,
    /// Part hidden by nothing, wherever it is.
    pub unhidden: f64,
    /// Part inside the view, hidden or not.
    pub in_view: f64,
    /// Where the feet are, in metres: right of the camera, above the floor, ahead at pan 0.
    pub position_m: Option<[f64; 3]>,
    /// Pan and tilt in degrees that bring the centroid into the middle of the view.
    pub direction_deg: Option<(f64, f64)>,
}

/// Which pixels of a picture show somebody.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row after row, 255 where somebody is seen, 0 elsewhere.
    pub data: Vec<u8>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_know_their_middle_and_how_much_of_them_is_inside() {
        let bounds = Bounds::around([(-10.0, 5.0), (30.0, 25.0), (0.0, 20.0)]).unwrap();
        assert_eq!(bounds, Bounds { left: -10.0, top: 5.0, width: 40.0, height: 20.0 });
        assert_eq!(bounds.centre(), (10.0, 15.0));
        assert!(
            bounds.contains((30.0, 5.0)) && !bounds.contains((30.1, 5.0)) && !bounds.contains((0.0, 4.9))
        );
        assert_eq!(bounds.part_inside((100, 100)), 0.75);
        assert_eq!(bounds.part_inside((100, 15)), 0.375);
        assert_eq!(bounds.part_inside((20, 4)), 0.0);
        assert_eq!(Bounds { left: 200.0, ..bounds }.part_inside((100, 100)), 0.0);
        assert_eq!(Bounds { width: 0.0, ..bounds }.part_inside((100, 100)), 0.0);
        assert_eq!(Bounds::around([]), None);
    }
}
