// SPDX-License-Identifier: MPL-2.0

//! A target followed by all that tells it from the wall: motion against the background, colour, silhouette, the
//! correlation filter, and the points that lie on its figure.

use opencv::core::{Point2f, Rect2f};

use super::course::Course;
use super::usual::{Usual, of_whole};
use super::{Estimate, Follow, GROWN_WINDOW, MAX_POINTS, Sight, YOUNG_S, is_gone, spacing, window_for};
use crate::vision::tracker::colour::ColourModel;
use crate::vision::tracker::corners::{self, Search};
use crate::vision::tracker::correlation_filter::{CorrelationFilter, Response, vertex};
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::figure::{
    CONTEXT, Cells, Evidence, FigureMap, Grid, Halves, Level, Looks, Shape, Template,
};
use crate::vision::tracker::flow::{Flow, Followed};
use crate::vision::tracker::geometry::{around, centre, in_ellipse, length, overlap, scaled};
use crate::vision::tracker::grey_histogram::near_the_middle;
use crate::vision::tracker::patch::{Patch, cut_around};
use crate::vision::tracker::points::{Consensus, Points};
use crate::vision::tracker::policy::{Owner, Sighting};
use crate::vision::tracker::presence::Presence;
use crate::vision::{Luma, Observation};

/// Cells of the map of figure and ground in one of the filter's, across and down.
const FINER: usize = 2;
/// How far around its expected place the target is looked for in one picture, cells of the filter.
const REACH: i32 = 4;
/// Deviation of the target from there, in sides of it: where the points agree, and where nothing but its motion tells.
const SPREAD: f32 = 0.2;
const WIDE_SPREAD: f32 = 0.6;
/// Grey levels of mean absolute difference from which a point is lost, and pixels it may be off going forth and back.
const MAX_RESIDUAL: f32 = 25.0;
const MAX_RETURN_ERROR: f32 = 0.8;
/// Share of the points that must agree for them to be believed alone.
const BELIEVED_SHARE: f32 = 0.5;
/// New points are looked for when fewer than this share of them is left, every so many pictures.
const REPLENISH_SHARE: f32 = 0.7;
const REPLENISH_PICTURES: u32 = 4;
/// With fewer points the target starts with new ones.
const MIN_MEMBERS: usize = 4;
/// How likely a corner must lie on the figure to be followed.
const ON_FIGURE: f32 = 0.6;
/// Share of what is usually seen of the target from which it is learned, and found again after it was hidden.
const LEARNT: f32 = 0.7;
const FOUND: f32 = 0.65;
/// How fast what the target looks like is learned, per second, and never more in one picture.
const LEARNING_PER_S: f32 = 0.8;
const MAX_LEARNING: f32 = 0.08;
/// The ground beside the target changes as fast as the camera turns.
const GROUND_LEARNING_PER_S: f32 = 4.0;
/// Nobody changes their velocity faster than this, in heights of them per second squared: about 7 m/s².
const ACCELERATION: f32 = 4.0;
/// Deviation of the points' motion, pixels and shares of the height: limbs swing.
const POINT_NOISE: (f32, f32) = (1.0, 0.015);
/// Time constant of the smoothed velocity, seconds: a stride is longer.
const VELOCITY_TIME_S: f32 = 0.35;
/// Time constant of a hidden silhouette's correction of where the points say that the target is, seconds: they drift slowly.
const CORRECTION_TIME_S: f32 = 0.12;
/// How much the points lead where nothing of the target is hidden, and the missing share of what is usually seen of it from
/// which they lead alone.
const POINTS_LEAD: f32 = 0.5;
const CLEARLY_HIDDEN: f32 = 0.1;
/// How much larger or smaller a box is tried, and what is then made of it.
const TRIED_GROWTH: f32 = 0.06;
const GROWTH_GAIN: f32 = 0.5;
/// How far a side of the box goes outwards in one picture where there is figure beyond it, in sizes of the box.
const WIDENING: f32 = 0.03;
/// By its looks the box never grows or shrinks further than this from the size that the detector last gave it.
const MAX_GROWTH: f32 = 4.0;
/// How much of that it adopts in one picture.
const ADOPTED: f32 = 0.3;
/// How far the centre of mass may lie from the middle of the box, as a share of its sides.
const CENTROID_REACH: f32 = 0.15;
/// How far, in heights of it, a target that is not seen may be from where its last motion took it: at once, and farther with
/// every second, as somebody may turn or run.
const UNSEEN_REACH: (f32, f32) = (0.5, 2.3);
/// Deviation within that of whoever need not look like it.
const UNSEEN_SPREAD: (f32, f32) = (0.15, 1.5);
/// Logarithm of the odds that what moves beside other people is the target, and the seconds in which their going adds 1 to it.
const ALONE_BESIDE_OTHERS: f32 = 0.5;
const OTHERS_TIME_S: f32 = 2.0;
/// Time after somebody else was near from which the target is rather alone, seconds.
const ALONE_TIME_S: f32 = 4.0;
/// How much of the width and height of the target a region has that shows all of it.
const WHOLE: f32 = 0.7;
/// Intersection over union with what is somebody else's from which nothing is learned.
const SHARED: f32 = 0.15;
/// Time over which the track gives the size of the box, seconds.
const STRIDE_S: f32 = 1.0;
/// How alike in colour whoever goes somewhere must be to a hidden target.
const ALIKE: f32 = 0.6;
/// Of a silhouette of which nothing is known yet.
const EVEN: Level =
    Level { figure: Halves { upper: 0.5, lower: 0.5 }, moving: Halves { upper: 0.0, lower: 0.0 } };
