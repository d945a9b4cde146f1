// SPDX-License-Identifier: MPL-2.0

//! Where a picture lies on what is known of the background, if that is not where the camera's motion put it. While a picture is blurred
//! nobody can tell how the camera turns, and what is lost of its way then would be lost for good.

use opencv::core::{self, Mat, Point, Rect, Size};
use opencv::imgproc;
use opencv::prelude::*;
use ptztrack_contract::Homography;

use super::model::{KNOWN, Model, Sampled};
use crate::vision::Luma;

/// How far beside that place it is looked for at most, pixels; down less, in a picture that is less high.
const REACH: usize = 64;
/// Pixels of either side that are looked at as one.
const REDUCED: usize = 2;
/// Part of the background there that must be known.
const LEAST_KNOWN: f64 = 0.5;
/// Columns that are looked at, how many of them must tell, and from the first to the last that does: somebody and the place that they left
/// take fewer.
const COLUMNS: i32 = 8;
const LEAST_TELLING: usize = 3;
const LEAST_REACH: i32 = 6;

/// Finds by how much a picture lies beside the background: the least sum of squared differences over all displacements.
#[derive(Debug, Default)]
pub(super) struct Registration {
    seen: Vec<u8>,
    known: Vec<u8>,
    picture: Mat,
    mean: Mat,
    mask: Mat,
    both: Mat,
    differences: Mat,
}

impl Registration {
    /// What takes a place of the canvas to where the picture, which covers `spans` of it, shows that; `None` where it lies there already,
    /// or what is known does not tell.
    pub fn offset(
        &mut self,
        model: &Model,
        picture: &Sampled,
        spans: &[(usize, usize)],
    ) -> opencv::Result<Option<Homography>> {
        self.reduce(model, picture, spans)?;
        let whole = self.mean.size()?;
        let reach = (REACH / REDUCED) as i32;
        let (across, down) = (reach.min(whole.width / 4), reach.min(whole.height / 4));
        let middle = Rect::new(across, down, whole.width - 2 * across, whole.height - 2 * down);
        let mask = self.mask.roi(middle)?;
        if f64::from(core::count_non_zero(&mask)?) < LEAST_KNOWN * f64::from(middle.area()) {
            return Ok(None);
        }
        let (mean, differences) = (self.mean.roi(middle)?, &mut self.differences);
        imgproc::match_template(&self.picture, &mean, differences, imgproc::TM_SQDIFF, &mask)?;
        let mut best = Point::default();
        core::min_max_loc(differences, None, None, Some(&mut best), None, &core::no_array())?;
        if !self.is_told(middle, best)? {
            return Ok(None);
        }
        let off = |at: i32| (REDUCED as i32 * at) as f64;
        let (x, y) = (off(best.x - across), off(best.y - down));
        Ok(Some(Homography::translation(x, y)))
    }

    /// Whether most of the picture tells that it lies at `best` and not in the `middle`. A column tells where picture and background, laid
    /// off so, are less than half as unlike as the background is to itself. Before a plain wall any place fits at which nobody is, and only
    /// they tell; where it lies in the middle nothing does.
    fn is_told(&mut self, middle: Rect, best: Point) -> opencv::Result<bool> {
        let edge = |column: i32| column * middle.width / COLUMNS;
        let (mut sums, mut telling) = ((0.0, 0.0), Vec::new());
        for column in 0..COLUMNS {
            let width = edge(column + 1) - edge(column);
            let here = Rect::new(middle.x + edge(column), middle.y, width, middle.height);
            let there = Rect::new(best.x + edge(column), best.y, width, middle.height);
            let known = self.mask.roi(here)?;
            core::bitwise_and(&known, &self.mask.roi(there)?, &mut self.both, &core::no_array())?;
            let mean = self.mean.roi(here)?;
            let unlike = |other: &Mat| core::norm2(&mean, &other.roi(there)?, core::NORM_L2SQR, &self.both);
            let (picture, background) = (unlike(&self.picture)?, unlike(&self.mean)?);
            sums = (sums.0 + picture, sums.1 + background);
            if picture < background / 2.0 {
                telling.push(column);
            }
        }
        let reach = telling.first().zip(telling.last()).map_or(0, |(first, last)| last - first + 1);
        Ok(sums.0 < sums.1 / 2.0 && telling.len() >= LEAST_TELLING && reach >= LEAST_REACH)
    }

    /// Takes picture, background and what is known of it as they lie on the canvas.
    fn reduce(&mut self, model: &Model, picture: &Sampled, spans: &[(usize, usize)]) -> opencv::Result<()> {
        let (width, height) = model.size;
        self.seen.clone_from(&model.shown);
        let rows = self.seen.chunks_exact_mut(width).zip(picture.luma.chunks_exact(width));
        for ((row, seen), &(start, end)) in rows.zip(spans).filter(|(_, (start, end))| start < end) {
            row[start..end].copy_from_slice(&seen[start..end]);
            // What lies beyond the picture is as its edge, which speaks neither for nor against a displacement by much.
            row[..start].fill(seen[start]);
            row[end..].fill(seen[end - 1]);
        }
        self.known.clear();
        self.known.extend(model.age.iter().map(|age| if *age >= KNOWN { u8::MAX } else { 0 }));
        let size = Size::new((width / REDUCED) as i32, (height / REDUCED) as i32);
        let reduced = |data, out: &mut Mat, way| {
            Luma::packed(data, width).with_mat(|plane| imgproc::resize(plane, out, size, 0.0, 0.0, way))
        };
        reduced(&self.seen, &mut self.picture, imgproc::INTER_AREA)?;
        reduced(&model.shown, &mut self.mean, imgproc::INTER_AREA)?;
        reduced(&self.known, &mut self.mask, imgproc::INTER_NEAREST)
    }
}
