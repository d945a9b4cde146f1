// SPDX-License-Identifier: MPL-2.0

//! By how little a picture of a turning camera lies beside what is known of the background. The camera's motion is measured from picture to
//! picture, and its errors add up: where a tiled floor lies a pixel off, its edges differ by more than somebody does who is hardly seen.
//! One step of Gauss and Newton over the background that is known (Lucas and Kanade, IJCAI 1981; Baker and Matthews, IJCV 2004), with the
//! mean gradient of both pictures (Benhimane and Malis, IROS 2004). Light is no motion: what a block differs by as a whole says nothing.

mod line;

use std::ops::Range;

use multiversion::multiversion;
use opencv::core::Point2f;
use ptztrack_contract::{Homography, Point, Rect};

use self::line::{Line, Rows};
use super::model::{Model, Sampled};
use crate::vision::camera_motion::displacement;
use crate::vision::projective::{Centred, Parameters, solve};

/// Pixels of a side of a block, which is taken to lie off as a whole.
const BLOCK: usize = 16;
/// One in so many rows is looked at.
const SAMPLING: usize = 2;
/// Deviation of what a pixel differs by, grey levels.
const NOISE: f64 = 3.0;
/// Deviation of where a picture lies before it is looked at, pixels: before a plain wall it stays there.
const EXPECTED: f64 = 0.2;
/// Pixels that a corner of the canvas is moved by at most: what is farther off is not found by gradients.
const MOST: f64 = 4.0;

/// Weighted sums over a block, apart for each of its columns: of one, of the gradient across and down and of what pixels differ by, and
/// of the products of those: across with across, down and off, and down with down and off.
#[derive(Debug, Clone, Copy, Default)]
struct Block([[f32; BLOCK]; 9]);

impl Block {
    /// The products but for what is the same all over the block; `None` where nothing of it is known.
    fn centred(&self) -> Option<[f64; 5]> {
        let [weight, across, down, off, products @ ..] = totals(&self.0);
        let of_means = [across * across, across * down, across * off, down * down, down * off];
        (weight > 0.0).then(|| std::array::from_fn(|i| products[i] - of_means[i] / weight))
    }
}

/// The sum over all columns, for each of what is summed up.
#[multiversion(targets("x86_64+avx2"))]
fn totals(sums: &[[f32; BLOCK]; 9]) -> [f64; 9] {
    let mut totals = [0.0; 9];
    for (total, columns) in totals.iter_mut().zip(sums) {
        let mut halves = [0.0; BLOCK / 2];
        for (half, (a, b)) in halves.iter_mut().zip(columns.iter().zip(&columns[BLOCK / 2..])) {
            *half = a + b;
        }
        *total = halves.iter().map(|half| f64::from(*half)).sum();
    }
    totals
}

/// Finds by how little; keeps memory.
#[derive(Debug, Default)]
pub(super) struct Alignment {
    blocks: Vec<Block>,
    line: Line,
}

impl Alignment {
    /// What takes a place of the canvas to where the picture, which covers `spans` of it, shows that. What lies in the box `held`, where
    /// somebody is, what was foreground in the picture before, and what lies beside that in its row says nothing. `None` where that
    /// cannot be told, or is too far.
    pub fn step(
        &mut self,
        model: &Model,
        picture: &Sampled,
        spans: &[(usize, usize)],
        held: Option<Rect>,
    ) -> Option<Homography> {
        self.gather(model, picture, spans, held);
        let (width, height) = model.size;
        let centred = Centred::of(width as f64, height as f64);
        let blocks = self.blocks.iter().enumerate().map(|(index, block)| {
            let place = |at: usize| (at * BLOCK) as f32 + (BLOCK as f32 - 1.0) / 2.0;
            let across = width.div_ceil(BLOCK);
            (centred.enter(Point2f::new(place(index % across), place(index / across))), block)
        });
        let (matrix, right) = normal_equations(blocks);
        let [a, b, tx, ty, g, h] = solve(matrix, right)?.map(|pixels| pixels / centred.unit);
        let step = centred.leave([1.0 + a, b, tx, ty, g, h]);
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
        let is_small = corners.iter().all(|(x, y)| {
            let corner = Point { x: x * width as f64, y: y * height as f64 };
            // Not so of what is no number.
            displacement(&step, corner) <= MOST
        });
        is_small.then_some(step)
    }