/// Pictures in a row in which a hidden target must be seen.
const SEEN_AGAIN: u32 = 2;

/// The best place of the target around a box.
#[derive(Debug, Clone, Copy)]
struct Place {
    bounds: Rect2f,
    fit: Halves,
    level: Level,
    response: Halves,
    /// Share of what is usually seen of either half of the target.
    shares: Halves,
    /// Of the whole target.
    share: f32,
}

impl Place {
    /// Whether nothing hides a half of the body: only then is there something to learn.
    fn is_unhidden(&self) -> bool {
        self.shares.upper.min(self.shares.lower) >= FOUND
    }
}

/// A target followed by all cues.
pub(in super::super) struct Robust {
    estimate: Estimate,
    points: Points,
    patch: Patch,
    filter: CorrelationFilter,
    grid: Grid,
    shape: Shape,
    colours: Option<ColourModel>,
    /// Figure and ground in the last picture.
    map: FigureMap,
    usual: Usual,
    presence: Presence,
    course: Course,
    ego: EgoMotion,
    measured_size: (f32, f32),
    age_s: f32,
    unseen_s: f32,
    /// Since somebody else was near.
    alone_s: f32,
    seen_in_a_row: u32,
    pictures: u32,
    pictures_since_replenished: u32,
    followed: Followed,
    memory: Memory,
}

/// What is worked out of one picture, kept as memory for the next.
#[derive(Default)]
struct Memory {
    cells: Cells,
    evidence: Evidence,
    template: Template,
    response: Response,
    /// The map of figure and ground in the filter's cells.
    figure: Vec<f32>,
    taken: Vec<Point2f>,
    corners: Vec<Point2f>,
}

