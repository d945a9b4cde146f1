// SPDX-License-Identifier: MPL-2.0

//! What is known of each pixel of the background, and how a picture is held against it.

use std::ops::Range;

use opencv::core::{CV_8UC1, Mat, Point as Pixel, Rect as PixelRect, Scalar, Size, Vector};
use opencv::imgproc;
use opencv::prelude::*;

use ptztrack_contract::{Point, Rect};

use super::noise::Noise;
use super::rows::{self, MIN_PATIENCE};
use super::warp::{Lanczos, Warp};
use crate::vision::Luma;

/// An apparent background that nobody has looked at yet has this age.
pub(super) const UNSEEN: u8 = 0;
/// From this age (pictures) on, a pixel is known: before, who can tell what is foreground?
pub(super) const KNOWN: u8 = 4;
pub(super) const MAX_AGE: u8 = 250;
/// Likelihood of a pixel of which nothing is known.
pub const UNKNOWN: u8 = 128;
/// Pixels of each row that the noise is learned from: one in so many.
const SAMPLING: usize = 7;
/// Where the background's own range around a pixel is larger, its deviations say little of noise.
const FLAT: u8 = 8;

/// The picture as it lies on the model.
#[derive(Debug, Default)]
pub(super) struct Sampled {
    pub luma: Vec<u8>,
    pub chroma: Option<[Vec<u8>; 2]>,
}

/// A part of a row of the model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<'a> {
    /// 8.8 fixed point.
    pub mean: &'a [u16],
    /// Mean absolute deviation, 8.8.
    pub spread: &'a [u16],
    /// The mean's range within one pixel.
    pub range: &'a [u8],
    pub likelihood: &'a [u8],
}

/// How a picture is held against the model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Comparison {
    /// How far the picture may lie beside the model, as a part of a pixel.
    pub misplaced: f32,
    /// Least weight of a picture in mean and spread (the α of thesis 3.1).
    pub min_weight: f32,
    /// Time since the last picture, in `TICKS` a second.
    pub ticks: u8,
    /// After so many ticks what stays the same is background.
    pub patience: u8,
}

/// Pixels of a side over which light that changed is taken to be the same.
const LIGHT_SIDE: i32 = 15;

/// Units of time in which candidates wait.
pub(super) const TICKS: f64 = 25.0;

/// Mean and spread of every pixel (thesis 3.1, 3.2), its age, and beside it a candidate (Yi et al. 2013) for
/// what it may become: so foreground never gets into the mean of the background.
#[derive(Debug, Default)]
pub(super) struct Model {
    pub size: (usize, usize),
    /// 8.8 fixed point, as the other means.
    pub luma: Vec<u16>,
    pub chroma: [Vec<u16>; 2],
    /// Mean absolute deviation of luma, 8.8.
    pub spread: Vec<u16>,
    pub age: Vec<u8>,
    /// Luma, U and V of what may become background.
    pub candidate: [Vec<u8>; 3],
    /// For how long it has been the same, in ticks.
    pub waited: Vec<u8>,
    /// The mean's luma in whole grey levels, and the range of it within one pixel.
    pub shown: Vec<u8>,
    range: Vec<u8>,
    pub likelihood: Vec<u8>,
    /// Deviations, weights and extremes of one row, kept as memory.
    row: Vec<f32>,
    alphas: Vec<u16>,
    extremes: [Vec<u8>; 2],
    /// A plane of each kind, kept as memory.
    wide: Vec<u16>,
    narrow: Vec<u8>,
    lanczos: Lanczos,
}

impl Model {
    pub fn new(size: (usize, usize)) -> Self {
        let count = size.0 * size.1;
        Self {
            size,
            luma: vec![0; count],
            chroma: [vec![128 << 8; count], vec![128 << 8; count]],
            spread: vec![0; count],
            age: vec![UNSEEN; count],
            candidate: [vec![0; count], vec![0; count], vec![0; count]],
            waited: vec![0; count],
            shown: vec![0; count],
            range: vec![0; count],
            likelihood: vec![UNKNOWN; count],
            row: Vec::new(),
            alphas: Vec::new(),
            extremes: Default::default(),
            wide: Vec::new(),
            narrow: Vec::new(),
            lanczos: Lanczos::default(),
        }
    }

