// SPDX-License-Identifier: MPL-2.0

//! Locally weighted regression (Cleveland, Robust locally weighted regression and smoothing scatterplots, 1979): for ground that is
//! no plane, for lenses that bend lines, and for as long as too little is known for a homography.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::geometry::{Ray, Tangent, angle};
use crate::pairs::Pair;
use crate::robust;

/// What the neighbours of a place tell of it.
#[derive(Debug, Clone, Copy)]
pub struct Guess {
    pub ray: Ray,
    /// Standard deviation, radians.
    pub doubt: f64,
    /// Natural logarithm of the height in degrees.
    pub log_height: Option<f64>,
}

/// This part of all pairs counts.
const SPAN: f64 = 0.2;
/// But so many at least.
const LEAST: usize = 12;
/// Radians by which directions are expected to change with one radian of place, before it is known: as much, where both cameras
/// are as far away.
const SLOPE: f64 = 1.0;
/// And how the slope itself changes with one more.
const BEND: f64 = 1.0;

/// A pair near the place that is asked for.
struct Near<'a> {
    pair: &'a Pair,
    /// From there, radians.
    offset: Vector2<f64>,
    /// By distance.
    weight: f64,
}

/// What is known of a place by its neighbours; `None` where there are none.
pub fn guess<'a>(place: &Ray, pairs: impl Iterator<Item = &'a Pair>) -> Option<Guess> {
    let near = neighbours(place, pairs);
    let tangent = Tangent::at(medoid(&near)?);
    let known: Vec<(&Near, Vector2<f64>)> =
        near.iter().filter_map(|near| Some((near, tangent.project(&near.pair.direction.ray())?))).collect();
    let mut weights: Vec<f64> = known.iter().map(|(near, _)| near.weight).collect();
    let (mut fit, mut scale) = (Vector2::zeros(), robust::FEET);
    let mut variance = 0.0;
    for _ in 0..5 {
        let line = Line::fit(known.iter().map(|(near, _)| near.offset), &weights, scale)?;
        let [x, y] = [0, 1].map(|axis| line.solve(known.iter().map(|(_, seen)| seen[axis])));
        fit = Vector2::new(x[0], y[0]);
        variance = line.variance();
        let residual = |(near, seen): &(&Near, Vector2<f64>)| {
            let at = Vector3::new(1.0, near.offset.x, near.offset.y);
            (seen - Vector2::new(x.dot(&at), y.dot(&at))).norm()
        };
        let residuals: Vec<f64> = known.iter().map(residual).collect();
        scale = robust::scale(residuals.iter().copied());
        let reweigh =
            |((near, _), residual): (&(&Near, _), &f64)| near.weight * robust::weight(*residual, scale);
        weights = known.iter().zip(&residuals).map(reweigh).collect();
    }
    let total: f64 = weights.iter().sum();
    let spread = known.iter().zip(&weights).map(|((near, _), weight)| weight * near.offset.norm_squared());
    let bend = BEND / 2.0 * spread.sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let heights = known.iter().zip(&weights).map(|((near, _), weight)| (near, *weight));
    Some(Guess {
        ray: tangent.ray(fit),
        doubt: (variance + scale * scale + bend * bend).sqrt(),
        log_height: log_height(heights),
    })
}

/// Those that count, by Cleveland's tricube.
fn neighbours<'a>(place: &Ray, pairs: impl Iterator<Item = &'a Pair>) -> Vec<Near<'a>> {
    let tangent = Tangent::at(*place);
    let mut near: Vec<Near> = pairs
        .filter_map(|pair| Some(Near { pair, offset: tangent.project(&pair.place.ray())?, weight: 0.0 }))
        .collect();
    near.sort_by(|one, other| one.offset.norm().total_cmp(&other.offset.norm()));
    near.truncate(((near.len() as f64 * SPAN) as usize).max(LEAST));
    let reach = near.last().map_or(0.0, |last| last.offset.norm()) + robust::FEET;
    for near in &mut near {
        near.weight = (1.0 - (near.offset.norm() / reach).powi(3)).powi(3);
    }
    near
}

/// The direction that is nearest to all others: wherever the wrong ones are, if they are the minority.
fn medoid(near: &[Near]) -> Option<Ray> {
    let rays: Vec<(Ray, f64)> = near.iter().map(|near| (near.pair.direction.ray(), near.weight)).collect();
    let sum = |ray: &Ray| rays.iter().map(|(other, weight)| weight * angle(ray, other)).sum::<f64>();
    rays.iter()
        .map(|(ray, _)| (ray, sum(ray)))
        .min_by(|one, other| one.1.total_cmp(&other.1))
        .map(|best| *best.0)
}

/// A plane through weighted points, its slopes bounded by what is expected of them (ridge regression, with Bayes' variance).
struct Line {
    inverse: Matrix3<f64>,
    /// Of every point: how it enters.
    terms: Vec<Vector3<f64>>,
}

impl Line {
    fn fit(offsets: impl Iterator<Item = Vector2<f64>> + Clone, weights: &[f64], scale: f64) -> Option<Self> {
        let precision = 1.0 / (scale * scale);
        let slope = 1.0 / (SLOPE * SLOPE);
        let mut normal = Matrix3::from_diagonal(&Vector3::new(f64::EPSILON, slope, slope));
        let mut terms = Vec::with_capacity(weights.len());
        for (offset, weight) in offsets.zip(weights) {
            let at = Vector3::new(1.0, offset.x, offset.y);
            normal += at * at.transpose() * (weight * precision);
            terms.push(at * (weight * precision));
        }
        Some(Self { inverse: normal.try_inverse()?, terms })
    }

    /// Value and slopes where the offset is 0.
    fn solve(&self, values: impl Iterator<Item = f64>) -> Vector3<f64> {
        let sum =
            self.terms.iter().zip(values).fold(Vector3::zeros(), |sum, (term, value)| sum + term * value);
        self.inverse * sum
    }

    /// Of that value.
    fn variance(&self) -> f64 {
        self.inverse[(0, 0)]
    }
}

/// People differ in height, the pairs by whom they are of and by how far away they were: their weighted mean will do.
fn log_height<'a>(weighted: impl Iterator<Item = (&'a &'a Near<'a>, f64)>) -> Option<f64> {
    let known = weighted.filter_map(|(near, weight)| Some((near.pair.height_deg?.ln(), weight)));
    let (sum, total) =
        known.fold((0.0, 0.0), |sum, (height, weight)| (sum.0 + weight * height, sum.1 + weight));
    (total > 0.0).then(|| sum / total)
}