impl Robust {
    /// Takes up what was sighted; `None` where it has no corner.
    pub fn acquire(seen: &Observation, sighting: &Sighting) -> opencv::Result<Option<Self>> {
        let bounds = sighting.bounds;
        let patch = Patch::cut(&seen.luma, cut_around(&seen.luma, bounds), GROWN_WINDOW)?;
        if patch.is_empty() {
            return Ok(None);
        }
        let filter = CorrelationFilter::new(bounds)?;
        let grid = Grid { columns: filter.grid().columns * FINER, rows: filter.grid().rows * FINER };
        let shape = Shape::upright(grid);
        let cells = Cells::observe(seen, bounds, grid);
        let map = FigureMap::new(&cells, &cells.evidence(None), &shape);
        let mut target = Self {
            estimate: Estimate {
                bounds,
                centroid: centre(bounds),
                confidence: 1.0,
                own_velocity: sighting.velocity,
                ego_velocity: None,
            },
            points: Points::default(),
            patch,
            filter,
            grid,
            shape,
            colours: None,
            map,
            usual: Usual::at_first(Halves::default(), Level::default()),
            presence: Presence::default(),
            course: Course { middle: centre(bounds), velocity: sighting.velocity },
            ego: EgoMotion::default(),
            measured_size: (bounds.width, bounds.height),
            age_s: 0.0,
            unseen_s: 0.0,
            alone_s: f32::INFINITY,
            seen_in_a_row: 0,
            pictures: 0,
            pictures_since_replenished: 0,
            followed: Followed::default(),
            memory: Memory::default(),
        };
        if let ([Some(upper), Some(lower)], Some(ground)) = cells.histograms(&target.map) {
            target.colours = Some(ColourModel::new([upper, lower], ground));
        }
        target.look_closely(seen);
        let fit = target.shape.template(1.0).fit(&target.memory.evidence, (0, 0));
        let level = target.shape.level(&target.memory.evidence, (0, 0), EVEN);
        target.usual = Usual::at_first(fit, level);
        target.learn_looks(seen, 1.0)?;
        target.find_corners()?;
        let found = corners::reject_outliers(std::mem::take(&mut target.memory.corners), 2.0);
        target.points = Points::on_target(found.kept);
        target.points.reject(found.rejected);
        Ok((target.points.len() > 0).then_some(target))
    }

    /// Looks around the box as it is now: cells, their evidence, and the map of figure and ground.
    fn look_closely(&mut self, seen: &Observation) {
        self.look_at(seen, self.estimate.bounds);
        let Memory { cells, evidence, .. } = &self.memory;
        self.map.draw(cells, evidence, &self.shape);
    }

    /// Looks around a box: cells and their evidence.
    fn look_at(&mut self, seen: &Observation, bounds: Rect2f) {
        self.memory.cells.look(seen, bounds, self.grid);
        let mut evidence = std::mem::take(&mut self.memory.evidence);
        self.memory.cells.weigh(self.looks(), &mut evidence);
        self.memory.evidence = evidence;
    }

    /// Has the filter learn the figure.
    fn learn_looks(&mut self, seen: &Observation, rate: f32) -> opencv::Result<()> {
        self.map.reduce(FINER, &mut self.memory.figure);
        self.filter.learn(&seen.luma, self.estimate.bounds, &self.memory.figure, rate)
    }

    fn watch_background(&mut self, seen: &Observation, dt_s: f32) {
        let ego = EgoMotion::of(seen);
        self.ego = ego.unwrap_or_default();
        self.estimate.ego_velocity = ego.map(|ego| ego.at(centre(self.estimate.bounds)) / dt_s);
        self.age_s += dt_s;
        self.pictures += 1;
    }

    /// Notices who else is near: one who was seen beside the target may be behind it, or it behind them, a moment later.
    fn watch_others(&mut self, sightings: &[Sighting], dt_s: f32) {
        let reach = scaled(self.estimate.bounds, CONTEXT.0, CONTEXT.1);
        let near =
            sightings.iter().any(|one| one.owner == Owner::Another && (one.bounds & reach).area() > 0.0);
        self.alone_s = if near { 0.0 } else { self.alone_s + dt_s };
    }

    /// How likely it is that nobody else is near, 0 to 1.
    fn alone(&self) -> f32 {
        1.0 - (-self.alone_s / ALONE_TIME_S).exp()
    }

