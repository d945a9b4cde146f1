// SPDX-License-Identifier: MPL-2.0

//! What a target looks like: silhouette, colours of figure and ground, and greys; and where, by all of them, it is.

use opencv::core::{Point2f, Rect2f};

use super::robust::FAINT;
use crate::vision::Observation;
use crate::vision::tracker::colour::ColourModel;
use crate::vision::tracker::figure::{
    CONTEXT, Cells, Evidence, FigureMap, GreyTemplate, Grid, Halves, Looks, Shape, Template,
};

/// Cells of the grid around a target, more or less, whatever its size.
const CELLS: f32 = 2048.0;
/// How far around its expected place the target is looked for in one picture, and in which steps, cells.
const REACH: i32 = 8;
const STEP: usize = 2;
/// What is taken for a usual fit and a usual correlation at least.
const LEAST_FIT: f32 = 0.02;
const LEAST_CORRELATION: f32 = 0.1;
/// Correlation with anybody, as a share of the usual one.
const ANYBODY: f32 = 0.35;
/// What a correlation of 1 weighs beside the fit of the silhouette where it is asked whether the target is there, and where it is.
const CORRELATION_WEIGHT: f32 = 0.1;
const PLACE_WEIGHT: f32 = 0.5;
/// Share of what usually stands out of the target below which nothing of it is there.
const OUTSTANDING: f32 = 0.3;
/// More than silhouette and greys ever come to together: 1 and their weight, and a hundredth for rounding.
const BEST_SCORE: f32 = 1.01 * (1.0 + PLACE_WEIGHT);
/// How fast what the target looks like is learned, per second, and never more at once; how often, seconds.
const LEARNING_PER_S: f32 = 0.8;
const MAX_LEARNING: f32 = 0.15;
const LEARNING_EVERY_S: f32 = 0.07;
/// Logarithm of the odds that what moves beside other people is the target, and the seconds in which their going adds 1 to it.
const ALONE_BESIDE_OTHERS: f32 = 0.5;
const OTHERS_TIME_S: f32 = 2.0;

/// The best place of the target around a box.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub bounds: Rect2f,
    /// How well the silhouette fits there, and the greys correlate.
    fit: Halves,
    correlation: Option<f32>,
    /// Both as a share of what is usual, from 0 to about 1.
    pub share: f32,
}

/// What a target looks like.
pub(super) struct Appearance {
    grid: Grid,
    shape: Shape,
    colours: Option<ColourModel>,
    greys: GreyTemplate,
    /// Figure and ground in the last picture.
    map: FigureMap,
    /// How well the silhouette usually fits, and the greys correlate: only beside that does what is seen now say whether the target is
    /// there.
    usual_fit: Halves,
    usual_correlation: f32,
    /// How much of it usually stands out from the background, 0 to 1, once that was seen.
    usually_stands_out: Option<f32>,
    /// Since somebody else was near.
    alone_s: f32,
    /// Since something was learned.
    learned_s: f32,
    /// Where the cells of `memory` lie, if that is in the picture that is looked at: the target is mostly where it was expected, and
    /// nothing there is worked out twice.
    looked_at: Option<Rect2f>,
    memory: Memory,
}

/// What is worked out of one picture, kept as memory for the next.
#[derive(Default)]
struct Memory {
    cells: Cells,
    evidence: Evidence,
    template: Template,
}

impl Appearance {
    /// Of a target in `bounds`.
    pub fn new(seen: &Observation, bounds: Rect2f) -> Self {
        let grid = grid_for(bounds);
        let shape = Shape::upright(grid);
        let cells = Cells::observe(seen, bounds, grid);
        let map = FigureMap::new(&cells, &cells.evidence(None), &shape);
        let mut colours = None;
        if let ([Some(upper), Some(lower)], Some(ground)) = cells.histograms(&map) {
            colours = Some(ColourModel::new([upper, lower], ground));
        }
        let mut appearance = Self {
            grid,
            shape,
            colours,
            map,
            greys: GreyTemplate::default(),
            usual_fit: Halves::default(),
            usual_correlation: 1.0,
            usually_stands_out: None,
            alone_s: f32::INFINITY,
            learned_s: 0.0,
            looked_at: None,
            memory: Memory::default(),
        };
        appearance.look_closely(seen, bounds);
        let fit = appearance.shape.template().fit(&appearance.memory.evidence, (0, 0));
        appearance.usual_fit = fit.with(fit, |fit, _| fit.max(LEAST_FIT));
        appearance.greys.learn(&appearance.memory.cells, &appearance.map, 1.0);
        appearance
    }

