// SPDX-License-Identifier: MPL-2.0

//! The motion that most points of the picture share.

use opencv::core::Point2f;
use ptztrack_contract::Homography;

use crate::vision::projective::{Centred, Parameters, solve};

/// Where a point was and where it is, in pixels, and how much it is believed to be background (0 to 1).
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    pub from: Point2f,
    pub to: Point2f,
    pub weight: f64,
}

/// A motion of the picture and how well it is known.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    /// In pixels, counted from the picture's middle in units of its half width.
    pub homography: Homography,
    /// Of the displacement in the middle: xx, xy, yy in squared pixels.
    pub covariance: [f64; 3],
}

/// What a fit says of each pair, and memory for the next one.
#[derive(Debug, Default)]
pub(super) struct Agreement {
    /// Which pairs agree.
    pub agrees: Vec<bool>,
    offs: Vec<f64>,
}

impl Agreement {
    /// How many pairs agree.
    pub fn count(&self) -> usize {
        self.agrees.iter().filter(|agrees| **agrees).count()
    }
}

/// Fewer points, or a smaller share of what they weigh, say nothing about the background.
const MIN_POINTS: usize = 6;
const MIN_SHARE: f64 = 0.3;
/// Half widths of the picture that they span at least, in one direction: a world does not fit into a corner, somebody
/// before a blank wall does.
const MIN_EXTENT: f64 = 0.7;
/// Pairs of points that are tried: of twenty, one misses a share of a quarter by less than one in three
/// thousand times.
const TRIALS: usize = 100;
/// Support, as a share of what all points weigh, with which no other trial is made.
const ENOUGH: f64 = 0.8;
/// Pixels within which a point agrees with a trial; more where the picture moves much and is blurred.
const TOLERANCE: f64 = 1.0;
const RELATIVE_TOLERANCE: f64 = 0.05;
/// Pixels that a point is off, at least: the precision of Lucas-Kanade.
const PRECISION: f64 = 0.1;
/// Rounds of reweighting.
const ROUNDS: usize = 6;
/// How much a camera scales and turns the picture from one to the next, as standard deviations.
const SCALE: f64 = 0.05;
const TURN: f64 = 0.03;
/// Perspective is a part of the displacement, t/f²: cameras see less than 90 degrees of the world.
const PERSPECTIVE: f64 = 0.5;

fn off(homography: &Homography, pair: &Pair) -> f64 {
    let to = apply(homography, pair.from);
    let (x, y) = (f64::from(to.x - pair.to.x), f64::from(to.y - pair.to.y));
    // `hypot` takes care of numbers that pixels never have, and costs ten times as much.
    (x * x + y * y).sqrt()
}

/// Where a pixel goes.
pub(super) fn apply(homography: &Homography, point: Point2f) -> Point2f {
    let to = homography.apply(ptztrack_contract::Point { x: f64::from(point.x), y: f64::from(point.y) });
    Point2f::new(to.x as f32, to.y as f32)
}

/// The motion that most of `pairs` share: the best of `expected` ones and of trials through two points each
/// (RANSAC), then least squares with Tukey's weights. `None` where too few agree. `agreement` is of the same order as `pairs`.
pub(super) fn fit(
    pairs: &[Pair],
    expected: impl Iterator<Item = Homography>,
    centred: Centred,
    agreement: &mut Agreement,
) -> Option<Fit> {
    if pairs.len() < MIN_POINTS {
        return None;
    }
    let all: f64 = pairs.iter().map(|pair| pair.weight).sum();
    let mut homography = start(pairs, expected, centred, ENOUGH * all)?;
    let mut limit = 2.0 * tolerance(&homography, pairs);
    let mut solved = None;
    for _ in 0..ROUNDS {
        let normal = Normal::of(pairs, &homography, limit, centred);
        let parameters = normal.solve()?;
        homography = centred.leave(parameters);
        limit = (4.0 * spread(&homography, pairs, limit, &mut agreement.offs)).clamp(4.0 * PRECISION, limit);
        solved = Some(normal);
    }
    agreement.agrees.clear();
    agreement.agrees.extend(pairs.iter().map(|pair| off(&homography, pair) <= limit));
    let agreeing = pairs.iter().zip(&agreement.agrees).filter(|(_, agrees)| **agrees).map(|(pair, _)| pair);
    let share: f64 = agreeing.clone().map(|pair| pair.weight).sum();
    if agreement.count() < MIN_POINTS || share < MIN_SHARE * all || extent(agreeing, centred) < MIN_EXTENT {
        return None;
    }
    let deviation = spread(&homography, pairs, limit, &mut agreement.offs).max(PRECISION);
    let covariance = solved?.covariance(deviation * deviation);
    Some(Fit { homography, covariance })
}

/// The best of `expected` motions and of trials; no trial is made any more once one has support enough.
fn start(
    pairs: &[Pair],
    expected: impl Iterator<Item = Homography>,
    centred: Centred,
    enough: f64,
) -> Option<Homography> {
    let trials = (0..TRIALS).filter_map(|trial| similarity(pairs, trial, centred));
    let mut best: Option<(f64, Homography)> = None;
    for map in expected.chain(trials) {
        let support = support(&map, pairs);
        if best.is_none_or(|best| support > best.0) {
            best = Some((support, map));
        }
        if support >= enough {
            break;
        }
    }
    best.map(|(_, map)| map)
}