    /// What its looks are, and how likely it is that what moves around it is nobody else.
    fn looks(&self) -> Option<Looks<'_>> {
        let alone = ALONE_BESIDE_OTHERS + self.alone_s / OTHERS_TIME_S;
        self.colours.as_ref().map(|colours| Looks { colours, alone })
    }

    fn follow_points(
        &mut self,
        luma: &Luma,
        expected: Point2f,
    ) -> opencv::Result<(Patch, Option<Consensus>)> {
        let bounds = self.estimate.bounds;
        let shift = self.ego.at(centre(bounds)) + expected;
        let next = Patch::cut(luma, self.patch.as_cut().moved(luma, shift), GROWN_WINDOW)?;
        let ego = self.ego;
        self.followed.begin(self.points.positions().map(|start| (start, ego.apply(start) + expected)));
        let flow = Flow {
            window: window_for(bounds, self.patch.step()),
            grown_window: GROWN_WINDOW,
            max_residual: MAX_RESIDUAL,
            max_return_error: Some(MAX_RETURN_ERROR),
        };
        flow.follow(&self.patch, &next, &mut self.followed)?;
        let (map, found) = (&self.map, &self.followed.found);
        let consensus = self.points.advance(found, ego, expected, bounds.height, |point| map.at(point));
        Ok((next, consensus))
    }

    /// The best place near `bounds`, expected in its middle with a deviation of `spread` times its sides.
    fn locate(&mut self, seen: &Observation, bounds: Rect2f, spread: f32) -> opencv::Result<Place> {
        self.look_at(seen, bounds);
        self.filter.respond(&seen.luma, bounds, &mut self.memory.response)?;
        self.shape.cut(1.0, &mut self.memory.template);
        let Memory { cells, evidence, template: silhouette, response, .. } = &self.memory;
        let cell = cells.cell() * FINER as f32;
        let (across, down) = (spread * bounds.width / cell.x, spread * bounds.height / cell.y);
        let score = |(x, y): (i32, i32)| {
            let (u, v) = (x as f32 / across, y as f32 / down);
            self.agreement(silhouette, evidence, response, (x, y)) * (-0.5 * (u * u + v * v)).exp()
        };
        let places = (-REACH..=REACH).flat_map(|y| (-REACH..=REACH).map(move |x| (x, y)));
        let (mut best, mut height) = ((0, 0), f32::NEG_INFINITY);
        for place in places {
            let value = score(place);
            if value > height {
                (best, height) = (place, value);
            }
        }
        let (x, y) = best;
        let finer = Point2f::new(
            vertex(score((x - 1, y)), height, score((x + 1, y))),
            vertex(score((x, y - 1)), height, score((x, y + 1))),
        );
        let offset = Point2f::new((x as f32 + finer.x) * cell.x, (y as f32 + finer.y) * cell.y);
        let moved = (x * FINER as i32, y * FINER as i32);
        let fit = silhouette.fit(evidence, moved);
        let answer = response.at(best);
        let level = self.shape.level(evidence, moved, self.usual.level());
        let shares = self.usual.shares(fit, level, answer, self.alone());
        Ok(Place { bounds: bounds + offset, fit, level, response: answer, shares, share: of_whole(shares) })
    }

    /// What filter and silhouette say together of a displacement in cells of the filter.
    fn agreement(
        &self,
        silhouette: &Template,
        evidence: &Evidence,
        response: &Response,
        (x, y): (i32, i32),
    ) -> f32 {
        let moved = (x * FINER as i32, y * FINER as i32);
        let looks = 0.5 * response.at((x, y)).sum() / self.usual.response();
        looks.max(0.0) + silhouette.fit(evidence, moved).mean().max(0.0)
    }

    /// Its course by what is seen of it now.
    fn measured(&self) -> Course {
        Course { middle: centre(self.estimate.bounds), velocity: self.estimate.own_velocity }
    }

    fn learn_velocity(&mut self, own: Point2f, dt_s: f32) {
        self.estimate.own_velocity += (own - self.estimate.own_velocity) * (dt_s / (dt_s + VELOCITY_TIME_S));
    }

    /// Takes a place over as the target's own.
    fn settle(
        &mut self,
        seen: &Observation,
        place: &Place,
        sightings: &[Sighting],
        dt_s: f32,
    ) -> opencv::Result<()> {
        self.estimate.bounds = place.bounds;
        self.look_closely(seen);
        // Who is seen whole and alone is learned however they look: who turns round looks new.
        let is_own = self.is_whole(sightings);
        if is_own || (place.is_unhidden() && !self.is_shared(sightings)) {
            self.learn(seen, place, dt_s)?;
        }
        self.remember(&seen.luma)?;
        let bounds = self.estimate.bounds;
        let mass = self.map.centre_of_mass(bounds).unwrap_or_else(|| centre(bounds));
        self.estimate.centroid = near_the_middle(mass, bounds, CENTROID_REACH);
        let body = scaled(bounds, 1.2, 1.1);
        self.points.retain(|point| in_ellipse(body, point));
        self.replenish(place.share >= LEARNT)
    }

    /// Learns looks, silhouette and colours as they are now, and tries another size.
    fn learn(&mut self, seen: &Observation, place: &Place, dt_s: f32) -> opencv::Result<()> {
        let rate = (LEARNING_PER_S * dt_s).min(MAX_LEARNING);
        self.usual.learn(place.fit, place.level, place.response, rate);
        self.widen(self.memory.evidence.beyond());
        self.shape.learn(&self.map, rate);
        let (figure, ground) = self.memory.cells.histograms(&self.map);
        let ground_rate = (GROUND_LEARNING_PER_S * dt_s).min(0.5);
        match (&mut self.colours, &figure, &ground) {
            (Some(colours), ..) => colours.learn(figure, rate, ground, ground_rate),
            (None, [Some(upper), Some(lower)], Some(ground)) => {
                self.colours = Some(ColourModel::new([upper.clone(), lower.clone()], ground.clone()));
            }
            _ => (),
        }
        match self.pictures % 4 {
            1 => self.try_size(seen, 1.0 + TRIED_GROWTH),
            3 => self.try_size(seen, 1.0 / (1.0 + TRIED_GROWTH)),
            _ => self.learn_looks(seen, 2.0 * rate),
        }
    }

    fn try_size(&mut self, seen: &Observation, growth: f32) -> opencv::Result<()> {
        let bounds = self.estimate.bounds;
        let Memory { evidence, template, response, .. } = &mut self.memory;
        let mut respond = |bounds| {
            let answered = self.filter.respond(&seen.luma, bounds, response);
            answered.map(|()| response.at((0, 0)).sum())
        };
        let (now, other) = (respond(bounds)?, respond(scaled(bounds, growth, growth))?);
        let mut fit = |scale| {
            self.shape.cut(scale, template);
            template.fit(evidence, (0, 0)).mean()
        };
        let usual = self.usual.response();
        if other / usual + fit(growth) > now / usual + fit(1.0) {
            self.grow(1.0 + GROWTH_GAIN * (growth - 1.0));
        }
        Ok(())
    }

    /// Moves the sides outwards beyond which there is figure too: the detector may have seen only a part of the target.
    fn widen(&mut self, beyond: [f32; 4]) {
        let bounds = self.estimate.bounds;
        let step = |probability: f32, size: f32| if probability >= ON_FIGURE { WIDENING * size } else { 0.0 };
        let [left, top, right, bottom] = beyond;
        let (left, right) = (step(left, bounds.width), step(right, bounds.width));
        let (top, bottom) = (step(top, bounds.height), step(bottom, bounds.height));
        self.estimate.bounds = Rect2f::new(
            bounds.x - left,
            bounds.y - top,
            bounds.width + left + right,
            bounds.height + top + bottom,
        );
        self.grow(1.0);
    }

    /// Keeps the pixels around the box for the next picture.
    fn remember(&mut self, luma: &Luma) -> opencv::Result<()> {
        let wanted = cut_around(luma, self.estimate.bounds);
        if !self.patch.as_cut().serves(&wanted) {
            self.patch = Patch::cut(luma, wanted, GROWN_WINDOW)?;
        }
        Ok(())
    }

    fn replenish(&mut self, sure: bool) -> opencv::Result<()> {
        self.pictures_since_replenished += 1;
        if !sure {
            // What is there now may be whoever passes in front.
            return Ok(());
        }
        if self.points.members().count() < MIN_MEMBERS {
            return self.seed();
        }
        let few = (self.points.len() as f32) < REPLENISH_SHARE * MAX_POINTS as f32;
        if few && self.pictures_since_replenished >= REPLENISH_PICTURES {
            self.pictures_since_replenished = 0;
            self.find_corners()?;
            self.points.propose(self.memory.corners.drain(..));
        }
        Ok(())
    }

    /// Starts with new points after the old ones were lost.
    fn seed(&mut self) -> opencv::Result<()> {
        self.points = Points::default();
        self.find_corners()?;
        self.points = Points::on_target(self.memory.corners.drain(..));
        Ok(())
    }

    /// Finds corners on the figure.
    fn find_corners(&mut self) -> opencv::Result<()> {
        let bounds = self.estimate.bounds;
        let body = corners::ellipse(scaled(bounds, 0.95, 1.0));
        let Memory { taken, corners, .. } = &mut self.memory;
        taken.clear();
        taken.extend(self.points.positions());
        let count = MAX_POINTS.saturating_sub(taken.len());
        let search = Search { contour: &body, taken, count, distance: spacing(bounds) };
        corners::find(&self.patch, &search, corners)?;
        corners.retain(|corner| self.map.at(*corner) >= ON_FIGURE);
        Ok(())
    }

    /// Moves the box as the camera and its own velocity take it.
    fn carry(&mut self, own: Point2f) {
        let middle = centre(self.estimate.bounds);
        self.estimate.bounds += self.ego.at(middle) + own;
        self.grow(self.ego.scale_at(middle));
    }

    fn grow(&mut self, growth: f32) {
        let bounds = self.estimate.bounds;
        let limit = |size: f32, first: f32| size.clamp(first / MAX_GROWTH, first * MAX_GROWTH);
        self.estimate.bounds = around(
            centre(bounds),
            limit(bounds.width * growth, self.measured_size.0),
            limit(bounds.height * growth, self.measured_size.1),
        );
    }

    /// The box takes the size of the target's track where that is seen alone; by how much its middle shifts, which is no motion of the
    /// target.
    fn adopt(&mut self, sightings: &[Sighting], dt_s: f32) -> Point2f {
        let Some(track) = self.own_region(sightings) else { return Point2f::default() };
        let bounds = self.estimate.bounds;
        let middle = centre(bounds);
        // Young, it is still finding its size.
        let rate = if self.age_s < YOUNG_S { ADOPTED } else { dt_s / (dt_s + STRIDE_S) };
        let shift = (centre(track) - middle) * rate;
        let mix = |old: f32, new: f32| old + (new - old) * rate;
        let size = (mix(bounds.width, track.width), mix(bounds.height, track.height));
        self.estimate.bounds = around(middle + shift, size.0, size.1);
        self.measured_size = size;
        shift
    }

    /// Whether what is seen in the box is also somebody else's: nothing is learned of it then.
    fn is_shared(&self, sightings: &[Sighting]) -> bool {
        sightings.iter().any(|sighting| {
            matches!(sighting.owner, Owner::Several | Owner::Another)
                && overlap(sighting.bounds, self.estimate.bounds) > SHARED
        })
    }

    /// Whether the box shows the target's track, all of it and nobody else.
    fn is_whole(&self, sightings: &[Sighting]) -> bool {
        sightings.iter().any(|sighting| {
            sighting.owner == Owner::Target
                && sighting.is_whole
                && overlap(sighting.bounds, self.estimate.bounds) >= WHOLE
        })
    }

    /// The region that the detector sees the target in, and nobody else.
    fn own_region(&self, sightings: &[Sighting]) -> Option<Rect2f> {
        sightings.iter().find(|sighting| sighting.owner == Owner::Target).map(|sighting| sighting.bounds)
    }

    /// The best of what the detector saw within reach that looks like the target.
    fn recognise(&mut self, seen: &Observation, sightings: &[Sighting]) -> opencv::Result<Option<Place>> {
        let mut best: Option<Place> = None;
        for sighting in sightings.iter().filter(|sighting| sighting.owner != Owner::Another) {
            let bounds = self.box_in(sighting);
            if self.distance_in(bounds, UNSEEN_REACH) > 1.0 {
                continue;
            }
            // Half hidden or turned it may look unlike what the filter knows; colours, motion and place must do.
            let place = self.locate(seen, bounds, WIDE_SPREAD)?;
            let shares = self
                .usual
                .silhouette(place.fit)
                .with(self.usual.stands_out(place.level, self.alone()), |fit, stands_out| fit * stands_out);
            let by_looks = Place { share: of_whole(shares), ..place };
            let by_colours = self.by_colours(sighting, bounds, place);
            let most = by_colours.map_or(by_looks.share, |by_colours| by_colours.share.max(by_looks.share));
            if most < best.map_or(FOUND, |best| best.share) {
                continue;
            }
            // In a crowd there is always somebody who fits: who is farther away must have the target's colours.
            let found = if !self.resembles(seen, sighting) {
                Place { share: by_looks.share * self.likely_at(place.bounds), ..place }
            } else {
                by_colours.filter(|by_colours| by_colours.share > by_looks.share).unwrap_or(by_looks)
            };
            if found.share >= FOUND && best.is_none_or(|best| found.share > best.share) {
                best = Some(found);
            }
        }
        Ok(best)
    }

    /// Whether who was sighted has the target's colours.
    fn resembles(&self, seen: &Observation, sighting: &Sighting) -> bool {
        let Some(colours) = &self.colours else { return false };
        let cells = Cells::observe(seen, sighting.bounds, self.grid);
        let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(self.grid));
        let (figure, _) = cells.histograms(&map);
        colours.likeness(&figure) >= ALIKE
    }

    /// Somebody in the target's colours, where it is expected and nobody else is near, is the target, however it turned: all of
    /// it, or, while it is hidden, the part that comes out again.
    /// Takes the target's box in the region, and the best `place` there.
    fn by_colours(&self, sighting: &Sighting, mut bounds: Rect2f, place: Place) -> Option<Place> {
        let region = sighting.bounds;
        let whole = region.width > WHOLE * bounds.width && region.height > WHOLE * bounds.height;
        if !whole && self.presence.is_here() {
            return None;
        }
        if whole && sighting.owner != Owner::Several {
            let mix = |old: f32, new: f32| old + (new - old) * ADOPTED;
            let (width, height) = (mix(bounds.width, region.width), mix(bounds.height, region.height));
            bounds = around(centre(region), width, height);
        }
        Some(Place { bounds, share: self.likely_at(bounds) * self.alone(), ..place })
    }

    /// The target's box in a region, which may show a part of it only or somebody else too: as near to where it is
    /// expected as the region allows, heads level unless there are several.
    fn box_in(&self, sighting: &Sighting) -> Rect2f {
        let region = sighting.bounds;
        let bounds = self.estimate.bounds;
        let middle = centre(bounds);
        let x = middle.x.clamp(region.x, region.x + region.width);
        let y = if region.height > WHOLE * bounds.height && sighting.owner != Owner::Several {
            region.y + bounds.height / 2.0
        } else {
            middle.y.clamp(region.y, region.y + region.height)
        };
        around(Point2f::new(x, y), bounds.width, bounds.height)
    }

    /// How far a place is from where an unseen target is expected, beside a distance (`UNSEEN_REACH`, `UNSEEN_SPREAD`) that
    /// grows while it is not seen.
    fn distance_in(&self, place: Rect2f, (at_once, per_s): (f32, f32)) -> f32 {
        let bounds = self.estimate.bounds;
        length(centre(place) - centre(bounds)) / (bounds.height * (at_once + per_s * self.unseen_s))
    }

    /// How likely it has come to a place since it was seen, beside where it is expected: 0 to 1.
    fn likely_at(&self, place: Rect2f) -> f32 {
        let off = self.distance_in(place, UNSEEN_SPREAD);
        (-0.5 * off * off).exp()
    }

    /// The best place where a hidden target may be by now.
    fn search(&mut self, seen: &Observation, sightings: &[Sighting]) -> opencv::Result<Option<Place>> {
        let bounds = self.estimate.bounds;
        let mut best = self.recognise(seen, sightings)?;
        for sideways in [0.0, -0.6, 0.6] {
            let place = bounds + Point2f::new(sideways * bounds.width, 0.0);
            let place = self.locate(seen, place, WIDE_SPREAD)?;
            if place.share >= LEARNT && best.is_none_or(|best| place.share > best.share) {
                best = Some(place);
            }
        }
        Ok(best)
    }
}

