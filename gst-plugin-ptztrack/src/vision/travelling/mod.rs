// SPDX-License-Identifier: MPL-2.0

//! The background travels with the camera (Yi et al., Detection of Moving Objects with Non-stationary Cameras
//! in 5.8 ms, CVPR Workshops 2013): mean and spread (thesis 3.1, 3.2) of every pixel on a canvas somewhat larger
//! than the picture, and a map that says where on it the picture lies. The picture is laid on the canvas, not
//! the canvas on the picture, so that what is known is not resampled in every picture; where the canvas has to be laid anew, that is
//! done so that it stays sharp.

mod alignment;
mod another_view;
mod burned_in;
mod gain;
mod median;
mod model;
mod noise;
mod pooled;
mod registration;
mod rows;
mod samples;
mod warp;

use std::time::Duration;

use opencv::core::{Point as Pixel, Vector};
use ptztrack_contract::{Homography, Point, Rect};

use self::alignment::Alignment;
use self::burned_in::BurnedIn;
use self::median::Median;
pub use self::model::UNKNOWN;
use self::model::{Comparison, Model, Sampled, TICKS};
use self::noise::Noise;
use self::pooled::Pooled;
use self::registration::Registration;
use self::samples::Sample;
use self::warp::Warp;
use super::Luma;
use super::camera_motion::{displacement, to_pixels};
use super::contours::{Grid, nearest};
use super::picture::Reduced;

/// Pixels of the canvas around the picture: what leaves the picture for a moment is still known on return.
const MARGIN: usize = 32;
/// When the map bends the picture by more than this many pixels beyond a displacement, the canvas is laid anew.
const MAX_BEND: f64 = 10.0;
/// A camera that rests as long as this is looked at without resampling.
const REST: Duration = Duration::from_millis(300);
/// Displacement of a picture, in pixels, below which the camera rests.
const RESTS: f64 = 0.05;
/// Displacement from which it turns: less may be people who walk before one that rests.
const TURNS: f64 = 0.5;
/// A resting camera's picture may lie this far beside the canvas' pixels, in pixels.
const MAX_BLUR: f64 = 0.15;
/// Time constant of mean and spread.
const MEMORY: Duration = Duration::from_secs(4);
/// How long something must stay the same to become background.
const PATIENCE: Duration = Duration::from_secs(6);
/// Parts of a pixel by which a picture may lie beside the model: at rest, and turning.
const MISPLACED_AT_REST: f32 = 0.2;
const MISPLACED: f32 = 1.0;
/// What differs from the background counts so many times as much where the target is, as a fraction: somebody is expected there (Senior et
/// al., "Appearance models for occlusion handling", 2006).
const EXPECTED: (u16, u16) = (8, 5);
/// Foreground beyond this fraction of the picture is a new picture: lights, a cut.
const NEW_PICTURE: f64 = 0.6;

/// What is known of how a picture came to where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// All of it.
    Known,
    /// How it moved since the picture before, but not how that came there: it is laid where it fits what is known.
    Lost,
    /// Nothing.
    Unknown,
}

/// Tells foreground from background, whether the camera turns or not.
#[derive(Debug, Default)]
pub struct TravellingBackground {
    model: Model,
    noise: Noise,
    pooled: Pooled,
    alignment: Alignment,
    registration: Registration,
    burned_in: BurnedIn,
    /// From the canvas to the last picture, pixels.
    to_picture: Homography,
    rested: Duration,
    /// Where nothing is learned: in the last picture, normalised.
    held: Option<Rect>,
    size: (usize, usize),
    sampled: Sampled,
    forth: Warp,
    back: Warp,
    foreground: Vec<u8>,
    shown: Vec<u8>,
    /// Pixels of the last picture beside what was known of them.
    samples: Vec<Sample>,
    /// Memory for what they differ by.
    median: Median,
    /// Of the canvas onto another.
    anew: Warp,
}

