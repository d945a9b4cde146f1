//! One target: its box, its points, its looks, and one step of following it.

use opencv::core::{Point2f, Rect2f};

use super::appearance::Appearance;
use super::background::Background;
use super::corners::{self, Search};
use super::ego_motion::EgoMotion;
use super::flow::Flow;
use super::geometry::{Frame, around, centre, grown, in_ellipse, length, mean, scaled, share_inside};
use super::mean_shift::{GreyModel, near_the_middle};
use super::patch::{Cut, Patch};
use super::patience::Patience;
use super::points::{Consensus, Points};
use super::proof::MotionProof;
use super::selection::Sighting;
use super::steps::Steps;
use crate::vision::Luma;

/// Points followed at most: more cost time and add nothing to their median.
const MAX_POINTS: usize = 64;
/// New points are looked for when fewer than this share of them is left, every so many frames.
const REPLENISH_SHARE: f32 = 0.7;
const REPLENISH_FRAMES: u32 = 4;
/// With fewer points the target starts with new ones.
const MIN_MEMBERS: usize = 4;
/// Window for lost points in the second attempt; the pyramids are built for it.
const GROWN_WINDOW: i32 = 25;
/// Pixels of the patch that a target has at most: a larger one is looked at more coarsely.
const MAX_AREA: f32 = 40_000.0;
/// What is seen around the box, as a share of its sides, and at least, in pixels of the patch.
const MARGIN_SHARE: f32 = 0.3;
const MIN_MARGIN: f32 = 40.0;
/// Time constant of the smoothed velocity, seconds: a stride is longer.
const VELOCITY_TIME_S: f32 = 0.35;
/// Share of the usual peak of the appearance that says "this is it", "this may be it" and "found again".
const SURE: f32 = 0.55;
const POSSIBLE: f32 = 0.35;
const FOUND: f32 = 0.6;
/// How far from where it should be a target is looked for, in sides of it: next to it, and after it was hidden.
const SPREAD: f32 = 0.35;
const WIDE_SPREAD: f32 = 1.0;
/// How much larger or smaller a box is tried, by how much it must fit better, and what is then made of it.
const TRIED_GROWTH: f32 = 0.06;
const BETTER: f32 = 1.0;
const GROWTH_GAIN: f32 = 0.6;
/// Share of the usual peak from which the appearance is learned, and below which points that stop may lie
/// on something in front.
const LEARNT: f32 = 0.7;
const UNHIDDEN: f32 = 0.8;
/// Pixels in [`VELOCITY_TIME_S`] from which a target is moving; share of its velocity that is staying behind.
const MOVING: f32 = 3.0;
const STAYING: f32 = 0.4;
/// How far the box follows the appearance where points say otherwise.
const PULL: f32 = 0.4;
/// How fast the appearance learns, per second, and never more in one frame.
const LEARNING_PER_S: f32 = 0.4;
const MAX_LEARNING: f32 = 0.04;
/// Share of the points that must be found again for the points to be believed alone.
const BELIEVED_SHARE: f32 = 0.5;
/// Part of the box that must be in the picture.
const MIN_INSIDE: f32 = 0.35;
/// The box never grows or shrinks further than this from its first size.
const MAX_GROWTH: f32 = 2.5;

/// What one step saw of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sight {
    /// It was followed.
    Seen,
    /// It is hidden, or something else is in its place.
    Hidden,
    /// It is no longer in the picture.
    Gone,
}

/// A target that is followed. All pixels are of the frame.
pub(super) struct Target {
    pub bounds: Rect2f,
    pub centroid: Point2f,
    pub confidence: f32,
    pub points: Points,
    /// Motion against the background, pixels per second.
    pub own_velocity: Point2f,
    /// Motion of the background at the target, pixels per second; `None` where it could not be seen.
    pub ego_velocity: Option<Point2f>,
    pub proof: MotionProof,
    pub patience: Patience,
    steps: Steps,
    first_size: (f32, f32),
    patch: Patch,
    background: Background,
    ego: EgoMotion,
    greys: Option<GreyModel>,
    appearance: Appearance,
    usual_peak: f32,
    sightings_in_a_row: u32,
    sure: bool,
    /// What is done with the appearance in this frame.
    turn: u8,
    frames_since_replenished: u32,
}