impl Follow for Robust {
    fn follow(&mut self, seen: &Observation, dt_s: f32, sightings: &[Sighting]) -> opencv::Result<Sight> {
        self.watch_background(seen, dt_s);
        self.watch_others(sightings, dt_s);
        let expected = self.estimate.own_velocity * dt_s;
        let (next, consensus) = self.follow_points(&seen.luma, expected)?;
        let start = centre(self.estimate.bounds);
        let carried = self.ego.at(start) + expected;
        self.carry(expected);
        let trust = consensus.map_or(0.0, |consensus| {
            // Points on whoever passes in front agree too; but no person turns so quickly.
            let height = self.estimate.bounds.height;
            let deviation = POINT_NOISE.0 + POINT_NOISE.1 * height + ACCELERATION * height * dt_s * dt_s;
            let innovation = length(consensus.motion - carried) / deviation;
            (consensus.share / BELIEVED_SHARE).min(1.0) * (-0.125 * innovation * innovation).exp()
        });
        if let Some(consensus) = consensus {
            // The fewer points agree, the more counts where it was going.
            self.estimate.bounds += (consensus.motion - carried) * trust;
        }
        self.patch = next;
        let by_points = (consensus.map_or(carried, |consensus| consensus.motion) - self.ego.at(start)) / dt_s;
        let start = start + self.adopt(sightings, dt_s);
        let spread = WIDE_SPREAD + (SPREAD - WIDE_SPREAD) * trust;
        let mut place = self.locate(seen, self.estimate.bounds, spread)?;
        self.unseen_s = if place.share < FOUND { self.unseen_s + dt_s } else { 0.0 };
        if place.share < FOUND
            && let Some(beside) = self.recognise(seen, sightings)?
        {
            place = beside;
        }
        // The less is seen of it, the more counts where it was going.
        let gain = ((place.share - FOUND / 2.0) / (LEARNT - FOUND / 2.0)).clamp(0.0, 1.0);
        // A silhouette that is hidden on one side seems to stay behind; the points on what is left of it do not.
        let hidden = ((1.0 - place.share) / CLEARLY_HIDDEN).clamp(0.0, 1.0);
        let lead = trust * hidden.max(POINTS_LEAD);
        let correction = 1.0 + (dt_s / (dt_s + CORRECTION_TIME_S) - 1.0) * lead;
        let predicted = self.estimate.bounds;
        place.bounds = predicted + (centre(place.bounds) - centre(predicted)) * (gain * correction);
        self.presence.update(place.share, dt_s);
        self.estimate.confidence = self.presence.confidence() * place.share.min(1.0);
        self.course.go_on(self.ego, dt_s);
        if !self.presence.is_here() {
            self.seen_in_a_row = 0;
            let bounds = self.estimate.bounds;
            self.estimate.bounds = around(self.course.middle, bounds.width, bounds.height);
            self.estimate.own_velocity = self.course.velocity;
            self.remember(&seen.luma)?;
            self.estimate.centroid = centre(self.estimate.bounds);
            return Ok(if is_gone(self.estimate.bounds, &seen.luma) { Sight::Gone } else { Sight::Hidden });
        }
        if place.share >= LEARNT {
            let by_places = (centre(place.bounds) - start - self.ego.at(start)) / dt_s;
            self.learn_velocity(by_places + (by_points - by_places) * lead, dt_s);
        }
        self.settle(seen, &place, sightings, dt_s)?;
        self.course.correct(self.measured(), (1.0 - hidden).max(trust));
        Ok(if is_gone(self.estimate.bounds, &seen.luma) { Sight::Gone } else { Sight::Seen })
    }