    /// These columns of a row.
    pub fn row(&self, y: usize, columns: Range<usize>) -> Row<'_> {
        let part = y * self.size.0 + columns.start..y * self.size.0 + columns.end;
        Row {
            mean: &self.luma[part.clone()],
            spread: &self.spread[part.clone()],
            range: &self.range[part.clone()],
            likelihood: &self.likelihood[part],
        }
    }

    /// Lays all planes anew as `warp` says; what was never seen has no age.
    pub fn carry(&mut self, warp: &Warp) -> opencv::Result<()> {
        let mut wide = std::mem::take(&mut self.wide);
        warp.sample_wide(&self.luma, 0, &mut wide);
        if !warp.is_copy() {
            self.lanczos.sharpen(&mut wide, warp, &self.luma, &self.age)?;
        }
        std::mem::swap(&mut self.luma, &mut wide);
        for plane in [&mut self.spread].into_iter().chain(&mut self.chroma) {
            warp.sample_wide(plane, 0, &mut wide);
            std::mem::swap(plane, &mut wide);
        }
        let mut narrow = std::mem::take(&mut self.narrow);
        for plane in [&mut self.waited].into_iter().chain(&mut self.candidate) {
            warp.sample_nearest(plane, 0, &mut narrow);
            std::mem::swap(plane, &mut narrow);
        }
        warp.sample_nearest(&self.likelihood, UNKNOWN, &mut narrow);
        std::mem::swap(&mut self.likelihood, &mut narrow);
        // A mean mixed with one of which nothing is known is not known.
        warp.sample_least(&self.age, 0, &mut narrow);
        std::mem::swap(&mut self.age, &mut narrow);
        (self.wide, self.narrow) = (wide, narrow);
        Ok(())
    }

    /// Makes everything lighter or darker by a factor. Colours fade with the light.
    pub fn relight(&mut self, gain: f32) {
        if gain == 1.0 {
            return;
        }
        let lit = |value: u16, black: f32| {
            (black + gain * (f32::from(value) - black)).clamp(0.0, f32::from(u16::MAX)) as u16
        };
        self.luma.iter_mut().chain(&mut self.spread).for_each(|mean| *mean = lit(*mean, 0.0));
        self.chroma.iter_mut().flatten().for_each(|mean| *mean = lit(*mean, f32::from(128_u16 << 8)));
        for (plane, black) in self.candidate.iter_mut().zip([0.0, 128.0, 128.0]) {
            plane.iter_mut().for_each(|seen| *seen = lit(u16::from(*seen), black).min(255) as u8);
        }
    }

    /// Leaves the mean in whole grey levels, and its range within one pixel in the rows that `spans` say are compared.
    pub fn survey(&mut self, spans: &[(usize, usize)]) {
        rows::whole(&mut self.shown, &self.luma);
        let (width, last) = (self.size.0, self.size.1.saturating_sub(1));
        let [least, most] = &mut self.extremes;
        for (y, _) in spans.iter().enumerate().filter(|(_, (start, end))| start < end) {
            let around =
                [y.saturating_sub(1), y, (y + 1).min(last)].map(|y| &self.shown[y * width..][..width]);
            rows::ranges(&mut self.range[y * width..][..width], around, least, most);
        }
    }

    /// Holds the picture against the model where `spans` say that it covers it (3.3, with the deviation measured
    /// in units of what noise makes): leaves the likelihood of foreground.
    pub fn compare(&mut self, picture: &Sampled, spans: &[(usize, usize)], how: Comparison, noise: &Noise) {
        let (line, chroma_noise) = (noise.luma(), noise.chroma());
        for (y, &(start, end)) in spans.iter().enumerate() {
            let whole = &mut self.likelihood[y * self.size.0..][..self.size.0];
            whole[..start].fill(UNKNOWN);
            whole[end..].fill(UNKNOWN);
            if start >= end {
                continue;
            }
            let row = y * self.size.0 + start..y * self.size.0 + end;
            self.row.clear();
            self.row.resize(row.len(), 0.0);
            if let Some(chroma) = &picture.chroma {
                for (seen, mean) in chroma.iter().zip(&self.chroma) {
                    rows::add_deviations(&mut self.row, &seen[row.clone()], &mean[row.clone()], chroma_noise);
                }
            }
            let known = rows::Known {
                mean: &self.luma[row.clone()],
                spread: &self.spread[row.clone()],
                age: &self.age[row.clone()],
                range: &self.range[row.clone()],
            };
            let out = &mut self.likelihood[row.clone()];
            rows::likelihoods(out, &picture.luma[row], &self.row, known, how.misplaced, line);
        }
    }

    /// Learns the noise from what is background for sure.
    pub fn note_noise(&self, picture: &Sampled, spans: &[(usize, usize)], noise: &mut Noise) {
        for (y, &(start, end)) in spans.iter().enumerate() {
            let row = y * self.size.0 + start..y * self.size.0 + end.max(start);
            let (age, range) = (&self.age[row.clone()], &self.range[row.clone()]);
            let (likelihood, shown) = (&self.likelihood[row.clone()], &self.shown[row.clone()]);
            let (seen, mean) = (&picture.luma[row.clone()], &self.luma[row.clone()]);
            let chroma = picture.chroma.as_ref().map(|[u, v]| {
                let [mean_u, mean_v] = &self.chroma;
                [(&u[row.clone()], &mean_u[row.clone()]), (&v[row.clone()], &mean_v[row.clone()])]
            });
            for x in (y % SAMPLING..row.len()).step_by(SAMPLING) {
                if likelihood[x] < UNKNOWN && age[x] > 2 * KNOWN && range[x] <= FLAT {
                    let off =
                        |seen: &[u8], mean: &[u16]| (f32::from(seen[x]) - f32::from(mean[x]) / 256.0).abs();
                    let chroma = chroma.map_or(0.0, |[u, v]| 0.5 * (off(u.0, u.1) + off(v.0, v.1)));
                    noise.note(shown[x], off(seen, mean), chroma);
                }
            }
        }
        noise.learn();
    }

    /// Takes the picture into the model: (3.1) and the spread where it is background, or else into the candidate,
    /// which becomes background when it has waited long enough. Nothing does in the box `held`, where somebody is. What
    /// was never seen before, there and around, has to stay the same for a moment first: it may be them, who reach
    /// farther than the box.
    pub fn learn(
        &mut self,
        picture: &Sampled,
        spans: &[(usize, usize)],
        how: Comparison,
        held: Option<Rect>,
    ) {
        let mut alphas = std::mem::take(&mut self.alphas);
        let pixels = |area: Option<Rect>| area.map_or((0..0, 0..0), |area| pixels_of(area, self.size));
        let (around_columns, around_rows) = pixels(held.map(around));
        let (held_columns, held_rows) = pixels(held);
        for (y, &(start, end)) in spans.iter().enumerate().filter(|(_, (start, end))| start < end) {
            let row = y * self.size.0 + start..y * self.size.0 + end;
            alphas.resize(row.len(), 0);
            rows::alphas(&mut alphas, &self.likelihood[row.clone()], &self.age[row.clone()], how.min_weight);
            if around_rows.contains(&y) {
                let column = |x: usize| x.clamp(start, end) - start;
                let near = column(around_columns.start)..column(around_columns.end);
                rows::leave_unseen(&mut alphas[near.clone()], &self.age[row.clone()][near]);
            }
            let (mean, spread) = (&mut self.luma[row.clone()], &mut self.spread[row.clone()]);
            rows::learn_spread(spread, mean, &picture.luma[row.clone()], &alphas);
            rows::learn_mean(mean, &picture.luma[row.clone()], &alphas);
            if let Some(chroma) = &picture.chroma {
                for (seen, mean) in chroma.iter().zip(&mut self.chroma) {
                    rows::learn_mean(&mut mean[row.clone()], &seen[row.clone()], &alphas);
                }
            }
            rows::grow_older(&mut self.age[row.clone()], &mut self.waited[row.clone()], &alphas);
            let held = if held_rows.contains(&y) { held_columns.clone() } else { 0..0 };
            for (part, alphas) in alphas.chunks(rows::PART).enumerate() {
                if rows::any_foreground(alphas) {
                    self.wait(picture, (start + rows::PART * part, y), alphas, how, &held);
                }
            }
        }
        self.alphas = alphas;
    }

    /// What the candidates of foreground pixels, those of `alphas` that are nought, make of a part of a row of the picture, which begins
    /// at column `x` and row `y`. In the columns `held`, where somebody is, they only begin to wait.
    fn wait(
        &mut self,
        picture: &Sampled,
        (x, y): (usize, usize),
        alphas: &[u16],
        how: Comparison,
        held: &Range<usize>,
    ) {
        let first = y * self.size.0 + x;
        let part = first..first + alphas.len();
        let grey = [128; rows::PART];
        let [u, v] = match &picture.chroma {
            Some(chroma) => chroma.each_ref().map(|plane| &plane[part.clone()]),
            None => [&grey[..alphas.len()]; 2],
        };
        let candidates = self.candidate.each_mut().map(|plane| &mut plane[part.clone()]);
        let seen = [&picture.luma[part.clone()], u, v];
        let times = (how.ticks, how.patience);
        let (waited, age) = (&mut self.waited[part.clone()], &self.age[part.clone()]);
        let is_any_due = rows::wait(candidates, waited, seen, alphas, age, times);
        let [held_start, held_end] =
            [held.start, held.end].map(|column| column.clamp(x, x + alphas.len()) - x);
        for waited in &mut waited[held_start..held_end] {
            *waited = (*waited).min(MIN_PATIENCE);
        }
        if !is_any_due {
            return;
        }
        for (at, _) in part.zip(alphas).filter(|(_, alpha)| **alpha == 0) {
            let is_due = self.waited[at] >= rows::patience(self.age[at], times);
            if is_due && (self.age[at] == UNSEEN || !held.contains(&(x + at - first))) {
                self.adopt(at);
            }
        }
    }

    /// The canvas, 255 within a polygon and 0 elsewhere.
    fn within(&self, polygon: &Vector<Pixel>) -> opencv::Result<Mat> {
        let (width, height) = (self.size.0 as i32, self.size.1 as i32);
        let mut mask = Mat::new_rows_cols_with_default(height, width, CV_8UC1, Scalar::all(0.0))?;
        imgproc::fill_poly_def(&mut mask, polygon, Scalar::all(255.0))?;
        Ok(mask)
    }

    /// Makes the mean within a polygon as light as the picture is around each pixel, but for what is `held`.
    pub fn relight_within(
        &mut self,
        polygon: &Vector<Pixel>,
        picture: &Sampled,
        held: Option<Rect>,
    ) -> opencv::Result<()> {
        let mask = self.within(polygon)?;
        let bounds =
            imgproc::bounding_rect(polygon)? & PixelRect::new(0, 0, self.size.0 as i32, self.size.1 as i32);
        if bounds.empty() {
            return Ok(());
        }
        let (left, top) = (bounds.x as usize, bounds.y as usize);
        let blurred = |plane: &[u8]| -> opencv::Result<Mat> {
            let part = Luma::packed(plane, self.size.0).crop(
                left,
                top,
                bounds.width as usize,
                bounds.height as usize,
            );
            let mut blurred = Mat::default();
            part.with_mat(|part| imgproc::blur_def(part, &mut blurred, Size::new(LIGHT_SIDE, LIGHT_SIDE)))?;
            Ok(blurred)
        };
        let (seen, known) = (blurred(&picture.luma)?, blurred(&self.shown)?);
        let (seen, known) = (seen.data_bytes()?, known.data_bytes()?);
        let inside = mask.data_bytes()?;
        for (index, (&seen, &known)) in seen.iter().zip(known).enumerate() {
            let (x, y) = (left + index % bounds.width as usize, top + index / bounds.width as usize);
            let at = y * self.size.0 + x;
            if inside[at] > 0 && !held.is_some_and(|held| lies_in(held, x, y)) {
                let gain = f32::from(seen.max(1)) / f32::from(known.max(1));
                self.luma[at] = (gain * f32::from(self.luma[at])).min(f32::from(u16::MAX)) as u16;
                self.waited[at] = 0;
            }
        }
        Ok(())
    }

    /// Makes what has waited a moment within a polygon background.
    pub fn adopt_within(&mut self, polygon: &Vector<Pixel>) -> opencv::Result<()> {
        let mask = self.within(polygon)?;
        for (at, _) in mask.data_bytes()?.iter().enumerate().filter(|(_, inside)| **inside > 0) {
            if self.waited[at] >= MIN_PATIENCE {
                self.adopt(at);
            }
        }
        Ok(())
    }

    /// Makes the candidate background.
    fn adopt(&mut self, at: usize) {
        let [luma, u, v] = [0, 1, 2].map(|k| u16::from(self.candidate[k][at]) << 8);
        (self.luma[at], self.chroma[0][at], self.chroma[1][at]) = (luma, u, v);
        (self.age[at], self.waited[at]) = (KNOWN, 0);
    }
}

/// How far around their box somebody may reach, in sizes of the box.
const AROUND: f64 = 0.4;

/// Where somebody may be of whom that box is known.
pub(super) fn around(held: Rect) -> Rect {
    let Rect { x, y, width, height } = held;
    let times = 1.0 + 2.0 * AROUND;
    Rect { x: x - AROUND * width, y: y - AROUND * height, width: times * width, height: times * height }
}

/// Columns and rows of a canvas of that size that lie in a box.
fn pixels_of(bounds: Rect, (width, height): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let places = |first: f64, length: f64, size: usize| {
        let end = ((first + length).floor() + 1.0).max(0.0) as usize;
        let first = (first.ceil().max(0.0) as usize).min(size);
        first..end.clamp(first, size)
    };
    (places(bounds.x, bounds.width, width), places(bounds.y, bounds.height, height))
}

fn lies_in(bounds: Rect, x: usize, y: usize) -> bool {
    bounds.contains(Point { x: x as f64, y: y as f64 })
}
