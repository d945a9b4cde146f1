// SPDX-License-Identifier: MPL-2.0

//! What is really to be seen in a picture, for those who judge what was found in it.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// A box in pixels of the view: the edges of its pixels are at whole numbers, 0 to the width. It may lie outside.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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

    /// Whether a part of it lies in another one.
    pub fn overlaps(&self, other: &Self) -> bool {
        let common = |start: f64, length: f64, other: f64, other_length: f64| {
            start < other + other_length && other < start + length
        };
        common(self.left, self.width, other.left, other.width)
            && common(self.top, self.height, other.top, other.height)
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// Which pixels of a picture show somebody. It is kept as lengths of runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "Runs", try_from = "Runs")]
pub struct Mask {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row after row, 255 where somebody is seen, 0 elsewhere.
    pub data: Vec<u8>,
}

/// A mask as how many pixels are 0, then 255, then 0 and so on, row after row.
#[derive(Serialize, Deserialize)]
struct Runs {
    width: usize,
    height: usize,
    lengths: Vec<u32>,
}

impl From<Mask> for Runs {
    fn from(Mask { width, height, data }: Mask) -> Self {
        let (mut lengths, mut value) = (vec![0], 0);
        for pixel in data {
            if pixel != value {
                lengths.push(0);
                value = pixel;
            }
            if let Some(length) = lengths.last_mut() {
                *length += 1;
            }
        }
        Self { width, height, lengths }
    }
}

impl TryFrom<Runs> for Mask {
    type Error = String;

    fn try_from(Runs { width, height, lengths }: Runs) -> Result<Self, String> {
        let pixels: u64 = lengths.iter().copied().map(u64::from).sum();
        if width.checked_mul(height).map(|count| count as u64) != Some(pixels) {
            return Err(format!("{pixels} pixels in a mask of {width} x {height}"));
        }
        let runs = lengths.iter().zip([0, 255].into_iter().cycle());
        let data = runs.flat_map(|(length, value)| std::iter::repeat_n(value, *length as usize));
        Ok(Self { width, height, data: data.collect() })
    }
}

/// The whole shape of one person in a picture of the view, hidden parts and parts outside of the view included, and how
/// much of it is seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Silhouette {
    /// Left edge of the masks' first column and top edge of their first row, in pixels of the view.
    origin: (f64, f64),
    /// Width and height of a pixel of the masks, in pixels of the view.
    pixel: (f64, f64),
    /// The whole body.
    whole: Mask,
    /// What of it is inside the view and hidden by nothing.
    visible: Mask,
}

/// A box whose silhouette is not known is cut into so many pixels across and down.
const BOX_PIXELS: usize = 32;

impl Silhouette {
    /// Two masks of the same size, whose first pixel's corner is at `origin` in the view and each of whose pixels is as
    /// large as `pixel`.
    pub(crate) fn new(origin: (f64, f64), pixel: (f64, f64), whole: Mask, visible: Mask) -> Self {
        Self { origin, pixel, whole, visible }
    }

    /// Of somebody of whom only the box is known, in a picture of `size`; nothing hides them.
    pub fn of_box(bounds: &Bounds, size: (u32, u32)) -> Self {
        let side = BOX_PIXELS as f64;
        let filled = Mask { width: BOX_PIXELS, height: BOX_PIXELS, data: vec![255; BOX_PIXELS * BOX_PIXELS] };
        let (origin, pixel) = ((bounds.left, bounds.top), (bounds.width / side, bounds.height / side));
        let mut silhouette = Self { origin, pixel, visible: filled.clone(), whole: filled };
        silhouette.cut_to(size);
        silhouette
    }

    /// Leaves nothing visible outside of a picture of that size.
    pub(crate) fn cut_to(&mut self, size: (u32, u32)) {
        let view = Bounds { left: 0.0, top: 0.0, width: f64::from(size.0), height: f64::from(size.1) };
        let ((columns, rows), width) = (self.inside(&view), self.visible.width.max(1));
        for (row, line) in self.visible.data.chunks_exact_mut(width).enumerate() {
            let seen = if rows.contains(&row) { columns.clone() } else { 0..0 };
            line[..seen.start].fill(0);
            line[seen.end..].fill(0);
        }
    }

    /// Whether a place of the view, in pixels, lies on the person, hidden there or not.
    pub fn contains(&self, place: (f64, f64)) -> bool {
        self.at(&self.whole, place)
    }

    fn at(&self, mask: &Mask, (x, y): (f64, f64)) -> bool {
        let column = ((x - self.origin.0) / self.pixel.0).floor();
        let row = ((y - self.origin.1) / self.pixel.1).floor();
        let inside = |index: f64, count: usize| (0.0..count as f64).contains(&index);
        inside(column, mask.width)
            && inside(row, mask.height)
            && mask.data[row as usize * mask.width + column as usize] > 127
    }

