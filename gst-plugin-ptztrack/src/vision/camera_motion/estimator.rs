// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use opencv::core::Point2f;
use ptztrack_contract::{CameraMotion, Homography, Point};

use super::corners::{self, Corner, Grid};
use super::fit::{self, Agreement, Fit, Pair};
use super::flow;
use super::opening::Opening;
use crate::vision::Luma;
use crate::vision::lucas_kanade::{Pyramid, Template};
use crate::vision::projective::Centred;

/// Farther than this many pixels from the key picture, anywhere in the picture, the next picture becomes the
/// key picture: blur and perspective change what points look like.
const MAX_TRAVEL: f64 = 4.0;
/// New corners looked for in one picture, after the first: a search everywhere costs more than all the rest.
const TOP_UP: usize = 12;
/// When a smaller share of the key picture's points agrees, the next picture becomes the key picture.
const MIN_AGREEING: f64 = 0.6;
/// How long the camera is taken to go on as it did, where nothing is seen of how it moves.
const COAST: Duration = Duration::from_millis(300);
/// Background that was seen as such counts fully; points of unknown standing, and points on what was
/// foreground in the picture before, count less.
const NEW_WEIGHT: f64 = 0.5;
const FOREGROUND_WEIGHT: f64 = 0.1;

/// A point that is followed from the key picture on.
#[derive(Debug)]
struct Tracked {
    /// In the key picture, pixels.
    place: Point2f,
    /// What it looks like there.
    template: Template,
    /// Belief that it is background: 1 for sure.
    weight: f64,
}

impl Tracked {
    /// With memory for what it looks like.
    fn new(corner: &Corner, pyramid: &Pyramid, template: Template) -> Self {
        let mut point = Self { place: corner.place, template, weight: NEW_WEIGHT };
        point.look(pyramid);
        point
    }

    /// Takes what is at its place for what it looks like.
    fn look(&mut self, pyramid: &Pyramid) {
        flow::take(&mut self.template, pyramid, self.place);
    }
}

/// A picture that the following ones are compared with. While the camera rests it stays the same, so that no
/// errors add up.
#[derive(Debug)]
struct Key {
    grid: Grid,
    points: Vec<Tracked>,
    /// From it to the last picture, pixels.
    to_last: Homography,
    /// Eigenvalue up to which a corner may be noise.
    noise: f64,
    /// Memory: of points that were given up.
    spare: Vec<Template>,
}

/// What one picture says of the key picture's points; kept as memory for the next.
#[derive(Debug, Default)]
struct Comparison {
    /// Where each point is now.
    ends: Vec<Option<Point2f>>,
    /// Those that were found, ...
    pairs: Vec<Pair>,
    /// ... and which of them agree.
    agreement: Agreement,
    /// Cells that have a point.
    taken: Vec<bool>,
}

/// Estimates the motion of the camera from picture to picture (see the table of this module). Works on
/// pictures about 320 pixels wide.
#[derive(Debug, Default)]
pub struct CameraMotionEstimator {
    key: Option<Key>,
    /// The last picture, where it did not fit the key picture: it may show another view.
    another: Option<Key>,
    /// For how long no picture has fitted.
    coasted: Duration,
    /// Whether the last picture fitted none that its way is known from.
    may_be_elsewhere: bool,
    /// Of the last picture; memory for the next.
    pyramid: Pyramid,
    /// Motion of the last picture, pixels: the camera goes on as it did.
    last: Homography,
    comparison: Comparison,
    opening: Opening,
}

impl CameraMotionEstimator {
    /// Forgets the pictures before.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// How the camera moved since the last picture. `foreground` (of the last picture, in its size) says where
    /// points are not to be believed, `expected` (normalised) where the picture may have gone: a guess
    /// that is tried where it does not go on as it did. `None`: the first picture, or nothing to hold on to. After that the motion is
    /// from where the camera was taken to have gone on to ([`Self::coasted`]).
    pub fn update(
        &mut self,
        luma: &Luma,
        foreground: Option<&Luma>,
        expected: Option<Homography>,
        elapsed: Duration,
    ) -> opencv::Result<Option<CameraMotion>> {
        let mut opening = std::mem::take(&mut self.opening);
        let motion = opening.apply(luma).and_then(|seen| self.follow(&seen, foreground, expected, elapsed));
        let is_lost = motion.is_ok() && self.key.is_none();
        let begun = if is_lost { self.look_otherwise(luma, &mut opening) } else { Ok(()) };
        self.opening = opening;
        begun.and(motion)
    }

    /// Begins with this picture, not opened where the last one was, else opened if there are corners almost everywhere, as rain is: a few
    /// may all be of somebody who goes along before a plain wall.
    fn look_otherwise(&mut self, luma: &Luma, opening: &mut Opening) -> opencv::Result<()> {
        let was_opened = opening.is_called_for();
        opening.call_for(false);
        self.begin(luma)?;
        if !was_opened && self.key.as_ref().is_some_and(Key::is_full) {
            opening.call_for(true);
            self.begin(&opening.apply(luma)?)?;
        }
        Ok(())
    }