impl Target {
    /// Takes up what was sighted. `None` where it has no point that could be followed.
    pub fn acquire(luma: &Luma, sighting: &Sighting, steps: Steps) -> opencv::Result<Option<Self>> {
        let bounds = sighting.bounds;
        let patch = Patch::cut(luma, cut_around(luma, bounds), GROWN_WINDOW)?;
        if patch.is_empty() {
            return Ok(None);
        }
        let body =
            if sighting.contour.len() >= 3 { sighting.contour.clone() } else { corners::ellipse(bounds) };
        let search = Search { contour: &body, taken: &[], count: MAX_POINTS, distance: spacing(bounds) };
        let found = corners::reject_outliers(corners::find(&patch, &search)?, steps.deviation_range);
        if found.kept.is_empty() {
            return Ok(None);
        }
        let greys = GreyModel::new(&patch, &found.kept, steps.background_weighted.then_some(bounds))?;
        let mut background = Background::default();
        background.remember(luma, bounds)?;
        let mut points = Points::on_target(found.kept);
        points.reject(found.rejected);
        let mut target = Self {
            bounds,
            centroid: centre(bounds),
            confidence: 1.0,
            points,
            own_velocity: sighting.velocity,
            ego_velocity: None,
            proof: MotionProof::new(false),
            patience: Patience::default(),
            steps,
            first_size: (bounds.width, bounds.height),
            patch,
            background,
            ego: EgoMotion::default(),
            greys,
            appearance: Appearance::new(luma, bounds)?,
            usual_peak: 0.6,
            sightings_in_a_row: 0,
            sure: true,
            turn: 0,
            frames_since_replenished: 0,
        };
        target.centroid = target.centre_of_mass()?;
        Ok(Some(target))
    }

    /// Follows the target into the next frame, `dt_s` later.
    pub fn follow(&mut self, luma: &Luma, dt_s: f32) -> opencv::Result<Sight> {
        self.watch_background(luma, dt_s)?;
        let expected = self.own_velocity * dt_s;
        let (next, consensus) = self.follow_points(luma, expected)?;
        let start = centre(self.bounds);
        let sight = if self.steps.appearance {
            self.weigh(luma, consensus, expected, dt_s)?
        } else {
            self.believe_points(consensus)
        };
        self.patch = next;
        self.settle(luma, start, dt_s, sight)
    }

    /// Keeps moving a hidden target as it moved, and looks for it there; `Seen` once it is back.
    pub fn coast(&mut self, luma: &Luma, dt_s: f32) -> opencv::Result<Sight> {
        self.watch_background(luma, dt_s)?;
        self.carry(self.own_velocity * dt_s);
        let sight = match self.search(luma)? {
            Some(offset) => {
                self.sightings_in_a_row += 1;
                self.bounds += offset;
                if self.sightings_in_a_row >= 2 { Sight::Seen } else { Sight::Hidden }
            }
            None => {
                self.sightings_in_a_row = 0;
                Sight::Hidden
            }
        };
        self.take_stock(luma)?;
        if sight == Sight::Seen {
            self.sightings_in_a_row = 0;
            self.seed()?;
        }
        self.centroid = centre(self.bounds);
        Ok(if self.is_gone(luma) { Sight::Gone } else { sight })
    }

    /// How the background moved into this frame; `None` where it could not be seen.
    pub fn ego(&self) -> Option<EgoMotion> {
        self.ego_velocity.map(|_| self.ego)
    }

    /// Whether a detection may be this target, hidden until now, and takes it up if so.
    pub fn recognise(&mut self, luma: &Luma, sighting: &Sighting) -> opencv::Result<bool> {
        let place = around(centre(sighting.bounds), self.bounds.width, self.bounds.height);
        // Before looking, which is dear: a crowd has a hundred sightings.
        if length(centre(place) - centre(self.bounds)) >= self.bounds.height {
            return Ok(false);
        }
        let answer = self.appearance.look(luma, place, WIDE_SPREAD)?;
        if answer.peak < FOUND * self.usual_peak {
            return Ok(false);
        }
        self.bounds = place + answer.offset;
        self.take_stock(luma)?;
        self.seed()?;
        Ok(true)
    }

    /// Estimates how the picture moved away from the target.
    fn watch_background(&mut self, luma: &Luma, dt_s: f32) -> opencv::Result<()> {
        self.ego_velocity = None;
        if !self.steps.ego_motion {
            self.ego = EgoMotion::default();
            return Ok(());
        }
        if let Some(ego) = self.background.motion(luma, self.ego)? {
            self.ego = ego;
            self.ego_velocity = Some(ego.at(centre(self.bounds)) / dt_s);
        }
        Ok(())
    }

    fn follow_points(
        &mut self,
        luma: &Luma,
        expected: Point2f,
    ) -> opencv::Result<(Patch, Option<Consensus>)> {
        let shift = self.ego.at(centre(self.bounds)) + expected;
        let next = Patch::cut(luma, self.patch.as_cut().moved(luma, shift), GROWN_WINDOW)?;
        let starts = self.points.positions();
        let guesses: Vec<Point2f> = starts.iter().map(|start| self.ego.apply(*start) + expected).collect();
        let flow = Flow {
            window: window_for(self.bounds, self.patch.step()),
            grown_window: GROWN_WINDOW,
            max_residual: self.steps.max_residual,
            max_return_error: self.steps.max_return_error,
        };
        let found = flow.follow(&self.patch, &next, &starts, &guesses)?;
        let consensus = if self.steps.consensus {
            self.points.advance(&found, self.ego, self.bounds.height)
        } else {
            self.points.average(&found)
        };
        Ok((next, consensus))
    }