impl TravellingBackground {
    /// How likely each pixel of the last picture is foreground: 0 for known background, 128 where nothing is known,
    /// 255 for what is surely not background; `None` before the first picture. More so where the target is. Neither smoothed nor cleaned.
    pub fn foreground(&self) -> Option<Luma<'_>> {
        (!self.foreground.is_empty()).then(|| Luma::packed(&self.foreground, self.size.0))
    }

    /// Mean luma of the background where the last picture shows it.
    pub fn mean(&self) -> Option<Luma<'_>> {
        (!self.shown.is_empty()).then(|| Luma::packed(&self.shown, self.size.0))
    }

    /// What lies in `bounds` (normalised, of the last picture) does not become background, however long it stands
    /// still. Holds until it is said again; it is carried along with the camera.
    pub fn protect(&mut self, bounds: Option<Rect>) {
        self.held = bounds;
    }

    /// Tells foreground from background in the next picture, to which the camera moved by `motion` (normalised), then learns from it.
    /// Where that is not known, the camera may still rest. A picture whose `way` is not
    /// known may show another view.
    pub fn update(
        &mut self,
        picture: &Reduced,
        motion: Option<&Homography>,
        way: Way,
        elapsed: Duration,
    ) -> opencv::Result<()> {
        if picture.size() != self.size {
            *self = Self { size: picture.size(), ..Self::default() };
        }
        if self.size.0 == 0 || self.size.1 == 0 {
            return Ok(());
        }
        if self.model.size == (0, 0) {
            self.start();
        }
        let travel = motion.map_or(0.0, |motion| self.move_by(motion, elapsed));
        let rests = motion.is_none() || self.rested > REST;
        self.stay_on_canvas()?;
        let how = comparison(rests, elapsed);
        self.lay_luma(picture);
        self.heed_light();
        if travel >= TURNS && way != Way::Lost {
            self.align(picture);
        }
        self.lay_chroma(picture);
        self.compare(how);
        let stale = self.changed() > NEW_PICTURE || way != Way::Known && self.shows_another_view();
        if stale {
            self.start();
            self.lay(picture);
            self.compare(how);
        }
        if way == Way::Lost && !stale {
            self.register(picture, how)?;
        }
        let held = self.held_on_canvas();
        let expected = self.pooled.look(&self.model, &self.sampled, self.forth.spans(), rests, held);
        if self.rested > REST {
            self.model.note_noise(&self.sampled, self.forth.spans(), &mut self.noise);
        }
        // Only of the target it is known that they are somebody; whatever else is faint may be a shadow, and is learned.
        if expected.is_some() {
            self.pooled.mark(&mut self.model, expected);
        }
        self.model.learn(&self.sampled, self.forth.spans(), how, held);
        self.pooled.mark(&mut self.model, None);
        self.show();
        self.expect_target();
        self.forget_burned_in(&picture.luma(), travel);
        Ok(())
    }

    /// Lays a picture where it fits what is known best, if less than half as much of it is foreground then.
    fn register(&mut self, picture: &Reduced, how: Comparison) -> opencv::Result<()> {
        let off = self.registration.offset(&self.model, &self.sampled, self.forth.spans())?;
        let Some(off) = off else { return Ok(()) };
        let (thought, changed) = (self.to_picture, self.changed());
        self.lay_at(off.then(&thought), picture, how);
        if self.changed() < changed / 2.0 {
            self.rested = Duration::ZERO;
        } else {
            self.lay_at(thought, picture, how);
        }
        Ok(())
    }

    /// Lays the luma of a picture, which is laid on the canvas already, where it fits what is known to parts of a pixel.
    fn align(&mut self, picture: &Reduced) {
        let held = self.held_on_canvas();
        if let Some(step) = self.alignment.step(&self.model, &self.sampled, self.forth.spans(), held) {
            self.to_picture = step.then(&self.to_picture);
            self.lay_luma(picture);
        }
    }

    /// Lays the picture there on the canvas and holds it against what is known.
    fn lay_at(&mut self, to_picture: Homography, picture: &Reduced, how: Comparison) {
        self.to_picture = to_picture;
        self.lay(picture);
        self.compare(how);
    }

    /// Makes what has stayed the same for a moment within `contour` (normalised, in the last picture) background, protected
    /// or not: nobody is there.
    pub fn adopt(&mut self, contour: &[Point]) -> opencv::Result<()> {
        match self.on_canvas(contour) {
            Some(polygon) => self.model.adopt_within(&polygon),
            None => Ok(()),
        }
    }

    /// Makes the background within `contour` (normalised, in the last picture) as light as the last picture is there, but for what is
    /// protected.
    pub fn relight(&mut self, contour: &[Point]) -> opencv::Result<()> {
        let held = self.held_on_canvas();
        match self.on_canvas(contour) {
            Some(polygon) => self.model.relight_within(&polygon, &self.sampled, held),
            None => Ok(()),
        }
    }

    /// Where nothing is learned, pixels of the canvas.
    fn held_on_canvas(&self) -> Option<Rect> {
        self.held.map(|held| canvas_box(held, self.size, &self.to_picture))
    }

    /// A polygon of the last picture (normalised) in pixels of the canvas.
    fn on_canvas(&self, contour: &[Point]) -> Option<Vector<Pixel>> {
        let to_canvas = self.to_picture.inverse()?;
        let grid = Grid { width: self.size.0 as f64, height: self.size.1 as f64 };
        Some(contour.iter().map(|point| nearest(to_canvas.apply(grid.place(point)))).collect())
    }

    /// A canvas of which nothing is known.
    fn start(&mut self) {
        self.model = Model::new((self.size.0 + 2 * MARGIN, self.size.1 + 2 * MARGIN));
        self.to_picture = Homography::translation(-(MARGIN as f64), -(MARGIN as f64));
        self.rested = Duration::ZERO;
    }

    /// Finds where the next picture lies on the canvas; by how many pixels its middle moved.
    fn move_by(&mut self, motion: &Homography, elapsed: Duration) -> f64 {
        let size = (self.size.0 as f64, self.size.1 as f64);
        let step = to_pixels(motion, size);
        let travel = displacement(&step, Point { x: size.0 / 2.0, y: size.1 / 2.0 });
        self.to_picture = self.to_picture.then(&step);
        self.rested = if travel < RESTS { self.rested.saturating_add(elapsed) } else { Duration::ZERO };
        self.held = self.held.map(|held| moved(held, motion));
        travel
    }

    /// Lays the canvas anew where the picture no longer fits it.
    fn stay_on_canvas(&mut self) -> opencv::Result<()> {
        let margin = MARGIN as f64;
        let (shift, bend) = shift_and_bend(&self.to_picture, self.model.size);
        let off = (shift.0 + margin, shift.1 + margin);
        let between = (shift.0 - shift.0.round()).abs().max((shift.1 - shift.1.round()).abs());
        let blurred = self.rested > REST && bend.max(between) > MAX_BLUR;
        if bend > MAX_BEND || blurred {
            let wanted = Homography::translation(-margin, -margin);
            match self.to_picture.inverse() {
                Some(back) => self.lay_anew(&wanted.then(&back), wanted)?,
                None => self.start(),
            }
        } else if off.0.abs().max(off.1.abs()) + bend > margin - 2.0 {
            // By whole pixels: nothing is resampled.
            let to_old = Homography::translation(-off.0.round(), -off.1.round());
            self.lay_anew(&to_old, to_old.then(&self.to_picture))?;
        }
        Ok(())
    }

    /// Goes over to another canvas, whose pixels lie on the old one where `to_old` says.
    fn lay_anew(&mut self, to_old: &Homography, to_picture: Homography) -> opencv::Result<()> {
        self.anew.prepare(self.model.size, self.model.size, to_old);
        self.model.carry(&self.anew)?;
        self.to_picture = to_picture;
        Ok(())
    }

    /// Lays the picture on the canvas.
    fn lay(&mut self, picture: &Reduced) {
        self.lay_luma(picture);
        self.lay_chroma(picture);
    }

    fn lay_luma(&mut self, picture: &Reduced) {
        self.forth.prepare(self.model.size, self.size, &self.to_picture);
        self.forth.sample(picture.luma().bytes(), 0, &mut self.sampled.luma);
    }

    /// Where its luma lies.
    fn lay_chroma(&mut self, picture: &Reduced) {
        self.sampled.chroma = picture.chroma().map(|planes| {
            let mut sampled = self.sampled.chroma.take().unwrap_or_default();
            for (plane, out) in planes.iter().zip(&mut sampled) {
                self.forth.sample(plane.bytes(), 128, out);
            }
            sampled
        });
    }

    /// Whether the picture shows none of what is known where it should lie.
    fn shows_another_view(&mut self) -> bool {
        self.sample();
        another_view::is_another_view(&self.samples, &self.noise)
    }

    /// Makes what is known as light as the picture.
    fn heed_light(&mut self) {
        self.sample();
        self.model.relight(gain::light_gain(&self.samples, &mut self.median));
    }

    /// Takes pixels all over the picture beside what is known of them.
    fn sample(&mut self) {
        let Model { luma, age, .. } = &self.model;
        samples::take(&self.sampled.luma, luma, age, self.forth.spans(), &mut self.samples);
    }

    /// Holds the picture on the canvas against what is known.
    fn compare(&mut self, how: Comparison) {
        self.model.survey(self.forth.spans());
        self.model.compare(&self.sampled, self.forth.spans(), how, &self.noise);
    }

    /// Which fraction of what is known is foreground.
    fn changed(&self) -> f64 {
        let (mut known, mut changed) = (1_u32, 0_u32);
        for (y, &(start, end)) in self.forth.spans().iter().enumerate() {
            let row = &self.model.likelihood[y * self.model.size.0..][start..end];
            let (some, foreground) = rows::count(row);
            (known, changed) = (known + some, changed + foreground);
        }
        f64::from(changed) / f64::from(known)
    }

    /// Makes likelier foreground of what differs from the background where the target is.
    fn expect_target(&mut self) {
        let (width, height) = self.size;
        let Some(held) = self.held.map(|held| in_pixels(held, (width as f64, height as f64))) else { return };
        let within = |from: f64, length: f64, size: usize| {
            let place = |at: f64| at.clamp(0.0, size as f64) as usize;
            place(from)..place(from + length.max(0.0))
        };
        let (columns, rows) = (within(held.x, held.width, width), within(held.y, held.height, height));
        for row in self.foreground.chunks_exact_mut(width).take(rows.end).skip(rows.start) {
            rows::expect(&mut row[columns.clone()], EXPECTED);
        }
    }

    /// Takes out of the foreground what stays put in the picture while the world moves.
    fn forget_burned_in(&mut self, luma: &Luma, travel: f64) {
        let held = self.held.map(|held| in_pixels(held, (self.size.0 as f64, self.size.1 as f64)));
        self.burned_in.update(luma, &self.foreground, travel, held);
        self.burned_in.clear(&mut self.foreground);
    }

    /// Leaves likelihood and mean as they lie in the picture.
    fn show(&mut self) {
        let Some(back) = self.to_picture.inverse() else { return };
        self.back.prepare(self.size, self.model.size, &back);
        self.back.sample(&self.model.likelihood, UNKNOWN, &mut self.foreground);
        self.back.sample(&self.model.shown, 0, &mut self.shown);
    }
}

