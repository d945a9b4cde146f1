// SPDX-License-Identifier: MPL-2.0

//! Floors that shine: below the feet of whoever stands on one is their reflection, upside down and faint.
//!
//! Such a floor adds `s (P - E)` to what is known of it: of the light from above the feet, `P`, it reflects the part `s`, and so it did of
//! what was there before, `E`. That is the background which somebody hides now; or, where the floor scatters it, light as even as the
//! floor's own. Whichever fits better counts.

use std::ops::Range;

use multiversion::multiversion;

use super::scene_model::SceneView;
use super::segmentation::WEAK;

/// Only of what is so many pixels high, and so many times as high as broad, a reflection is looked for.
const LEAST_HEIGHT: usize = 24;
const TALL: f32 = 1.5;
/// Where the feet may be, in heights of the region: with all of a reflection, which is hardly longer than who it is of, and a little below a region
/// without; and how much of the reflection is in the picture.
const HIGHEST: f32 = 0.4;
const LOWEST: f32 = 1.15;
const VISIBLE: f32 = 0.3;
/// This part of somebody, from the feet up, is not compared: legs that are lighter from the knees down, and the shadow on the floor around them,
/// are reflections of each other too.
const FEET: f32 = 0.25;
/// The part of the light that a floor reflects, at least and at most. Legs below a trunk differ as much as it does.
const REFLECTED: Range<f32> = 0.1..0.45;
/// How alike (cosine of the angle between them) somebody and a reflection are: such that a floor shines, and once it is known to.
const ALIKE: f32 = 0.6;
const ALIKE_WHERE_IT_SHINES: f32 = 0.5;
/// Share of the regions looked at, over so many of them, that have a reflection where a floor shines. Elsewhere it is one in fifteen.
const SHINES: f32 = 0.3;
const REGIONS: f32 = 30.0;
/// Regions of a picture that are looked at where it is not known to: in a crowd the time that this takes is bounded.
const AT_ONCE: usize = 2;

/// What there is of a region in a mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Extent {
    pub rows: Range<usize>,
    pub columns: Range<usize>,
}

/// By this part of its breadth a reflection may be broader than who it is of, and longer.
const MARGIN: f32 = 0.25;

impl Extent {
    /// Whether all of another one, or nearly all, lies in it.
    pub fn holds(&self, other: &Self) -> bool {
        let margin = (MARGIN * self.columns.len() as f32) as usize;
        other.rows.start >= self.rows.start
            && other.rows.end <= self.rows.end + margin
            && other.columns.start + margin >= self.columns.start
            && other.columns.end <= self.columns.end + margin
    }
}

/// Finds reflections, and learns whether the floor shines. Keeps its memory for the next region.
#[derive(Debug, Default)]
pub(super) struct Reflections {
    /// Share of the last regions that have a reflection.
    share: f32,
    /// Of how many regions of this picture one may be looked for so far, and the numbers of those whose turn it is.
    count: usize,
    turn: Range<usize>,
    halved: Halved,
}

/// A part of a picture, reduced by two: rows one after the other.
#[derive(Debug, Default)]
struct Halved {
    columns: usize,
    rows: usize,
    picture: Vec<i16>,
    background: Vec<i16>,
    /// All bits where it may be foreground, none elsewhere.
    foreground: Vec<i16>,
}

/// How what is below a row is like what is above it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Fit {
    alike: f32,
    reflected: f32,
}

impl Reflections {
    /// Goes on to the next picture. Until the floor is known to shine, [`AT_ONCE`] regions of each are looked at, one after the other.
    pub fn next_picture(&mut self) {
        let first = if self.turn.end < self.count { self.turn.end } else { 0 };
        self.turn = first..first + AT_ONCE;
        self.count = 0;
    }

