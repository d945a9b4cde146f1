// SPDX-License-Identifier: MPL-2.0

//! Somebody cut out of film, as an upright board that stands where they do and faces the camera.

use std::sync::Arc;

use super::{
    equirectangular::Rays,
    settings::{PhotoError, PhotoSettings},
    sprite::{Level, Sprite, Sprites},
    way::{HEIGHT, Moment},
};
use crate::{
    kinematics::Pose,
    picture::Plane,
    truth::Bounds,
    world::{
        layer::{ASIDE, Layer, Window},
        room::view::View,
    },
};

/// Where somebody stands, and how large a board they take there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stand {
    pub moment: Moment,
    /// Sine and cosine of the direction they stand in, and how far away.
    pub facing: (f64, f64),
    away: f64,
    pub eye: f64,
}

impl Stand {
    pub fn new(moment: Moment, eye: f64) -> Self {
        let away = moment.away();
        Self { moment, facing: (moment.x / away, moment.z / away), away, eye }
    }

    /// Corners of the board in a view, generously; none where it is behind.
    pub fn bounds(&self, view: &View) -> Option<Bounds> {
        let (sin, cos) = self.facing;
        let corners = [(-0.75, -0.12), (0.75, -0.12), (-0.75, 1.1), (0.75, 1.1)].map(|(right, up)| {
            let (right, up) = (right * 0.8 * HEIGHT / 1.75, up * HEIGHT - self.eye);
            let seen = view.turned([self.moment.x + right * cos, up, self.moment.z - right * sin]);
            (seen[2] > 1e-3).then(|| view.project(seen))
        });
        Bounds::around(corners.into_iter().collect::<Option<Vec<_>>>()?)
    }
}

/// Somebody at one moment: where, and the picture that shows them.
pub(super) struct Figure {
    stand: Stand,
    sprite: Arc<Sprite>,
    mirrored: bool,
    foot: (f64, f64),
    /// Pixels of the picture on a metre.
    per_metre: f64,
}

impl Figure {
    /// The level of the picture for samples that are `step` radians apart.
    fn level(&self, step: f64) -> Level<'_> {
        self.sprite.level(step * self.stand.away * self.per_metre)
    }

    /// What a ray (right, down, ahead) meets of them.
    #[inline]
    fn seen(&self, level: Level, [right, down, ahead]: [f64; 3]) -> [u8; 4] {
        let (sin, cos) = self.stand.facing;
        let depth = right * sin + ahead * cos;
        if depth <= 1e-6 {
            return [0; 4];
        }
        let reach = self.stand.away / depth;
        let across = (right * cos - ahead * sin) * reach * self.per_metre;
        let up = (self.stand.eye - down * reach) * self.per_metre;
        let across = if self.mirrored { -across } else { across };
        level.at(self.foot.0 + across, self.foot.1 - up)
    }

    /// All of them through a view, whatever hides them.
    pub fn whole(&self, pose: &Pose, view: &View) -> Plane {
        let (rays, level) = (Rays::new(pose, view), self.level(1.0 / view.pinhole.focal));
        let mut whole = Plane::filled(view.size.0, view.size.1, 0);
        for (row, line) in whole.data.chunks_exact_mut(view.size.0.max(1)).enumerate() {
            for (column, pixel) in line.iter_mut().enumerate() {
                let [.., there] = self.seen(level, rays.ray(column as f64, row as f64));
                *pixel = 255 * there;
            }
        }
        whole
    }

    /// The box around them in a view, inside of it or not.
    pub fn bounds(&self, pose: &Pose, view: &View) -> Option<Bounds> {
        let around = self.stand.bounds(view)?;
        // Where in that they really are.
        let (left, top) = (around.left.floor(), around.top.floor());
        let mut pinhole = view.pinhole;
        (pinhole.centre_x, pinhole.centre_y) = (pinhole.centre_x - left, pinhole.centre_y - top);
        let close = view.through(pinhole, (around.width as usize + 2, around.height as usize + 2));
        let whole = self.whole(pose, &close);
        let lit = (0..whole.data.len()).filter(|&index| whole.data[index] > 0);
        let pixels =
            lit.map(|index| ((index % whole.width) as f64 + left, (index / whole.width) as f64 + top));
        Bounds::around(pixels.flat_map(|(x, y)| [(x, y), (x + 1.0, y + 1.0)]))
    }
}

/// The film, and how somebody of it looks in a photograph.
pub(super) struct Film {
    sprites: Arc<Sprites>,
    other_clothes: bool,
    /// Brightness, as a part of that in the film.
    shade: f64,
}

impl Film {
    pub fn new(sprites: Arc<Sprites>, photo: &PhotoSettings) -> Self {
        Self { sprites, other_clothes: photo.other_clothes, shade: photo.place.shade }
    }

    pub fn figure(&self, stand: Stand) -> Result<Figure, PhotoError> {
        let (index, mirrored) = self.sprites.choose(stand.moment.heading_deg, stand.moment.walked);
        let row = &self.sprites.rows[index];
        let sprite = self.sprites.picture(index, self.other_clothes)?;
        Ok(Figure { stand, sprite, mirrored, foot: row.foot, per_metre: row.height_px / HEIGHT })
    }

    /// The person alone, as the mean of some moments.
    pub fn layer(&self, moments: &[(Figure, (Pose, View))], size: (usize, usize)) -> Option<Layer> {
        let corners =
            moments.iter().filter_map(|(figure, (_, view))| figure.stand.bounds(view)).flat_map(|bounds| {
                [(bounds.left, bounds.top), (bounds.left + bounds.width, bounds.top + bounds.height)]
            });
        let window = Window::around(corners, size)?;
        let mut layer = Layer::new(window);
        let mut colours = vec![[0u8; 4]; window.width * window.height];
        let shade =
            |value: u8, zero: f64| (zero + (f64::from(value) - zero) * self.shade).clamp(0.0, 255.0) as u8;
        for ((figure, (pose, view)), aside) in moments.iter().zip(ASIDE) {
            let (rays, level) = (Rays::new(pose, view), figure.level(0.5 / view.pinhole.focal));
            for (row, line) in colours.chunks_exact_mut(window.width).enumerate() {
                let y = (window.top + row) as f64 + aside.1;
                for (column, colour) in line.iter_mut().enumerate() {
                    let ray = rays.ray((window.left + column) as f64 + aside.0, y);
                    let [luma, u, v, there] = figure.seen(level, ray);
                    *colour = if there == 0 {
                        [0; 4]
                    } else {
                        [shade(luma, 16.0), shade(u, 128.0), shade(v, 128.0), 1]
                    };
                }
            }
            layer.add(&colours);
        }
        Some(layer)
    }
}