    /// Figure and ground as they were when it was last looked at closely.
    pub fn map(&self) -> &FigureMap {
        &self.map
    }

    /// Goes on to the next picture, in which somebody else may be near: one who was seen beside the target may be behind it, or it
    /// behind them, a moment later.
    pub fn pass(&mut self, is_another_near: bool, dt_s: f32) {
        self.looked_at = None;
        self.alone_s = if is_another_near { 0.0 } else { self.alone_s + dt_s };
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
    pub fn locate(&mut self, seen: &Observation, bounds: Rect2f, spread: f32) -> Place {
        self.look_at(seen, bounds);
        self.shape.cut(&mut self.memory.template);
        let Memory { cells, evidence, template } = &self.memory;
        let cell = cells.cell();
        let (across, down) = (spread * bounds.width / cell.x, spread * bounds.height / cell.y);
        let chance = |(x, y): (i32, i32)| {
            let (u, v) = (x as f32 / across, y as f32 / down);
            (-0.5 * (u * u + v * v)).exp()
        };
        let likeness = |place| {
            let looks = PLACE_WEIGHT * self.greys.correlation(cells, place).unwrap_or_default();
            let silhouette = template.fit(evidence, place).mean();
            let both = looks.max(0.0) + silhouette.max(0.0);
            debug_assert!(both <= BEST_SCORE, "{looks} and {silhouette}");
            both
        };
        let score = |place| likeness(place) * chance(place);
        let steps = || (-REACH..=REACH).step_by(STEP);
        let (mut best, mut height) = ((0, 0), score((0, 0)));
        for place in steps().flat_map(|y| steps().map(move |x| (x, y))) {
            let chance = chance(place);
            // Where the best that could be seen would be less, there is nothing to look for.
            if BEST_SCORE * chance <= height {
                continue;
            }
            let value = likeness(place) * chance;
            if value > height {
                (best, height) = (place, value);
            }
        }
        let ((x, y), step) = (best, STEP as i32);
        let finer = Point2f::new(
            vertex(score((x - step, y)), height, score((x + step, y))),
            vertex(score((x, y - step)), height, score((x, y + step))),
        ) * STEP as f32;
        let offset = Point2f::new((x as f32 + finer.x) * cell.x, (y as f32 + finer.y) * cell.y);
        let fit = template.fit(evidence, best);
        let correlation = self.greys.correlation(cells, best);
        Place { bounds: bounds + offset, fit, correlation, share: self.share(fit, correlation) }
    }

    /// Share of what is usual. Both must speak for it: somebody else stands out as well, and the wall may look like anybody. The one that
    /// usually says more counts for more; where there is nothing to correlate, the silhouette alone.
    fn share(&self, fit: Halves, correlation: Option<f32>) -> f32 {
        // What hides one half takes nothing from the other.
        let silhouette = fit.with(self.usual_fit, |fit, usual| (fit / usual).clamp(0.0, 1.2)).mean();
        let Some(correlation) = correlation else { return silhouette };
        let looks = ((correlation / self.usual_correlation - ANYBODY) / (1.0 - ANYBODY)).clamp(0.0, 1.2);
        let usual = self.usual_fit.mean();
        let weight = usual / (usual + CORRELATION_WEIGHT * self.usual_correlation);
        silhouette.powf(weight) * looks.powf(1.0 - weight)
    }

    /// How much of what is in its place must stand out from the background for that to be the target, 0 to 1: the rest is wall that looks
    /// like it. Who never stood out need not.
    pub fn least_outstanding(&self) -> f32 {
        (OUTSTANDING * self.usually_stands_out.unwrap_or_default()).min(FAINT)
    }

    /// Learns silhouette, colours and greys as they are in the box that was looked at closely: `place` is what was seen there, of which so
    /// much `stands_out` from the background where that is known.
    pub fn learn(&mut self, place: &Place, stands_out: Option<f32>) {
        if self.learned_s < LEARNING_EVERY_S {
            return;
        }
        let rate = (LEARNING_PER_S * self.learned_s).min(MAX_LEARNING);
        self.learned_s = 0.0;
        let learned = |least: f32| move |usual: f32, seen: f32| (usual + (seen - usual) * rate).max(least);
        self.usual_fit = self.usual_fit.with(place.fit, learned(LEAST_FIT));
        if let Some(share) = stands_out {
            let usual = self.usually_stands_out.unwrap_or(share);
            self.usually_stands_out = Some(learned(0.0)(usual, share));
        }
        if let Some(correlation) = place.correlation {
            self.usual_correlation = learned(LEAST_CORRELATION)(self.usual_correlation, correlation);
        }
        self.shape.learn(&self.map, rate);
        self.greys.learn(&self.memory.cells, &self.map, rate);
        let (figure, ground) = self.memory.cells.histograms(&self.map);
        match (&mut self.colours, &figure, &ground) {
            (Some(colours), ..) => colours.learn(figure, ground, rate),
            (None, [Some(upper), Some(lower)], Some(ground)) => {
                self.colours = Some(ColourModel::new([upper.clone(), lower.clone()], ground.clone()));
            }
            _ => (),
        }
    }
}

/// Columns and rows of cells around a target of that shape: multiples of two steps.
fn grid_for(bounds: Rect2f) -> Grid {
    let aspect = (bounds.width * CONTEXT.0 / (bounds.height * CONTEXT.1).max(1.0)).clamp(0.2, 5.0);
    let unit = 2 * STEP;
    let whole = |cells: f32| unit * (cells / unit as f32).round() as usize;
    Grid { columns: whole((CELLS * aspect).sqrt()), rows: whole((CELLS / aspect).sqrt()) }
}

/// Where the parabola through three neighbouring values peaks, -0.5 to 0.5 from the middle one.
fn vertex(before: f32, middle: f32, after: f32) -> f32 {
    let curvature = before - 2.0 * middle + after;
    if curvature < -1e-6 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::robust::FOUND;
    use super::*;
    use crate::vision::tracker::geometry::{centre, length};
    use crate::vision::tracker::synthetic::{Picture, Scene};
    use proptest::prelude::*;

    const PERSON: Rect2f = Rect2f { x: 140.0, y: 80.0, width: 40.0, height: 90.0 };

    /// A street with somebody of that texture so far from where they were.
    fn street(moved: Point2f, texture: Option<u32>) -> Picture {
        let mut picture = Scene::new(320, 240).background((0.0, 0.0));
        if let Some(texture) = texture {
            picture.paint(PERSON + moved, texture);
        }
        picture
    }

    /// Of a picture of which nobody knows the background.
    fn observed(picture: &Picture) -> Observation<'_> {
        Observation { luma: picture.luma(), scene: None }
    }