    /// The row at which the reflection of who is seen in `region` begins, where the floor shines and there is one.
    pub fn feet(&mut self, region: &Extent, scene: &SceneView) -> Option<usize> {
        let height = region.rows.len();
        if height < LEAST_HEIGHT || (height as f32) < TALL * region.columns.len() as f32 {
            return None;
        }
        let is_its_turn = self.turn.contains(&self.count);
        self.count += 1;
        if self.share <= SHINES && !is_its_turn {
            return None;
        }
        let end = (region.rows.end + height).min(scene.luma.height());
        self.halved.take(&Extent { rows: region.rows.start..end, ..region.clone() }, scene);
        let found = self.axis(height / 2);
        let is_clear = found.is_some_and(|(_, fit)| fit.alike > ALIKE);
        self.share += (f32::from(is_clear) - self.share) / REGIONS;
        let (axis, fit) = found?;
        (self.share > SHINES && fit.alike > ALIKE_WHERE_IT_SHINES).then_some(region.rows.start + 2 * axis)
    }

    /// The row, of a region of `height` rows, below which the picture is most like a reflection of what is above, and how much it is.
    fn axis(&self, height: usize) -> Option<(usize, Fit)> {
        let visible = (VISIBLE * height as f32) as usize;
        let [highest, lowest] = [HIGHEST, LOWEST].map(|share| (share * height as f32) as usize);
        let axes = highest..(lowest + 1).min(self.halved.rows.saturating_sub(visible));
        let fits = axes.clone().map(|axis| (axis, self.halved.fit(axis)));
        let (axis, fit) = fits.max_by(|a, b| a.1.alike.total_cmp(&b.1.alike))?;
        // At either end it may be more alike beyond.
        let is_inside = axis > axes.start && axis + 1 < axes.end;
        (is_inside && REFLECTED.contains(&fit.reflected)).then_some((axis, fit))
    }
}

impl Halved {
    fn take(&mut self, area: &Extent, scene: &SceneView) {
        (self.columns, self.rows) = (area.columns.len() / 2, area.rows.len() / 2);
        let Self { picture, background, foreground, .. } = self;
        for (plane, halved) in
            [(&scene.luma, picture), (&scene.background, background), (&scene.foreground, &mut *foreground)]
        {
            halved.clear();
            let row = |y: usize| &plane.row(y)[area.columns.clone()];
            for y in area.rows.clone().step_by(2).take(self.rows) {
                halve(row(y), row(y + 1), halved);
            }
        }
        for likelihood in foreground {
            *likelihood = if *likelihood >= WEAK as i16 { -1 } else { 0 };
        }
    }

    fn row(&self, y: usize) -> Row<'_> {
        let columns = y * self.columns..(y + 1) * self.columns;
        Row {
            picture: &self.picture[columns.clone()],
            background: &self.background[columns.clone()],
            foreground: &self.foreground[columns],
        }
    }

    /// How what is below a row is like what is above it, as far as that is in the picture.
    fn fit(&self, axis: usize) -> Fit {
        let mut sums = Sums::default();
        // Rows beside each other tell nearly the same.
        for below in (axis + (FEET * axis as f32) as usize..(2 * axis).min(self.rows)).step_by(2) {
            add(&mut sums, self.row(below), self.row(2 * axis - 1 - below));
        }
        let [hidden, even] = [sums.hidden, sums.even].map(|(product, square)| {
            let [product, square, seen] = [product, square, sums.seen].map(|sum| sum as f32);
            let least = f32::EPSILON;
            Fit { alike: product / (square * seen).sqrt().max(least), reflected: product / square.max(least) }
        });
        if even.alike > hidden.alike { even } else { hidden }
    }
}

/// A row of what is halved.
#[derive(Clone, Copy)]
struct Row<'a> {
    picture: &'a [i16],
    background: &'a [i16],
    foreground: &'a [i16],
}

/// Of what is seen below the feet its squares; of what that is to be like, the products with it and the squares.
#[derive(Debug, Default)]
struct Sums {
    seen: i64,
    hidden: (i64, i64),
    even: (i64, i64),
}

