//! The person who walks through the room: their way, their gait, their body and clothes, and how they are drawn.

mod body;
mod clothes;
mod figure;
mod fill;
mod gait;
mod layer;
mod mesh;
mod obstruction;
mod paint;
mod pattern;
mod walk;
mod wardrobe;

pub(crate) use gait::BodyPose;
pub(crate) use layer::{Layer, MOMENTS};
pub(crate) use walk::Walk;

use self::{
    clothes::Outfit,
    figure::Build,
    gait::Gait,
    mesh::{Detail, Patch},
    paint::Moment,
};
use super::{
    light::Light,
    scene::{Obstacle, Solid, Style},
    settings::RoomSettings,
    view::{Canvas, View, add, scale},
};
use crate::{picture::Plane, seeded::Seeded};

/// Streams of chance: who somebody is depends on the seed and the subject alone, how they step off on the way too.
const PERSON: u64 = 0xb0d7;
const STEP: u64 = 0x57e9;

/// One person on their way.
pub(crate) struct Walker {
    build: Build,
    outfit: Outfit,
    gait: Gait,
    repeats: bool,
}

impl Walker {
    pub fn new(settings: &RoomSettings) -> Self {
        let root = Seeded::new(settings.seed);
        let mut person = root.fork(PERSON).fork(settings.subject as u64);
        let build = Build::of(settings.subject, &mut person);
        let outfit = Outfit::of(settings.subject, Style::of(settings.seed).wall, &mut person);
        let phase = root.fork(STEP).fork(settings.way()).unit();
        let gait = Gait::new(Walk::new(settings), build.clone(), phase);
        Self { build, outfit, gait, repeats: settings.repeats }
    }

    /// The way of the person, once.
    pub fn walk(&self) -> &Walk {
        self.gait.walk()
    }

    /// How the person stands at a time in seconds since the world's start.
    pub fn pose_at(&self, time: f64) -> BodyPose {
        self.gait.pose(if self.repeats { time.rem_euclid(self.walk().duration()) } else { time })
    }

    /// The whole body, as far as it is in the picture, during an exposure that begins at `time` in seconds; `views` are
    /// the camera's at as many moments, evenly spread over the exposure's `duration`.
    pub fn layer(&self, time: f64, duration: f64, views: &[View; MOMENTS], light: &Light) -> Option<Layer> {
        let mut number = 0.0;
        let moments = views.each_ref().map(|view| {
            number += 1.0;
            let pose = self.pose_at(time + duration * (number - 0.5) / MOMENTS as f64);
            Moment { patches: self.patches(&pose, view), view: view.clone() }
        });
        paint::paint(&moments, &self.outfit.cloths, light)
    }

    /// Darkens the floor below the body: softly all around, more where a foot stands.
    pub fn draw_shadow(&self, pose: &BodyPose, view: &View, canvas: &mut Canvas) {
        paint::shadow(pose.place, 0.75, 0.30, view, canvas);
        for leg in &pose.legs {
            let lift = (leg.ankle[1] - self.build.ankle_height).max(0.0);
            let [x, _, z] = add(leg.ankle, scale(leg.foot.ahead, 0.05));
            paint::shadow([x, 0.0, z], 0.20 + lift, 0.45 / (1.0 + 8.0 * lift), view, canvas);
        }
    }

    /// Sets every pixel of `mask`, of the view's size, that shows the body to 255.
    pub fn silhouette(&self, pose: &BodyPose, view: &View, mask: &mut Plane) {
        paint::mark(&self.patches(pose, view), view, mask);
    }

    /// Left, top, right and bottom of the body in pixels of the view, inside of it or not, edges of pixels at whole
    /// numbers; `None` unless all of it is ahead.
    pub fn bounds(&self, pose: &BodyPose, view: &View) -> Option<[f64; 4]> {
        let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for vertex in self.patches(pose, view).iter().flat_map(|patch| &patch.vertices) {
            let ((x, y), _) = view.pixel(vertex.place)?;
            let (x, y) = (x + 0.5, y + 0.5);
            bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
        }
        Some(bounds)
    }

    /// What must stand in the way, if anything.
    pub(super) fn obstacle(&self, settings: &RoomSettings) -> Option<(Obstacle, Solid)> {
        obstruction::obstacle(self, settings)
    }

    fn patches(&self, pose: &BodyPose, view: &View) -> Vec<Patch> {
        let depth = view.seen(pose.pelvis)[2].max(1.0);
        // Corners of limbs must not show close up.
        let close = view.pinhole.focal / depth > 700.0;
        let detail = if close { Detail { corners: 28, steps: 5 } } else { Detail { corners: 12, steps: 2 } };
        body::patches(pose, &self.build, &self.outfit, detail)
    }
}

#[cfg(test)]
mod tests;