    /// Makes this the key picture.
    fn begin(&mut self, luma: &Luma) -> opencv::Result<()> {
        flow::fill(&mut self.pyramid, luma);
        self.key = Some(Key::first(luma, &self.pyramid, Grid::of(luma))?);
        Ok(())
    }

    /// How the camera moved, by a picture that was opened where that is called for. Where nothing was seen of that for longer than it is
    /// taken to go on, there is no key picture after it.
    fn follow(
        &mut self,
        luma: &Luma,
        foreground: Option<&Luma>,
        expected: Option<Homography>,
        elapsed: Duration,
    ) -> opencv::Result<Option<CameraMotion>> {
        let size = (luma.width() as f64, luma.height() as f64);
        flow::fill(&mut self.pyramid, luma);
        self.may_be_elsewhere = true;
        let another = self.another.take();
        let pyramid = &self.pyramid;
        let grid = Grid::of(luma);
        let Some(mut key) = self.key.take().filter(|key| key.grid == grid) else {
            self.last = Homography::IDENTITY;
            self.key = Some(Key::first(luma, pyramid, grid)?);
            return Ok(None);
        };
        if let Some(foreground) = foreground {
            key.doubt(foreground);
        }
        let told = expected.map(|motion| to_pixels(&motion, size));
        let guesses = [Some(self.last), told, Some(Homography::IDENTITY)].into_iter().flatten();
        let comparison = &mut self.comparison;
        let centred = Centred::of(size.0, size.1);
        let mut fit = key.compare(pyramid, guesses.clone(), centred, comparison);
        self.may_be_elsewhere = fit.is_none();
        if let Some(another) = another.filter(|_| fit.is_none()) {
            fit = another.compare(pyramid, guesses, centred, comparison);
            if fit.is_some() {
                key = another;
            }
        }
        let Some(fit) = fit else {
            self.coast(key, luma, elapsed)?;
            return Ok(None);
        };
        self.coasted = Duration::ZERO;
        let Some(back) = key.to_last.inverse() else {
            self.key = Some(Key::first(luma, pyramid, grid)?);
            return Ok(None);
        };
        self.last = back.then(&fit.homography);
        let inliers = comparison.agreement.count();
        let motion = CameraMotion {
            homography: to_frame(&self.last, size),
            covariance: [
                fit.covariance[0] / (size.0 * size.0),
                fit.covariance[1] / (size.0 * size.1),
                fit.covariance[2] / (size.1 * size.1),
            ],
            inliers: u32::try_from(inliers).unwrap_or(u32::MAX),
        };
        self.key = Some(key.next(luma, pyramid, &fit, comparison)?);
        Ok(Some(motion))
    }

    /// How the camera was taken to have moved in the last picture, as it did before, normalised; `None` where its motion was seen, or has
    /// not been seen for too long.
    pub fn coasted(&self) -> Option<Homography> {
        let another = self.another.as_ref()?;
        Some(to_frame(&self.last, another.grid.size()))
    }

    /// Whether the last picture may show another view, which nothing that was seen before leads to.
    pub fn may_be_elsewhere(&self) -> bool {
        self.may_be_elsewhere
    }

    /// Goes on from the key picture as if the camera had moved on as it did: where the next picture fits, nothing is lost of the way. Where
    /// it fits this one, that shows another view. After a while there is no key picture any more.
    fn coast(&mut self, mut key: Key, luma: &Luma, elapsed: Duration) -> opencv::Result<()> {
        self.coasted = self.coasted.saturating_add(elapsed);
        if self.coasted > COAST {
            self.last = Homography::IDENTITY;
            return Ok(());
        }
        self.may_be_elsewhere = false;
        self.another = Some(Key::first(luma, &self.pyramid, key.grid)?);
        key.to_last = key.to_last.then(&self.last);
        self.key = Some(key);
        Ok(())
    }
}

impl Key {
    fn first(luma: &Luma, pyramid: &Pyramid, grid: Grid) -> opencv::Result<Self> {
        let mut corners = Vec::new();
        for cell in 0..grid.cells() {
            corners.extend(corners::best(luma, grid, cell)?);
        }
        let noise = corners::noise(&corners);
        let good = corners.iter().filter(|corner| corner.stands_out(noise));
        let points = good.map(|corner| Tracked::new(corner, pyramid, Template::default())).collect();
        Ok(Self { grid, points, to_last: Homography::IDENTITY, noise, spare: Vec::new() })
    }

    /// Whether most cells have a corner.
    fn is_full(&self) -> bool {
        2 * self.points.len() >= self.grid.cells()
    }

