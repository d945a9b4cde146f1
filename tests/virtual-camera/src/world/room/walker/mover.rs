// SPDX-License-Identifier: MPL-2.0

//! Whoever or whatever moves through a room by itself: how it is drawn, and where it is seen.

use super::{
    super::{
        light::Light,
        view::{Canvas, Vector, View, add, scale},
    },
    clothes::Cloth,
    mesh::SkinPatch,
    paint::{self, Moment},
    walk::Walk,
};
use crate::{
    picture::Plane,
    truth::Kind,
    world::layer::{Layer, MOMENTS},
};

/// A person or a vehicle on its way; times are seconds since the action began.
pub(in crate::world) trait Mover: Send + Sync {
    fn kind(&self) -> Kind;

    /// The way, once.
    fn walk(&self) -> &Walk;

    /// Where on the floor it is.
    fn place(&self, time: f64) -> Vector;

    /// Its skin, as fine as it takes for a view.
    fn patches(&self, time: f64, view: &View) -> Vec<SkinPatch>;

    /// What the skin is of.
    fn cloths(&self) -> &[Cloth];

    /// Darkens the floor below it.
    fn draw_shadow(&self, time: f64, view: &View, canvas: &mut Canvas);

    /// All of it, as far as it is in the picture, during an exposure that begins at `time` and lasts `duration` seconds;
    /// `views` are the camera's at as many moments, evenly spread over it.
    fn layer(&self, time: f64, duration: f64, views: &[View; MOMENTS], light: &Light) -> Option<Layer> {
        let mut number = 0.0;
        let moments = views.each_ref().map(|view| {
            number += 1.0;
            let patches = self.patches(time + duration * (number - 0.5) / MOMENTS as f64, view);
            Moment { patches, view: view.clone() }
        });
        paint::paint(&moments, self.cloths(), light)
    }

    /// Sets every pixel of `mask`, of the view's size, on which it throws its shadow on the floor, light falling along
    /// `direction`, to 255.
    fn cast_shadow(&self, time: f64, direction: Vector, view: &View, mask: &mut Plane) {
        let on_floor = |place: Vector| {
            let [x, _, z] = add(place, scale(direction, -place[1] / direction[1]));
            ([x, 0.0, z], [0.0, 1.0, 0.0])
        };
        let patches =
            self.patches(time, view).into_iter().map(|patch| patch.moved(|place, _| on_floor(place)));
        paint::mark(&patches.collect::<Vec<_>>(), view, mask);
    }

    /// It as a floor like a mirror shows it.
    fn reflection(&self, time: f64, view: &View, light: &Light) -> Option<Layer> {
        let below = |[x, y, z]: Vector| [x, -y, z];
        let mirrored = |patch: SkinPatch| patch.moved(|place, normal| (below(place), below(normal)));
        let moments: [Moment; MOMENTS] = std::array::from_fn(|_| Moment {
            patches: self.patches(time, view).into_iter().map(mirrored).collect(),
            view: view.clone(),
        });
        paint::paint(&moments, self.cloths(), light)
    }

    /// Sets every pixel of `mask`, of the view's size, that shows it to 255.
    fn silhouette(&self, time: f64, view: &View, mask: &mut Plane) {
        paint::mark(&self.patches(time, view), view, mask);
    }

    /// Its left, top, right and bottom in pixels of the view, inside of it or not, edges of pixels at whole numbers;
    /// `None` unless all of it is ahead.
    fn bounds(&self, time: f64, view: &View) -> Option<[f64; 4]> {
        paint::bounds(&self.patches(time, view), view)
    }
}