    fn coast(&mut self, seen: &Observation, dt_s: f32, sightings: &[Sighting]) -> opencv::Result<Sight> {
        self.watch_background(seen, dt_s);
        self.watch_others(sightings, dt_s);
        self.unseen_s += dt_s;
        self.carry(self.estimate.own_velocity * dt_s);
        let found = self.search(seen, sightings)?;
        self.seen_in_a_row = if found.is_some() { self.seen_in_a_row + 1 } else { 0 };
        if let Some(place) = found {
            self.estimate.bounds = place.bounds;
        }
        self.estimate.centroid = centre(self.estimate.bounds);
        self.remember(&seen.luma)?;
        if is_gone(self.estimate.bounds, &seen.luma) {
            return Ok(Sight::Gone);
        }
        if self.seen_in_a_row < SEEN_AGAIN {
            return Ok(Sight::Hidden);
        }
        self.presence = Presence::default();
        self.unseen_s = 0.0;
        self.course = self.measured();
        self.look_closely(seen);
        self.seed()?;
        Ok(Sight::Seen)
    }

    fn expect(&mut self, bounds: Rect2f, velocity: Point2f) {
        self.estimate.bounds = bounds;
        self.estimate.own_velocity = velocity;
        self.estimate.centroid = centre(bounds);
        self.course = self.measured();
    }

    fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    fn points(&self) -> &Points {
        &self.points
    }
}
