// SPDX-License-Identifier: MPL-2.0

//! Floors that shine: below the feet of whoever stands on one is their reflection, upside down and faint.
//!
//! Such a floor adds `s (P - E)` to what is known of it: of the light from above the feet, `P`, it reflects the part `s`, and so it did of
//! what was there before, `E`. That is the background which somebody hides now; or, where the floor scatters it, light as even as the
//! floor's own. Whichever fits better counts.
//!
//! Trousers of the coat's kind and fainter than it are like a reflection of it from the hips down: whoever wears such may lose their legs for a while.
//! To ask that the head is reflected too tells them apart, and loses most reflections (P of the stratum *reflecting* 81 to 72 %).

use std::ops::Range;

use multiversion::multiversion;

use super::scene_model::SceneView;
use super::segmentation::WEAK;

/// Only of what is so many pixels high, and so many times as high as broad, a reflection is looked for.
const LEAST_HEIGHT: usize = 24;
const TALL: f32 = 1.5;
/// Where the feet may be, in heights of the region: near its middle where all of a reflection, which is hardly longer than who it is of, hangs
/// together with them, and a little below a region without any.
const HIGHEST: f32 = 0.4;
const LOWEST: f32 = 1.15;
/// So much of a reflection, in heights of the region, must be in the picture.
const VISIBLE: f32 = 0.3;
/// This part of somebody, from the feet up, is not compared: legs that are lighter from the knees down, and the shadow on the floor around them,
/// are reflections of each other too.
const FEET: f32 = 0.25;
/// The part of the light that a floor reflects, at least and at most.
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

impl Extent {
    /// The reflection of who stands in it with their feet in that row. It may be a little broader than they are, and longer.
    pub fn reflection(&self, feet: usize) -> Self {
        let margin = self.columns.len() / 4;
        let Range { start, end } = self.columns;
        Self {
            rows: feet..2 * feet - self.rows.start + margin,
            columns: start.saturating_sub(margin)..end + margin,
        }
    }

