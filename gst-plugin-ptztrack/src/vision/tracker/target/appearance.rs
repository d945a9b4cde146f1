// SPDX-License-Identifier: MPL-2.0

//! What a target looks like: silhouette, colours of figure and ground, and the correlation filter; and where, by all of them, it is.

use opencv::core::{Point2f, Rect2f};

use super::usual::Usual;
use crate::vision::Observation;
use crate::vision::tracker::colour::ColourModel;
use crate::vision::tracker::correlation_filter::{CorrelationFilter, Response, vertex};
use crate::vision::tracker::figure::{Cells, Evidence, FigureMap, Grid, Halves, Looks, Shape, Template};

/// Cells of the map of figure and ground in one of the filter's, across and down.
const FINER: usize = 2;
/// How far around its expected place the target is looked for in one picture, cells of the filter.
const REACH: i32 = 4;
/// More than a silhouette ever fits, which is 1 but for rounding.
const BEST_FIT: f32 = 1.001;
/// How fast what the target looks like is learned, per second, and never more at once; how often, seconds.
const LEARNING_PER_S: f32 = 0.8;
const MAX_LEARNING: f32 = 0.15;
const LEARNING_EVERY_S: f32 = 0.07;
/// The ground beside the target changes as fast as the camera turns.
const GROUND_LEARNING_PER_S: f32 = 4.0;
/// Logarithm of the odds that what moves beside other people is the target, and the seconds in which their going adds 1 to it.
const ALONE_BESIDE_OTHERS: f32 = 0.5;
const OTHERS_TIME_S: f32 = 2.0;

/// The best place of the target around a box.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub bounds: Rect2f,
    fit: Halves,
    response: Halves,
    /// Share of what is usually seen of the target.
    pub share: f32,
}

/// What a target looks like.
pub(super) struct Appearance {
    filter: CorrelationFilter,
    grid: Grid,
    shape: Shape,
    colours: Option<ColourModel>,
    /// Figure and ground in the last picture.
    map: FigureMap,
    usual: Usual,
    /// Since somebody else was near.
    alone_s: f32,
    /// Since something was learned.
    learned_s: f32,
    /// Where the cells of `memory`, and what the filter has a description of, lie, if that is in the picture that is looked at: the
    /// target is mostly where it was expected, and nothing there is worked out twice.
    looked_at: Option<Rect2f>,
    described: Option<Rect2f>,
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
}

impl Appearance {
    /// Of a target in `bounds`.
    pub fn new(seen: &Observation, bounds: Rect2f) -> opencv::Result<Self> {
        let filter = CorrelationFilter::new(bounds)?;
        let grid = Grid { columns: filter.grid().columns * FINER, rows: filter.grid().rows * FINER };
        let shape = Shape::upright(grid);
        let cells = Cells::observe(seen, bounds, grid);
        let map = FigureMap::new(&cells, &cells.evidence(None), &shape);
        let mut colours = None;
        if let ([Some(upper), Some(lower)], Some(ground)) = cells.histograms(&map) {
            colours = Some(ColourModel::new([upper, lower], ground));
        }
        let mut appearance = Self {
            filter,
            grid,
            shape,
            colours,
            map,
            usual: Usual::at_first(Halves::default()),
            alone_s: f32::INFINITY,
            learned_s: 0.0,
            looked_at: None,
            described: None,
            memory: Memory::default(),
        };
        appearance.look_closely(seen, bounds);
        let fit = appearance.shape.template().fit(&appearance.memory.evidence, (0, 0));
        appearance.usual = Usual::at_first(fit);
        appearance.learn_filter(seen, bounds, 1.0)?;
        Ok(appearance)
    }

    /// Figure and ground as they were when it was last looked at closely.
    pub fn map(&self) -> &FigureMap {
        &self.map
    }

    /// Goes on to the next picture, in which somebody else may be near: one who was seen beside the target may be behind it, or it
    /// behind them, a moment later.
    pub fn watch_others(&mut self, near: bool, dt_s: f32) {
        (self.looked_at, self.described) = (None, None);
        self.alone_s = if near { 0.0 } else { self.alone_s + dt_s };
        self.learned_s += dt_s;
    }

    /// Looks around a box: cells, their evidence, and the map of figure and ground.
    pub fn look_closely(&mut self, seen: &Observation, bounds: Rect2f) {
        self.look_at(seen, bounds);
        let Memory { cells, evidence, .. } = &self.memory;
        self.map.draw(cells, evidence, &self.shape);
    }