    fn share(picture: &Picture) -> f32 {
        let mut appearance = Appearance::new(&observed(&street(Point2f::default(), Some(7))), PERSON);
        appearance.pass(false, 0.04);
        appearance.locate(&observed(picture), PERSON, 0.3).share
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn it_is_found_nearby(x in -14.0_f32..14.0, y in -14.0_f32..14.0) {
            let mut appearance = Appearance::new(&observed(&street(Point2f::default(), Some(7))), PERSON);
            appearance.pass(false, 0.04);
            let moved = Point2f::new(x.round(), y.round());
            let place = appearance.locate(&observed(&street(moved, Some(7))), PERSON, 0.6);
            let off = length(centre(place.bounds) - centre(PERSON + moved));
            prop_assert!(off < 4.0 && place.share >= FOUND, "{off} pixels off, {}", place.share);
        }

        #[test]
        fn any_box_is_survived(
            x in -200.0_f32..600.0, y in -200.0_f32..600.0, width in 1.0_f32..900.0, height in 1.0_f32..900.0,
        ) {
            let (bounds, picture) = (Rect2f::new(x, y, width, height), street(Point2f::default(), Some(7)));
            let mut appearance = Appearance::new(&observed(&picture), bounds);
            appearance.pass(true, 0.2);
            let place = appearance.locate(&observed(&picture), bounds, 0.3);
            appearance.look_closely(&observed(&picture), bounds);
            appearance.learn(&place, Some(0.4));
            prop_assert!(place.share.is_finite() && place.bounds.x.is_finite() && place.bounds.y.is_finite());
        }
    }

    #[test]
    fn the_same_is_there_and_the_wall_and_others_are_not() {
        let same = share(&street(Point2f::default(), Some(7)));
        assert!(same > 0.9, "{same}");
        for other in [None, Some(99), Some(4321)] {
            let share = share(&street(Point2f::default(), other));
            assert!(share < FOUND, "{other:?}: {share}");
        }
    }
}
