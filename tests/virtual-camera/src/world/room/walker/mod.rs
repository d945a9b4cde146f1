// SPDX-License-Identifier: MPL-2.0

//! The people and vehicles that move through the room: their ways, their gait, their bodies and clothes, and how they are
//! drawn.

mod body;
mod cast;
mod clothes;
mod figure;
mod fill;
mod gait;
mod mesh;
mod mover;
mod obstruction;
mod paint;
mod pattern;
mod route;
mod vehicle;
mod walk;
mod wardrobe;

pub(super) use mesh::SkinPatch;
pub(in crate::world) use mover::Mover;
pub(super) use obstruction::obstacles;
pub(super) use paint::{bounds, mark};
pub(crate) use walk::Walk;
pub(in crate::world) use walk::{Moment, RATE};

use self::{
    cast::Role,
    clothes::{Cloth, Outfit},
    figure::Build,
    gait::{BodyPose, Gait},
    mesh::Detail,
    vehicle::Vehicle,
};
use super::{
    action::Action,
    scene::Style,
    settings::{RoomSettings, Subject},
    view::{Canvas, Vector, View, add, scale},
};
use crate::{seeded::Seeded, truth::Kind};

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

/// Everybody and everything that moves in a room by itself, who is to be followed first.
pub(super) fn movers(settings: &RoomSettings) -> Vec<Box<dyn Mover>> {
    let mut movers: Vec<Box<dyn Mover>> = match settings.action {
        Action::Test => vec![Box::new(Walker::of_test(settings))],
        _ => in_roles(settings, &cast::cast(settings), 0),
    };
    let others = cast::others(settings, movers.len());
    movers.extend(in_roles(settings, &others, movers.len()));
    movers
}

fn in_roles(settings: &RoomSettings, roles: &[Role], first: usize) -> Vec<Box<dyn Mover>> {
    let mover = |(role, number): (&Role, usize)| -> Box<dyn Mover> {
        match role.kind {
            Kind::Person => Box::new(Walker::in_role(settings, number, role)),
            Kind::Vehicle => Box::new(Vehicle::new(settings, number, &role.way)),
        }
    };
    roles.iter().zip(first..).map(mover).collect()
}

/// One person on their way.
pub(in crate::world) struct Walker {
    build: Build,
    outfit: Outfit,
    gait: Gait,
    repeats: bool,
}

impl Walker {
    /// The person of a test of the thesis.
    fn of_test(settings: &RoomSettings) -> Self {
        let (build, outfit) = person(settings, settings.subject, 0);
        Self::walking(settings, build, outfit, Walk::of_test(settings), 0)
    }

    /// Somebody of an action, by their number from 0.
    fn in_role(settings: &RoomSettings, number: usize, role: &Role) -> Self {
        let (subject, clothes) =
            if settings.alike { (settings.subject, 0) } else { (role.subject, role.clothes) };
        let (build, outfit) = person(settings, subject, clothes);
        // Who wears another's clothes is not their twin.
        let own =
            Build::of(role.subject, &mut Seeded::new(settings.seed).fork(PERSON).fork(100 + number as u64));
        let build = if clothes == number || clothes >= SUBJECTS { build } else { own };
        Self::walking(settings, build, outfit, Walk::along(&role.way), number)
    }

    fn walking(settings: &RoomSettings, build: Build, outfit: Outfit, walk: Walk, number: usize) -> Self {
        let phase = Seeded::new(settings.seed).fork(STEP).fork(settings.way() + 1000 * number as u64).unit();
        Self { gait: Gait::new(walk, build.clone(), phase), build, outfit, repeats: settings.repeats }
    }

    /// Somebody of a seed and a subject's kind who goes by these moments, [`RATE`] of them a second, once; their clothes in
    /// light of this tint, both chroma values of grey less 128.
    pub(in crate::world) fn going(seed: u64, subject: Subject, moments: Vec<Moment>, tint: [f64; 2]) -> Self {
        let settings = RoomSettings { seed, subject, ..RoomSettings::default() };
        let (build, outfit) = person(&settings, subject, 0);
        let walker = Self::walking(&settings, build, outfit, Walk::by(moments), 0);
        Self { outfit: walker.outfit.tinted(tint), ..walker }
    }

    /// How the person stands at a time in seconds since the action began.
    pub fn pose_at(&self, time: f64) -> BodyPose {
        self.gait.pose(if self.repeats { time.rem_euclid(self.walk().duration()) } else { time })
    }
}

impl Mover for Walker {
    fn kind(&self) -> Kind {
        Kind::Person
    }

    fn walk(&self) -> &Walk {
        self.gait.walk()
    }

    fn place(&self, time: f64) -> Vector {
        self.pose_at(time).place
    }

    fn patches(&self, time: f64, view: &View) -> Vec<SkinPatch> {
        let pose = self.pose_at(time);
        let depth = view.seen(pose.pelvis)[2].max(1.0);
        // Corners of limbs must not show close up.
        let close = view.pinhole.focal / depth > 700.0;
        let detail = if close { Detail { corners: 28, steps: 5 } } else { Detail { corners: 12, steps: 2 } };
        body::patches(&pose, &self.build, &self.outfit, detail)
    }

    fn cloths(&self) -> &[Cloth] {
        &self.outfit.cloths
    }

    /// Softly all around, more where a foot stands.
    fn draw_shadow(&self, time: f64, view: &View, canvas: &mut Canvas) {
        let pose = self.pose_at(time);
        paint::shadow(pose.place, 0.75, 0.30, view, canvas);
        for leg in &pose.legs {
            let lift = (leg.ankle[1] - self.build.ankle_height).max(0.0);
            let [x, _, z] = add(leg.ankle, scale(leg.foot.ahead, 0.05));
            paint::shadow([x, 0.0, z], 0.20 + lift, 0.45 / (1.0 + 8.0 * lift), view, canvas);
        }
    }
}

#[cfg(test)]
mod tests;