/// How far pairs lie apart, in half widths.
fn extent<'a>(pairs: impl Iterator<Item = &'a Pair> + Clone, centred: Centred) -> f64 {
    let range = |pick: fn((f64, f64)) -> f64| {
        let values = pairs.clone().map(|pair| pick(centred.enter(pair.from)));
        let (least, most) = values.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        most - least
    };
    range(|place| place.0).max(range(|place| place.1))
}

/// The similarity through the two points of a trial; the same for the same trial of the same points.
fn similarity(pairs: &[Pair], trial: usize, centred: Centred) -> Option<Homography> {
    // Steps of a linear congruential generator, spread by their upper bits.
    let random = (trial as u32).wrapping_mul(2_654_435_761).wrapping_add(0x9e37_79b9);
    let first = (random >> 16) as usize % pairs.len();
    let second = (random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223) >> 16) as usize % pairs.len();
    let [p, q] = [first, second].map(|index| centred.enter(pairs[index].from));
    let [r, s] = [first, second].map(|index| centred.enter(pairs[index].to));
    let (from, to) = ((q.0 - p.0, q.1 - p.1), (s.0 - r.0, s.1 - r.1));
    let square = from.0 * from.0 + from.1 * from.1;
    if square < 0.01 {
        return None;
    }
    let a = (from.0 * to.0 + from.1 * to.1) / square;
    let b = (from.0 * to.1 - from.1 * to.0) / square;
    if (a - 1.0).abs() > 3.0 * SCALE || b.abs() > 3.0 * TURN {
        return None;
    }
    Some(centred.leave([a, b, r.0 - a * p.0 + b * p.1, r.1 - b * p.0 - a * p.1, 0.0, 0.0]))
}

fn tolerance(homography: &Homography, pairs: &[Pair]) -> f64 {
    let travel = pairs.iter().map(|pair| {
        let to = apply(homography, pair.from);
        f64::from(to.x - pair.from.x).hypot(f64::from(to.y - pair.from.y))
    });
    TOLERANCE + RELATIVE_TOLERANCE * travel.sum::<f64>() / pairs.len() as f64
}

/// What the pairs weigh that agree, the more the better they do.
fn support(homography: &Homography, pairs: &[Pair]) -> f64 {
    let limit = 2.0 * tolerance(homography, pairs);
    pairs.iter().map(|pair| pair.weight * tukey(off(homography, pair), limit)).sum()
}

/// Tukey's biweight: 1 for what fits, 0 from `limit` on.
fn tukey(off: f64, limit: f64) -> f64 {
    let part = 1.0 - (off / limit).powi(2);
    if part > 0.0 { part * part } else { 0.0 }
}

/// Standard deviation of the pairs that agree, from their median, which outliers among them do not move. `offs` is memory.
fn spread(homography: &Homography, pairs: &[Pair], limit: f64, offs: &mut Vec<f64>) -> f64 {
    offs.clear();
    offs.extend(pairs.iter().map(|pair| off(homography, pair)).filter(|off| *off <= limit));
    offs.sort_unstable_by(f64::total_cmp);
    // The median length of a vector with two normal components is 1.18 deviations.
    offs.get(offs.len() / 2).map_or(0.0, |median| median / 1.18)
}

/// Normal equations of the weighted least squares, with what is known beforehand of a camera.
struct Normal {
    matrix: [[f64; 6]; 6],
    right: Parameters,
}

impl Normal {
    /// Pairs count the less the farther they are off the `last` solution, from `limit` on not at all.
    fn of(pairs: &[Pair], last: &Homography, limit: f64, centred: Centred) -> Self {
        let (mut matrix, mut right) = ([[0.0; 6]; 6], [0.0; 6]);
        let mut add = |row: Parameters, value: f64, weight: f64| {
            for (i, &left) in row.iter().enumerate() {
                for (j, &above) in row.iter().enumerate() {
                    matrix[i][j] += weight * left * above;
                }
                right[i] += weight * left * value;
            }
        };
        let weighted = pairs.iter().map(|pair| (pair, pair.weight * tukey(off(last, pair), limit)));
        for (pair, weight) in weighted.filter(|(_, weight)| *weight > 0.0) {
            let ((x, y), (u, v)) = (centred.enter(pair.from), centred.enter(pair.to));
            add([x, -y, 1.0, 0.0, -u * x, -u * y], u, weight);
            add([y, x, 0.0, 1.0, -v * x, -v * y], v, weight);
        }
        // What is known beforehand, each worth as much as its deviation against that of a point.
        let noise = (2.0 * PRECISION / centred.unit).powi(2);
        let middle = Point2f::new(centred.middle.0 as f32, centred.middle.1 as f32);
        let (x, y) = centred.enter(apply(last, middle));
        let perspective = |shift: f64| PERSPECTIVE * shift.abs() + 1e-3;
        let known = [(0, 1.0, SCALE), (1, 0.0, TURN), (4, 0.0, perspective(x)), (5, 0.0, perspective(y))];
        for (index, mean, deviation) in known {
            let mut row = [0.0; 6];
            row[index] = 1.0;
            add(row, mean, noise / (deviation * deviation));
        }
        Self { matrix, right }
    }

    fn solve(&self) -> Option<Parameters> {
        solve(self.matrix, self.right)
    }

    /// Of the displacement in the middle, in squared pixels, where points deviate by `variance` squared pixels.
    fn covariance(&self, variance: f64) -> [f64; 3] {
        let column = |index: usize| {
            let mut unit = [0.0; 6];
            unit[index] = 1.0;
            solve(self.matrix, unit).unwrap_or([f64::MAX; 6])
        };
        let (x, y) = (column(2), column(3));
        [x[2] * variance, x[3] * variance, y[3] * variance]
    }
}