    /// Whether all of another one lies in it.
    pub fn holds(&self, other: &Self) -> bool {
        let is_within =
            |one: &Range<usize>, other: &Range<usize>| one.start <= other.start && other.end <= one.end;
        is_within(&self.rows, &other.rows) && is_within(&self.columns, &other.columns)
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

    /// Whether the floor is known to shine.
    pub fn shines(&self) -> bool {
        self.share > SHINES
    }

    /// The row at which the reflection of who is seen in `region` begins, where there seems to be one.
    pub fn feet(&mut self, region: &Extent, scene: &SceneView) -> Option<usize> {
        let height = region.rows.len();
        if height < LEAST_HEIGHT || (height as f32) < TALL * region.columns.len() as f32 {
            return None;
        }
        let is_its_turn = self.turn.contains(&self.count);
        self.count += 1;
        if !self.shines() && !is_its_turn {
            return None;
        }
        let end = (region.rows.end + height).min(scene.luma.height());
        self.halved.take(&Extent { rows: region.rows.start..end, ..region.clone() }, scene);
        let found = self.halved.axis(height / 2);
        let is_clear = found.is_some_and(|(_, fit)| fit.alike > ALIKE);
        self.share += (f32::from(is_clear) - self.share) / REGIONS;
        let (axis, fit) = found?;
        (fit.alike > ALIKE_WHERE_IT_SHINES).then_some(region.rows.start + 2 * axis)
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

    /// The row, of a region of `height` rows, below which the picture is most like a reflection of what is above, and how alike they are; all
    /// rows are of what is halved.
    fn axis(&self, height: usize) -> Option<(usize, Fit)> {
        let [highest, lowest, visible] =
            [HIGHEST, LOWEST, VISIBLE].map(|share| (share * height as f32) as usize);
        let axes = highest..(lowest + 1).min(self.rows.saturating_sub(visible));
        let fits = axes.clone().map(|axis| (axis, self.fit(axis)));
        let (axis, fit) = fits.max_by(|a, b| a.1.alike.total_cmp(&b.1.alike))?;
        // At either end it may be more alike beyond.
        let is_inside = axis > axes.start && axis + 1 < axes.end;
        let is_one = is_inside && REFLECTED.contains(&fit.reflected);
        is_one.then_some((axis, fit))
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
    // All of one length, which the compiler needs to know for vector code. Sums of up to 33,000 do not overflow.
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
    use proptest::prelude::*;

    const SIZE: (usize, usize) = (60, 120);
    /// Where somebody stands: the columns of their trunk, and rows.
    const BODY: (Range<usize>, Range<usize>) = (20..36, 20..60);

    /// What somebody wears at a pixel of them, if it is one: a head, a trunk, and legs, apart or not.
    fn worn([head, trunk, legs]: [u8; 3], are_apart: bool, row: usize, column: usize) -> Option<u8> {
        let across = column - BODY.0.start;
        match row - BODY.1.start {
            0..6 => (5..11).contains(&across).then_some(head),
            6..20 => Some(trunk),
            _ => (!are_apart || (2..6).contains(&across) || (10..14).contains(&across)).then_some(legs),
        }
    }

    fn wall(row: usize) -> u8 {
        if row < 50 { 120 } else { 100 }
    }

    /// Looks at somebody in `pictures` pictures, on a floor that reflects a part of them, and of the wall behind where it `reflects_all`;
    /// where their feet are found in the last.
    fn feet(
        (clothes, are_apart): ([u8; 3], bool),
        (reflected, reflects_all): (f32, bool),
        pictures: usize,
    ) -> (Option<usize>, Reflections) {
        let feet = BODY.1.end;
        let mut reflections = Reflections::default();
        let background: Vec<u8> = (0..SIZE.0 * SIZE.1).map(|at| wall(at / SIZE.0)).collect();
        let (mut picture, mut foreground) = (background.clone(), vec![0; background.len()]);
        for (row, column) in BODY.1.flat_map(|row| BODY.0.map(move |column| (row, column))) {
            let Some(worn) = worn(clothes, are_apart, row, column) else { continue };
            picture[row * SIZE.0 + column] = worn;
            foreground[row * SIZE.0 + column] = 255;
            let below = 2 * feet - 1 - row;
            let known = f32::from(wall(below));
            let before = if reflects_all { f32::from(wall(row)) } else { known };
            let seen = known + reflected * (f32::from(worn) - before);
            picture[below * SIZE.0 + column] = seen.round() as u8;
        }
        let [luma, background, foreground] =
            [&picture, &background, &foreground].map(|plane| Luma::packed(plane, SIZE.0));
        let scene = SceneView::of_greys(luma, background, foreground);
        let rows = BODY.1.start..if reflected > 0.0 { 2 * feet - BODY.1.start } else { feet };
        let look = |_| {
            reflections.next_picture();
            reflections.feet(&Extent { rows: rows.clone(), columns: BODY.0 }, &scene)
        };
        let found = (0..pictures).map(look).last().flatten();
        (found, reflections)
    }

    const SOMEBODY: ([u8; 3], bool) = ([170, 200, 40], true);

    #[test]
    fn a_reflection_begins_at_the_feet_and_tells_that_the_floor_shines() {
        for reflects_all in [true, false] {
            for pictures in [1, 30] {
                let (found, reflections) = feet(SOMEBODY, (0.3, reflects_all), pictures);
                assert!(found.is_some_and(|row| row.abs_diff(BODY.1.end) <= 1), "{found:?}");
                assert_eq!(reflections.shines(), pictures == 30);
            }
        }
    }

    #[test]
    fn somebody_else_and_legs_are_no_reflections() {
        let nothing = (0.0, true);
        for (who, floor) in [
            (SOMEBODY, (0.9, true)),
            (SOMEBODY, nothing),
            (([90, 40, 60], false), nothing),
            (([90, 40, 180], true), nothing),
        ] {
            let (found, reflections) = feet(who, floor, 100);
            assert_eq!((found, reflections.share), (None, 0.0), "{who:?} {floor:?}");
        }
    }

    #[test]
    fn in_a_crowd_two_regions_are_looked_at_in_each_picture_and_all_in_turn() {
        let plane = vec![100; SIZE.0 * SIZE.1];
        let luma = Luma::packed(&plane, SIZE.0);
        let scene = SceneView::of_greys(luma, luma, luma);
        let mut reflections = Reflections { share: 0.1, ..Reflections::default() };
        let mut looked_at = [0; 5];
        for _ in 0..6 {
            reflections.next_picture();
            for (number, looks) in looked_at.iter_mut().enumerate() {
                let before = reflections.share;
                let left = 10 * number;
                assert_eq!(
                    reflections.feet(&Extent { rows: 10..50, columns: left..left + 10 }, &scene),
                    None
                );
                *looks += u32::from(reflections.share < before);
            }
        }
        // Two, two, and the one that is left.
        assert_eq!(looked_at, [2; 5]);
    }

    proptest! {
        #[test]
        fn any_part_of_any_picture_can_be_looked_at(
            (width, height) in (1usize..40, 1usize..90),
            (left, right, top, bottom) in (0.0f64..1.0, 0.0f64..1.0, 0.0f64..1.0, 0.0f64..1.0),
            seed in prop::collection::vec(any::<u8>(), 97),
        ) {
            let plane = |step: usize| (0..width * height).map(|at| seed[at * step % 97]).collect::<Vec<_>>();
            let planes = [plane(1), plane(3), plane(5)];
            let part = |one: f64, other: f64, count: usize| {
                let [one, other] = [one, other].map(|share| (share * count as f64) as usize);
                one.min(other)..one.max(other) + 1
            };
            let region = Extent { rows: part(top, bottom, height), columns: part(left, right, width) };
            let mut reflections = Reflections { share: 1.0, ..Reflections::default() };
            let [luma, background, foreground] = planes.each_ref().map(|plane| Luma::packed(plane, width));
            let found = reflections.feet(&region, &SceneView::of_greys(luma, background, foreground));
            prop_assert!(found.is_none_or(|row| row > region.rows.start && row <= height));
            prop_assert!(reflections.share.is_finite());
        }
    }
}
