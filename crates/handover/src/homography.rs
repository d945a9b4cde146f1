// SPDX-License-Identifier: MPL-2.0

//! The homography that the ground makes between two cameras.
//!
//! Whatever stands on a plane is in the direction `H p` from the one camera, where `p` is the ray in which the other one sees it
//! (Hartley and Zisserman, Multiple view geometry, 2004, 13.1). Directions instead of pixels: the camera that is called turns.

use fastrand::Rng;
use nalgebra::{Matrix3, SMatrix, SymmetricEigen, Unit, Vector3};

use crate::geometry::{Ray, angle};
use crate::robust;

type Matrix9 = SMatrix<f64, 9, 9>;

/// Where somebody is seen by the one camera and by the other.
pub type Seen = (Ray, Ray);

/// A homography, and how well it is known.
#[derive(Debug, Clone)]
pub struct Homography {
    matrix: Matrix3<f64>,
    /// In which ways the matrix may yet differ, and the variance of each.
    doubts: Vec<(Matrix3<f64>, f64)>,
}

impl Homography {
    /// A homography has eight degrees of freedom; four pairs determine it, and one more contradicts where one is wrong.
    const SAMPLE: usize = 5;
    /// Of seven in ten that are right, five right ones are not drawn with a probability of 10⁻¹⁶.
    const DRAWS: usize = 200;
    /// Weights settle sooner.
    const REWEIGHTS: usize = 12;
    /// The matrix, whose norm is 1, is determined where it differs by no more than this standard deviation. Where all pairs lie on
    /// a line it is not, and what is near to it is no measure of what else it might be.
    const DETERMINED: f64 = 0.2;

    /// The one that fits most pairs: random sample consensus with a cost that is bounded (Torr and Zisserman, MLESAC, 2000), then
    /// reweighted least squares. `None` where there are too few, or they do not determine one.
    pub fn fit(seen: &[Seen]) -> Option<Self> {
        if seen.len() < Self::SAMPLE {
            return None;
        }
        let mut rng = Rng::with_seed(seen.len() as u64);
        let draw = |_| {
            let sample: Vec<Seen> = rng.choose_multiple(seen.iter().copied(), Self::SAMPLE);
            let fit = solve(sample.iter().map(|seen| (seen, 1.0)))?;
            Some((residuals(&fit.0, seen).into_iter().map(robust::cost).sum::<f64>(), fit.0))
        };
        let best = (0..Self::DRAWS).filter_map(draw).min_by(|(one, _), (other, _)| one.total_cmp(other));
        Self::refine(best?.1, seen)
    }

    fn refine(mut matrix: Matrix3<f64>, seen: &[Seen]) -> Option<Self> {
        let mut found = None;
        for _ in 0..Self::REWEIGHTS {
            let residuals = residuals(&matrix, seen);
            let scale = robust::scale(residuals.iter().copied());
            let weight = |(seen, residual): (_, &f64)| (seen, robust::weight(*residual, scale), &matrix);
            let weighted = seen.iter().zip(&residuals).map(weight).map(|(seen, weight, matrix)| {
                let length = (matrix * seen.0.as_ref()).norm();
                (seen, weight / (length * length).max(f64::MIN_POSITIVE))
            });
            let (next, eigen) = solve(weighted)?;
            matrix = next;
            found = Some((eigen, scale));
        }
        let (eigen, scale) = found?;
        let doubts = doubts(&eigen, scale);
        let determined = doubts.iter().all(|(_, variance)| variance.sqrt() < Self::DETERMINED);
        determined.then_some(Self { matrix, doubts })
    }

    /// Where the other camera sees what this one sees along a ray, and the standard deviation of that by what is not known of the
    /// homography, in radians.
    pub fn map(&self, ray: &Ray) -> (Ray, f64) {
        let image = self.matrix * ray.as_ref();
        let length = image.norm().max(f64::MIN_POSITIVE);
        let (direction, _) = Unit::new_and_get(image);
        let aside = |change: Vector3<f64>| (change - *direction * direction.dot(&change)) / length;
        let variance = self
            .doubts
            .iter()
            .map(|(mode, variance)| variance * aside(mode * ray.as_ref()).norm_squared())
            .sum::<f64>();
        (direction, (variance / 2.0).sqrt())
    }
}

/// Angles between what was seen and what should have been.
fn residuals(matrix: &Matrix3<f64>, seen: &[Seen]) -> Vec<f64> {
    let residual = |(from, to): &Seen| angle(&Unit::new_normalize(matrix * from.as_ref()), to);
    seen.iter().map(residual).map(|angle| if angle.is_finite() { angle } else { f64::MAX }).collect()
}

/// The direct linear transform: `d × H p = 0` of every pair, in least squares.
fn solve<'a>(
    weighted: impl Iterator<Item = (&'a Seen, f64)> + Clone,
) -> Option<(Matrix3<f64>, SymmetricEigen<f64, nalgebra::Const<9>>)> {
    let mut normal = Matrix9::zeros();
    for ((from, to), weight) in weighted.clone() {
        let aside = Matrix3::identity() - to.into_inner() * to.transpose();
        normal += aside.kronecker(&(from.into_inner() * from.transpose())) * weight;
    }
    let eigen = SymmetricEigen::try_new(normal, f64::EPSILON, 1000)?;
    let smallest = eigen.eigenvalues.imin();
    let matrix = as_matrix(&eigen, smallest);
    // Both signs fit as well; people are ahead of the camera that sees them.
    let ahead: f64 = weighted.map(|((from, to), weight)| weight * to.dot(&(matrix * from.as_ref()))).sum();
    let matrix = if ahead < 0.0 { -matrix } else { matrix };
    matrix.iter().all(|part| part.is_finite()).then_some((matrix, eigen))
}

fn as_matrix(eigen: &SymmetricEigen<f64, nalgebra::Const<9>>, column: usize) -> Matrix3<f64> {
    Matrix3::from_row_iterator(eigen.eigenvectors.column(column).iter().copied())
}

/// The covariance of the solution, where each axis of a residual has this standard deviation.
fn doubts(eigen: &SymmetricEigen<f64, nalgebra::Const<9>>, scale: f64) -> Vec<(Matrix3<f64>, f64)> {
    let smallest = eigen.eigenvalues.imin();
    let others = (0..9).filter(|column| *column != smallest);
    others.map(|column| (as_matrix(eigen, column), scale * scale / eigen.eigenvalues[column])).collect()
}