    /// Sums up each block.
    fn gather(&mut self, model: &Model, picture: &Sampled, spans: &[(usize, usize)], held: Option<Rect>) {
        let (width, height) = model.size;
        let across = width.div_ceil(BLOCK);
        self.blocks.clear();
        self.blocks.resize(across * height.div_ceil(BLOCK), Block::default());
        self.line.resize(across * BLOCK);
        for y in (1..height.saturating_sub(1)).step_by(SAMPLING) {
            let around = [y - 1, y, y + 1];
            let start = around.map(|y| spans[y].0).into_iter().max().unwrap_or(0) + 1;
            let end = around.map(|y| spans[y].1).into_iter().min().unwrap_or(0).saturating_sub(1);
            if start >= end {
                continue;
            }
            let rows = Rows {
                mean: around.map(|y| &model.luma[y * width..][..width]),
                age: around.map(|y| &model.age[y * width..][..width]),
                seen: around.map(|y| &picture.luma[y * width..][..width]),
                likelihood: &model.likelihood[y * width..][..width],
            };
            self.line.read(rows, start..end);
            self.line.forget(columns_of(held, y, start..end));
            add(&mut self.blocks[y / BLOCK * across..][..across], &self.line);
        }
    }
}

/// Those of the columns of a row that lie in a box.
fn columns_of(held: Option<Rect>, y: usize, columns: Range<usize>) -> Range<usize> {
    let has_row = |held: &Rect| (held.y..=held.y + held.height).contains(&(y as f64));
    let Some(held) = held.filter(has_row) else { return 0..0 };
    // Casts saturate.
    let (left, right) = (held.x as usize, ((held.x + held.width) as usize).saturating_add(1));
    let start = left.clamp(columns.start, columns.end);
    // The box comes from whoever tracks, who may tell of one that has no width left in the picture.
    start..right.clamp(start, columns.end)
}

/// Adds what a row says to the blocks that it goes through.
#[multiversion(targets("x86_64+avx2"))]
fn add(blocks: &mut [Block], line: &Line) {
    for (column, block) in blocks.iter_mut().enumerate() {
        if let Some(lanes) = line.lanes(column * BLOCK) {
            add_products(block, lanes);
        }
    }
}

#[inline(always)]
fn add_products(Block(sums): &mut Block, [root, across, down, off]: [&[f32; BLOCK]; 4]) {
    let of_two = [
        (root, root),
        (root, across),
        (root, down),
        (root, off),
        (across, across),
        (across, down),
        (across, off),
        (down, down),
        (down, off),
    ];
    for (sums, (a, b)) in sums.iter_mut().zip(of_two) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
}