    /// The thesis: where the points go the target is.
    fn believe_points(&mut self, consensus: Option<Consensus>) -> Sight {
        let Some(consensus) = consensus else { return Sight::Hidden };
        self.bounds += consensus.motion;
        self.confidence = consensus.share;
        Sight::Seen
    }

    /// Weighs what the points say against what the target looks like.
    fn weigh(
        &mut self,
        luma: &Luma,
        consensus: Option<Consensus>,
        expected: Point2f,
        dt_s: f32,
    ) -> opencv::Result<Sight> {
        let start = centre(self.bounds);
        let carried = self.ego.at(start) + expected;
        let stays =
            consensus.is_some_and(|consensus| self.stays_behind(consensus.motion - self.ego.at(start), dt_s));
        let hidden_behind = stays && {
            let answer = self.appearance.look(luma, self.bounds + carried, SPREAD)?;
            answer.peak < UNHIDDEN * self.usual_peak
        };
        let consensus = consensus.filter(|_| !hidden_behind);
        let share = consensus.map_or(0.0, |consensus| consensus.share);
        self.carry(expected);
        if let Some(consensus) = consensus {
            // The fewer points agree, the more counts where it was going.
            self.bounds += (consensus.motion - carried) * (share / BELIEVED_SHARE).min(1.0);
        }
        let answer = self.appearance.look(luma, self.bounds, SPREAD)?;
        let likeness = answer.peak / self.usual_peak;
        self.confidence = (0.5 * share + 0.5 * likeness.min(1.0)).clamp(0.0, 1.0);
        self.sure = likeness >= SURE;
        let believed = share >= BELIEVED_SHARE;
        if self.sure || (believed && likeness >= POSSIBLE) {
            self.bounds += answer.offset * if believed { PULL } else { 1.0 };
        }
        if likeness >= LEARNT {
            self.update_appearance(luma, answer.peak, dt_s)?;
        }
        let seen = self.sure || (believed && likeness >= POSSIBLE);
        Ok(if seen { Sight::Seen } else { Sight::Hidden })
    }

    /// Whether points that moved by `own` against the background stay behind the target: they lie on a post
    /// or a sign in front of it.
    fn stays_behind(&self, own: Point2f, dt_s: f32) -> bool {
        let usual = length(self.own_velocity);
        usual * VELOCITY_TIME_S > MOVING && length(own) < STAYING * usual * dt_s
    }

    /// Learns in one frame and tries another size in the next: each costs as much as looking for the target.
    fn update_appearance(&mut self, luma: &Luma, peak: f32, dt_s: f32) -> opencv::Result<()> {
        let rate = (LEARNING_PER_S * dt_s).min(MAX_LEARNING);
        self.usual_peak += (peak - self.usual_peak) * rate.max(0.02);
        self.turn = (self.turn + 1) % 4;
        match self.turn {
            1 => self.try_size(luma, 1.0 + TRIED_GROWTH, peak),
            3 => self.try_size(luma, 1.0 / (1.0 + TRIED_GROWTH), peak),
            _ => self.appearance.learn(luma, self.bounds, 2.0 * rate),
        }
    }

    fn try_size(&mut self, luma: &Luma, growth: f32, peak: f32) -> opencv::Result<()> {
        let other = self.appearance.look(luma, scaled(self.bounds, growth, growth), SPREAD)?;
        if other.peak > BETTER * peak {
            self.grow(1.0 + GROWTH_GAIN * (growth - 1.0));
        }
        Ok(())
    }

    /// What every frame ends with: velocity, centre of mass, and the pixels for the next frame.
    fn settle(&mut self, luma: &Luma, start: Point2f, dt_s: f32, sight: Sight) -> opencv::Result<Sight> {
        if self.is_gone(luma) {
            return Ok(Sight::Gone);
        }
        if sight == Sight::Hidden {
            self.sightings_in_a_row = 0;
            self.take_stock(luma)?;
            return Ok(sight);
        }
        let own = (centre(self.bounds) - start - self.ego.at(start)) / dt_s;
        if self.ego_velocity.is_some() {
            self.proof.watch(own * dt_s, dt_s, self.bounds);
        }
        if self.sure {
            self.own_velocity += (own - self.own_velocity) * (dt_s / (dt_s + VELOCITY_TIME_S));
        }
        if self.steps.recentre
            && let Some(middle) = mean(self.points.positions().into_iter())
        {
            self.bounds = around(middle, self.bounds.width, self.bounds.height);
        }
        self.take_stock(luma)?;
        self.centroid = self.centre_of_mass()?;
        if self.steps.replenish {
            let body = scaled(self.bounds, 1.2, 1.1);
            self.points.retain(|point| in_ellipse(body, point));
            self.replenish()?;
        }
        Ok(sight)
    }