    /// Whether something of the person is seen at a place of the view, in pixels.
    pub fn shows(&self, place: (f64, f64)) -> bool {
        self.at(&self.visible, place)
    }

    /// The outline of the whole body, a closed polygon in pixels of the view; nothing of nobody. Gaps between limbs are filled.
    pub fn outline_of_whole(&self) -> Vec<(f64, f64)> {
        self.outline(&self.whole)
    }

    /// The same of what is seen.
    pub fn outline_of_visible(&self) -> Vec<(f64, f64)> {
        self.outline(&self.visible)
    }

    /// Down the left ends of the rows, and up the right ones.
    fn outline(&self, mask: &Mask) -> Vec<(f64, f64)> {
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for (row, line) in mask.data.chunks_exact(mask.width.max(1)).enumerate() {
            let is_set = |value: &u8| *value > 127;
            let Some((first, last)) = line.iter().position(is_set).zip(line.iter().rposition(is_set)) else {
                continue;
            };
            let place = |column: usize, row: usize| {
                (self.origin.0 + self.pixel.0 * column as f64, self.origin.1 + self.pixel.1 * row as f64)
            };
            left.extend([place(first, row), place(first, row + 1)]);
            right.extend([place(last + 1, row), place(last + 1, row + 1)]);
        }
        left.extend(right.into_iter().rev());
        left
    }

    /// What part of the whole silhouette, 0 to 1, lies in a box of the view.
    pub fn part_in(&self, bounds: &Bounds) -> f64 {
        let (columns, rows) = self.inside(bounds);
        let weight = |line: &[u8]| line.iter().map(|value| u64::from(*value)).sum::<u64>();
        let whole = weight(&self.whole.data);
        let lines = self.whole.data.chunks_exact(self.whole.width.max(1));
        let part: u64 =
            lines.skip(rows.start).take(rows.len()).map(|line| weight(&line[columns.clone()])).sum();
        if whole > 0 { part as f64 / whole as f64 } else { 0.0 }
    }

    /// What part of the whole silhouette, 0 to 1, is visible.
    pub(crate) fn part_visible(&self) -> f64 {
        let weight = |mask: &Mask| mask.data.iter().map(|value| u64::from(*value)).sum::<u64>();
        let whole = weight(&self.whole);
        if whole > 0 { weight(&self.visible) as f64 / whole as f64 } else { 0.0 }
    }

