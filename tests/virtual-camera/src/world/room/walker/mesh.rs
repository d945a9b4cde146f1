// SPDX-License-Identifier: MPL-2.0

//! Skins over the bones: tubes of elliptical rings, smoothed along their length.

use std::f64::consts::TAU;

use super::super::view::{Vector, add, cross, dot, scale, subtract};

/// An elliptical cross-section of a part of the body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ring {
    pub centre: Vector,
    /// Half width to the right and half depth ahead, as vectors.
    pub right: Vector,
    pub ahead: Vector,
    /// How much light reaches it past the rest of the body.
    pub open: f64,
}

/// A place on the skin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vertex {
    pub place: Vector,
    /// Outwards, of length 1.
    pub normal: Vector,
    /// Round the limb and along it, in metres of cloth.
    pub cloth: [f64; 2],
    pub open: f64,
}

/// Four-cornered patches of skin of one material.
pub(crate) struct SkinPatch {
    pub material: usize,
    pub vertices: Vec<Vertex>,
    /// Vertices of a ring; the first one comes again at the end, with its other place in the cloth.
    pub columns: usize,
}

impl SkinPatch {
    /// The same skin elsewhere, by place and normal of each vertex.
    pub fn moved(mut self, to: impl Fn(Vector, Vector) -> (Vector, Vector)) -> Self {
        for vertex in &mut self.vertices {
            (vertex.place, vertex.normal) = to(vertex.place, vertex.normal);
        }
        self
    }
}

/// How finely skins are cut: corners of a ring, and steps between two rings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Detail {
    pub corners: usize,
    pub steps: usize,
}

/// Lays a skin over rings. `cloth` is where in the material it begins.
pub(crate) fn skin(rings: &[Ring], material: usize, cloth: [f64; 2], detail: Detail) -> SkinPatch {
    let smooth = smoothed(rings, detail.steps);
    let columns = detail.corners + 1;
    let mut vertices = Vec::with_capacity(smooth.len() * columns);
    let widest =
        |ring: &Ring| (dot(ring.right, ring.right).sqrt() + dot(ring.ahead, ring.ahead).sqrt()) / 2.0;
    let round = TAU * rings.iter().map(widest).fold(0.0, f64::max);
    let mut along = cloth[1];
    let mut before: Option<Vector> = None;
    for ring in &smooth {
        if let Some(before) = before {
            let way = subtract(ring.centre, before);
            along += dot(way, way).sqrt();
        }
        before = Some(ring.centre);
        for corner in 0..columns {
            let share = corner as f64 / detail.corners as f64;
            // Begins at the back, where the seam is seen least.
            let (sin, cos) = (TAU * (share - 0.5)).sin_cos();
            vertices.push(Vertex {
                place: add(ring.centre, add(scale(ring.right, sin), scale(ring.ahead, cos))),
                normal: [0.0; 3],
                cloth: [cloth[0] + round * share, along],
                open: ring.open,
            });
        }
    }
    let mut patch = SkinPatch { material, vertices, columns };
    find_normals(&mut patch, &smooth);
    patch
}

/// An egg: half its axes as vectors.
pub(crate) fn egg(centre: Vector, [right, up, ahead]: [Vector; 3], open: f64) -> [Ring; 5] {
    [(-1.0f64, 0.0), (-0.7, 0.714), (0.0, 1.0), (0.7, 0.714), (1.0, 0.0)].map(|(height, width)| Ring {
        centre: add(centre, scale(up, height)),
        right: scale(right, width),
        ahead: scale(ahead, width),
        open,
    })
}

/// Rings between the rings, on Catmull-Rom splines.
fn smoothed(rings: &[Ring], steps: usize) -> Vec<Ring> {
    let at = |index: isize| rings[index.clamp(0, rings.len() as isize - 1) as usize];
    let mut all = Vec::with_capacity(rings.len() * steps);
    for index in 0..rings.len().saturating_sub(1) as isize {
        let four = [at(index - 1), at(index), at(index + 1), at(index + 2)];
        for step in 0..steps {
            let share = step as f64 / steps as f64;
            let weights = catmull_rom(share);
            let mix = |pick: &dyn Fn(&Ring) -> Vector| {
                four.iter()
                    .zip(weights)
                    .fold([0.0; 3], |sum, (ring, weight)| add(sum, scale(pick(ring), weight)))
            };
            all.push(Ring {
                centre: mix(&|ring| ring.centre),
                right: mix(&|ring| ring.right),
                ahead: mix(&|ring| ring.ahead),
                open: four[1].open + (four[2].open - four[1].open) * share,
            });
        }
    }
    all.extend(rings.last());
    all
}

fn catmull_rom(share: f64) -> [f64; 4] {
    let (square, cube) = (share * share, share * share * share);
    [
        (-share + 2.0 * square - cube) / 2.0,
        (2.0 - 5.0 * square + 3.0 * cube) / 2.0,
        (share + 4.0 * square - 3.0 * cube) / 2.0,
        (cube - square) / 2.0,
    ]
}

/// Across the neighbours of every vertex; outwards from the middle of its ring.
fn find_normals(patch: &mut SkinPatch, rings: &[Ring]) {
    let (columns, rows) = (patch.columns, rings.len());
    for (row, ring) in rings.iter().enumerate() {
        for column in 0..columns {
            let at = |row: usize, column: usize| patch.vertices[row * columns + column].place;
            let round = subtract(
                at(row, if column + 1 < columns { column + 1 } else { 1 }),
                at(row, if column > 0 { column - 1 } else { columns - 2 }),
            );
            let along = subtract(at((row + 1).min(rows - 1), column), at(row.saturating_sub(1), column));
            let place = at(row, column);
            let across = cross(round, along);
            let length = dot(across, across).sqrt();
            let outwards = subtract(place, ring.centre);
            let end = if row == 0 { -1.0 } else { 1.0 };
            let fallback = scale(along, end / dot(along, along).sqrt().max(1e-12));
            let mut normal = if length > 1e-12 { scale(across, 1.0 / length) } else { fallback };
            if dot(normal, outwards) < 0.0 {
                normal = scale(normal, -1.0);
            }
            patch.vertices[row * columns + column].normal = normal;
        }
    }
}