    /// Finds corners in some of the cells that are not `taken`.
    fn top_up(&mut self, luma: &Luma, pyramid: &Pyramid, taken: &[bool]) -> opencv::Result<()> {
        let grid = self.grid;
        // Another few each time: in some cells there is nothing to find.
        let free = (0..grid.cells()).filter(|cell| !taken[*cell]);
        let count = free.clone().count();
        let start = self.points.first().map_or(0, |point| point.place.x as usize) % count.max(1);
        for cell in free.cycle().skip(start).take(TOP_UP.min(count)) {
            let corner = corners::best(luma, grid, cell)?.filter(|corner| corner.stands_out(self.noise));
            if let Some(corner) = corner {
                let template = self.spare.pop().unwrap_or_default();
                self.points.push(Tracked::new(&corner, pyramid, template));
            }
        }
        Ok(())
    }

    /// Believes less in points that lie on what was foreground in the last picture.
    fn doubt(&mut self, foreground: &Luma) {
        for point in &mut self.points {
            let at = fit::apply(&self.to_last, point.place);
            let (x, y) = (at.x.round(), at.y.round());
            let inside =
                x >= 0.0 && y >= 0.0 && x < foreground.width() as f32 && y < foreground.height() as f32;
            if inside && foreground.row(y as usize)[x as usize] > 127 {
                point.weight = FOREGROUND_WEIGHT;
            }
        }
    }

    /// How the picture moved from this one to `pyramid`.
    fn compare(
        &self,
        pyramid: &Pyramid,
        guesses: impl Iterator<Item = Homography> + Clone,
        centred: Centred,
        Comparison { ends, pairs, agreement, .. }: &mut Comparison,
    ) -> Option<Fit> {
        let from_key = guesses.map(|motion| self.to_last.then(&motion));
        for guess in from_key.clone() {
            let found =
                |point: &Tracked| flow::follow(&point.template, pyramid, fit::apply(&guess, point.place));
            ends.clear();
            ends.extend(self.points.iter().map(found));
            pairs.clear();
            pairs.extend(self.points.iter().zip(&*ends).filter_map(|(point, end)| {
                Some(Pair { from: point.place, to: (*end)?, weight: point.weight })
            }));
            if let Some(fit) = fit::fit(pairs, from_key.clone(), centred, agreement) {
                return Some(fit);
            }
        }
        None
    }

    /// What the picture after this one is compared with.
    fn next(
        mut self,
        luma: &Luma,
        pyramid: &Pyramid,
        fit: &Fit,
        Comparison { ends, agreement, taken, .. }: &mut Comparison,
    ) -> opencv::Result<Self> {
        let found = self.points.iter_mut().zip(&*ends).filter(|(_, end)| end.is_some());
        for ((point, _), &agrees) in found.zip(&agreement.agrees) {
            point.weight += 0.3 * (f64::from(u8::from(agrees)) - point.weight);
        }
        let grid = self.grid;
        let near = travel(&fit.homography, grid) <= MAX_TRAVEL;
        if near && agreement.count() as f64 >= MIN_AGREEING * self.points.len() as f64 {
            self.to_last = fit.homography;
            return Ok(self);
        }
        taken.clear();
        taken.resize(grid.cells(), false);
        let (mut ends, mut agrees) = (ends.iter(), agreement.agrees.iter());
        let spare = &mut self.spare;
        self.points.retain_mut(|point| {
            let place = ends.next().copied().flatten();
            let agrees = place.is_some() && agrees.next().is_some_and(|agrees| *agrees);
            let cell = place.filter(|_| agrees).and_then(|place| Some((place, grid.cell(place)?)));
            let kept = cell.filter(|(_, cell)| !std::mem::replace(&mut taken[*cell], true));
            match kept {
                Some((place, _)) => {
                    point.place = place;
                    point.look(pyramid);
                }
                None => spare.push(std::mem::take(&mut point.template)),
            }
            kept.is_some()
        });
        self.to_last = Homography::IDENTITY;
        self.top_up(luma, pyramid, taken)?;
        Ok(self)
    }
}

/// How far a corner of the picture goes at most, pixels.
fn travel(homography: &Homography, grid: Grid) -> f64 {
    let (width, height) = grid.size();
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
    corners.map(|(x, y)| displacement(homography, Point { x, y })).into_iter().fold(0.0, f64::max)
}

/// A normalised motion as one of pixels, whose middles lie half a pixel inside.
pub(in crate::vision) fn to_pixels(motion: &Homography, (width, height): (f64, f64)) -> Homography {
    let scaled = motion.scaled(width, height);
    Homography::translation(0.5, 0.5).then(&scaled).then(&Homography::translation(-0.5, -0.5))
}

/// How far `motion` takes what is at `from`.
pub(in crate::vision) fn displacement(motion: &Homography, from: Point) -> f64 {
    let to = motion.apply(from);
    (to.x - from.x).hypot(to.y - from.y)
}

/// The way back.
fn to_frame(motion: &Homography, (width, height): (f64, f64)) -> Homography {
    let moved = Homography::translation(-0.5, -0.5).then(motion).then(&Homography::translation(0.5, 0.5));
    moved.scaled(1.0 / width, 1.0 / height)
}
