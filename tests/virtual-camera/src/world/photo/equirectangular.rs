// SPDX-License-Identifier: MPL-2.0

//! The panorama itself: decoded once for the whole process, and looked at through a view.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, OnceLock},
};

use super::{obstacle::Obstacle, rgba::Rgba, settings::PhotoError, way::turned};
use crate::{
    geometry::rotation,
    kinematics::Pose,
    picture::{Picture, Plane},
    sync::lock,
    world::{room::view::View, warp::warp},
};

/// An equirectangular picture, horizon in the middle row. Each plane is half as wide again as the picture and begins anew
/// there, so that no view meets a seam.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Equirectangular {
    planes: [Plane; 3],
}

impl Equirectangular {
    /// The picture in a file, decoded unless somebody has it already.
    pub fn open(path: &Path) -> Result<Arc<Self>, PhotoError> {
        static OPEN: OnceLock<Mutex<HashMap<PathBuf, Arc<Equirectangular>>>> = OnceLock::new();
        let mut open = lock(OPEN.get_or_init(Mutex::default));
        if let Some(known) = open.get(path) {
            return Ok(known.clone());
        }
        let decoded = Arc::new(Self::decode(path)?);
        open.insert(path.into(), decoded.clone());
        Ok(decoded)
    }

    fn decode(path: &Path) -> Result<Self, PhotoError> {
        let Rgba { width, height, pixels } = Rgba::read(path)?;
        if width != 2 * height || width % 4 != 0 || height < 16 {
            let reason = format!("a panorama is twice as wide as high, not {width}x{height}");
            return Err(PhotoError::Nonsense { path: path.into(), reason });
        }
        let colours: Vec<[u8; 3]> = pixels.iter().map(|&[r, g, b, _]| yuv([r, g, b])).collect();
        let plane = |step: usize, part: usize| {
            let padded = width / step * 3 / 2;
            let value = |i: usize| {
                let first = i / padded * step * width + i % padded * step % width;
                let corners = [0, step - 1, (step - 1) * width, (step - 1) * (width + 1)];
                let sum: u32 = corners.iter().map(|corner| u32::from(colours[first + corner][part])).sum();
                ((sum + 2) / 4) as u8
            };
            Plane {
                width: padded,
                height: height / step,
                data: (0..padded * height / step).map(value).collect(),
            }
        };
        Ok(Self { planes: [plane(1, 0), plane(2, 1), plane(2, 2)] })
    }

    /// What it shows around a direction, by shares of its width and height: the mean of some pixels there.
    pub fn mean_at(&self, across: f64, down: f64) -> [f64; 3] {
        [0, 1, 2].map(|index| {
            let plane = &self.planes[index];
            let (width, reach) = (plane.width * 2 / 3, (plane.height / 64).max(1));
            let (column, row) = ((across * width as f64) as usize, (down * plane.height as f64) as usize);
            let rows = row.saturating_sub(reach)..(row + reach).min(plane.height);
            let columns = column..(column + 2 * reach).min(plane.width);
            let count = (rows.len() * columns.len()).max(1);
            let line = |row: usize| {
                plane.data[row * plane.width..][columns.clone()].iter().map(|value| u32::from(*value))
            };
            f64::from(rows.flat_map(line).sum::<u32>()) / count as f64
        })
    }

    /// A small one, painted by yaw and pitch in degrees.
    #[cfg(test)]
    pub fn painted(colour: impl Fn(f64, f64) -> [u8; 3]) -> Self {
        let plane = |step: usize, part: usize| {
            let (width, height) = (128 / step, 64 / step);
            let value = |index: usize| {
                let (column, row) = (index % (width * 3 / 2) % width, index / (width * 3 / 2));
                let yaw = (column as f64 + 0.5) / width as f64 * 360.0 - 180.0;
                colour(yaw, 90.0 - (row as f64 + 0.5) / height as f64 * 180.0)[part]
            };
            Plane { width: width * 3 / 2, height, data: (0..width * 3 / 2 * height).map(value).collect() }
        };
        Self { planes: [plane(1, 0), plane(2, 1), plane(2, 2)] }
    }

