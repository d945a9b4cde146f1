// SPDX-License-Identifier: MPL-2.0

//! The maps that a turning and zooming camera makes of a picture, and what least squares over them solve.

use opencv::core::Point2f;
use ptztrack_contract::Homography;

/// Projective maps of a turning and zooming camera: similarity and perspective. x' = (ax − by + t)/(1 + gx + hy).
pub type Parameters = [f64; 6];

/// Pixels as coordinates whose origin is the picture's middle, the half width one unit.
#[derive(Debug, Clone, Copy)]
pub struct Centred {
    pub middle: (f64, f64),
    /// The half width, pixels.
    pub unit: f64,
}

impl Centred {
    pub fn of(width: f64, height: f64) -> Self {
        Self { middle: (width / 2.0 - 0.5, height / 2.0 - 0.5), unit: width / 2.0 }
    }

    /// Where a pixel lies.
    pub fn enter(self, point: Point2f) -> (f64, f64) {
        ((f64::from(point.x) - self.middle.0) / self.unit, (f64::from(point.y) - self.middle.1) / self.unit)
    }

    /// The map of pixels that does what `parameters` do.
    pub fn leave(self, [a, b, tx, ty, g, h]: Parameters) -> Homography {
        let centred = Homography([[a, -b, tx], [b, a, ty], [g, h, 1.0]]);
        let place = Homography([
            [1.0 / self.unit, 0.0, -self.middle.0 / self.unit],
            [0.0, 1.0 / self.unit, -self.middle.1 / self.unit],
            [0.0, 0.0, 1.0],
        ]);
        let back =
            Homography([[self.unit, 0.0, self.middle.0], [0.0, self.unit, self.middle.1], [0.0, 0.0, 1.0]]);
        place.then(&centred).then(&back)
    }
}

/// Solves a symmetric positive definite system by Cholesky's decomposition.
pub fn solve(matrix: [[f64; 6]; 6], right: Parameters) -> Option<Parameters> {
    let mut lower = [[0.0; 6]; 6];
    for i in 0..6 {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            lower[i][j] = if i == j {
                if rest <= 1e-12 {
                    return None;
                }
                rest.sqrt()
            } else {
                rest / lower[j][j]
            };
        }
    }
    let mut half = [0.0; 6];
    for i in 0..6 {
        half[i] = (right[i] - (0..i).map(|k| lower[i][k] * half[k]).sum::<f64>()) / lower[i][i];
    }
    let mut solution = [0.0; 6];
    for i in (0..6).rev() {
        solution[i] = (half[i] - (i + 1..6).map(|k| lower[k][i] * solution[k]).sum::<f64>()) / lower[i][i];
    }
    Some(solution)
}