/// Of the displacement, whose derivatives are those of [`Centred::leave`] where nothing moves, in pixels; with what is known beforehand.
fn normal_equations<'a>(
    blocks: impl Iterator<Item = ((f64, f64), &'a Block)>,
) -> ([[f64; 6]; 6], Parameters) {
    let (mut matrix, mut right) = ([[0.0; 6]; 6], [0.0; 6]);
    for ((x, y), block) in blocks {
        let Some([xx, xy, x_off, yy, y_off]) = block.centred() else { continue };
        let derivatives = [(x, y), (-y, x), (1.0, 0.0), (0.0, 1.0), (-x * x, -x * y), (-x * y, -y * y)];
        for (i, (u, v)) in derivatives.into_iter().enumerate() {
            let (ux, uy) = (u * xx + v * xy, u * xy + v * yy);
            for (sum, (u, v)) in matrix[i].iter_mut().zip(derivatives) {
                *sum += ux * u + uy * v;
            }
            right[i] += u * x_off + v * y_off;
        }
    }
    (0..6).for_each(|i| matrix[i][i] += (NOISE / EXPECTED).powi(2));
    (matrix, right)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::vision::synthetic::{Canvas, texture};

    const SIZE: (usize, usize) = (192, 144);
    /// Somebody of another texture: left, top, width, height in pixels.
    const PERSON: (f64, f64, f64, f64) = (60.0, 20.0, 60.0, 100.0);

    fn room(x: f64, y: f64) -> f64 {
        60.0 + 0.5 * texture(1, x, y)
    }

    /// A plain wall, lighter towards the right.
    fn wall(x: f64, _: f64) -> f64 {
        100.0 + 0.1 * x
    }

    /// What is known of somebody in the picture.
    #[derive(Clone, Copy, PartialEq)]
    enum Known {
        Nobody,
        New,
        Foreground,
        Held,
    }

    /// How far from where it is the picture of a `world` that lies `off` from the background, in another `light`, is laid, pixels, at the
    /// worst corner.
    fn error(world: fn(f64, f64) -> f64, off: &Homography, known: Known, light: fn(f64) -> f64) -> f64 {
        let mut model = Model::new(SIZE);
        model.luma = Canvas::seen(SIZE, &Homography::IDENTITY, world)
            .pixels
            .iter()
            .map(|pixel| u16::from(*pixel) << 8)
            .collect();
        (model.age, model.likelihood) = (vec![100; model.luma.len()], vec![0; model.luma.len()]);
        let mut picture = Canvas::seen(SIZE, off, |x, y| world(x, y) + light(x)).noisy(2.0, 7);
        let (x, y, width, height) = PERSON;
        let person = Rect { x, y, width, height };
        if known != Known::Nobody {
            picture.paint(PERSON, |u, v| 20.0 + texture(5, u, v));
        }
        for (at, likelihood) in model.likelihood.iter_mut().enumerate() {
            let place = Point { x: (at % SIZE.0) as f64, y: (at / SIZE.0) as f64 };
            if known == Known::Foreground && person.contains(place) {
                *likelihood = 200;
            }
        }
        let picture = Sampled { luma: picture.pixels, chroma: None };
        let held = (known == Known::Held).then_some(person);
        let spans = [(0, SIZE.0); SIZE.1];
        let step = Alignment::default().step(&model, &picture, &spans, held).unwrap_or(Homography::IDENTITY);
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
        let error = corners.map(|(x, y)| {
            let corner = Point { x: x * SIZE.0 as f64, y: y * SIZE.1 as f64 };
            let (there, wanted) = (step.apply(corner), off.apply(corner));
            (there.x - wanted.x).hypot(there.y - wanted.y)
        });
        error.into_iter().fold(0.0, f64::max)
    }

    /// A shift, and somewhat of a turn, a zoom and perspective.
    fn off() -> Homography {
        Homography([[1.002, -0.001, 0.3], [0.001, 1.002, -0.4], [1e-6, -1e-6, 1.0]])
    }

    /// The light in which the background was learned, and how much lighter it may be, more so in the middle.
    fn same(_: f64) -> f64 {
        0.0
    }

    fn lighter(x: f64) -> f64 {
        6.0 - 4.0 * ((x - 96.0) / 96.0).powi(2)
    }

    #[test]
    fn a_picture_is_laid_where_it_fits_to_parts_of_a_pixel_in_another_light_too() {
        for light in [same, lighter] {
            let errors = [off(), Homography::IDENTITY].map(|off| error(room, &off, Known::Nobody, light));
            assert!(errors[0] < 0.1 && errors[1] < 0.05, "{errors:?}");
        }
    }

    #[test]
    fn somebody_moves_no_picture_but_for_the_first_moment() {
        let errors =
            [Known::New, Known::Foreground, Known::Held].map(|known| error(room, &off(), known, same));
        assert!(errors[0] < 0.5 && errors[1..].iter().all(|error| *error < 0.1), "{errors:?}");
    }

    #[test]
    fn before_a_plain_wall_a_picture_stays_where_it_is_in_another_light_too() {
        let errors = [same, lighter].map(|light| error(wall, &Homography::IDENTITY, Known::Nobody, light));
        assert!(errors.iter().all(|error| *error < 0.2), "{errors:?}");
    }

    #[test]
    fn what_is_too_far_off_is_left_where_it_is() {
        let far = Homography::translation(12.0, 0.0);
        let error = error(room, &far, Known::Nobody, same);
        assert!((error - 12.0).abs() < 4.1, "{error}");
    }

    proptest! {
        #[test]
        fn any_box_has_columns(
            x in -99.0..99.0_f64, y in -9.0..9.0_f64, width in -99.0..99.0_f64, height in 0.0..9.0_f64, wild in any::<f64>(),
            row in 0..9_usize,
        ) {
            for (x, width) in [(x, width), (x, wild), (wild, width), (x, f64::NAN)] {
                let columns = columns_of(Some(Rect { x, y, width, height }), row, 3..50);
                prop_assert!(columns == (0..0) || (3 <= columns.start && columns.start <= columns.end && columns.end <= 50));
            }
        }
    }
}