    /// Looks around a box: cells and their evidence.
    fn look_at(&mut self, seen: &Observation, bounds: Rect2f) {
        if self.looked_at.replace(bounds) == Some(bounds) {
            return;
        }
        let Memory { cells, evidence, .. } = &mut self.memory;
        cells.look(seen, bounds, self.grid);
        let alone = ALONE_BESIDE_OTHERS + self.alone_s / OTHERS_TIME_S;
        cells.weigh(self.colours.as_ref().map(|colours| Looks { colours, alone }), evidence);
    }

    /// The best place near `bounds`, expected in its middle with a deviation of `spread` times its sides.
    pub fn locate(&mut self, seen: &Observation, bounds: Rect2f, spread: f32) -> opencv::Result<Place> {
        self.look_at(seen, bounds);
        self.describe(seen, bounds)?;
        self.filter.respond(&mut self.memory.response)?;
        self.shape.cut(&mut self.memory.template);
        let Memory { cells, evidence, template, response, .. } = &self.memory;
        let cell = cells.cell() * FINER as f32;
        let (across, down) = (spread * bounds.width / cell.x, spread * bounds.height / cell.y);
        let chance = |(x, y): (i32, i32)| {
            let (u, v) = (x as f32 / across, y as f32 / down);
            (-0.5 * (u * u + v * v)).exp()
        };
        let score =
            |place| (self.looks(response, place) + silhouette(template, evidence, place)) * chance(place);
        // Where even a silhouette that fits could not make up for the looks, it need not be held against what is seen.
        let least = score((0, 0));
        let is_possible =
            |place: &(i32, i32)| (self.looks(response, *place) + BEST_FIT) * chance(*place) >= least;
        let places = (-REACH..=REACH).flat_map(|y| (-REACH..=REACH).map(move |x| (x, y)));
        let (mut best, mut height) = ((0, 0), f32::NEG_INFINITY);
        for place in places.filter(is_possible) {
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
        let fit = template.fit(evidence, moved);
        let answer = response.at(best);
        let share = self.usual.share(fit, answer);
        Ok(Place { bounds: bounds + offset, fit, response: answer, share })
    }

    /// What the filter says of a displacement in cells of it.
    fn looks(&self, response: &Response, place: (i32, i32)) -> f32 {
        (0.5 * response.at(place).sum() / self.usual.response()).max(0.0)
    }

    /// Has the filter describe what is in `bounds`.
    fn describe(&mut self, seen: &Observation, bounds: Rect2f) -> opencv::Result<()> {
        if self.described != Some(bounds) {
            self.filter.describe(&seen.luma, bounds)?;
            self.described = Some(bounds);
        }
        Ok(())
    }

    /// Learns looks, silhouette and colours as they are in `bounds`, which was looked at closely: `place` is what was seen there.
    pub fn learn(&mut self, seen: &Observation, bounds: Rect2f, place: &Place) -> opencv::Result<()> {
        if self.learned_s < LEARNING_EVERY_S {
            return Ok(());
        }
        let rate = (LEARNING_PER_S * self.learned_s).min(MAX_LEARNING);
        let ground_rate = (GROUND_LEARNING_PER_S * self.learned_s).min(0.5);
        self.learned_s = 0.0;
        self.usual.learn(place.fit, place.response, rate);
        self.shape.learn(&self.map, rate);
        let (figure, ground) = self.memory.cells.histograms(&self.map);
        match (&mut self.colours, &figure, &ground) {
            (Some(colours), ..) => colours.learn(figure, rate, ground, ground_rate),
            (None, [Some(upper), Some(lower)], Some(ground)) => {
                self.colours = Some(ColourModel::new([upper.clone(), lower.clone()], ground.clone()));
            }
            _ => (),
        }
        self.learn_filter(seen, bounds, rate)
    }

    /// Has the filter learn the figure.
    fn learn_filter(&mut self, seen: &Observation, bounds: Rect2f, rate: f32) -> opencv::Result<()> {
        self.describe(seen, bounds)?;
        self.map.reduce(FINER, &mut self.memory.figure);
        self.filter.learn(&self.memory.figure, rate)
    }
}

/// What the silhouette says of a displacement in cells of the filter.
fn silhouette(template: &Template, evidence: &Evidence, (x, y): (i32, i32)) -> f32 {
    template.fit(evidence, (x * FINER as i32, y * FINER as i32)).mean().max(0.0)
}