    /// Remembers the pixels around the box for the next step.
    fn take_stock(&mut self, luma: &Luma) -> opencv::Result<()> {
        let wanted = cut_around(luma, self.bounds);
        if self.patch.as_cut() != wanted {
            self.patch = Patch::cut(luma, wanted, GROWN_WINDOW)?;
        }
        if self.steps.ego_motion {
            self.background.remember(luma, self.bounds)?;
        }
        Ok(())
    }

    fn centre_of_mass(&self) -> opencv::Result<Point2f> {
        let Some(greys) = &self.greys else { return Ok(centre(self.bounds)) };
        let mass = greys.centre_of_mass(&self.patch, self.bounds)?.unwrap_or_else(|| centre(self.bounds));
        Ok(near_the_middle(mass, self.bounds, self.steps.centroid_reach))
    }

    fn replenish(&mut self) -> opencv::Result<()> {
        self.frames_since_replenished += 1;
        if !self.sure {
            // What is there now may be whoever passes in front.
            return Ok(());
        }
        if self.points.members().len() < MIN_MEMBERS {
            // Too few to vouch for new ones; the appearance did.
            return self.seed();
        }
        let few = (self.points.len() as f32) < REPLENISH_SHARE * MAX_POINTS as f32;
        if few && self.frames_since_replenished >= REPLENISH_FRAMES {
            self.frames_since_replenished = 0;
            let corners = self.corners()?;
            self.points.propose(corners);
        }
        Ok(())
    }

    /// Starts with new points after the old ones were lost.
    fn seed(&mut self) -> opencv::Result<()> {
        self.points = Points::default();
        self.points = Points::on_target(self.corners()?);
        Ok(())
    }

    fn corners(&self) -> opencv::Result<Vec<Point2f>> {
        let body = corners::ellipse(scaled(self.bounds, 0.85, 0.95));
        let taken = self.points.positions();
        let count = MAX_POINTS.saturating_sub(taken.len());
        let search = Search { contour: &body, taken: &taken, count, distance: spacing(self.bounds) };
        corners::find(&self.patch, &search)
    }

    /// The best sure answer around the place where the target should be.
    fn search(&self, luma: &Luma) -> opencv::Result<Option<Point2f>> {
        let reach = 0.6 * self.bounds.width;
        let mut best: Option<(Point2f, f32)> = None;
        for sideways in [0.0, -reach, reach] {
            let shift = Point2f::new(sideways, 0.0);
            let answer = self.appearance.look(luma, self.bounds + shift, WIDE_SPREAD)?;
            if best.is_none_or(|(_, peak)| answer.peak > peak) {
                best = Some((shift + answer.offset, answer.peak));
            }
        }
        Ok(best.filter(|(_, peak)| *peak >= FOUND * self.usual_peak).map(|(offset, _)| offset))
    }

    /// Moves the box as the camera and its own velocity take it.
    fn carry(&mut self, own: Point2f) {
        let middle = centre(self.bounds);
        self.bounds += self.ego.at(middle) + own;
        self.grow(self.ego.scale());
    }

    fn grow(&mut self, growth: f32) {
        let (width, height) = self.first_size;
        let limit = |size: f32, first: f32| size.clamp(first / MAX_GROWTH, first * MAX_GROWTH);
        self.bounds = around(
            centre(self.bounds),
            limit(self.bounds.width * growth, width),
            limit(self.bounds.height * growth, height),
        );
    }

    fn is_gone(&self, luma: &Luma) -> bool {
        let frame = Frame { width: luma.width() as f32, height: luma.height() as f32 };
        share_inside(self.bounds, frame.bounds()) < MIN_INSIDE
    }
}

/// Where optical flow for a target looks: around it, at a step that bounds the number of pixels.
fn cut_around(luma: &Luma, bounds: Rect2f) -> Cut {
    let step = (bounds.area() / MAX_AREA).sqrt().round().max(1.0);
    let margin = (MARGIN_SHARE * bounds.width.max(bounds.height)).max(MIN_MARGIN * step);
    Cut::new(luma, grown(bounds, margin), step as usize)
}

/// A window that sees a part of the body, not the street on both sides of it.
fn window_for(bounds: Rect2f, step: usize) -> i32 {
    let side = bounds.width.min(bounds.height) / step as f32;
    2 * (side / 6.0).clamp(4.0, 8.0) as i32 + 1
}

/// Distance between points so that some sixty fit onto the target.
fn spacing(bounds: Rect2f) -> f32 {
    (bounds.area() / (2.0 * MAX_POINTS as f32)).sqrt().max(2.0)
}