/// How a picture is held against what is known, `elapsed` after the last, by a camera that `rests` or turns.
fn comparison(rests: bool, elapsed: Duration) -> Comparison {
    let ticks = |time: Duration| (time.as_secs_f64() * TICKS).round().clamp(1.0, 255.0) as u8;
    Comparison {
        misplaced: if rests { MISPLACED_AT_REST } else { MISPLACED },
        min_weight: (elapsed.as_secs_f64() / MEMORY.as_secs_f64()).min(1.0) as f32,
        ticks: ticks(elapsed),
        patience: ticks(PATIENCE),
    }
}

/// The displacement of the canvas' middle, and how far its corners go beyond that.
fn shift_and_bend(map: &Homography, size: (usize, usize)) -> ((f64, f64), f64) {
    let (width, height) = (size.0 as f64, size.1 as f64);
    let shift = |x: f64, y: f64| {
        let to = map.apply(Point { x, y });
        (to.x - x, to.y - y)
    };
    let middle = shift(width / 2.0, height / 2.0);
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
    let bend = corners.map(|(x, y)| {
        let corner = shift(x, y);
        (corner.0 - middle.0).hypot(corner.1 - middle.1)
    });
    (middle, bend.into_iter().fold(0.0, f64::max))
}

/// A box after the camera moved.
pub fn moved(bounds: Rect, motion: &Homography) -> Rect {
    let first = motion.apply(Point { x: bounds.x, y: bounds.y });
    let last = motion.apply(Point { x: bounds.x + bounds.width, y: bounds.y + bounds.height });
    Rect { x: first.x, y: first.y, width: last.x - first.x, height: last.y - first.y }
}

/// A normalised box in pixels.
fn in_pixels(bounds: Rect, (width, height): (f64, f64)) -> Rect {
    Rect {
        x: bounds.x * width,
        y: bounds.y * height,
        width: bounds.width * width,
        height: bounds.height * height,
    }
}

/// Where a box of the picture (normalised) lies on the canvas, pixels.
fn canvas_box(bounds: Rect, size: (usize, usize), to_picture: &Homography) -> Rect {
    let pixels = in_pixels(bounds, (size.0 as f64, size.1 as f64));
    to_picture.inverse().map_or(pixels, |back| moved(pixels, &back))
}

#[cfg(test)]
mod tests;