/// Adds one row below the feet, and that which it may reflect.
#[multiversion(targets("x86_64+avx2"))]
fn add(sums: &mut Sums, below: Row, above: Row) {
    // All of one length, which the compiler needs to know for vector code. A row of them does not overflow.
    let count = below.picture.len();
    let [seen, floor, body, wall, is_body] =
        [below.picture, below.background, above.picture, above.background, above.foreground]
            .map(|row| &row[..count]);
    let mut of_row = [0_i32; 5];
    for x in 0..count {
        let [seen, hidden, even] =
            [seen[x] - floor[x], body[x] - wall[x], (body[x] - floor[x]) & is_body[x]].map(i32::from);
        let products = [seen * seen, hidden * seen, hidden * hidden, even * seen, even * even];
        of_row.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }
    let [seen, hidden, hidden_square, even, even_square] = of_row.map(i64::from);
    sums.seen += seen;
    sums.hidden = (sums.hidden.0 + hidden, sums.hidden.1 + hidden_square);
    sums.even = (sums.even.0 + even, sums.even.1 + even_square);
}

/// Adds the means of 2 x 2 pixels of two rows.
#[multiversion(targets("x86_64+avx2"))]
fn halve(upper: &[u8], lower: &[u8], out: &mut Vec<i16>) {
    let (upper, lower) = (upper.as_chunks::<2>().0, lower.as_chunks::<2>().0);
    let sum = |pair: &[u8; 2]| i16::from(pair[0]) + i16::from(pair[1]);
    out.extend(upper.iter().zip(lower).map(|(upper, lower)| (sum(upper) + sum(lower) + 2) / 4));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::Luma;

    const SIZE: (usize, usize) = (60, 120);
    /// Somebody of these columns and rows.
    const BODY: (Range<usize>, Range<usize>) = (20..36, 20..60);

    /// What somebody wears, by row: a head, a trunk with stripes, legs.
    fn worn(row: usize) -> u8 {
        match row - BODY.1.start {
            0..6 => 170,
            6..20 if row.is_multiple_of(6) => 60,
            6..20 => 200,
            _ => 40,
        }
    }

    fn wall(row: usize) -> u8 {
        if row < 50 { 120 } else { 100 }
    }

    /// Somebody on a floor that reflects so much of them, and of the wall behind where it `reflects_all`; for so many pictures. Where
    /// their feet are found in the last, and the share of them that have a reflection.
    fn feet(reflected: f32, reflects_all: bool, pictures: usize) -> (Option<usize>, f32) {
        let feet = BODY.1.end;
        let mut reflections = Reflections::default();
        let background: Vec<u8> = (0..SIZE.0 * SIZE.1).map(|at| wall(at / SIZE.0)).collect();
        let mut picture = background.clone();
        let mut foreground = vec![0; background.len()];
        for column in BODY.0 {
            for row in BODY.1 {
                picture[row * SIZE.0 + column] = worn(row);
                foreground[row * SIZE.0 + column] = 255;
                let below = 2 * feet - 1 - row;
                let known = f32::from(wall(below));
                let before = if reflects_all { f32::from(wall(row)) } else { known };
                let seen = known + reflected * (f32::from(worn(row)) - before);
                picture[below * SIZE.0 + column] = seen.round() as u8;
            }
        }
        let [luma, background, foreground] =
            [&picture, &background, &foreground].map(|plane| Luma::packed(plane, SIZE.0));
        let scene = SceneView {
            camera_motion: None,
            coasted_motion: None,
            luma,
            chroma: None,
            foreground,
            background,
        };
        let whole = Extent { rows: BODY.1.start..2 * feet - BODY.1.start, columns: BODY.0 };
        let look = |_| {
            reflections.next_picture();
            reflections.feet(&whole, &scene)
        };
        let found = (0..pictures).map(look).last().flatten();
        (found, reflections.share)
    }

    #[test]
    fn a_reflection_begins_at_the_feet_once_the_floor_is_known_to_shine() {
        for reflects_all in [true, false] {
            assert_eq!(feet(0.3, reflects_all, 1).0, None);
            let found = feet(0.3, reflects_all, 30).0;
            assert!(found.is_some_and(|row| row.abs_diff(BODY.1.end) <= 1), "{found:?}");
        }
    }

    #[test]
    fn what_is_no_fainter_and_what_is_not_there_is_no_reflection() {
        assert_eq!(feet(0.9, true, 100), (None, 0.0), "somebody else, upside down");
        assert_eq!(feet(0.0, true, 100), (None, 0.0), "nothing");
    }
}