    /// Where the whole silhouette touches its box: left, top, right and bottom.
    pub(crate) fn extremes(&self, bounds: &Bounds) -> [(f64, f64); 4] {
        let width = self.whole.width.max(1);
        let set = || (0..self.whole.data.len()).filter(|index| self.whole.data[*index] > 127);
        let place = |index: usize| {
            let (column, row) = ((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
            (self.origin.0 + column * self.pixel.0, self.origin.1 + row * self.pixel.1)
        };
        let or_middle = |index: Option<usize>| index.map_or_else(|| bounds.centre(), place);
        let (left, right) = (
            or_middle(set().min_by_key(|index| index % width)),
            or_middle(set().max_by_key(|index| index % width)),
        );
        let (top, bottom) = (or_middle(set().next()), or_middle(set().next_back()));
        [
            (bounds.left, left.1),
            (top.0, bounds.top),
            (bounds.left + bounds.width, right.1),
            (bottom.0, bounds.top + bounds.height),
        ]
    }

    /// The same in another picture, where it has another box; `back` takes places of that picture to places of this.
    pub(crate) fn redrawn(&self, bounds: &Bounds, back: impl Fn((f64, f64)) -> (f64, f64)) -> Self {
        let (wide, high) = self.pixel;
        let origin = (bounds.left - 2.0 * wide, bounds.top - 2.0 * high);
        let count = |length: f64, pixel: f64| (length / pixel).ceil() as usize + 4;
        let (width, height) = (count(bounds.width, wide), count(bounds.height, high));
        let mut masks = [(); 2].map(|()| Mask { width, height, data: vec![0; width * height] });
        for index in 0..width * height {
            let (column, row) = ((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
            let (x, y) = back((origin.0 + column * wide, origin.1 + row * high));
            let (column, row) = (((x - self.origin.0) / wide).floor(), ((y - self.origin.1) / high).floor());
            let inside = |place: f64, count: usize| (0.0..count as f64).contains(&place);
            if inside(column, self.whole.width) && inside(row, self.whole.height) {
                let from = row as usize * self.whole.width + column as usize;
                masks[0].data[index] = self.whole.data[from];
                masks[1].data[index] = self.visible.data[from];
            }
        }
        let [whole, visible] = masks;
        Self { origin, pixel: self.pixel, whole, visible }
    }

    /// The whole body.
    pub fn whole(&self) -> &Mask {
        &self.whole
    }

    /// What of it is inside the view and hidden by nothing: as large as [`Self::whole`], and in the same place.
    pub fn visible(&self) -> &Mask {
        &self.visible
    }

    /// Columns and rows whose middles lie in a box of the view.
    fn inside(&self, bounds: &Bounds) -> (Range<usize>, Range<usize>) {
        let range = |start: f64, length: f64, origin: f64, pixel: f64, count: usize| {
            let index = |edge: f64| ((edge - origin) / pixel - 0.5).ceil().clamp(0.0, count as f64) as usize;
            index(start)..index(start + length).max(index(start))
        };
        let Mask { width, height, .. } = self.whole;
        (
            range(bounds.left, bounds.width, self.origin.0, self.pixel.0, width),
            range(bounds.top, bounds.height, self.origin.1, self.pixel.1, height),
        )
    }
}

/// What somebody or something that moves is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Kind {
    /// On two legs.
    #[default]
    Person,
    /// On wheels.
    Vehicle,
}

/// One person, or vehicle, in a picture: where, and in what shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sighting {
    /// Who and where.
    pub truth: GroundTruth,
    /// In what shape; the box where no more is known.
    pub silhouette: Silhouette,
    /// What it is.
    pub kind: Kind,
    /// Numbers of those who hide a part of them, in ascending order; things that hide them have none.
    pub hidden_by: Vec<u32>,
}

impl Sighting {
    /// A person of whom only the box is known, in a picture of `size`; nobody hides them.
    pub fn of_box(truth: GroundTruth, size: (u32, u32)) -> Self {
        let silhouette = Silhouette::of_box(&truth.bounds, size);
        Self { truth, silhouette, kind: Kind::Person, hidden_by: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silhouette_says_what_lies_on_it_and_what_part_a_box_holds() {
        // An L: the left half, and the lower right quarter; each pixel of the mask is 2 x 4 of the view.
        let whole = Mask { width: 4, height: 2, data: vec![255, 255, 0, 0, 255, 255, 255, 255] };
        let mut shape = Silhouette::new((10.0, 20.0), (2.0, 4.0), whole.clone(), whole);
        assert!(shape.contains((10.0, 20.0)) && shape.contains((17.9, 27.9)));
        assert!(
            !shape.contains((14.0, 23.9)) && !shape.contains((9.9, 20.0)) && !shape.contains((12.0, 28.0))
        );
        let bounds = |left, top, width, height| Bounds { left, top, width, height };
        assert_eq!(shape.part_in(&bounds(0.0, 0.0, 100.0, 100.0)), 1.0);
        assert_eq!(shape.part_in(&bounds(10.0, 20.0, 4.0, 4.0)), 2.0 / 6.0);
        assert_eq!(shape.part_in(&bounds(14.0, 20.0, 4.0, 4.0)), 0.0);
        assert_eq!(shape.part_in(&bounds(14.0, 20.0, -4.0, 4.0)), 0.0);
        shape.cut_to((14, 24));
        assert_eq!(shape.visible().data, [255, 255, 0, 0, 0, 0, 0, 0]);
        assert_eq!(shape.part_in(&bounds(0.0, 0.0, 100.0, 100.0)), 1.0);
        let half_out = Silhouette::of_box(&bounds(-16.0, 0.0, 32.0, 64.0), (640, 480));
        assert_eq!(half_out.visible().data.iter().filter(|value| **value > 0).count(), 32 * 32 / 2);
        assert!(half_out.contains((-15.0, 63.0)));
        let nothing = Silhouette::of_box(&bounds(5.0, 5.0, 0.0, 0.0), (640, 480));
        assert!(!nothing.contains((6.0, 6.0)));
    }

    #[test]
    fn an_outline_goes_round_what_is_seen() {
        let shape =
            Silhouette::of_box(&Bounds { left: -16.0, top: 8.0, width: 32.0, height: 64.0 }, (640, 480));
        let around = |outline: Vec<(f64, f64)>| Bounds::around(outline).unwrap();
        assert_eq!(
            around(shape.outline_of_whole()),
            Bounds { left: -16.0, top: 8.0, width: 32.0, height: 64.0 }
        );
        assert_eq!(
            around(shape.outline_of_visible()),
            Bounds { left: 0.0, top: 8.0, width: 16.0, height: 64.0 }
        );
        assert!(shape.shows((1.0, 9.0)) && !shape.shows((-1.0, 9.0)) && !shape.shows((1.0, 7.0)));
    }

    #[test]
    fn a_mask_is_kept_as_runs_and_a_broken_one_is_refused() {
        for data in [vec![0, 0, 255, 255, 0, 255], vec![255; 6], vec![0; 6]] {
            let mask = Mask { width: 3, height: 2, data };
            let kept = serde_json::to_string(&mask).unwrap();
            assert_eq!(serde_json::from_str::<Mask>(&kept).unwrap(), mask, "{kept}");
        }
        let broken = r#"{"width":3,"height":2,"lengths":[1,2]}"#;
        assert!(serde_json::from_str::<Mask>(broken).is_err());
    }

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