    /// The same with something standing in it.
    pub fn with(&self, obstacle: &Obstacle) -> Self {
        let mut changed = self.clone();
        for (index, plane) in changed.planes.iter_mut().enumerate() {
            let (before, width) = (&self.planes[index], plane.width * 2 / 3);
            let per_degree = width as f64 / 360.0;
            let direction = |column: f64, row: f64| {
                ((column + 0.5) / per_degree - 180.0, 90.0 - (row + 0.5) / per_degree)
            };
            let reached: Vec<usize> = (0..plane.width)
                .filter(|column| obstacle.reaches(direction(*column as f64, 0.0).0))
                .collect();
            for (row, line) in plane.data.chunks_exact_mut(plane.width).enumerate() {
                for &column in &reached {
                    let (yaw, pitch) = direction(column as f64, row as f64);
                    let Some(seen) = obstacle.seen(yaw, pitch, per_degree) else { continue };
                    let (u, v) = ((seen.from.0 + 180.0) * per_degree, (90.0 - seen.from.1) * per_degree);
                    let source = before.data[(v.max(0.0) as usize).min(before.height - 1) * before.width
                        + (u.rem_euclid(width as f64)) as usize];
                    let zero = if index == 0 { 16.0 } else { 128.0 };
                    let lit = |value: f64, light: f64| zero + (value - zero) * light;
                    let old = lit(f64::from(line[column]), seen.shadow);
                    line[column] = (old + (lit(f64::from(source), seen.light) - old) * seen.part + 0.5) as u8;
                }
            }
        }
        changed
    }

    /// What a view along `pose` sees of it.
    pub fn look(&self, pose: &Pose, view: &View, canvas: &mut Picture) {
        let half = view.halved();
        for (index, target) in canvas.planes.iter_mut().enumerate() {
            let (source, view) = (&self.planes[index], if index == 0 { view } else { &half });
            let width = (source.width * 2 / 3) as f64;
            // Left of the middle a quarter, and right of it one, lie inside.
            let ahead = ((pose.pan_deg / 360.0 + 0.5).rem_euclid(1.0)) * width;
            let ahead = if ahead < width / 4.0 { ahead + width } else { ahead };
            let rays = Rays::new(pose, view);
            warp(source, target, |x, y| {
                let (yaw, pitch) = rays.direction(x, y);
                let across = turned(pose.pan_deg, yaw) / 360.0 * width;
                (ahead + across - 0.5, (0.5 - pitch / 180.0) * source.height as f64 - 0.5)
            });
        }
    }
}

/// Which way the pixels of a view look.
pub(super) struct Rays {
    rows: [[f64; 3]; 3],
}

impl Rays {
    pub fn new(pose: &Pose, view: &View) -> Self {
        let (focal, x, y) = (view.pinhole.focal, view.pinhole.centre_x, view.pinhole.centre_y);
        let rows = rotation(pose).map(|[a, b, c]| [a / focal, b / focal, c - (a * x + b * y) / focal]);
        Self { rows }
    }

    /// To the right, down and ahead of pan 0; of no particular length.
    pub fn ray(&self, x: f64, y: f64) -> [f64; 3] {
        self.rows.map(|row| row[0] * x + row[1] * y + row[2])
    }

    /// Degrees to the right and up.
    pub fn direction(&self, x: f64, y: f64) -> (f64, f64) {
        let [right, down, ahead] = self.ray(x, y);
        (right.atan2(ahead).to_degrees(), -down.atan2(right.hypot(ahead)).to_degrees())
    }
}

/// BT.601 in video range.
pub(super) fn yuv(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(i32::from);
    [
        (66 * r + 129 * g + 25 * b + 4224) >> 8,
        (-38 * r - 74 * g + 112 * b + 32896) >> 8,
        (112 * r - 94 * g - 18 * b + 32896) >> 8,
    ]
    .map(|value| value.clamp(0, 255) as u8)
}
