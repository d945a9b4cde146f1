// SPDX-License-Identifier: MPL-2.0

//! The people who walk through the room: their ways, their gait, their bodies and clothes, and how they are drawn.

mod body;
mod cast;
mod clothes;
mod figure;
mod fill;
mod gait;
mod mesh;
mod obstruction;
mod paint;
mod pattern;
mod route;
mod walk;
mod wardrobe;

pub(crate) use gait::BodyPose;
pub(super) use obstruction::obstacles;
pub(crate) use walk::Walk;

use self::{
    cast::Role,
    clothes::Outfit,
    figure::Build,
    gait::Gait,
    mesh::{Detail, SkinPatch},
    paint::Moment,
};
use super::{
    action::Action,
    light::Light,
    scene::Style,
    settings::{RoomSettings, Subject},
    view::{Canvas, Vector, View, add, scale},
};
use crate::{
    picture::Plane,
    seeded::Seeded,
    world::layer::{Layer, MOMENTS},
};

/// Streams of chance: who somebody is depends on the seed and the subject alone, how they step off on the way too.
const PERSON: u64 = 0xb0d7;
const STEP: u64 = 0x57e9;

/// How many subjects there are. Who comes after them in a room is somebody else of a subject's kind.
const SUBJECTS: usize = 3;

/// Body and clothes of the subject of a seed, or of somebody of its kind by the number of their clothes.
fn person(settings: &RoomSettings, subject: Subject, clothes: usize) -> (Build, Outfit) {
    let seeded = Seeded::new(settings.seed).fork(PERSON).fork(subject as u64);
    let mut chance = if clothes < SUBJECTS { seeded } else { seeded.fork(clothes as u64) };
    (Build::of(subject, &mut chance), Outfit::of(subject, Style::of(settings.seed).wall, &mut chance))
}

/// One person on their way.
pub(crate) struct Walker {
    build: Build,
    outfit: Outfit,
    gait: Gait,
    repeats: bool,
}

impl Walker {
    /// Everybody in a room, the person to be followed first.
    pub fn all(settings: &RoomSettings) -> Vec<Self> {
        let mut walkers: Vec<_> = match settings.action {
            Action::Test => vec![Self::of_test(settings)],
            _ => Self::in_roles(settings, &cast::cast(settings), 0),
        };
        let others = cast::others(settings, walkers.len());
        walkers.extend(Self::in_roles(settings, &others, walkers.len()));
        walkers
    }

    fn in_roles(settings: &RoomSettings, roles: &[Role], first: usize) -> Vec<Self> {
        roles.iter().zip(first..).map(|(role, number)| Self::in_role(settings, number, role)).collect()
    }

    /// The person of a test of the thesis.
    fn of_test(settings: &RoomSettings) -> Self {
        let (build, outfit) = person(settings, settings.subject, 0);
        Self::walking(settings, build, outfit, Walk::of_test(settings), 0)
    }

    /// Somebody of an action, by their number from 0.
    fn in_role(settings: &RoomSettings, number: usize, role: &Role) -> Self {
        let (build, outfit) = person(settings, role.subject, role.clothes);
        // Who wears another's clothes is not their twin.
        let own =
            Build::of(role.subject, &mut Seeded::new(settings.seed).fork(PERSON).fork(100 + number as u64));
        let build = if role.clothes == number { build } else { own };
        Self::walking(settings, build, outfit, Walk::along(&role.way), number)
    }

    fn walking(settings: &RoomSettings, build: Build, outfit: Outfit, walk: Walk, number: usize) -> Self {
        let phase = Seeded::new(settings.seed).fork(STEP).fork(settings.way() + 1000 * number as u64).unit();
        Self { gait: Gait::new(walk, build.clone(), phase), build, outfit, repeats: settings.repeats }
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

    /// Sets every pixel of `mask`, of the view's size, on which the body throws its shadow on the floor, light falling along
    /// `direction`, to 255.
    pub fn cast_shadow(&self, pose: &BodyPose, direction: Vector, view: &View, mask: &mut Plane) {
        let on_floor = |place: Vector| {
            let [x, _, z] = add(place, scale(direction, -place[1] / direction[1]));
            ([x, 0.0, z], [0.0, 1.0, 0.0])
        };
        let patches =
            self.patches(pose, view).into_iter().map(|patch| patch.moved(|place, _| on_floor(place)));
        paint::mark(&patches.collect::<Vec<_>>(), view, mask);
    }

    /// The body as a floor like a mirror shows it.
    pub fn reflection(&self, pose: &BodyPose, view: &View, light: &Light) -> Option<Layer> {
        let below = |[x, y, z]: Vector| [x, -y, z];
        let mirrored = |patch: SkinPatch| patch.moved(|place, normal| (below(place), below(normal)));
        let moments: [Moment; MOMENTS] = std::array::from_fn(|_| Moment {
            patches: self.patches(pose, view).into_iter().map(mirrored).collect(),
            view: view.clone(),
        });
        paint::paint(&moments, &self.outfit.cloths, light)
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

    fn patches(&self, pose: &BodyPose, view: &View) -> Vec<SkinPatch> {
        let depth = view.seen(pose.pelvis)[2].max(1.0);
        // Corners of limbs must not show close up.
        let close = view.pinhole.focal / depth > 700.0;
        let detail = if close { Detail { corners: 28, steps: 5 } } else { Detail { corners: 12, steps: 2 } };
        body::patches(pose, &self.build, &self.outfit, detail)
    }
}

#[cfg(test)]
mod tests;
